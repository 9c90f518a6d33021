pub mod constant;
pub mod this_host;
pub mod udp_listener;
pub mod udp_sender;
pub mod util;
