//! Chains: consecutive elements whose directions stay within a right angle.
//!
//! If the joints of a chain hold, its offset is nowhere too near to the chain itself.

use crate::geometry::element::{Element, Vec2, cross};

/// Belongs to no chain.
pub(crate) const NO_CHAIN: u32 = u32::MAX;

/// Gives elements in a row their chains.
#[derive(Debug)]
pub(crate) struct Chains {
    chain: u32,
    /// The rightmost and leftmost direction so far.
    range: Option<(Vec2, Vec2)>,
}

impl Chains {
    pub(crate) const fn new() -> Self {
        Self { chain: 0, range: None }
    }

    /// The chain of the next element.
    pub(crate) fn next(&mut self, element: &Element) -> u32 {
        let fits = element.is_line()
            || matches!(element, Element::Arc(arc) if arc.sweep < std::f64::consts::FRAC_PI_2);
        let tangents = [element.start_tangent(), element.end_tangent()];
        let widened = self
            .range
            .filter(|_| fits)
            .and_then(|range| widen(widen(range, tangents[0])?, tangents[1]));
        if widened.is_none() {
            self.chain += 1;
        }
        self.range = match widened {
            Some(range) => Some(range),
            None if fits => widen((tangents[0], tangents[0]), tangents[1]),
            None => None,
        };
        self.chain
    }

    /// The chain of the last element.
    pub(crate) const fn current(&self) -> u32 {
        self.chain
    }

    /// The next element begins a chain of its own.
    pub(crate) fn cut(&mut self) {
        self.range = None;
    }
}

/// The range of directions with one more; `None` when it would be a right angle or more.
fn widen((right, left): (Vec2, Vec2), tangent: Vec2) -> Option<(Vec2, Vec2)> {
    if right.dot(&tangent) <= 0.0 || left.dot(&tangent) <= 0.0 {
        return None;
    }
    let range = (
        if cross(right, tangent) < 0.0 { tangent } else { right },
        if cross(left, tangent) > 0.0 { tangent } else { left },
    );
    (range.0.dot(&range.1) > 0.0).then_some(range)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_ends_before_its_directions_span_a_right_angle() {
        let mut chains = Chains::new();
        let directions = [0.0_f64, 40.0, -45.0, 30.0, 90.0, 120.0, 179.0, -1.0];
        let numbers = directions.map(|degrees| {
            let (y, x) = degrees.to_radians().sin_cos();
            chains.next(&Element::line(Vec2::zeros(), Vec2::new(x, y)).expect("a length"))
        });
        assert_eq!(numbers, [1, 1, 1, 1, 2, 2, 2, 3]);
    }
}
