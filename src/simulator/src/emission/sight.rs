//! How much of what a place sees a luminous opening fills: what it would give there by one luminance all over.

use std::f64::consts::PI;

use glam::DVec3;

use super::sheet::{OpeningPart, Part, facing};
use super::{IN_PLANE_M, LocalMeter, Precision};
use luxproof_photometry::angles_deg;
use luxproof_scene::geometry::configuration_factor::element_to_polygon;
use luxproof_scene::opening::Opening;
use luxproof_scene::{Luminaire, Meter};

/// To so much of itself it is integrated where it has no closed form.
const PRECISION: Precision = Precision::relative(1e-9);
/// Less of the sphere than this is edge on.
const EDGE_ON_SR: f64 = 1e-12;

/// The projected solid angle of a luminaire's opening at a meter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// In steradians: illuminance over it is the opening's mean luminance.
    pub projected_sr: f64,
    /// How far off it may be, as a part of it.
    pub relative_error: f64,
}

impl Sight {
    /// Of a luminaire alone; `None` where its opening has no area, is seen edge on, or holds the meter.
    ///
    /// That of a point is its luminous area's as seen from afar, which is at its centre.
    pub fn of(luminaire: &Luminaire, meter: &Meter) -> Option<Self> {
        let (opening, own) = (Opening::of_luminaire(luminaire), LocalMeter::of(luminaire, meter));
        let found = if opening == Opening::Point {
            let (c_deg, gamma_deg) = angles_deg(own.position_m);
            let area_m2 = luminaire.photometry.projected_area_m2(c_deg, gamma_deg);
            let cosine = -own.position_m.normalize_or_zero().dot(own.normal);
            Self { projected_sr: area_m2 * cosine.max(0.0) / own.position_m.length_squared(), relative_error: 0.0 }
        } else {
            Self::of_extended(&opening, &own)
        };
        (found.projected_sr.is_finite() && found.projected_sr > EDGE_ON_SR).then_some(found)
    }

    fn of_extended(opening: &Opening, own: &LocalMeter) -> Self {
        let fills = |part: &Part| {
            let path = own.position_m - part.at_m;
            let cosines = part.area_m2.dot(path).abs() * (-path.dot(own.normal)).max(0.0);
            // A place upon the opening sees it under no angle.
            if cosines > 0.0 { cosines / path.length_squared().powi(2) } else { 0.0 }
        };
        let (mut value, mut bound) = (0.0, 0.0);
        for sheet in facing(opening, own.position_m) {
            match sheet {
                OpeningPart::Line(_) => {}
                // In its plane it is edge on, or the meter lies on it.
                OpeningPart::Face { corner_m: p, edges_m: [a, b] } if is_in_plane(own.position_m - p, a.cross(b)) => {}
                OpeningPart::Face { corner_m: p, edges_m: [a, b] } => {
                    value += PI * element_to_polygon(own.position_m, own.normal, &[p, p + a, p + a + b, p + b]);
                }
                curved => {
                    let found = curved.integral(PRECISION, &fills, &|_, _| None);
                    value += found.value;
                    bound += found.bound;
                }
            }
        }
        Self { projected_sr: value, relative_error: bound / value }
    }
}

