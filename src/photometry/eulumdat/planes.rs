//! Which C planes a EULUMDAT file stores for its symmetry indicator, and how they become those of a distribution.

use crate::photometry::error::Problem;

/// The angles of the planes whose intensities follow, in the order of the file.
pub(super) fn stored(symmetry: u8, c_deg: &[f64]) -> Result<Vec<f64>, Problem> {
    let planes = c_deg.len();
    let problem = |expected| {
        let (first, last) = (c_deg[0], c_deg[planes - 1]);
        Err(Problem::AngleRange { axis: "C", first, last, expected })
    };
    let at = |k: usize, angle: f64| c_deg.get(k).is_some_and(|c| *c == angle);
    match symmetry {
        0 if planes > 1 && at(0, 0.0) => Ok(c_deg.to_vec()),
        0 => problem("without symmetry (Isym 0) they run from 0 around the circle"),
        1 => Ok(vec![0.0]),
        2 if planes >= 2 && at(0, 0.0) && at(planes / 2, 180.0) => Ok(c_deg[..=planes / 2].to_vec()),
        2 => problem("for Isym 2, plane Mc/2 + 1 must be 180"),
        3 if planes.is_multiple_of(4) && at(planes / 4, 90.0) && at(3 * planes / 4, 270.0) => {
            let (before, after) = (&c_deg[3 * planes / 4..], &c_deg[..=planes / 4]);
            Ok(before.iter().chain(after).copied().collect())
        }
        3 => problem("for Isym 3, planes Mc/4 + 1 and 3 Mc/4 + 1 must be 90 and 270"),
        _ if planes >= 4 && at(0, 0.0) && at(planes / 4, 90.0) => Ok(c_deg[..=planes / 4].to_vec()),
        _ => problem("for Isym 4, plane Mc/4 + 1 must be 90"),
    }
}

/// Planes and intensities as a distribution has them.
///
/// Planes 270 over 0 to 90 (Isym 3) are mirrored in C90-C270 to 90 to 270; without symmetry plane 0 closes the circle.
pub(super) fn arrange(symmetry: u8, mut c_deg: Vec<f64>, mut candela: Vec<f64>, gammas: usize) -> (Vec<f64>, Vec<f64>) {
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

/// Whether the listed planes are mirror images of each other, as the symmetry indicator says.
pub(super) fn mirrored(symmetry: u8, c_deg: &[f64]) -> bool {
    let open = if c_deg.last() == Some(&360.0) { &c_deg[..c_deg.len() - 1] } else { c_deg };
    let planes = open.len();
    // The plane `at` lies in the mirror; those on its two sides belong together. Files round their angles.
    let about = |mirror_deg: f64, at: usize| {
        (1..planes).all(|k| {
            let off = (open[(at + k) % planes] + open[(at + planes - k) % planes] - 2.0 * mirror_deg).rem_euclid(360.0);
            off.min(360.0 - off) < 0.01
        })
    };
    match symmetry {
        2 => about(0.0, 0),
        3 => about(90.0, planes / 4),
        4 => about(0.0, 0) && about(90.0, planes / 4),
        _ => true,
    }
}
