//! Closed contours of lines and arcs that take tools up to a radius that is known beforehand.
//!
//! A random shape is opened with a disc: made smaller by its radius and larger again. What
//! is left are all places that the disc gets to, with an arc of its radius in every corner
//! that it does not get into. So every smaller tool fits everywhere, and no larger one does.

use super::contour;
use super::outline::{area_above, offsets, polyline};
use super::shapes::{edge, vertices};
use cavalier_contours::core::math::Vector2;
use cavalier_contours::polyline::{BooleanOp, PlineSource, PlineSourceMut, Polyline};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::profile::Profile;
use proptest::prelude::*;

/// A contour, entered in the middle of its longest line.
#[derive(Clone)]
pub struct Opened {
    /// From the entry on, each point with the bulge of the edge after it.
    pub vertices: Vec<([f64; 2], f64)>,
    /// The largest tool that fits.
    pub clearance_mm: f64,
    pub is_left: bool,
}

impl std::fmt::Debug for Opened {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "up to {} mm:\n{}", self.clearance_mm, self.program())
    }
}

impl Opened {
    fn new(shape: &Polyline<f64>, clearance_mm: f64, is_left: bool) -> Option<Self> {
        let count = shape.vertex_count();
        let at = |index: usize| shape.at(index % count);
        let length = |index: usize| (at(index + 1).pos() - at(index).pos()).length();
        let lines = (0..count).filter(|&index| at(index).bulge == 0.0);
        let longest = lines.max_by(|&a, &b| length(a).total_cmp(&length(b)))?;
        // A line that is long enough to be entered in its middle; and no noise that is
        // merged, differently from either end: it has its own tests.
        if length(longest) < 1.0 || (0..count).any(|index| length(index) < 0.02) {
            return None;
        }
        let middle = (at(longest).pos() + at(longest + 1).pos()).scale(0.5);
        let corners = (longest + 1..=longest + count).map(at);
        let corners = corners.map(|vertex| ([vertex.x, vertex.y], vertex.bulge));
        let vertices = std::iter::once(([middle.x, middle.y], 0.0)).chain(corners).collect();
        Some(Self { vertices, clearance_mm, is_left })
    }

    pub fn signed(&self, radius_mm: f64) -> f64 {
        if self.is_left { radius_mm } else { -radius_mm }
    }

    pub fn polyline(&self) -> Polyline<f64> {
        polyline(&self.vertices)
    }

    /// The contour as a program in the words of SINUMERIK 840C; the leads are square to its
    /// first line. The first edge stands in line 3.
    pub fn program(&self) -> String {
        let ([x, y], [to_x, to_y]) = (self.vertices[0].0, self.vertices[1].0);
        let away = self.signed(3.0 * self.clearance_mm) / (to_x - x).hypot(to_y - y);
        let (out_x, out_y) = (x - (to_y - y) * away, y + (to_x - x) * away);
        let side = if self.is_left { "G41" } else { "G42" };
        let mut text = format!("G0 X{out_x} Y{out_y}\n{side} D1 G456 G1 X{x} Y{y} F100\n");
        for (index, (from, bulge)) in self.vertices.iter().enumerate() {
            let to = self.vertices[(index + 1) % self.vertices.len()].0;
            text += &edge(*from, to, *bulge);
        }
        text + &format!("G40 G456 G1 X{out_x} Y{out_y}")
    }

    pub fn contour(&self, profile: &Profile) -> ProgrammedContour {
        contour(&self.program(), profile)
    }
}

fn opened(shape: &Polyline<f64>, radius_mm: f64, is_left: bool) -> Option<Polyline<f64>> {
    let inwards = if is_left { radius_mm } else { -radius_mm };
    // The largest of the pieces that the disc gets to.
    let smaller = offsets(shape, inwards).into_iter();
    let smaller = smaller.max_by(|a, b| a.area().abs().total_cmp(&b.area().abs()))?;
    let [larger]: [Polyline<f64>; 1] = offsets(&smaller, -inwards).try_into().ok()?;
    // An arc that the disc is inside of, and that turns enough to be no noise.
    let is_rounded = larger.iter_segments().any(|(from, to)| {
        let bulge = if is_left { from.bulge } else { -from.bulge };
        let half = (to.pos() - from.pos()).length() / 2.0;
        bulge > 0.1 && (half * (bulge + 1.0 / bulge) / 2.0 - radius_mm).abs() < 1e-6
    });
    (is_rounded && area_above(&larger, 1.0)).then_some(larger)
}

fn star(corners: &[(f64, f64)], bends: &[f64]) -> Option<Polyline<f64>> {
    let shape = polyline(&vertices(corners, bends));
    (shape.area() > 1.0 && !shape.scan_for_self_intersect()).then_some(shape)
}

fn corners() -> impl Strategy<Value = Vec<(f64, f64)>> {
    prop::collection::vec((8.0..60.0_f64, -1.0..1.0_f64), 3..16)
}

fn bends() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(prop_oneof![2 => Just(0.0), 1 => -0.8..0.8_f64], 1..6)
}

/// Pockets and bosses whose narrowest corners are as round as the clearance.
pub fn rounded() -> impl Strategy<Value = Opened> {
    let numbers = (corners(), bends(), 0.5..8.0_f64, any::<bool>());
    numbers.prop_filter_map("nothing is left", |(corners, bends, radius_mm, is_left)| {
        let shape = opened(&star(&corners, &bends)?, radius_mm, is_left)?;
        Opened::new(&shape, radius_mm, is_left)
    })
}

/// Two pockets with a channel between them that is narrower than all of their corners: its
/// walls are far apart in the program.
pub fn necked() -> impl Strategy<Value = Opened> {
    let numbers = (corners(), corners(), bends(), 2.0..6.0_f64, 0.2..0.95_f64, 0.0..1.0_f64);
    numbers.prop_filter_map("no channel", |(first, second, bends, radius_mm, part, turned)| {
        let first = opened(&star(&first, &bends)?, radius_mm, true)?;
        let mut second = opened(&star(&second, &bends)?, radius_mm, true)?;
        let (sin, cos) = (turned * std::f64::consts::TAU).sin_cos();
        let (far, half) = (140.0, part * radius_mm);
        second.translate_mut(far * cos, far * sin);
        let mut channel = Polyline::new_closed();
        for (along, across) in [(0.0, -half), (far, -half), (far, half), (0.0, half)] {
            channel.add(along * cos - across * sin, along * sin + across * cos, 0.0);
        }
        for (pocket, end) in
            [(&first, Vector2::new(0.0, 0.0)), (&second, Vector2::new(far * cos, far * sin))]
        {
            // Each wall of the channel leaves the pocket once.
            let crossings = pocket.find_intersects(&channel);
            let is_within = pocket.winding_number(end) == 1
                && pocket.closest_point(end, 1e-9)?.distance > 2.0 * half;
            if !is_within || crossings.basic_intersects.len() != 2 {
                return None;
            }
        }
        let joined = union(&union(&first, &channel)?, &second)?;
        Opened::new(&joined, half, true)
    })
}

fn union(a: &Polyline<f64>, b: &Polyline<f64>) -> Option<Polyline<f64>> {
    let mut result = a.boolean(b, BooleanOp::Or);
    (result.pos_plines.len() == 1 && result.neg_plines.is_empty())
        .then(|| result.pos_plines.remove(0).pline)
}

/// Either of them.
pub fn shapes() -> impl Strategy<Value = Opened> {
    prop_oneof![2 => rounded(), 1 => necked()]
}
