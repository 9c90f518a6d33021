//! The quality of service that publishers of a topic offered, in the form bags keep it.
//!
//! The channel record and metadata.yaml get the same value, because readers
//! that compare the two drop a topic silently when they differ. This file writes
//! the YAML of bag version 9 and also reads the integers of older versions.

use intake::yaml::{Limits, YamlError, from_str};
use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// How many samples a publisher keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum History {
    SystemDefault,
    KeepLast,
    KeepAll,
    Unknown,
}

/// Whether a publisher sends lost samples again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reliability {
    SystemDefault,
    Reliable,
    BestEffort,
    Unknown,
    BestAvailable,
}

/// Whether a publisher hands its last samples to late subscribers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Durability {
    SystemDefault,
    TransientLocal,
    Volatile,
    Unknown,
    BestAvailable,
}

/// How a publisher asserts its liveliness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Liveliness {
    SystemDefault,
    Automatic,
    ManualByTopic,
    Unknown,
    BestAvailable,
}

/// Reads an enumeration by its name (version 9) or its number (before).
macro_rules! by_name_or_number {
    ($kind:ident: $($variant:ident $name:literal $number:literal),+) => {
        impl<'de> Deserialize<'de> for $kind {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                match NameOrNumber::deserialize(deserializer)? {
                    $(NameOrNumber::Name(name) if name == $name => Ok(Self::$variant),)+
                    $(NameOrNumber::Number($number) => Ok(Self::$variant),)+
                    NameOrNumber::Name(name) => Err(D::Error::custom(format!(
                        "{} has no value \"{name}\"", stringify!($kind).to_lowercase()))),
                    NameOrNumber::Number(number) => Err(D::Error::custom(format!(
                        "{} has no value {number}", stringify!($kind).to_lowercase()))),
                }
            }
        }
    };
}

#[derive(Deserialize)]
#[serde(untagged)]
enum NameOrNumber {
    Number(u64),
    Name(String),
}

// The numbers are those of rmw/types.h.
by_name_or_number!(History: SystemDefault "system_default" 0, KeepLast "keep_last" 1,
    KeepAll "keep_all" 2, Unknown "unknown" 3);
by_name_or_number!(Reliability: SystemDefault "system_default" 0, Reliable "reliable" 1,
    BestEffort "best_effort" 2, Unknown "unknown" 3, BestAvailable "best_available" 4);
by_name_or_number!(Durability: SystemDefault "system_default" 0, TransientLocal "transient_local" 1,
    Volatile "volatile" 2, Unknown "unknown" 3, BestAvailable "best_available" 4);
by_name_or_number!(Liveliness: SystemDefault "system_default" 0, Automatic "automatic" 1,
    ManualByTopic "manual_by_topic" 3, Unknown "unknown" 4, BestAvailable "best_available" 5);

/// A span of time as QoS states it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosTime {
    /// Whole seconds.
    pub sec: u64,
    /// The remaining nanoseconds.
    pub nsec: u64,
}

impl QosTime {
    /// No limit, as ROS writes it: the largest signed 64-bit number of nanoseconds.
    pub const INFINITE: Self = Self { sec: 9_223_372_036, nsec: 854_775_807 };
}

/// What one publisher offered.
///
/// Every field is written, since `ros2 bag info` and `ros2 bag play` refuse a
/// profile that lacks one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosProfile {
    pub history: History,
    /// Samples kept; counts with [`History::KeepLast`] alone.
    pub depth: u64,
    pub reliability: Reliability,
    pub durability: Durability,
    pub deadline: QosTime,
    pub lifespan: QosTime,
    pub liveliness: Liveliness,
    pub liveliness_lease_duration: QosTime,
    pub avoid_ros_namespace_conventions: bool,
}

impl QosProfile {
    /// Reliable and volatile, the last `depth` samples: what ROS takes by default with depth 10.
    pub const fn reliable(depth: u64) -> Self {
        Self {
            history: History::KeepLast,
            depth,
            reliability: Reliability::Reliable,
            durability: Durability::Volatile,
            deadline: QosTime::INFINITE,
            lifespan: QosTime::INFINITE,
            liveliness: Liveliness::Automatic,
            liveliness_lease_duration: QosTime::INFINITE,
            avoid_ros_namespace_conventions: false,
        }
    }

    /// Reliable and transient local: late subscribers get the last `depth` samples.
    pub const fn latched(depth: u64) -> Self {
        Self { durability: Durability::TransientLocal, ..Self::reliable(depth) }
    }

    /// Best effort and volatile, as sensors publish.
    pub const fn best_effort(depth: u64) -> Self {
        Self { reliability: Reliability::BestEffort, ..Self::reliable(depth) }
    }

    /// Samples that a late subscriber gets; all of them with "keep all".
    pub(crate) fn depth_for_late_joiners(&self) -> usize {
        match (self.durability, self.history) {
            (Durability::TransientLocal, History::KeepAll) => usize::MAX,
            // Discovery does not always carry the depth; latched topics keep one.
            (Durability::TransientLocal, _) => usize::try_from(self.depth.max(1)).unwrap_or(1),
            _ => 0,
        }
    }
}

/// Writes profiles as the YAML text of a channel's `offered_qos_profiles`.
pub fn profiles_to_yaml(profiles: &[QosProfile]) -> String {
    serde_yaml::to_string(profiles).expect("profiles hold names, numbers and booleans only")
}

/// Reads the YAML text of a channel's `offered_qos_profiles`; empty text means none.
pub fn profiles_from_yaml(text: &str) -> Result<Vec<QosProfile>, YamlError> {
    if text.trim().is_empty() {
        return Ok(Vec::new());
    }
    from_str(text, &Limits::MESSAGE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_written_with_every_key_in_the_words_of_version_9() {
        let expected = "\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: automatic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
";
        assert_eq!(profiles_to_yaml(&[QosProfile::latched(1)]), expected);
    }

    #[test]
    fn what_is_written_reads_back_the_same() {
        let profiles = [QosProfile::best_effort(5), QosProfile::latched(1)];
        assert_eq!(profiles_from_yaml(&profiles_to_yaml(&profiles)).unwrap(), profiles);
        assert_eq!(profiles_from_yaml("").unwrap(), []);
        assert_eq!(profiles_from_yaml(&profiles_to_yaml(&[])).unwrap(), []);
    }

    #[test]
    fn the_numbers_of_older_bags_are_understood() {
        let text = "- {history: 1, depth: 1, reliability: 1, durability: 1, \
            deadline: {sec: 9223372036, nsec: 854775807}, \
            lifespan: {sec: 9223372036, nsec: 854775807}, liveliness: 1, \
            liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}, \
            avoid_ros_namespace_conventions: false}";
        assert_eq!(profiles_from_yaml(text).unwrap(), [QosProfile::latched(1)]);
    }

    #[test]
    fn an_unknown_word_is_named_in_the_error() {
        let text = profiles_to_yaml(&[QosProfile::reliable(1)]).replace("keep_last", "keep_most");
        let error = profiles_from_yaml(&text).unwrap_err().to_string();
        assert!(error.contains("keep_most"), "{error}");
    }
}
