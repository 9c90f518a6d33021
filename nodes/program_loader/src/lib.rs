//! Part program text to programmed contour.
