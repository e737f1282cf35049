//! The beam of a distribution: its axis, the direction of the largest intensity, and its widths in planes through the axis.
//!
//! CIE 121-1996 and ANSI/IES LM-35-02: beam angle to 50 % and field angle to 10 % of the largest intensity. Each counts
//! outwards from the axis to where the intensity first falls below. NEMA floodlight types: ANSI/NEMA FA 1-1973, as the
//! IES Lighting Handbook prints them.

use glam::DVec3;

use super::{LuminousIntensityDistribution, angles_deg, direction};
use crate::units::Candela;

/// Intensities that differ by less than this fraction belong to one peak.
const SAME_PEAK_FRACTION: f64 = 1e-9;
/// An axis within this angle of a pole has planes through C 0 and C 90; any other axis has a vertical plane.
const NEAR_POLE_DEG: f64 = 10.0;
/// Half the table's finest step, within these limits, is the step of the search outwards.
const SEARCH_STEP_RANGE_DEG: [f64; 2] = [0.02, 0.25];

/// The largest intensity, its direction, and the axis from which beam angles count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// C of the axis: the direction of the peak, or the middle of several equal peaks of one beam.
    pub c_deg: f64,
    /// Gamma of the axis.
    pub gamma_deg: f64,
    /// The largest intensity.
    pub peak: Candela,
    /// C and gamma of the peak; of several peaks the nearest to the nadir, then that of the smallest C.
    pub peak_deg: [f64; 2],
    /// Whether other directions have the largest intensity too.
    pub shape: PeakShape,
    /// Whether several peaks belong to one beam: their middle has half the largest intensity.
    pub is_one_beam: bool,
}

/// The number of directions with the largest intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PeakShape {
    /// One direction, or a plateau with the axis in its middle.
    One,
    /// This number of separate nodes of the table.
    Several(usize),
    /// All around the vertical.
    Ring,
}

/// A plane through the beam's axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeamPlane {
    /// Through the vertical; for an axis within 10 degrees of a pole the one through C 0.
    Vertical,
    /// Perpendicular to the vertical plane.
    Across,
}

