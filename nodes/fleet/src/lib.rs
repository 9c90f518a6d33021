//! The bags of many machines: kept in a store, asked, and replayed by workers that know of no other.
//!
//! Nothing here distributes work. A store keeps objects, whatever runs array jobs starts workers, and
//! Parquet files are for anybody's engine.
//!
//! - `core/` decides: keys, rows, shards, conditions, what is still to do, what a report says, which commit
//!   is tried next. It knows no file, clock or store
//! - `table`: rows as Parquet; `store`: objects, tried again when a request fails
//! - `bag_file`: a bag as one file; `facts`: its row; `push`: bags into the store; `spool`: bags that wait for it
//! - `dataset`: index and verdicts of a store; `worker` and `journal`: one shard
//! - `report`, `page` and `pages`: what came out; `bisect`: which commit did it

pub mod bag_file;
pub mod bisect;
pub mod core;
pub mod dataset;
pub mod error;
pub mod facts;
pub mod journal;
pub mod page;
pub mod pages;
pub mod push;
pub mod report;
pub mod spool;
pub mod store;
pub mod table;
pub mod worker;

pub use error::FleetError;
