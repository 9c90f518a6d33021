//! Draws programs: a seed gives the same program on every machine.
//!
//! Contours do not cross themselves but where tails do; what crosses is drawn again. All
//! else that a program may do is left to chance: the tool may fit or not, leads come from
//! anywhere.

mod contour;
mod language;
mod outline;
mod writer;

use crate::piece::{Piece, Point, point};
use crate::program::{CONTROLS, Corner, Element, End, Program, Role, Span};
use crate::random::Random;
use cnc_msgs::tool_table::{Offset, Tool, ToolTable};
use contour::{Planned, closed, lead, open};
use language::{ChangeOfSide, Language};
use settings::Control;
use std::f64::consts::PI;
use writer::Writer;

/// The program of a seed; six seeds in a row are for the six controls.
pub fn program(seed: u64) -> Program {
    let mut random = Random::new(seed);
    let control = CONTROLS[(seed % CONTROLS.len() as u64) as usize];
    loop {
        if let Some(program) = attempt(seed, control, &mut random) {
            return program;
        }
    }
}

/// Makes of a seed another one, for arcs as leads. The programs of `mended` have none.
const ARC_LEADS: u64 = 0x1_0000_0108;

/// What is the same all through a program.
struct Job {
    control: Control,
    language: Language,
    /// Never negative, mm.
    radius_mm: f64,
    /// The size of what is drawn goes by this: tools fit better into larger contours, mm.
    drawn_mm: f64,
    /// That of the second register.
    other_radius_mm: f64,
    /// −1: the value is negative, and the tool runs on the other side.
    sign: f64,
    /// The words that select the tool on `G41`.
    tool_words: String,
    features: Vec<&'static str>,
    /// For programs that begin with an arc; what else a seed draws stays as it was without them.
    arc_leads: Option<Random>,
}

fn attempt(seed: u64, control: Control, random: &mut Random) -> Option<Program> {
    let language = Language::of(control);
    let axes = match language.only_plane {
        Some(axes) => axes,
        None => random.of(&[[0, 1, 2], [0, 1, 2], [0, 1, 2], [2, 0, 1], [1, 2, 0]]),
    };
    let mut writer = Writer::new(language, random.of(&[3, 3, 4, 6]), axes);
    let radius_mm = random.of(&[0.4, 1.0, 2.0, 3.0, 5.0, 8.0]);
    let radius_mm =
        if random.once_in(3) { (random.between(0.3, 8.0) * 1e3).round() / 1e3 } else { radius_mm };
    let other_radius_mm = ((radius_mm * random.of(&[0.9, 0.98, 1.02, 1.1])) * 1e3).round() / 1e3;
    let sign = match language.has_negative_radius {
        true => random.of(&[1.0, 1.0, 1.0, 1.0, -1.0]),
        false => 1.0,
    };
    let mut arcs = Random::new(seed ^ ARC_LEADS);
    let has_arcs = language.has_arc_leads && arcs.once_in(4);
    let mut job = Job {
        control,
        language,
        radius_mm,
        drawn_mm: radius_mm * random.of(&language.sizes),
        other_radius_mm,
        sign,
        tool_words: String::new(),
        features: Vec::new(),
        arc_leads: Some(arcs).filter(|_| has_arcs),
    };
    if sign < 0.0 {
        job.features.push("negative radius");
    }
    let tools = header(&mut writer, &mut job, random);
    let mut spans = Vec::new();
    let mut height_mm = 0.0;
    let count = 1 + random.below(5) / 3 + random.below(4) / 3;
    if count > 1 {
        job.features.push("several spans");
    }
    let mut origin = point(0.0, 0.0);
    for _ in 0..count {
        height_mm -= random.of(&[0.0, 1.0, 2.0]);
        spans.extend(draw_spans(&mut writer, &mut job, origin, &mut height_mm, random)?);
        if !random.once_in(4) {
            origin = origin + point(60.0 * job.drawn_mm, random.between(-40.0, 40.0));
        }
    }
    for block in language.end {
        writer.block(block);
    }
    job.features.sort_unstable();
    job.features.dedup();
    let Job { features, .. } = job;
    Some(Program { seed, control, text: writer.text, tools, axes, spans, features })
}

