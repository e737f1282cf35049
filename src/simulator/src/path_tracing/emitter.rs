//! Luminaires as the path tracer samples them: a goniometric point, or a luminous opening every part of which sends
//! out the far-field distribution in proportion to the area that it shows.
//!
//! A part dA with normal n of an opening of projected area P(w) has the intensity I(w) max(0, n.w) dA / P(w) towards
//! w, so that all parts together have the intensity of the table. For a flat opening that is I(w) dA / A on both
//! sides. The body of a luminaire blocks no light.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use luxproof_photometry::{Goniometer, LuminousIntensityDistribution, Symmetry};
use luxproof_scene::Luminaire;
use luxproof_scene::opening::{Opening, lay};

/// A luminaire in its place.
pub(super) struct Emitter<'a> {
    distribution: &'a LuminousIntensityDistribution,
    flux_scale: f64,
    position_m: DVec3,
    to_world: DMat3,
    to_own: DMat3,
    opening: Opening,
    bands: Bands,
    axial: bool,
}

/// What a luminaire sends towards a point, were nothing between.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    /// Where the light comes from.
    pub(super) from_m: DVec3,
    /// Illuminance in lux, an unbiased estimate of the whole luminaire's where it has an extent.
    pub(super) lux: f64,
    /// Illuminance for each candela: cosine over squared distance.
    lux_per_cd: f64,
    gamma_deg: f64,
}

/// Light that leaves a luminaire along a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emission {
    /// Where it starts.
    pub(super) from_m: DVec3,
    /// Unit vector.
    pub(super) direction: DVec3,
    /// Intensity in candela, times the inverse of the density of the starting point.
    pub(super) candela: f64,
    /// Density of the direction per steradian.
    pub(super) density_per_sr: f64,
}

impl<'a> Emitter<'a> {
    /// `None` for a luminaire that gives no light.
    pub(super) fn new(luminaire: &'a Luminaire) -> Option<Self> {
        let distribution = &luminaire.photometry.distribution;
        let bands = Bands::new(distribution)?;
        (luminaire.flux_scale > 0.0).then(|| Self {
            distribution,
            flux_scale: luminaire.flux_scale,
            position_m: luminaire.position_m,
            to_world: luminaire.orientation,
            to_own: luminaire.orientation.transpose(),
            opening: Opening::of_luminaire(luminaire),
            bands,
            axial: distribution.symmetry() == Symmetry::Axial,
        })
    }

    /// Photometric centre in metres.
    pub(super) fn position_m(&self) -> DVec3 {
        self.position_m
    }

    /// Whether it has an extent, which takes two more random numbers to sample.
    pub(super) fn has_extent(&self) -> bool {
        self.opening != Opening::Point
    }

    /// Luminous flux in lumens.
    pub(super) fn flux_lm(&self) -> f64 {
        self.distribution.flux().value() * self.flux_scale
    }

    /// How far rounding may move the illuminance of a point at `point_m`, in lux: the angles carry a few units in the last
    /// place, which over the steepest cell of a table of tenths of a degree are 1e-13 of its peak.
    pub(super) fn rounding_lux(&self, point_m: DVec3) -> f64 {
        let peak = self.distribution.max_intensity().value() * self.flux_scale;
        1e-13 * peak / (point_m - self.position_m).length_squared()
    }

    /// Light from the part of the opening that `u` picks on a surface at `point_m`; `None` from behind or without light.
    pub(super) fn arrival(&self, point_m: DVec3, normal: DVec3, u: [f64; 2]) -> Option<Arrival> {
        let part = pick_part(&self.opening, u);
        let from_m = self.position_m + self.to_world * part.at_m;
        let path = point_m - from_m;
        let square = path.length_squared();
        let cosine = -path.dot(normal) / square.sqrt();
        // A point upon the luminaire has no direction: 0 / 0.
        if cosine <= 0.0 || cosine.is_nan() {
            return None;
        }
        let own = self.to_own * path;
        let gamma_deg = self.bands.lit_gamma_deg(own)?;
        let candela = self.intensity(own, gamma_deg) * share(&self.opening, &part, own);
        let lux_per_cd = cosine / square;
        (candela > 0.0).then_some(Arrival { from_m, lux: candela * lux_per_cd, lux_per_cd, gamma_deg })
    }

