//! The checker can fail: verdicts that were right are made wrong, and it must say so.

use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::path::Role as PathRole;
use cnc_msgs::profile::Profile;
use kerf_checker::fit::{Fit, fits};
use kerf_checker::judge::{Judgement, ProductResult, WrongKind, judge};
use kerf_checker::piece::{Piece, point};
use kerf_checker::program::{Corner, End, Program, Role};
use kerf_checker::{draw, product, profiles};
use settings::Control;

/// Accepted programs with one contour, and their verdicts, before anything is changed.
fn accepted(profiles: &[Profile]) -> Vec<(Program, ProductResult)> {
    let judged = (0..3000).map(|seed| {
        let program = draw::program(seed);
        let verdict = product(&program, profiles);
        (program, verdict)
    });
    let is_right = |(program, verdict): &(Program, ProductResult)| {
        let plain = program.spans.len() == 1 && !program.spans[0].changes_tool();
        plain && judge(program, verdict).0 == Judgement::Accepted
    };
    judged.filter(is_right).collect()
}

/// The kinds of what is wrong.
fn kinds(program: &Program, verdict: &ProductResult) -> Vec<WrongKind> {
    judge(program, verdict).1.into_iter().map(|wrong| wrong.kind).collect()
}

/// How many verdicts were changed, and how many of those were found out.
#[derive(Debug, Default)]
struct Found {
    changed: usize,
    found: usize,
}

impl Found {
    fn count(&mut self, is_found: bool) {
        self.changed += 1;
        self.found += usize::from(is_found);
    }

    fn check(&self, least: usize, percent: usize) {
        assert!(self.changed >= least && self.found * 100 >= self.changed * percent, "{self:?}");
    }
}

#[test]
fn a_path_for_another_radius_is_found() {
    let profiles = profiles();
    let mut found = Found::default();
    for (program, _) in accepted(&profiles) {
        let mut other = program.clone();
        for tool in other.tools.tools.values_mut() {
            tool.diameter_mm *= 1.03;
            tool.wear_diameter_mm *= 1.03;
            tool.nose_radius_mm *= 1.03;
        }
        for offset in other.tools.offsets.values_mut() {
            offset.radius_mm *= 1.03;
        }
        let is_radius_in_program = match program.control {
            Control::Automation1 | Control::Masso => true,
            Control::Rs274 => program.text.contains(".1 D"),
            Control::OspLathe | Control::Sinumerik840c | Control::Nct => false,
        };
        if is_radius_in_program {
            continue;
        }
        let verdict = product(&other, &profiles);
        if verdict.is_accepted() {
            found.count(!kinds(&program, &verdict).is_empty());
        }
    }
    found.check(100, 94);
}

#[test]
fn a_path_on_the_other_side_is_found() {
    let profiles = profiles();
    let mut found = Found::default();
    for (program, _) in accepted(&profiles) {
        let mut other = program.clone();
        let swapped = program.text.replace("G41", "G4?").replace("G42", "G41");
        other.text = swapped.replace("G4?", "G42");
        let verdict = product(&other, &profiles);
        if verdict.is_accepted() {
            found.count(!kinds(&program, &verdict).is_empty());
        }
    }
    found.check(50, 94);
}

#[test]
fn a_corner_that_is_cut_by_a_hundredth_is_found() {
    let profiles = profiles();
    let mut found = Found::default();
    for (program, mut verdict) in accepted(&profiles) {
        // Between two contour elements, towards the contour.
        let (span, [u, v, _]) = (&program.spans[0], program.axes);
        let elements = &mut verdict.path.elements;
        let joint = (1..elements.len()).find(|&index| {
            let (before, after) = (&elements[index - 1], &elements[index]);
            before.role == PathRole::Contour
                && after.role == PathRole::Contour
                && (before.end[u] - after.end[u]).hypot(before.end[v] - after.end[v]) > 0.1
        });
        let Some(joint) = joint else { continue };
        let at = point(elements[joint - 1].end[u], elements[joint - 1].end[v]);
        let near = |element: &&kerf_checker::program::Element| element.role == Role::Wall;
        let walls = span.elements.iter().filter(near);
        let nearest = walls.min_by(|a, b| a.shape.distance(at).total_cmp(&b.shape.distance(at)));
        let Some(wall) = nearest else { continue };
        let radius_mm = wall.radius_mm.0;
        if (wall.shape.distance(at) - radius_mm).abs() > 1e-3 {
            continue;
        }
        let towards = (0..=1000).map(|part| wall.shape.at(f64::from(part) / 1000.0));
        let foot = towards.min_by(|a, b| a.to(at).total_cmp(&b.to(at))).expect("a point");
        let cut = at + (foot - at).unit() * 0.01;
        (elements[joint - 1].end[u], elements[joint - 1].end[v]) = (cut.u, cut.v);
        verdict.findings.clear();
        found.count(kinds(&program, &verdict).contains(&WrongKind::SilentCut));
    }
    found.check(100, 95);
}