/// The angles in degrees that a beam reaches on either side of its axis.
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
    /// The intensity never falls below the limit.
    #[error("all around this plane the intensity stays at {percent:.0} % of the largest or above")]
    Unbounded {
        /// The limit in percent of the largest intensity.
        percent: f64,
    },
    /// Several beams, where a type describes one.
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
        let tied = self.brightest_nodes((1.0 - SAME_PEAK_FRACTION) * peak.value());
        let middle = middle_direction(&tied);
        // The brightest nodes include the peak, so that there is a first one.
        let first = tied.first().copied().unwrap_or((0.0, 0.0));
        let middle_share = middle.map(|(c, g)| self.intensity(c, g).value() / peak.value());
        let is_plateau = middle_share.is_some_and(|share| share >= 1.0 - SAME_PEAK_FRACTION);
        let shape = if is_plateau {
            PeakShape::One
        } else if self.is_ring(first.1, peak) {
            PeakShape::Ring
        } else {
            PeakShape::Several(tied.len())
        };
        let common_axis = middle.filter(|_| middle_share.is_some_and(|share| share >= 0.5));
        let (c_deg, gamma_deg) = common_axis.unwrap_or(first);
        let peak_deg = if is_plateau { [c_deg, gamma_deg] } else { [first.0, first.1] };
        Ok(Beam { c_deg, gamma_deg, peak, peak_deg, shape, is_one_beam: common_axis.is_some() })
    }

    /// Whether every plane reaches the peak at this gamma.
    fn is_ring(&self, gamma_deg: f64, peak: Candela) -> bool {
        let full = self.full_circle();
        let mut shares = full.c_deg().iter().map(|c| self.intensity(*c, gamma_deg).value() / peak.value());
        shares.all(|share| share >= 1.0 - SAME_PEAK_FRACTION)
    }

    /// Nodes (C, gamma) of the full circle at which the intensity reaches `least`, by gamma, then by C. A pole counts once.
    fn brightest_nodes(&self, least: f64) -> Vec<(f64, f64)> {
        if self.is_native() {
            let mut tied = self.nodes_deg();
            tied.retain(|(c, g)| self.intensity(*c, *g).value() >= least);
            tied.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.total_cmp(&b.0)));
            return tied;
        }
        let full = self.full_circle();
        // Four planes of an axial table are enough for a mean direction.
        let around = if self.c_deg().len() == 1 { vec![0.0, 90.0, 180.0, 270.0] } else { full.c_deg().to_vec() };
        let planes = around.iter().filter(|c| **c < 360.0);
        let nodes = planes.flat_map(|c| full.gamma_deg().iter().map(move |g| (*c, *g)));
        let mut tied: Vec<(f64, f64)> = nodes.filter(|(c, g)| full.intensity(*c, *g).value() >= least).collect();
        for node in &mut tied {
            // At a pole every C is the same direction, although the planes of some tables disagree there.
            let is_pole = node.1 == 0.0 || node.1 == 180.0;
            if is_pole && full.intensity(0.0, node.1).value() >= least {
                node.0 = 0.0;
            }
        }
        tied.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.total_cmp(&b.0)));
        tied.dedup();
        tied
    }

    /// The width of the beam in a plane through its axis, to a fraction of its largest intensity.
    pub fn beam_width(&self, beam: &Beam, plane: BeamPlane, fraction: f64) -> Result<BeamWidth, NoBeam> {
        let [axis, aside] = beam.frame(plane);
        let least = fraction * beam.peak.value();
        let unbounded = NoBeam::Unbounded { percent: 100.0 * fraction };
        let one_side_deg = self.beam_half_width_deg(axis, aside, least).ok_or(unbounded)?;
        let other_side_deg = self.beam_half_width_deg(axis, -aside, least).ok_or(unbounded)?;
        Ok(BeamWidth { one_side_deg, other_side_deg })
    }

    /// The angle from the axis towards `aside` at which the intensity first falls below `least`; `None` where it never does.
    fn beam_half_width_deg(&self, axis: DVec3, aside: DVec3, least: f64) -> Option<f64> {
        let step = self.finest_deg().clamp(SEARCH_STEP_RANGE_DEG[0], SEARCH_STEP_RANGE_DEG[1]);
        let mut steps = (1..=(180.0 / step).ceil() as u32).map(|k| (step * f64::from(k)).min(180.0));
        let beyond = steps.find(|t| self.intensity_off_axis(axis, aside, *t) < least)?;
        Some(bisect((beyond - step).max(0.0), beyond, |t| self.intensity_off_axis(axis, aside, t) >= least))
    }

    /// The intensity in candela at an angle from the axis towards `aside`, in degrees.
    fn intensity_off_axis(&self, axis: DVec3, aside: DVec3, angle_deg: f64) -> f64 {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        self.intensity_towards(axis * cos + aside * sin).value()
    }

    /// NEMA types, horizontal (across) and vertical, from the field angles of the beam.
    pub fn nema_types(&self, beam: &Beam) -> Result<[u8; 2], NoBeam> {
        if !beam.is_one_beam {
            return Err(NoBeam::SeveralBeams);
        }
        let across = self.beam_width(beam, BeamPlane::Across, 0.1)?;
        let horizontal = nema_type(across.full_deg())?;
        let vertical = self.beam_width(beam, BeamPlane::Vertical, 0.1)?;
        Ok([horizontal, nema_type(vertical.full_deg())?])
    }

    /// Half the smallest distance between angles of the table, in degrees.
    fn finest_deg(&self) -> f64 {
        0.5 * smallest_step_deg(self.gamma_deg()).min(smallest_step_deg(self.c_deg()))
    }
}

/// The smallest distance between neighbouring angles; infinite for a single angle.
fn smallest_step_deg(angles: &[f64]) -> f64 {
    angles.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min)
}

