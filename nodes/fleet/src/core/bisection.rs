//! Which commit is tried next, and which one did it.

use std::collections::BTreeSet;

/// What a commit makes of the bag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The same as the good commit.
    Same,
    Different,
    /// It does not build, or cannot read the bag.
    Broken,
}

/// A search among commits in order: the first is good, the last is not.
#[derive(Debug)]
pub struct Bisection {
    /// The newest that is known to be good, and the oldest that is known not to be.
    good: usize,
    bad: usize,
    broken: BTreeSet<usize>,
}

impl Bisection {
    /// A search among commits 0 (good) to `last` (different).
    pub fn new(last: usize) -> Self {
        Self { good: 0, bad: last, broken: BTreeSet::new() }
    }

    /// The commit to try: the one nearest to the middle that is not known.
    pub fn next(&self) -> Option<usize> {
        let middle = self.good + (self.bad - self.good) / 2;
        let unknown = (self.good + 1..self.bad).filter(|commit| !self.broken.contains(commit));
        unknown.min_by_key(|commit| commit.abs_diff(middle))
    }

    /// Records the result of a commit.
    pub fn record(&mut self, commit: usize, outcome: Outcome) {
        match outcome {
            Outcome::Same => self.good = self.good.max(commit),
            Outcome::Different => self.bad = self.bad.min(commit),
            Outcome::Broken => {
                self.broken.insert(commit);
            }
        }
    }

    /// The first commit that is known to differ, and those right before it that may differ already,
    /// because they are broken.
    pub fn first_different(&self) -> (usize, Vec<usize>) {
        (self.bad, (self.good + 1..self.bad).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Searches; returns what was found and how many were tried.
    fn search(last: usize, first_different: usize, broken: &[usize]) -> (usize, Vec<usize>, usize) {
        let mut bisection = Bisection::new(last);
        let mut tried = 0;
        while let Some(commit) = bisection.next() {
            tried += 1;
            let outcome = match commit {
                _ if broken.contains(&commit) => Outcome::Broken,
                _ if commit < first_different => Outcome::Same,
                _ => Outcome::Different,
            };
            bisection.record(commit, outcome);
        }
        let (found, suspects) = bisection.first_different();
        (found, suspects, tried)
    }

    #[test]
    fn each_commit_is_found_and_few_are_tried() {
        for last in 1..40 {
            for first in 1..=last {
                let (found, suspects, tried) = search(last, first, &[]);
                assert_eq!((found, suspects), (first, vec![]));
                assert!(tried <= 6, "{tried} of {last}");
            }
        }
    }

    #[test]
    fn a_broken_commit_is_passed_or_named() {
        assert_eq!(search(10, 7, &[5]).0, 7);
        let (found, suspects, _) = search(10, 7, &[5, 6]);
        assert_eq!((found, suspects), (7, vec![5, 6]));
        let (found, suspects, _) = search(10, 7, &[7]);
        assert_eq!((found, suspects), (8, vec![7]));
        let (found, suspects, tried) = search(5, 3, &[1, 2, 3, 4]);
        assert_eq!((found, suspects, tried), (5, vec![1, 2, 3, 4], 4));
    }
}
