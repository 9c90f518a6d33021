//! A grbl 1.1 controller with axes that move in time, on a pseudo-terminal.
