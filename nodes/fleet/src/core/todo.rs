//! Which bags a worker has still to replay, and in which order.

use super::shard::Shard;
use std::collections::{BTreeMap, BTreeSet};

/// The bags of a shard without a verdict, by key: the same for every worker that is asked.
///
/// `selected` may name a bag twice, and be in any order. A bag in which earlier workers
/// stopped comes last, the one with the most of them at the end: if it was the bag that stopped them,
/// the others are done first.
pub fn to_do<'a>(
    selected: impl IntoIterator<Item = &'a str>,
    shard: Shard,
    done: &BTreeSet<String>,
    stopped_in: &BTreeMap<String, u32>,
) -> Vec<String> {
    let ours = selected.into_iter().filter(|key| shard.has(key) && !done.contains(*key));
    let ours: BTreeSet<&str> = ours.collect();
    let mut ours: Vec<String> = ours.into_iter().map(str::to_owned).collect();
    ours.sort_by_key(|key| stopped_in.get(key));
    ours
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_done_is_left_out_and_what_stopped_a_worker_comes_last() {
        let set = |keys: &[&str]| -> BTreeSet<String> {
            keys.iter().map(|key| (*key).to_owned()).collect()
        };
        for (selected, shard, done, stopped, expected) in [
            (&["c", "a", "b", "a"][..], "0/1", &[][..], &[][..], &["a", "b", "c"][..]),
            (&["a", "b", "c"], "0/1", &["b"], &["a"], &["c", "a"]),
            (&["a", "b", "c"], "0/2", &[], &[], &["a", "c"]),
            (&["a", "b", "c"], "1/2", &[], &[], &["b"]),
            (&["a"], "0/1", &["a"], &["a"], &[]),
            (&["a", "b", "c", "d"], "0/1", &[], &["a", "b", "a"], &["c", "d", "b", "a"]),
        ] {
            let shard = shard.parse().expect("a shard");
            let mut stops = BTreeMap::new();
            for key in stopped {
                *stops.entry((*key).to_owned()).or_default() += 1;
            }
            let list = to_do(selected.iter().copied(), shard, &set(done), &stops);
            assert_eq!(list, expected, "{selected:?} {shard} {done:?} {stopped:?}");
        }
    }
}
