//! Planning a program in parts is planning it whole, however it arrives.

mod support;

use cnc_msgs::chunk::{Collector, ContourChunks};
use cnc_msgs::contour::{ContourEventKind, ProgrammedContour};
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{PathElement, Role};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use compensation_planner::replan::replan;
use compensation_planner::set_tool::LoadedProgram;
use proptest::prelude::*;
use support::opened::{Opened, shapes};
use support::random::{config, elements, free, in_modes, near, random_contour, run, sides, step};
use support::*;

/// A contour that went through messages, whose chunks came in the reverse order.
fn sent(contour: &ProgrammedContour) -> (ProgrammedContour, u32) {
    let chunks = ContourChunks::new("program".into(), contour.clone());
    let manifest = wire::ProgrammedContour {
        program_id: "program".into(),
        chunk_count: chunks.count(),
        sha256: chunks.sha256().into(),
        event_count: contour.events.len() as u64,
        start: cnc_msgs::units::point_from_position(contour.start),
        assumed_axes: contour.assumed_axes.bits(),
        ..Default::default()
    };
    let mut collector = Collector::for_contour(&manifest).unwrap();
    for index in (0..chunks.count()).rev() {
        collector.add(chunks.chunk(index).unwrap()).unwrap();
    }
    (collector.finish(&manifest).unwrap(), chunks.count())
}

/// As programs are written: with six decimals.
fn as_posted(contour: &mut ProgrammedContour) {
    let round = |position: &mut [f64; 3]| {
        *position = position.map(|value| format!("{value:.6}").parse().unwrap());
    };
    round(&mut contour.start);
    let mut at = contour.start;
    for event in &mut contour.events {
        if let ContourEventKind::Motion(motion) = &mut event.kind {
            round(&mut motion.end);
            if let Shape::Arc(arc) = &mut motion.shape {
                round(&mut arc.center);
                arc.center[2] = at[2];
            }
            at = motion.end;
        }
    }
}

proptest! {
    #![proptest_config(config(60))]

    /// The cut between two chunks may fall anywhere: into the lead, the contour or after it.
    #[test]
    fn p10_a_contour_that_arrives_in_chunks_is_planned_as_the_whole(
        steps in prop::collection::vec(step(), 1..14),
        side in sides(),
        corner in in_modes(),
        radius in 0.01..20.0_f64,
        before in 346..356_usize,
    ) {
        let mut contour = random_contour(&steps, side, corner);
        set_radius(&mut contour, (radius * 1e6).round() / 1e6);
        // The radius word stays first; it is put before what fills the first chunk.
        let filler = vec![contour.events[1]; before];
        contour.events.splice(1..1, filler);
        as_posted(&mut contour);
        let (arrived, count) = sent(&contour);
        prop_assume!(count == 2);
        let planned = |contour| compensation_planner::plan(contour, &free(), &tool(0.0));
        let (whole, parts) = (planned(&contour), planned(&arrived));
        prop_assert_eq!(whole, parts);
    }
}

/// What is cut in the blocks up to this line.
fn up_to(elements: &[PathElement], line: u32) -> Vec<PathElement> {
    elements.iter().take_while(|element| element.source.line <= line).copied().collect()
}

/// The same except for rounding: a line that continues in the next block is one with it.
fn check_alike(got: &[PathElement], expected: &[PathElement]) -> Result<(), TestCaseError> {
    prop_assert_eq!(got.len(), expected.len());
    for (a, b) in got.iter().zip(expected) {
        let (shape, end) = (b.shape, b.end);
        prop_assert_eq!(PathElement { shape, end, ..*a }, *b);
        prop_assert!(near(a.end, b.end, 1e-9), "{:?} {:?}", a, b);
        if let (Shape::Arc(a), Shape::Arc(b)) = (a.shape, b.shape) {
            prop_assert!(near(a.center, b.center, 1e-9) && a.clockwise == b.clockwise);
        }
    }
    Ok(())
}

fn after_line(elements: &[PathElement], line: u32) -> Vec<PathElement> {
    elements.iter().skip_while(|element| element.source.line <= line).copied().collect()
}

