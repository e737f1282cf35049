//! Laws of light: it adds up, it scales, and a table is what it says, however fine, narrow or dark.

use luxproof_photometry::HorizontalAxis;
use luxproof_photometry::LuminousOpening;
use luxproof_scene::orientation;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use itertools::Itertools;
use luxproof_photometry::{LuminousIntensityDistribution, Photometry, direction};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Transport};

use super::furnace::furnace;
use super::surfaces::known_direct;
use super::{Against, Law, Light, Variant};
use luxproof_engines::{Job, Sensor};
use luxproof_model::MeterId;

const FLUX_UP: Law = Law {
    id: "flux_up",
    what: "tables scaled to a largest intensity: illuminance in proportion",
    unit: "cd",
    magnitudes: &[1e4, 1e6, 1e9, 1e12],
    light: Light::Either,
    variant: brightened,
};

/// In the order of reports.
pub(super) const LAWS: &[Law] = &[
    FLUX_UP,
    Law { id: "flux_down", magnitudes: &[1.0, 1e-3, 1e-6, 1e-9], ..FLUX_UP },
    Law {
        id: "dimming",
        what: "the factor on a luminaire's flux: illuminance in proportion",
        unit: "factor",
        magnitudes: &[1e-3, 1e-6, 1e-9],
        light: Light::Either,
        variant: |job, factor| {
            let mut job = job.clone();
            job.scene.luminaires.iter_mut().for_each(|l| l.flux_scale *= factor);
            Some(Variant { job, against: Against::Base(factor) })
        },
    },
    Law {
        id: "superposition",
        what: "several luminaires: the sum of what each gives alone",
        unit: "luminaires",
        magnitudes: &[2.0, 4.0],
        light: Light::Either,
        variant: superposed,
    },
    Law {
        id: "mixed_luminaires",
        what: "a point and openings of every shape, up and down, wide and narrow: the sum of what each gives alone",
        unit: "luminaires",
        magnitudes: &[2.0, 3.0, 6.0],
        light: Light::Either,
        variant: mixed,
    },
    Law {
        id: "many_luminaires",
        what: "the flux spread over many luminaires: inverse squares add up, and reflected light in a furnace is what the flux makes it",
        unit: "luminaires",
        magnitudes: &[1.0, 10.0, 100.0, 1000.0],
        light: Light::Either,
        variant: many,
    },
    Law {
        id: "fine_table",
        what: "the same table with more angles: the same light",
        unit: "deg",
        magnitudes: &[1.0, 0.1, 0.01],
        light: Light::Either,
        variant: refined,
    },
    Law {
        id: "needle_beam",
        what: "all flux in a narrow beam: inverse square on its axis, and reflected light in a furnace is what the flux makes it",
        unit: "deg",
        magnitudes: &[10.0, 1.0, 0.1, 0.01],
        light: Light::Either,
        variant: |job, width_deg| beam(job, [0.0, width_deg], 0.0),
    },
    Law {
        id: "one_gamma",
        what: "all flux at one angle from the nadir: inverse square there, and reflected light in a furnace is what the flux makes it",
        unit: "deg",
        magnitudes: &[10.0, 1.0, 0.1, 1e-3],
        light: Light::Either,
        variant: |job, width_deg| beam(job, [37.0, 37.0 + width_deg], 37.0 + 0.5 * width_deg),
    },
    Law {
        id: "dark",
        what: "luminaires of 0 lm: 0 lx",
        unit: "lm",
        magnitudes: &[0.0],
        light: Light::Either,
        variant: |job, _| {
            let mut job = job.clone();
            retable(&mut job, |table| Some(table.scaled(0.0)))?;
            let against = Against::Known(vec![0.0; job.sensors.len()]);
            Some(Variant { job, against })
        },
    },
    Law {
        id: "seeds",
        what: "another seed: the same light within the standard errors stated",
        unit: "seed",
        magnitudes: &[2.0, 3.0, 4.0, 5.0],
        light: Light::Reflected,
        // The seed of a magnitude is set where it is read.
        variant: |job, _| Some(Variant { job: job.clone(), against: Against::Base(1.0) }),
    },
];

