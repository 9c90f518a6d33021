//! A curve that visits all cells of a square, each next to the one before it (Hilbert).

/// Cells along one side of the square that a Hilbert curve fills.
pub(super) const SIDE: u32 = 1 << 16;

/// The place of a cell along the Hilbert curve.
pub(super) fn along(mut x: u32, mut y: u32) -> u32 {
    let mut place = 0;
    let mut side = SIDE / 2;
    while side > 0 {
        let (right, top) = (u32::from(x & side > 0), u32::from(y & side > 0));
        place += side * side * ((3 * right) ^ top);
        if top == 0 {
            if right == 1 {
                (x, y) = (SIDE - 1 - x, SIDE - 1 - y);
            }
            (x, y) = (y, x);
        }
        side /= 2;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_each_cell_once_and_goes_to_a_neighbour_each_time() {
        let shift = SIDE / 16;
        let mut cells: Vec<(u32, [u32; 2])> = (0..256)
            .map(|cell| [cell % 16, cell / 16])
            .map(|[x, y]| (along(x * shift, y * shift) / (shift * shift), [x, y]))
            .collect();
        cells.sort_unstable();
        for (index, (along, _)) in cells.iter().enumerate() {
            assert_eq!(*along as usize, index);
        }
        for pair in cells.windows(2) {
            let [[ax, ay], [bx, by]] = [pair[0].1, pair[1].1];
            assert_eq!(ax.abs_diff(bx) + ay.abs_diff(by), 1);
        }
    }
}
