//! The path watch of the driver: every damage that takes the tool off its path is held within
//! one report interval, and nothing is held where nothing is wrong. All in virtual time, with
//! the virtual controller's own count of where its axes are.

mod certified;
mod damaged;
mod echo;
mod named;
mod parts;
mod rig;
mod sound;
mod turning;
