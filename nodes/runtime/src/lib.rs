//! The shell all nodes share; the only crate that knows ros2-client.
