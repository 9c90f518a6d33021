//! A peer at the other end of a pseudo-terminal.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

/// Far longer than any test takes; only a hang reaches it.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(60);
const O_NOCTTY: i32 = 0o400;
const O_NONBLOCK: i32 = 0o4000;

pub(crate) struct Peer {
    pub(crate) file: File,
    pub(crate) received: String,
}

impl Peer {
    pub(crate) fn open(path: &Path) -> Self {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(O_NOCTTY | O_NONBLOCK)
            .open(path)
            .unwrap();
        Self { file, received: String::new() }
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.file.write_all(bytes).unwrap();
    }

    /// Waits for a text and returns everything up to its end.
    pub(crate) fn expect(&mut self, text: &str) -> String {
        let started = Instant::now();
        loop {
            if let Some(at) = self.received.find(text) {
                return self.received.drain(..at + text.len()).collect();
            }
            assert!(started.elapsed() < TIMEOUT, "no `{text}` in {:?}", self.received);
            let mut buffer = [0; 256];
            match self.file.read(&mut buffer) {
                Ok(count) => self.received += std::str::from_utf8(&buffer[..count]).unwrap(),
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    std::thread::sleep(Duration::from_millis(2));
                }
                Err(error) => panic!("{error}; received {:?}", self.received),
            }
        }
    }
}
