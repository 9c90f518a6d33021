//! Whether a program may be started at one of its lines.
//!
//! Knows where compensation is on; how a program is started in the middle is the
//! business of whoever runs it.

use crate::finding::block_name;
use cnc_msgs::contour::{ContourEventKind, ProgrammedContour, Source};
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile::{Profile, RestartMode};

/// What is said about a start in the middle of a compensated contour.
#[derive(Debug, Clone, PartialEq)]
pub struct Restart {
    /// An error or a warning, as the profile says.
    pub finding: Diagnostic,
    /// The block before the selection: the nearest place to start from.
    pub nearest: Source,
}

/// Whether `line` lies between a selection and the end of its lead-off, and the
/// control does not start there (M28).
pub fn restart(contour: &ProgrammedContour, profile: &Profile, line: u32) -> Option<Restart> {
    if profile.restart.rule == RestartMode::Rebuild {
        return None;
    }
    let mut plane = Plane::default();
    // The last block so far, and the one before it.
    let (mut before, mut last) = (Source::default(), Source::default());
    // Where compensation was selected, and the block before that.
    let mut selected: Option<(Source, Source)> = None;
    let mut is_cancelled = false;
    for event in &contour.events {
        if event.source.line >= line {
            break;
        }
        if selected.is_none() && event.source.line != last.line {
            (before, last) = (last, event.source);
        }
        match event.kind {
            ContourEventKind::Plane(other) => plane = other,
            ContourEventKind::Select { .. } => {
                selected.get_or_insert((event.source, before));
                is_cancelled = false;
            }
            ContourEventKind::Cancel { .. } => is_cancelled = true,
            ContourEventKind::Motion(motion) if is_cancelled => {
                let [u, v, _] = plane.axes();
                if motion.axes.contains(u) || motion.axes.contains(v) {
                    (selected, is_cancelled) = (None, false);
                }
            }
            _ => {}
        }
    }
    let (selected, nearest) = selected?;
    let mut finding = Diagnostic::error(
        Code::Restart,
        Source { line, ..Source::default() },
        format!(
            "line {line} lies under cutter compensation, which is on since {}; {} does not start there",
            block_name(selected),
            profile.name
        ),
    )
    .help(match nearest.line {
        0 => "start at the beginning".into(),
        nearest_line => format!("start at line {nearest_line} ({}) or before", block_name(nearest)),
    });
    finding.severity = profile.restart.severity();
    finding.other = Some(selected);
    Some(Restart { finding, nearest })
}
