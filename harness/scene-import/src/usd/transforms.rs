//! Where a prim is: its `xformOps` in their order.

use glam::{DMat4, DQuat, DVec3, EulerRot};

use luxproof_process::printable::Quoted;

use super::layer::Prim;

const RESET: &str = "!resetXformStack!";
const INVERT: &str = "!invert!";
/// Operations of a prim.
const MAX_OPERATIONS: usize = 100;

/// The transform of a prim below one with a transform; or why it is none.
pub(super) fn to_world(prim: &Prim, above: &DMat4) -> Result<DMat4, String> {
    let names = prim.texts("xformOpOrder").unwrap_or_default();
    if names.len() > MAX_OPERATIONS {
        return Err("it has too many operations".to_owned());
    }
    let is_reset = names.first().is_some_and(|name| name == RESET);
    let mut whole = if is_reset { DMat4::IDENTITY } else { *above };
    for name in names.iter().filter(|name| *name != RESET) {
        let (name, is_inverted) = match name.strip_prefix(INVERT) {
            Some(name) => (name, true),
            None => (name.as_str(), false),
        };
        let matrix = operation(prim, name)?;
        whole *= if is_inverted { matrix.inverse() } else { matrix };
    }
    if whole.is_finite() { Ok(whole) } else { Err("it is not finite".to_owned()) }
}

/// The matrix of one operation.
fn operation(prim: &Prim, name: &str) -> Result<DMat4, String> {
    let kind = name.split(':').nth(1).unwrap_or_default();
    let shown = Quoted(name);
    let numbers = prim.numbers(name).ok_or_else(|| format!("{shown} has no value"))?;
    let matrix = match (kind, numbers) {
        ("translate", [x, y, z]) => DMat4::from_translation(DVec3::new(*x, *y, *z)),
        ("scale", [x, y, z]) => DMat4::from_scale(DVec3::new(*x, *y, *z)),
        ("translateX", [x]) => DMat4::from_translation(DVec3::new(*x, 0.0, 0.0)),
        ("translateY", [y]) => DMat4::from_translation(DVec3::new(0.0, *y, 0.0)),
        ("translateZ", [z]) => DMat4::from_translation(DVec3::new(0.0, 0.0, *z)),
        ("scaleX", [x]) => DMat4::from_scale(DVec3::new(*x, 1.0, 1.0)),
        ("scaleY", [y]) => DMat4::from_scale(DVec3::new(1.0, *y, 1.0)),
        ("scaleZ", [z]) => DMat4::from_scale(DVec3::new(1.0, 1.0, *z)),
        ("rotateX", [x]) => DMat4::from_rotation_x(x.to_radians()),
        ("rotateY", [y]) => DMat4::from_rotation_y(y.to_radians()),
        ("rotateZ", [z]) => DMat4::from_rotation_z(z.to_radians()),
        ("orient", [w, x, y, z]) => rotation(DQuat::from_xyzw(*x, *y, *z, *w))?,
        // Rows of a matrix that points are multiplied with from the left are columns of one from the right.
        ("transform", numbers) => match <[f64; 16]>::try_from(numbers) {
            Ok(rows) => DMat4::from_cols_array(&rows),
            Err(_) => return Err(format!("{shown} has not sixteen numbers")),
        },
        (rotate, [x, y, z]) => turned(rotate, DVec3::new(*x, *y, *z)).ok_or_else(|| format!("{shown} is unknown"))?,
        _ => return Err(format!("{shown} is unknown, or has not its numbers")),
    };
    Ok(matrix)
}

fn rotation(quaternion: DQuat) -> Result<DMat4, String> {
    let length = quaternion.length();
    if length.is_finite() && length > 0.0 {
        return Ok(DMat4::from_quat(quaternion / length));
    }
    Err("a quaternion has no length".to_owned())
}

/// Three rotations, of which the first letter's comes first.
fn turned(name: &str, degrees: DVec3) -> Option<DMat4> {
    let [x, y, z] = degrees.to_array().map(f64::to_radians);
    let (order, angles) = match name {
        "rotateXYZ" => (EulerRot::ZYX, [z, y, x]),
        "rotateXZY" => (EulerRot::YZX, [y, z, x]),
        "rotateYXZ" => (EulerRot::ZXY, [z, x, y]),
        "rotateYZX" => (EulerRot::XZY, [x, z, y]),
        "rotateZXY" => (EulerRot::YXZ, [y, x, z]),
        "rotateZYX" => (EulerRot::XYZ, [x, y, z]),
        _ => return None,
    };
    Some(DMat4::from_euler(order, angles[0], angles[1], angles[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each of three rotations by itself, the first letter's first.
    #[test]
    fn three_rotations_are_one_after_the_other() {
        let degrees = DVec3::new(20.0, -50.0, 130.0);
        for name in ["rotateXYZ", "rotateXZY", "rotateYXZ", "rotateYZX", "rotateZXY", "rotateZYX"] {
            let mut expected = DMat4::IDENTITY;
            for letter in name.trim_start_matches("rotate").chars() {
                let next = match letter {
                    'X' => DMat4::from_rotation_x(degrees.x.to_radians()),
                    'Y' => DMat4::from_rotation_y(degrees.y.to_radians()),
                    _ => DMat4::from_rotation_z(degrees.z.to_radians()),
                };
                expected = next * expected;
            }
            let found = turned(name, degrees).unwrap();
            assert!(found.abs_diff_eq(expected, 1e-12), "{name}: {found} {expected}");
        }
    }
}
