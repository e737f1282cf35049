//! POV-Ray 3.7: meters are discs seen by a mesh camera, and radiosity comes in independent blocks of a turned scene.
//!
//! Direct light is exact to POV-Ray's float colours. Radiosity interpolates a cache of irradiance (Ward, Rubinstein & Clear,
//! SIGGRAPH 1988) and is deterministic. So each block turns the whole scene by another rotation and starts elsewhere in the
//! sequence of sample directions. Other directions and other cache points follow, and the blocks' spread is a true standard error.
//!
//! The first reflection is read without the cache, which removes nine tenths of the variance. The report names the bias of
//! interpolating the later reflections, which all blocks share.

mod direct_error;
mod export;
mod frame;
mod opening;
mod pigment;
mod pixels;
mod runner;
mod settings;
mod shared_precompute;
mod work;

#[cfg(test)]
pub(super) mod tests;

use std::path::{Path, PathBuf};

use glam::DVec3;
use itertools::Itertools;
use luxproof_scene::geometry::Room;
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Transport};
use rayon::prelude::*;

use super::cost::DirectCost;
use super::effort;
use super::job_dir::by_hand;
use super::settings::{Coordinates, Preset};
use super::{
    Absent, Budget, Component, CpuUse, Engine, EngineError, EngineRoot, Entry, Job, JobDir, Measurement, SceneFile,
    Setting, Support, Version, checked,
};
use export::Light;
use luxproof_model::{EngineName, Estimate};
use luxproof_process::process;
use settings::Settings;

const ID: EngineName = EngineName::new("povray");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "POV-Ray",
    installs: &[Component::PovRay],
    is_on_request: false,
    models: &[LuminaireModel::Point, LuminaireModel::Area],
    fits_coordinates: Some("recentre"),
    make: || Box::new(PovRay),
};

pub(super) struct PovRay;

impl Engine for PovRay {
    fn name(&self) -> EngineName {
        ID
    }

    fn reads_meters_independently(&self) -> bool {
        true
    }

    fn probe(&self, site: &EngineRoot) -> Result<Version, Absent> {
        let program = runner::program(site).map_err(|e| absent(e.to_string()))?;
        let finished = process::ask(program.clone(), "--version", |invocation| runner::hermetic(invocation, site));
        let finished = finished.map_err(|e| absent(e.to_string()))?;
        let output = format!("{}\n{}", String::from_utf8_lossy(&finished.stdout), finished.stderr);
        let version = output.lines().find_map(|l| l.trim().strip_prefix("POV-Ray "));
        let version = version.and_then(|v| v.split_whitespace().next());
        let version = version.ok_or_else(|| absent("povray does not tell its version".to_owned()))?;
        Ok(Version::of(&ID, version, site, unpacked_libraries(site, &program).into_iter().chain([program.clone()])))
    }

    fn supports(&self, job: &Job) -> Support {
        support(job)
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        Ok(files(job, &Settings::of(job)?, direct_error::points(job)))
    }

    fn command_by_hand(&self, job: &Job, site: &EngineRoot) -> Option<String> {
        Settings::of(job).ok()?;
        let program = runner::program(site).unwrap_or_else(|_| "povray".into());
        let images: &[(Light, &str)] = match job.transport {
            Transport::Direct => &[(Light::Direct, "direct.ppm")],
            Transport::Indirect(_) => &[(Light::Indirect, "indirect.ppm")],
            Transport::Total(_) => &[(Light::Direct, "direct.ppm"), (Light::Indirect, "indirect.ppm")],
        };
        let commands = images.iter().map(|(light, image)| {
            let arguments = export::arguments(job, *light, 0, 0, image);
            runner::hermetic(by_hand(&program), site).args(arguments).command_line_with_env()
        });
        Some(commands.collect::<Vec<String>>().join("; "))
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 0.06, a_point: 1e-4, an_opening: Some(6e-4) }.of(job)
    }

    fn most_planes(&self) -> Option<usize> {
        Some(pigment::MAX_ENTRIES)
    }

    fn settings(&self) -> &'static [Setting] {
        settings::SETTINGS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job).map(drop)
    }

    fn cpu_use(&self, job: &Job) -> CpuUse {
        let is_short = self.expected_s(job).is_some_and(|seconds| seconds < runner::SLEEP_S);
        if is_short { CpuUse::Idle } else { CpuUse::Partial }
    }

    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        (threads * runner::side_by_side_at_most(job)) as u64 * runner::process_mib(job)
    }

    /// Shares the light that is reflected once and twice, if the job reads more reflections.
    fn shared_precompute(&self, job: &Job) -> Option<Job> {
        settings::own_term(&Settings::of(job).ok()?.terms(job.reflections()?))?;
        let (transport, budget) = (Transport::Indirect(Bounces::Converged), Budget { seconds: 0.0, ..job.budget });
        Some(Job { transport, budget, ..job.clone() })
    }

    fn read(&self, job: &Job, workbench: &JobDir) -> Result<Measurement, EngineError> {
        let (settings, points) = (Settings::of(job)?, direct_error::points(job));
        workbench.write(&files(job, &settings, points))?;
        let bench = runner::PovrayRunner::new(job, workbench, &settings, points)?;
        let measurement = match job.transport {
            Transport::Direct | Transport::Total(Bounces::AtMost(0)) => bench.direct()?,
            Transport::Indirect(Bounces::AtMost(0)) => darkness(job),
            Transport::Indirect(_) => bench.indirect()?,
            Transport::Total(_) => sum(&bench.direct()?, bench.indirect()?),
        };
        checked(&ID, job, measurement)
    }
}

