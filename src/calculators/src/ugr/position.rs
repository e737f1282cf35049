//! Guth's position index: by how much a source's glare decreases with its distance from the line of sight.
//!
//! CIE 117-1995, table 4.1, by T/R and H/R: R is the distance along the horizontal line of sight, T the distance to its
//! side and H the height above it. The index is bilinear between the entries. A test compares every entry with Guth's
//! formula, within 11 %.

/// No entry, outside the field of view.
const NONE: f64 = f64::NAN;
/// The step between entries, for T/R (rows) and H/R (columns).
const STEP: f64 = 0.1;

/// `TABLE[T/R][H/R]`, each in steps of .1 from 0.
///
/// At T/R 2.7 and H/R .6 the standard prints 7.50, with neighbors 7.00, 7.08, 6.50 and 7.70: a misprint of 7.05.
#[rustfmt::skip]
const TABLE: [[f64; 20]; 31] = [
    [1.00, 1.26, 1.53, 1.90, 2.35, 2.86, 3.50, 4.20, 5.00, 6.00, 7.00, 8.10, 9.25, 10.35, 11.70, 13.15, 14.70, 16.20, NONE, NONE],
    [1.05, 1.22, 1.46, 1.80, 2.20, 2.75, 3.40, 4.10, 4.80, 5.80, 6.80, 8.00, 9.10, 10.30, 11.60, 13.00, 14.60, 16.10, NONE, NONE],
    [1.12, 1.30, 1.50, 1.80, 2.20, 2.66, 3.18, 3.88, 4.60, 5.50, 6.50, 7.60, 8.75, 9.85, 11.20, 12.70, 14.00, 15.70, NONE, NONE],
    [1.22, 1.38, 1.60, 1.97, 2.25, 2.70, 3.25, 3.90, 4.60, 5.45, 6.45, 7.40, 8.40, 9.50, 10.85, 12.10, 13.70, 15.00, NONE, NONE],
    [1.32, 1.47, 1.70, 1.96, 2.35, 2.80, 3.30, 3.90, 4.60, 5.40, 6.40, 7.30, 8.30, 9.40, 10.60, 11.90, 13.20, 14.60, 16.00, NONE],
    [1.43, 1.60, 1.82, 2.10, 2.48, 2.91, 3.40, 3.98, 4.70, 5.50, 6.40, 7.30, 8.30, 9.40, 10.50, 11.75, 13.00, 14.40, 15.70, NONE],
    [1.55, 1.72, 1.98, 2.30, 2.65, 3.10, 3.60, 4.10, 4.80, 5.50, 6.40, 7.35, 8.40, 9.40, 10.50, 11.70, 13.00, 14.10, 15.40, NONE],
    [1.70, 1.88, 2.12, 2.48, 2.87, 3.30, 3.78, 4.30, 4.88, 5.60, 6.50, 7.40, 8.50, 9.50, 10.50, 11.70, 12.85, 14.00, 15.20, NONE],
    [1.82, 2.00, 2.32, 2.70, 3.08, 3.50, 3.92, 4.50, 5.10, 5.75, 6.60, 7.50, 8.60, 9.50, 10.60, 11.75, 12.80, 14.00, 15.10, NONE],
    [1.96, 2.20, 2.54, 2.90, 3.30, 3.70, 4.20, 4.75, 5.30, 6.00, 6.75, 7.70, 8.70, 9.65, 10.75, 11.80, 12.90, 14.00, 15.00, 16.00],
    [2.11, 2.40, 2.75, 3.10, 3.50, 3.91, 4.40, 5.00, 5.60, 6.20, 7.00, 7.90, 8.80, 9.75, 10.80, 11.90, 12.95, 14.00, 15.00, 16.00],
    [2.30, 2.55, 2.92, 3.30, 3.72, 4.20, 4.70, 5.25, 5.80, 6.55, 7.20, 8.15, 9.00, 9.90, 10.95, 12.00, 13.00, 14.00, 15.00, 16.00],
    [2.40, 2.75, 3.12, 3.50, 3.90, 4.35, 4.85, 5.50, 6.05, 6.70, 7.50, 8.30, 9.20, 10.00, 11.02, 12.10, 13.10, 14.00, 15.00, 16.00],
    [2.55, 2.90, 3.30, 3.70, 4.20, 4.65, 5.20, 5.70, 6.30, 7.00, 7.70, 8.55, 9.35, 10.20, 11.20, 12.25, 13.20, 14.00, 15.00, 16.00],
    [2.70, 3.10, 3.50, 3.90, 4.35, 4.85, 5.35, 5.85, 6.50, 7.25, 8.00, 8.70, 9.50, 10.40, 11.40, 12.40, 13.25, 14.05, 15.00, 16.00],
    [2.85, 3.15, 3.65, 4.10, 4.55, 5.00, 5.50, 6.20, 6.80, 7.50, 8.20, 8.85, 9.70, 10.55, 11.50, 12.50, 13.30, 14.05, 15.02, 16.00],
    [2.95, 3.40, 3.80, 4.25, 4.75, 5.20, 5.75, 6.30, 7.00, 7.65, 8.40, 9.00, 9.80, 10.80, 11.75, 12.60, 13.40, 14.20, 15.10, 16.00],
    [3.10, 3.55, 4.00, 4.50, 4.90, 5.40, 5.95, 6.50, 7.20, 7.80, 8.50, 9.20, 10.00, 10.85, 11.85, 12.75, 13.45, 14.20, 15.10, 16.00],
    [3.25, 3.70, 4.20, 4.65, 5.10, 5.60, 6.10, 6.75, 7.40, 8.00, 8.65, 9.35, 10.10, 11.00, 11.90, 12.80, 13.50, 14.20, 15.10, 16.00],
    [3.43, 3.86, 4.30, 4.75, 5.20, 5.70, 6.30, 6.90, 7.50, 8.17, 8.80, 9.50, 10.20, 11.00, 12.00, 12.82, 13.55, 14.20, 15.10, 16.00],
    [3.50, 4.00, 4.50, 4.90, 5.35, 5.80, 6.40, 7.10, 7.70, 8.30, 8.90, 9.60, 10.40, 11.10, 12.00, 12.85, 13.60, 14.30, 15.10, 16.00],
    [3.60, 4.17, 4.65, 5.05, 5.50, 6.00, 6.60, 7.20, 7.82, 8.45, 9.00, 9.75, 10.50, 11.20, 12.10, 12.90, 13.70, 14.35, 15.10, 16.00],
    [3.75, 4.25, 4.72, 5.20, 5.60, 6.10, 6.70, 7.35, 8.00, 8.55, 9.15, 9.85, 10.60, 11.30, 12.10, 12.90, 13.70, 14.40, 15.15, 16.00],
    [3.85, 4.35, 4.80, 5.25, 5.70, 6.22, 6.80, 7.40, 8.10, 8.65, 9.30, 9.90, 10.70, 11.40, 12.20, 12.95, 13.70, 14.40, 15.20, 16.00],
    [3.95, 4.40, 4.90, 5.35, 5.80, 6.30, 6.90, 7.50, 8.20, 8.80, 9.40, 10.00, 10.80, 11.50, 12.25, 13.00, 13.75, 14.45, 15.20, 16.00],
    [4.00, 4.50, 4.96, 5.40, 5.85, 6.40, 6.95, 7.55, 8.25, 8.85, 9.50, 10.05, 10.85, 11.55, 12.30, 13.00, 13.80, 14.50, 15.25, 16.00],
    [4.07, 4.55, 5.05, 5.47, 5.95, 6.46, 7.00, 7.65, 8.35, 8.95, 9.55, 10.10, 10.90, 11.60, 12.32, 13.00, 13.80, 14.50, 15.25, 16.00],
    [4.10, 4.60, 5.10, 5.53, 6.00, 6.50, 7.05, 7.70, 8.40, 9.00, 9.60, 10.16, 10.92, 11.63, 12.35, 13.00, 13.80, 14.50, 15.25, 16.00],
    [4.15, 4.62, 5.15, 5.56, 6.05, 6.55, 7.08, 7.73, 8.45, 9.05, 9.65, 10.20, 10.95, 11.65, 12.35, 13.00, 13.80, 14.50, 15.25, 16.00],
    [4.20, 4.65, 5.17, 5.60, 6.07, 6.57, 7.12, 7.75, 8.50, 9.10, 9.70, 10.23, 10.95, 11.65, 12.35, 13.00, 13.80, 14.50, 15.25, 16.00],
    [4.22, 4.67, 5.20, 5.65, 6.12, 6.60, 7.15, 7.80, 8.55, 9.12, 9.70, 10.23, 10.95, 11.65, 12.35, 13.00, 13.80, 14.50, 15.25, 16.00],
];