#[test]
fn a_finding_that_is_missing_is_found() {
    let profiles = profiles();
    let mut found = Found::default();
    for (program, mut verdict) in accepted(&profiles) {
        let is_deep = |it: &Finding| {
            matches!(it.code, Code::Gouge | Code::LeadGouge | Code::LeadNick)
                && it.depth_mm.is_some_and(|depth_mm| depth_mm > 0.01)
        };
        if verdict.findings.iter().any(is_deep) {
            verdict.findings.clear();
            found.count(kinds(&program, &verdict).contains(&WrongKind::SilentCut));
        }
    }
    found.check(100, 100);
}

#[test]
fn a_block_that_is_left_out_is_found() {
    let profiles = profiles();
    let mut found = Found::default();
    for (program, mut verdict) in accepted(&profiles) {
        let span = &program.spans[0];
        let longest = span.elements[1..span.elements.len().max(2) - 1]
            .iter()
            .filter(|element| element.role == Role::Wall && !element.is_copy && element.pass == 0)
            .max_by(|a, b| a.shape.length().total_cmp(&b.shape.length()));
        let copied = span.elements.iter().any(|element| element.is_copy || element.pass > 0);
        let Some(longest) = longest.filter(|_| !copied) else { continue };
        let radius_mm = longest.radius_mm.0;
        if longest.shape.length() < 4.0 * radius_mm {
            continue;
        }
        verdict.path.elements.retain(|element| element.source.line != longest.line);
        found.count(!kinds(&program, &verdict).is_empty());
    }
    found.check(100, 94);
}

#[test]
fn a_refusal_of_what_fits_is_a_false_alarm() {
    let profiles = profiles();
    let mut found = Found::default();
    for (program, mut verdict) in accepted(&profiles) {
        let span = &program.spans[0];
        if [0.0, -1e-3].iter().any(|slack_mm| fits(span, *slack_mm) != Fit::Fits) {
            continue;
        }
        let line = span.elements[0].line;
        let finding = verdict.findings.first().map_or_else(Default::default, |it| it.source);
        let source = cnc_msgs::contour::Source { line, ..finding };
        verdict.findings = vec![Finding::error(Code::Gouge, source, "a false alarm")];
        found.count(kinds(&program, &verdict) == [WrongKind::FalseGouge]);
    }
    found.check(200, 100);
}

/// A slot of 4 mm, open on one side.
fn slot(radius_mm: f64) -> kerf_checker::program::Span {
    let corners = [(0.0, 0.0), (20.0, 0.0), (20.0, 4.0), (0.0, 4.0)];
    let corners = corners.map(|(u, v)| point(u, v));
    let elements =
        corners.windows(2).enumerate().map(|(index, ends)| kerf_checker::program::Element {
            shape: Piece::line(ends[0], ends[1]),
            line: index as u32 + 2,
            pass: 0,
            role: Role::Wall,
            radius_mm: (radius_mm, radius_mm),
            is_copy: false,
        });
    let outside = point(0.0, 2.0);
    kerf_checker::program::Span {
        elements: elements.collect(),
        side: 1.0,
        corner: Corner::Arc,
        begin: End::Normal { outside },
        end: End::Normal { outside },
        lines: (1, 5),
        is_closed: false,
    }
}

#[test]
fn a_tool_of_half_the_width_of_a_slot_is_the_largest_that_fits() {
    for (radius_mm, is_fitting) in [(0.5, true), (1.999, true), (2.001, false), (3.0, false)] {
        let fit = fits(&slot(radius_mm), 0.0);
        assert_eq!(fit == Fit::Fits, is_fitting, "{radius_mm}: {fit:?}");
    }
}