fn is_in_plane(away_m: DVec3, normal: DVec3) -> bool {
    away_m.dot(normal).abs() <= IN_PLANE_M * normal.length()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use approx::assert_relative_eq;

    use super::*;
    use crate::emission::Emitter;
    use luxproof_photometry::{HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry};
    use luxproof_scene::{LuminaireModel, orientation};

    fn luminaire(opening: LuminousOpening, model: LuminaireModel, candela: impl Fn(f64) -> f64) -> Luminaire {
        let gamma: Vec<f64> = (0..=180).map(f64::from).collect();
        let values = gamma.iter().map(|g| candela(g.to_radians())).collect();
        let table = LuminousIntensityDistribution::axial(gamma, values).unwrap();
        Luminaire {
            id: "l".into(),
            photometry: Arc::new(Photometry { opening, ..Photometry::of(table) }),
            position_m: DVec3::new(2.0, 1.0, 3.0),
            orientation: orientation(30.0, 20.0, 10.0),
            flux_scale: 1.0,
            model,
        }
    }

    fn aimed(luminaire: &Luminaire, away_m: DVec3) -> Meter {
        Meter { position_m: luminaire.position_m + away_m, normal: -away_m.normalize() }
    }

    #[test]
    fn a_ball_fills_its_disc_and_far_off_all_fill_their_shadows() {
        let ball = LuminousOpening::Ellipsoid { x_m: 0.2, y_m: 0.2, z_m: 0.2 };
        let area = luminaire(ball, LuminaireModel::Area, |_| 100.0);
        for away in [DVec3::new(0.1, 0.06, -0.02), DVec3::new(0.5, 2.0, 1.0)] {
            let sight = Sight::of(&area, &aimed(&area, away)).unwrap();
            // sin² of the ball's half angle times π.
            assert_relative_eq!(sight.projected_sr, PI * 0.01 / away.length_squared(), max_relative = 1e-9);
            assert!(sight.relative_error < 1e-9);
        }
        for opening in [
            ball,
            LuminousOpening::Box { x_m: 0.2, y_m: 0.3, height_m: 0.1 },
            LuminousOpening::Box { x_m: 0.2, y_m: 0.3, height_m: 0.0 },
            LuminousOpening::Ellipse { x_m: 0.2, y_m: 0.3, height_m: 0.1 },
            LuminousOpening::Ellipse { x_m: 0.2, y_m: 0.3, height_m: 0.0 },
            LuminousOpening::Ellipsoid { x_m: 0.0, y_m: 0.3, z_m: 0.1 },
            LuminousOpening::Ellipsoid { x_m: 0.2, y_m: 0.0, z_m: 0.1 },
            LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m: 0.3, diameter_m: 0.2 },
        ] {
            let away = DVec3::new(300.0, -500.0, -400.0);
            let [near, far] = [LuminaireModel::Area, LuminaireModel::Point]
                .map(|model| luminaire(opening, model, |_| 100.0))
                .map(|l| Sight::of(&l, &aimed(&l, away)).unwrap().projected_sr);
            assert_relative_eq!(near, far, max_relative = 1e-5);
        }
    }

    #[test]
    fn what_has_one_luminance_shows_it_from_every_place() {
        let panel = LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 };
        let panel = luminaire(panel, LuminaireModel::Area, |gamma| 90.0 * gamma.cos().max(0.0));
        let emitter = Emitter::new(&panel);
        for away in [DVec3::new(0.02, 0.1, -0.2), DVec3::new(2.0, 1.0, -0.7)] {
            let meter = aimed(&panel, panel.orientation * away);
            let lux = emitter.illuminance(&meter, &[], Precision::relative(1e-9)).value;
            let sight = Sight::of(&panel, &meter).unwrap();
            assert_relative_eq!(lux / sight.projected_sr, 500.0, max_relative = 1e-9);
        }
    }

    #[test]
    fn what_is_edge_on_or_a_point_or_around_the_meter_is_not_seen() {
        let flat = LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 };
        let model = |opening, model| luminaire(opening, model, |_| 1.0);
        let panel = model(flat, LuminaireModel::Area);
        assert_eq!(Sight::of(&panel, &aimed(&panel, panel.orientation * DVec3::X)), None);
        let point = model(LuminousOpening::Point, LuminaireModel::Point);
        assert_eq!(Sight::of(&point, &aimed(&point, DVec3::X)), None);
        let solid = LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.2 };
        let solid = model(solid, LuminaireModel::Area);
        assert_eq!(Sight::of(&solid, &aimed(&solid, DVec3::new(0.01, 0.0, 0.0))), None);
        let panel = model(flat, LuminaireModel::Area);
        assert_eq!(Sight::of(&panel, &Meter { position_m: panel.position_m, normal: DVec3::X }), None);
    }
}
