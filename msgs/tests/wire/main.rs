//! The contract on the wire: what the interface files say is what is sent,
//! hashed and written into bags, and what ROS 2 says of the same files.

mod cdr;
mod generator;
mod hashes;
mod refusals;
mod ros_package;
mod schemas;
mod structs;
