//! The beam of any distribution: its axis, the direction of the largest intensity, and its widths in planes through that.
//!
//! CIE 121-1996 and ANSI/IES LM-35-02: beam angle to 50 % and field angle to 10 % of the largest intensity, each counted
//! outwards from the axis to where the intensity first falls below. NEMA floodlight types: ANSI/NEMA FA 1-1973, as the IES
//! Lighting Handbook prints them.

use glam::DVec3;

use super::{LuminousIntensityDistribution, angles_deg, direction};
use crate::units::Candela;

/// Intensities that differ by less than this fraction are one peak's.
const SAME: f64 = 1e-9;
/// An axis within so many degrees of a pole has planes through C 0 and C 90; any other a vertical plane of its own.
const NEAR_POLE_DEG: f64 = 10.0;
/// Steps in degrees in which the intensity is looked up outwards: half a table's finest angle within these.
const STEPS_DEG: [f64; 2] = [0.02, 0.25];

/// Where the largest intensity is, and the axis that angles count from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// C of the axis: the direction of the peak or, of several as high, their middle where it lies within their common beam.
    pub c_deg: f64,
    /// Gamma of the axis.
    pub gamma_deg: f64,
    /// The largest intensity.
    pub peak: Candela,
    /// C and gamma of it; of several the one nearest the nadir, then of the smallest C.
    pub peak_deg: [f64; 2],
    /// Whether other directions have it too.
    pub shape: PeakShape,
    /// Whether the peaks, if there are several, belong to one beam: their middle has half the largest intensity.
    pub is_one_beam: bool,
}

/// In how many directions a table has its largest intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PeakShape {
    /// In one, or in a plateau whose middle is the axis.
    One,
    /// At so many angles of the table, apart from each other.
    Several(usize),
    /// All around the vertical.
    Ring,
}

/// A plane through the beam's axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeamPlane {
    /// Through the vertical; for an axis within 10 degrees of a pole the one through C 0.
    Vertical,
    /// Perpendicular to that.
    Across,
}

/// How far a beam reaches on either side of its axis, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamWidth {
    /// Upwards, or towards C 0, of the vertical plane; towards C 90 of the plane across.
    pub one_side_deg: f64,
    /// On the other side.
    pub other_side_deg: f64,
}

impl BeamWidth {
    /// The full angle.
    pub fn full_deg(self) -> f64 {
        self.one_side_deg + self.other_side_deg
    }
}

/// Why there is no beam, no angle of it or no type.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoBeam {
    /// No light.
    #[error("every intensity is zero")]
    Dark,
    /// Nothing bounds it.
    #[error("all around this plane the intensity stays at {percent:.0} % of the largest or above")]
    Unbounded {
        /// The share of the largest intensity that was looked for.
        percent: f64,
    },
    /// No one beam to have a type.
    #[error("the largest intensity is that of several beams, and NEMA types are of one")]
    SeveralBeams,
    /// Narrower than the narrowest type.
    #[error("a field angle of {field_deg:.1} degrees is below the 10 degrees at which NEMA types begin")]
    BelowTypes {
        /// The field angle.
        field_deg: f64,
    },
}

impl LuminousIntensityDistribution {
    /// The axis of the beam.
    pub fn beam(&self) -> Result<Beam, NoBeam> {
        let peak = self.max_intensity();
        if peak.value() <= 0.0 {
            return Err(NoBeam::Dark);
        }
        let tied = self.largest((1.0 - SAME) * peak.value());
        let weigh = |(c, g): &(f64, f64)| direction(*c, *g) * g.to_radians().sin();
        let mean: DVec3 = tied.iter().map(weigh).sum();
        let at_pole = tied.iter().find(|(_, g)| *g == 0.0 || *g == 180.0);
        let middle = match at_pole {
            Some((_, g)) if mean.truncate().length() <= SAME * tied.len() as f64 => Some((0.0, *g)),
            _ => mean.try_normalize().map(upright),
        };
        let share = |(c, g): (f64, f64)| self.intensity(c, g).value() / peak.value();
        // `largest` found the peak itself, so that there is a first one.
        let first = tied.first().copied().unwrap_or((0.0, 0.0));
        let is_plateau = middle.is_some_and(|m| share(m) >= 1.0 - SAME);
        let shape = if is_plateau {
            PeakShape::One
        } else if self.full_circle().c_deg().iter().all(|c| share((*c, first.1)) >= 1.0 - SAME) {
            PeakShape::Ring
        } else {
            PeakShape::Several(tied.len())
        };
        let within = middle.filter(|m| share(*m) >= 0.5);
        let (c_deg, gamma_deg) = within.unwrap_or(first);
        let peak_deg = if is_plateau { [c_deg, gamma_deg] } else { [first.0, first.1] };
        Ok(Beam { c_deg, gamma_deg, peak, peak_deg, shape, is_one_beam: within.is_some() })
    }