    /// Density with which [`Emitter::emit`] would have lit the point in the same way, per square metre of its surface.
    pub(super) fn density_per_m2(&self, arrival: &Arrival) -> f64 {
        self.bands.density_per_sr(arrival.gamma_deg) * arrival.lux_per_cd
    }

    /// A ray of light: `at` picks the part of the opening, `along` the direction.
    pub(super) fn emit(&self, at: [f64; 2], along: [f64; 2]) -> Emission {
        let part = pick_part(&self.opening, at);
        let (own, density_per_sr) = self.bands.direction(along);
        let gamma_deg = self.bands.lit_gamma_deg(own);
        let candela = gamma_deg.map_or(0.0, |g| self.intensity(own, g) * share(&self.opening, &part, own));
        Emission {
            from_m: self.position_m + self.to_world * part.at_m,
            direction: self.to_world * own,
            candela,
            density_per_sr,
        }
    }

    fn intensity(&self, own: DVec3, gamma_deg: f64) -> f64 {
        if self.distribution.goniometer() == Goniometer::B {
            return self.distribution.intensity_towards(own).value() * self.flux_scale;
        }
        let c_deg = if self.axial { 0.0 } else { own.y.atan2(own.x).to_degrees() };
        self.distribution.intensity(c_deg, gamma_deg).value() * self.flux_scale
    }
}

/// A point of an opening and the area with which it counts, as a vector along its outward normal.
struct Part {
    at_m: DVec3,
    area_m2: DVec3,
}

/// The part of an opening that two uniform numbers pick; its area is that of the whole surface over the density of the pick.
fn pick_part(opening: &Opening, [u, v]: [f64; 2]) -> Part {
    match *opening {
        Opening::Point => Part { at_m: DVec3::ZERO, area_m2: DVec3::ZERO },
        Opening::Line(half) => Part { at_m: half * (2.0 * u - 1.0), area_m2: DVec3::ZERO },
        Opening::Box(half) => box_part(half, u, v),
        Opening::Cylinder(half) => cylinder_part(half, u, v),
        Opening::Lying(axis, half) => {
            let upright = cylinder_part(half, u, v);
            Part { at_m: lay(axis, upright.at_m), area_m2: lay(axis, upright.area_m2) }
        }
        Opening::Ellipsoid(half) => {
            let z = 1.0 - 2.0 * u;
            let (sin, cos) = (TAU * v).sin_cos();
            let r = (1.0 - z * z).max(0.0).sqrt();
            let sphere = DVec3::new(r * cos, r * sin, z);
            let cofactor = DVec3::new(half.y * half.z, half.x * half.z, half.x * half.y);
            Part { at_m: half * sphere, area_m2: 4.0 * PI * cofactor * sphere }
        }
    }
}

/// How much of the table's intensity along `own` a part stands for; 1 on average over all parts.
///
/// Flat openings shine from both sides of every point, by symmetry all with the same intensity.
fn share(opening: &Opening, part: &Part, own: DVec3) -> f64 {
    match opening {
        Opening::Point | Opening::Line(_) => 1.0,
        flat if flat.flat_area_m2().is_some() => 1.0,
        solid => part.area_m2.dot(own).max(0.0) / solid.projected_area_m2(own),
    }
}

fn box_part(half: DVec3, u: f64, v: f64) -> Part {
    let faces = 4.0 * DVec3::new(half.y * half.z, half.x * half.z, half.x * half.y);
    let total = 2.0 * faces.element_sum();
    let mut rest = u * total;
    let mut axis = 0;
    while axis < 2 && rest >= 2.0 * faces[axis] {
        rest -= 2.0 * faces[axis];
        axis += 1;
    }
    let across = (rest / faces[axis]).clamp(0.0, 2.0);
    let side = if across >= 1.0 { 1.0 } else { -1.0 };
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut at_m = DVec3::ZERO;
    at_m[axis] = side * half[axis];
    at_m[a] = half[a] * (2.0 * (across % 1.0) - 1.0);
    at_m[b] = half[b] * (2.0 * v - 1.0);
    let mut area_m2 = DVec3::ZERO;
    area_m2[axis] = side * total;
    Part { at_m, area_m2 }
}

