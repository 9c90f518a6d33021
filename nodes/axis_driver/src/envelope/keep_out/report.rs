//! What is said of the boxes that a path touches, or may touch.

use super::{Chance, Cutter, Doubt, Hit, KeepOutCheck, PlacedBox};
use crate::envelope::{EnvelopeReport, place};
use crate::machine_path::{Lost, MoveFrame};
use cnc_msgs::contour::work_system;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet};
use std::collections::BTreeMap;

/// Boxes that one finding names.
const NAMES_MAX: usize = 3;

impl KeepOutCheck {
    pub(in crate::envelope) fn report(&self, report: &mut EnvelopeReport) {
        report.not_judged.extend(self.not_judged.iter().cloned());
        for (why, (first, more, _)) in &self.unplaced {
            let first = place(*first);
            let others = if *more > 0 { format!(" and of {more} more") } else { String::new() };
            let text = format!("keep-outs on the way to the end of {first}{others}: {why}");
            report.not_judged.push(text);
        }
        let hits = self.boxes.iter().filter_map(|it| Some(self.hit(it, it.hit.as_ref()?)));
        report.findings.extend(hits);
        // One block may touch many boxes for one reason.
        let mut chances: BTreeMap<_, Vec<(&PlacedBox, &Chance)>> = BTreeMap::new();
        for it in self.boxes.iter().filter(|it| it.hit.is_none()) {
            if let Some(chance) = &it.chance {
                let key = (chance.source.line, chance.because);
                chances.entry(key).or_default().push((it, chance));
            }
        }
        report.findings.extend(chances.values().filter_map(|them| self.chance(them)));
    }

    fn hit(&self, it: &PlacedBox, hit: &Hit) -> Finding {
        let Hit { nearest, cutter, .. } = hit;
        let ([x, y, z], top, frame) = (nearest.tip, it.bounds.max[2], &self.frame);
        let radius_mm = cutter.radii_mm[0];
        let mut message = format!("{} touches the keep-out {:?}", cutter.least(), it.name);
        if !hit.unknown.is_empty() {
            let (letters, is_one) = letters(hit.unknown);
            let were = if is_one { "was" } else { "were" };
            message += &format!(", wherever {letters} {were} before: from one of these places");
        } else {
            message += ":";
        }
        message += &format!(" its tip is at X{x:.3} Y{y:.3} Z{z:.3} in {frame}");
        if let Some([x, y, z]) = hit.in_work.filter(|_| hit.frame.name() != *frame) {
            message += &format!(" (X{x:.3} Y{y:.3} Z{z:.3} in {})", hit.frame.name());
        }
        let overlap = radius_mm - nearest.distance_mm;
        message += &match nearest.distance_mm > 0.0 {
            true => format!(", {:.3} mm from the side", nearest.distance_mm),
            false => ", within its sides".to_owned(),
        };
        message += &format!(", and {:.3} mm below the top", (top - z).max(0.0));
        if hit.blocks > 1 {
            message += &format!("; {} blocks do so", hit.blocks);
        }
        let lift = format!("lift the tip above Z{top:.3} in {frame}");
        let help = match nearest.distance_mm > 0.0 {
            true => format!("keep {:.3} mm more distance, or {lift}", overlap.max(0.001)),
            false => format!("lead around it, move the clamp, or {lift}"),
        };
        let mut finding = Finding::error(Code::KeepOut, hit.source, message).help(help);
        finding.position = hit.in_work.filter(|_| hit.unknown.is_empty());
        if radius_mm > 0.0 {
            finding.needed_mm = Some(radius_mm);
            finding.available_mm = Some(nearest.distance_mm);
        }
        finding
    }

    /// The largest tool that it may be.
    fn most(&self, cutter: Cutter) -> String {
        match (cutter.tool, self.tools.largest) {
            (None, Some((tool, radius))) => format!("T{tool} (radius {radius:.3} mm)"),
            _ => cutter.least(),
        }
    }

    /// Of boxes that one block may touch for one reason.
    fn chance(&self, them: &[(&PlacedBox, &Chance)]) -> Option<Finding> {
        let (_, chance) = them.first()?;
        let top = them.iter().map(|(it, _)| it.bounds.max[2]).fold(f64::MIN, f64::max);
        let (most, frame) = (self.most(chance.cutter), &self.frame);
        let mut names: Vec<_> =
            them.iter().take(NAMES_MAX).map(|(it, _)| format!("{:?}", it.name)).collect();
        if them.len() > NAMES_MAX {
            names.push(format!("{} more", them.len() - NAMES_MAX));
        }
        let keep_outs =
            format!("the keep-out{} {}", if them.len() > 1 { "s" } else { "" }, and(&names));
        let mut height = format!("Z{top:.3} in {frame}");
        if let Some((system, zero)) =
            chance.zero.filter(|(system, _)| work_system(*system) != *frame)
        {
            height += &format!(" (Z{:.3} in {})", top - zero, work_system(system));
        }
        let (unknown, is_one) = letters(chance.unknown);
        let (message, help) = match chance.because {
            Doubt::Tool => (
                format!(
                    "which tool is in the spindle is not known: {most}, the largest of the tool \
                     table, would touch {keep_outs}, where its tip must be above {height}"
                ),
                "change to the tool by its number (T and M6) before this block".to_owned(),
            ),
            Doubt::Place(lost) => {
                let when = match lost {
                    Lost::Homing => "after homing",
                    _ => "before this move",
                };
                let tip = match chance.tip {
                    [least, most] if least == most && least <= top => {
                        format!("its tip ends at Z{least:.3}, and must be above {height}")
                    }
                    _ => format!("it does so where its tip is at {height} or lower"),
                };
                (
                    format!(
                        "where {unknown} {} {when} is not known: on its way {most} may touch \
                         {keep_outs}; {tip}",
                        if is_one { "is" } else { "are" }
                    ),
                    format!(
                        "put a move in Z alone before it, to above {height}; the driver judges a \
                         run from where the tool is"
                    ),
                )
            }
        };
        Some(Finding::warning(Code::KeepOut, chance.source, message).help(help))
    }
}

impl Cutter {
    fn least(&self) -> String {
        match (self.tool, self.radii_mm[0]) {
            (None | Some(0), _) => "the axis of the tool".to_owned(),
            (Some(tool), radius) if radius <= 0.0 => format!("the axis of T{tool}"),
            (Some(tool), radius) => format!("T{tool} (radius {radius:.3} mm)"),
        }
    }
}

/// Why a move cannot be compared.
pub(super) fn unplaced(doubt: Doubt, frame: MoveFrame) -> String {
    match doubt {
        Doubt::Place(Lost::Probe) => "where the probe ends is known only in the run".to_owned(),
        Doubt::Place(Lost::Frame) => {
            let verb = if matches!(frame, MoveFrame::Work { .. }) { "lies" } else { "leads" };
            format!("where {} {verb} in the machine is not known", frame.name())
        }
        Doubt::Place(Lost::Homing) => "where homing leaves the axes is not known".to_owned(),
        Doubt::Place(Lost::Start) | Doubt::Tool => {
            "where the tool is before it is not known".to_owned()
        }
    }
}

/// `X, Y and Z`, and whether it is one axis.
fn letters(axes: AxisSet) -> (String, bool) {
    let named = (0..3).filter(|axis| axes.contains(*axis));
    let named: Vec<_> = named.map(|axis| AXIS_LETTERS[axis].to_string()).collect();
    (and(&named), named.len() == 1)
}

fn and(words: &[String]) -> String {
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        Some((last, _)) => last.clone(),
        None => String::new(),
    }
}
