//! What of the light at a meter makes a reading: an illuminance, a mean of many, a luminance, a rating.

use std::f64::consts::{LN_10, PI};

use glam::DVec3;
use luminaire::calculators::ugr::observer;
use luminaire::scene::{Luminaire, Meter};
use luminaire::simulator::Sight;
use luminaire::units::Lux;

use crate::record::Estimate;

/// What of the light at a meter makes a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// The illuminance on the side that the meter looks to.
    Illuminance,
    /// Its mean over all vertical directions.
    AllAround,
    /// The luminance of the diffuse surface on which the meter lies, L = rho E / pi.
    Luminance,
    /// The mean luminance of the luminous opening of the luminaire that alone is lit, L = E over its projected solid angle, E being the
    /// illuminance of an eye that is aimed at its centre, wherever the meter looks.
    OpeningLuminance,
    /// The unified glare rating of an observer who looks as the meter does, by the openings in view and the indirect illuminance.
    GlareRating,
}

/// An illuminance that counts in a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aspect {
    pub meter: Meter,
    /// The reading's unit a lux: 1, or distance squared for an intensity.
    pub weight: f64,
}

/// What a reading makes of its weighted sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Made {
    /// The sum itself.
    Sum,
    /// The glare rating of an eye whose indirect illuminance it is; `glare` is the sum of L^2 w / p^2 over the openings in view.
    Rating { glare: f64 },
}

impl Made {
    pub(super) fn of(self, sum: Estimate) -> Estimate {
        match self {
            Self::Sum => sum,
            Self::Rating { glare } => rating_of(sum, glare),
        }
    }

    /// How much it changes with its sum.
    pub fn slope(self, sum: f64) -> f64 {
        match self {
            Self::Sum => 1.0,
            Self::Rating { .. } => -slope_of_rating(sum),
        }
    }
}

/// What is known of a meter beside its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) reflectance: Option<f64>,
    pub(super) glare: Option<f64>,
    pub(super) opening: Option<Aimed>,
}

/// An eye that is aimed at a luminaire's photometric centre, and what of its view the luminous opening fills.
#[derive(Clone, Copy, Debug)]
pub struct Aimed {
    pub eye: Meter,
    pub sight: Sight,
}

impl Aimed {
    /// At a meter's place; `None` where no area of the opening shows.
    pub fn at(luminaire: &Luminaire, meter: &Meter) -> Option<Self> {
        let normal = (luminaire.position_m - meter.position_m).try_normalize()?;
        let eye = Meter { normal, ..*meter };
        Some(Self { eye, sight: Sight::of(luminaire, &eye)? })
    }
}

/// What a reading is made of, as [`super::Target`] holds it.
pub(super) struct Parts {
    pub(super) aspects: Vec<Aspect>,
    pub(super) quadrature: f64,
    pub(super) made: Made,
}

impl Reads {
    /// What a reading at a meter is made of; nothing where it takes a surface, or openings in view, and there are none.
    pub(super) fn parts(self, meter: Meter, seen: Seen) -> Option<Parts> {
        let one = |weight: f64| Parts { aspects: vec![Aspect { meter, weight }], quadrature: 0.0, made: Made::Sum };
        match self {
            Self::Illuminance => Some(one(1.0)),
            Self::AllAround => {
                let (aspects, quadrature) = all_around(meter);
                Some(Parts { aspects, quadrature, made: Made::Sum })
            }
            Self::Luminance => Some(one(seen.reflectance? / PI)),
            Self::OpeningLuminance => {
                let Aimed { eye, sight } = seen.opening?;
                let aspects = vec![Aspect { meter: eye, weight: 1.0 / sight.projected_sr }];
                Some(Parts { aspects, quadrature: sight.relative_error, made: Made::Sum })
            }
            Self::GlareRating => Some(Parts { made: Made::Rating { glare: seen.glare? }, ..one(1.0) }),
        }
    }
}

/// Directions of the mean all around: odd, so that its error is that of twice as many.
const DIRECTIONS: u32 = 31;

