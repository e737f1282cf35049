//! Inverse-square method: direct illuminance of a point from point luminaires, E = I cos(xi) / d^2.
//!
//! Lambert, *Photometria* (1760); IES Lighting Handbook, point calculations. The method is exact for a point source.
//! For an extended one its error is about 1-2.5 % at five times the largest luminous dimension (the five-times rule).
//! Lambert's polygon formula gives the error for a Lambertian opening of the luminaire's size.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Calculated, NotApplicable, Validity};
use luxproof_photometry::LuminousOpening;
use luxproof_photometry::units::{Candela, Lux};
use luxproof_scene::geometry::configuration_factor::element_to_polygon;
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape};

/// Direct illuminance of a meter: the sum over luminaires that no obstacle hides, 0 behind the meter's plane.
///
/// It is exact for point models. Of extended luminaires the nearest one, relative to its size, decides the validity. One
/// with a hidden centre counts too: a part of it may show.
/// Within the five-times rule the validity states the error for a Lambertian opening. Closer, the method does not
/// apply.
pub fn direct_illuminance(scene: &Scene, meter: &Meter) -> Result<Calculated, NotApplicable> {
    let mut sum = Lux(0.0);
    let mut nearest: Option<(FiveTimesRule, &Luminaire)> = None;
    for luminaire in &scene.luminaires {
        if luminaire.position_m == meter.position_m {
            let reason = format!("the meter lies at the photometric centre of `{}`; move either", luminaire.id);
            return Err(NotApplicable { method: METHOD, reason });
        }
        let hidden = scene.obstacles.iter().any(|obstacle| blocks(obstacle, meter.position_m, luminaire.position_m));
        let unshaded = from_luminaire(luminaire, meter);
        sum = sum + if hidden { Lux(0.0) } else { unshaded };
        if luminaire.model != LuminaireModel::Point && unshaded.value() > 0.0 {
            let rule = FiveTimesRule::check(luminaire, meter);
            if nearest.is_none_or(|(other, _)| rule.distance_over_size < other.distance_over_size) {
                nearest = Some((rule, luminaire));
            }
        }
    }
    let objection = nearest.and_then(|(rule, luminaire)| rule.objection(luminaire));
    if let (Some(reason), Some((rule, _))) = (&objection, nearest)
        && !rule.holds()
    {
        return Err(NotApplicable { method: METHOD, reason: reason.clone() });
    }
    Ok(Calculated { illuminance: sum, validity: Validity::from_objections(objection.as_slice()) })
}

/// The illuminance of a meter by one luminaire, without obstacles.
pub fn from_luminaire(luminaire: &Luminaire, meter: &Meter) -> Lux {
    by_distance(luminaire, meter, Luminaire::intensity_towards)
}

/// The difference that rounding can make at a meter in the direction of a jump of a point luminaire's table.
///
/// It is the sum over all point luminaires, including hidden ones.
pub fn jump(scene: &Scene, meter: &Meter) -> Lux {
    let points = scene.luminaires.iter().filter(|l| l.model == LuminaireModel::Point);
    Lux(points.map(|l| by_distance(l, meter, Luminaire::jump_towards).value()).sum())
}

/// The illuminance of a meter by an intensity, over the squared distance.
fn by_distance(luminaire: &Luminaire, meter: &Meter, towards: fn(&Luminaire, DVec3) -> Candela) -> Lux {
    let towards_meter = meter.position_m - luminaire.position_m;
    let cos_xi = -towards_meter.normalize().dot(meter.normal);
    if cos_xi > 0.0 {
        Lux(towards(luminaire, towards_meter).value() * cos_xi / towards_meter.length_squared())
    } else {
        Lux(0.0)
    }
}

/// Mean cylindrical illuminance of a point by point luminaires, without obstacles.
///
/// By EN 12464-1 it is the mean illuminance of vertical surfaces over all azimuths. A surface that faces the azimuth
/// phi receives `I cos(phi - phi_0) r / d^3` from a luminaire at the horizontal distance r, and nothing from behind.
/// The mean of the positive part of a cosine is 1 / pi, so E = sum of I r / (pi d^3).
pub fn cylindrical_illuminance(scene: &Scene, point_m: DVec3) -> Lux {
    Lux(scene.luminaires.iter().map(|luminaire| cylindrical_illuminance_by(luminaire, point_m)).sum())
}