/// Returns why POV-Ray cannot be used, with the remedy.
fn absent(reason: String) -> Absent {
    Absent { reason, remedy: "run `luxproof engines install`, or install the Debian package povray".to_owned() }
}

/// Returns the libraries that were unpacked together with the program.
///
/// The system's own libraries and Mitsuba's LLVM do not count, because POV-Ray's readings do not depend on them.
fn unpacked_libraries(site: &EngineRoot, program: &Path) -> Vec<PathBuf> {
    let (unpacked, llvm) = (site.debian(), site.libraries("libLLVM"));
    if !program.starts_with(&unpacked) {
        return vec![];
    }
    site.libraries("lib").into_iter().filter(|l| l.starts_with(&unpacked) && !llvm.contains(l)).collect()
}

/// Returns all files of an exported scene.
fn files(job: &Job, settings: &Settings, points: usize) -> Vec<SceneFile> {
    let ini = "; POV-Ray takes this file for the user's and the system's povray.ini, which could change settings.\n";
    vec![export::scene(job, settings, points), SceneFile::text("povray.ini", ini)]
}

fn darkness(job: &Job) -> Measurement {
    let notes = vec!["nothing that was never reflected is indirect: not rendered".to_owned()];
    Measurement { estimates: vec![Estimate::DARK; job.sensors.len()], notes, ..Measurement::default() }
}

fn sum(direct: &Measurement, mut indirect: Measurement) -> Measurement {
    for (total, part) in indirect.estimates.iter_mut().zip(&direct.estimates) {
        *total = total.plus(part);
    }
    for (key, value) in direct.effort.iter() {
        indirect.effort.entry(key.clone()).or_insert_with(|| value.clone());
    }
    indirect
}

fn support(job: &Job) -> Support {
    let objection = ENTRY
        .objection(job)
        .or_else(|| job.scene.luminaires.iter().find_map(unsupported_luminaire))
        .or_else(|| filters_in_the_way(job))
        .or_else(|| too_near(job))
        .or_else(|| frame::narrow(job));
    if let Some(why) = objection {
        return Support::No(why);
    }
    let Some(bounces) = job.reflections() else { return Support::Yes };
    let Some(room) = job.scene.room else {
        return Support::No("in free field nothing reflects: there is no room to gather light from".to_owned());
    };
    let preset = Settings::of(job).map_or(Preset::Audit, |s| s.preset);
    cache_error(&room, bounces, preset, settings::audit_recursion(job))
}

/// Returns the bias of radiosity's cache, measured against exact values, plus the light of reflections that are not followed.
fn cache_error(room: &Room, bounces: Bounces, preset: Preset, followed: u32) -> Support {
    let mean_reflectance = effort::mean_reflectance(room);
    let interpolation = match preset {
        Preset::Audit => audit_bias(mean_reflectance, settings::slenderness(room)),
        Preset::Default => 0.27,
        Preset::Fast => 0.05,
    };
    let cut = match bounces {
        Bounces::AtMost(n) if n <= settings::MAX_RECURSION => 0.0,
        _ => mean_reflectance.powi(followed as i32),
    };
    let mut why =
        "radiosity interpolates a cache of irradiance (Ward et al. 1988), whose bias all blocks share".to_owned();
    if cut > 1e-3 {
        why.push_str("; POV-Ray follows 20 reflections at most");
    }
    Support::Approximate { why, size: Some(interpolation + cut) }
}

/// Returns the bias of the audit preset: linear between measured mean reflectances, and larger in slender rooms.
fn audit_bias(mean_reflectance: f64, slenderness: f64) -> f64 {
    let compact_bias = if mean_reflectance <= BIAS[0].0 {
        BIAS[0].1
    } else if mean_reflectance <= BIAS[1].0 {
        interpolated(mean_reflectance, BIAS[0], BIAS[1])
    } else {
        interpolated(mean_reflectance, BIAS[1], BIAS[2]).min(BIAS[2].1)
    };
    compact_bias * (slenderness / settings::COMPACT).powf(1.3)
}

