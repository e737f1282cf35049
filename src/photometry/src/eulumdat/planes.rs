//! The C planes that a EULUMDAT file stores for its symmetry indicator, and their conversion to those of a distribution.

use crate::error::Problem;

/// The angles of the planes with intensities, in the order of the file.
pub(super) fn stored_planes(symmetry: u8, c_deg: &[f64]) -> Result<Vec<f64>, Problem> {
    let planes = c_deg.len();
    let is_plane = |k: usize, angle: f64| c_deg.get(k).is_some_and(|c| *c == angle);
    let expected = match symmetry {
        0 if planes > 1 && is_plane(0, 0.0) => return Ok(c_deg.to_vec()),
        0 => "without symmetry (Isym 0) they run from 0 around the circle",
        1 => return Ok(vec![0.0]),
        2 if planes >= 2 && is_plane(0, 0.0) && is_plane(planes / 2, 180.0) => {
            return Ok(c_deg[..=planes / 2].to_vec());
        }
        2 => "for Isym 2, plane Mc/2 + 1 must be 180",
        3 if planes.is_multiple_of(4) && is_plane(planes / 4, 90.0) && is_plane(3 * planes / 4, 270.0) => {
            let (before, after) = (&c_deg[3 * planes / 4..], &c_deg[..=planes / 4]);
            return Ok(before.iter().chain(after).copied().collect());
        }
        3 => "for Isym 3, planes Mc/4 + 1 and 3 Mc/4 + 1 must be 90 and 270",
        _ if planes >= 4 && is_plane(0, 0.0) && is_plane(planes / 4, 90.0) => {
            return Ok(c_deg[..=planes / 4].to_vec());
        }
        _ => "for Isym 4, plane Mc/4 + 1 must be 90",
    };
    Err(Problem::AngleRange { axis: "C", first: c_deg[0], last: c_deg[planes - 1], expected })
}

/// Arranges stored planes and intensities as those of a distribution.
///
/// Planes 270 over 0 to 90 (Isym 3) are mirrored in C90-C270 to 90 to 270. Without symmetry, plane 0 closes the circle.
pub(super) fn arrange_planes(
    symmetry: u8,
    mut c_deg: Vec<f64>,
    mut candela: Vec<f64>,
    gammas: usize,
) -> (Vec<f64>, Vec<f64>) {
    match symmetry {
        0 if c_deg[c_deg.len() - 1] < 360.0 => {
            c_deg.push(360.0);
            candela.extend_from_within(..gammas);
        }
        3 => {
            c_deg = c_deg.iter().rev().map(|c| (540.0 - c).rem_euclid(360.0)).collect();
            candela = candela.chunks(gammas).rev().flatten().copied().collect();
        }
        _ => {}
    }
    (c_deg, candela)
}

/// Whether the listed planes are mirror images of each other, as the symmetry indicator requires.
pub(super) fn are_planes_mirrored(symmetry: u8, c_deg: &[f64]) -> bool {
    let open = if c_deg.last() == Some(&360.0) { &c_deg[..c_deg.len() - 1] } else { c_deg };
    let quarter = open.len() / 4;
    match symmetry {
        2 => has_mirror(open, 0.0, 0),
        3 => has_mirror(open, 90.0, quarter),
        4 => has_mirror(open, 0.0, 0) && has_mirror(open, 90.0, quarter),
        _ => true,
    }
}

/// Whether the planes on both sides of plane `at`, which lies in the mirror, are mirror images.
fn has_mirror(c_deg: &[f64], mirror_deg: f64, at: usize) -> bool {
    let planes = c_deg.len();
    (1..planes).all(|k| {
        let sum = c_deg[(at + k) % planes] + c_deg[(at + planes - k) % planes];
        let deviation = (sum - 2.0 * mirror_deg).rem_euclid(360.0);
        // Files round their angles.
        deviation.min(360.0 - deviation) < 0.01
    })
}
