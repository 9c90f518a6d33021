//! The shipped control profiles.

use cnc_msgs::profile::Profile;

/// `rs274`, `masso`, `sinumerik_840c`.
pub(crate) fn profile(name: &str) -> Profile {
    settings::load_profile(name).expect("a shipped profile")
}
