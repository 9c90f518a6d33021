//! What happens to the bytes of a bag: accidents of disks, and records that lie.

use crate::mutate::Random;
use std::collections::BTreeSet;

/// Kind and length, before the body of each record.
const FRAME: usize = 9;
const MAGIC: usize = 8;
const CHUNK: u8 = 6;
/// The footer's frame, two places, a checksum, magic bytes.
const FOOTER: usize = FRAME + 20 + MAGIC;

/// Changes a file in some places; half of the time its index is believed all the same.
pub(crate) fn mutate(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    for _ in 0..=random.below(3) {
        match random.below(14) {
            0 => bytes.truncate(random.below(bytes.len() + 1)),
            1 => flip(bytes, random),
            2 => set(bytes, random),
            3 => zero_block(bytes, random),
            4 => junk(bytes, random),
            5 => foreign(bytes, other, random),
            6 | 7 => lie_about_length(bytes, random),
            8 | 9 => lie_inside(bytes, random),
            10 => change_kind(bytes, random),
            11 => drop_record(bytes, random),
            12 => repeat_record(bytes, random),
            _ => swap_records(bytes, random),
        }
    }
    if random.once_in(2) {
        mend_summary(bytes);
    }
}

/// Where the records are, as far as they hang together: place and length of the body.
fn records(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut at = MAGIC;
    while let Some(head) = bytes.get(at..at + FRAME) {
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        let Ok(length) = usize::try_from(length) else { break };
        let Some(end) = (at + FRAME).checked_add(length).filter(|end| *end <= bytes.len()) else {
            break;
        };
        found.push((at, length));
        at = end;
    }
    found
}

/// One of them, the rare kinds as often as those of which there are many.
fn pick(bytes: &[u8], records: &[(usize, usize)], random: &mut Random) -> (usize, usize) {
    let kinds: BTreeSet<u8> = records.iter().map(|(at, _)| bytes[*at]).collect();
    let kinds: Vec<u8> = kinds.into_iter().collect();
    let kind = *random.of(&kinds);
    let of_kind: Vec<_> = records.iter().filter(|(at, _)| bytes[*at] == kind).collect();
    **random.of(&of_kind)
}

fn flip(bytes: &mut [u8], random: &mut Random) {
    if !bytes.is_empty() {
        let at = random.below(bytes.len());
        bytes[at] ^= 1 << random.below(8);
    }
}

fn set(bytes: &mut [u8], random: &mut Random) {
    if !bytes.is_empty() {
        let at = random.below(bytes.len());
        bytes[at] = *random.of(&[0, 1, 2, 0x7f, 0x80, 0xff]);
    }
}

/// A block that was allocated and never written.
fn zero_block(bytes: &mut [u8], random: &mut Random) {
    let blocks = bytes.len().div_ceil(512);
    if blocks > 0 {
        let start = 512 * random.below(blocks);
        let end = bytes.len().min(start + 512 * (1 + random.below(8)));
        bytes[start..end].fill(0);
    }
}

fn junk(bytes: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(bytes.len() + 1);
    let junk: Vec<u8> = (0..random.below(40)).map(|_| random.next() as u8).collect();
    bytes.splice(at..at, junk);
}

/// A piece of another bag.
fn foreign(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if other.is_empty() {
        return;
    }
    let start = random.below(other.len());
    let end = other.len().min(start + random.below(2000));
    let at = random.below(bytes.len() + 1);
    let over = if random.once_in(2) { bytes.len().min(at + end - start) } else { at };
    bytes.splice(at..over, other[start..end].iter().copied());
}

/// Lengths at the edges of everything.
fn length(was: u64, random: &mut Random) -> u64 {
    match random.below(10) {
        0 => 0,
        1 => 1,
        2 => was.wrapping_add(1),
        3 => was.wrapping_sub(1),
        4 => u64::MAX,
        5 => u64::from(u32::MAX),
        6 => 1 << 62,
        7 => 255 << 20,
        8 => was / 2,
        _ => random.next() >> random.below(64),
    }
}

fn lie_about_length(bytes: &mut [u8], random: &mut Random) {
    let records = records(bytes);
    if records.is_empty() {
        return;
    }
    let (at, was) = pick(bytes, &records, random);
    let lie = length(was as u64, random);
    bytes[at + 1..at + FRAME].copy_from_slice(&lie.to_le_bytes());
}

