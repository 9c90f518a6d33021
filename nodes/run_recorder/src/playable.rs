//! Whether `ros2 bag play` plays a file: what libmcap, inside of it, asks of the chunks.
//!
//! rosbag2 plays in the order of time if any chunk has an index of its messages. libmcap up to
//! 1.4 then looks at the first chunk only; if that one has no index, it reads no message, and
//! the player ends without an error. A chunk that holds definitions alone has no index, so
//! [`crate::bag_writer`] never writes one.
//! Source: `IndexedMessageReader` of libmcap 1.3.0, the version of ROS 2 Jazzy.

use mcap::records::ChunkIndex;

/// The chunk for which libmcap refuses the file, by its offset; `None` if it plays.
///
/// The order of the indexes does not matter: libmcap sorts them.
pub(crate) fn refused_chunk<'a>(chunks: impl IntoIterator<Item = &'a ChunkIndex>) -> Option<u64> {
    let mut first: Option<(u64, bool)> = None;
    let mut any_has_index = false;
    for chunk in chunks {
        let (at, has_index) = (chunk.chunk_start_offset, chunk.message_index_length > 0);
        any_has_index |= has_index;
        if first.is_none_or(|(before, _)| at < before) {
            first = Some((at, has_index));
        }
    }
    first.filter(|(_, has_index)| any_has_index && !has_index).map(|(at, _)| at)
}

/// Whether every chunk holds a message; stricter than [`refused_chunk`].
pub(crate) fn has_messages_in_each<'a>(chunks: impl IntoIterator<Item = &'a ChunkIndex>) -> bool {
    chunks.into_iter().all(|chunk| chunk.message_index_length > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_plays_unless_its_first_chunk_alone_lacks_an_index() {
        /// The offset of a chunk, and the length of its index.
        type Chunk = (u64, u64);
        // Chunks, and the refused one.
        let table: [(&[Chunk], Option<u64>); 8] = [
            (&[], None),
            (&[(384, 900)], None),
            (&[(384, 900), (2000, 31)], None),
            (&[(384, 0), (2000, 31)], Some(384)),
            (&[(384, 0), (900, 0), (2000, 31)], Some(384)),
            (&[(2000, 31), (384, 0)], Some(384)),
            // rosbag2 plays it in the order of the file.
            (&[(384, 0)], None),
            // Only the first is looked at.
            (&[(384, 900), (2000, 0)], None),
        ];
        for (chunks, expected) in table {
            let indexes: Vec<_> = chunks.iter().map(|it| chunk(*it)).collect();
            assert_eq!(refused_chunk(&indexes), expected, "{chunks:?}");
        }
    }

    fn chunk((chunk_start_offset, message_index_length): (u64, u64)) -> ChunkIndex {
        ChunkIndex {
            message_start_time: 0,
            message_end_time: 0,
            chunk_start_offset,
            chunk_length: 100,
            message_index_offsets: Default::default(),
            message_index_length,
            compression: "zstd".to_owned(),
            compressed_size: 60,
            uncompressed_size: 80,
        }
    }
}
