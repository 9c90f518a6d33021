//! What travels, whatever carries it: samples, addresses of endpoints, qualities of service.
//!
//! Pure; uses `process`. Belongs here: what every middleware has. Does not belong here: how one of
//! them says it (`rustdds`, `zenoh`), and how endpoints are made (`endpoints`).

pub(crate) mod gid;
pub(crate) mod qos;
pub(crate) mod sample;
pub(crate) mod type_names;
