//! Workarounds for faults of the DDS layer, one file for each, and what our copy of it is asked for.
//!
//! Uses `process` and `parameters`. Belongs here: code that can be removed when RustDDS or
//! ros2-client is mended. Each file but `dds_watch` and `memory_bound`, which guard against defects
//! in general, names its page in `docs/upstream/`, whose table says what may go then. Does not belong here: what every DDS layer would need (`endpoints`).

pub(crate) mod dds_watch;
pub(crate) mod dropped_publishers;
pub(crate) mod memory_bound;
pub(crate) mod padded;
pub(crate) mod received;
pub(crate) mod type_hashes;
