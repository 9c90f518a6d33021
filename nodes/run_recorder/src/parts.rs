//! The files of a bag while it is written: one after the other, each complete by itself.
//!
//! A full file gets its index and footer and is synced to the disk before the next
//! one is written, so that later errors cannot damage it. [`crate::split`] decides when
//! a file is full, and [`crate::write_thread`] what is written and when it is flushed.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::bag_reader::{RESULT_RECORD, RUN_RECORD};
use crate::bag_writer::{BagAttachment, BagWriteError, BagWriter, ChannelIndex, ChannelSpec};
use crate::closing::Closing;
use crate::metadata::FileSummary;
use crate::records::FRAME;
use crate::run_bag::RunBagOptions;
use crate::scan::MESSAGE_HEAD;
use crate::split::{LatchedMessages, PART_KEY, PART_RECORD};

/// Bytes of a message in a chunk besides its data.
const MESSAGE_OVERHEAD: u64 = (FRAME + MESSAGE_HEAD) as u64;

/// A new file.
pub(crate) struct PartFile {
    pub(crate) name: String,
    pub(crate) sink: Box<dyn Write + Send>,
    /// Syncs flushed data to the disk.
    pub(crate) sync: Box<dyn Fn() -> io::Result<()> + Send>,
}

/// All files of a bag that is closed.
pub(crate) struct Finished {
    pub(crate) files: Vec<FileSummary>,
    /// Keeps the lock of the last file; each file is locked while it is written.
    pub(crate) is_ours: Box<dyn Fn() -> io::Result<()> + Send>,
}

/// The files to write to.
pub(crate) struct Outlet {
    pub(crate) directory: PathBuf,
    pub(crate) first: PartFile,
    /// Makes the file of this number.
    pub(crate) next: Box<dyn FnMut(usize) -> io::Result<PartFile> + Send>,
}

impl Outlet {
    /// Removes a file that is not needed, if it can.
    pub(crate) fn remove(self) {
        let _ = fs::remove_file(self.directory.join(&self.first.name));
        let _ = fs::remove_dir(self.directory);
    }
}

/// The current file and the finished ones.
pub(crate) struct Parts<'a> {
    options: &'a RunBagOptions,
    open_next: Box<dyn FnMut(usize) -> io::Result<PartFile> + Send>,
    /// Of all files.
    bytes: Arc<AtomicU64>,
    closed: Vec<FileSummary>,
    latched: LatchedMessages,
    name: String,
    sync: Box<dyn Fn() -> io::Result<()> + Send>,
    writer: BagWriter<CountingSink>,
    began: Instant,
    /// Of the files before.
    bytes_before: u64,
    /// Bytes in the open chunk, at most.
    bytes_open: u64,
    /// Messages of this file that it does not repeat from others.
    messages: u64,
}

impl<'a> Parts<'a> {
    /// Begins the first file.
    pub(crate) fn begin(
        options: &'a RunBagOptions,
        outlet: Outlet,
        bytes: Arc<AtomicU64>,
    ) -> Result<Self, BagWriteError> {
        let PartFile { name, sink, sync } = outlet.first;
        let writer = BagWriter::new(CountingSink { sink, bytes: bytes.clone() })?;
        let mut parts = Self {
            options,
            open_next: outlet.next,
            bytes,
            closed: Vec::new(),
            latched: LatchedMessages::default(),
            name,
            sync,
            writer,
            began: Instant::now(),
            bytes_before: 0,
            bytes_open: 0,
            messages: 0,
        };
        if options.split.is_on() {
            parts.write_part_record(0)?;
        }
        parts.write_metadata(RUN_RECORD, &options.run)?;
        parts.flush()?;
        Ok(parts)
    }

    pub(crate) fn add_channel(&mut self, spec: &ChannelSpec) -> Result<(), BagWriteError> {
        let channel = self.writer.add_channel(spec)?;
        if self.options.split.is_on() {
            self.latched.add_channel(channel, spec);
        }
        Ok(())
    }

    /// Whether the next message belongs to another file.
    pub(crate) fn is_full(&self) -> bool {
        let written = self.bytes.load(Ordering::Relaxed) - self.bytes_before;
        self.options.split.is_due(self.messages, written + self.bytes_open, self.began.elapsed())
    }

