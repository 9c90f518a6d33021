//! Reads the text of a part program into a programmed contour.
//!
//! ```text
//! bytes --line--> lexer --Block--> interpreter --events--> ProgrammedContour
//!         |          \__ dialect: what a word means __/
//!       reader: which line comes next, with flow for O words
//! ```
//!
//! The loader knows the languages of controls: how words are written, what they mean, in which
//! order a block is executed, where the tool is. Tool tables and the geometry of compensation are
//! the planner's. All findings of a program are collected, each with its place.
//!
//! Where RS-274 leaves a choice, the loader decides: F is in the units of its own block (grbl).
//! The radii of an arc may differ as LinuxCNC allows, but never by more than grbl allows. `G80`
//! may be in a block with G0 to G3. `G41 D0` is the tool in the spindle (LinuxCNC). G61, G64 and
//! G97 are accepted and have no effect, because a driver plans its own path.
//! M100 to M199 are functions of the machine.

mod appended;
mod block;
mod bounds;
mod curve;
mod dialect;
mod expression;
mod findings;
mod flow;
mod interpreter;
mod lexer;
mod line;
mod no_effect;
mod number;
mod parameters;
mod reader;
mod rules;
mod turning;
mod values;

pub mod answer;
pub mod canonical;
pub mod limits;
#[cfg(feature = "node")]
pub mod node;
pub mod parameter_file;
pub mod pieces;
pub mod probe_results;
pub mod render;
pub mod subroutines;
pub mod tool_rows;
pub mod upload;

pub use bounds::Bounds;

use cnc_msgs::calls::Calls;
use cnc_msgs::contour::{Action, ContourEventKind, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Position;
use cnc_msgs::profile::Profile;
use findings::Findings;
use flow::{Flow, FlowMap};
use interpreter::{Interpreter, code_in_tenths};
use limits::{FlowLimits, ProgramSize};
use parameter_file::{Left, Section};
use pieces::Whole;
use reader::{Parts, Read, Reader};
use rules::Rules;
use std::collections::{BTreeMap, BTreeSet};

/// How a program is loaded.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoadOptions {
    /// Where the tool is before the first block, in the work frame, mm.
    pub start: Position,
    /// Whether blocks that begin with `/` are skipped.
    pub block_delete: bool,
    /// The text is one block of manual data input: exactly one block, and no program end.
    pub is_single_block: bool,
    /// How long subroutines and loops may take.
    pub flow: FlowLimits,
    /// At which share of its way a probe is taken to touch whose result the text does not have; `None`: nobody
    /// knows where, and the contour ends where that is read.
    pub probes_touch_at: Option<f64>,
}

/// A program after reading.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Loaded {
    /// The contour; without events if any finding is an error.
    pub contour: ProgrammedContour,
    /// All findings in the order of the program.
    pub findings: Vec<Finding>,
    /// Number of lines of the text.
    pub line_count: u32,
    /// The box around all motion; `None` without motion or with an error.
    pub bounds: Option<Bounds>,
    /// The tools that M61 says are in the spindle, without a change.
    pub named_tools: Vec<(u32, Source)>,
    /// The parameters that the program has used, where it leaves any to the next one
    /// ([`parameter_file`]).
    pub left: Vec<Left>,
    /// The block that needs the result of a probe which the text does not have: the contour ends before
    /// it ([`probe_results`]).
    pub awaits: Option<Source>,
    /// Whether the program has read what the tool table has of a tool ([`tool_rows`]).
    pub reads_tools: bool,
    /// Why nodes, which hold all of a program, refuse this one. Only [`load_pieces`](pieces::load_pieces) accepts it.
    pub too_long: Option<Finding>,
}

impl Loaded {
    /// Whether the program has no errors, so that the planner may have it.
    pub fn is_accepted(&self) -> bool {
        !self.findings.iter().any(Finding::is_error)
    }

    /// Takes the table of calls without the rows that nothing in the contour was run in.
    fn take_calls(&mut self, mut calls: Calls) {
        if calls.is_empty() {
            return;
        }
        let of_events = self.contour.events.iter_mut().map(|event| &mut event.source);
        let mut places: Vec<&mut Source> =
            of_events.chain(self.named_tools.iter_mut().map(|(_, source)| source)).collect();
        let numbers = calls.keep(places.iter().map(|source| source.call));
        for finding in &mut self.findings {
            places.push(&mut finding.source);
            places.extend(&mut finding.other);
        }
        places.extend(&mut self.awaits);
        for source in places {
            source.call = numbers[source.call as usize];
        }
        self.contour.calls = calls;
    }