/// The mean over all vertical directions, by the rectangle rule.
///
/// A surface that turns once sees each bit of light as the positive part of a cosine, whose even harmonics 2k are
/// 2 / (4 k^2 - 1) of its mean and whose odd ones but the first are none. An odd number N of directions takes the harmonics 2 N j for
/// the mean: it is off by 2 / (4 N^2 j^2 - 1) of it, summed over j, at most, whatever the light, since all light is positive. The sum is
/// 1 - x cot x with x = pi / 2N.
fn all_around(meter: Meter) -> (Vec<Aspect>, f64) {
    let facing = |k: u32| {
        let azimuth = 2.0 * PI * f64::from(k) / f64::from(DIRECTIONS);
        let normal = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
        Aspect { meter: Meter { normal, ..meter }, weight: 1.0 / f64::from(DIRECTIONS) }
    };
    let x = PI / f64::from(2 * DIRECTIONS);
    ((0..DIRECTIONS).map(facing).collect(), 1.0 - x / x.tan())
}

/// Darker than this, in lux, no surroundings are: what a renderer reads below is a rating beyond any scale, and a number.
const DARKEST_LX: f64 = 1e-12;
/// Of an interval about a background that reaches to darkness, the part that is told.
const NEARLY_ALL: f64 = 0.999;

/// The glare rating by an indirect illuminance, and its uncertainty: dUGR = 8 / ln 10 dE / E, and as much more as the logarithm of the
/// darker end of a bound is.
fn rating_of(indirect: Estimate, glare: f64) -> Estimate {
    let lux = indirect.value.max(DARKEST_LX);
    let bound = (indirect.uncertainty.bound() / lux).min(NEARLY_ALL);
    let bent = if bound > 0.0 { -(-bound).ln_1p() / bound } else { 1.0 };
    let uncertainty = indirect.uncertainty.times(bent * slope_of_rating(lux));
    Estimate { value: observer::rating(glare, Lux(lux)), uncertainty }
}

/// By how much a rating falls with a lux more of a background of so many.
fn slope_of_rating(indirect_lx: f64) -> f64 {
    8.0 / LN_10 / indirect_lx.max(DARKEST_LX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Uncertainty;

    #[test]
    fn the_mean_all_around_is_off_by_its_bound_at_most_and_nearly_reaches_it() {
        let meter = Meter { position_m: DVec3::ZERO, normal: DVec3::Z };
        let (aspects, bound) = all_around(meter);
        let off = |azimuth: f64| {
            let towards_light = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
            let mean: f64 = aspects.iter().map(|a| a.weight * a.meter.normal.dot(towards_light).max(0.0)).sum();
            (mean * PI - 1.0).abs()
        };
        let worst = (0..100_000).map(|k| off(f64::from(k) * 1e-4)).fold(0.0, f64::max);
        assert!(worst <= bound && worst > 0.5 * bound, "{worst} {bound}");
        assert!((8.5e-4..8.6e-4).contains(&bound), "{bound}");
    }

    #[test]
    fn a_rating_has_the_uncertainty_of_its_logarithm_and_is_always_a_number() {
        let glare = 1e5;
        let rating = |value: f64, uncertainty| rating_of(Estimate { value, uncertainty }, glare);
        let at = |lux: f64| 8.0 * (0.25 * PI * glare / lux).log10();
        let read = rating(40.0, Uncertainty::sampled(0.4, Some(7.0)));
        assert!((read.value - at(40.0)).abs() < 1e-12);
        // A hundredth of the background: 8 / ln 10 of it.
        assert!((read.uncertainty.standard_error().unwrap() - 0.08 / LN_10).abs() < 1e-12);
        assert_eq!(read.uncertainty.degrees_of_freedom(), Some(7.0));
        // Either end of a bound is within the rating's, which the darker end reaches.
        let bound = rating(40.0, Uncertainty::Bound(10.0)).uncertainty.bound();
        assert!((at(30.0) - at(40.0) - bound).abs() < 1e-9 && at(40.0) - at(50.0) < bound, "{bound}");
        assert_eq!(rating(40.0, Uncertainty::Exact).uncertainty, Uncertainty::Exact);
        for (value, uncertainty) in
            [(0.0, Uncertainty::NotSeen), (-3.0, Uncertainty::Exact), (1.0, Uncertainty::Bound(2.0))]
        {
            let odd = rating(value, uncertainty);
            assert!(odd.value.is_finite() && odd.uncertainty.is_sound(), "{odd:?}");
        }
        assert!(rating(0.0, Uncertainty::Unstated).value > 100.0);
    }
}
