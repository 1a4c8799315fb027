//! Rows are processed in whole vectors of [`LANES`] values. The compiler turns loops of this fixed length into vector
//! instructions, and nothing is left over at a row's end.

/// Values worked on at once: a 512-bit register of 16-bit values.
pub(super) const LANES: usize = 32;

/// One vector.
pub(super) type Lanes<T> = [T; LANES];

/// A value between `own` and `near`, with a weight of `EIGHTHS` (0 to 3) eighths for `near`. The two must differ by
/// less than 2^15.
#[inline(always)]
pub(super) fn mixed<const EIGHTHS: u8>(own: i16, near: i16) -> i16 {
    let difference = near - own;
    own + match EIGHTHS {
        0 => 0,
        1 => difference >> 3,
        2 => difference >> 2,
        _ => (difference >> 2) + (difference >> 3),
    }
}

/// The mean of two values, rounded up. Processors have a single instruction for this.
#[inline(always)]
pub(super) fn halfway(one: u16, other: u16) -> u16 {
    ((u32::from(one) + u32::from(other) + 1) >> 1) as u16
}

/// The mean of three values with the middle one counted twice: the nearest whole number, or the one above it.
#[inline(always)]
pub(super) fn weighted([left, middle, right]: [u16; 3]) -> u16 {
    halfway(halfway(left, right), middle)
}

/// The upper half of a product, rounded down.
#[inline(always)]
pub(super) fn upper_half(one: i16, other: i16) -> i16 {
    ((i32::from(one) * i32::from(other)) >> 16) as i16
}

/// For row `row` of the `rows` rows of the row of cells `y`: the nearest other of the `cells` rows of cells, and its
/// weight in eighths, by the distances of the centres.
pub(super) fn between(row: usize, rows: usize, y: usize, cells: usize) -> (usize, u8) {
    let near = if row < rows / 2 { y.saturating_sub(1) } else { (y + 1).min(cells - 1) };
    let eighths = 4 * (2 * row + 1).abs_diff(rows) / rows;
    (near, eighths as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_between_cells_count_by_their_distance() {
        assert_eq!([0, 1, 2, 3].map(|row| between(row, 4, 5, 9)), [(4, 3), (4, 1), (6, 1), (6, 3)]);
        assert_eq!([0, 1].map(|row| between(row, 2, 0, 9)), [(0, 2), (1, 2)]);
        assert_eq!(between(0, 1, 8, 9), (8, 0));
    }

    #[test]
    fn a_value_between_two_is_within_one_of_the_exact_one() {
        for (own, near) in [(0, 8000), (8000, 0), (-300, 301), (17, 17), (16_000, -16_000)] {
            let exact = |eighths: i32| (8 - eighths) * i32::from(own) + eighths * i32::from(near);
            let found = [mixed::<0>(own, near), mixed::<1>(own, near), mixed::<2>(own, near), mixed::<3>(own, near)];
            for (eighths, found) in (0..).zip(found) {
                assert!((8 * i32::from(found) - exact(eighths)).abs() <= 16, "{own} {near} {eighths}: {found}");
            }
        }
    }
}
