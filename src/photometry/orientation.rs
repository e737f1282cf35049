//! Which way a luminaire faces: what its format says of the planes, where its light leans, and how to turn it.

use glam::DVec3;

use super::{
    Details, FileFormat, HorizontalAxis, LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry,
    direction,
};

/// What a format means by its planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convention {
    /// The plane that points forward: across the street, away from houses.
    pub forward_c_deg: f64,
    /// The plane along which long luminaires and their lamps lie.
    pub lamp_axis_c_deg: f64,
    /// Where that stands.
    pub source: &'static str,
}

/// LM-63, and TM-33, which takes over its coordinates.
const LM63: Convention = Convention {
    forward_c_deg: FileFormat::Tm33.forward_c_deg(),
    lamp_axis_c_deg: 0.0,
    source: "ANSI/IES LM-63-19 (photometric horizontal) with LM-31-95: roadway luminaires have C 0 across the street, on the \
             street side; linear ones have C 0 along the lamps, LM-41-14",
};

/// EULUMDAT.
const EULUMDAT: Convention = Convention {
    forward_c_deg: FileFormat::Eulumdat.forward_c_deg(),
    lamp_axis_c_deg: 90.0,
    source: "EULUMDAT (Stockmar 1990) with CIE 121-1996 and EN 13032-1: roadway luminaires have C 0 along the street and C 90 \
             towards the road; C 0 looks at a linear luminaire's long side, its lamps lie along C 90",
};

/// Where the light of a distribution leans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lean {
    /// C of the flux-weighted mean direction; `None` where that is vertical.
    pub c_deg: Option<f64>,
    /// Gamma of it.
    pub gamma_deg: f64,
    /// How far the light is bundled that way: 1 for a ray, 0 where it goes all ways alike.
    pub strength: f64,
    /// Share of the flux in the half around C 0, C 90, C 180 and C 270, each from 90 degrees before to 90 after.
    pub halves: [f64; 4],
    /// Share of the flux above the horizon.
    pub up: f64,
}

/// A mean direction is vertical, and goes no way at all, within this.
const NO_LEAN: f64 = 1e-6;

impl Photometry {
    /// What the format of this file means by its planes.
    pub fn convention(&self) -> Convention {
        if matches!(self.details, Details::Eulumdat(_)) { EULUMDAT } else { LM63 }
    }

    /// The luminaire turned about its vertical axis by `turn_deg`, C 0 towards C 90, and what of it cannot turn with it.
    ///
    /// Tables turn exactly. Openings are boxes along the axes: they turn by quarters; others stay, unless they are round.
    pub fn turned(&self, turn_deg: f64) -> (Self, Option<String>) {
        let turned = self.with_distribution(self.distribution.turned(turn_deg).reduced());
        let quarters = (turn_deg / 90.0).rem_euclid(4.0);
        let [width, length, _] = self.opening.bounding_box_m();
        let is_round = width == length && !matches!(self.opening, LuminousOpening::Box { .. });
        if is_round || quarters == 0.0 {
            return (turned, None);
        }
        if quarters.fract() != 0.0 {
            let kept =
                format!("the luminous opening stays along the axes: no format holds one turned by {turn_deg} degrees");
            return (turned, Some(kept));
        }
        let quarters = quarters as usize;
        let opening = if quarters % 2 == 1 { crossed(self.opening) } else { self.opening };
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

/// An opening turned by a quarter.
fn crossed(opening: LuminousOpening) -> LuminousOpening {
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
    /// Where the light leans; `None` without light. The mean direction is summed over cells of one degree.
    pub fn lean(&self) -> Option<Lean> {
        let flux = self.flux();
        if flux.value() <= 0.0 {
            return None;
        }
        let middles = |count: u32| (0..count).map(|k| f64::from(k) + 0.5).collect::<Vec<f64>>();
        let (c_deg, gamma_deg) = (middles(360), middles(180));
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
        let half = |c: f64| self.flux_of_half(c) / flux;
        Some(Lean {
            // A hair below C 0 is rounding.
            c_deg: (mean.truncate().length() > NO_LEAN).then_some(if c > 360.0 - NO_LEAN { 0.0 } else { c }),
            gamma_deg: gamma,
            strength: mean.length(),
            halves: [0.0, 90.0, 180.0, 270.0].map(half),
            up: self.flux_between(90.0, 180.0) / flux,
        })
    }

    /// The same table with the fewest planes that its values, exactly, leave needed.
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
        let at = |c: f64, g: f64| full.intensity(c, g).value();
        let candela = c_deg.iter().flat_map(|&c| full.gamma_deg().iter().map(move |&g| at(c, g))).collect();
        // Planes of a sound table over the range of a symmetry make a sound table.
        Self::new(c_deg, full.gamma_deg().to_vec(), candela).unwrap_or_else(|_| full.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::{eulumdat, lm63};

    /// Light thrown towards a plane, as a road luminaire throws it.
    fn thrown(towards_deg: f64) -> LuminousIntensityDistribution {
        let c: Vec<f64> = (0..=36).map(|k| 10.0 * f64::from(k)).collect();
        let of = |c: f64| 100.0 + 80.0 * ((c % 360.0) - towards_deg).to_radians().cos();
        let candela = c.iter().flat_map(|c| [200.0, of(*c), 0.0]).collect();
        LuminousIntensityDistribution::new(c, vec![0.0, 60.0, 90.0], candela).unwrap()
    }

    #[test]
    fn light_leans_to_where_it_is_thrown() {
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
        let zones = |p: &Photometry| p.distribution.classification_zones(p.convention().forward_c_deg);
        for (a, b) in zones(&ldt).forward.into_iter().zip(zones(&ies).forward) {
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