/// Returns the value at `at` of the straight line through two points.
fn interpolated(at: f64, (x, y): (f64, f64), (a, b): (f64, f64)) -> f64 {
    y + (b - y) * (at - x) / (a - x)
}

/// Mean reflectances and relative biases of compact rooms.
///
/// Measured: `cachet/point-all` within 0.1 %; the calibration's room +0.2 to +0.4 %, each within 0.1 %. Cubes of 6 m: +0.9 to
/// +1.1 % at three meters with 0.7 everywhere; +1 % with 0.9 everywhere, without the light that twenty reflections omit.
/// Slender rooms are in `docs/decisions/0016-povray-radiosity.md`.
const BIAS: [(f64, f64); 3] = [(settings::USUAL, 0.005), (0.7, 0.02), (0.9, 0.05)];

fn unsupported_luminaire(luminaire: &Luminaire) -> Option<String> {
    let id = &luminaire.id;
    let planes = luminaire.photometry.distribution.full_circle().c_deg().len();
    if planes > pigment::MAX_ENTRIES {
        return Some(format!("{id} has {planes} C planes; a map of POV-Ray holds {}", pigment::MAX_ENTRIES));
    }
    match luminaire.model {
        LuminaireModel::Area if opening::parts(luminaire.photometry.opening, 1).is_none() => {
            Some(format!("{id}: only flat luminous openings are modelled in POV-Ray"))
        }
        _ => None,
    }
}

/// Returns an objection if light of a luminaire passes another luminaire's filter on its way to a meter, which would absorb it.
fn filters_in_the_way(job: &Job) -> Option<String> {
    let coordinates = Settings::of(job).map_or(Coordinates::Fitted, |s| s.coordinates);
    let radius_m = 1.5 * opening::FILTER_RADIUS / frame::Frame::of(job, coordinates).scale;
    let lit: Vec<&Luminaire> = job.scene.luminaires.iter().filter(|l| frame::candela(l) > 0.0).collect();
    let places_m: Vec<DVec3> = lit.iter().map(|l| l.position_m).collect();
    if let Some((a, b)) = near_pair(&places_m, 2.0 * radius_m) {
        let (a, b) = (&lit[a].id, &lit[b].id);
        return Some(format!("{a} and {b} are at the same point, where POV-Ray would filter both by either"));
    }
    // The first meter with an objection gives it, so that the message does not depend on the order of threads.
    job.sensors.par_iter().find_map_first(|sensor| {
        let (id, position_m) = (&sensor.id, sensor.meter.position_m);
        if let Some(a) = places_m.iter().position(|p| p.distance(position_m) < 2.0 * radius_m) {
            return Some(format!("{id} is inside the filter of {}", lit[a].id));
        }
        let (a, b) = in_the_way(&places_m, position_m, radius_m)?;
        Some(format!("{} lies between {} and {id}, and would filter its light", lit[b].id, lit[a].id))
    })
}

/// A direction that is not parallel to the usual rows of luminaires. Sorting along it separates points that lie in rows.
const ASKEW: DVec3 = DVec3::new(0.532_117, 0.341_883, 0.774_597);

/// Sorts points along [`ASKEW`]; returns each one's position along it and its number.
fn sorted_along(points: impl Iterator<Item = DVec3>) -> Vec<(f64, usize)> {
    points.map(|p| p.dot(ASKEW)).zip(0..).sorted_by(|a, b| a.0.total_cmp(&b.0)).collect()
}

/// Returns the numbers of sorted points that lie within a distance of a position along [`ASKEW`].
fn about(sorted: &[(f64, usize)], along: f64, within: f64) -> impl Iterator<Item = usize> {
    let first = sorted.partition_point(|(other, _)| *other < along - within);
    sorted[first..].iter().take_while(move |(other, _)| *other <= along + within).map(|(_, number)| *number)
}

/// Finds two points that are nearer to each other than `within_m`.
fn near_pair(points: &[DVec3], within_m: f64) -> Option<(usize, usize)> {
    let sorted = sorted_along(points.iter().copied());
    sorted.iter().find_map(|(along, a)| {
        let mut candidates = about(&sorted, *along, within_m);
        let b = candidates.find(|b| b != a && points[*a].distance(points[*b]) < within_m)?;
        Some((*a.min(&b), *a.max(&b)))
    })
}

/// Straight ways of light from all lights to one place.
struct Ways<'a> {
    lights_m: &'a [DVec3],
    at_m: DVec3,
    /// Lights in the order of their directions from the place.
    sorted: Vec<(f64, usize)>,
}

impl<'a> Ways<'a> {
    fn of(lights_m: &'a [DVec3], at_m: DVec3) -> Self {
        Self { lights_m, at_m, sorted: sorted_along(lights_m.iter().map(|p| (p - at_m).normalize_or_zero())) }
    }

