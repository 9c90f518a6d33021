//! Shards: which worker replays which bag.
//!
//! A bag belongs to a shard by its key alone, so workers need not know of each other, and a bag that is
//! pushed meanwhile moves no other.

use std::fmt;
use std::str::FromStr;

/// One of a number of shards, counted from 0 as array jobs do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Shard {
    /// The only one.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Whether a bag belongs to it.
    pub fn has(self, key: &str) -> bool {
        // A key is a hash: its first digits are as good as any other number.
        let digits = key.get(..15).unwrap_or(key);
        let number = u64::from_str_radix(digits, 16).unwrap_or(0);
        number % u64::from(self.count) == u64::from(self.index)
    }

    /// Its name in a folder.
    pub fn name(self) -> String {
        format!("{}-of-{}", self.index, self.count)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || format!("`{text}` is not a shard; write 0/3, 1/3 and 2/3 for three workers");
        let (index, count) = text.split_once('/').ok_or_else(form)?;
        let number = |text: &str| text.parse::<u32>().map_err(|_| form());
        let (index, count) = (number(index)?, number(count)?);
        match count {
            0 => Err(form()),
            _ if index >= count => {
                let last = count - 1;
                Err(format!(
                    "shard {text} does not exist: the shards of {count} are 0/{count} to {last}/{count}"
                ))
            }
            _ => Ok(Self { index, count }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::key::key_of;

    #[test]
    fn a_shard_that_is_none_is_refused_with_those_that_are() {
        for (text, expected) in [
            ("7/3", "shard 7/3 does not exist: the shards of 3 are 0/3 to 2/3"),
            ("3/3", "shard 3/3 does not exist: the shards of 3 are 0/3 to 2/3"),
            ("0/0", "`0/0` is not a shard; write 0/3, 1/3 and 2/3 for three workers"),
            ("3", "`3` is not a shard; write 0/3, 1/3 and 2/3 for three workers"),
            ("-1/3", "`-1/3` is not a shard; write 0/3, 1/3 and 2/3 for three workers"),
            ("1/3/5", "`1/3/5` is not a shard; write 0/3, 1/3 and 2/3 for three workers"),
        ] {
            assert_eq!(text.parse::<Shard>(), Err(expected.to_owned()));
        }
    }

    #[test]
    fn each_bag_is_of_one_shard_and_shards_are_of_like_size() {
        let shards: Vec<Shard> =
            (0..7).map(|index| format!("{index}/7").parse().expect("a shard")).collect();
        let mut counts = [0; 7];
        for number in 0..7000_u32 {
            let key = key_of(&number.to_le_bytes());
            let of: Vec<usize> = (0..7).filter(|index| shards[*index].has(&key)).collect();
            assert_eq!(of.len(), 1, "{key} is of the shards {of:?}");
            counts[of[0]] += 1;
        }
        assert!(counts.iter().all(|count| (850..1150).contains(count)), "{counts:?}");
        assert!(Shard::WHOLE.has(&key_of(b"any")));
    }
}
