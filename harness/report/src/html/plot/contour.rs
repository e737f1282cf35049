//! Isolux lines: marching squares over a grid of meters, linear along the sides of each square.

/// A segment of a contour, in fractional grid indices along u and v.
pub(super) type Segment = [[f64; 2]; 2];

/// A corner of a grid square with its value.
struct Corner {
    index: [usize; 2],
    value: f64,
}

/// The segments of the contour at `level`; `values` row by row, `counts` along u and v.
pub(super) fn contour(values: &[f64], counts: [usize; 2], level: f64) -> Vec<Segment> {
    let mut segments = vec![];
    for j in 0..counts[1].saturating_sub(1) {
        for i in 0..counts[0].saturating_sub(1) {
            let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]]
                .map(|index| Corner { index, value: values[index[1] * counts[0] + index[0]] });
            segments.extend(square_segments(&corners, level));
        }
    }
    segments
}

/// The segments within one square: none, one or two.
fn square_segments(corners: &[Corner; 4], level: f64) -> Vec<Segment> {
    let crossings: Vec<[f64; 2]> = (0..4).filter_map(|k| crossing(&corners[k], &corners[(k + 1) % 4], level)).collect();
    match crossings[..] {
        [a, b] => vec![[a, b]],
        // A saddle: the mean of the corners decides which sides are connected.
        [a, b, c, d] => {
            let mean = corners.iter().map(|corner| corner.value).sum::<f64>() / 4.0;
            if (mean >= level) == (corners[0].value >= level) { vec![[a, b], [c, d]] } else { vec![[d, a], [b, c]] }
        }
        _ => vec![],
    }
}

/// The point of a side where the value passes the level.
fn crossing(a: &Corner, b: &Corner, level: f64) -> Option<[f64; 2]> {
    if (a.value >= level) == (b.value >= level) {
        return None;
    }
    let t = (level - a.value) / (b.value - a.value);
    Some([0, 1].map(|k| a.index[k] as f64 + t * (b.index[k] as f64 - a.index[k] as f64)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_has_one_straight_line_where_it_passes_the_level() {
        let values: Vec<f64> = (0..12).map(|k| f64::from(k % 4)).collect();
        let segments = contour(&values, [4, 3], 1.25);
        assert_eq!(segments.len(), 2);
        assert!(segments.iter().flatten().all(|p| (p[0] - 1.25).abs() < 1e-12));
    }

    #[test]
    fn a_cone_has_closed_rings_of_its_radius() {
        let n = 41;
        let values: Vec<f64> = (0..n * n).map(|k| f64::hypot((k % n) as f64 - 20.0, (k / n) as f64 - 20.0)).collect();
        let segments = contour(&values, [n, n], 10.0);
        assert!(segments.iter().flatten().all(|p| (f64::hypot(p[0] - 20.0, p[1] - 20.0) - 10.0).abs() < 0.02));
        let length: f64 = segments.iter().map(|[a, b]| f64::hypot(a[0] - b[0], a[1] - b[1])).sum();
        assert!((length / std::f64::consts::TAU / 10.0 - 1.0).abs() < 0.01, "{length}");
    }

    #[test]
    fn a_level_that_is_never_reached_has_no_line() {
        assert!(contour(&[1.0; 9], [3, 3], 2.0).is_empty());
    }

    #[test]
    fn a_saddle_keeps_its_two_sides_apart() {
        for level in [0.4, 0.6] {
            let segments = contour(&[1.0, 0.0, 0.0, 1.0], [2, 2], level);
            assert_eq!(segments.len(), 2);
            let crosses = |s: &Segment| (s[0][0] - s[1][0]).abs() > 0.9 || (s[0][1] - s[1][1]).abs() > 0.9;
            assert!(!segments.iter().any(crosses), "{segments:?}");
        }
    }
}