proptest! {
    #![proptest_config(config(60))]

    /// A block is settled when the next one is known.
    #[test]
    fn p10_a_block_is_planned_alike_whatever_comes_after_the_next(
        shape in shapes(),
        parts in (0.01..0.99_f64, 0.0..1.0_f64),
    ) {
        let profile = sinumerik();
        let radius = parts.0 * shape.clearance_mm;
        let whole = run(&shape.contour(&profile), &profile, radius);
        let lines = shape.vertices.len() as u32 + 2;
        let last = 4 + (parts.1 * f64::from(lines - 4)) as u32;
        let mut begun = shape.contour(&profile);
        begun.events.retain(|event| event.source.line <= last);
        // It is not cancelled, so it is refused; the path is there all the same.
        let begun = run(&begun, &profile, radius);
        let settled = up_to(elements(&begun), last - 1);
        prop_assert!(settled.iter().any(|element| element.role == Role::Contour));
        let expected = up_to(elements(&whole), last - 1);
        check_alike(&settled, &expected)?;
    }

    /// Each compensated piece of a program is planned as if it were alone.
    #[test]
    fn p10_a_program_of_two_contours_is_planned_as_both(
        shapes in (shapes(), shapes()),
        part in 0.01..0.99_f64,
    ) {
        let (profile, tool_mm) = (sinumerik(), part * shapes.0.clearance_mm.min(shapes.1.clearance_mm));
        let first = shapes.0.contour(&profile);
        let mut second = shapes.1.contour(&profile);
        let lines = first.events.last().unwrap().source.line;
        for event in &mut second.events {
            event.source.line += lines;
        }
        let mut both = first.clone();
        both.events.extend(second.events.iter().copied());
        let mut both = run(&both, &profile, tool_mm);
        // But for what the second cuts of the first.
        both.findings.retain(|finding| finding.code != Code::CutsOtherSpan);
        let (first, second) = (run(&first, &profile, tool_mm), run(&second, &profile, tool_mm));
        prop_assert!(both.accepted(), "{}", findings(&both));
        prop_assert_eq!(&both.findings, &[first.findings, second.findings].concat());
        prop_assert_eq!(&both.path.elements, &[first.path.elements, second.path.elements].concat());
    }

    /// What has been sent stays; what comes after the block that changes is what the whole
    /// program is with the new radius.
    #[test]
    fn p10_the_rest_of_a_program_is_planned_as_the_whole_is(
        shape in shapes(),
        parts in (0.05..0.95_f64, 0.05..0.95_f64, 0.0..1.0_f64),
    ) {
        prop_assume!((parts.0 - parts.1).abs() > 1e-3);
        let profile = sinumerik();
        let [old, new] = [parts.0, parts.1].map(|part| tool(part * shape.clearance_mm));
        let contour = shape.contour(&profile);
        let running = plan_of(&contour, &profile, &old).path;
        let settled = 2 + (parts.2 * (running.elements.len() - 2) as f64) as usize;
        let program = LoadedProgram { name: "shape", contour: &contour, profile: &profile };
        let rest = match replan(program, &old, &new, &running, settled) {
            Ok(rest) => rest,
            Err(why) => {
                prop_assert!(is_refusal(&shape, &running.elements, settled, &why.message), "{why}");
                return Ok(());
            }
        };
        let got = &rest.plan.path.elements;
        prop_assert_eq!(&got[..settled], &running.elements[..settled]);
        let sent = running.elements[settled - 1].source.line;
        prop_assert!(rest.from_line > sent);
        // Until the block that changes, as it ran; after it, as the whole with the new value.
        check_alike(&up_to(got, rest.from_line - 1), &up_to(&running.elements, rest.from_line - 1))?;
        let whole = plan_of(&contour, &profile, &new).path;
        check_alike(&after_line(got, rest.from_line), &after_line(&whole.elements, rest.from_line))?;
    }
}

/// Whether there was a reason not to change: no straight block of the contour is left, or the
/// change of radius does not fit into the block.
fn is_refusal(shape: &Opened, running: &[PathElement], settled: usize, why: &str) -> bool {
    // The first edge stands in line 3.
    let sent = (running[settled - 1].source.line as usize).saturating_sub(2);
    let is_left = shape.vertices.iter().skip(sent).any(|edge| edge.1 == 0.0);
    match why {
        "no straight block is left in which the radius could change"
        | "the change does not affect the rest of the program" => !is_left,
        _ => why.starts_with("line "),
    }
}
