//! Which bags a worker has still to replay, and in which order.

use super::shard::Shard;
use std::collections::{BTreeMap, BTreeSet};

/// The bags of a shard without a verdict, by key: the same for every worker that is asked.
///
/// `selected` may name a bag twice, and be in any order. A bag in which an earlier worker stopped comes
/// last: if it was the bag that stopped it, the others are done first.
pub fn to_do<'a>(
    selected: impl IntoIterator<Item = &'a str>,
    shard: Shard,
    done: &BTreeSet<String>,
    stopped_in: &BTreeMap<String, u32>,
) -> Vec<String> {
    let ours = selected.into_iter().filter(|key| shard.has(key) && !done.contains(*key));
    let ours: BTreeSet<&str> = ours.collect();
    let (last, first): (Vec<&str>, Vec<&str>) =
        ours.into_iter().partition(|key| stopped_in.contains_key(*key));
    first.into_iter().chain(last).map(str::to_owned).collect()
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
        ] {
            let shard = shard.parse().expect("a shard");
            let stopped = set(stopped).into_iter().map(|key| (key, 1)).collect();
            let list = to_do(selected.iter().copied(), shard, &set(done), &stopped);
            assert_eq!(list, expected, "{selected:?} {shard} {done:?} {stopped:?}");
        }
    }
}
