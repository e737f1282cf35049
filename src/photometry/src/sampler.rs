//! Importance sampling: directions drawn with a density exactly proportional to the intensity.
//!
//! The density over the sphere is I(C, gamma) / flux per steradian. Gamma comes from the azimuth average: its flux up to
//! any gamma has a closed form, which safeguarded Newton iteration inverts. C comes from the piecewise linear intensities
//! at that gamma; their integral is inverted in closed form. Types A and B are sampled in native angles.

use glam::DVec3;

use super::LuminousIntensityDistribution;
use crate::units::Lumen;

/// Draws directions of a distribution.
#[derive(Clone, Debug)]
pub struct DirectionSampler {
    full: LuminousIntensityDistribution,
    /// Mean intensity over C at each gamma, in candela.
    average: Vec<f64>,
    /// Flux below each gamma, in lumens.
    flux_below: Vec<f64>,
}

/// A direction drawn in the luminaire's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledDirection {
    /// Unit vector.
    pub direction: DVec3,
    /// Probability density per steradian.
    pub density: f64,
}

impl DirectionSampler {
    /// Prepares sampling; `None` for a distribution without flux.
    pub fn new(distribution: &LuminousIntensityDistribution) -> Option<Self> {
        let full = distribution.own_planes();
        let average = full.azimuth_average();
        let mut flux = 0.0;
        let mut flux_below = vec![flux];
        for zone in full.gamma_deg().windows(2) {
            flux += full.own_flux_between(zone[0], zone[1]).value();
            flux_below.push(flux);
        }
        (flux > 0.0 && flux.is_finite()).then_some(Self { full, average, flux_below })
    }

    /// The flux of the distribution.
    pub fn flux(&self) -> Lumen {
        Lumen(self.flux_below[self.flux_below.len() - 1])
    }

    /// The direction for two numbers within 0..1.
    pub fn sample(&self, u: [f64; 2]) -> SampledDirection {
        let gamma_deg = self.sample_gamma_deg(u[0]);
        let c_deg = self.sample_c_deg(gamma_deg, u[1]);
        let density = self.full.own_intensity(c_deg, gamma_deg).value() / self.flux().value();
        SampledDirection { direction: self.full.own_direction(c_deg, gamma_deg), density }
    }

    /// The gamma below which the fraction `u` of the flux lies.
    fn sample_gamma_deg(&self, u: f64) -> f64 {
        let gamma_deg = self.full.gamma_deg();
        let target = u.clamp(0.0, 1.0) * self.flux().value();
        let zone = self.flux_below.partition_point(|f| *f <= target).clamp(1, gamma_deg.len() - 1) - 1;
        let (low, high) = (gamma_deg[zone].to_radians(), gamma_deg[zone + 1].to_radians());
        let (a, b) = (self.average[zone], self.average[zone + 1]);
        let slope = (b - a) / (high - low);
        // The rest of the target within the zone, per radian of C.
        let wanted = (target - self.flux_below[zone]) / std::f64::consts::TAU;
        let (mut left, mut right) = (low, high);
        let mut gamma = f64::midpoint(low, high);
        // Bisection alone converges within 60 steps; Newton mostly within 5.
        for _ in 0..60 {
            let intensity = a + slope * (gamma - low);
            // Integral of (a + slope (g - low)) sin g from low to gamma.
            let flux = a * low.cos() - intensity * gamma.cos() + slope * (gamma.sin() - low.sin());
            let excess = flux - wanted;
            if excess > 0.0 {
                right = gamma;
            } else {
                left = gamma;
            }
            let newton = gamma - excess / (intensity * gamma.sin());
            let next = if newton > left && newton < right { newton } else { f64::midpoint(left, right) };
            if (next - gamma).abs() <= 1e-15 {
                break;
            }
            gamma = next;
        }
        gamma.to_degrees().clamp(gamma_deg[zone], gamma_deg[zone + 1])
    }

