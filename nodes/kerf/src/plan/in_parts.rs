//! Plans a long program in parts while it is being read, where only its errors are shown: no part is kept.

use super::long_program::LongProgram;
use super::{Planned, keep_for_report};
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::node::parts::{Outcome, PartsVerdict};
use compensation_planner::{Planning, Verdict, judge};
use program_loader::limits::EVENTS_MAX;
use program_loader::pieces::load_pieces;
use program_loader::{LoadOptions, Loaded, load_in_parts};
use std::ops::RangeInclusive;

/// The least events of a part: enough spans for all processors, and as few as stay in their caches.
const PART_EVENTS: usize = 16_384;
/// Events of a part of a file: as many as are held of a whole program, at most.
pub(super) const FILE_PART_EVENTS: RangeInclusive<usize> = PART_EVENTS..=EVENTS_MAX;

impl Planned {
    /// For callers that show errors only: what is accepted may come without its contour, its path,
    /// and the warnings of the planner.
    ///
    /// A long program is planned in parts while it is still being read, and no part is kept.
    pub(super) fn without_path(
        text: &[u8],
        profile: &Profile,
        tools: &ToolTable,
        options: &LoadOptions,
        planning: Planning<'_>,
    ) -> Self {
        let (mut loaded, is_accepted) = std::thread::scope(|scope| {
            let mut parts = PartsVerdict::new(scope, profile, tools, planning.workers, u64::MAX);
            let mut loaded = load_in_parts(text, profile, options, PART_EVENTS, &mut |contour| {
                parts.take(contour);
            });
            if loaded.reads_tools {
                return (loaded, Some(false));
            }
            if parts.is_untouched() || !loaded.is_accepted() {
                return (loaded, None);
            }
            let rest = std::mem::take(&mut loaded.contour);
            let is_accepted = matches!(parts.judge(rest), Ok(None));
            (loaded, Some(is_accepted))
        });
        match is_accepted {
            None => Self::of(loaded, profile, tools, planning),
            // It is read again with the tools, or to say why it is refused.
            Some(false) => Self::new(text, profile, tools, options, planning),
            Some(true) => {
                let findings = std::mem::take(&mut loaded.findings);
                Self { loaded, verdict: Verdict::default(), findings, on_machine: None }
            }
        }
    }
}

/// What comes of planning a long file without holding it.
#[derive(Debug)]
pub(super) enum OfFile {
    /// Its lines need each other, so that the text is to be read whole.
    NotPlain,
    Judged {
        is_accepted: bool,
        shown: Vec<Finding>,
    },
}

impl OfFile {
    pub(super) fn plan(
        program: &mut LongProgram<'_>,
        profile: &Profile,
        tools: &ToolTable,
        options: &LoadOptions,
        planning: Planning<'_>,
        part_events: RangeInclusive<usize>,
    ) -> Self {
        let planned = std::thread::scope(|scope| {
            let memory = memory_bytes_max();
            let mut parts = PartsVerdict::new(scope, profile, tools, planning.workers, memory);
            let take = &mut |contour: &mut _| parts.take(contour);
            let mut loaded = load_pieces(program, profile, options, part_events, take)?;
            let rest = std::mem::take(&mut loaded.contour);
            let outcome = match (loaded.is_accepted(), parts.is_untouched()) {
                (false, _) => Ok(None),
                (true, false) => parts.judge(rest),
                (true, true) => {
                    let verdict = judge(&rest, profile, tools, planning);
                    if verdict.plan.accepted() { Ok(None) } else { Err(Box::new(verdict)) }
                }
            };
            Some((loaded, outcome))
        });
        let (loaded, outcome) = match planned {
            Some((loaded, outcome)) if program.is_read() && !loaded.reads_tools => {
                (loaded, outcome)
            }
            _ => return Self::NotPlain,
        };
        let too_long = program.too_long(loaded.line_count);
        let is_accepted = loaded.is_accepted() && outcome.is_ok();
        if let Err(verdict) = &outcome
            && let Some(found) = &verdict.disagreement
        {
            keep_for_report(&program.name(), &program.beginning(), found);
        }
        Self::Judged { is_accepted, shown: shown(loaded, outcome, too_long) }
    }
}