    /// Rejects a program that selects any tool other than these. An empty list allows all; T0,
    /// no tool in the spindle, is always allowed.
    pub fn allow_tools(&mut self, expected: &[u32]) {
        if expected.is_empty() {
            return;
        }
        let allowed: BTreeSet<u32> = expected.iter().copied().chain([0]).collect();
        let mut others = BTreeMap::new();
        for event in &self.contour.events {
            if let ContourEventKind::Action(
                Action::SelectTool { tool } | Action::ChangeTool { tool },
            ) = event.kind
                && !allowed.contains(&tool)
            {
                others.entry(tool).or_insert(event.source);
            }
        }
        for &(tool, source) in self.named_tools.iter().filter(|(tool, _)| !allowed.contains(tool)) {
            others.entry(tool).or_insert(source);
        }
        if others.is_empty() {
            return;
        }
        let mut others: Vec<_> = others.into_iter().collect();
        others.sort_by_key(|(_, source)| (source.line, source.column));
        let listed = listed(expected);
        let rest = others.split_off(others.len().min(limits::UNEXPECTED_TOOLS_MAX)).len();
        self.findings.extend(others.into_iter().map(|(tool, source)| {
            let message = format!("T{tool} is not one of the tools that are expected: {listed}");
            Finding::error(Code::UnknownTool, source, message).help(
                "load the program that belongs to this job, or add the tool to expected_tools",
            )
        }));
        self.contour.calls.explain(&mut self.findings);
        // Findings without a place stay at the end.
        let place = |found: &Finding| (found.source.line.wrapping_sub(1), found.source.column);
        self.findings.sort_by_key(place);
        if rest > 0 {
            let message = format!("{rest} more tools are not expected");
            self.findings.push(Finding::error(Code::Limit, Source::default(), message));
        }
        self.contour.events = Vec::new();
        self.contour.calls = Calls::default();
        self.bounds = None;
    }
}