/// The mean cylindrical illuminance of a point by one luminaire.
fn cylindrical_illuminance_by(luminaire: &Luminaire, point_m: DVec3) -> f64 {
    let towards_point = point_m - luminaire.position_m;
    let horizontal_m = towards_point.truncate().length();
    let intensity = luminaire.intensity_towards(towards_point).value();
    intensity * horizontal_m / (PI * towards_point.length().powi(3))
}

/// Semi-cylindrical illuminance of a meter by point luminaires, without obstacles (EN 13201-3).
///
/// It is the mean over the half circle about the meter's horizontal direction of the illuminance of vertical surfaces:
/// light from the azimuth alpha off that direction counts (1 + cos alpha) / pi of what a surface that faces it gets.
pub fn semicylindrical_illuminance(scene: &Scene, meter: &Meter) -> Lux {
    let facing = meter.normal.truncate().normalize_or_zero();
    let by_luminaire = scene.luminaires.iter().map(|luminaire| {
        let towards_point = meter.position_m - luminaire.position_m;
        let cos_alpha = -towards_point.truncate().normalize_or_zero().dot(facing);
        cylindrical_illuminance_by(luminaire, meter.position_m) * (1.0 + cos_alpha)
    });
    Lux(by_luminaire.sum())
}

/// Hemispherical illuminance of a meter by point luminaires, without obstacles (EN 13201-3).
///
/// A hemisphere of radius r shows pi r^2 (1 + cos theta) / 2 of its 2 pi r^2 to light at the angle theta from its axis.
pub fn hemispherical_illuminance(scene: &Scene, meter: &Meter) -> Lux {
    let by_luminaire = scene.luminaires.iter().map(|luminaire| {
        let cos_theta = (luminaire.position_m - meter.position_m).normalize().dot(meter.normal);
        normal_illuminance_by(luminaire, meter.position_m) * (1.0 + cos_theta) / 4.0
    });
    Lux(by_luminaire.sum())
}

/// Mean spherical (scalar) illuminance of a point by point luminaires, without obstacles.
///
/// A sphere of radius r shows pi r^2 of its 4 pi r^2 to any light.
pub fn spherical_illuminance(scene: &Scene, point_m: DVec3) -> Lux {
    Lux(scene.luminaires.iter().map(|luminaire| normal_illuminance_by(luminaire, point_m) / 4.0).sum())
}

/// The illuminance at a point of a surface that faces one luminaire.
fn normal_illuminance_by(luminaire: &Luminaire, point_m: DVec3) -> f64 {
    let towards_point = point_m - luminaire.position_m;
    luminaire.intensity_towards(towards_point).value() / towards_point.length_squared()
}

/// The name of the method in errors.
const METHOD: &str = "inverse-square method";

/// The five-times rule for one luminaire and one meter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiveTimesRule {
    /// Distance over the largest luminous dimension; infinite for an opening without extent.
    pub distance_over_size: f64,
    /// Point formula over exact value, less 1, for a Lambertian opening of the luminaire's size and plan.
    ///
    /// `None` where the meter sees the opening edge-on or its plane cuts the opening, and where that is not flat.
    pub lambertian_error: Option<f64>,
}

impl FiveTimesRule {
    /// Checks the rule for the luminaire's opening, whatever its model.
    pub fn check(luminaire: &Luminaire, meter: &Meter) -> Self {
        let distance = meter.position_m.distance(luminaire.position_m);
        let distance_over_size = distance / largest_dimension_m(&luminaire.photometry.opening);
        Self { distance_over_size, lambertian_error: lambertian_twin(luminaire, meter) }
    }

    /// Whether the distance is at least five times the size.
    pub fn holds(&self) -> bool {
        self.distance_over_size >= 5.0
    }

    /// The error by the luminaire's extent, as a text; `None` where it has no extent.
    fn objection(&self, luminaire: &Luminaire) -> Option<String> {
        if self.distance_over_size.is_infinite() {
            return None;
        }
        let error = match self.lambertian_error {
            Some(error) => format!("for a Lambertian opening of its size the method errs by {:+.2} %", 100.0 * error),
            None => format!("its extent matters by up to about {:.2} %", 100.0 * FAR_ERROR / self.k2()),
        };
        let rule = if self.holds() { "" } else { ", closer than the five-times rule allows; take an area method" };
        Some(format!(
            "`{}` is {:.2} times its largest luminous dimension away{rule}; {error}",
            luminaire.id, self.distance_over_size
        ))
    }

