//! The orientation of a luminaire: the convention of its file format, the mean direction of its light, and turns.

use glam::DVec3;

use super::distribution::tabulate;
use super::{
    Details, FileFormat, HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry,
    direction,
};

/// The meaning of the C planes in a format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convention {
    /// The plane that points forward: across the street, away from houses.
    pub forward_c_deg: f64,
    /// The plane along which long luminaires and their lamps lie.
    pub lamp_axis_c_deg: f64,
    /// The standards that define this.
    pub source: &'static str,
}

/// The convention of LM-63, and of TM-33, which uses the same coordinates.
const LM63: Convention = Convention {
    forward_c_deg: FileFormat::Tm33.forward_c_deg(),
    lamp_axis_c_deg: 0.0,
    source: "ANSI/IES LM-63-19 (photometric horizontal) with LM-31-95: roadway luminaires have C 0 across the street, on the \
             street side; linear ones have C 0 along the lamps, LM-41-14",
};

/// The convention of EULUMDAT.
const EULUMDAT: Convention = Convention {
    forward_c_deg: FileFormat::Eulumdat.forward_c_deg(),
    lamp_axis_c_deg: 90.0,
    source: "EULUMDAT (Stockmar 1990) with CIE 121-1996 and EN 13032-1: roadway luminaires have C 0 along the street and C 90 \
             towards the road; C 0 looks at a linear luminaire's long side, its lamps lie along C 90",
};

/// The asymmetry of a distribution: the mean direction of its light and the flux in halves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lean {
    /// C of the flux-weighted mean direction; `None` where that is vertical.
    pub c_deg: Option<f64>,
    /// Gamma of the mean direction.
    pub gamma_deg: f64,
    /// Length of the mean direction vector: 1 for a ray, 0 for uniform light.
    pub strength: f64,
    /// Share of the flux in the half around C 0, C 90, C 180 and C 270, each from 90 degrees before to 90 after.
    pub halves: [f64; 4],
    /// Share of the flux above the horizon.
    pub up: f64,
}

/// Below this length, the horizontal part of a mean direction vector is rounding.
const MIN_HORIZONTAL_LENGTH: f64 = 1e-6;

impl Photometry {
    /// The convention of the format of this file.
    pub fn convention(&self) -> Convention {
        if matches!(self.details, Details::Eulumdat(_)) { EULUMDAT } else { LM63 }
    }

    /// The luminaire turned about its vertical axis by `turn_deg`, C 0 towards C 90, with a remark on what cannot turn.
    ///
    /// Tables turn exactly. Openings lie along the axes, so that they turn by quarters only, unless they are round.
    pub fn turned(&self, turn_deg: f64) -> (Self, Option<String>) {
        let turned = self.with_distribution(self.distribution.turned(turn_deg).reduced());
        let quarters = (turn_deg / 90.0).rem_euclid(4.0);
        let [width, length, _] = self.opening.bounding_box_m();
        let is_round = width == length && !matches!(self.opening, LuminousOpening::Box { .. });
        if is_round || quarters == 0.0 {
            return (turned, None);
        }
        if quarters.fract() != 0.0 {
            let remark =
                format!("the luminous opening stays along the axes: no format holds one turned by {turn_deg} degrees");
            return (turned, Some(remark));
        }
        let quarters = quarters as usize;
        let opening = if quarters % 2 == 1 { turn_opening_by_quarter(self.opening) } else { self.opening };
        let mut details = self.details.clone();
        if let Details::Eulumdat(details) = &mut details {
            details.luminous_heights_mm.rotate_right(quarters);
            if quarters % 2 == 1 && details.luminaire_mm[1] != 0.0 {
                details.luminaire_mm.swap(0, 1);
            }
        }
        (Self { opening, details, ..turned }, None)
    }
}

/// Turns an opening by a quarter.
fn turn_opening_by_quarter(opening: LuminousOpening) -> LuminousOpening {
    match opening {
        LuminousOpening::Point => LuminousOpening::Point,
        LuminousOpening::Box { x_m, y_m, height_m } => LuminousOpening::Box { x_m: y_m, y_m: x_m, height_m },
        LuminousOpening::Ellipse { x_m, y_m, height_m } => LuminousOpening::Ellipse { x_m: y_m, y_m: x_m, height_m },
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } => LuminousOpening::Ellipsoid { x_m: y_m, y_m: x_m, z_m },
        LuminousOpening::LyingCylinder { axis, length_m, diameter_m } => {
            let axis = if axis == HorizontalAxis::X { HorizontalAxis::Y } else { HorizontalAxis::X };
            LuminousOpening::LyingCylinder { axis, length_m, diameter_m }
        }
    }
}

impl LuminousIntensityDistribution {
    /// The mean direction of the light and the flux in halves; `None` without light.
    ///
    /// The mean direction is a sum over cells of one degree.
    pub fn lean(&self) -> Option<Lean> {
        let flux = self.flux();
        if flux.value() <= 0.0 {
            return None;
        }
        let (c_deg, gamma_deg) = (cell_middles_deg(360), cell_middles_deg(180));
        let candela = self.intensities(&c_deg, &gamma_deg);
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for (g, row) in gamma_deg.iter().zip(candela.chunks_exact(c_deg.len())) {
            for (c, i) in c_deg.iter().zip(row) {
                let weight = i * g.to_radians().sin();
                sum += direction(*c, *g) * weight;
                total += weight;
            }
        }
        let mean = if total > 0.0 { sum / total } else { DVec3::ZERO };
        let (c, gamma) = super::angles_deg(mean);
        // An angle just below 360 is C 0 to rounding.
        let c = if c > 360.0 - 1e-6 { 0.0 } else { c };
        Some(Lean {
            c_deg: (mean.truncate().length() > MIN_HORIZONTAL_LENGTH).then_some(c),
            gamma_deg: gamma,
            strength: mean.length(),
            halves: [0.0, 90.0, 180.0, 270.0].map(|c| self.flux_of_half(c) / flux),
            up: self.flux_between(90.0, 180.0) / flux,
        })
    }

