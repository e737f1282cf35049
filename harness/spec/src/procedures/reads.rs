//! What of the light at a meter makes a reading: an illuminance, a mean of many, a luminance, a rating.

use std::f64::consts::{LN_10, PI};

use glam::DVec3;
use luxproof_calculators::ugr::observer;
use luxproof_photometry::units::Lux;
use luxproof_scene::{Luminaire, Meter};
use luxproof_simulator::Sight;

use luxproof_model::Estimate;

/// What of the light at a meter makes a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// The illuminance on the side that the meter looks to.
    Illuminance,
    /// Its mean over all vertical directions.
    AllAround,
    /// Its mean over an upright half cylinder that faces as the meter does.
    Semicylinder,
    /// Its mean over a hemisphere that faces as the meter does.
    Hemisphere,
    /// Its mean over all directions.
    Sphere,
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
pub enum ReadingKind {
    /// The sum itself.
    Sum,
    /// The glare rating of an eye whose indirect illuminance it is; `glare` is the sum of L^2 w / p^2 over the openings in view.
    Rating { glare: f64 },
}

impl ReadingKind {
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
pub(super) struct MeterContext {
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
    pub(super) made: ReadingKind,
}

impl Reads {
    /// What a reading at a meter is made of; nothing where it takes a surface, or openings in view, and there are none.
    pub(super) fn parts(self, meter: Meter, seen: MeterContext) -> Option<Parts> {
        match self {
            Self::Illuminance => Some(Parts::of_one(meter, 1.0)),
            Self::AllAround => {
                let (aspects, quadrature) = all_around(meter, 0.0);
                Some(Parts { aspects, quadrature, made: ReadingKind::Sum })
            }
            Self::Semicylinder => {
                let facing = horizontal(meter.normal)?;
                // The first direction is the one faced: POV-Ray can read meters that are parallel, but not nearly so.
                let (mut aspects, quadrature) = all_around(meter, facing.y.atan2(facing.x));
                aspects.extend(difference(meter, facing, 1.0 / PI));
                Some(Parts { aspects, quadrature, made: ReadingKind::Sum })
            }
            Self::Hemisphere => {
                let (mut aspects, quadrature) = all_over(meter, apart_from(meter.normal));
                aspects.extend(difference(meter, meter.normal, 0.25));
                Some(Parts { aspects, quadrature, made: ReadingKind::Sum })
            }
            Self::Sphere => {
                let (aspects, quadrature) = all_over(meter, 0.0);
                Some(Parts { aspects, quadrature, made: ReadingKind::Sum })
            }
            Self::Luminance => Some(Parts::of_one(meter, seen.reflectance? / PI)),
            Self::OpeningLuminance => {
                let Aimed { eye, sight } = seen.opening?;
                let aspects = vec![Aspect { meter: eye, weight: 1.0 / sight.projected_sr }];
                Some(Parts { aspects, quadrature: sight.relative_error, made: ReadingKind::Sum })
            }
            Self::GlareRating => {
                Some(Parts { made: ReadingKind::Rating { glare: seen.glare? }, ..Parts::of_one(meter, 1.0) })
            }
        }
    }
}

impl Parts {
    /// One illuminance, times a weight.
    fn of_one(meter: Meter, weight: f64) -> Self {
        Self { aspects: vec![Aspect { meter, weight }], quadrature: 0.0, made: ReadingKind::Sum }
    }
}

/// Directions of the mean all around: odd, so that its error is that of twice as many.
const DIRECTIONS: u32 = 31;

/// The mean over all vertical directions from an azimuth on, by the rectangle rule.
///
/// A surface that turns once sees each bit of light as the positive part of a cosine, whose even harmonics 2k are
/// 2 / (4 k^2 - 1) of its mean and whose odd ones but the first are none. An odd number N of directions takes the harmonics 2 N j for
/// the mean: it is off by 2 / (4 N^2 j^2 - 1) of it, summed over j, at most, whatever the light, since all light is positive. The sum is
/// 1 - x cot x with x = pi / 2N.
fn all_around(meter: Meter, first: f64) -> (Vec<Aspect>, f64) {
    let aspects = (0..DIRECTIONS).map(|k| {
        let azimuth = first + 2.0 * PI * f64::from(k) / f64::from(DIRECTIONS);
        let normal = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
        Aspect { meter: Meter { normal, ..meter }, weight: 1.0 / f64::from(DIRECTIONS) }
    });
    let x = PI / f64::from(2 * DIRECTIONS);
    (aspects.collect(), 1.0 - x / x.tan())
}

/// The horizontal direction nearest to a normal; `None` of one that looks straight up or down.
pub(crate) fn horizontal(normal: DVec3) -> Option<DVec3> {
    let level = DVec3::new(normal.x, normal.y, 0.0);
    (level.length() > MIN_LEVEL_PART).then(|| level.normalize())
}

/// Below this horizontal part a unit vector has no azimuth.
const MIN_LEVEL_PART: f64 = 1e-6;

/// A weight times the illuminance of a direction less that of its opposite, which is the cosine to any light, signed.
fn difference(meter: Meter, direction: DVec3, weight: f64) -> [Aspect; 2] {
    [1.0, -1.0].map(|sign| Aspect { meter: Meter { normal: sign * direction, ..meter }, weight: sign * weight })
}

/// A ring of directions about the vertical for the mean over the sphere.
struct Ring {
    /// The cosine to the vertical; negative below the horizon.
    z: f64,
    directions: u32,
    /// By how many steps of azimuth the first direction is turned.
    turn: f64,
    weight: f64,
}

/// Rings at the positive nodes of the Gauss-Legendre rule of order 12, of which half lie below the horizon. Their weights
/// minimise the largest error over all directions of light (a linear programme).
const RINGS: [Ring; 6] = [
    Ring { z: -0.125_233_408_511_468_9, directions: 23, turn: 0.0, weight: 0.267_66 },
    Ring { z: -0.367_831_498_998_180_2, directions: 21, turn: 0.5, weight: 0.183_63 },
    Ring { z: 0.587_317_954_286_617_4, directions: 19, turn: 0.0, weight: 0.257_84 },
    Ring { z: 0.769_902_674_194_304_7, directions: 15, turn: 0.5, weight: 0.126_54 },
    Ring { z: -0.904_117_256_370_474_9, directions: 11, turn: 0.0, weight: 0.123_09 },
    Ring { z: -0.981_560_634_246_719_3, directions: 5, turn: 0.5, weight: 0.041_73 },
];

/// The largest relative error of the mean over [`RINGS`], for light from any direction. A test computes it.
const RINGS_ERROR: f64 = 4.7e-3;

/// The azimuth by which to turn [`RINGS`] so that no direction is near a normal or its opposite: halfway between the directions of
/// the ring at the same height.
fn apart_from(normal: DVec3) -> f64 {
    let nearest = RINGS.iter().min_by(|a, b| {
        let [a, b] = [a, b].map(|ring| (ring.z.abs() - normal.z.abs()).abs());
        a.total_cmp(&b)
    });
    let Some(ring) = nearest else { return 0.0 };
    let facing = if ring.z * normal.z < 0.0 { -normal } else { normal };
    facing.y.atan2(facing.x) - 2.0 * PI * (ring.turn + 0.5) / f64::from(ring.directions)
}

/// The mean over all directions, of rings that are turned by an azimuth.
///
/// Light from a direction s counts the positive part of n s in the illuminance of a surface with the normal n, which is
/// (n s + |n s|) / 2. The first part adds up to nothing, by a last pair of directions. The second is the same for n and
/// -n, so that directions of one half space suffice; each ring is on one side of the horizon. As the weighted sum of |n s|
/// is linear between the planes n s = 0, its extremes are at the lines where two of them meet and within the cells around.
fn all_over(meter: Meter, first: f64) -> (Vec<Aspect>, f64) {
    let mut aspects = vec![];
    for Ring { z, directions, turn, weight } in RINGS {
        let across = (1.0 - z * z).sqrt();
        for k in 0..directions {
            let azimuth = first + 2.0 * PI * (f64::from(k) + turn) / f64::from(directions);
            let normal = DVec3::new(across * azimuth.cos(), across * azimuth.sin(), z).normalize();
            aspects.push(Aspect { meter: Meter { normal, ..meter }, weight: weight / f64::from(directions) });
        }
    }
    let whole: f64 = aspects.iter().map(|a| a.weight).sum();
    let lean: f64 = aspects.iter().map(|a| a.weight * a.meter.normal.z).sum();
    for aspect in &mut aspects {
        aspect.weight /= whole;
    }
    // The rings lean up or down together; a signed pair of half as much undoes it.
    aspects.extend(difference(meter, DVec3::Z, -0.5 * lean / whole));
    (aspects, RINGS_ERROR)
}

/// Darker than this, in lux, no surroundings are: what a renderer reads below is a rating beyond any scale, and a number.
const DARKEST_LX: f64 = 1e-12;
/// Of an interval about a background that reaches to darkness, the part that is reported.
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
    use glam::DVec2;

