//! Every tolerance of the planner, once, with its unit and its reason.

/// Sine of the turn below which two elements are tangent, rad.
///
/// With the largest tool in use (1 m) the joint is off by a micrometre along the element, and by
/// the square of this across it.
pub(crate) const TANGENT_RAD: f64 = 1e-6;

/// The shortest element that is written, and how far a compensated element may run backwards before
/// it counts as reversed, mm. Far below any machine's resolution, far above the rounding of
/// coordinates of 10 m.
pub(crate) const LENGTH_MM: f64 = 1e-6;

/// Legs that stay this close to one line or arc are one for the geometry, mm.
/// Programs are written with three or four decimals.
pub(crate) const MERGE_MM: f64 = 1e-4;

/// An outside corner whose arc would be shorter than this is joined by the
/// intersection instead, mm, if it also turns by less than [`SMALL_TURN_RAD`].
pub(crate) const SHORT_CORNER_MM: f64 = 1e-4;

/// See [`SHORT_CORNER_MM`]; keeps the intersection within 1e-7 mm of the arc.
pub(crate) const SMALL_TURN_RAD: f64 = 1e-3;

/// How far the middle of such a corner may be off the circle next to it, mm. If it is farther,
/// because the circle is nearly a point, the tool goes around the corner.
pub(crate) const FLAT_MM: f64 = 1e-7;

/// Sine below which two lines do not meet, rad: 1 nm of offset would move the
/// meeting point by a metre.
pub(crate) const PARALLEL_RAD: f64 = 1e-9;

/// How far the tool may be nearer to an element than its radius before it is a
/// gouge, mm. That of merging: both add up to less than a quarter of a micrometre.
pub(crate) const GOUGE_MM: f64 = 1e-4;

/// An intersection at an outside corner is reported if it is more radii than this from the corner:
/// a turn of more than 168.5 degrees.
pub(crate) const FAR_CORNER_RADII: f64 = 10.0;

/// `1 + cos(turn)` below which the intersection of an outside corner is not used,
/// whatever the mode: a turn of more than 178.4 degrees, a spike of 70 radii.
pub(crate) const REVERSAL: f64 = 4e-4;

/// Chords of a curve bend less than this from one to the next, rad, and are off the
/// curve by less than [`CHORD_MM`]: what posts write for splines and surfaces.
pub(crate) const CHORD_TURN_RAD: f64 = 0.1;

/// See [`CHORD_TURN_RAD`], mm.
pub(crate) const CHORD_MM: f64 = 0.05;

/// An arc of a smaller radius that turns by more than [`CHORD_TURN_RAD`] is no chord of a curve,
/// mm. A curve of this radius bends by that much in a third of a millimetre.
pub(crate) const CURVE_RADIUS_MM: f64 = 3.0;

/// Sine of the turn above which a corner between two curves is sharp, rad. Between this and
/// [`CHORD_TURN_RAD`] it may be one curve with a chord missing, whose chords are features.
pub(crate) const SHARP_TURN_RAD: f64 = 0.125;

/// A straight longer than this part of the radius is no chord of a curve but a feature.
pub(crate) const CHORD_RADII: f64 = 1.0;

/// Walls that continue each other bend less than this, by the noise of coordinates, rad.
pub(crate) const BEND_RAD: f64 = 1e-2;

/// A narrower loop of a contour counts as none, mm: the contour went back over itself.
pub(crate) const LOOP_MM: f64 = 2e-3;

/// Difference of the radii at both ends of an arc that is rounding only, relative.
pub(crate) const ARC_RADIUS_REL: f64 = 1e-12;

/// Largest move of an arc's centre to where both ends are equally far, as a part of the radius.
/// Beyond that, the chord is too short to locate the centre.
pub(crate) const CENTER_SHIFT_REL: f64 = 0.05;

/// The same for arcs of less than half a turn. Their ends locate them well enough, and the centre
/// of a short one, posted with two decimals, may be anywhere.
pub(crate) const SHORT_ARC_SHIFT_REL: f64 = 0.5;

/// The largest radius of an arc that leads to a contour, mm: no coordinate of a program is farther. From
/// that far away a centre still locates the arc to 1e-9 mm.
pub(crate) const LEAD_ARC_RADIUS_MM_MAX: f64 = 1e6;

/// How many times as large as programmed an arc that leads to a contour may be before a warning says so.
/// Where it turns by a quarter, tools inside of it stay below up to 0.58 of its radius.
pub(crate) const LEAD_ARC_GROWTH_MAX: f64 = 2.0;

/// Radii that differ by less are the same offset, mm.
pub(crate) const RADIUS_MM: f64 = 1e-9;