fn retable(
    job: &mut Job,
    table: impl Fn(&LuminousIntensityDistribution) -> Option<LuminousIntensityDistribution>,
) -> Option<()> {
    for luminaire in &mut job.scene.luminaires {
        let distribution = table(&luminaire.photometry.distribution)?;
        luminaire.photometry = Arc::new(luminaire.photometry.with_distribution(distribution));
    }
    Some(())
}

fn brightened(job: &Job, peak_cd: f64) -> Option<Variant> {
    let peaks_cd = job.scene.luminaires.iter().map(|l| l.photometry.distribution.max_intensity().value());
    let brightest_cd = peaks_cd.fold(0.0, f64::max);
    let factor = peak_cd / brightest_cd;
    let mut job = job.clone();
    retable(&mut job, |table| Some(table.scaled(factor)))?;
    (brightest_cd > 0.0).then_some(Variant { job, against: Against::Base(factor) })
}

fn superposed(job: &Job, count: f64) -> Option<Variant> {
    let count = count as usize;
    let mut all = job.clone();
    if all.scene.luminaires.len() > 1 {
        if count > all.scene.luminaires.len() {
            return None;
        }
        all.scene.luminaires.truncate(count);
    } else {
        let only = all.scene.luminaires.first()?.clone();
        all.scene.luminaires = (0..count).map(|k| aside(&only, job, k)).collect::<Option<_>>()?;
    }
    Some(against_each(all))
}

/// A job against the sum of what each of its luminaires gives.
fn against_each(job: Job) -> Variant {
    let luminaires = job.scene.luminaires.iter();
    let jobs = luminaires.map(|l| {
        let mut one = job.clone();
        one.scene.luminaires = vec![l.clone()];
        one
    });
    let against = Against::Sum(jobs.collect());
    Variant { job, against }
}

/// The first luminaire and others of as many shapes, each with its own beam.
fn mixed(job: &Job, count: f64) -> Option<Variant> {
    let mut all = job.clone();
    let first = job.scene.luminaires.first()?;
    let flux_lm = first.photometry.distribution.flux().value() * first.flux_scale;
    let others = (1..count as usize).map(|k| {
        let shape = SHAPES.get(k.checked_sub(1)?)?;
        let (up, power) = (k % 2 == 1, [2, 60, 8][k % 3]);
        let photometry = Photometry { opening: shape.opening, ..Photometry::of(lobe(up, power, flux_lm)?) };
        let orientation = orientation(50.0 * k as f64, 15.0, 0.0);
        let luminaire = aside(first, job, k)?;
        Some(Luminaire {
            photometry: Arc::new(photometry),
            orientation,
            flux_scale: 1.0,
            model: shape.model,
            ..luminaire
        })
    });
    let others = others.collect::<Option<Vec<_>>>()?;
    all.scene.luminaires = std::iter::once(first.clone()).chain(others).collect();
    Some(against_each(all))
}

/// A luminous opening and how it is modelled.
struct Shape {
    opening: LuminousOpening,
    model: LuminaireModel,
}

const fn area(opening: LuminousOpening) -> Shape {
    Shape { opening, model: LuminaireModel::Area }
}

const SHAPES: [Shape; 5] = [
    Shape { opening: LuminousOpening::Point, model: LuminaireModel::Point },
    area(LuminousOpening::Box { x_m: 0.3, y_m: 0.2, height_m: 0.0 }),
    area(LuminousOpening::Ellipse { x_m: 0.24, y_m: 0.14, height_m: 0.2 }),
    area(LuminousOpening::Ellipsoid { x_m: 0.2, y_m: 0.2, z_m: 0.3 }),
    area(LuminousOpening::LyingCylinder { axis: HorizontalAxis::X, length_m: 0.4, diameter_m: 0.1 }),
];

/// A beam of a power of a cosine about the nadir or the zenith, of so much flux.
fn lobe(up: bool, power: i32, flux_lm: f64) -> Option<LuminousIntensityDistribution> {
    let gamma_deg: Vec<f64> = (0..=180).map(f64::from).collect();
    let sign = if up { -1.0 } else { 1.0 };
    let candela = gamma_deg.iter().map(|gamma| (sign * gamma.to_radians().cos()).max(0.0).powi(power)).collect();
    let unit = LuminousIntensityDistribution::axial(gamma_deg, candela).ok()?;
    let factor = flux_lm / unit.flux().value();
    Some(unit.scaled(factor))
}

