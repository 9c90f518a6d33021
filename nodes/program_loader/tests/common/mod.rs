//! The control profiles as they are shipped.

use cnc_msgs::profile::Profile;
use std::path::Path;

/// `rs274`, `masso`, `sinumerik_840c`.
pub(crate) fn profile(name: &str) -> Profile {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../config/controls")
        .join(format!("{name}.yaml"));
    let text = std::fs::read_to_string(&path).expect("a shipped profile");
    serde_yaml::from_str(&text).expect("a valid profile")
}