/// Both ends together get the part of `u` that their projected area has of the whole at 45 degrees; any would do.
fn cylinder_part(half: DVec3, u: f64, v: f64) -> Part {
    let (end, side) = (PI * half.x * half.y, 4.0 * half.z * half.x.max(half.y));
    let ends = end / (end + side);
    let (sin, cos) = (TAU * v).sin_cos();
    if u < ends {
        let across = 2.0 * u / ends;
        let up = if across >= 1.0 { 1.0 } else { -1.0 };
        let r = (across % 1.0).sqrt();
        let at_m = DVec3::new(half.x * r * cos, half.y * r * sin, up * half.z);
        Part { at_m, area_m2: DVec3::Z * up * 2.0 * end / ends }
    } else {
        let z = 2.0 * (u - ends) / (1.0 - ends) - 1.0;
        let at_m = DVec3::new(half.x * cos, half.y * sin, half.z * z);
        let area_m2 = 2.0 * half.z * TAU * DVec3::new(half.y * cos, half.x * sin, 0.0) / (1.0 - ends);
        Part { at_m, area_m2 }
    }
}

/// Directions by gamma band, each with the probability of its flux, uniform in solid angle within.
struct Bands {
    cos_gamma: Vec<f64>,
    gamma_deg: Vec<f64>,
    /// Probability that the band is below the k-th angle.
    below: Vec<f64>,
    /// Cosines of gamma between which there is light, a rounding wider.
    lit_cos: [f64; 2],
}

impl Bands {
    fn new(distribution: &LuminousIntensityDistribution) -> Option<Self> {
        // About another axis than the vertical: bands as narrow as any beam is wide.
        let own = |table: &LuminousIntensityDistribution| table.gamma_deg().to_vec();
        let even = || (0..=360).map(|k| 0.5 * f64::from(k)).collect();
        let gamma_deg = if distribution.goniometer() == Goniometer::B { even() } else { own(distribution) };
        let mut below = vec![0.0];
        let mut total = 0.0;
        for g in gamma_deg.windows(2) {
            total += distribution.flux_between(g[0], g[1]).value().max(0.0);
            below.push(total);
        }
        for b in &mut below {
            *b /= total;
        }
        let cos_gamma: Vec<f64> = gamma_deg.iter().map(|g| g.to_radians().cos()).collect();
        let first = below.partition_point(|b| *b == 0.0).max(1) - 1;
        let last = below.partition_point(|b| *b < 1.0);
        let lit_cos = [cos_gamma[last.min(cos_gamma.len() - 1)] - 1e-12, cos_gamma[first] + 1e-12];
        (total > 0.0).then_some(Self { cos_gamma, gamma_deg, below, lit_cos })
    }

    /// Gamma of a direction of any length, `None` where the table is surely dark, which saves most of the work.
    fn lit_gamma_deg(&self, own: DVec3) -> Option<f64> {
        let across = own.x * own.x + own.y * own.y;
        let cos = -own.z / (across + own.z * own.z).sqrt();
        let [low, high] = self.lit_cos;
        (low..=high).contains(&cos).then(|| across.sqrt().atan2(-own.z).to_degrees())
    }

    fn density_per_sr(&self, gamma_deg: f64) -> f64 {
        let k = self.gamma_deg.partition_point(|g| *g <= gamma_deg).clamp(1, self.gamma_deg.len() - 1);
        (self.below[k] - self.below[k - 1]) / (TAU * (self.cos_gamma[k - 1] - self.cos_gamma[k]))
    }

    fn direction(&self, [u, v]: [f64; 2]) -> (DVec3, f64) {
        let k = self.below.partition_point(|b| *b <= u).clamp(1, self.below.len() - 1);
        let within = (u - self.below[k - 1]) / (self.below[k] - self.below[k - 1]);
        let cos = self.cos_gamma[k - 1] + within * (self.cos_gamma[k] - self.cos_gamma[k - 1]);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (sin_c, cos_c) = (TAU * v).sin_cos();
        let own = DVec3::new(sin * cos_c, sin * sin_c, -cos);
        (own, (self.below[k] - self.below[k - 1]) / (TAU * (self.cos_gamma[k - 1] - self.cos_gamma[k])))
    }
}

#[cfg(test)]
#[path = "emitter_tests.rs"]
mod tests;
