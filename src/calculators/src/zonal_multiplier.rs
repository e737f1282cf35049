//! Zonal multipliers: the share of a zone's downward flux that reaches the work plane directly, fitted and exact.
//!
//! The fit is that of IES LM-57 and ANSI/IES LS-6: K = exp(-A g^B) for room cavity ratio g. The exact multipliers are
//! those of luminaires that cover a rectangular plane continuously and evenly. There a ray at angle theta travels
//! r = h tan theta sideways in azimuth p. It lands inside with probability (1 - r |cos p| / W)+ (1 - r |sin p| / L)+,
//! which has a closed mean over p.

use std::f64::consts::FRAC_PI_2;

/// Constants of K = exp(-A g^B), one pair for each downward zone of 10 degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZonalMultipliers {
    /// A of zones 1 to 9.
    pub a: [f64; 9],
    /// B of zones 1 to 9.
    pub b: [f64; 9],
}

impl ZonalMultipliers {
    /// The constants of LM-57.
    pub const LM57: Self = Self {
        a: [0.0, 0.041, 0.070, 0.100, 0.136, 0.190, 0.315, 0.640, 2.10],
        b: [0.0, 0.98, 1.05, 1.12, 1.16, 1.25, 1.25, 1.25, 0.80],
    };

    /// K of zones 1 to 9 at a room cavity ratio; 1 everywhere at ratio 0.
    pub fn at(&self, room_cavity_ratio: f64) -> [f64; 9] {
        if room_cavity_ratio <= 0.0 {
            return [1.0; 9];
        }
        std::array::from_fn(|n| (-self.a[n] * room_cavity_ratio.powf(self.b[n])).exp())
    }
}

/// The exact multipliers of zones 1 to 9 for evenly spread luminaires `height_m` above a work plane.
///
/// Each is the mean of [`exact_at`] over its zone by solid angle, for an intensity that is constant in the zone.
pub fn exact(width_m: f64, length_m: f64, height_m: f64) -> [f64; 9] {
    std::array::from_fn(|zone| {
        let (low, high) = ((10.0 * zone as f64).to_radians(), (10.0 * zone as f64 + 10.0).to_radians());
        let weight = low.cos() - high.cos();
        midpoints(low, high, 2000).map(|(t, dt)| exact_at(width_m, length_m, height_m, t) * t.sin() * dt).sum::<f64>()
            / weight
    })
}

/// The probability that light at `theta` (radians from the nadir) lands on the work plane.
///
/// It is a mean over azimuth and over the luminaire plane.
pub fn exact_at(width_m: f64, length_m: f64, height_m: f64, theta: f64) -> f64 {
    let run = height_m * theta.tan();
    let (a, b) = (run / width_m, run / length_m);
    // Within a quadrant both factors are positive from acos(1/a) to asin(1/b).
    let low = if a > 1.0 { (1.0 / a).acos() } else { 0.0 };
    let high = if b > 1.0 { (1.0 / b).asin() } else { FRAC_PI_2 };
    if high <= low || !run.is_finite() {
        return 0.0;
    }
    let [high, low] = [high, low].map(|p| p - a * p.sin() + b * p.cos() + 0.5 * a * b * p.sin().powi(2));
    (high - low) / FRAC_PI_2
}

/// The midpoints and the width of equal intervals.
fn midpoints(low: f64, high: f64, count: u32) -> impl Iterator<Item = (f64, f64)> {
    let step = (high - low) / f64::from(count);
    (0..count).map(move |k| (low + (f64::from(k) + 0.5) * step, step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use luxproof_scene::geometry::configuration_factor::opposed_rectangles;

    #[test]
    fn exact_multipliers_of_a_lambertian_plane_integrate_to_its_form_factor() {
        // A uniform Lambertian plane sends sin 2t dt of its flux into dt; what lands opposite is the form factor.
        for (w, l, h) in [(1.0, 1.0, 1.0), (1.0, 1.6, 0.5), (2.0, 7.0, 3.0), (1.0, 1.0, 0.05)] {
            let landed: f64 =
                midpoints(0.0, FRAC_PI_2, 20_000).map(|(t, dt)| exact_at(w, l, h, t) * (2.0 * t).sin() * dt).sum();
            assert_relative_eq!(landed, opposed_rectangles(w, l, h), epsilon = 1e-6);
        }
    }

    /// Largest difference of fitted and exact multipliers of a 1.6:1 room, zones 2 to 9, cavity ratios 1 to 10.
    ///
    /// Zone 1 is 1 by definition, where the exact value falls to .86 at ratio 10.
    fn misfit(fit: &ZonalMultipliers) -> f64 {
        let (w, l) = (1.0, 1.6);
        (1..=10)
            .flat_map(|g| {
                let height = f64::from(g) * w * l / (5.0 * (w + l));
                let (fitted, exact) = (fit.at(f64::from(g)), exact(w, l, height));
                (1..9).map(move |n| (fitted[n] - exact[n]).abs())
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn the_lm57_fit_follows_the_exact_multipliers_and_a_wrong_constant_does_not() {
        let fitted = misfit(&ZonalMultipliers::LM57);
        assert!(fitted < 0.065, "{fitted}");
        for zone in 1..9 {
            let mut wrong = ZonalMultipliers::LM57;
            wrong.a[zone] *= 2.0;
            assert!(misfit(&wrong) > 0.065, "zone {}: {}", zone + 1, misfit(&wrong));
        }
    }

    #[test]
    fn multipliers_are_one_without_a_cavity_and_fall_with_its_depth() {
        assert_eq!(ZonalMultipliers::LM57.at(0.0), [1.0; 9]);
        let (shallow, deep) = (ZonalMultipliers::LM57.at(1.0), ZonalMultipliers::LM57.at(5.0));
        assert!(shallow.iter().zip(&deep).skip(1).all(|(s, d)| s > d));
        assert_relative_eq!(ZonalMultipliers::LM57.at(5.0)[5], (-0.190_f64 * 5f64.powf(1.25)).exp(), epsilon = 1e-15);
    }
}
