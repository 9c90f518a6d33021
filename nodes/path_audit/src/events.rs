//! Checks that everything that is not motion happens once, in order, and between the right blocks.

use crate::blocks::program::NONE;
use crate::blocks::tool_path::ToolPath;
use crate::report::{self, Report};
use cnc_msgs::contour::{Action, ContourEvent, ContourEventKind};
use cnc_msgs::further::{FurtherMode, FurtherMove};
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use cnc_msgs::profile::{LengthOfD, Profile};
use cnc_msgs::tool_table::ToolTable;

pub(crate) fn check(
    tool_path: &ToolPath<'_>,
    profile: &Profile,
    tools: &ToolTable,
    report: &mut Report<'_>,
) {
    let is_of_d = |action: &Action| {
        profile.radius.length_of_d == LengthOfD::WithZ
            && matches!(action, Action::ToolLength { .. })
    };
    let actions = tool_path.program.actions.iter().map(|&index| index as usize);
    let actions = actions.map(|index| (index, &tool_path.program.contour.events[index]));
    let stops = exact_stops(actions.clone().map(|(_, event)| event));
    let is_in_order =
        |event: &&PathEvent| event.action != Action::ExactStop && !is_of_d(&event.action);
    let mut happened = tool_path.path.events.iter().filter(is_in_order);
    let mut last = 0;
    // The first block after the action, and the first element that is not before it.
    let (mut block, mut element) = (0, 0);
    for (index, event) in actions {
        let ContourEventKind::Action(action) = event.kind else { continue };
        if action == Action::ExactStop || is_of_d(&action) {
            continue;
        }
        let Some(found) = happened.next() else {
            report.push(report::lost(event.source, &action));
            return;
        };
        if found.source != event.source || !is_same(&action, &found.action, tools) {
            // From here on every event would be off by one.
            report.push(report::other_event(event.source, &action, found));
            return;
        }
        while tool_path.program.blocks.get(block).is_some_and(|b| (b.event as usize) < index) {
            block += 1;
        }
        // Elements of earlier blocks come before it.
        while element < tool_path.block_of.len()
            && (tool_path.block_of[element] == NONE
                || (tool_path.block_of[element] as usize) < block)
        {
            element += 1;
        }
        // A corner belongs to the next block, but may come before an action that stands before that
        // block.
        let generated = tool_path.path.elements[element..]
            .iter()
            .take_while(|element| matches!(element.role, Role::Corner | Role::Link));
        let latest = element + generated.count();
        if found.at_element < element.max(last) || found.at_element > latest {
            report.push(report::misplaced(found, element));
        }
        if !has_its_motion(tool_path.path, found, happened.clone().next()) {
            report.push(report::without_motion(found));
        }
        last = found.at_element;
    }
    if let Some(extra) = happened.next() {
        report.push(report::extra(extra));
    }
    check_stops(tool_path, &stops, report);
    if profile.radius.length_of_d == LengthOfD::WithZ {
        check_lengths(tool_path, report);
    }
}

/// Whether what belongs to a motion of its block (axes along with it, a probe) has it: the next element, or the
/// next action where that takes the words of axes.
fn has_its_motion(path: &CompensatedPath, found: &PathEvent, next: Option<&PathEvent>) -> bool {
    let is_part = match found.action {
        Action::Further(FurtherMove { mode, .. }) => mode == FurtherMode::Along,
        Action::Probe(_) | Action::SpindleSync { .. } | Action::Relative { .. } => true,
        _ => false,
    };
    if !is_part {
        return true;
    }
    match next.filter(|next| next.at_element == found.at_element) {
        Some(next) => {
            let takes = match found.action {
                Action::Relative { .. } => matches!(next.action, Action::Probe(_)),
                Action::Probe(_) | Action::SpindleSync { .. } => false,
                _ => matches!(
                    next.action,
                    Action::MachineMove { .. }
                        | Action::SetWorkOffset { .. }
                        | Action::Reference { .. }
                ),
            };
            takes && next.source == found.source
        }
        None => path.elements.get(found.at_element).is_some_and(|it| it.source == found.source),
    }
}

