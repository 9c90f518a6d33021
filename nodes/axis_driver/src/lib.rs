//! Compensated path to motion controller, over a serial line.