    use super::*;
    use luxproof_model::Uncertainty;

    #[test]
    fn the_mean_all_around_is_off_by_its_bound_at_most_and_nearly_reaches_it() {
        let meter = Meter { position_m: DVec3::ZERO, normal: DVec3::Z };
        let (aspects, bound) = all_around(meter, 0.0);
        let directions = (0..100_000).map(|k| DVec2::from_angle(f64::from(k) * 1e-4).extend(0.0));
        let offs = directions.map(|towards_light| {
            let mean: f64 = aspects.iter().map(|a| a.weight * a.meter.normal.dot(towards_light).max(0.0)).sum();
            (mean * PI - 1.0).abs()
        });
        let worst = offs.fold(0.0, f64::max);
        assert!(worst <= bound && worst > 0.5 * bound, "{worst} {bound}");
        assert!((8.5e-4..8.6e-4).contains(&bound), "{bound}");
    }

    /// What light of one direction counts, as a part of what a surface that faces it gets.
    fn share(aspects: &[Aspect], towards_light: DVec3) -> f64 {
        aspects.iter().map(|a| a.weight * a.meter.normal.dot(towards_light).max(0.0)).sum()
    }

    #[test]
    fn the_mean_over_the_sphere_is_off_by_its_bound_at_most() {
        let meter = Meter { position_m: DVec3::ZERO, normal: DVec3::Z };
        let (aspects, bound) = all_over(meter, 0.0);
        let lean: DVec3 = aspects.iter().map(|a| a.weight * a.meter.normal).sum();
        assert!(lean.length() < 1e-12, "{lean}");
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        // The last pair is linear in the light.
        let rings = &aspects[..aspects.len() - 2];
        for (i, a) in rings.iter().enumerate() {
            for b in &rings[i + 1..] {
                let Some(meet) = a.meter.normal.cross(b.meter.normal).try_normalize() else { continue };
                least = least.min(share(&aspects, meet)).min(share(&aspects, -meet));
                // Of the four cells around, the gradient of the linear function in each.
                let of_pair = |x: &Aspect| x.meter.normal == a.meter.normal || x.meter.normal == b.meter.normal;
                let others = rings.iter().filter(|x| !of_pair(x));
                let base: DVec3 = others
                    .map(|x| {
                        let cosine = x.meter.normal.dot(meet);
                        let sign = if cosine.abs() < 1e-12 { 0.0 } else { cosine.signum() };
                        0.5 * x.weight * sign * x.meter.normal
                    })
                    .sum();
                for (p, q) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                    let gradient = base + 0.5 * (p * a.weight * a.meter.normal + q * b.weight * b.meter.normal);
                    most = most.max(gradient.length());
                }
            }
        }
        assert!(1.0 - 4.0 * least <= bound && 4.0 * most - 1.0 <= bound, "{least} {most} {bound}");
        assert!((1.0 - 4.0 * least).max(4.0 * most - 1.0) > 0.9 * bound, "{least} {most} {bound}");
    }

    #[test]
    fn half_cylinders_and_hemispheres_see_light_as_their_projected_areas() {
        let normal = DVec3::new(1.0, 0.5, 0.2).normalize();
        let meter = Meter { position_m: DVec3::ZERO, normal };
        let seen = MeterContext { reflectance: None, glare: None, opening: None };
        let level = horizontal(normal).unwrap();
        let semicylinder = Reads::Semicylinder.parts(meter, seen).unwrap();
        let hemisphere = Reads::Hemisphere.parts(meter, seen).unwrap();
        for k in 0..2000 {
            let (z, azimuth) = (2.0 * f64::from(k) / 2000.0 - 1.0, 2.399_963 * f64::from(k));
            let across = (1.0 - z * z).sqrt();
            let light = DVec3::new(across * azimuth.cos(), across * azimuth.sin(), z);
            let cylinder = (across + light.dot(level)) / PI;
            let found = share(&semicylinder.aspects, light);
            assert!(
                (found - cylinder).abs() <= semicylinder.quadrature * across / PI + 1e-12,
                "{light}: {found} {cylinder}"
            );
            let half = (1.0 + light.dot(normal)) / 4.0;
            let found = share(&hemisphere.aspects, light);
            assert!((found - half).abs() <= hemisphere.quadrature / 4.0 + 1e-12, "{light}: {found} {half}");
        }
        assert!(Reads::Semicylinder.parts(Meter { normal: DVec3::Z, ..meter }, seen).is_none());
    }

    #[test]
    fn planes_at_a_meter_are_parallel_or_a_few_degrees_apart_whatever_its_normal() {
        let seen = MeterContext { reflectance: None, glare: None, opening: None };
        for k in 0..500 {
            // Not within 5 degrees of the vertical, where a normal and the vertical pair are near each other.
            let (z, azimuth) = (0.996 * (2.0 * f64::from(k) / 499.0 - 1.0), 2.399_963 * f64::from(k));
            let across = (1.0 - z * z).sqrt();
            let normal = DVec3::new(across * azimuth.cos(), across * azimuth.sin(), z);
            for reads in [Reads::Semicylinder, Reads::Hemisphere] {
                let parts = reads.parts(Meter { position_m: DVec3::ZERO, normal }, seen).unwrap();
                for (i, a) in parts.aspects.iter().enumerate() {
                    for b in &parts.aspects[i + 1..] {
                        let (sine, cosine) =
                            (a.meter.normal.cross(b.meter.normal).length(), a.meter.normal.dot(b.meter.normal));
                        assert!(cosine < 0.0 || !(1e-9..=0.05).contains(&sine), "{reads:?} {normal}: {sine}");
                    }
                }
            }
        }
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
