//! The parameters of the recorder.

use crate::retention::RetentionLimits;
use crate::run_bag::SplitLimits;
use runtime::parameters::ParameterValue;
use runtime::{Declared, Handle};
use std::path::PathBuf;
use std::time::Duration;

const MB: u64 = 1_000_000;
/// The largest split limits, MB and seconds: as good as no limit.
const SPLIT_SIZE_MB_MAX: i64 = 1_000_000;
const SPLIT_DURATION_S_MAX: i64 = 365 * 86_400;
const GB: u64 = 1_000_000_000;
/// A century, and more than any disk.
const KEEP_DAYS_MAX: i64 = 36_525;
const KEEP_GB_MAX: i64 = 1_000_000;

/// The node's parameters.
pub(super) fn declared() -> Vec<Declared> {
    vec![
        Declared::new(
            "directory",
            "kerf-bags",
            "folder for bags; each run gets a directory of its own; from the next run on",
        ),
        Declared::new(
            "extra_topics",
            ["/tf", "/tf_static", "/rosout", "/diagnostics", "/parameter_events"]
                .map(String::from)
                .to_vec(),
            "absolute names of topics that are recorded besides those of this namespace",
        )
        .read_only(),
        Declared::new(
            "include_action_feedback",
            false,
            "whether feedback of actions is recorded; not every reader of bags knows its types",
        )
        .read_only(),
        Declared::new(
            "split_size_mb",
            0,
            "size at which a bag continues in another file, MB; 0: never; from the next run on",
        )
        .integer_within(0, SPLIT_SIZE_MB_MAX),
        Declared::new(
            "split_duration_s",
            0,
            "time after which a bag continues in another file, s; 0: never; from the next run on",
        )
        .integer_within(0, SPLIT_DURATION_S_MAX),
        Declared::new("keep_days", 0, "days for which unmarked bags are kept; 0: for ever")
            .integer_within(0, KEEP_DAYS_MAX),
        Declared::new(
            "keep_gb",
            0,
            "space that unmarked bags may take, GB; the oldest are removed; 0: no limit",
        )
        .integer_within(0, KEEP_GB_MAX),
        Declared::new(
            "fleet_store",
            "",
            "store that is given each bag, by kerf-fleet: a folder, file:///FOLDER or s3://BUCKET/PREFIX; empty: none",
        ),
    ]
}

/// Where bags go from now on.
pub(super) fn directory(node: &Handle) -> PathBuf {
    let given = PathBuf::from(node.parameter::<String>("directory"));
    // Only an empty path, or a working directory that is gone, has no absolute one.
    std::path::absolute(&given).unwrap_or(given)
}

/// Refuses a folder in which no bag can be made.
pub(super) fn guard(node: &Handle) {
    node.guard_parameters(|changes| {
        for (name, value) in changes {
            if let ("directory", ParameterValue::String(path)) = (name.as_str(), value) {
                std::fs::create_dir_all(path)
                    .map_err(|error| format!("cannot make the directory {path}: {error}"))?;
            }
        }
        Ok(())
    });
}

/// When a new bag is split into another file.
pub(super) fn split(node: &Handle) -> SplitLimits {
    SplitLimits {
        size: unsigned(node, "split_size_mb").saturating_mul(MB),
        duration: Duration::from_secs(unsigned(node, "split_duration_s")),
    }
}

/// Which old bags are kept.
pub(super) fn keep(node: &Handle) -> RetentionLimits {
    RetentionLimits {
        days: u32::try_from(unsigned(node, "keep_days")).unwrap_or(u32::MAX),
        bytes: unsigned(node, "keep_gb").saturating_mul(GB),
    }
}

/// The range keeps it from being negative.
fn unsigned(node: &Handle, name: &str) -> u64 {
    u64::try_from(node.parameter::<i64>(name)).unwrap_or(0)
}
