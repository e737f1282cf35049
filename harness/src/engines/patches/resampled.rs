//! A candela table as a renderer looks it up, and what that leaves off.

use glam::DVec3;
use luminaire::photometry::{LuminousIntensityDistribution, angles_deg};
use luminaire::scene::{Luminaire, Meter};

pub(in crate::engines) trait Resampled {
    /// The table itself.
    fn table(&self) -> &LuminousIntensityDistribution;

    /// What the renderer looks up in a direction.
    fn intensity_cd(&self, c_deg: f64, gamma_deg: f64) -> f64;

    /// How far its look-up is off in a direction, in candela.
    fn off_cd(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        (self.intensity_cd(c_deg, gamma_deg) - self.table().intensity(c_deg, gamma_deg).value()).abs()
    }

    /// The same about a direction, up to so far to either side in C and gamma.
    fn off_about_cd(&self, c_deg: f64, gamma_deg: f64, _spread_deg: [f64; 2]) -> f64 {
        self.off_cd(c_deg, gamma_deg)
    }

    /// How far its look-up leaves the light of a luminaire at a meter from the table's own, in lux, where equal parts of it come from these places;
    /// how far directions from a place are spread, in degrees of C and gamma, is asked for.
    fn off_lx(
        &self,
        luminaire: &Luminaire,
        places: &[DVec3],
        meter: &Meter,
        spread_deg: impl Fn(DVec3) -> [f64; 2],
    ) -> f64
    where
        Self: Sized,
    {
        let of_place = |place_m: &DVec3| {
            let ray_m = meter.position_m - *place_m;
            let cosine = -ray_m.normalize_or_zero().dot(meter.normal);
            let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray_m);
            self.off_about_cd(c, gamma, spread_deg(*place_m)) * cosine.max(0.0) / ray_m.length_squared()
        };
        luminaire.flux_scale * places.iter().map(of_place).sum::<f64>() / places.len() as f64
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