    /// Nodes (C, gamma) of the full circle at which the intensity reaches `least`: by gamma, then by C; a pole is one.
    fn largest(&self, least: f64) -> Vec<(f64, f64)> {
        if self.is_native() {
            let is_lit = |(c, g): &(f64, f64)| self.intensity(*c, *g).value() >= least;
            let mut tied: Vec<(f64, f64)> = self.nodes_deg().into_iter().filter(is_lit).collect();
            tied.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.total_cmp(&b.0)));
            return tied;
        }
        let full = self.full_circle();
        // One plane stands for all: those that a mean direction needs.
        let around = if self.c_deg().len() == 1 { vec![0.0, 90.0, 180.0, 270.0] } else { full.c_deg().to_vec() };
        let planes = around.iter().filter(|c| **c < 360.0);
        let nodes = planes.flat_map(|c| full.gamma_deg().iter().map(move |g| (*c, *g)));
        // At a pole every C is the same direction; the planes of some tables disagree there.
        let pole = |(c, g): (f64, f64)| {
            let is_one = (g == 0.0 || g == 180.0) && full.intensity(0.0, g).value() >= least;
            if is_one { (0.0, g) } else { (c, g) }
        };
        let mut tied: Vec<(f64, f64)> =
            nodes.filter(|(c, g)| full.intensity(*c, *g).value() >= least).map(pole).collect();
        tied.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.total_cmp(&b.0)));
        tied.dedup();
        tied
    }

    /// How far the beam reaches in a plane through its axis before it falls below a fraction of its largest intensity.
    pub fn beam_width(&self, beam: &Beam, plane: BeamPlane, fraction: f64) -> Result<BeamWidth, NoBeam> {
        let [axis, aside] = beam.frame(plane);
        let least = fraction * beam.peak.value();
        let step = self.finest_deg().clamp(STEPS_DEG[0], STEPS_DEG[1]);
        let side = |sign: f64| {
            let at = |t: f64| {
                let (sin, cos) = t.to_radians().sin_cos();
                self.intensity_towards(axis * cos + aside * (sign * sin)).value()
            };
            let steps = (1..=(180.0 / step).ceil() as u32).map(|k| (step * f64::from(k)).min(180.0));
            let beyond = steps.into_iter().find(|t| at(*t) < least);
            beyond.map(|t| bisect((t - step).max(0.0), t, |t| at(t) >= least))
        };
        let unbounded = NoBeam::Unbounded { percent: 100.0 * fraction };
        let (one_side_deg, other_side_deg) = (side(1.0).ok_or(unbounded)?, side(-1.0).ok_or(unbounded)?);
        Ok(BeamWidth { one_side_deg, other_side_deg })
    }

    /// NEMA types, horizontal (across) and vertical, by the beam's field angles.
    pub fn nema_types(&self, beam: &Beam) -> Result<[u8; 2], NoBeam> {
        if !beam.is_one_beam {
            return Err(NoBeam::SeveralBeams);
        }
        let of = |plane| nema_type(self.beam_width(beam, plane, 0.1)?.full_deg());
        Ok([of(BeamPlane::Across)?, of(BeamPlane::Vertical)?])
    }

    /// Half the smallest distance between angles of the table, in degrees.
    fn finest_deg(&self) -> f64 {
        let steps = |angles: &[f64]| angles.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        0.5 * steps(self.gamma_deg()).min(steps(self.c_deg()))
    }
}