    /// Returns the lights with a way to the place that passes a point within `radius_m`.
    ///
    /// Seen from the place, they lie nearly in the point's direction, so only a few lights need a test.
    fn past(&self, point_m: DVec3, radius_m: f64) -> impl Iterator<Item = usize> {
        let away_m = point_m - self.at_m;
        // The sine of the angle between both directions is at most radius over distance, and twice the sine exceeds the chord
        // between them. If the point is nearer to the place than the radius, the limit exceeds every chord.
        let within = 2.0 * radius_m / away_m.length();
        about(&self.sorted, away_m.normalize_or_zero().dot(ASKEW), within)
            .filter(move |a| distance_to_segment(point_m, self.lights_m[*a], self.at_m) < radius_m)
    }
}

/// Finds a light and another one that the first one's way to a place passes within `radius_m`.
fn in_the_way(lights_m: &[DVec3], at_m: DVec3, radius_m: f64) -> Option<(usize, usize)> {
    let ways = Ways::of(lights_m, at_m);
    lights_m.iter().enumerate().find_map(|(b, light_m)| Some((ways.past(*light_m, radius_m).find(|a| *a != b)?, b)))
}

/// Returns an objection if a meter is so near an opening that its single point lights matter.
fn too_near(job: &Job) -> Option<String> {
    if matches!(job.transport, Transport::Indirect(_)) {
        return None;
    }
    opening::too_near(job, opening::MOST_POINTS)
}

/// Returns the distance of a point to the segment between two others.
fn distance_to_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = to - from;
    let t = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(from + t * along)
}

#[cfg(test)]
mod way_tests {
    use super::*;

    /// Returns a place in a grid below a ceiling, as luminaires usually hang, or anywhere in a cube.
    fn random_place(random: &mut fastrand::Rng, is_in_grid: bool) -> DVec3 {
        if is_in_grid {
            DVec3::new(f64::from(random.u8(0..9)), f64::from(random.u8(0..9)), 3.0)
        } else {
            DVec3::new(random.f64(), random.f64(), random.f64()) * 4.0
        }
    }

    /// Returns a place in a flat box, so that many lights lie near the ways of others.
    fn random_flat_place(random: &mut fastrand::Rng) -> DVec3 {
        DVec3::new(random.f64(), random.f64(), random.f64() * 0.1)
    }

    #[test]
    fn a_light_in_the_way_is_found_as_by_trying_all() {
        let mut random = fastrand::Rng::with_seed(7);
        let radius_m = 0.05;
        for round in 0..300 {
            let mut lights_m: Vec<DVec3> = vec![];
            for _ in 0..25 {
                let p = random_place(&mut random, round % 2 == 0);
                if lights_m.iter().all(|l| l.distance(p) >= 2.0 * radius_m) {
                    lights_m.push(p);
                }
            }
            assert_eq!(near_pair(&lights_m, 2.0 * radius_m), None);
            let at_m = random_place(&mut random, round % 2 == 0)
                + DVec3::new(0.0, 0.0, if round % 3 == 0 { 0.0 } else { -2.0 });
            if lights_m.iter().any(|l| l.distance(at_m) < 2.0 * radius_m) {
                continue;
            }
            let passes = |(a, b): (usize, usize)| distance_to_segment(lights_m[b], lights_m[a], at_m) < radius_m;
            let pairs = (0..lights_m.len()).cartesian_product(0..lights_m.len());
            let expected = pairs.filter(|(a, b)| a != b).any(passes);
            let found = in_the_way(&lights_m, at_m, radius_m);
            assert_eq!(found.is_some(), expected, "{lights_m:?} {at_m}");
            assert!(found.is_none_or(passes));
        }
        // The points are anywhere, at a light, and near the place itself.
        for _ in 0..300 {
            let lights_m: Vec<DVec3> = (0..40).map(|_| random_flat_place(&mut random)).collect();
            let (at_m, step) = (random_flat_place(&mut random), 0.6 * random_flat_place(&mut random));
            let ways = Ways::of(&lights_m, at_m);
            for point_m in
                [random_flat_place(&mut random), lights_m[3], at_m, at_m + radius_m * step, at_m - radius_m * step]
            {
                let mut found: Vec<usize> = ways.past(point_m, radius_m).collect();
                found.sort_unstable();
                let expected: Vec<usize> = (0..lights_m.len())
                    .filter(|k| distance_to_segment(point_m, lights_m[*k], at_m) < radius_m)
                    .collect();
                assert_eq!(found, expected, "{point_m} {at_m}");
            }
        }
        let pair = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y * 1e-3];
        assert_eq!(near_pair(&pair, 2e-3), Some((1, 2)));
    }
}
