//! metadata.yaml of a bag directory, version 9, as `ros2 bag` of Jazzy writes it.
//!
//! This file knows the form; the figures come from [`BagSummary`], which the
//! writer and the reader both make. Writing the file is for [`crate::files`].

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::qos::QosProfile;

/// The version of the form written here.
const VERSION: u32 = 9;
/// The ROS distribution whose tools define this form.
const ROS_DISTRO: &str = "jazzy";

/// One topic of a bag and what is known of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicSummary {
    /// Full name, with the leading slash.
    pub topic: String,
    /// `package/msg/Type`.
    pub type_name: String,
    /// `RIHS01_` and 64 digits, empty if not known.
    pub type_hash: String,
    /// What its publishers offered.
    pub qos: Vec<QosProfile>,
    /// Messages in the bag.
    pub message_count: u64,
}

/// The figures of a bag's one file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct BagSummary {
    /// By channel, in the order they were added.
    pub topics: Vec<TopicSummary>,
    /// Messages of all topics.
    pub message_count: u64,
    /// First and last log time, nanoseconds since the epoch; `None` without messages.
    pub time_range_ns: Option<(u64, u64)>,
}

impl BagSummary {
    /// Time between the first and the last message, nanoseconds.
    pub fn duration_ns(&self) -> u64 {
        self.time_range_ns.map_or(0, |(start, end)| end - start)
    }
}

/// Writes metadata.yaml.
///
/// `file_name` is the bag's file beside it, `custom_data` free keys and values
/// (run id, program checksum).
pub fn metadata_yaml(
    summary: &BagSummary,
    file_name: &str,
    custom_data: &BTreeMap<String, String>,
) -> String {
    let information = Information::new(summary, file_name, custom_data);
    serde_yaml::to_string(&MetadataFile { information })
        .expect("metadata holds text and numbers only")
}

/// Writes the value of `serialized_metadata` of the `rosbag2` metadata record:
/// the same without the outermost key.
pub fn serialized_metadata(
    summary: &BagSummary,
    file_name: &str,
    custom_data: &BTreeMap<String, String>,
) -> String {
    serde_yaml::to_string(&Information::new(summary, file_name, custom_data))
        .expect("metadata holds text and numbers only")
}

/// Reads the names of a bag's files out of metadata.yaml, in their order.
pub fn file_names(text: &str) -> Result<Vec<String>, serde_yaml::Error> {
    let file: FileList = serde_yaml::from_str(text)?;
    Ok(file.information.relative_file_paths)
}

#[derive(Deserialize)]
struct FileList {
    #[serde(rename = "rosbag2_bagfile_information")]
    information: RelativePaths,
}

#[derive(Deserialize)]
struct RelativePaths {
    relative_file_paths: Vec<String>,
}

#[derive(Serialize)]
struct MetadataFile<'a> {
    #[serde(rename = "rosbag2_bagfile_information")]
    information: Information<'a>,
}

#[derive(Serialize)]
struct Information<'a> {
    version: u32,
    storage_identifier: &'static str,
    duration: Nanoseconds,
    starting_time: SinceEpoch,
    message_count: u64,
    topics_with_message_count: Vec<TopicWithCount<'a>>,
    compression_format: &'static str,
    compression_mode: &'static str,
    relative_file_paths: [&'a str; 1],
    files: [FileInformation<'a>; 1],
    // Nothing rather than an empty map, as rosbag2 does.
    custom_data: Option<&'a BTreeMap<String, String>>,
    ros_distro: &'static str,
}

#[derive(Serialize, Clone, Copy)]
struct Nanoseconds {
    nanoseconds: u64,
}

#[derive(Serialize, Clone, Copy)]
struct SinceEpoch {
    nanoseconds_since_epoch: u64,
}

#[derive(Serialize)]
struct TopicWithCount<'a> {
    topic_metadata: TopicMetadata<'a>,
    message_count: u64,
}

