//! Programs that are uploaded in chunks.
//!
//! Knows which chunks of which upload have arrived, and their limits; the shell has the requests
//! and responses.

use crate::limits::PROGRAM_BYTES_MAX;
use cnc_msgs::wire::cnc_msgs::srv::PutProgramChunkRequest;
use std::collections::{BTreeMap, VecDeque};

/// Size of one chunk, bytes: it has to fit a message.
pub const CHUNK_BYTES_MAX: usize = 48_000;
/// Incomplete uploads at the same time; a further one drops the oldest.
pub const UPLOADS_MAX: usize = 4;

/// Why a chunk was rejected, or an upload cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UploadError {
    #[error("upload_id is empty; choose one and send it with every chunk")]
    NoId,
    #[error("chunk {index} of {count} does not exist")]
    Index { index: u32, count: u32 },
    #[error("chunk_count is {count}, but earlier chunks of this upload said {earlier}")]
    CountChanged { count: u32, earlier: u32 },
    #[error("chunk {index} holds {bytes} bytes; at most {CHUNK_BYTES_MAX} are accepted")]
    ChunkTooLarge { index: u32, bytes: usize },
    #[error(
        "{count} chunks of up to {CHUNK_BYTES_MAX} bytes are announced; a program may have at most {PROGRAM_BYTES_MAX} bytes"
    )]
    TooLarge { count: u32 },
    #[error("chunk {index} is damaged: its CRC-32 is {found:08x}, not {stated:08x}")]
    Damaged { index: u32, found: u32, stated: u32 },
    #[error(
        "there is no upload {id:?}: it was never started, is already used, or was dropped for newer ones; upload the program again"
    )]
    Unknown { id: String },
    #[error("upload {id:?} is not complete: chunk {index} of {count} is missing")]
    Incomplete { id: String, index: u32, count: u32 },
}

/// All uploads in progress.
#[derive(Debug, Default)]
pub struct Uploads {
    /// Ids, oldest first.
    order: VecDeque<String>,
    uploads: BTreeMap<String, Upload>,
}

#[derive(Debug)]
struct Upload {
    count: u32,
    chunks: BTreeMap<u32, Vec<u8>>,
}

impl Uploads {
    /// Adds a chunk; returns how many different chunks have arrived.
    ///
    /// A chunk may come again; the last one counts.
    ///
    /// # Errors
    /// The chunk is damaged, too large, or contradicts earlier chunks of the upload.
    pub fn put(&mut self, request: PutProgramChunkRequest) -> Result<u32, UploadError> {
        let PutProgramChunkRequest { upload_id, index, chunk_count: count, data, crc32 } = request;
        if upload_id.is_empty() {
            return Err(UploadError::NoId);
        }
        if count as usize > PROGRAM_BYTES_MAX / CHUNK_BYTES_MAX {
            return Err(UploadError::TooLarge { count });
        }
        if index >= count {
            return Err(UploadError::Index { index, count });
        }
        if data.len() > CHUNK_BYTES_MAX {
            return Err(UploadError::ChunkTooLarge { index, bytes: data.len() });
        }
        let found = crc32fast::hash(&data);
        if found != crc32 {
            return Err(UploadError::Damaged { index, found, stated: crc32 });
        }
        if !self.uploads.contains_key(&upload_id) {
            if self.order.len() == UPLOADS_MAX {
                let oldest = self.order.pop_front().expect("UPLOADS_MAX is not zero");
                self.uploads.remove(&oldest);
            }
            self.order.push_back(upload_id.clone());
        }
        let upload = self
            .uploads
            .entry(upload_id)
            .or_insert_with(|| Upload { count, chunks: BTreeMap::new() });
        if upload.count != count {
            return Err(UploadError::CountChanged { count, earlier: upload.count });
        }
        upload.chunks.insert(index, data);
        Ok(upload.chunks.len() as u32)
    }

    /// Removes a complete upload and returns its text.
    ///
    /// # Errors
    /// The upload is unknown or incomplete.
    pub fn take(&mut self, id: &str) -> Result<Vec<u8>, UploadError> {
        let upload =
            self.uploads.get(id).ok_or_else(|| UploadError::Unknown { id: id.to_owned() })?;
        let missing = (0..upload.count).find(|index| !upload.chunks.contains_key(index));
        if let Some(index) = missing {
            return Err(UploadError::Incomplete { id: id.to_owned(), index, count: upload.count });
        }
        self.order.retain(|other| other != id);
        let upload = self.uploads.remove(id).expect("it was found above");
        Ok(upload.chunks.into_values().flatten().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(id: &str, index: u32, count: u32, data: &[u8]) -> PutProgramChunkRequest {
        PutProgramChunkRequest {
            upload_id: id.into(),
            index,
            chunk_count: count,
            data: data.to_vec(),
            crc32: crc32fast::hash(data),
        }
    }

    #[test]
    fn pieces_in_any_order_and_twice_make_the_text() {
        let mut uploads = Uploads::default();
        assert_eq!(uploads.put(piece("a", 1, 2, b"X10\n")), Ok(1));
        assert_eq!(uploads.put(piece("a", 1, 2, b"X10\n")), Ok(1));
        assert_eq!(uploads.put(piece("a", 0, 2, b"G0\n")), Ok(2));
        assert_eq!(uploads.take("a"), Ok(b"G0\nX10\n".to_vec()));
        assert_eq!(uploads.take("a"), Err(UploadError::Unknown { id: "a".into() }));
    }

    #[test]
    fn a_missing_piece_is_named() {
        let mut uploads = Uploads::default();
        uploads.put(piece("a", 0, 3, b"G0")).unwrap();
        uploads.put(piece("a", 2, 3, b"G1")).unwrap();
        assert_eq!(
            uploads.take("a"),
            Err(UploadError::Incomplete { id: "a".into(), index: 1, count: 3 })
        );
    }

    #[test]
    fn damaged_contradicting_and_endless_pieces_are_refused() {
        let mut uploads = Uploads::default();
        uploads.put(piece("a", 0, 3, b"G0")).unwrap();
        let mut damaged = piece("a", 1, 3, b"G1");
        damaged.crc32 ^= 1;
        assert!(matches!(uploads.put(damaged), Err(UploadError::Damaged { index: 1, .. })));
        assert_eq!(
            uploads.put(piece("a", 1, 4, b"G1")),
            Err(UploadError::CountChanged { count: 4, earlier: 3 })
        );
        assert_eq!(
            uploads.put(piece("a", 3, 3, b"G1")),
            Err(UploadError::Index { index: 3, count: 3 })
        );
        assert!(matches!(
            uploads.put(piece("b", 0, u32::MAX, b"")),
            Err(UploadError::TooLarge { .. })
        ));
        assert!(matches!(
            uploads.put(piece("b", 0, 1, &[0; CHUNK_BYTES_MAX + 1])),
            Err(UploadError::ChunkTooLarge { .. })
        ));
        assert_eq!(uploads.put(piece("", 0, 1, b"")), Err(UploadError::NoId));
    }

    #[test]
    fn a_fifth_upload_drops_the_oldest() {
        let mut uploads = Uploads::default();
        for id in ["a", "b", "c", "d", "e"] {
            uploads.put(piece(id, 0, 1, id.as_bytes())).unwrap();
        }
        assert_eq!(uploads.take("a"), Err(UploadError::Unknown { id: "a".into() }));
        assert_eq!(uploads.take("e"), Ok(b"e".to_vec()));
    }
}