/// The tool, and the blocks that come first.
fn header(writer: &mut Writer, job: &mut Job, random: &mut Random) -> ToolTable {
    let signed_mm = job.sign * job.radius_mm;
    let mut tools = ToolTable::default();
    let mut tool = Tool { diameter_mm: 2.0 * job.radius_mm, ..Tool::default() };
    let plane = match writer.axes {
        [0, ..] => "G17",
        [2, ..] => "G18",
        _ => "G19",
    };
    match job.control {
        Control::Rs274 => {
            writer.block(&format!("G21 G90 {plane} F600"));
            writer.block("T1 M6");
            job.tool_words = random.of(&["", " D1"]).into();
            if job.sign < 0.0 {
                job.tool_words = format!(".1 D{}", 2.0 * signed_mm);
            }
        }
        Control::Masso => {
            writer.block("G21 G90 G17 F600");
            writer.block("T1 M6");
            if job.sign < 0.0 {
                tool = Tool { diameter_mm: 0.0, wear_diameter_mm: 2.0 * signed_mm, ..tool };
            } else if random.once_in(3) {
                tool.diameter_mm = job.radius_mm;
                job.tool_words = format!(" P{}", job.radius_mm / 2.0);
            }
        }
        Control::Automation1 => {
            writer.block(&format!("G71 G90 {plane} F600"));
            let set = random.of(&["G43 P", "CutterCompensationSetRadius("]);
            let end = if set.ends_with('(') { ")" } else { "" };
            writer.block(&format!("{set}{}{end}", job.radius_mm));
        }
        Control::OspLathe => {
            writer.block("G90 G94");
            writer.block("T010101");
            writer.block("F600");
            tool = Tool { nose_radius_mm: job.radius_mm, ..Tool::default() };
        }
        Control::Sinumerik840c | Control::Nct => {
            writer.block(&format!("{plane} G90 F600"));
            job.tool_words = " D1".into();
            let offset =
                |radius_mm: f64| Offset { radius_mm: job.sign * radius_mm, ..Offset::default() };
            tools.offsets.insert(1, offset(job.radius_mm));
            tools.offsets.insert(2, offset(job.other_radius_mm));
        }
    }
    tools.tools.insert(1, tool);
    tools
}

/// One contour with its leads, or two with a change of side between them.
fn draw_spans(
    writer: &mut Writer,
    job: &mut Job,
    origin: Point,
    height_mm: &mut f64,
    random: &mut Random,
) -> Option<Vec<Span>> {
    let radius_mm = job.radius_mm;
    let word = random.of(&["G41", "G42"]);
    let side = if word == "G41" { job.sign } else { -job.sign };
    let is_closed = random.once_in(2);
    let any = random.between(0.0, 6.3);
    let angle = random.of(&[0.0, any]);
    let (planned, legs) = match is_closed {
        true => closed(job, side, angle, origin, random),
        false => (open(job, angle, origin, random), false),
    };
    let (first, last) = (planned.first()?.piece, planned.last()?.piece);
    // Some refuse an arc that the tool runs inside of and that is not twice as large.
    let is_tight = |it: &Planned| match it.piece {
        Piece::Arc { radius, sweep, .. } => sweep * side > 0.0 && radius < 2.0 * radius_mm,
        Piece::Line { .. } => false,
    };
    if job.language.refuses_tight_arcs && planned.iter().any(is_tight) && !random.once_in(30) {
        return None;
    }
    let (begin, end, select, cancel, corner) = words(writer, job, random);
    let outside = lead(first.start(), first.direction(0.0), side, radius_mm, random);
    let outside = writer.rounded(outside);
    writer.go("G0", outside);
    writer.height("G1", *height_mm);
    let rapid = job.language.has_rapid_leads && random.once_in(8);
    if rapid {
        job.features.push("rapid leads");
    }
    let mode = if rapid { "G0" } else { "G1" };
    if rapid && job.language.repeats_feed {
        writer.block("G1 F600");
    }
    let words = format!("{word}{}{select} ", job.tool_words);
    let own = job.arc_leads.as_mut().filter(|_| !rapid);
    match own.and_then(|own| Some((arc_lead(outside, &first, own)?, own))) {
        Some((arc, own)) => {
            writer.piece(&words, &arc, own);
            job.features.push("arc leads");
        }
        None => {
            writer.go(&format!("{words}{mode}"), first.start());
        }
    }
    let first_line = writer.line;
    let changes_at = change_of_tool(job, &planned, random);
    let mut span = Span {
        elements: Vec::new(),
        side,
        corner,
        begin: begin(outside),
        end: End::OtherSide,
        lines: (first_line, first_line),
        is_closed,
    };
    write(writer, job, &mut span, &planned, changes_at, "", height_mm, random);
    if legs {
        split_legs(&mut span)?;
    }
    if !is_simple(&span) {
        return None;
    }
    let may_change = job.language.change_of_side != ChangeOfSide::Never;
    let mut spans = Vec::new();
    if may_change && !is_closed && changes_at.is_none() && random.once_in(4) {
        job.features.push("change of side");
        span.lines.1 = writer.line;
        spans.push(span);
        span = other_side(writer, job, word, side, corner, last, height_mm, random)?;
    }
    let last = span.elements.last()?.shape;
    let outside = lead(last.end(), last.direction(1.0), span.side, radius_mm, random);
    let outside = writer.rounded(outside);
    writer.go(&format!("G40{cancel} {mode}"), outside);
    span.end = end(outside);
    span.lines.1 = writer.line;
    writer.height("G0", 5.0);
    spans.push(span);
    Some(spans)
}

