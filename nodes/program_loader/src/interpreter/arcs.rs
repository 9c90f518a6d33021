//! G2 and G3: turns the words of an arc into its shape.
//!
//! `arc` has the plane geometry; this file has the words and the messages.

use super::arc::{self, ArcTrouble, InPlane, Resolved};
use super::moves::CENTER_WORDS;
use super::{Interpreter, Scene};
use crate::dialect::{Distance, GWord, Units};
use crate::expression::whole;
use crate::limits::{
    ARC_MISMATCH_INCH, ARC_MISMATCH_MM, ARC_R_SHORT_INCH, ARC_R_SHORT_MM, ARC_TURNS_MAX,
    COORDINATE_MM_MAX, MM_PER_INCH,
};
use cnc_msgs::contour::MotionClass;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{Arc, AxisSet, Shape};
use cnc_msgs::numbers::with_enough_digits;

impl Interpreter<'_> {
    pub(super) fn arc(&mut self, scene: &mut Scene<'_>, clockwise: bool) {
        self.check_plane(scene, "an arc");
        let start = self.axes.position;
        let plane = self.modal.plane;
        let [first, second, normal] = plane.axes();
        let mut end = self.end(scene);
        let in_plane = AxisSet::NONE.with(first).with(second);
        let helix = AxisSet::from_bits(end.named.bits() & AxisSet::NONE.with(normal).bits());
        let is_sound =
            self.relies(scene, in_plane.union(helix)) & self.has_feed(scene, MotionClass::Feed);
        let from = [start[first], start[second]];
        let to = [end.position[first], end.position[second]];
        let turns = self.turns(scene);
        let center = self.center(scene, [first, second], from, to, clockwise);
        if let Some(resolved) = center
            && resolved.is_full_circle
        {
            end.position[first] = from[0];
            end.position[second] = from[1];
        }
        if !self.arrive(&end) || !is_sound {
            return;
        }
        let (Some(resolved), Some(turns)) = (center, turns) else { return };
        let mut center = start;
        center[first] = resolved.center[0];
        center[second] = resolved.center[1];
        let turns = turns - u16::from(!resolved.is_full_circle);
        let arc = Arc { center, plane, clockwise, turns };
        self.add_to_bounds(start, Shape::Arc(arc), end.position, end.named);
        self.feed_of_length(MotionClass::Feed, || arc::length(start, end.position, &arc));
        self.feed_at_surface(MotionClass::Feed, start, end.position, Some(&arc));
        // An arc determines both axes of its plane, even if it names one or none.
        let axes = end.named.union(in_plane);
        self.emit_motion(Shape::Arc(arc), end.position, MotionClass::Feed, axes);
    }

    /// P: the number of turns of the arc, at least 1.
    pub(super) fn turns(&mut self, scene: &mut Scene<'_>) -> Option<u16> {
        if !self.rules.dialect.arc_radius_and_turns {
            return Some(1);
        }
        let Some(turns) = self.take(b'P') else { return Some(1) };
        if let Some(turns) = whole(turns).and_then(|turns| u16::try_from(turns).ok())
            && (1.0..=ARC_TURNS_MAX).contains(&f64::from(turns))
        {
            return Some(turns);
        }
        if !turns.is_nan() {
            let message = format!("an arc cannot make {turns} turns");
            let help = format!("write P as a whole number from 1 to {ARC_TURNS_MAX}");
            self.report(scene, b'P', Code::BadNumber, message, &help);
        }
        None
    }

    /// Finds the centre from I, J, K or R; `None` after an error, or in a block that has one.
    pub(super) fn center(
        &mut self,
        scene: &mut Scene<'_>,
        [first, second]: [usize; 2],
        from: InPlane,
        to: InPlane,
        clockwise: bool,
    ) -> Option<Resolved> {
        let scale = self.scale();
        let letters = [CENTER_WORDS[first], CENTER_WORDS[second]];
        let offsets =
            letters.map(|letter| self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm"));
        let arc_radius = self.rules.dialect.arc_radius;
        let radius = if self.rules.dialect.arc_radius_and_turns {
            self.take_within(scene, arc_radius, scale, COORDINATE_MM_MAX, "mm")
        } else {
            None
        };
        // Some posts write K0 after I and J (FreeCAD); any other value is an error.
        let normal = CENTER_WORDS[3 - first - second];
        if self.request.value(normal) == Some(0.0) {
            self.take(normal);
        }
        let names = letters.map(char::from);
        if radius.is_some() && offsets.iter().any(Option::is_some) {
            let radius = char::from(arc_radius);
            let message = format!("{radius} and {} or {} in one block", names[0], names[1]);
            let help = "give the centre or the radius, not both";
            self.report(scene, arc_radius, Code::ModalConflict, message, help);
            return None;
        }
        let is_absolute = self.modal.centers == Distance::Absolute;
        if radius.is_none()
            && (offsets == [None, None] || is_absolute && offsets.iter().any(Option::is_none))
        {
            if !self.request.has_refused_word {
                let message = format!("the arc needs {} and {}", names[0], names[1]);
                let help = if is_absolute {
                    "write both coordinates of the centre: G90.1 is in force"
                } else {
                    "write the distance from the start to the centre"
                };
                self.report_block(scene, Code::MissingWord, message, help);
            }
            return None;
        }
        if self.request.is_damaged {
            return None;
        }
        let (mismatch, short) = match self.modal.units {
            Units::Millimetre => (ARC_MISMATCH_MM, ARC_R_SHORT_MM),
            Units::Inch => (ARC_MISMATCH_INCH * MM_PER_INCH, ARC_R_SHORT_INCH * MM_PER_INCH),
        };
        let shift = [self.modal.shift[first], self.modal.shift[second]];
        let about = |base: InPlane| {
            let center = [base[0] + offsets[0].unwrap_or(0.0), base[1] + offsets[1].unwrap_or(0.0)];
            arc::about_center(from, to, center, mismatch)
        };
        let resolved = match radius {
            Some(radius) => arc::with_radius(from, to, radius, clockwise, short),
            None if is_absolute => about(shift),
            None => about(from),
        };
        match resolved {
            Ok(resolved) => Some(resolved),
            Err(trouble) => {
                let fits_otherwise =
                    radius.is_none() && about(if is_absolute { from } else { shift }).is_ok();
                let other = fits_otherwise.then_some(self.modal.centers);
                self.report_arc(scene, trouble, other);
                None
            }
        }
    }

    /// `other`: how centres count now, where they would fit the other way.
    #[cold]
    fn report_arc(&mut self, scene: &mut Scene<'_>, trouble: ArcTrouble, other: Option<Distance>) {
        let (message, help, numbers) = match trouble {
            ArcTrouble::ZeroRadius => (
                "the arc has no radius".to_owned(),
                "the centre must not be the start or the end",
                None,
            ),
            ArcTrouble::Mismatch { start_mm, end_mm, allowed_mm } => (
                {
                    let [off, allowed] = with_enough_digits((start_mm - end_mm).abs(), allowed_mm);
                    let [start, end] = with_enough_digits(start_mm, end_mm);
                    format!(
                        "the radii of the arc differ by {off} mm: {start} mm at its start, \
                         {end} mm at its end; {allowed} mm is allowed"
                    )
                },
                "check the end and the centre; I, J and K count from the start of the arc \
                 unless G90.1 is in force",
                Some((allowed_mm, (start_mm - end_mm).abs())),
            ),
            ArcTrouble::TooShort { radius_mm, half_chord_mm } => (
                {
                    let [radius, needed] = with_enough_digits(radius_mm, half_chord_mm);
                    format!(
                        "radius {radius} mm is too small: start and end are {:.3} mm apart, \
                         so at least {needed} mm is needed",
                        2.0 * half_chord_mm
                    )
                },
                "check the end and the radius",
                Some((half_chord_mm, radius_mm)),
            ),
            ArcTrouble::NoChord => (
                "an arc that is given by its radius cannot end where it starts".to_owned(),
                "program a full circle with its centre: I, J or K",
                None,
            ),
            ArcTrouble::TooLarge { radius_mm } => (
                format!("radius {radius_mm:.3} mm is beyond {COORDINATE_MM_MAX} mm"),
                "program a straight line",
                None,
            ),
        };
        let has_word = matches!((self.rules.dialect.g)(901), GWord::Centers(_));
        let help = match other.filter(|_| has_word) {
            Some(Distance::Incremental) => {
                "the centre fits as absolute coordinates: write G90.1 before the first arc"
            }
            Some(Distance::Absolute) => {
                "the centre fits if it counts from the start of the arc: write G91.1 before the first arc"
            }
            None => help,
        };
        self.request.is_damaged = true;
        let mut finding = Finding::error(Code::ArcRadius, self.source, message).help(help);
        if let Some((needed, available)) = numbers {
            finding.needed_mm = Some(needed);
            finding.available_mm = Some(available);
        }
        scene.findings.push(finding);
    }
}
