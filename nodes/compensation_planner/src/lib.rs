//! Programmed contour and tool table to compensated path.