/// (C, gamma) of the mean of directions; `None` where they cancel.
fn middle_direction(nodes: &[(f64, f64)]) -> Option<(f64, f64)> {
    // The sine is the density of C nodes per solid angle.
    let mean: DVec3 = nodes.iter().map(|(c, g)| direction(*c, *g) * g.to_radians().sin()).sum();
    let pole = nodes.iter().find(|(_, g)| *g == 0.0 || *g == 180.0);
    match pole {
        Some((_, g)) if mean.truncate().length() <= SAME_PEAK_FRACTION * nodes.len() as f64 => Some((0.0, *g)),
        _ => mean.try_normalize().map(beam_angles_deg),
    }
}

impl Beam {
    /// The axis, and the direction in a plane at right angles to the axis.
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
    /// The lower limits of types 2 to 7; an angle at a limit belongs to the narrower type.
    const TYPE_LIMITS_DEG: [f64; 6] = [18.0, 29.0, 46.0, 70.0, 100.0, 130.0];
    if field_deg < 10.0 {
        return Err(NoBeam::BelowTypes { field_deg });
    }
    Ok(1 + TYPE_LIMITS_DEG.iter().filter(|limit| field_deg > **limit).count() as u8)
}

/// (C, gamma) of a direction; those of the pole where it is vertical to rounding.
fn beam_angles_deg(towards: DVec3) -> (f64, f64) {
    if towards.truncate().length() < SAME_PEAK_FRACTION {
        return (0.0, if towards.z < 0.0 { 0.0 } else { 180.0 });
    }
    angles_deg(towards)
}

/// Bisects for the point between `inside` and `outside` up to which a condition holds.
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

    /// The full angle of a beam with this tangent of its half angle.
    fn full_deg(tan: f64) -> f64 {
        2.0 * tan.atan().to_degrees()
    }

    #[test]
    fn vertical_and_across_stay_distinct_when_a_floodlight_is_tilted() {
        // Wide in y (C 90), narrow in x, then tilted up towards C 0 and towards C 90.
        let lobe =
            |d: DVec3| if d.z >= 0.0 { 0.0 } else { (-(d.x / d.z / 0.2).powi(2) - (d.y / d.z / 1.0).powi(2)).exp() };
        let (narrow, wide) = (0.2 * 2f64.ln().sqrt(), 2f64.ln().sqrt());

        for (turn, expected) in [
            (DMat3::IDENTITY, [narrow, wide]),
            (DMat3::from_rotation_y(-60f64.to_radians()), [narrow, wide]),
            (DMat3::from_rotation_x(60f64.to_radians()), [wide, narrow]),
        ] {
            let flood = table(&angles(360, 2.0), &angles(180, 1.0), |d| 1000.0 * lobe(turn.transpose() * d));
            for (found, expected) in widths(&flood, 0.5).into_iter().zip(expected) {
                assert!((found.unwrap() - full_deg(expected)).abs() < 0.3, "{found:?} {}", full_deg(expected));
            }
        }
    }

    /// A batwing: the peak at gamma 30, half of it at the nadir.
    fn batwing(gamma: f64) -> f64 {
        if gamma <= 90.0 { (2.0 * gamma - 60.0).to_radians().cos().max(0.0) } else { 0.0 }
    }

    #[test]
    fn the_axis_is_the_middle_of_the_peaks_of_one_beam_and_else_the_first_peak() {
        let gamma = angles(90, 1.0);
        let candela = gamma.iter().map(|g| batwing(*g)).collect();
        let ring = LuminousIntensityDistribution::axial(gamma.clone(), candela).unwrap();
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
        // The width of the first beam: to cos 60 below its axis; above, the table ends at the axis.
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

    /// The same intensity in every direction.
    fn even(candela: f64) -> LuminousIntensityDistribution {
        LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![candela; 2]).unwrap()
    }

    #[test]
    fn without_light_or_without_end_there_is_a_reason() {
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