    /// The C below which the fraction `u` of the light at this gamma lies.
    fn sample_c_deg(&self, gamma_deg: f64, u: f64) -> f64 {
        let c_deg = self.full.c_deg();
        let candela: Vec<f64> = c_deg.iter().map(|&c| self.full.own_intensity(c, gamma_deg).value()).collect();
        let areas: Vec<f64> =
            c_deg.windows(2).zip(candela.windows(2)).map(|(c, i)| 0.5 * (c[1] - c[0]) * (i[0] + i[1])).collect();
        let mut target = u.clamp(0.0, 1.0) * areas.iter().sum::<f64>();
        let last = areas.iter().rposition(|a| *a > 0.0).unwrap_or(areas.len() - 1);
        let mut cell = 0;
        while cell < last && (target >= areas[cell] || areas[cell] == 0.0) {
            target -= areas[cell];
            cell += 1;
        }
        let (a, b, width) = (candela[cell], candela[cell + 1], c_deg[cell + 1] - c_deg[cell]);
        // Solves width (a t + (b - a) t^2 / 2) = target for t in the form without cancellation.
        let x = (target / width).max(0.0);
        let root = (a * a + 2.0 * (b - a) * x).max(0.0).sqrt();
        let t = if a + root > 0.0 { 2.0 * x / (a + root) } else { u };
        c_deg[cell] + width * t.clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn table() -> LuminousIntensityDistribution {
        let (c, gamma) = (vec![0.0, 30.0, 90.0, 180.0], vec![0.0, 20.0, 70.0, 90.0, 150.0]);
        let candela = vec![
            90.0, 50.0, 10.0, 0.0, 5.0, //
            90.0, 80.0, 0.0, 0.0, 40.0, //
            90.0, 20.0, 30.0, 0.0, 0.0, //
            90.0, 0.0, 100.0, 0.0, 70.0,
        ];
        LuminousIntensityDistribution::new(c, gamma, candela).unwrap()
    }

    /// Points of a rank-1 lattice (Korobov).
    fn lattice(count: u32) -> impl Iterator<Item = [f64; 2]> {
        (0..count).map(move |k| {
            let k = (f64::from(k) + 0.5) / f64::from(count);
            [k, (k * 17_711.0).fract()]
        })
    }

    #[test]
    fn density_is_intensity_over_flux() {
        let sampler = DirectionSampler::new(&table()).unwrap();
        assert_relative_eq!(sampler.flux().value(), table().flux().value(), max_relative = 1e-13);
        for u in lattice(1000) {
            let sampled = sampler.sample(u);
            let intensity = table().intensity_towards(sampled.direction).value();
            assert_relative_eq!(
                sampled.density,
                intensity / table().flux().value(),
                max_relative = 1e-6,
                epsilon = 1e-9
            );
            assert!(sampled.density > 0.0, "{u:?}");
        }
    }

    /// Flux per degree of C of a plane.
    fn plane_flux(full: &LuminousIntensityDistribution, c: f64) -> f64 {
        let row = full.gamma_deg().iter().map(|&g| full.intensity(c, g).value()).collect();
        LuminousIntensityDistribution::axial(full.gamma_deg().to_vec(), row).unwrap().flux().value() / 360.0
    }

    /// Flux of a sector: the trapezoid rule over C of planes divided at its borders.
    fn sector_flux(full: &LuminousIntensityDistribution, from: f64, to: f64) -> f64 {
        let inner = full.c_deg().iter().copied().filter(|c| *c > from && *c < to);
        let mut c: Vec<f64> = inner.chain([from, to]).collect();
        c.sort_by(f64::total_cmp);
        c.windows(2).map(|w| 0.5 * (w[1] - w[0]) * (plane_flux(full, w[0]) + plane_flux(full, w[1]))).sum()
    }

    #[test]
    fn zones_and_sectors_get_samples_in_proportion_to_their_flux() {
        let sampler = DirectionSampler::new(&table()).unwrap();
        let full = table().full_circle();
        let count = 200_000;
        let samples: Vec<(f64, f64)> =
            lattice(count).map(|u| super::super::angles_deg(sampler.sample(u).direction)).collect();
        for (from, to) in [(0.0, 10.0), (10.0, 45.0), (45.0, 80.0), (80.0, 120.0), (120.0, 180.0)] {
            let hits = samples.iter().filter(|(_, g)| *g >= from && *g < to).count();
            let expected = full.flux_between(from, to) / full.flux();
            assert!((hits as f64 / f64::from(count) - expected).abs() < 1e-4, "{from} {to}");
        }
        let borders = [0.0, 15.0, 60.0, 140.0, 250.0, 360.0];
        let mut total = 0.0;
        for border in borders.windows(2) {
            let expected = sector_flux(&full, border[0], border[1]) / full.flux().value();
            let hits = samples.iter().filter(|(c, _)| *c >= border[0] && *c < border[1]).count();
            assert!((hits as f64 / f64::from(count) - expected).abs() < 2e-3, "{border:?} {expected}");
            total += expected;
        }
        assert_relative_eq!(total, 1.0, max_relative = 1e-12);
    }

    #[test]
    fn darkness_cannot_be_sampled() {
        let dark = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![0.0, 0.0]).unwrap();
        assert!(DirectionSampler::new(&dark).is_none());
    }
}