impl Beam {
    /// The axis, and the direction at right angles to it in which a plane goes on.
    pub fn frame(&self, plane: BeamPlane) -> [DVec3; 2] {
        let axis = direction(self.c_deg, self.gamma_deg);
        let from_pole = self.gamma_deg.min(180.0 - self.gamma_deg);
        let along = if from_pole <= NEAR_POLE_DEG { DVec3::X } else { DVec3::Z };
        let vertical = (along - axis * axis.dot(along)).normalize();
        match plane {
            BeamPlane::Vertical => [axis, vertical],
            BeamPlane::Across => [axis, vertical.cross(axis)],
        }
    }
}

/// The NEMA type of a field angle in degrees: 1 to 7.
fn nema_type(field_deg: f64) -> Result<u8, NoBeam> {
    /// Where types 2 to 7 begin; an angle at a limit belongs to the narrower type.
    const ABOVE_DEG: [f64; 6] = [18.0, 29.0, 46.0, 70.0, 100.0, 130.0];
    if field_deg < 10.0 {
        return Err(NoBeam::BelowTypes { field_deg });
    }
    Ok(1 + ABOVE_DEG.iter().filter(|limit| field_deg > **limit).count() as u8)
}

/// (C, gamma) of a direction; C 0 where it is vertical but for rounding.
fn upright(towards: DVec3) -> (f64, f64) {
    let (c, gamma) = angles_deg(towards);
    if towards.truncate().length() < SAME { (0.0, if towards.z < 0.0 { 0.0 } else { 180.0 }) } else { (c, gamma) }
}