    /// Closes this file and begins the next, whose first own message is of this time.
    pub(crate) fn go_on(&mut self, log_time_ns: u64) -> Result<(), BagWriteError> {
        self.flush()?;
        let part = self.closed.len() + 1;
        let PartFile { name, sink, sync } = (self.open_next)(part)?;
        let next = self.writer.next_part(CountingSink { sink, bytes: self.bytes.clone() })?;
        let full = std::mem::replace(&mut self.writer, next);
        let full_name = std::mem::replace(&mut self.name, name);
        let sync_full = std::mem::replace(&mut self.sync, sync);
        let (mut sink, summary) = full.finish(&full_name, &self.options.run)?;
        sink.flush()?;
        sync_full()?;
        self.closed.push(FileSummary { name: full_name, summary });
        self.bytes_before = self.bytes.load(Ordering::Relaxed);
        self.began = Instant::now();
        self.messages = 0;
        self.write_part_record(part)?;
        for again in self.latched.iter() {
            self.writer.repeat(
                again.channel,
                again.sequence,
                log_time_ns,
                again.publish_time_ns,
                &again.data,
            )?;
        }
        self.write_metadata(RUN_RECORD, &self.options.run)?;
        self.flush()
    }

    pub(crate) fn write(
        &mut self,
        channel: ChannelIndex,
        log_time_ns: u64,
        publish_time_ns: u64,
        data: &[u8],
    ) -> Result<(), BagWriteError> {
        let before = self.bytes.load(Ordering::Relaxed);
        let sequence = self.writer.next_sequence(channel);
        self.writer.write(channel, log_time_ns, publish_time_ns, data)?;
        self.latched.note(channel, sequence, publish_time_ns, data);
        self.messages += 1;
        // This also wrote the full chunk.
        let is_closed = self.bytes.load(Ordering::Relaxed) != before;
        let so_far = if is_closed { 0 } else { self.bytes_open };
        self.bytes_open = so_far + MESSAGE_OVERHEAD + data.len() as u64;
        Ok(())
    }

    pub(crate) fn skip(&mut self, channel: ChannelIndex, count: u32) -> Result<(), BagWriteError> {
        self.writer.skip(channel, count)
    }

    /// Closes the open chunk, too.
    pub(crate) fn attach(&mut self, attachment: &BagAttachment) -> Result<(), BagWriteError> {
        self.bytes_open = 0;
        self.writer.attach(attachment)
    }

    /// Closes the open chunk, too.
    pub(crate) fn write_metadata(
        &mut self,
        name: &str,
        values: &BTreeMap<String, String>,
    ) -> Result<(), BagWriteError> {
        self.bytes_open = 0;
        self.writer.write_metadata(name, values)
    }

    /// Closes the open chunk.
    pub(crate) fn flush(&mut self) -> Result<(), BagWriteError> {
        self.bytes_open = 0;
        self.writer.flush()
    }

    /// Syncs flushed data to the disk.
    pub(crate) fn sync(&self) -> io::Result<()> {
        (self.sync)()
    }

    /// Writes how the run ended and closes the last file. Returns all of them.
    pub(crate) fn finish(
        mut self,
        closing: &Closing,
        custom_data: &BTreeMap<String, String>,
    ) -> Result<Finished, BagWriteError> {
        self.write_metadata(RESULT_RECORD, &closing.to_record())?;
        let (mut sink, summary) = self.writer.finish(&self.name, custom_data)?;
        sink.flush()?;
        (self.sync)()?;
        self.closed.push(FileSummary { name: self.name, summary });
        Ok(Finished { files: self.closed, is_ours: self.sync })
    }

    fn write_part_record(&mut self, part: usize) -> Result<(), BagWriteError> {
        let values = BTreeMap::from([(PART_KEY.to_owned(), part.to_string())]);
        self.write_metadata(PART_RECORD, &values)
    }
}

/// Counts the bytes that pass.
struct CountingSink {
    sink: Box<dyn Write + Send>,
    bytes: Arc<AtomicU64>,
}

impl Write for CountingSink {
    fn write(&mut self, buf: &[u8]) -> io::Result<usize> {
        let written = self.sink.write(buf)?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}
