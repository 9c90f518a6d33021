//! What the cores make, as messages and as a bag.

use super::ReplayError;
use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use run_recorder::bag_writer::{BagWriteError, BagWriter, ChannelSpec};
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// One message that a core made.
#[derive(Debug, Clone)]
pub struct CoreOutput {
    pub topic: &'static str,
    pub type_name: &'static str,
    /// Recording time of the message that it corresponds to.
    pub log_time_ns: u64,
    pub data: Vec<u8>,
}

impl CoreOutput {
    pub fn new<M: Message>(topic: &'static str, log_time_ns: u64, message: &M) -> Self {
        Self { topic, type_name: M::TYPE_NAME, log_time_ns, data: cdr::encapsulated(message) }
    }
}

/// The name of a bag; the name of its folder may contain dots.
pub fn name_of(bag: &Path) -> String {
    // `.` has no name of its own.
    let real = if bag.file_name().is_none() { bag.canonicalize().ok() } else { None };
    let bag = real.as_deref().unwrap_or(bag);
    let name = if bag.is_dir() { bag.file_name() } else { bag.file_stem() };
    name.unwrap_or("bag".as_ref()).to_string_lossy().into_owned()
}

/// The output file for a bag.
fn target(directory: &Path, bag: &Path) -> PathBuf {
    directory.join(format!("{}.mcap", name_of(bag)))
}

/// Checks, before anything is replayed, that no output file exists yet.
pub fn must_be_free(directory: &Path, bags: &[PathBuf]) -> Result<(), ReplayError> {
    let mut taken: BTreeMap<PathBuf, &Path> = BTreeMap::new();
    for bag in bags {
        let file = target(directory, bag);
        if fs::symlink_metadata(&file).is_ok() {
            return Err(ReplayError::OutputTaken { file });
        }
        if let Some(other) = taken.get(&file) {
            let (one, other) = (other.to_path_buf(), bag.clone());
            return Err(ReplayError::OutputTwice { file, one, other });
        }
        taken.insert(file, bag);
    }
    Ok(())
}

/// Writes the outputs as a new bag file, by time; equal outputs give equal bytes.
pub fn write(directory: &Path, bag: &Path, outputs: &[CoreOutput]) -> Result<(), ReplayError> {
    let name = name_of(bag);
    fs::create_dir_all(directory).map_err(BagWriteError::Io)?;
    let path = target(directory, bag);
    // Never overwrites a file that was made in the meantime.
    let file = fs::File::create_new(&path).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => ReplayError::OutputTaken { file: path },
        _ => BagWriteError::Io(error).into(),
    })?;
    let mut writer = BagWriter::new(std::io::BufWriter::new(file))?;
    let mut channels = BTreeMap::new();
    let mut in_order: Vec<&CoreOutput> = outputs.iter().collect();
    in_order.sort_by_key(|output| output.log_time_ns);
    for output in in_order {
        let channel = match channels.get(output.topic) {
            Some(&channel) => channel,
            None => {
                let info = cnc_msgs::schema::lookup(output.type_name)
                    .expect("every output is a message of ours");
                let channel = writer.add_channel(&ChannelSpec {
                    topic: format!("/{}", output.topic),
                    type_name: output.type_name.to_owned(),
                    schema_text: info.schema_text.to_owned(),
                    type_hash: info.rihs01.to_owned(),
                    qos: Vec::new(),
                })?;
                channels.insert(output.topic, channel);
                channel
            }
        };
        writer.write(channel, output.log_time_ns, output.log_time_ns, &output.data)?;
    }
    writer.finish(&format!("{name}.mcap"), &BTreeMap::new())?;
    Ok(())
}