#[derive(Serialize)]
struct TopicMetadata<'a> {
    name: &'a str,
    #[serde(rename = "type")]
    type_name: &'a str,
    serialization_format: &'static str,
    offered_qos_profiles: &'a [QosProfile],
    type_description_hash: &'a str,
}

#[derive(Serialize)]
struct FileInformation<'a> {
    path: &'a str,
    starting_time: SinceEpoch,
    duration: Nanoseconds,
    message_count: u64,
}

impl<'a> Information<'a> {
    fn new(
        summary: &'a BagSummary,
        file_name: &'a str,
        custom_data: &'a BTreeMap<String, String>,
    ) -> Self {
        let starting_time = SinceEpoch {
            nanoseconds_since_epoch: summary.time_range_ns.map_or(0, |(start, _)| start),
        };
        let duration = Nanoseconds { nanoseconds: summary.duration_ns() };
        let topics = summary.topics.iter().map(|topic| TopicWithCount {
            topic_metadata: TopicMetadata {
                name: &topic.topic,
                type_name: &topic.type_name,
                serialization_format: "cdr",
                offered_qos_profiles: &topic.qos,
                type_description_hash: &topic.type_hash,
            },
            message_count: topic.message_count,
        });
        Self {
            version: VERSION,
            storage_identifier: "mcap",
            duration,
            starting_time,
            message_count: summary.message_count,
            topics_with_message_count: topics.collect(),
            // Chunks are compressed inside the container, which is not what these two mean.
            compression_format: "",
            compression_mode: "",
            relative_file_paths: [file_name],
            files: [FileInformation {
                path: file_name,
                starting_time,
                duration,
                message_count: summary.message_count,
            }],
            custom_data: (!custom_data.is_empty()).then_some(custom_data),
            ros_distro: ROS_DISTRO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary() -> BagSummary {
        BagSummary {
            topics: vec![TopicSummary {
                topic: "/mill/program".into(),
                type_name: "std_msgs/msg/String".into(),
                type_hash: "RIHS01_00".into(),
                qos: vec![QosProfile::latched(1)],
                message_count: 3,
            }],
            message_count: 3,
            time_range_ns: Some((1_000, 4_500)),
        }
    }

    #[test]
    fn metadata_has_the_keys_and_the_order_of_version_9() {
        let custom = BTreeMap::from([("run_id".to_owned(), "r7".to_owned())]);
        let text = metadata_yaml(&summary(), "r7_0.mcap", &custom);
        let expected = "\
rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  duration:
    nanoseconds: 3500
  starting_time:
    nanoseconds_since_epoch: 1000
  message_count: 3
  topics_with_message_count:
  - topic_metadata:
      name: /mill/program
      type: std_msgs/msg/String
      serialization_format: cdr
      offered_qos_profiles:
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
      type_description_hash: RIHS01_00
    message_count: 3
  compression_format: ''
  compression_mode: ''
  relative_file_paths:
  - r7_0.mcap
  files:
  - path: r7_0.mcap
    starting_time:
      nanoseconds_since_epoch: 1000
    duration:
      nanoseconds: 3500
    message_count: 3
  custom_data:
    run_id: r7
  ros_distro: jazzy
";
        assert_eq!(text, expected);
        assert_eq!(file_names(&text).unwrap(), ["r7_0.mcap"]);
    }

    #[test]
    fn the_metadata_record_holds_the_same_without_the_outermost_key() {
        let text = serialized_metadata(&summary(), "r7_0.mcap", &BTreeMap::new());
        assert!(text.starts_with("version: 9\n"), "{text}");
        assert!(text.contains("custom_data: null\n"), "{text}");
    }

    #[test]
    fn a_bag_without_messages_has_duration_zero() {
        let text = metadata_yaml(&BagSummary::default(), "a_0.mcap", &BTreeMap::new());
        assert!(text.contains("duration:\n    nanoseconds: 0"), "{text}");
    }
}