/// The `k`-th of several copies of a luminaire, spread over the room at about its height.
fn aside(luminaire: &Luminaire, job: &Job, k: usize) -> Option<Luminaire> {
    let size_m = job.scene.room?.size_m;
    let step = k as f64 * DVec3::new(0.233, 0.171, 0.029);
    // Back and forth between a tenth and nine tenths of the room.
    let part = (luminaire.position_m / size_m + step).to_array();
    let folded = part.map(|x| 0.9 - 0.8 * (((x - 0.1) / 0.8).rem_euclid(2.0) - 1.0).abs());
    let position_m = if k == 0 { luminaire.position_m } else { size_m * DVec3::from(folded) };
    Some(Luminaire { id: format!("{}_{k}", luminaire.id), position_m, ..luminaire.clone() })
}

fn many(job: &Job, count: f64) -> Option<Variant> {
    let (room, count) = (job.scene.room?, count as usize);
    let mut job = job.clone();
    let mut first = job.scene.luminaires.first()?.clone();
    first.model = LuminaireModel::Point;
    first.flux_scale /= count as f64;
    let columns = (count as f64).sqrt().ceil() as usize;
    let rows = count.div_ceil(columns);
    let height = (first.position_m.z / room.size_m.z).clamp(0.05, 0.95);
    let copies = (0..count).map(|k| {
        let [x, y] =
            [(k % columns, columns), (k / columns, rows)].map(|(k, n)| 0.15 + 0.7 * (k as f64 + 0.5) / n as f64);
        let position_m = room.size_m * DVec3::new(x, y, height);
        Luminaire { id: format!("{}_{k}", first.id), position_m, ..first.clone() }
    });
    job.scene.luminaires = copies.collect();
    job.scene.obstacles.clear();
    if job.transport == Transport::Direct { known_direct(job) } else { furnace(job, 0.5) }
}

fn refined(job: &Job, step_deg: f64) -> Option<Variant> {
    let mut job = job.clone();
    retable(&mut job, |table| {
        let (first, last) = (table.gamma_deg()[0], *table.gamma_deg().last()?);
        let steps = ((last - first) / step_deg).round() as usize;
        let even = (0..steps).map(|k| first + k as f64 * step_deg);
        // Nodes that differ by rounding alone are one.
        let mut nodes: Vec<f64> = vec![];
        for gamma in even.chain(table.gamma_deg().iter().copied()).sorted_by(f64::total_cmp) {
            let known = table.gamma_deg().contains(&gamma);
            match nodes.last_mut() {
                Some(near) if gamma - *near < 1e-6 * step_deg => *near = if known { gamma } else { *near },
                _ => nodes.push(gamma),
            }
        }
        Some(table.resampled(table.c_deg().to_vec(), nodes).ok()?.distribution)
    })?;
    Some(Variant { job, against: Against::Base(1.0) })
}

/// One luminaire with the flux that there was, between two angles, aimed as the table is: at the nadir.
fn beam(job: &Job, [from_deg, to_deg]: [f64; 2], towards_deg: f64) -> Option<Variant> {
    let flux_lm: f64 =
        job.scene.luminaires.iter().map(|l| l.photometry.distribution.flux().value() * l.flux_scale).sum();
    let unit = LuminousIntensityDistribution::axial(vec![from_deg, to_deg], vec![1.0, 1.0]).ok()?;
    let factor = flux_lm / unit.flux().value();
    let mut job = job.clone();
    let room = job.scene.room?;
    let mut one = job.scene.luminaires.first()?.clone();
    one.photometry = Arc::new(Photometry::of(unit.scaled(factor)));
    one.orientation = DMat3::IDENTITY;
    one.flux_scale = 1.0;
    one.model = LuminaireModel::Point;
    job.scene.obstacles.clear();
    job.scene.luminaires = vec![one.clone()];
    if job.transport != Transport::Direct {
        return furnace(job, 0.5);
    }
    // On its way to the floor, or to a wall, whichever is nearer.
    let path = direction(20.0, towards_deg);
    let reach_m = 0.5 * one.position_m.min(room.size_m - one.position_m).min_element();
    let meter = Meter { position_m: one.position_m + reach_m * path, normal: -path };
    job.sensors = vec![Sensor { id: MeterId::new("beam", 0), meter }];
    known_direct(job)
}
