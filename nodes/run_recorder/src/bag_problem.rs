//! Problems of bags: why a bag cannot be opened, and what is missing from one that can.
//!
//! Positions are bytes from the beginning of the named file.

use std::io;

/// Why a bag cannot be read at all.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    #[error("{path} does not exist")]
    Missing { path: String },
    #[error("{path} is neither a bag directory nor an .mcap file")]
    NoPath { path: String },
    #[error("{directory} holds no .mcap file, so it is not a bag")]
    EmptyDirectory { directory: String },
    #[error("{directory}/metadata.yaml names {file}, which does not exist")]
    MissingFile { directory: String, file: String },
    #[error("{directory}/metadata.yaml cannot be read, and no .mcap file is next to it: {why}")]
    Metadata { directory: String, why: String },
    #[error("{file} is empty (0 bytes); the recorder died before it wrote anything")]
    ZeroLength { file: String },
    #[error("{file} is not a bag (MCAP file)")]
    NotABag { file: String },
    #[error("{file} ends at byte {length}, before its header; nothing in it can be read")]
    NoHeader { file: String, length: u64 },
    #[error("{file} has the profile \"{profile}\"; only bags of profile \"ros2\" can be read")]
    WrongProfile { file: String, profile: String },
    #[error("reading {file} failed: {cause}")]
    Io { file: String, cause: io::Error },
}

/// What is wrong with a bag that can be read in part.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    #[error("there is no metadata.yaml: the recorder did not finish")]
    NoMetadataFile,
    #[error("{directory}/metadata.yaml cannot be read, so all files next to it are: {why}")]
    MetadataFile { directory: String, why: String },
    #[error("{directory}/metadata.yaml names {file}, which does not exist")]
    FileMissing { directory: String, file: String },
    #[error("{directory}/metadata.yaml does not name {file}, which is read all the same")]
    FileNotListed { directory: String, file: String },
    #[error("a file of the bag is left out: {why}")]
    FileUnreadable { why: String },
    #[error("{file} is part {part} of a bag, where part {expected} should come; it is not here")]
    PartMissing { file: String, part: u64, expected: u64 },
    #[error("{file} is part {part} of a bag, and not the last; what came after it is not here")]
    LastPartMissing { file: String, part: u64 },
    #[error(
        "{file} ends at byte {length} without a footer; its last whole record ends at byte {at}"
    )]
    Truncated { file: String, at: u64, length: u64 },
    #[error(
        "{file}: the record at byte {at} claims {claimed} bytes, {available} follow; nothing after it can be read"
    )]
    CutRecord { file: String, at: u64, claimed: u64, available: u64 },
    #[error("{file}: the chunk at byte {at} is damaged: {why}; its messages are left out")]
    DamagedChunk { file: String, at: u64, why: String },
    #[error("{file}: the record at byte {at} is damaged: {why}")]
    DamagedRecord { file: String, at: u64, why: String },
    #[error("{file}: the record at byte {at} is damaged, and no message with it: {why}")]
    DamagedIndex { file: String, at: u64, why: String },
    #[error(
        "{file}: `ros2 bag play` would play nothing of it: the chunk at byte {at} has no messages and is the first; `kerf bag recover` makes a copy that plays"
    )]
    NotPlayable { file: String, at: u64 },
    #[error("{directory}/metadata.yaml says {why}")]
    MetadataDiffers { directory: String, why: String },
    #[error("topic {topic} has no schema, so its messages cannot be decoded")]
    SchemaMissing { topic: String },
    #[error(
        "{file}: a message at byte {at} is of channel {channel}, which is not defined; left out"
    )]
    UnknownChannel { file: String, at: u64, channel: u16 },
    #[error("{file}: there is data after the footer at byte {at}")]
    AfterFooter { file: String, at: u64 },
    #[error("the index promises {promised} messages, {found} can be read")]
    MessagesMissing { promised: u64, found: u64 },
    #[error(
        "{topic} has {found} messages, and the recorder wrote {written}: the bag was changed; replay the recording as it was"
    )]
    MessagesChanged { topic: String, written: u64, found: u64 },
    #[error(
        "from {log_time_ns} ns on messages come out of order: chunks overlap by more than the window, or state wrong times"
    )]
    OrderNotKept { log_time_ns: u64 },
    #[error("the recorder says that it is not complete: {reason}")]
    RecorderSays { reason: String },
}

impl Problem {
    /// Whether the files were damaged or changed; otherwise the recording itself is incomplete.
    pub fn is_damage(&self) -> bool {
        match self {
            Self::MetadataFile { .. }
            | Self::FileMissing { .. }
            | Self::FileUnreadable { .. }
            | Self::PartMissing { .. }
            | Self::LastPartMissing { .. }
            | Self::Truncated { .. }
            | Self::CutRecord { .. }
            | Self::DamagedChunk { .. }
            | Self::DamagedRecord { .. }
            | Self::DamagedIndex { .. }
            | Self::MetadataDiffers { .. }
            | Self::UnknownChannel { .. }
            | Self::AfterFooter { .. }
            | Self::MessagesMissing { .. }
            | Self::MessagesChanged { .. } => true,
            Self::NoMetadataFile
            | Self::FileNotListed { .. }
            | Self::NotPlayable { .. }
            | Self::SchemaMissing { .. }
            | Self::OrderNotKept { .. }
            | Self::RecorderSays { .. } => false,
        }
    }

    /// Whether only redundant data is damaged: no message is lost, and a copy is complete.
    pub fn is_of_index(&self) -> bool {
        matches!(
            self,
            Self::DamagedIndex { .. } | Self::MetadataDiffers { .. } | Self::NotPlayable { .. }
        )
    }

    /// Whether the bag is complete in spite of it: only other programs cannot read it.
    pub fn is_of_players(&self) -> bool {
        matches!(self, Self::NotPlayable { .. })
    }
}
