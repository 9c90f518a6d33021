//! What an MCAP file has in its chunks when they are unpacked.

/// Bytes before the first record.
const MAGIC: usize = 8;
/// Opcode and length of a record.
const HEAD: usize = 9;
const CHUNK: u8 = 6;
/// Where a chunk says its unpacked size: after its first and last time.
const SIZE_AT: usize = 16;

/// The bytes of a bag when all its chunks are unpacked, as the chunks say; the file's own where none is.
pub fn unpacked_bytes(content: &[u8]) -> u64 {
    let number = |at: usize| {
        let bytes = content.get(at..at.checked_add(8)?)?;
        Some(u64::from_le_bytes(bytes.try_into().ok()?))
    };
    let (mut at, mut unpacked) = (MAGIC, content.len() as u64);
    while let (Some(opcode), Some(length)) = (content.get(at), number(at + 1)) {
        if *opcode == CHUNK {
            let size = number(at + HEAD + SIZE_AT).unwrap_or(0);
            unpacked = unpacked.saturating_add(size.saturating_sub(length));
        }
        let next = usize::try_from(length).ok().and_then(|it| it.checked_add(at + HEAD));
        let Some(next) = next else { break };
        at = next;
    }
    unpacked
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(opcode: u8, content: &[u8]) -> Vec<u8> {
        [&[opcode][..], &(content.len() as u64).to_le_bytes(), content].concat()
    }

    #[test]
    fn chunks_count_as_what_they_unpack_to() {
        let chunk =
            |size: u64| record(CHUNK, &[&[0; 16][..], &size.to_le_bytes(), &[1; 20]].concat());
        let other = record(1, &[9; 30]);
        for (records, more) in [
            (vec![], 0),
            (vec![other.clone()], 0),
            (vec![other, chunk(5_000), chunk(3_000)], 5_000 - 44 + 3_000 - 44),
            (vec![chunk(u64::MAX)], u64::MAX),
            (vec![chunk(5_000)[..20].to_vec()], 0),
            (vec![[&[1][..], &[0xff; 8]].concat()], 0),
        ] {
            let content = [&[0x89; MAGIC][..], &records.concat()].concat();
            let expected = (content.len() as u64).saturating_add(more);
            assert_eq!(unpacked_bytes(&content), expected);
        }
        assert_eq!(unpacked_bytes(b""), 0);
    }
}
