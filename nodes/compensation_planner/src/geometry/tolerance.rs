//! Every tolerance of the planner, once, with its unit and its reason.

/// Sine of the turn below which two elements are tangent, rad.
///
/// At the largest tool that is ever used (1 m) the joint is off by a micrometre,
/// sideways and by the square of this along the normal.
pub(crate) const TANGENT_RAD: f64 = 1e-6;

/// Shortest element that is put out, and how far a compensated element may run
/// backwards before it counts as reversed, mm. Far below any machine's
/// resolution, far above the rounding of coordinates of 10 m.
pub(crate) const LENGTH_MM: f64 = 1e-6;

/// Legs that stay this close to one line or arc are one for the geometry, mm.
/// Programs are written with three or four decimals.
pub(crate) const MERGE_MM: f64 = 1e-4;

/// An outside corner whose arc would be shorter than this is joined by the
/// intersection instead, mm, if it also turns by less than [`SMALL_TURN_RAD`].
pub(crate) const SHORT_CORNER_MM: f64 = 1e-4;

/// See [`SHORT_CORNER_MM`]; keeps the intersection within 1e-7 mm of the arc.
pub(crate) const SMALL_TURN_RAD: f64 = 1e-3;

/// How far the middle of such a corner may be off the circle beside it, mm; where it is
/// farther, because the circle is nearly a point, the tool goes around the corner.
pub(crate) const FLAT_MM: f64 = 1e-7;

/// Sine below which two lines do not meet, rad: 1 nm of offset would move the
/// meeting point by a metre.
pub(crate) const PARALLEL_RAD: f64 = 1e-9;

/// How far the tool may be nearer to an element than its radius before it is a
/// gouge, mm. That of merging: both add up to less than a quarter of a micrometre.
pub(crate) const GOUGE_MM: f64 = 1e-4;

/// An intersection at an outside corner that is farther from the corner than so
/// many radii is told: a turn of more than 168.5 degrees.
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
/// mm: a curve of the radius of this bends by that much in a third of a millimetre.
pub(crate) const CURVE_RADIUS_MM: f64 = 3.0;

/// Sine of the turn above which a corner between two curves is sharp, rad: between this and
/// [`CHORD_TURN_RAD`] it may be one curve with a chord too few, whose chords are features.
pub(crate) const SHARP_TURN_RAD: f64 = 0.125;

/// A straight that is longer than this part of the radius is no chord of a curve but a
/// feature of its own.
pub(crate) const CHORD_RADII: f64 = 1.0;

/// Walls that go on in each other bend less by the noise of coordinates, rad.
pub(crate) const BEND_RAD: f64 = 1e-2;

/// A loop of a contour that is narrower is none, mm: it went back over itself.
pub(crate) const LOOP_MM: f64 = 2e-3;

/// Difference of the radii at both ends of an arc that is rounding only, relative.
pub(crate) const ARC_RADIUS_REL: f64 = 1e-12;

/// Largest move of an arc's centre to where both ends are equally far, as a part
/// of the radius. Beyond, the chord is too short to tell where the centre is.
pub(crate) const CENTER_SHIFT_REL: f64 = 0.05;

/// The same for arcs of less than half a turn: their ends say where they are, and the centre of
/// a short one, posted with two decimals, may be anywhere.
pub(crate) const SHORT_ARC_SHIFT_REL: f64 = 0.5;

/// Radii that differ by less are the same offset, mm.
pub(crate) const RADIUS_MM: f64 = 1e-9;
