//! Retention: which bags are removed, by age and total size.
//!
//! Pure: takes the bags of a directory and returns those to remove, oldest first.
//! `stored_bags` lists and removes them.

use std::path::PathBuf;
use std::time::Duration;

const NS_PER_DAY: u64 = 86_400_000_000_000;

/// How long bags are kept, and in how much space; zero: no limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RetentionLimits {
    /// Since its last write.
    pub days: u32,
    /// Bytes of all unmarked bags together.
    pub bytes: u64,
}

impl RetentionLimits {
    /// Whether there is a limit at all.
    pub fn is_limited(&self) -> bool {
        self.days > 0 || self.bytes > 0
    }
}

/// Why a bag is kept beyond the limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stays {
    /// It is marked; its space does not count.
    Marked,
    /// It is being written.
    InUse,
    /// Removing it failed.
    Stuck,
    /// A store has not been given it yet.
    Due,
}

/// A bag of ours in the directory of bags.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredBag {
    pub path: PathBuf,
    /// Bytes.
    pub size: u64,
    /// When it was written to last, nanoseconds since the epoch.
    pub ended_ns: u64,
    pub stays: Option<Stays>,
}

/// The limit that a bag exceeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExceededLimit {
    /// More days than bags are kept.
    Age(Duration),
    /// The size of all bags together, bytes.
    Space(u128),
}

/// A bag to remove.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Removal {
    pub path: PathBuf,
    /// Bytes.
    pub size: u64,
    pub beyond: ExceededLimit,
}

/// The bags to remove, oldest first.
///
/// The newest unmarked bag is always kept: one run above the limit is better than none, and a
/// wrong clock makes all of them old.
pub fn to_remove(bags: &[StoredBag], keep: RetentionLimits, now_ns: u64) -> Vec<Removal> {
    let mut counted: Vec<&StoredBag> =
        bags.iter().filter(|bag| bag.stays != Some(Stays::Marked)).collect();
    counted.sort_by(|a, b| (a.ended_ns, &a.path).cmp(&(b.ended_ns, &b.path)));
    let newest = counted.last().map(|bag| &bag.path);
    let mut total: u128 = counted.iter().map(|bag| u128::from(bag.size)).sum();
    let days_ns = u64::from(keep.days).saturating_mul(NS_PER_DAY);
    let mut removals = Vec::new();
    let may_go = |bag: &&&StoredBag| bag.stays.is_none() && Some(&bag.path) != newest;
    for bag in counted.iter().filter(may_go) {
        // A clock that was set back does not make bags old.
        let age_ns = now_ns.saturating_sub(bag.ended_ns);
        let beyond = if keep.days > 0 && age_ns > days_ns {
            ExceededLimit::Age(Duration::from_nanos(age_ns))
        } else if keep.bytes > 0 && total > u128::from(keep.bytes) {
            ExceededLimit::Space(total)
        } else {
            continue;
        };
        total -= u128::from(bag.size);
        removals.push(Removal { path: bag.path.clone(), size: bag.size, beyond });
    }
    removals
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: u64 = 1_000 * NS_PER_DAY;

    /// Name, size, age in days, what keeps it.
    type Row = (&'static str, u64, u64, Option<Stays>);

    /// The case, the bags, days, bytes, the removed bags.
    type Case<'a> = (&'a str, &'a [Row], u32, u64, &'a [(&'a str, &'a str)]);

    fn gone(rows: &[Row], days: u32, bytes: u64) -> Vec<(String, &'static str)> {
        let bags: Vec<_> = rows
            .iter()
            .map(|&(name, size, age_days, stays)| StoredBag {
                path: name.into(),
                size,
                ended_ns: NOW - age_days * NS_PER_DAY,
                stays,
            })
            .collect();
        to_remove(&bags, RetentionLimits { days, bytes }, NOW)
            .into_iter()
            .map(|removal| {
                let why = match removal.beyond {
                    ExceededLimit::Age(_) => "age",
                    ExceededLimit::Space(_) => "space",
                };
                (removal.path.display().to_string(), why)
            })
            .collect()
    }

    #[test]
    fn the_oldest_go_first_and_no_more_than_must() {
        let marked = Some(Stays::Marked);
        let in_use = Some(Stays::InUse);
        let stuck = Some(Stays::Stuck);
        // In no order, as a directory gives them.
        let plain: &[Row] = &[("c", 10, 1, None), ("a", 10, 9, None), ("b", 10, 5, None)];
        let table: &[Case<'_>] = &[
            ("nothing there", &[], 1, 1, &[]),
            ("for ever", plain, 0, 0, &[]),
            ("the day itself is kept", plain, 9, 0, &[]),
            ("by age", plain, 4, 0, &[("a", "age"), ("b", "age")]),
            ("just enough space", plain, 0, 30, &[]),
            ("one byte too many", plain, 0, 29, &[("a", "space")]),
            ("two", plain, 0, 10, &[("a", "space"), ("b", "space")]),
            ("the newest stays", plain, 0, 1, &[("a", "space"), ("b", "space")]),
            ("age makes room", plain, 8, 20, &[("a", "age")]),
            ("age and space", plain, 8, 19, &[("a", "age"), ("b", "space")]),
            (
                "a marked one stays and takes no space",
                &[("a", 50, 9, marked), ("b", 10, 5, None), ("c", 10, 1, None)],
                4,
                20,
                &[("b", "age")],
            ),
            (
                "one that is written stays, takes space and is the newest",
                &[("a", 10, 9, None), ("b", 10, 5, None), ("c", 50, 0, in_use)],
                0,
                60,
                &[("a", "space")],
            ),
            (
                "one that cannot go takes space of the others",
                &[("a", 10, 9, stuck), ("b", 10, 5, None), ("c", 10, 1, None)],
                0,
                20,
                &[("b", "space")],
            ),
            ("one alone", &[("a", 99, 3, None)], 0, 1, &[]),
            ("one alone and old", &[("a", 99, 3, None)], 2, 1, &[]),
            ("all are old", plain, 1, 0, &[("a", "age"), ("b", "age")]),
            (
                "all by a clock that is wrong",
                &[("a", 1, 900, None), ("b", 1, 899, None)],
                9,
                0,
                &[("a", "age")],
            ),
            ("empty ones too", &[("a", 0, 9, None), ("b", 0, 1, None)], 3, 0, &[("a", "age")]),
        ];
        for (what, rows, days, bytes, expected) in table {
            let found = gone(rows, *days, *bytes);
            let found: Vec<_> = found.iter().map(|(name, why)| (name.as_str(), *why)).collect();
            assert_eq!(&found[..], *expected, "{what}");
        }
    }

    #[test]
    fn a_clock_that_was_put_back_makes_nothing_old() {
        let bag = StoredBag { path: "a".into(), size: 1, ended_ns: NOW, stays: None };
        assert_eq!(to_remove(&[bag], RetentionLimits { days: 1, bytes: 0 }, 5), []);
    }

    #[test]
    fn sizes_beyond_all_measure_do_not_overflow() {
        let bag = |name: &str, ended_ns| StoredBag {
            path: name.into(),
            size: u64::MAX,
            ended_ns,
            stays: None,
        };
        let gone = to_remove(
            &[bag("a", 1), bag("b", 2), bag("c", 3)],
            RetentionLimits { days: 0, bytes: 9 },
            9,
        );
        assert_eq!(gone.len(), 2, "{gone:?}");
    }
}
