//! The contract on the wire: what is sent, hashed and written into bags is what the
//! interface files say, and what ROS 2 says about the same files.

mod cdr;
mod generator;
mod hashes;
mod refusals;
mod ros_package;
mod schemas;
mod structs;
