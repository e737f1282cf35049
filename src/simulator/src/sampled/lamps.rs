//! Light straight from the luminaires on a place, by one part of each opening.

use glam::{DMat3, DVec3, UVec3};

use super::surroundings::Surroundings;
use crate::emission::Emitter;
use crate::sampler::Sampler;
use luxproof_photometry::Symmetry;
use luxproof_photometry::units::Candela;
use luxproof_scene::opening::Opening;
use luxproof_scene::{Luminaire, Meter};

/// Up to so many luminaires are all asked at every place; of more, so many are drawn.
const MAX_ALL: usize = 8;
const DRAWN: usize = 4;
/// Cells of space in which it is known how often each luminaire is drawn, and numbers of all cells together, at most.
const MAX_CELLS: usize = 4096;
const MAX_WEIGHTS: usize = 2_000_000;
/// The part of a luminaire's peak by which it counts where the centre of a cell gets no light of it.
const FLOOR_PART: f64 = 0.05;
/// Parts of an opening that are asked from a place nearer to it than this part of its radius: one part there says little of all.
const NEAR_PARTS: usize = 8;
const NEAR_RADII: f64 = 0.5;
/// The steps of a lattice of these parts along the second coordinate: by the golden ratio.
const GOLDEN_STEP: f64 = 0.618_033_988_749_895;
/// Directions so near to the horizon may round to either side of it.
const DARK_SLACK: f64 = 1e-9;

/// A luminaire as paths ask it.
#[derive(Debug)]
struct Lamp {
    luminaire: Luminaire,
    kind: LampKind,
    /// Highest intensity, and the radius of a ball around the opening.
    peak_cd: f64,
    radius_m: f64,
    /// Lower and upper corner of a box around the opening.
    bounds_m: [DVec3; 2],
    to_own: DMat3,
    /// Whether one plane of its table stands for all.
    is_axial: bool,
    /// Whether the table is 0 above the horizon.
    is_dark_above: bool,
}

/// What it shines from.
#[derive(Debug)]
enum LampKind {
    Point,
    /// A flat rectangle: its two edges in world coordinates. Each part has the intensity of the table, in proportion to its area.
    Rectangle([DVec3; 2]),
    Other(Box<Emitter>),
}

/// All luminaires of a scene.
#[derive(Debug)]
pub(super) struct Lamps {
    shining: Vec<Lamp>,
    has_extent: bool,
    /// Where there are many.
    cells: Option<LampCells>,
}

/// Cells of space, each with the probability of every luminaire up to and including each.
#[derive(Debug)]
struct LampCells {
    low_m: DVec3,
    cells_per_m: DVec3,
    counts: UVec3,
    cumulative: Vec<f32>,
}

impl LampCells {
    fn new(lamps: &[Lamp], [low_m, high_m]: [DVec3; 2]) -> Self {
        let size_m = (high_m - low_m).max(DVec3::splat(f64::MIN_POSITIVE));
        let most = (MAX_WEIGHTS / lamps.len()).clamp(1, MAX_CELLS) as f64;
        // Cubes as far as that goes, at least one along each axis.
        let longest = size_m.max_element();
        let flat = (size_m / longest).max(DVec3::splat(most.powf(-0.5)));
        let per_side = (most / flat.element_product()).cbrt();
        let counts = (flat * per_side).floor().max(DVec3::ONE).as_uvec3();
        let cell_m = size_m / counts.as_dvec3();
        let radius_m = 0.5 * cell_m.length();
        let mut cumulative = Vec::with_capacity(counts.element_product() as usize * lamps.len());
        for z in 0..counts.z {
            for y in 0..counts.y {
                for x in 0..counts.x {
                    let centre_m = low_m + (UVec3::new(x, y, z).as_dvec3() + 0.5) * cell_m;
                    let weights: Vec<f64> = lamps.iter().map(|lamp| lamp.weight(centre_m, radius_m)).collect();
                    let total: f64 = weights.iter().sum();
                    let mut sum = 0.0;
                    cumulative.extend(weights.iter().map(|w| {
                        sum += w;
                        (sum / total) as f32
                    }));
                }
            }
        }
        Self { low_m, cells_per_m: counts.as_dvec3() / size_m, counts, cumulative }
    }

    fn of_place(&self, point_m: DVec3, lamps: usize) -> &[f32] {
        let at = ((point_m - self.low_m) * self.cells_per_m).max(DVec3::ZERO).as_uvec3().min(self.counts - 1);
        let cell = ((at.z * self.counts.y + at.y) * self.counts.x + at.x) as usize;
        &self.cumulative[cell * lamps..][..lamps]
    }
}

impl Lamp {
    fn new(luminaire: &Luminaire) -> Self {
        let emitter = Emitter::new(luminaire);
        let [low, high] = emitter.bounds_m();
        let kind = match Opening::of_luminaire(luminaire) {
            Opening::Point => LampKind::Point,
            Opening::Box(half_m) if half_m.z == 0.0 => {
                let [x_axis, y_axis] = [luminaire.orientation.x_axis, luminaire.orientation.y_axis];
                LampKind::Rectangle([2.0 * half_m.x * x_axis, 2.0 * half_m.y * y_axis])
            }
            _ => LampKind::Other(Box::new(emitter)),
        };
        Self {
            luminaire: luminaire.clone(),
            kind,
            peak_cd: luminaire.photometry.distribution.max_intensity().value() * luminaire.flux_scale,
            radius_m: 0.5 * (high - low).length(),
            bounds_m: [low, high],
            to_own: luminaire.orientation.transpose(),
            is_axial: luminaire.photometry.distribution.symmetry() == Symmetry::Axial,
            is_dark_above: luminaire.photometry.distribution.is_dark_above(Candela(0.0)),
        }
    }