/// What is shown of a program of which nothing is held. `too_long`: why it cannot be.
fn shown(loaded: Loaded, outcome: Outcome, too_long: Option<Finding>) -> Vec<Finding> {
    let too_long = too_long.or(loaded.too_long);
    let awaits = loaded.awaits;
    let mut shown = loaded.findings;
    shown.retain(Finding::is_error);
    match outcome {
        Ok(too_long_path) if shown.is_empty() => {
            shown.extend(too_long.or(too_long_path).map(|limit| too_long_to_run(limit, awaits)));
        }
        Ok(_) => {}
        Err(verdict) => {
            shown.extend(verdict.plan.findings.into_iter().filter(Finding::is_error));
            shown.push(rest_not_planned());
        }
    }
    shown
}

/// The plan is good, and yet no machine runs it: the only warning that is shown.
fn too_long_to_run(limit: Finding, awaits: Option<Source>) -> Finding {
    // What follows needs the result of a probe or of M66.
    let until = awaits.map_or(String::new(), |at| format!(" up to line {}", at.line));
    let message =
        format!("the program is planned{until}, and too long to be run: {}", limit.message);
    Finding::warning(Code::Limit, limit.source, message)
        .help("split the program into several to run it")
}

fn rest_not_planned() -> Finding {
    let message = "what follows is not planned: the program is too long to be planned whole";
    let warning = Finding::warning(Code::Limit, Source::default(), message);
    warning.help("correct what is listed, or split the program to have all errors listed")
}

/// What the walls of all contours may take, bytes: three quarters of what is free. A process that takes all is killed by
/// the kernel, or another one is.
fn memory_bytes_max() -> u64 {
    let known = std::fs::read_to_string("/proc/meminfo").ok();
    known.and_then(|text| available_bytes(&text)).map_or(u64::MAX, |bytes| bytes / 4 * 3)
}