/// A number in a record: a length, a count, a time, a place or a checksum.
fn lie_inside(bytes: &mut [u8], random: &mut Random) {
    let mut records = records(bytes);
    records.retain(|(_, length)| *length >= 8);
    if records.is_empty() {
        return;
    }
    let (at, body) = pick(bytes, &records, random);
    // Heads are short, and most of what can be lied about is in them.
    let reach = if random.once_in(4) { body - 7 } else { (body - 7).min(60) };
    let place = at + FRAME + random.below(reach);
    let was = u64::from_le_bytes(bytes[place..place + 8].try_into().expect("eight bytes"));
    if random.once_in(2) {
        let lie = length(was, random);
        bytes[place..place + 8].copy_from_slice(&lie.to_le_bytes());
    } else {
        let lie = length(was & u64::from(u32::MAX), random) as u32;
        bytes[place..place + 4].copy_from_slice(&lie.to_le_bytes());
    }
}

fn change_kind(bytes: &mut [u8], random: &mut Random) {
    let records = records(bytes);
    if !records.is_empty() {
        let (at, _) = pick(bytes, &records, random);
        bytes[at] = if random.once_in(4) { random.next() as u8 } else { random.below(17) as u8 };
    }
}

fn drop_record(bytes: &mut Vec<u8>, random: &mut Random) {
    let records = records(bytes);
    if !records.is_empty() {
        let (at, length) = pick(bytes, &records, random);
        bytes.drain(at..at + FRAME + length);
    }
}

fn repeat_record(bytes: &mut Vec<u8>, random: &mut Random) {
    let records = records(bytes);
    if !records.is_empty() {
        let (at, length) = pick(bytes, &records, random);
        let (to, _) = *random.of(&records);
        let copy = bytes[at..at + FRAME + length].to_vec();
        bytes.splice(to..to, copy);
    }
}

fn swap_records(bytes: &mut Vec<u8>, random: &mut Random) {
    let records = records(bytes);
    if records.len() > 1 {
        let first = random.below(records.len() - 1);
        let (at, length) = records[first];
        let (next, next_length) = records[first + 1];
        let moved = bytes[next..next + FRAME + next_length].to_vec();
        bytes.drain(next..next + FRAME + next_length);
        bytes.splice(at..at, moved);
        debug_assert!(length < bytes.len());
    }
}

/// Makes the checksum of the index right again, so that its lies are believed.
fn mend_summary(bytes: &mut [u8]) {
    let Some(footer) = bytes.len().checked_sub(FOOTER) else { return };
    let start = u64::from_le_bytes(bytes[footer + 9..footer + 17].try_into().expect("8 bytes"));
    let Ok(start) = usize::try_from(start) else { return };
    if start == 0 || start > footer {
        return;
    }
    let crc = crc32fast::hash(&bytes[start..footer + FRAME + 16]);
    bytes[footer + FRAME + 16..footer + FRAME + 20].copy_from_slice(&crc.to_le_bytes());
}

/// The bytes of a definition, changed: fields that come and go, counts beyond all measure,
/// types that hold themselves.
pub(crate) fn mutate_definition(text: &str, random: &mut Random) -> String {
    const FIELDS: [&str; 14] = [
        "uint8[4000000000] all",
        "string[] texts",
        "string<=3 short",
        "float64[<=2] few",
        "float64[1000000] many",
        "wstring wide",
        "bool is",
        "time when",
        "int32 X=99999999999999999999",
        "string S=\"",
        "uint8[<=] odd",
        "uint8[-1] less",
        "a/b/c/d deep",
        "==========",
    ];
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    if lines.is_empty() {
        lines.push(String::new());
    }
    // What a definition calls itself, for one that holds itself.
    let named: Vec<String> =
        lines.iter().filter_map(|line| line.strip_prefix("MSG: ")).map(str::to_owned).collect();
    for _ in 0..=random.below(4) {
        let at = random.below(lines.len());
        match random.below(7) {
            0 if lines.len() > 1 => drop(lines.remove(at)),
            1 => lines.insert(at, (*random.of(&FIELDS)).to_owned()),
            2 => {
                let with = random.below(lines.len());
                lines.swap(at, with);
            }
            3 if !named.is_empty() => {
                let own = random.of(&named);
                let count = random.of(&["", "[]", "[3]", "[100000]"]);
                lines.insert(at, format!("{own}{count} again"));
            }
            4 => lines.insert(at, lines[at].clone()),
            5 => {
                lines[at] =
                    lines[at].replace(' ', ["  ", "", "[] ", "[99999999] "][random.below(4)])
            }
            _ => {
                let mut bytes = std::mem::take(&mut lines[at]).into_bytes();
                flip(&mut bytes, random);
                lines[at] = String::from_utf8_lossy(&bytes).into_owned();
            }
        }
    }
    lines.join("\n")
}

/// Whether a file has chunks, for the count of what was tried.
pub(crate) fn has_chunks(bytes: &[u8]) -> bool {
    records(bytes).iter().any(|(at, _)| bytes[*at] == CHUNK)
}
