//! The links of a chain in few bytes: a long contour has millions.
//!
//! What a run has already is not kept twice, and a corner is made of its neighbours again.

use crate::geometry::element::Element;
use crate::span::Run;
use crate::span::chain::{ChainLink, Role};

/// All links, without their runs.
#[derive(Debug, Default)]
pub(crate) struct ChainLinks {
    kept: Vec<Kept>,
    entry: Option<ChainEnd>,
    exit: Option<ChainEnd>,
    /// The radii of the runs are multiplied by this.
    scale: f64,
}

/// A link that is no run, and no corner.
#[derive(Debug, Clone, Copy)]
struct ChainEnd {
    element: Element,
    d_mm: f64,
}

/// What a link has besides its run.
#[derive(Debug, Clone, Copy)]
struct Kept {
    kind: Kind,
    is_smooth: bool,
    is_lengthened: bool,
    /// The run, or the leg after a corner.
    index: u32,
    /// The longest straight of a run, mm; the sweep of a corner, rad.
    measure: f64,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Entry,
    Run,
    Corner,
    Exit,
}

impl ChainLinks {
    /// Without any link, for so many runs whose radii are multiplied by `scale`.
    pub(crate) fn new(runs: usize, scale: f64) -> Self {
        Self { kept: Vec::with_capacity(2 * runs + 2), scale, ..Self::default() }
    }

    /// Appends a link. Of a run it keeps its number, and of a corner its sweep.
    pub(crate) fn push(&mut self, link: &ChainLink) {
        let end = ChainEnd { element: link.element, d_mm: link.d_in_mm };
        let straight_mm = f64::from(link.straight_mm);
        let (kind, index, measure) = match (link.role, &link.element) {
            (Role::Run(run), _) => (Kind::Run, run, straight_mm),
            (Role::Corner { next_leg }, Element::Arc(arc)) => (Kind::Corner, next_leg, arc.sweep),
            (Role::Corner { next_leg }, Element::Line(_)) => (Kind::Corner, next_leg, 0.0),
            (Role::Entry, _) => {
                self.entry = Some(end);
                (Kind::Entry, 0, straight_mm)
            }
            (Role::Exit, _) => {
                self.exit = Some(end);
                (Kind::Exit, 0, straight_mm)
            }
        };
        let ChainLink { is_smooth, is_lengthened, .. } = *link;
        self.kept.push(Kept { kind, is_smooth, is_lengthened, index: index as u32, measure });
    }

    /// With the runs that they were made of.
    pub(crate) fn of<'a>(&'a self, runs: &'a [Run]) -> Links<'a> {
        Links { all: self, runs, from: 0, to: self.kept.len(), part: 1.0 }
    }

    /// Gives each run its longest straight, mm.
    pub(crate) fn measure_straights(&mut self, mut of_run: impl FnMut(usize) -> f32) {
        for kept in self.kept.iter_mut().filter(|kept| matches!(kept.kind, Kind::Run)) {
            kept.measure = f64::from(of_run(kept.index as usize));
        }
    }
}

/// Consecutive links of a chain.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Links<'a> {
    all: &'a ChainLinks,
    runs: &'a [Run],
    from: usize,
    to: usize,
    /// All radii are multiplied by this.
    part: f64,
}

impl<'a> Links<'a> {
    pub(crate) fn len(self) -> usize {
        self.to - self.from
    }

    /// The link of this index.
    #[inline]
    pub(crate) fn at(self, index: usize) -> ChainLink {
        let at = self.from + index;
        let kept = self.all.kept[at];
        match kept.kind {
            Kind::Run => self.with(kept, self.own(kept)),
            _ => self.no_run(at),
        }
    }

    /// A corner or an end. Not inline, so that runs are.
    #[inline(never)]
    fn no_run(self, at: usize) -> ChainLink {
        let kept = self.all.kept[at];
        match kept.kind {
            Kind::Corner => {
                // It has a run or an end on both sides.
                let [before, after] = [at - 1, at + 1].map(|at| self.own(self.all.kept[at]));
                let tangents = (before.0.end_tangent(), after.0.start_tangent());
                let corner = Element::bend(after.0.start(), tangents, after.1, kept.measure);
                ChainLink { straight_mm: 0.0, ..self.with(kept, (corner, after.1, after.1)) }
            }
            _ => self.with(kept, self.own(kept)),
        }
    }

    #[inline]
    fn with(self, kept: Kept, (element, d_in_mm, d_out_mm): (Element, f64, f64)) -> ChainLink {
        ChainLink {
            role: kept.role(),
            element,
            d_in_mm: d_in_mm * self.part,
            d_out_mm: d_out_mm * self.part,
            is_smooth: kept.is_smooth,
            straight_mm: kept.measure as f32,
            is_lengthened: kept.is_lengthened,
        }
    }

    /// The element of a run or of an end, and its offsets.
    #[inline]
    fn own(self, kept: Kept) -> (Element, f64, f64) {
        let end = match kept.kind {
            Kind::Run | Kind::Corner => {
                let run = &self.runs[kept.index as usize];
                let scale = self.all.scale;
                return (run.element, run.d_in_mm * scale, run.d_out_mm * scale);
            }
            Kind::Entry => self.all.entry,
            Kind::Exit => self.all.exit,
        };
        let ChainEnd { element, d_mm } = end.expect("an end that was pushed");
        (element, d_mm, d_mm)
    }

    /// What the link of this index is made from.
    #[inline]
    pub(crate) fn role(self, index: usize) -> Role {
        self.all.kept[self.from + index].role()
    }

    pub(crate) fn iter(
        self,
    ) -> impl DoubleEndedIterator<Item = ChainLink> + ExactSizeIterator + use<'a> {
        (0..self.len()).map(move |index| self.at(index))
    }

    /// The links `from..to` of these.
    pub(crate) fn range(self, from: usize, to: usize) -> Self {
        Self { from: self.from + from, to: self.from + to, ..self }
    }

    /// The same with all radii multiplied by `part`.
    pub(crate) fn scaled(self, part: f64) -> Self {
        Self { part: self.part * part, ..self }
    }
}

impl Kept {
    #[inline]
    fn role(self) -> Role {
        let index = self.index as usize;
        match self.kind {
            Kind::Entry => Role::Entry,
            Kind::Run => Role::Run(index),
            Kind::Corner => Role::Corner { next_leg: index },
            Kind::Exit => Role::Exit,
        }
    }
}
