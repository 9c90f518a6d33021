//! metadata.yaml of a bag directory, version 9, as `ros2 bag` of Jazzy writes it.
//!
//! This file knows the format. The figures come from [`BagSummary`], which both the
//! writer and the reader make. [`crate::files`] writes the file.

use intake::yaml::{Limits, YamlError, from_str};
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::qos::QosProfile;
use crate::verify::Facts;

/// The version of the format written here.
const VERSION: u32 = 9;
/// The ROS distribution whose tools define this format.
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

/// The figures of a bag, or of one of its files.
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
    /// The figures of a bag by those of its files.
    pub fn of_files(files: &[FileSummary]) -> Self {
        let mut total = Self::default();
        for FileSummary { summary, .. } in files {
            total.message_count += summary.message_count;
            for topic in &summary.topics {
                match total.topics.iter_mut().find(|known| known.topic == topic.topic) {
                    Some(known) => known.message_count += topic.message_count,
                    None => total.topics.push(topic.clone()),
                }
            }
            total.time_range_ns = match (total.time_range_ns, summary.time_range_ns) {
                (Some((start, end)), Some((first, last))) => {
                    Some((start.min(first), end.max(last)))
                }
                (range, None) | (None, range) => range,
            };
        }
        total
    }

    /// Time between the first and the last message, nanoseconds.
    pub fn duration_ns(&self) -> u64 {
        self.time_range_ns.map_or(0, |(start, end)| end - start)
    }
}

/// One file of a bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileSummary {
    /// Its name in the directory of metadata.yaml.
    pub name: String,
    pub summary: BagSummary,
}

/// Writes metadata.yaml of a bag of one file.
///
/// `file_name` is the bag's file next to it, `custom_data` free keys and values
/// (run id, program checksum).
pub fn metadata_yaml(
    summary: &BagSummary,
    file_name: &str,
    custom_data: &BTreeMap<String, String>,
) -> String {
    let file = FileSummary { name: file_name.to_owned(), summary: summary.clone() };
    metadata_yaml_of_files(&[file], custom_data)
}

/// Writes metadata.yaml of a bag of several files, which are listed in their order.
///
/// The counts include the messages that a file repeats from earlier ones.
pub fn metadata_yaml_of_files(
    files: &[FileSummary],
    custom_data: &BTreeMap<String, String>,
) -> String {
    let total = BagSummary::of_files(files);
    let information = Information::new(&total, files, custom_data);
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
    let file = FileSummary { name: file_name.to_owned(), summary: summary.clone() };
    serde_yaml::to_string(&Information::new(summary, &[file], custom_data))
        .expect("metadata holds text and numbers only")
}

/// Reads the names of a bag's files out of metadata.yaml, in their order.
pub fn file_names(text: &str) -> Result<Vec<String>, YamlError> {
    let file: FileList = from_str(text, &Limits::FILE)?;
    Ok(file.information.relative_file_paths)
}

/// Reads the free keys and values out of metadata.yaml.
pub fn custom_data(text: &str) -> Result<BTreeMap<String, String>, YamlError> {
    let file: OwnData = from_str(text, &Limits::FILE)?;
    Ok(file.information.custom_data.unwrap_or_default())
}

/// The figures in metadata.yaml or in the record of rosbag2, as far as they are there.
#[derive(Debug, Default, Deserialize)]
pub(crate) struct Claims {
    #[serde(default)]
    message_count: Option<u64>,
    #[serde(default)]
    starting_time: Option<SinceEpoch>,
    #[serde(default)]
    duration: Option<Nanoseconds>,
    #[serde(default)]
    topics_with_message_count: Option<Vec<TopicClaim>>,
    #[serde(default)]
    files: Option<Vec<FileClaim>>,
}

#[derive(Debug, Deserialize)]
struct TopicClaim {
    topic_metadata: TopicName,
    message_count: u64,
}

#[derive(Debug, Deserialize)]
struct TopicName {
    name: String,
}

#[derive(Debug, Deserialize)]
struct FileClaim {
    path: String,
    message_count: u64,
}

#[cfg(feature = "std-fs")]
#[derive(Deserialize)]
struct ClaimsFile {
    #[serde(rename = "rosbag2_bagfile_information")]
    information: Claims,
}

impl Claims {
    /// Of metadata.yaml.
    #[cfg(feature = "std-fs")]
    pub(crate) fn of_file(text: &str) -> Result<Self, YamlError> {
        Ok(from_str::<ClaimsFile>(text, &Limits::FILE)?.information)
    }

    /// Of the record, which has no outermost key.
    pub(crate) fn of_record(text: &str) -> Result<Self, YamlError> {
        from_str(text, &Limits::FILE)
    }

