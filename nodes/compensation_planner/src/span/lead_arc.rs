//! The arc that leads the tool to the contour, as LinuxCNC makes it of a programmed one.
//!
//! It begins where the programmed arc does, with the tool there, and ends one radius beside its end, at a
//! tangent to it. Both have the same turn. Where there is no such arc, `rules` refuses the program.

use crate::geometry::element::{Arc, swept};
use crate::geometry::tolerance::{
    LEAD_ARC_GROWTH_MAX, LEAD_ARC_RADIUS_MM_MAX, LENGTH_MM, RADIUS_MM,
};
use std::f64::consts::TAU;

/// Why no arc leads to the offset of a programmed one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum NoLeadArc {
    /// It ends where it starts.
    FullCircle,
    /// Its ends are nearer to each other than the radius of the tool: the tool would cut its end.
    Short { chord_mm: f64 },
    /// The tool runs inside of it, and is too large. Above `wanted_mm` an arc of the same angle leads it well
    /// ([`radius_of_angle`]).
    Inside { radius_mm_limit: f64, wanted_mm: f64 },
}

/// The lead of a programmed arc at a signed offset. Its offset by `d_mm` is the path of the tool, from
/// the programmed start; it ends where the programmed arc does.
pub(crate) fn lead_arc(programmed: &Arc, d_mm: f64) -> Result<Arc, NoLeadArc> {
    let Arc { center, radius, turn, from, to, sweep } = *programmed;
    // From the chord, so that short arcs lose no digits.
    let (part, chord_mm) = ((from - to).norm_squared(), radius * (from - to).norm());
    if chord_mm <= LENGTH_MM {
        return Err(NoLeadArc::FullCircle);
    }
    // How far the start is on the inner side of the tangent at the end, mm.
    let inside_mm = radius * part / 2.0;
    // How far the tool is on that side.
    let beside_mm = d_mm * turn;
    if beside_mm <= 0.0 && -beside_mm >= chord_mm - RADIUS_MM {
        return Err(NoLeadArc::Short { chord_mm });
    }
    if beside_mm > 0.0 {
        let radius_mm_limit = largest_inside(radius, inside_mm);
        if beside_mm >= radius_mm_limit - RADIUS_MM {
            let wanted_mm = radius_of_angle(programmed, beside_mm);
            return Err(NoLeadArc::Inside { radius_mm_limit, wanted_mm });
        }
    }
    let squared = chord_mm * chord_mm + beside_mm * (beside_mm - 2.0 * inside_mm);
    let path_radius = squared / (2.0 * (inside_mm - beside_mm));
    let path_center = center + to * (radius - beside_mm - path_radius);
    let start = center + from * radius - path_center;
    let out = start / start.norm();
    let turns = (sweep / TAU).floor();
    Ok(Arc {
        center: path_center,
        radius: path_radius + beside_mm,
        from: out,
        sweep: swept(out, to, turn) + TAU * turns,
        ..*programmed
    })
}

/// The radius that a tool inside of an arc has to stay below, mm: it fits into the arc, and comes from the
/// inner side of the tangent beside it. The start of the arc is so far on the inner side of the tangent at
/// its end.
fn largest_inside(radius: f64, inside_mm: f64) -> f64 {
    // Where the tool is nearly at the tangent, its arc is nearly straight.
    let straight = inside_mm * (2.0 * radius - inside_mm) / (2.0 * LEAD_ARC_RADIUS_MM_MAX);
    radius.min(inside_mm - straight)
}

