//! A candela table as a renderer looks it up, and what that leaves off.

use std::f64::consts::PI;

use glam::DVec3;
use itertools::Itertools;
use luxproof_photometry::{LuminousIntensityDistribution, angles_deg};
use luxproof_scene::{Luminaire, Meter};

/// What a patch is wide in C, for the largest part of it that lies within some degrees: with a pole at its corner, and where it is wider
/// than so many degrees by its distance from that, at its centre.
const BESIDE_POLE_DEG: f64 = 57.0;
const NEAR_POLE_DEG: f64 = 600.0;
const AT_POLE_DEG: f64 = 150.0;

/// The directions in which a luminaire may lie from a meter's patch, in degrees of C and gamma.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    /// So far to either side, patch and rounding together.
    pub(crate) reach_deg: [f64; 2],
    /// The longer side of the patch: it is no narrower.
    pub(crate) patch_deg: [f64; 2],
}

impl Spread {
    /// Of a square patch of such a side as far from a place as this ray is long, along these directions of its frame.
    pub(crate) fn of(reach_deg: [f64; 2], ray: DVec3, side: f64, [along, across]: [DVec3; 2]) -> Self {
        let from_axis = ray.x.hypot(ray.y);
        let by_c = if from_axis > 0.0 { DVec3::new(-ray.y, ray.x, 0.0) / from_axis } else { DVec3::X };
        let by_gamma = by_c.cross(ray.normalize_or_zero());
        let [c_deg, gamma_deg] = [(by_c, from_axis), (by_gamma, ray.length())].map(|(by, distance)| {
            let extent = side * along.dot(by).abs().max(across.dot(by).abs());
            (extent / distance.max(f64::MIN_POSITIVE)).to_degrees()
        });
        // About a pole in the patch all of C lies, and what is as wide in gamma everywhere is a ring.
        let patch_deg = match c_deg {
            ..BESIDE_POLE_DEG => [c_deg, gamma_deg],
            ..NEAR_POLE_DEG => [BESIDE_POLE_DEG, gamma_deg / PI],
            _ => [AT_POLE_DEG, gamma_deg / PI],
        };
        Self { reach_deg, patch_deg }
    }
}

pub(crate) trait Resampled {
    /// The table itself.
    fn table(&self) -> &LuminousIntensityDistribution;

    /// What the renderer looks up in a direction.
    fn intensity_cd(&self, c_deg: f64, gamma_deg: f64) -> f64;

    /// How far its look-up is off in a direction, in candela.
    fn off_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        (self.intensity_cd(c_deg, gamma_deg) - self.table().intensity(c_deg, gamma_deg).value()).abs()
    }

    /// The same of all that a patch may see about a direction: where a look-up is straight between few angles, the largest of a grid and a margin.
    fn off_about_cd(&self, c_deg: f64, gamma_deg: f64, spread: Spread) -> f64 {
        let [by_c, by_gamma] = [spread.reach_deg[0].min(180.0), spread.reach_deg[1]];
        let parts = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let off = |(x, y): (f64, f64)| self.off_cd(c_deg + x * by_c, (gamma_deg + y * by_gamma).clamp(0.0, 180.0));
        1.1 * parts.into_iter().cartesian_product(parts).map(off).fold(0.0, f64::max)
    }

    /// How far its look-up leaves the light of a luminaire at a meter from the table's own, in lux, where equal parts of it come from these places;
    /// in which directions it may lie from there is asked for.
    fn off_lx(&self, luminaire: &Luminaire, places: &[DVec3], meter: &Meter, spread: impl Fn(DVec3) -> Spread) -> f64
    where
        Self: Sized,
    {
        let parts_lx = places.iter().map(|place_m| {
            let ray_m = meter.position_m - *place_m;
            let cosine = -ray_m.normalize_or_zero().dot(meter.normal);
            let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray_m);
            self.off_about_cd(c, gamma, spread(*place_m)) * cosine.max(0.0) / ray_m.length_squared()
        });
        luminaire.flux_scale * parts_lx.sum::<f64>() / places.len() as f64
    }

    /// The share of the flux that its look-up sends elsewhere, adds or loses.
    fn misled_share(&self) -> f64 {
        const C: usize = 144;
        const GAMMA: usize = 720;
        let (mut off, mut all) = (0.0, f64::MIN_POSITIVE);
        for j in 0..GAMMA {
            let gamma = 180.0 * (j as f64 + 0.5) / GAMMA as f64;
            for k in 0..C {
                let c = 360.0 * (k as f64 + 0.381_966) / C as f64;
                let sine = gamma.to_radians().sin();
                off += self.off_cd(c, gamma) * sine;
                all += self.table().intensity(c, gamma).value() * sine;
            }
        }
        off / all
    }
}