    /// The same table with the smallest range of planes that reproduces its values exactly.
    #[must_use]
    pub fn reduced(&self) -> Self {
        let full = self.full_circle();
        let symmetry = full.detected_symmetry(0.0);
        let range = match symmetry {
            Symmetry::Axial => 0.0..=0.0,
            Symmetry::Quadrant => 0.0..=90.0,
            Symmetry::BilateralC0 => 0.0..=180.0,
            Symmetry::BilateralC90 => 90.0..=270.0,
            Symmetry::None => return full,
        };
        let mut c_deg: Vec<f64> = full.c_deg().iter().copied().filter(|c| range.contains(c)).collect();
        c_deg.extend([*range.start(), *range.end()]);
        c_deg.sort_by(f64::total_cmp);
        c_deg.dedup();
        let candela = tabulate(&c_deg, full.gamma_deg(), |c, g| full.intensity(c, g).value());
        // The planes of a valid table over the range of a symmetry make a valid table.
        Self::new(c_deg, full.gamma_deg().to_vec(), candela).unwrap_or_else(|_| full.clone())
    }
}

/// The middles of cells of one degree from 0 on.
pub(super) fn cell_middles_deg(count: u32) -> Vec<f64> {
    (0..count).map(|k| f64::from(k) + 0.5).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{eulumdat, lm63};

    /// The light of a road luminaire that emits most towards a plane.
    fn thrown(towards_deg: f64) -> LuminousIntensityDistribution {
        let c: Vec<f64> = (0..=36).map(|k| 10.0 * f64::from(k)).collect();
        let middles = c.iter().map(|c| 100.0 + 80.0 * ((c % 360.0) - towards_deg).to_radians().cos());
        let candela = middles.flat_map(|middle| [200.0, middle, 0.0]).collect();
        LuminousIntensityDistribution::new(c, vec![0.0, 60.0, 90.0], candela).unwrap()
    }

    /// Forward light by the convention of the format.
    fn forward_zones(photometry: &Photometry) -> [crate::units::Lumen; 4] {
        photometry.distribution.classification_zones(photometry.convention().forward_c_deg).forward
    }

    #[test]
    fn the_mean_direction_points_where_the_luminaire_emits_most() {
        for towards in [0.0, 90.0, 200.0] {
            let lean = thrown(towards).lean().unwrap();
            assert!((lean.c_deg.unwrap() - towards + 180.0).rem_euclid(360.0) - 180.0 < 0.1, "{lean:?}");
            assert!(lean.gamma_deg > 1.0 && lean.gamma_deg < 60.0 && lean.strength < 1.0 && lean.up == 0.0);
            assert!((lean.halves[0] + lean.halves[2] - 1.0).abs() < 1e-9);
        }
        let [forward, _, back, _] = thrown(0.0).lean().unwrap().halves;
        assert!(forward > 0.55 && back < 0.45);
        let even = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![1.0; 2]).unwrap();
        let lean = even.lean().unwrap();
        assert!(lean.c_deg.is_none() && lean.strength < 1e-9 && (lean.up - 0.5).abs() < 1e-12);
        assert!(even.scaled(0.0).lean().is_none());
    }

    #[test]
    fn a_turned_luminaire_keeps_its_forward_light_forward_in_the_other_format() {
        let street = Photometry {
            opening: LuminousOpening::Box { x_m: 0.6, y_m: 0.3, height_m: 0.0 },
            ..Photometry::of(thrown(0.0))
        };
        let (turned, lost) = street.turned(90.0);
        assert_eq!(lost, None);
        assert_eq!(turned.opening, LuminousOpening::Box { x_m: 0.3, y_m: 0.6, height_m: 0.0 });
        let ldt = eulumdat::parse(eulumdat::write(&turned).text.as_bytes()).unwrap();
        let ies = lm63::parse(lm63::write_2019(&street).text.as_bytes()).unwrap();
        for (a, b) in forward_zones(&ldt).into_iter().zip(forward_zones(&ies)) {
            assert!((a.value() - b.value()).abs() < 1e-9, "{a} {b}");
        }
        let (back, _) = ldt.turned(-90.0);
        assert!((back.distribution.intensity(0.0, 60.0).value() - 180.0).abs() < 1e-9);
        assert!(street.turned(30.0).1.unwrap().contains("stays along the axes"));
    }

    #[test]
    fn the_fewest_planes_are_kept() {
        let quarter = LuminousIntensityDistribution::new(
            vec![0.0, 45.0, 90.0],
            vec![0.0, 90.0],
            vec![3.0, 1.0, 3.0, 2.0, 3.0, 4.0],
        );
        let turned = quarter.unwrap().turned(90.0).reduced();
        assert_eq!((turned.symmetry(), turned.c_deg()), (Symmetry::Quadrant, &[0.0, 45.0, 90.0][..]));
        assert_eq!(turned.intensity(0.0, 90.0).value(), 4.0);
        assert_eq!(thrown(0.0).turned(20.0).reduced().symmetry(), Symmetry::None);
        let round = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![2.0, 1.0]).unwrap();
        assert_eq!(round.turned(33.0).reduced().symmetry(), Symmetry::Axial);
    }
}