fn available_bytes(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensation_planner::Alone;
    use program_loader::limits::ProgramSize;

    #[test]
    fn available_memory_is_read_as_the_kernel_writes_it() {
        let text = "MemTotal:       24635708 kB\nMemFree:  19 kB\nMemAvailable:   22000000 kB\n";
        assert_eq!(available_bytes(text), Some(22_528_000_000));
        assert_eq!(available_bytes("MemTotal: 1 kB\n"), None);
    }

    /// A square of this size with its corner at this X, the tool of 4 mm inside.
    fn square(x_mm: f64, side_mm: f64) -> String {
        let [middle, right] = [x_mm + side_mm / 2.0, x_mm + side_mm];
        let half = side_mm / 2.0;
        format!(
            "G0 X{middle} Y{half}\nG41.1 D4 G1 X{middle} Y0\nX{right} Y0\nX{right} Y{side_mm}\nX{x_mm} Y{side_mm}\n\
             X{x_mm} Y0\nX{middle} Y0\nG40 G1 X{middle} Y{half}\n"
        )
    }

    /// Ten squares, and what follows them: 82 lines and more.
    fn program(end: &str) -> String {
        let squares: String = (0..10).map(|at| square(40.0 * f64::from(at), 30.0)).collect();
        format!("G21 G17 G90 G40 F1000\nT1 M6\n{squares}{end}M2\n")
    }

    /// What is planned of a file in parts of so many events, where so many lines are held; and the lines that findings show.
    fn planned(
        text: &str,
        part_events: RangeInclusive<usize>,
        lines_max: u32,
    ) -> (OfFile, Vec<(u32, String)>) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("long.ngc");
        std::fs::write(&path, text).expect("written");
        let most = ProgramSize { lines: lines_max, ..ProgramSize::HELD_MAX };
        let mut program = LongProgram::of(&path, most).expect("a long program");
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        let (tools, options) = (ToolTable::default(), LoadOptions::default());
        let planning = Planning { certifies: false, workers: &Alone };
        let of_file = OfFile::plan(&mut program, &profile, &tools, &options, planning, part_events);
        let findings = if let OfFile::Judged { shown, .. } = &of_file { &shown[..] } else { &[] };
        let lines = program.lines(findings).expect("read");
        (of_file, lines)
    }

    /// Each finding that is shown: whether it is an error, its line, and its message.
    fn judged(of_file: &OfFile) -> Option<Vec<(bool, u32, &str)>> {
        let OfFile::Judged { is_accepted, shown } = of_file else { return None };
        assert_eq!(*is_accepted, !shown.iter().any(Finding::is_error), "{shown:?}");
        Some(shown.iter().map(|it| (it.is_error(), it.source.line, &*it.message)).collect())
    }

    #[test]
    fn a_program_that_no_node_holds_is_judged_in_parts() {
        let narrow = square(1000.0, 3.5);
        let not_planned =
            "what follows is not planned: the program is too long to be planned whole";
        let too_long = "the program is planned, and too long to be run: the program has 83 lines; at most 82 are accepted";
        // What follows the squares; the findings, and the lines that they show.
        for (end, wanted, shown) in [
            ("", &[(false, 0, too_long)][..], &[][..]),
            (
                &narrow,
                &[
                    (true, 84, "the lead-on is 1.750 mm long"),
                    (true, 84, "cuts 2.0000 mm into line 86"),
                    (true, 86, "does not reach line 85 to line 89"),
                    (true, 90, "cuts 2.0000 mm into line 86"),
                    (false, 0, not_planned),
                ],
                &["G41.1 D4 G1 X1001.75 Y0", "X1003.5 Y3.5", "G40 G1 X1001.75 Y1.75"],
            ),
            ("G1 X\nG1 Y1 Y2\n", &[(true, 83, "X"), (true, 84, "Y")], &["G1 X", "G1 Y1 Y2"]),
        ] {
            for part_events in [1, 20, 1000] {
                let (of_file, lines) = planned(&program(end), part_events..=1000, 82);
                let found = judged(&of_file).unwrap_or_else(|| panic!("{end}: {of_file:?}"));
                assert_eq!(found.len(), wanted.len(), "{found:?}");
                for (found, wanted) in found.iter().zip(wanted) {
                    assert_eq!((found.0, found.1), (wanted.0, wanted.1), "{found:?}");
                    assert!(found.2.contains(wanted.2), "{found:?}");
                }
                assert_eq!(lines.iter().map(|it| it.1.as_str()).collect::<Vec<_>>(), shown);
            }
        }
    }

    #[test]
    fn a_program_with_a_flow_is_to_be_read_whole() {
        for end in ["o1 repeat [2]\nG0 X5\no1 endrepeat\n", "M98 P10\n"] {
            let (of_file, _) = planned(&program(end), 20..=1000, 82);
            assert!(matches!(of_file, OfFile::NotPlain), "{end}: {of_file:?}");
        }
    }

    #[test]
    fn a_program_that_waits_for_a_probe_is_planned_up_to_there() {
        let (of_file, _) = planned(&program("F50 G38.2 Z-9\n#1=#5063\nG1 X\n"), 20..=1000, 82);
        let found = judged(&of_file).expect("plain lines");
        assert!(found[0].2.starts_with("the program is planned up to line 84, and"), "{found:?}");
    }

    #[test]
    fn a_program_that_can_be_held_is_none_for_pieces() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("long.ngc");
        std::fs::write(&path, "M2\n".repeat(100)).expect("written");
        let is_long = |bytes, lines| LongProgram::of(&path, ProgramSize { bytes, lines }).is_some();
        assert_eq!([is_long(300, 100), is_long(299, 100), is_long(300, 99)], [false, true, true]);
    }

    #[test]
    fn a_path_that_is_too_long_to_be_run_is_a_warning_unless_it_is_refused() {
        let limit = |message: &str| Finding::error(Code::Limit, Source::default(), message);
        let error = Finding::error(Code::Syntax, Source::default(), "wrong");
        let of = |findings: Vec<Finding>, too_long: Option<Finding>| Loaded {
            findings,
            too_long,
            ..Loaded::default()
        };
        let path = || Ok(Some(limit("of the path")));
        let starts = "the program is planned, and too long to be run: ";
        for (loaded, outcome, of_file, wanted) in [
            (of(vec![], None), Ok(None), None, None),
            (of(vec![], None), path(), None, Some("of the path")),
            (of(vec![], Some(limit("of cycles"))), path(), None, Some("of cycles")),
            (
                of(vec![], Some(limit("of cycles"))),
                path(),
                Some(limit("of the file")),
                Some("of the file"),
            ),
        ] {
            let found = shown(loaded, outcome, of_file);
            let texts: Vec<_> =
                found.iter().map(|it| (it.is_error(), it.message.clone())).collect();
            let wanted: Vec<_> =
                wanted.iter().map(|message| (false, format!("{starts}{message}"))).collect();
            assert_eq!(texts, wanted);
        }
        let refused = shown(of(vec![error.clone()], None), Ok(None), Some(limit("of the file")));
        assert_eq!(refused, [error]);
    }
}