/// Where between `inside` and `outside` a condition ceases to hold.
fn bisect(mut inside: f64, mut outside: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..50 {
        let middle = f64::midpoint(inside, outside);
        if holds(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use glam::DMat3;

    fn angles(last: u32, step: f64) -> Vec<f64> {
        (0..=(f64::from(last) / step) as u32).map(|k| step * f64::from(k)).collect()
    }

    fn table(c: &[f64], gamma: &[f64], of: impl Fn(DVec3) -> f64) -> LuminousIntensityDistribution {
        let candela = c.iter().flat_map(|c| gamma.iter().map(|g| of(direction(*c % 360.0, *g)))).collect();
        LuminousIntensityDistribution::new(c.to_vec(), gamma.to_vec(), candela).unwrap()
    }

    fn widths(of: &LuminousIntensityDistribution, fraction: f64) -> [Result<f64, NoBeam>; 2] {
        let beam = of.beam().unwrap();
        [BeamPlane::Vertical, BeamPlane::Across]
            .map(|plane| of.beam_width(&beam, plane, fraction).map(BeamWidth::full_deg))
    }

    #[test]
    fn a_round_beam_has_one_width_wherever_it_points() {
        let half = 2.0 * 0.5f64.powf(0.1).acos().to_degrees();
        for (c, g) in [(0.0, 0.0), (45.0, 60.0), (200.0, 90.0), (310.0, 5.0), (0.0, 180.0)] {
            let axis = direction(c, g);
            let lobe = table(&angles(360, 5.0), &angles(180, 1.0), |d| 700.0 * d.dot(axis).max(0.0).powi(10));
            let beam = lobe.beam().unwrap();
            assert!(direction(beam.c_deg, beam.gamma_deg).dot(axis) > 1.0 - 1e-9, "{beam:?}");
            assert_eq!(beam.shape, PeakShape::One);
            for width in widths(&lobe, 0.5) {
                assert!((width.unwrap() - half).abs() < 0.2, "{c} {g}: {width:?} {half}");
            }
        }
    }

    #[test]
    fn vertical_and_across_are_told_apart_when_a_floodlight_is_tilted() {
        // Wide in y (C 90), narrow in x, then tilted up towards C 0 and towards C 90.
        let lobe =
            |d: DVec3| if d.z >= 0.0 { 0.0 } else { (-(d.x / d.z / 0.2).powi(2) - (d.y / d.z / 1.0).powi(2)).exp() };
        let (narrow, wide) = (0.2 * 2f64.ln().sqrt(), 2f64.ln().sqrt());
        let full = |tan: f64| 2.0 * tan.atan().to_degrees();
        for (turn, expected) in [
            (DMat3::IDENTITY, [narrow, wide]),
            (DMat3::from_rotation_y(-60f64.to_radians()), [narrow, wide]),
            (DMat3::from_rotation_x(60f64.to_radians()), [wide, narrow]),
        ] {
            let flood = table(&angles(360, 2.0), &angles(180, 1.0), |d| 1000.0 * lobe(turn.transpose() * d));
            for (found, expected) in widths(&flood, 0.5).into_iter().zip(expected) {
                assert!((found.unwrap() - full(expected)).abs() < 0.3, "{found:?} {}", full(expected));
            }
        }
    }

    #[test]
    fn peaks_of_one_beam_have_their_middle_for_its_axis_and_others_their_own() {
        let bat = |gamma: f64| if gamma <= 90.0 { (2.0 * gamma - 60.0).to_radians().cos().max(0.0) } else { 0.0 };
        let gamma = angles(90, 1.0);
        let ring =
            LuminousIntensityDistribution::axial(gamma.clone(), gamma.iter().map(|g| bat(*g)).collect()).unwrap();
        let beam = ring.beam().unwrap();
        // Half the peak straight down: one beam about the nadir.
        assert_eq!((beam.gamma_deg, beam.peak_deg, beam.shape), (0.0, [0.0, 30.0], PeakShape::Ring));
        assert_relative_eq!(
            ring.beam_width(&beam, BeamPlane::Across, 0.4).unwrap().full_deg(),
            126.4,
            max_relative = 1e-3
        );
        assert!(ring.nema_types(&beam).is_ok());
        let two = table(&[0.0, 90.0], &gamma, |d| d.x.abs());
        let beam = two.beam().unwrap();
        assert_eq!((beam.shape, beam.is_one_beam, beam.peak_deg), (PeakShape::Several(2), false, [0.0, 90.0]));
        assert_eq!(two.nema_types(&beam), Err(NoBeam::SeveralBeams));
        // The first beam's own width: to cos 60 either side, below; the table ends at its axis above.
        let width = two.beam_width(&beam, BeamPlane::Vertical, 0.5).unwrap();
        assert!(width.one_side_deg < 1e-6 && (width.other_side_deg - 60.0).abs() < 0.1, "{width:?}");
    }

    #[test]
    fn a_flat_top_has_its_axis_in_its_middle() {
        let flat = LuminousIntensityDistribution::axial(vec![0.0, 10.0, 20.0, 90.0], vec![5.0, 5.0, 0.0, 0.0]).unwrap();
        let beam = flat.beam().unwrap();
        assert_eq!((beam.gamma_deg, beam.shape), (0.0, PeakShape::One));
        assert_relative_eq!(widths(&flat, 0.5)[0].unwrap(), 30.0, max_relative = 1e-9);
        let up = LuminousIntensityDistribution::axial(vec![90.0, 170.0, 180.0], vec![0.0, 5.0, 5.0]).unwrap();
        assert_eq!(up.beam().unwrap().gamma_deg, 180.0);
    }

    #[test]
    fn without_light_or_without_end_there_is_a_reason() {
        let even = |candela: f64| LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![candela; 2]).unwrap();
        assert_eq!(even(0.0).beam(), Err(NoBeam::Dark));
        let beam = even(3.0).beam().unwrap();
        let width = even(3.0).beam_width(&beam, BeamPlane::Across, 0.5);
        assert_eq!(width, Err(NoBeam::Unbounded { percent: 50.0 }));
        // A table that ends with light ends the beam there.
        let half = LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![3.0; 2]).unwrap();
        assert_relative_eq!(widths(&half, 0.1)[1].unwrap(), 180.0, max_relative = 1e-9);
    }

    #[test]
    fn nema_types_are_those_of_the_table() {
        for (field, expected) in
            [(10.0, 1), (18.0, 1), (18.1, 2), (29.0, 2), (46.0, 3), (70.0, 4), (100.0, 5), (130.0, 6), (131.0, 7)]
        {
            assert_eq!(nema_type(field), Ok(expected), "{field}");
        }
        assert_eq!(nema_type(9.0), Err(NoBeam::BelowTypes { field_deg: 9.0 }));
    }
}