/// The radius above which an arc of the same angle leads a tool of this radius along its inside, and grows to no more than
/// [`LEAD_ARC_GROWTH_MAX`]. An arc with the same ends and a larger radius turns less, and may lead no tool at all.
pub(crate) fn radius_of_angle(programmed: &Arc, tool_mm: f64) -> f64 {
    // The lead has the radius (2 i r^2 - t^2) / (2 (i r - t)), i of which the start is on the inner side of the tangent.
    let inside = (programmed.from - programmed.to).norm_squared() / 2.0;
    let more = LEAD_ARC_GROWTH_MAX - 1.0;
    let root = (LEAD_ARC_GROWTH_MAX.powi(2) - 2.0 * more * inside).max(0.0).sqrt();
    tool_mm.max(tool_mm * (LEAD_ARC_GROWTH_MAX + root) / (2.0 * more * inside))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::element::{Element, Vec2};
    use proptest::prelude::*;

    /// About a centre, from an angle on, degrees.
    fn arc(center: [f64; 2], radius: f64, from: f64, sweep: f64) -> Arc {
        let at = |degrees: f64| Vec2::from(center) + unit(degrees) * radius;
        let (start, end) = (at(from), at(from + sweep));
        let turns = (sweep.abs() / 360.0).floor() as u16;
        match Element::arc(start, end, Vec2::from(center), sweep > 0.0, turns) {
            Some(Element::Arc(arc)) => arc,
            _ => panic!("no arc"),
        }
    }

    fn unit(degrees: f64) -> Vec2 {
        Vec2::new(degrees.to_radians().cos(), degrees.to_radians().sin())
    }

    /// The path of the tool: start, end, centre and sweep.
    fn path(programmed: &Arc, d_mm: f64) -> (Vec2, Vec2, Vec2, f64) {
        let lead = lead_arc(programmed, d_mm).expect("a lead");
        let path = Element::Arc(lead).offset(d_mm).expect("a path");
        (path.start(), path.end(), lead.center, lead.sweep)
    }

    #[test]
    fn the_tool_runs_from_where_it_stands_to_the_offset_of_the_end() {
        // What LinuxCNC's interpreter prints for these, to four decimals.
        for (sweep, d_mm, end, center) in [
            (90.0, 5.0, [15.0, 20.0], [-5.8333, 20.0]),
            (90.0, -5.0, [25.0, 20.0], [4.5, 20.0]),
            (-90.0, -5.0, [15.0, -20.0], [-5.8333, -20.0]),
            (-90.0, 5.0, [25.0, -20.0], [4.5, -20.0]),
            (270.0, 5.0, [-15.0, 20.0], [5.8333, 20.0]),
            (270.0, -5.0, [-25.0, 20.0], [-4.5, 20.0]),
            (450.0, -5.0, [25.0, 20.0], [4.5, 20.0]),
        ] {
            let up = if sweep > 0.0 { 1.0 } else { -1.0 };
            let programmed = arc([0.0, 20.0 * up], 20.0, -90.0 * up, sweep);
            let (from, to, about, swept) = path(&programmed, d_mm);
            let case = format!("{sweep} {d_mm}: {from} {to} {about} {swept}");
            assert!(from.norm() < 1e-9, "{case}");
            assert!((to - Vec2::from(end)).norm() < 1e-9, "{case}");
            assert!((about - Vec2::from(center)).norm() < 1e-4, "{case}");
            assert_eq!((swept / TAU).floor(), (sweep.abs() / 360.0).floor(), "{case}");
        }
    }

    #[test]
    fn without_an_offset_the_lead_is_the_programmed_arc() {
        let programmed = arc([3.0, -4.0], 7.0, 100.0, 250.0);
        let lead = lead_arc(&programmed, 0.0).expect("a lead");
        assert!((lead.center - programmed.center).norm() < 1e-9);
        assert!((lead.sweep - programmed.sweep).abs() < 1e-9);
    }

    #[test]
    fn a_tool_that_no_arc_leads_is_refused_at_its_radius() {
        let quarter = arc([0.0, 6.0], 6.0, -90.0, 90.0);
        let chord = 6.0 * 2.0_f64.sqrt();
        // Inside, the start is 6 mm on the inner side of the tangent.
        for (d_mm, takes) in [(5.99, true), (6.01, false), (-8.48, true), (-8.49, false)] {
            assert_eq!(lead_arc(&quarter, d_mm).is_ok(), takes, "{d_mm}");
        }
        let short = lead_arc(&quarter, -9.0);
        let is_chord = |mm: f64| (mm - chord).abs() < 1e-9;
        assert!(
            matches!(short, Err(NoLeadArc::Short { chord_mm }) if is_chord(chord_mm)),
            "{short:?}"
        );
        // A sixth of a circle: 10 mm on the inner side.
        let sixth = arc([0.0, 20.0], 20.0, -90.0, 60.0);
        let limit = |of| match lead_arc(&sixth, of) {
            Err(NoLeadArc::Inside { radius_mm_limit, .. }) => radius_mm_limit,
            other => panic!("{other:?}"),
        };
        assert!((limit(10.0) - 10.0).abs() < 1e-3 && limit(10.0) < 10.0);
        // Beyond the tangent the tool would come backwards.
        assert!(lead_arc(&sixth, 12.0).is_err() && lead_arc(&sixth, 9.99).is_ok());
        // The tool may run an arc that bends more than itself: it is inside.
        let half = arc([0.0, 8.0], 8.0, -90.0, 180.0);
        for (d_mm, takes) in [(5.0, true), (7.9, true), (8.1, false), (-15.9, true), (-16.1, false)]
        {
            assert_eq!(lead_arc(&half, d_mm).is_ok(), takes, "{d_mm}");
        }
        for d_mm in [5.0, -5.0, 0.0] {
            let circle = arc([0.0, 20.0], 20.0, -90.0, 360.0);
            assert_eq!(lead_arc(&circle, d_mm), Err(NoLeadArc::FullCircle));
        }
    }

    #[test]
    fn an_arc_that_nearly_closes_leads_no_tool_that_is_wider_than_its_gap() {
        let open = arc([0.0, 0.0], 20.0, 0.0, 359.99);
        let chord = 40.0 * 0.005_f64.to_radians().sin();
        assert!(matches!(lead_arc(&open, -5.0), Err(NoLeadArc::Short { .. })));
        assert!(matches!(lead_arc(&open, 5.0), Err(NoLeadArc::Inside { .. })));
        assert!(lead_arc(&open, -0.9 * chord).is_ok());
    }

    proptest! {
        /// What the refusal advises: a larger arc of the same angle, or half a circle. A smaller one is not enough.
        #[test]
        fn a_larger_arc_of_the_same_angle_leads_the_tool(
            radius in 0.01..1e3_f64,
            sweep in prop_oneof![-719.0..-0.1_f64, 0.1..719.0_f64],
            part in 0.0..5.0_f64,
        ) {
            let d_mm = (part * radius).min(500.0) * sweep.signum();
            let leads = |radius: f64, sweep: f64| {
                let programmed = arc([5.0, -7.0], radius, 30.0, sweep);
                lead_arc(&programmed, d_mm).is_ok_and(|it| it.radius <= LEAD_ARC_GROWTH_MAX * radius)
            };
            let refused = lead_arc(&arc([5.0, -7.0], radius, 30.0, sweep), d_mm);
            if let Err(NoLeadArc::Inside { wanted_mm, .. }) = refused {
                if wanted_mm < 1e5 {
                    prop_assert!(leads(wanted_mm * (1.0 + 1e-6) + 1e-8, sweep), "{wanted_mm}");
                    prop_assert!(!leads(wanted_mm * (1.0 - 1e-6) - 1e-8, sweep), "{wanted_mm}");
                }
                let half = 180.0 * sweep.signum();
                prop_assert!(leads(d_mm.abs() * (1.0 + 1e-6) + 1e-8, half));
            }
        }

        /// Whatever the arc: it starts at the tool, ends at a tangent, and comes to the programmed end as
        /// near as the radius and nowhere nearer.
        #[test]
        fn a_lead_arc_touches_the_end_at_the_radius(
            radius in 0.01..1e6_f64,
            from in 0.0..360.0_f64,
            sweep in prop_oneof![-719.0..-0.01_f64, 0.01..719.0_f64],
            part in -3.0..3.0_f64,
        ) {
            let programmed = arc([5.0, -7.0], radius, from, sweep);
            let d_mm = part * radius.min(100.0);
            let Ok(lead) = lead_arc(&programmed, d_mm) else { return Ok(()) };
            let path = Element::Arc(lead).offset(d_mm).expect("a path");
            let whole = Element::Arc(programmed);
            let size = radius.max(lead.radius.min(1e7)).max(1.0);
            let (own, other) = (path.end_tangent(), whole.end_tangent());
            prop_assert!((path.start() - whole.start()).norm() < 1e-9 * size, "start");
            prop_assert!((own - other).norm() < 1e-9, "tangent");
            prop_assert!(((path.end() - whole.end()).norm() - d_mm.abs()).abs() < 1e-9 * size, "end");
            let path_radius = lead.radius - d_mm * lead.turn;
            let off = ((whole.end() - lead.center).norm() - path_radius).abs();
            prop_assert!(off > d_mm.abs() - 1e-9 * size, "{off} from the end");
            prop_assert_eq!((lead.sweep / TAU).floor(), (programmed.sweep / TAU).floor());
        }
    }
}
