//! Curved surfaces of Radiance as flat faces, their corners on the surface: what is drawn never sticks out of what
//! was meant.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Faces around an axis.
pub(super) const AROUND: usize = 32;

type Triangles = Vec<[DVec3; 3]>;

/// The triangles of a ring, cylinder, tube, cone, cup, sphere or bubble by its numbers.
pub(super) fn triangles(kind: &str, numbers: &[f64]) -> Result<Triangles, String> {
    let count = |expected: usize| format!("{} numbers, not {expected}", numbers.len());
    let (mut made, is_inwards) = match kind {
        "ring" => {
            let [x, y, z, u, v, w, inner, outer] = *numbers else { return Err(count(8)) };
            let (centre, radii) = (DVec3::new(x, y, z), [inner, outer]);
            let axis = DVec3::new(u, v, w);
            (band([(centre, inner.min(outer)), (centre, inner.max(outer))], axis, &radii)?, false)
        }
        "cylinder" | "tube" => {
            let [a, b, c, x, y, z, r] = *numbers else { return Err(count(7)) };
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(x, y, z));
            (band([(to, r), (from, r)], to - from, &[r])?, kind == "tube")
        }
        "cone" | "cup" => {
            let [a, b, c, x, y, z, r, s] = *numbers else { return Err(count(8)) };
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(x, y, z));
            (band([(to, s), (from, r)], to - from, &[r, s])?, kind == "cup")
        }
        _ => {
            let [x, y, z, r] = *numbers else { return Err(count(4)) };
            (ball(DVec3::new(x, y, z), r)?, (kind == "bubble") != (r < 0.0))
        }
    };
    if is_inwards {
        for triangle in &mut made {
            triangle.swap(1, 2);
        }
    }
    Ok(made)
}

/// The corner of so many around a circle; the same for both directions of an axis, so that a ring closes a cylinder.
fn around(centre: DVec3, axis: DVec3, radius: f64, k: usize) -> DVec3 {
    let canonical = if axis.to_array().iter().find(|c| **c != 0.0).is_some_and(|c| *c < 0.0) { -axis } else { axis };
    let (u, v) = canonical.any_orthonormal_pair();
    let (sin, cos) = (TAU * (k % AROUND) as f64 / AROUND as f64).sin_cos();
    let turn = if canonical == axis { 1.0 } else { -1.0 };
    // Turned the other way around the other direction, from the same corner.
    centre + radius * (cos * u + turn * sin * v)
}

/// What lies between two circles about an axis, looking outwards where the first is the one ahead, along the axis
/// where it is the inner one.
fn band(circles: [(DVec3, f64); 2], axis: DVec3, radii: &[f64]) -> Result<Triangles, String> {
    let axis = axis.try_normalize().ok_or("it has no direction")?;
    if radii.iter().any(|r| *r < 0.0) || radii.iter().all(|r| *r == 0.0) {
        return Err("its radii are not positive".to_owned());
    }
    let [first, second] = circles;
    let mut triangles = vec![];
    for k in 0..AROUND {
        let [a, b] = [k, k + 1].map(|k| around(first.0, axis, first.1, k));
        let [c, d] = [k, k + 1].map(|k| around(second.0, axis, second.1, k));
        if second.1 > 0.0 {
            triangles.push([c, d, a]);
        }
        if first.1 > 0.0 {
            triangles.push([a, d, b]);
        }
    }
    Ok(triangles)
}

/// A sphere by meridians and parallels.
fn ball(centre: DVec3, radius: f64) -> Result<Triangles, String> {
    if radius == 0.0 {
        return Err("its radius is 0".to_owned());
    }
    let parallels = AROUND / 2;
    let bands = (0..parallels).map(|k| {
        let circles = [k, k + 1].map(|k| {
            let (sin, cos) = (PI * k as f64 / parallels as f64).sin_cos();
            // At the poles all corners are one.
            let r = if k == 0 || k == parallels { 0.0 } else { radius.abs() * sin };
            (centre + radius.abs() * cos * DVec3::Z, r)
        });
        band(circles, DVec3::Z, &circles.map(|c| c.1))
    });
    Ok(bands.collect::<Result<Vec<_>, _>>()?.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(triangles: &Triangles) -> f64 {
        triangles.iter().map(|[a, b, c]| a.cross(*b).dot(*c) / 6.0).sum()
    }

    #[test]
    fn solids_enclose_what_they_should_facing_outwards() {
        let prism = AROUND as f64 / 2.0 * (TAU / AROUND as f64).sin();
        for axis in [[0.0, 0.0, 2.0], [0.0, 0.0, -2.0], [1.2, -1.6, 0.0], [-1.2, 1.6, 0.0]] {
            let [x, y, z] = axis;
            let mut tin = triangles("cylinder", &[0.0, 0.0, 0.0, x, y, z, 0.5]).unwrap();
            tin.extend(triangles("ring", &[0.0, 0.0, 0.0, -x, -y, -z, 0.5, 0.0]).unwrap());
            tin.extend(triangles("ring", &[x, y, z, x, y, z, 0.0, 0.5]).unwrap());
            assert!((volume(&tin) - prism * 0.25 * 2.0).abs() < 1e-12, "{axis:?}: {}", volume(&tin));
            // Closed: each edge is run along once in either direction.
            let key = |p: DVec3| (p * 1e9).round().to_array().map(|c| c as i64);
            let edges: Vec<_> = tin.iter().flat_map(|t| (0..3).map(|k| (key(t[k]), key(t[(k + 1) % 3])))).collect();
            assert!(edges.iter().all(|(a, b)| edges.iter().filter(|e| **e == (*b, *a)).count() == 1), "{axis:?}");
        }
        let sphere = volume(&triangles("sphere", &[0.0, 0.0, 0.0, 1.5]).unwrap()) / (4.0 / 3.0 * PI * 1.5f64.powi(3));
        assert!((0.97..1.0).contains(&sphere), "{sphere}");
        let bubble = volume(&triangles("bubble", &[0.0, 0.0, 0.0, 1.5]).unwrap());
        let turned = volume(&triangles("sphere", &[0.0, 0.0, 0.0, -1.5]).unwrap());
        assert!(bubble < 0.0 && (bubble - turned).abs() < 1e-12);
        let mut cone = triangles("cone", &[0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 1.0, 0.0]).unwrap();
        cone.extend(triangles("ring", &[0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0]).unwrap());
        assert!((volume(&cone) - prism).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_solid_is_refused() {
        for (kind, numbers) in [
            ("sphere", &[0.0, 0.0, 0.0][..]),
            ("sphere", &[0.0, 0.0, 0.0, 0.0]),
            ("cylinder", &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
            ("cylinder", &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0]),
            ("ring", &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        ] {
            assert!(triangles(kind, numbers).is_err(), "{kind} {numbers:?}");
        }
    }
}