/// `T1, T2`, and how many more.
fn listed(tools: &[u32]) -> String {
    let shown: Vec<_> =
        tools.iter().take(limits::UNEXPECTED_TOOLS_MAX).map(|tool| format!("T{tool}")).collect();
    match tools.len() - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Reads a part program in the dialect of a control.
///
/// Never fails: errors are in the findings. The text should be UTF-8 or ASCII; other bytes are
/// accepted in comments only. Time and memory are linear in the length of the text, and of what its
/// loops, subroutines and cycles execute, which [`limits`] bound.
pub fn load(text: &[u8], profile: &Profile, options: &LoadOptions) -> Loaded {
    load_in_parts(text, profile, options, usize::MAX, &mut |_| {})
}

/// [`load`] for a contour that need not be kept: once it has so many events, `take` is called with
/// it after each line without compensation, and may take all of its events. Without loops and subroutines that ends near the
/// end of the text. What it leaves comes again, and at last in what is returned; other fields of the contour are complete only
/// there, and the table of calls has the rows of what is left alone.
///
/// From the first error on nothing is taken.
pub fn load_in_parts(
    text: &[u8],
    profile: &Profile,
    options: &LoadOptions,
    part_events: usize,
    take: &mut dyn FnMut(&mut ProgrammedContour),
) -> Loaded {
    let (rules, mut findings) = rules_of(profile);
    let text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
    let (text, measured) = probe_results::split(text);
    let (text, tool_rows) = tool_rows::split(text);
    let text = without_filler(text);
    let text = if options.is_single_block { text.trim_ascii_end() } else { text };
    let line_feeds = memchr::memchr_iter(b'\n', text).count();
    let lines = line_feeds + usize::from(text.last().is_some_and(|&last| last != b'\n'));
    let line_count = u32::try_from(lines).unwrap_or(u32::MAX);

    if let Some(refusal) = refuse_whole(text, line_count) {
        findings.push(refusal);
        return refused(findings, options, line_count);
    }
    let flow = match (rules.dialect.lexer.programs, rules.dialect.lexer.parameters) {
        _ if options.is_single_block => FlowMap::default(),
        (Some(programs), _) => FlowMap::of_programs(text, programs, &mut findings),
        (None, true) => FlowMap::of(text, options.block_delete, &mut findings),
        (None, false) => FlowMap::default(),
    };
    if findings.has_error() {
        return refused(findings, options, line_count);
    }
    let has_file = rules.dialect.lexer.parameters && !options.is_single_block;
    let section = parameter_file::section_of(text).filter(|_| has_file);
    let no_section = Section::default();
    let stored = section.as_ref().unwrap_or(&no_section);
    let events = lines.min(text.len() / 4);
    let events = if part_events == usize::MAX { events } else { events.min(2 * part_events) };
    let mut interpreter = Interpreter::new(&rules, options.start, events);
    interpreter.store(stored, &mut findings);
    interpreter.take_results(measured, options.probes_touch_at);
    interpreter.take_tools(tool_rows);
    let flow = (!flow.entries.is_empty())
        .then(|| Flow::new(text, flow, rules.dialect.lexer.programs, options.flow));
    let mut reader = Reader::new(text, &rules, options, interpreter, flow, findings);
    reader.store(&stored.values);
    let parts = Parts { least: part_events, most: usize::MAX, take };
    let read = reader.read(&mut Whole::of(text), parts);
    loaded(read, options, line_count, has_file.then_some(section))
}

/// What a program has come to. `file`: its language has a parameter file, and the one that was appended to the text.
fn loaded(
    read: Read<'_>,
    options: &LoadOptions,
    line_count: u32,
    file: Option<Option<Section>>,
) -> Loaded {
    let Read { interpreter, parameters, mut findings, calls, awaits, deleted } = read;
    if let Some(source) = awaits {
        findings.begin_block();
        let message = "what follows needs the result of a probe or of M66: it is planned and judged while the run waits here";
        let help = match interpreter.waits_for_probe() {
            true => {
                "to have all of it judged before the run, set the zero where the probe has touched with \
                 G10 L20, and write places as numbers from there"
            }
            false => "read no #5399 if all of it is to be judged before the run",
        };
        findings.push(Finding::warning(Code::Unsupported, source, message).help(help));
    }
    if let Some((source, share)) = interpreter.made_up_at().zip(options.probes_touch_at) {
        findings.begin_block();
        let message = format!(
            "what follows is planned as if each probe touched at {} % of its way; a run goes on from where it touches",
            100.0 * share
        );
        findings.push(Finding::warning(Code::Unsupported, source, message));
    }
    let is_whole = awaits.is_none();
    let has_file = file.is_some();
    let section = file.flatten();
    let keeps = section.is_some();
    let stored = section.unwrap_or_default().values;
    let mut left = if has_file && is_whole { parameters.left(&stored) } else { Vec::new() };
    findings.begin_block();
    for rotated in interpreter.rotations_left().filter(|_| is_whole) {
        match keeps {
            true => left.push(rotated.left(&stored)),
            false => rotated.forgotten().into_iter().for_each(|it| findings.push(it)),
        }
    }
    // A program that is refused has other troubles.
    let no_effects = interpreter.no_effects(is_whole).chain(deleted.findings(None));
    for finding in no_effects.take(if findings.has_error() { 0 } else { usize::MAX }) {
        findings.begin_block();
        findings.push(finding);
    }
    findings.explain(&calls);
    let reads_tools = interpreter.has_read_tools();
    if findings.has_error() {
        return Loaded { reads_tools, ..refused(findings, options, line_count) };
    }
    let too_long = interpreter.too_long();
    let (contour, bounds, named_tools) = interpreter.finish();
    let findings = findings.finish();
    let mut loaded = Loaded {
        contour,
        findings,
        line_count,
        bounds,
        named_tools,
        left,
        awaits,
        reads_tools,
        too_long,
    };
    loaded.take_calls(calls);
    loaded
}

/// A program that is refused: it has no contour.
fn refused(findings: Findings, options: &LoadOptions, line_count: u32) -> Loaded {
    let contour = ProgrammedContour { start: options.start, ..ProgrammedContour::default() };
    Loaded { contour, findings: findings.finish(), line_count, ..Loaded::default() }
}

/// The rules of a profile, and what is wrong with its words.
fn rules_of(profile: &Profile) -> (Rules<'_>, Findings) {
    let (rules, wrong_words) = Rules::of(profile);
    let mut findings = Findings::default();
    for wrong in wrong_words {
        findings.begin_block();
        findings.push(wrong);
    }
    (rules, findings)
}

/// What to do with a program that nobody holds.
const LONG_HELP: &str =
    "split the program; `kerf plan --quiet` may judge one of plain lines without holding it";

/// Why a program of this size is refused by all who hold it, as [`load`] does.
pub fn too_long(size: ProgramSize, most: ProgramSize) -> Option<Finding> {
    let message = if size.bytes > most.bytes {
        format!("the program has {} bytes; at most {} are accepted", size.bytes, most.bytes)
    } else if size.lines > most.lines {
        format!("the program has {} lines; at most {} are accepted", size.lines, most.lines)
    } else {
        return None;
    };
    Some(Finding::error(Code::Limit, Source::default(), message).help(LONG_HELP))
}

/// Checks for which a program is rejected before its lines are read.
fn refuse_whole(text: &[u8], lines: u32) -> Option<Finding> {
    let size = ProgramSize { bytes: text.len() as u64, lines };
    let too_long = too_long(size, ProgramSize::HELD_MAX);
    if too_long.is_some() {
        return too_long;
    }
    if is_utf_16(text) {
        let message = "the program is UTF-16 text";
        let help = "save it as plain text (ASCII or UTF-8)";
        return Some(Finding::error(Code::Syntax, Source::default(), message).help(help));
    }
    None
}

/// What begins a text in UTF-8, for some editors.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

fn is_utf_16(text: &[u8]) -> bool {
    text.starts_with(b"\xFF\xFE") || text.starts_with(b"\xFE\xFF")
}

/// A text without what fills the last block of some senders (0x00), and what DOS ended texts with
/// (0x1A).
pub(crate) fn without_filler(text: &[u8]) -> &[u8] {
    let zeros = text.iter().rev().take_while(|byte| **byte == 0).count();
    let text = if zeros < text.len() { &text[..text.len() - zeros] } else { text };
    text.strip_suffix(b"\x1A").unwrap_or(text)
}