/// An arc that leads from a point to a contour.
fn arc_lead(from: Point, first: &Piece, random: &mut Random) -> Option<Piece> {
    let (to, ahead) = (first.start(), first.direction(0.0));
    let chord = to - from;
    let is_tangent = random.once_in(2);
    // How far to the left of the chord the centre is.
    let left = match is_tangent {
        // On the normal of the contour; where that is along the chord there is none.
        true => chord.dot(ahead) / chord.cross(ahead) * chord.length() / 2.0,
        false => chord.length() * random.between(-2.0, 2.0),
    };
    let center = from + chord * 0.5 + chord.unit().left() * left;
    let is_ccw = match is_tangent {
        true => (to - center).left().dot(ahead) > 0.0,
        false => random.once_in(2),
    };
    let is_drawn = left.abs() < 50.0 * chord.length() && chord.length() > 1e-3;
    is_drawn.then(|| Piece::arc(from, to, center, is_ccw))
}

/// The contour after a change of side.
#[allow(clippy::too_many_arguments, reason = "a step of one function that draws")]
fn other_side(
    writer: &mut Writer,
    job: &mut Job,
    word: &str,
    side: f64,
    corner: Corner,
    last: Piece,
    height_mm: &mut f64,
    random: &mut Random,
) -> Option<Span> {
    let radius_mm = job.radius_mm;
    let other = if word == "G41" { "G42" } else { "G41" };
    let mut select = format!("{other} ");
    let mut start = last.end();
    if job.language.change_of_side == ChangeOfSide::OnOwnMove {
        let far = radius_mm * random.of(&[2.0, 4.0, 8.0]);
        start = start + point(far, 0.0).turned(random.between(0.0, 2.0 * PI));
        writer.go(&format!("{select}G1"), start);
        select.clear();
    }
    let first_line = writer.line + u32::from(!select.is_empty());
    let at = writer.at;
    let planned = open(job, random.between(0.0, 6.3), at, random);
    let mut span = Span {
        elements: Vec::new(),
        side: -side,
        corner,
        begin: End::OtherSide,
        end: End::OtherSide,
        lines: (first_line, first_line),
        is_closed: false,
    };
    write(writer, job, &mut span, &planned, None, &select, height_mm, random);
    is_simple(&span).then_some(span)
}

type Ends = fn(Point) -> End;

/// How a contour is entered, left and rounded, and the words for it.
fn words(
    writer: &mut Writer,
    job: &Job,
    random: &mut Random,
) -> (Ends, Ends, &'static str, &'static str, Corner) {
    let normal: Ends = |outside| End::Normal { outside };
    let joined: Ends = |outside| End::Joined { outside };
    match job.control {
        Control::Rs274 => (joined, normal, "", "", Corner::Arc),
        Control::OspLathe => (normal, normal, "", "", Corner::Intersection),
        Control::Nct => (normal, normal, "", "", Corner::Extended),
        Control::Sinumerik840c => {
            let (word, corner) = random.of(&[("G450", Corner::Arc), ("G451", Corner::Extended)]);
            writer.block(word);
            match random.once_in(2) {
                true => (normal, normal, " G456", " G456", corner),
                false => (joined, joined, "", "", corner),
            }
        }
        Control::Masso | Control::Automation1 => (normal, normal, "", "", Corner::Arc),
    }
}

/// The block that calls another tool, if one does: a straight one, not the first or the last.
fn change_of_tool(job: &mut Job, planned: &[Planned], random: &mut Random) -> Option<usize> {
    let is_long = |index: &usize| match planned[*index].piece {
        Piece::Line { .. } => planned[*index].piece.length() > 2.0 * job.radius_mm,
        Piece::Arc { .. } => false,
    };
    if !job.language.has_change_of_tool
        || !random.once_in(5)
        || planned.iter().any(|it| it.is_copy || it.pass > 0)
    {
        return None;
    }
    let at = (1..planned.len().saturating_sub(1)).find(is_long)?;
    job.features.push("D words");
    Some(at)
}

