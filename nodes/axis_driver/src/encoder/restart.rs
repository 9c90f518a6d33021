//! Beginning in the middle of a program.
//!
//! A run may begin at the first element of a source line; under cutter compensation only
//! where the control of the program begins there. What the words before
//! it have set is sent first: tool (to be
//! confirmed), work system, tool length, spindle, coolant. Dwells, stops and moves are
//! not repeated. The tool must stand where that element starts, in all axes that the program has moved,
//! A to W included, which is checked after the words that move the frame; or, where a height is given at which
//! it is clear of everything, it is lifted there before anything else. At that height A to W go where the
//! program has them, so that nothing turns under the tool; then the tool goes over the
//! place, and down to it at the feed in force there. A start at the first motion is lifted, too, where it
//! leaves words or moves before it out: the program's own retract may be one of them. Under compensation
//! the tool comes down at a point of the compensated path, along its own axis, so that the plunge removes
//! only what the path removes there too. Where Z lies in the plane of compensation that is not so, and the tool
//! must stand there. Where the program has left an axis elsewhere since
//! it gave its place (a retract in the machine frame, a reference point, another work
//! system), nothing is known that could be gone to: the tool stays at that height if it is
//! Z, and else the start is refused. Where no line has named Z yet it stays up too, if Z is named
//! before anything is cut.

use super::{AllowedOverrides, EncodeError, Encoder, EncoderConfig, UserFunction};
use cnc_msgs::contour::Action;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::path::{
    CompensatedPath, FurtherPlace, KnownPlace, NoEntry, PathElement, PathEvent, Role, StartInSpan,
    UnknownAxes, in_force,
};
use cnc_msgs::port_word::PortWord;
use std::sync::Arc;

const Z: AxisSet = AxisSet::from_bits(0b100);

/// Why a run cannot begin at a line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StartProblem {
    #[error("{}", no_entry(.0))]
    NoEntry(#[from] NoEntry),
    #[error(
        "line {line} is under cutter compensation: the nearest lines to begin at are {}",
        nearest(*.before, *.after)
    )]
    UnderCompensation {
        line: u32,
        /// The first line of the compensation, and the first one after its end.
        before: u32,
        after: Option<u32>,
    },
    #[error(
        "line {line} begins where {axes} {} not been given since {since}: begin after a line that gives {axes}",
        if axes.len() == 1 { "has" } else { "have" }
    )]
    UnknownPlace { line: u32, axes: String, since: String },
    #[error("line {line} comes after {word} in line {at}, and this controller has no {word}")]
    MachineFunction { line: u32, word: String, at: u32 },
    #[error("line {line} comes after {word}, which stores where the tool is: begin before it")]
    StoredPosition { line: u32, word: String },
    #[error(
        "line {line}: the tool would come down to Z{z_mm:.3} at rapid, since no move of X, Y or Z alone has a feed; \
         begin at line 1, or write F and G1 into the line that goes down to Z{z_mm:.3}"
    )]
    NoFeed { line: u32, z_mm: f64 },
    #[error(transparent)]
    Encode(Box<EncodeError>),
}

/// Whether a run is one of the whole program, and no start in the middle: lines 0 and 1, unless a later
/// time is asked for.
pub(crate) fn is_whole((line, occurrence): (u32, u32)) -> bool {
    line <= 1 && occurrence <= 1
}

/// An encoder that begins with the first element of `line` or after it, the time `occurrence` that it
/// is run (0: the only one), and the index of that element.
/// `in_span` is what the control of the program says of a start under compensation.
pub fn start_at(
    path: Arc<CompensatedPath>,
    config: EncoderConfig,
    (line, occurrence): (u32, u32),
    in_span: StartInSpan,
) -> Result<(Encoder, usize), StartProblem> {
    let mut encoder = Encoder::new(path.clone(), config);
    if is_whole((line, occurrence)) {
        return Ok((encoder, 0));
    }
    let entry = path.entry(line, occurrence)?;
    let index = entry.element;
    let is_in_span = path.begins_in_span(index);
    if is_in_span && in_span == StartInSpan::Refused {
        let before = path.elements[..index].iter().rfind(|element| element.role == Role::LeadOn);
        let before = before.map_or(1, |element| element.source.line);
        let is_free = |element: &&PathElement| {
            matches!(element.role, Role::None | Role::LeadOn) && element.source.line > line
        };
        let after = path.elements[index..].iter().find(is_free).map(|element| element.source.line);
        return Err(StartProblem::UnderCompensation { line, before, after });
    }
    encoder.next_element = index;
    encoder.next_event = entry.event;
    let restored = restored(&path, encoder.next_event, (line, index))?;
    let source_place = path.elements[index].source;
    let comes_down = !is_in_span || in_span == StartInSpan::FromAbove;
    let height = config.approach_z_mm.filter(|_| comes_down);
    // Without a lift, before the first motion, the tool is wherever the path expects it, as for the whole.
    let place = match (index, height) {
        (0, None) => KnownPlace::default(),
        _ => path.known_place(index, encoder.next_event),
    };
    if is_in_span && !place.unknown.is_empty() {
        // From elsewhere the first element would leave the path.
        let axes = place.unknown;
        return Err(refuse(place, line, axes));
    }
    let further = encoder.further_place();
    let pushed = match height {
        Some(height) => {
            // At the safe height the axes may come from anywhere to where the line takes them.
            let in_plane = place.unknown.without(Z);
            let given = path.elements[index].axes.without(path.relative_axes(index));
            let is_taken = place.unknown.contains(2) && in_plane.without(given).is_empty();
            if place.untouched.contains(2) && !names_z_first(&path, index) {
                return Err(refuse(place, line, Z));
            }
            if !in_plane.is_empty() && !is_taken {
                return Err(refuse(place, line, in_plane));
            }
            let counted = counted(&path.unknown_from(index, place.unknown));
            if !counted.is_empty() {
                return Err(refuse(place, line, counted));
            }
            let turned = path.further_given(encoder.next_event, index);
            let turned = if place.unknown.contains(2) { turned } else { FurtherAxes::NONE };
            refuse_lost(&further, turned, line)?;
            let given = place.known();
            if given.contains(2) && encoder.plunge_feed(index).is_none() {
                return Err(StartProblem::NoFeed { line, z_mm: path.start_of(index)[2] });
            }
            encoder.push_approach(height, &restored, index, (given, further.at))
        }
        None if !place.unknown.is_empty() => {
            let axes = place.unknown;
            return Err(refuse(place, line, axes));
        }
        None => {
            refuse_lost(&further, FurtherAxes::NONE, line)?;
            encoder.start_axes = match index {
                0 => path.assumed_axes,
                _ => AxisSet::ALL.without(place.untouched),
            };
            encoder.push_restored(&restored, further.at)
        }
    };
    pushed.map_err(|problem| {
        StartProblem::Encode(Box::new(EncodeError::new(&path, source_place, problem)))
    })?;
    let (mut allowed, mut word) = (AllowedOverrides::default(), source_place);
    for event in &path.events[..encoder.next_event] {
        if let Some(Ok(after)) = allowed.after(&event.action) {
            (allowed, word) = (after, event.source);
        }
    }
    encoder.allow_overrides(allowed, word);
    Ok((encoder, index))
}