    /// The squared distance over the squared size.
    fn k2(&self) -> f64 {
        self.distance_over_size * self.distance_over_size
    }
}

/// The largest |1/3 - sin^2 theta|: the error of a Lambertian square times (distance / side)^2.
const FAR_ERROR: f64 = 2.0 / 3.0;

/// The number of corners of a round outline.
const CORNERS: u32 = 720;

/// Relative error of the point formula for a flat Lambertian opening in the luminaire's place.
///
/// `None` for openings with height or none at all, and where part of the opening lies behind the meter's plane.
pub fn lambertian_twin(luminaire: &Luminaire, meter: &Meter) -> Option<f64> {
    let corners: Vec<DVec3> = luminaire
        .photometry
        .opening
        .flat_outline_m(CORNERS)?
        .into_iter()
        .map(|corner| luminaire.position_m + luminaire.orientation * corner)
        .collect();
    let axis = luminaire.orientation * DVec3::NEG_Z;
    let towards_meter = meter.position_m - luminaire.position_m;
    let cos_source = towards_meter.normalize().dot(axis).abs();
    let cos_xi = -towards_meter.normalize().dot(meter.normal);
    let visible = corners.iter().all(|corner| (corner - meter.position_m).dot(meter.normal) > 0.0);
    if !visible || cos_source < 1e-9 {
        return None;
    }
    // Exitance 1: exact E = c; intensity A cos / pi.
    let exact = element_to_polygon(meter.position_m, meter.normal, &corners);
    let point = area(&corners) * cos_source * cos_xi / (std::f64::consts::PI * towards_meter.length_squared());
    Some(point / exact - 1.0)
}

/// The area of a convex polygon.
fn area(corners: &[DVec3]) -> f64 {
    let fan = corners.windows(2).skip(1).map(|edge| (edge[0] - corners[0]).cross(edge[1] - corners[0]));
    0.5 * fan.sum::<DVec3>().length()
}

/// The largest extent of a luminous opening in meters, by the five-times rule; a rectangle's longer side.
pub fn largest_dimension_m(opening: &LuminousOpening) -> f64 {
    match *opening {
        LuminousOpening::Point => 0.0,
        LuminousOpening::Box { x_m, y_m, height_m } | LuminousOpening::Ellipse { x_m, y_m, height_m } => {
            x_m.max(y_m).max(height_m)
        }
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } => x_m.max(y_m).max(z_m),
        LuminousOpening::LyingCylinder { length_m, diameter_m, .. } => length_m.max(diameter_m),
    }
}

/// Whether an obstacle cuts the open segment between two points; an end that lies on its surface does not count.
pub(super) fn blocks(obstacle: &Obstacle, from_m: DVec3, to_m: DVec3) -> bool {
    let along = to_m - from_m;
    match &obstacle.shape {
        Shape::Box { min_m, max_m } => {
            let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
            for axis in 0..3 {
                let (low, high) = (min_m[axis] - from_m[axis], max_m[axis] - from_m[axis]);
                if along[axis] == 0.0 {
                    if low >= 0.0 || high <= 0.0 {
                        return false;
                    }
                    continue;
                }
                let (a, b) = (low / along[axis], high / along[axis]);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
            leave - enter > MAX_TOUCH
        }
        Shape::Mesh { vertices_m, triangles } => triangles.iter().any(|triangle| {
            let [a, b, c] = triangle.map(|vertex| vertices_m[vertex as usize]);
            crosses(from_m, along, [a, b, c])
        }),
    }
}

/// The share of a segment that may lie within an obstacle by rounding, when an end touches it.
const MAX_TOUCH: f64 = 1e-12;

/// Möller and Trumbore (1997): whether the segment crosses the triangle between its ends.
fn crosses(from_m: DVec3, along: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    let p = along.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return false;
    }
    let s = from_m - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = along.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > MAX_TOUCH && t < 1.0 - MAX_TOUCH
}

#[cfg(test)]
#[path = "inverse_square_tests.rs"]
mod tests;