/// Writes a contour and takes down what was written.
#[allow(clippy::too_many_arguments, reason = "a step of one function that draws")]
fn write(
    writer: &mut Writer,
    job: &Job,
    span: &mut Span,
    planned: &[Planned],
    changes_at: Option<usize>,
    select: &str,
    height_mm: &mut f64,
    random: &mut Random,
) {
    for (index, block) in planned.iter().enumerate() {
        if block.goes_down {
            *height_mm -= 1.5;
            writer.height("G1", *height_mm);
        }
        if changes_at == Some(index) {
            writer.with(" D2");
        }
        let before = if index == 0 { select } else { "" };
        let shape = writer.piece(before, &block.piece, random);
        let radius_mm = match changes_at {
            Some(at) if at == index => (job.radius_mm, job.other_radius_mm),
            Some(at) if at < index => (job.other_radius_mm, job.other_radius_mm),
            _ => (job.radius_mm, job.radius_mm),
        };
        let (pass, role, is_copy) = (block.pass, block.role, block.is_copy);
        span.elements.push(Element { shape, line: writer.line, pass, role, radius_mm, is_copy });
    }
}

/// What lies beyond the place where the first and the last leg cross is a tail.
fn split_legs(span: &mut Span) -> Option<()> {
    let (first, last) = (*span.elements.first()?, *span.elements.last()?);
    let (Piece::Line { start, end }, true) = (last.shape, span.elements.len() > 2) else {
        return None;
    };
    let &[at] = &first.shape.parts_at_line(start, (end - start).unit())[..] else { return None };
    let &[other] = &last.shape.parts_at_line(first.shape.start(), first.shape.direction(0.0))[..]
    else {
        return None;
    };
    let part = |element: Element, low: f64, high: f64, role: Role| Element {
        shape: element.shape.between(low, high),
        role,
        ..element
    };
    let last_index = span.elements.len() - 1;
    span.elements[last_index] = part(last, 0.0, other, Role::Wall);
    span.elements.push(part(last, other, 1.0, Role::Tail { is_at_end: true }));
    span.elements[0] = part(first, at, 1.0, Role::Wall);
    span.elements.insert(0, part(first, 0.0, at, Role::Tail { is_at_end: false }));
    Some(())
}

/// Whether a contour meets itself only where it is to: at joints and where tails begin.
fn is_simple(span: &Span) -> bool {
    const TOUCH_MM: f64 = 6e-3;
    const CLEAR_MM: f64 = 4e-3;
    // Each wall once.
    let counts =
        |element: &&Element| !element.is_copy && (element.pass == 0 || element.role != Role::Wall);
    let once: Vec<&Element> = span.elements.iter().filter(counts).collect();
    let is_real = |element: &Element| {
        let length = element.shape.length();
        let has_room = match element.shape {
            Piece::Line { .. } => length > 3e-3,
            Piece::Arc { radius, .. } => radius > 0.03 && length > 0.02,
        };
        has_room && length < 2000.0
    };
    if !span.elements.iter().all(is_real) {
        return false;
    }
    let pairs =
        once.iter().enumerate().flat_map(|(index, a)| once[..index].iter().map(move |b| (*b, *a)));
    for (a, b) in pairs {
        let cut = |one: &Piece, other: &Piece| {
            let part = 0.4 * other.length().min(one.length()).min(2.5) / one.length();
            let is_tail = a.role != Role::Wall || b.role != Role::Wall;
            let touches = |end: Point| {
                let is_joint = [other.start(), other.end()].iter().any(|it| it.to(end) < 1e-9);
                is_joint || (is_tail && other.distance(end) < TOUCH_MM)
            };
            let low = if touches(one.start()) { part } else { 0.0 };
            let high = if touches(one.end()) { 1.0 - part } else { 1.0 };
            one.between(low, high)
        };
        let (one, other) = (cut(&a.shape, &b.shape), cut(&b.shape, &a.shape));
        let is_short = one.length().min(other.length()) < 0.05;
        if one.apart(&other) < if is_short { 1e-4 } else { CLEAR_MM } {
            return false;
        }
    }
    // After a corner it does not come back through what was before it.
    let comes_back = |pair: &[Element]| {
        let (before, after) = (&pair[0].shape, &pair[1].shape);
        let is_corner = before.direction(1.0).cross(after.direction(0.0)).abs() > 0.02;
        is_corner && after.meets(before).into_iter().any(|at| at.to(after.start()) > 1e-6)
    };
    if span.elements.windows(2).any(comes_back) {
        return false;
    }
    // A reversal is no corner.
    span.elements
        .windows(2)
        .all(|pair| pair[0].shape.direction(1.0).dot(pair[1].shape.direction(0.0)) > -0.97)
}