impl Encoder {
    /// The axes whose place the path says here.
    pub(crate) fn known_axes(&self) -> AxisSet {
        self.path.known_place(self.next_element, self.next_event).known()
    }

    /// Where the path has left the axes A to W that are sent, before what comes next.
    pub(crate) fn further_place(&self) -> FurtherPlace {
        let FurtherPlace { at, lost, since } = self.path.further_after(self.next_event);
        let sent =
            |axes: FurtherAxes| axes.iter().filter(|(axis, _)| !self.leaves_out(*axis)).collect();
        FurtherPlace { at: sent(at), lost: sent(lost), since }
    }

    /// Whether what follows counts from a place that the path does not say.
    pub(crate) fn counts_from_unknown(&self) -> bool {
        let place = self.path.known_place(self.next_element, self.next_event);
        !counted(&self.path.unknown_from(self.next_element, place.unknown)).is_empty()
    }
}

/// Whether the path gives Z from this element on before it moves anything at feed.
fn names_z_first(path: &CompensatedPath, index: usize) -> bool {
    for number in index..path.elements.len() {
        let element = &path.elements[number];
        if element.axes.without(path.relative_axes(number)).contains(2) {
            return true;
        }
        if element.feed_mm_per_min.is_some() {
            return false;
        }
    }
    true
}

/// The axes whose place counts, although the path does not say it.
fn counted(unknown: &UnknownAxes) -> AxisSet {
    unknown.zeroed.map_or(unknown.relative, |(_, axes)| axes.union(unknown.relative))
}

/// The words before a line that are sent again: work offsets that the controller is to store, then
/// those in force.
fn restored(
    path: &CompensatedPath,
    before: usize,
    (line, element): (u32, usize),
) -> Result<Vec<PathEvent>, StartProblem> {
    let mut restored = Vec::new();
    let events = &path.events[..before];
    for (index, event) in events.iter().enumerate() {
        match event.action {
            Action::SetWorkOffset { by_position: false, .. } => restored.push(*event),
            Action::Further(_)
                if matches!(path.further_owner(index), Some(Action::SetWorkOffset { .. })) =>
            {
                restored.push(*event);
            }
            // It would be in force there, as G96 is.
            Action::Auxiliary { .. }
                if UserFunction::of(&event.action).is_none()
                    && PortWord::of(&event.action).is_none()
                    && !matches!(AllowedOverrides::default().after(&event.action), Some(Ok(_))) =>
            {
                let (word, at) = (event.action.text(), event.source.line);
                return Err(StartProblem::MachineFunction { line, word, at });
            }
            Action::SetWorkOffset { by_position: true, .. } | Action::StoreReference { .. } => {
                return Err(StartProblem::StoredPosition { line, word: event.action.text() });
            }
            _ => {}
        }
    }
    restored.extend(in_force(events, element));
    Ok(restored)
}

/// Refuses a start where axes A to W are somewhere that the path does not say, and are not given next.
fn refuse_lost(place: &FurtherPlace, given: FurtherAxes, line: u32) -> Result<(), StartProblem> {
    let lost = place.lost.without_all(given);
    match lost.is_empty() {
        true => Ok(()),
        false => {
            let (axes, since) = (lost.letters(), place.since.clone());
            Err(StartProblem::UnknownPlace { line, axes, since })
        }
    }
}

fn refuse(place: KnownPlace, line: u32, axes: AxisSet) -> StartProblem {
    StartProblem::UnknownPlace { line, axes: axes.letters(), since: place.since }
}

fn no_entry(refused: &NoEntry) -> String {
    format!("{refused}; {}", refused.help())
}

fn nearest(before: u32, after: Option<u32>) -> String {
    match after {
        Some(after) => format!("{before}, where it begins, and {after}, where it has ended"),
        None => format!("{before}, where it begins; it does not end before the program does"),
    }
}