    /// The differences from the files of the bag, a clause each.
    pub(crate) fn differences(&self, files: &[&Facts]) -> Vec<String> {
        let mut wrong = Vec::new();
        let mut compare = |what: &str, stated: Option<u64>, found: u64| {
            if let Some(stated) = stated.filter(|stated| *stated != found) {
                wrong.push(format!("{stated} {what}, and there are {found}"));
            }
        };
        compare("messages", self.message_count, files.iter().map(|it| it.message_count).sum());
        // Other recorders round them, or use another clock.
        if files.iter().all(|it| it.is_ours) {
            let start = files.iter().filter_map(|it| it.range_ns).map(|(start, _)| start).min();
            let end = files.iter().filter_map(|it| it.range_ns).map(|(_, end)| end).max();
            let (start, end) = (start.unwrap_or(0), end.unwrap_or(0));
            let stated = self.starting_time.map(|it| it.nanoseconds_since_epoch);
            compare("ns at the first message", stated, start);
            let stated = self.duration.map(|it| it.nanoseconds);
            compare("ns from the first to the last message", stated, end.saturating_sub(start));
        }
        let count_of =
            |topic: &str| -> u64 { files.iter().filter_map(|it| it.counts.get(topic)).sum() };
        if let Some(topics) = &self.topics_with_message_count {
            for topic in topics {
                let name = &topic.topic_metadata.name;
                compare(&format!("messages on {name}"), Some(topic.message_count), count_of(name));
            }
            let names = files.iter().flat_map(|it| it.counts.keys());
            let names: std::collections::BTreeSet<_> = names.collect();
            let is_listed = |name: &str| topics.iter().any(|it| it.topic_metadata.name == name);
            for name in names.into_iter().filter(|name| !is_listed(name)) {
                compare(&format!("messages on {name}"), Some(0), count_of(name));
            }
        }
        let listed = self.files.iter().filter(|listed| listed.len() == files.len()).flatten();
        for (listed, found) in listed.zip(files) {
            let what = format!("messages in {}", listed.path);
            compare(&what, Some(listed.message_count), found.message_count);
        }
        wrong
    }
}

#[derive(Deserialize)]
struct OwnData {
    #[serde(rename = "rosbag2_bagfile_information")]
    information: CustomData,
}

#[derive(Deserialize)]
struct CustomData {
    #[serde(default)]
    custom_data: Option<BTreeMap<String, String>>,
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
    relative_file_paths: Vec<&'a str>,
    files: Vec<FileInformation<'a>>,
    // Left out instead of an empty map, as in rosbag2.
    custom_data: Option<&'a BTreeMap<String, String>>,
    ros_distro: &'static str,
}

#[derive(Debug, Serialize, Deserialize, Clone, Copy)]
struct Nanoseconds {
    nanoseconds: u64,
}

#[derive(Debug, Serialize, Deserialize, Clone, Copy)]
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
        files: &'a [FileSummary],
        custom_data: &'a BTreeMap<String, String>,
    ) -> Self {
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
            duration: duration(summary),
            starting_time: starting_time(summary),
            message_count: summary.message_count,
            topics_with_message_count: topics.collect(),
            // These two do not mean the compression of chunks inside the container.
            compression_format: "",
            compression_mode: "",
            relative_file_paths: files.iter().map(|file| file.name.as_str()).collect(),
            files: files
                .iter()
                .map(|FileSummary { name, summary }| FileInformation {
                    path: name,
                    starting_time: starting_time(summary),
                    duration: duration(summary),
                    message_count: summary.message_count,
                })
                .collect(),
            custom_data: (!custom_data.is_empty()).then_some(custom_data),
            ros_distro: ROS_DISTRO,
        }
    }
}

fn starting_time(summary: &BagSummary) -> SinceEpoch {
    SinceEpoch { nanoseconds_since_epoch: summary.time_range_ns.map_or(0, |(start, _)| start) }
}

fn duration(summary: &BagSummary) -> Nanoseconds {
    Nanoseconds { nanoseconds: summary.duration_ns() }
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
    fn a_bag_of_several_files_lists_each_with_its_own_figures() {
        let mut second = summary();
        second.time_range_ns = Some((4_000, 9_000));
        second
            .topics
            .push(TopicSummary { topic: "/mill/late".into(), ..summary().topics[0].clone() });
        let empty = BagSummary::default();
        let files = [("r_0.mcap", summary()), ("r_1.mcap", second), ("r_2.mcap", empty)]
            .map(|(name, summary)| FileSummary { name: name.into(), summary });
        let total = BagSummary::of_files(&files);
        assert_eq!((total.message_count, total.time_range_ns), (6, Some((1_000, 9_000))));
        let counts: Vec<_> =
            total.topics.iter().map(|topic| (topic.topic.as_str(), topic.message_count)).collect();
        assert_eq!(counts, [("/mill/program", 6), ("/mill/late", 3)]);
        let text = metadata_yaml_of_files(&files, &BTreeMap::new());
        let listed = "\
  relative_file_paths:
  - r_0.mcap
  - r_1.mcap
  - r_2.mcap
  files:
  - path: r_0.mcap
    starting_time:
      nanoseconds_since_epoch: 1000
    duration:
      nanoseconds: 3500
    message_count: 3
  - path: r_1.mcap
    starting_time:
      nanoseconds_since_epoch: 4000
    duration:
      nanoseconds: 5000
    message_count: 3
  - path: r_2.mcap
";
        assert!(text.contains(listed), "{text}");
        assert_eq!(file_names(&text).unwrap(), ["r_0.mcap", "r_1.mcap", "r_2.mcap"]);
    }

    #[test]
    fn a_bag_without_messages_has_duration_zero() {
        let text = metadata_yaml(&BagSummary::default(), "a_0.mcap", &BTreeMap::new());
        assert!(text.contains("duration:\n    nanoseconds: 0"), "{text}");
    }
}