/// The position index; `None` beyond the table, where a source does not count.
pub fn position_index(sideways_over_along: f64, above_over_along: f64) -> Option<f64> {
    let (row, u) = split(sideways_over_along.abs(), TABLE.len())?;
    let (column, v) = split(above_over_along, TABLE[0].len())?;
    let [low, high] = [row, row + 1].map(|row| (1.0 - v) * TABLE[row][column] + v * TABLE[row][column + 1]);
    let index = (1.0 - u) * low + u * high;
    index.is_finite().then_some(index)
}

/// The interval between entries that contains a ratio, and the position in it from 0 to 1.
fn split(ratio: f64, entries: usize) -> Option<(usize, f64)> {
    let place = ratio / STEP;
    // Rounding may put the last entry slightly beyond the table.
    let last = (entries - 1) as f64;
    if !(0.0..=last + 1e-9).contains(&place) {
        return None;
    }
    let interval = (place.min(last).floor() as usize).min(entries - 2);
    Some((interval, place - interval as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guth's formula, as Levermore and the IES give it: angles from the line of sight and from the vertical through
    /// it.
    fn guth(sideways: f64, above: f64) -> f64 {
        let off = sideways.hypot(above).atan().to_degrees();
        let turned = sideways.atan2(above).to_degrees();
        let linear = 35.2 - 0.31889 * turned - 1.22 * (-2.0 * turned / 9.0).exp();
        let square = 21.0 + 0.26667 * turned - 0.002963 * turned * turned;
        (1e-3 * linear * off + 1e-5 * square * off * off).exp()
    }

    #[test]
    fn every_entry_is_near_guths_formula_and_between_its_neighbours() {
        let mut entries = 0;
        for (row, line) in TABLE.iter().enumerate() {
            for (column, entry) in line.iter().enumerate().filter(|(_, entry)| entry.is_finite()) {
                let formula = guth(STEP * row as f64, STEP * column as f64);
                assert!((entry / formula - 1.0).abs() < 0.11, "{row} {column}: {entry} {formula}");
                if column > 0 {
                    assert!(line[column - 1] < *entry, "{row} {column}");
                }
                // Between those before and after it, but for a few hundredths of rounding by hand.
                if row > 0 && row + 1 < TABLE.len() {
                    let (a, b) = (TABLE[row - 1][column], TABLE[row + 1][column]);
                    let middle = f64::midpoint(a, b);
                    assert!(
                        !middle.is_finite() || (entry / middle - 1.0).abs() < 0.05,
                        "{row} {column}: {a} {entry} {b}"
                    );
                }
                entries += 1;
            }
        }
        assert_eq!(entries, 31 * 20 - 13);
    }

    #[test]
    fn the_index_is_bilinear_and_ends_with_the_table() {
        assert_eq!(position_index(0.0, 0.0), Some(1.0));
        assert_eq!(position_index(-0.5, 0.5), Some(2.91));
        let middle = position_index(0.55, 0.55).unwrap();
        assert!((middle - (2.91 + 3.10 + 3.40 + 3.60) / 4.0).abs() < 1e-12);
        assert!((position_index(3.0, 1.9).unwrap() - 16.0).abs() < 1e-9);
        for (sideways, above) in [(3.1, 1.0), (1.0, 1.91), (0.05, 1.75), (0.0, f64::INFINITY), (f64::NAN, 0.0)] {
            assert_eq!(position_index(sideways, above), None, "{sideways} {above}");
        }
    }
}
