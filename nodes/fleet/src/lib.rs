//! The bags of many machines: kept in a store, asked, and replayed by workers that know of no other.
//!
//! Nothing here distributes work. A store keeps objects, whatever runs array jobs starts workers, and
//! Parquet files are for anybody's engine.
//!
//! - `core/` decides: keys, rows, shards, conditions, what is still to do, what a report says, which commit
//!   is tried next. It knows no file, clock or store
//! - `table`: rows as Parquet

pub mod core;
pub mod error;
pub mod table;

pub use error::FleetError;
