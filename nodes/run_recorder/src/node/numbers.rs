//! Which sequence numbers have been seen, and which are missing.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// A set of numbers, as ranges.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    /// First number to last number of each unbroken range.
    ranges: BTreeMap<u64, u64>,
}

impl Numbers {
    /// Adds one number; false when it was there.
    pub(super) fn add(&mut self, number: u64) -> bool {
        let before = self.ranges.range(..=number).next_back().map(|(&first, &last)| (first, last));
        let mut first = number;
        if let Some((start, last)) = before {
            if number <= last {
                return false;
            }
            if last == number - 1 {
                first = start;
            }
        }
        // There is no number after the largest one.
        let next = number.checked_add(1);
        let last = next.and_then(|next| self.ranges.remove(&next)).unwrap_or(number);
        self.ranges.insert(first, last);
        true
    }

    /// The smallest number seen.
    pub(super) fn first(&self) -> Option<u64> {
        self.ranges.first_key_value().map(|(&first, _)| first)
    }

    /// The largest number seen.
    pub(super) fn last(&self) -> Option<u64> {
        self.ranges.last_key_value().map(|(_, &last)| last)
    }

    /// The missing numbers from `first` to `last`.
    pub(super) fn missing(&self, first: u64, last: u64) -> Vec<RangeInclusive<u64>> {
        let mut gaps = Vec::new();
        let mut next = first;
        for (&start, &end) in &self.ranges {
            if start > next {
                gaps.push(next..=(start - 1).min(last));
            }
            if end >= last {
                return gaps;
            }
            next = next.max(end + 1);
        }
        if next <= last {
            gaps.push(next..=last);
        }
        gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_found_in_whatever_order_numbers_come() {
        let mut numbers = Numbers::default();
        assert_eq!(numbers.missing(1, 3), vec![1..=3]);
        for number in [5, 4, 9, 2, 8] {
            assert!(numbers.add(number));
        }
        assert!(!numbers.add(5), "a number counts once");
        assert_eq!(numbers.last(), Some(9));
        assert_eq!(numbers.missing(1, 10), vec![1..=1, 3..=3, 6..=7, 10..=10]);
        for number in [1, 3, 6, 7] {
            numbers.add(number);
        }
        assert_eq!(numbers.missing(1, 9), Vec::<RangeInclusive<u64>>::new());
        assert_eq!(numbers.ranges.len(), 1, "touching ranges become one");
    }

    #[test]
    fn the_smallest_and_the_largest_number_are_numbers_too() {
        const MAX: u64 = u64::MAX;
        let mut numbers = Numbers::default();
        for number in [MAX, 0, MAX - 2] {
            assert!(numbers.add(number));
        }
        assert_eq!(numbers.missing(0, MAX), vec![1..=MAX - 3, MAX - 1..=MAX - 1]);
        assert!(numbers.add(MAX - 1) && !numbers.add(MAX) && !numbers.add(0));
        assert_eq!(numbers.missing(MAX, MAX), []);
        assert_eq!(numbers.missing(0, MAX), vec![1..=MAX - 3]);
        assert_eq!(numbers.ranges.len(), 2);
    }
}
