//! Finds up to where something holds, in few trials.

/// What is known so far.
struct Search {
    /// The largest value that holds.
    low: f64,
    /// The smallest value that fails, and by how much.
    high: (f64, f64),
    /// The one before it.
    before: Option<(f64, f64)>,
}

/// Finds a value that holds, at most `exact` below one that fails. `low` holds; `high` fails by so much.
///
/// A trial gives by how much a value fails, infinite where that is not known, and `None` if it holds. A
/// line through the last two that fail shows where to try next, or through their roots, because a move
/// that leaves a circle at a tangent cuts by a square; where that does not help, the middle is tried. `None` once `goes_on` says no.
pub(crate) fn last_that_holds(
    (low, high): (f64, (f64, f64)),
    exact: f64,
    goes_on: &dyn Fn() -> bool,
    trial: impl Fn(f64) -> Option<f64>,
) -> Option<f64> {
    let mut search = Search { low, high, before: None };
    while search.width() > exact {
        if !goes_on() {
            return None;
        }
        let width = search.width();
        // On both sides of a good estimate, so that the interval closes.
        let [up, down] = [exact / 4.0, -exact / 4.0];
        for (power, beside) in [(1.0, up), (1.0, down), (0.5, up), (0.5, down)] {
            let value = search.estimate(power).map(|estimate| estimate + beside);
            if let Some(value) = value.filter(|value| search.low < *value && *value < search.high.0)
            {
                search.take(value, trial(value));
            }
        }
        if search.width() > exact.max(width / 2.0) {
            let middle = f64::midpoint(search.low, search.high.0);
            search.take(middle, trial(middle));
        }
    }
    Some(search.low)
}

impl Search {
    fn width(&self) -> f64 {
        self.high.0 - self.low
    }

    /// Where the line through this power of the last two that fail reaches zero.
    fn estimate(&self, power: f64) -> Option<f64> {
        let (near, far) = (self.high, self.before?);
        let [near_by, far_by] = [near.1, far.1].map(|by| by.powf(power));
        let estimate = near.0 - near_by * (far.0 - near.0) / (far_by - near_by);
        estimate.is_finite().then_some(estimate)
    }

    fn take(&mut self, value: f64, fails_by: Option<f64>) {
        match fails_by {
            None => self.low = value,
            Some(by) => (self.before, self.high) = (Some(self.high), (value, by)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// What is found for a limit, and in how many trials.
    fn found(limit: f64, fails_by: impl Fn(f64) -> f64) -> (f64, usize) {
        let count = Cell::new(0);
        let trial = |value: f64| {
            count.set(count.get() + 1);
            (value > limit).then(|| fails_by(value - limit))
        };
        let high = trial(1000.0).expect("it fails");
        let found = last_that_holds((0.0, (1000.0, high)), 1e-7, &|| true, trial);
        (found.expect("nobody interrupts"), count.get())
    }

    #[test]
    fn the_limit_is_found_and_a_line_needs_few_trials() {
        for limit in [0.0, 1e-9, 0.3, 4.166, 77.0, 999.0] {
            let bend = |beyond: f64| beyond.min(3.0) + 0.1 * beyond;
            for (fails_by, trials) in [
                (&(|beyond| 0.3 * beyond) as &dyn Fn(f64) -> f64, 16),
                (&bend, 24),
                (&|beyond| beyond * beyond, 24),
                (&|beyond| beyond.sqrt(), 50),
                // Nothing to go by: halving.
                (&|_| f64::INFINITY, 40),
                (&|_| 1.0, 40),
            ] {
                let (found, count) = found(limit, fails_by);
                assert!(found <= limit && limit - found <= 1e-7, "{limit}: {found}");
                assert!(count <= trials, "{limit}: {count} trials, {trials} expected");
            }
        }
    }

    #[test]
    fn an_interrupted_search_finds_nothing() {
        assert_eq!(last_that_holds((0.0, (1.0, 1.0)), 1e-7, &|| false, |_| None), None);
    }
}