/// A length of D acts at the first element of the next block that moves Z, and nowhere else (S34).
fn check_lengths(tool_path: &ToolPath<'_>, report: &mut Report<'_>) {
    let is_length = |event: &&PathEvent| matches!(event.action, Action::ToolLength { .. });
    let mut found = tool_path.path.events.iter().filter(is_length);
    let elements = &tool_path.path.elements;
    let mut first = 0;
    for (index, action) in &tool_path.program.lengths {
        let source = tool_path.program.contour.events[*index as usize].source;
        let Some(event) = found.next() else {
            return report.push(report::lost(source, action));
        };
        if event.source != source || !same_length(action, &event.action) {
            return report.push(report::other_event(source, action, event));
        }
        // The element before belongs to another block, and the next one begins this block.
        let is_of_block = |element: &PathElement| element.source == source;
        let at = event.at_element.min(elements.len());
        while first < at && !is_of_block(&elements[first]) {
            first += 1;
        }
        let mut rest = elements[at..].iter();
        let begins = rest.find(|it| !matches!(it.role, Role::Corner | Role::Link));
        if first < at || !begins.is_some_and(is_of_block) {
            report.push(report::misplaced(event, first));
        }
    }
    if let Some(extra) = found.next() {
        report.push(report::extra(extra));
    }
}

fn same_length(a: &Action, b: &Action) -> bool {
    match (a, b) {
        (
            Action::ToolLength { offset: a, length_mm: p, .. },
            Action::ToolLength { offset: b, length_mm: q, .. },
        ) => a == b && (p - q).abs() <= 1e-9,
        _ => false,
    }
}

fn is_same(programmed: &Action, found: &Action, tools: &ToolTable) -> bool {
    match (programmed, found) {
        // The planner fills in the length.
        (
            Action::ToolLength { offset: Some(a), second: c, length_mm: added_mm },
            Action::ToolLength { offset: Some(b), second: d, length_mm },
        ) => {
            // 0 is no tool, whatever the table has there.
            let in_table = |number: u32| {
                let tool = tools.tools.get(&number).filter(|_| number != 0);
                tool.map_or(0.0, |tool| tool.length_mm)
            };
            let expected = in_table(*a) + c.map_or(0.0, in_table) + added_mm;
            (a, c) == (b, d) && (expected - length_mm).abs() <= 1e-9
        }
        _ => same_numbers(programmed, found),
    }
}

/// Lengths that were converted to metres and back may differ by rounding.
fn same_numbers(a: &Action, b: &Action) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(1.0);
    match (a, b) {
        (
            Action::SetWorkOffset { system, axes, origin: p, by_position },
            Action::SetWorkOffset { system: of, axes: other, origin: q, by_position: also },
        ) => {
            (system, axes, by_position) == (of, other, also)
                && p.iter().zip(q).all(|(a, b)| near(*a, *b))
        }
        (
            Action::MachineMove { target: p, axes, rapid, feed_mm_per_min: f },
            Action::MachineMove { target: q, axes: other, rapid: as_rapid, feed_mm_per_min: g },
        ) => {
            (axes, rapid) == (other, as_rapid)
                && near(*f, *g)
                && p.iter().zip(q).all(|(a, b)| near(*a, *b))
        }
        (Action::SpindleSync { pitch_mm: p }, Action::SpindleSync { pitch_mm: q }) => near(*p, *q),
        (Action::Further(programmed), Action::Further(found)) => {
            let is_at =
                |axis: usize, at: f64| found.axes.get(axis).is_some_and(|other| near(at, other));
            let rate = match (programmed.mode, found.mode) {
                (FurtherMode::Feed(a), FurtherMode::Feed(b)) => near(a, b),
                (a, b) => a == b,
            };
            rate && programmed.axes.bits() == found.axes.bits()
                && programmed.axes.iter().all(|(axis, at)| is_at(axis, at))
        }
        _ => a == b,
    }
}

/// Lines whose elements must all end in an exact stop, in order.
fn exact_stops<'a>(events: impl Iterator<Item = &'a ContourEvent>) -> Vec<u32> {
    let stops = events.filter(|event| event.kind == ContourEventKind::Action(Action::ExactStop));
    let mut lines: Vec<u32> = stops.map(|event| event.source.line).collect();
    lines.sort_unstable();
    lines.dedup();
    lines
}

fn check_stops(tool_path: &ToolPath<'_>, stops: &[u32], report: &mut Report<'_>) {
    let mut found = tool_path
        .path
        .events
        .iter()
        .filter(|event: &&PathEvent| event.action == Action::ExactStop)
        .peekable();
    if stops.is_empty() {
        if let Some(extra) = found.next() {
            report.push(report::extra(extra));
        }
        return;
    }
    for (index, element) in tool_path.path.elements.iter().enumerate() {
        if stops.binary_search(&element.source.line).is_err() {
            continue;
        }
        let is_there = found.next_if(|event| {
            event.at_element == index + 1 && event.source.line == element.source.line
        });
        if is_there.is_none() {
            report.push(report::lost(element.source, &Action::ExactStop));
            return;
        }
    }
    if let Some(extra) = found.next() {
        report.push(report::extra(extra));
    }
}