    /// Illuminance in lux by one part that stands for all, and where that part is.
    fn sample(&self, point_m: DVec3, normal: DVec3, [u, v]: [f64; 2]) -> (f64, DVec3) {
        let from_m = match &self.kind {
            LampKind::Point => self.luminaire.position_m,
            LampKind::Rectangle([x, y]) => self.luminaire.position_m + (u - 0.5) * *x + (v - 0.5) * *y,
            LampKind::Other(emitter) => return emitter.sample(&Meter { position_m: point_m, normal }, [u, v]),
        };
        let path = point_m - from_m;
        let square = path.length_squared();
        let cosine = -path.dot(normal);
        if cosine <= 0.0 || square == 0.0 {
            return (0.0, from_m);
        }
        (self.intensity_cd(path) * cosine / (square * square.sqrt()), from_m)
    }

    /// The same where nothing hides the part; from near the opening, the mean over several parts. Adds the rays that it cast to `rays`.
    fn sample_seen(
        &self,
        surroundings: &Surroundings,
        point_m: DVec3,
        normal: DVec3,
        [u, v]: [f64; 2],
        rays: &mut u64,
    ) -> f64 {
        let count = if self.is_near(point_m, normal) { NEAR_PARTS } else { 1 };
        *rays += count as u64;
        let mut sum = 0.0;
        for k in 0..count {
            let k = k as f64;
            let part = [(u + k / count as f64).fract(), (v + k * GOLDEN_STEP).fract()];
            let (lux, from_m) = self.sample(point_m, normal, part);
            sum += if lux > 0.0 && !surroundings.is_hidden(point_m, from_m) { lux } else { 0.0 };
        }
        sum / count as f64
    }

    /// Whether a place faces an opening so near that its parts differ much there.
    fn is_near(&self, point_m: DVec3, normal: DVec3) -> bool {
        let [low, high] = self.bounds_m;
        let highest_m = DVec3::select(normal.cmpgt(DVec3::ZERO), high, low);
        let reach_m = NEAR_RADII * self.radius_m;
        !matches!(self.kind, LampKind::Point)
            && (highest_m - point_m).dot(normal) > 0.0
            && point_m.distance_squared(point_m.clamp(low, high)) < reach_m * reach_m
    }

    /// What it gives a cell of space, roughly: how often it is drawn there. Never 0, since the cell's centre does not tell all.
    fn weight(&self, centre_m: DVec3, radius_m: f64) -> f64 {
        let path = centre_m - self.luminaire.position_m;
        let square = path.length_squared() + radius_m * radius_m + self.radius_m * self.radius_m;
        (self.luminaire.intensity_towards(path).value() + FLOOR_PART * self.peak_cd) / square
    }

    /// Intensity towards a direction of the world, of any length.
    fn intensity_cd(&self, direction: DVec3) -> f64 {
        let table = &self.luminaire.photometry.distribution;
        if table.is_native() {
            return self.luminaire.intensity_towards(direction).value();
        }
        let own = self.to_own * direction;
        let across = (own.x * own.x + own.y * own.y).sqrt();
        if self.is_dark_above && -own.z < -DARK_SLACK * across {
            return 0.0;
        }
        let gamma_deg = across.atan2(-own.z).to_degrees();
        let c_deg = if self.is_axial { 0.0 } else { own.y.atan2(own.x).to_degrees() };
        table.intensity(c_deg, gamma_deg).value() * self.luminaire.flux_scale
    }
}

impl Lamps {
    pub(super) fn new(luminaires: &[Luminaire], bounds_m: [DVec3; 2]) -> Self {
        let lamps: Vec<Lamp> = luminaires.iter().filter(|l| l.is_on()).map(Lamp::new).collect();
        let has_extent = lamps.iter().any(|lamp| !matches!(lamp.kind, LampKind::Point));
        let cells = (lamps.len() > MAX_ALL).then(|| LampCells::new(&lamps, bounds_m));
        Self { shining: lamps, has_extent, cells }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.shining.is_empty()
    }

    /// Lower and upper corner of a box around each.
    pub(super) fn bounds_m(&self) -> impl Iterator<Item = &[DVec3; 2]> {
        self.shining.iter().map(|lamp| &lamp.bounds_m)
    }

    /// Illuminance in lux of a place, by a random part of each opening, of many luminaires by a few that are drawn. Adds the rays
    /// that it cast to `rays`.
    pub(super) fn illuminance(
        &self,
        surroundings: &Surroundings,
        point_m: DVec3,
        normal: DVec3,
        sampler: &mut Sampler,
        rays: &mut u64,
    ) -> f64 {
        let parts = if self.has_extent { sampler.next_pair() } else { [0.5; 2] };
        let Some(cells) = &self.cells else {
            return self.shining.iter().map(|lamp| lamp.sample_seen(surroundings, point_m, normal, parts, rays)).sum();
        };
        let cumulative = cells.of_place(point_m, self.shining.len());
        let first = sampler.next();
        let mut lux = 0.0;
        for draw in 0..DRAWN {
            let x = (first + draw as f64) / DRAWN as f64;
            let k = cumulative.partition_point(|c| f64::from(*c) <= x).min(self.shining.len() - 1);
            let below = if k == 0 { 0.0 } else { f64::from(cumulative[k - 1]) };
            let probability = f64::from(cumulative[k]) - below;
            lux += self.shining[k].sample_seen(surroundings, point_m, normal, parts, rays) / probability;
        }
        lux / DRAWN as f64
    }
}
