//! How far the lines are done for sure.

/// Where the tool has been for sure: in this move, after this share of it.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub(super) struct Bound {
    pub(super) index: usize,
    pub(super) part: f64,
}

impl Bound {
    /// The same when so many moves before it are gone.
    pub(super) fn after(self, gone: usize) -> Self {
        match self.index.checked_sub(gone) {
            Some(index) => Self { index, ..self },
            None => Self::default(),
        }
    }

    pub(super) fn earlier(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    pub(super) fn later(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}
