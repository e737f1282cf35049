//! POV-Ray 3.7: meters as discs seen by a mesh camera, radiosity in independent blocks of a turned scene.
//!
//! Direct light is exact to its float colours. Radiosity interpolates a cache of irradiance (Ward, Rubinstein & Clear,
//! SIGGRAPH 1988), deterministically: each block turns the whole scene by another rotation and starts elsewhere in the
//! sequence of sample directions, which gives it other directions and other cache points, so that the blocks' spread is
//! an honest standard error of their mean. The first reflection is read without the cache, which takes nine tenths of the
//! variance away. What all blocks share, the bias of interpolating the later ones, is named beside the readings.

mod bench;
mod direct_error;
mod export;
mod frame;
mod ground;
mod opening;
mod pigment;
mod pixels;
mod settings;
mod work;

#[cfg(test)]
pub(super) mod tests;

use std::path::PathBuf;

use glam::DVec3;
use itertools::Itertools;
use luminaire::geometry::Room;
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Transport};
use rayon::prelude::*;

use super::cost::DirectCost;
use super::effort;
use super::settings::{Coordinates, Preset};
use super::workbench::by_hand;
use super::{
    Absent, Budget, Component, Engine, EngineError, Entry, Job, Knob, Measurement, SceneFile, Site, Station, Support,
    Version, Waits, Workbench, checked,
};
use crate::record::{EngineName, Estimate};
use crate::system::process;
use export::Light;
use settings::Settings;

const ID: EngineName = EngineName::new("povray");

pub(super) static ENTRY: Entry = Entry {
    name: ID,
    display_name: "POV-Ray",
    colour: ("#007a5a", "#3fc79d"),
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

    fn reads_meters_apart(&self) -> bool {
        true
    }

    fn probe(&self, site: &Site) -> Result<Version, Absent> {
        let remedy = || "run `luxproof engines install`, or install the Debian package povray".to_owned();
        let absent = |reason| Absent { reason, remedy: remedy() };
        let program = bench::program(site).map_err(|e| absent(e.to_string()))?;
        let done = process::ask(program.clone(), "--version", |asked| bench::hermetic(asked, site));
        let done = done.map_err(|e| absent(e.to_string()))?;
        let said = format!("{}\n{}", String::from_utf8_lossy(&done.stdout), done.stderr);
        let version = said.lines().find_map(|l| l.trim().strip_prefix("POV-Ray "));
        let version = version.and_then(|v| v.split_whitespace().next());
        let version = version.ok_or_else(|| absent("povray does not tell its version".to_owned()))?;
        // Unpacked with it; the system's own libraries are not asked, nor Mitsuba's.
        let (unpacked, llvm) = (site.debian(), site.libraries("libLLVM"));
        let is_its = |l: &PathBuf| program.starts_with(&unpacked) && l.starts_with(&unpacked) && !llvm.contains(l);
        let libraries = site.libraries("lib").into_iter().filter(is_its);
        Ok(Version::of(&ID, version, site, libraries.chain([program.clone()])))
    }

    fn supports(&self, job: &Job) -> Support {
        support(job)
    }

    fn export(&self, job: &Job) -> Result<Vec<SceneFile>, EngineError> {
        Ok(files(job, &Settings::of(job)?, direct_error::points(job)))
    }

    fn command_by_hand(&self, job: &Job, site: &Site) -> Option<String> {
        Settings::of(job).ok()?;
        let program = bench::program(site).unwrap_or_else(|_| "povray".into());
        let command = |light, image: &str| {
            let arguments = export::arguments(job, light, 0, 0, image);
            bench::hermetic(by_hand(&program), site).args(arguments).command_line_with_env()
        };
        Some(match job.transport {
            Transport::Direct => command(Light::Direct, "direct.ppm"),
            Transport::Indirect(_) => command(Light::Indirect, "indirect.ppm"),
            Transport::Total(_) => {
                [command(Light::Direct, "direct.ppm"), command(Light::Indirect, "indirect.ppm")].join("; ")
            }
        })
    }

    fn expected_s(&self, job: &Job) -> Option<f64> {
        DirectCost { start: 0.06, a_point: 1e-4, an_opening: Some(6e-4) }.of(job)
    }

    fn most_planes(&self) -> Option<usize> {
        Some(pigment::MAX_ENTRIES)
    }

    fn knobs(&self) -> &'static [Knob] {
        settings::KNOBS
    }

    fn check_settings(&self, job: &Job) -> Result<(), EngineError> {
        Settings::of(job).map(drop)
    }

    fn waits(&self, job: &Job) -> Waits {
        let is_short = self.expected_s(job).is_some_and(|seconds| seconds < bench::SLEEP_S);
        if is_short { Waits::Mostly } else { Waits::Often }
    }

    fn memory_mib(&self, job: &Job, threads: usize) -> u64 {
        (threads * bench::side_by_side_at_most(job)) as u64 * bench::process_mib(job)
    }

    /// What is reflected once and twice, where more is read.
    fn groundwork(&self, job: &Job) -> Option<Job> {
        settings::own_term(&Settings::of(job).ok()?.terms(job.reflections()?))?;
        let (transport, budget) = (Transport::Indirect(Bounces::Converged), Budget { seconds: 0.0, ..job.budget });
        Some(Job { transport, budget, ..job.clone() })
    }

    fn read(&self, job: &Job, workbench: &Workbench) -> Result<Measurement, EngineError> {
        let (settings, points) = (Settings::of(job)?, direct_error::points(job));
        workbench.write(&files(job, &settings, points))?;
        let bench = bench::Bench::new(job, workbench, &settings, points)?;
        let measurement = match job.transport {
            Transport::Direct | Transport::Total(Bounces::AtMost(0)) => bench.direct()?,
            Transport::Indirect(Bounces::AtMost(0)) => darkness(job),
            Transport::Indirect(_) => bench.indirect()?,
            Transport::Total(_) => sum(&bench.direct()?, bench.indirect()?),
        };
        checked(&ID, job, measurement)
    }
}

fn files(job: &Job, settings: &Settings, points: usize) -> Vec<SceneFile> {
    let ini = "; POV-Ray takes this file for the user's and the system's povray.ini, which could change settings.\n";
    vec![export::scene(job, settings, points), SceneFile::text("povray.ini", ini)]
}

fn darkness(job: &Job) -> Measurement {
    let notes = vec!["nothing that was never reflected is indirect: not rendered".to_owned()];
    Measurement { estimates: vec![Estimate::DARK; job.stations.len()], notes, ..Measurement::default() }
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
    let unsupported = || job.scene.luminaires.iter().find_map(unsupported_luminaire);
    let objection = ENTRY.objection(job).or_else(unsupported);
    if let Some(why) =
        objection.or_else(|| filters_in_the_way(job)).or_else(|| too_near(job)).or_else(|| frame::narrow(job))
    {
        return Support::No(why);
    }
    let Some(bounces) = job.reflections() else { return Support::Yes };
    let Some(room) = job.scene.room else {
        return Support::No("in free field nothing reflects: there is no room to gather light from".to_owned());
    };
    let preset = Settings::of(job).map_or(Preset::Audit, |s| s.preset);
    cache_error(&room, bounces, preset, settings::audit_recursion(job))
}

/// The bias of radiosity's cache, as measured against exact values, and what so many reflections leave out.
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

/// Bias of the audit preset by mean reflectance, linear between what was measured, and by how slender the room is.
fn audit_bias(mean_reflectance: f64, slenderness: f64) -> f64 {
    let between = |(x, y): (f64, f64), (a, b): (f64, f64)| y + (b - y) * (mean_reflectance - x) / (a - x);
    let of_reflectance = if mean_reflectance <= BIAS[0].0 {
        BIAS[0].1
    } else if mean_reflectance <= BIAS[1].0 {
        between(BIAS[0], BIAS[1])
    } else {
        between(BIAS[1], BIAS[2]).min(BIAS[2].1)
    };
    of_reflectance * (slenderness / settings::COMPACT).powf(1.3)
}

/// Mean reflectances and biases of compact rooms, relative: `cachet/point-all` within .1 % and the calibration's room +.2 to +.4 %, each within
/// .1 %; cubes of 6 m, .7 everywhere +.9 to +1.1 % at three meters, .9 everywhere +1 % beside what twenty reflections leave out. Slender
/// rooms are in `benchmarks/engines-remarks.md`.
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

/// A luminaire's filter dims whatever passes through it: another luminaire's light towards a meter must not.
fn filters_in_the_way(job: &Job) -> Option<String> {
    let coordinates = Settings::of(job).map_or(Coordinates::Fitted, |s| s.coordinates);
    let radius_m = 1.5 * opening::FILTER_RADIUS / frame::Frame::of(job, coordinates).scale;
    let lit: Vec<&Luminaire> = job.scene.luminaires.iter().filter(|l| frame::candela(l) > 0.0).collect();
    let places_m: Vec<DVec3> = lit.iter().map(|l| l.position_m).collect();
    if let Some((a, b)) = near_pair(&places_m, 2.0 * radius_m) {
        let (a, b) = (&lit[a].id, &lit[b].id);
        return Some(format!("{a} and {b} are at the same point, where POV-Ray would filter both by either"));
    }
    let inside =
        |station: &&Station| places_m.iter().position(|p| p.distance(station.meter.position_m) < 2.0 * radius_m);
    // One objection is enough; the first meter that has one tells it, whoever finds it.
    job.stations.par_iter().find_map_first(|station| {
        let id = &station.id;
        if let Some(a) = inside(&station) {
            return Some(format!("{id} is inside the filter of {}", lit[a].id));
        }
        let (a, b) = in_the_way(&places_m, station.meter.position_m, radius_m)?;
        Some(format!("{} lies between {} and {id}, and would filter its light", lit[b].id, lit[a].id))
    })
}

/// A direction along which hardly any two of the points that people choose lie level, so that sorting by it parts them.
const ASKEW: DVec3 = DVec3::new(0.532_117, 0.341_883, 0.774_597);

/// Numbers of points in order along [`ASKEW`], each with how far it lies along it.
fn sorted_along(points: impl Iterator<Item = DVec3>) -> Vec<(f64, usize)> {
    points.map(|p| p.dot(ASKEW)).zip(0..).sorted_by(|a, b| a.0.total_cmp(&b.0)).collect()
}

/// Numbers of those that lie no further from a place along [`ASKEW`] than so much.
fn about(sorted: &[(f64, usize)], along: f64, within: f64) -> impl Iterator<Item = usize> {
    let first = sorted.partition_point(|(other, _)| *other < along - within);
    sorted[first..].iter().take_while(move |(other, _)| *other <= along + within).map(|(_, number)| *number)
}

/// Two points that are nearer to each other than this.
fn near_pair(points: &[DVec3], within_m: f64) -> Option<(usize, usize)> {
    let sorted = sorted_along(points.iter().copied());
    let near = |(along, a): &(f64, usize)| {
        let is_near = |b: &usize| b != a && points[*a].distance(points[*b]) < within_m;
        let b = about(&sorted, *along, within_m).find(is_near)?;
        Some((*a.min(&b), *a.max(&b)))
    };
    sorted.iter().find_map(near)
}

/// Lights as they are seen from a place.
struct Ways<'a> {
    lights_m: &'a [DVec3],
    at_m: DVec3,
    /// By their directions.
    sorted: Vec<(f64, usize)>,
}

impl<'a> Ways<'a> {
    fn of(lights_m: &'a [DVec3], at_m: DVec3) -> Self {
        Self { lights_m, at_m, sorted: sorted_along(lights_m.iter().map(|p| (p - at_m).normalize_or_zero())) }
    }

    /// The lights whose way to the place passes nearer to a point than this. Seen from there they are nearly in its direction, so that only
    /// few are looked at.
    fn past(&self, point_m: DVec3, radius_m: f64) -> impl Iterator<Item = usize> {
        let away_m = point_m - self.at_m;
        // The directions are a chord apart whose angle has this sine at most, half of one; twice the sine is more than the chord. Of a point
        // that is as near to the place as this, it is more than any chord.
        let within = 2.0 * radius_m / away_m.length();
        about(&self.sorted, away_m.normalize_or_zero().dot(ASKEW), within)
            .filter(move |a| distance_to_segment(point_m, self.lights_m[*a], self.at_m) < radius_m)
    }
}

/// A light, and another one that its way to a place passes nearer than this.
fn in_the_way(lights_m: &[DVec3], at_m: DVec3, radius_m: f64) -> Option<(usize, usize)> {
    let ways = Ways::of(lights_m, at_m);
    let found = |(b, light_m): (usize, &DVec3)| Some((ways.past(*light_m, radius_m).find(|a| *a != b)?, b));
    lights_m.iter().enumerate().find_map(found)
}

/// A meter so near an opening that it tells the opening's point lights apart.
fn too_near(job: &Job) -> Option<String> {
    let is_read = !matches!(job.transport, Transport::Indirect(_));
    is_read.then(|| opening::too_near(job, opening::MOST_POINTS)).flatten()
}

fn distance_to_segment(point: DVec3, from: DVec3, to: DVec3) -> f64 {
    let along = to - from;
    let t = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(from + t * along)
}

#[cfg(test)]
mod way_tests {
    use super::*;

    #[test]
    fn a_light_in_the_way_is_found_as_by_trying_all() {
        let mut random = fastrand::Rng::with_seed(7);
        let radius_m = 0.05;
        for round in 0..300 {
            // In rows, as people hang them, and anywhere.
            let place = |random: &mut fastrand::Rng| match round % 2 {
                0 => DVec3::new(f64::from(random.u8(0..9)), f64::from(random.u8(0..9)), 3.0),
                _ => DVec3::new(random.f64(), random.f64(), random.f64()) * 4.0,
            };
            let mut lights_m: Vec<DVec3> = vec![];
            for _ in 0..25 {
                let p = place(&mut random);
                if lights_m.iter().all(|l| l.distance(p) >= 2.0 * radius_m) {
                    lights_m.push(p);
                }
            }
            assert_eq!(near_pair(&lights_m, 2.0 * radius_m), None);
            let at_m = place(&mut random) + DVec3::new(0.0, 0.0, if round % 3 == 0 { 0.0 } else { -2.0 });
            if lights_m.iter().any(|l| l.distance(at_m) < 2.0 * radius_m) {
                continue;
            }
            let all = || (0..lights_m.len()).flat_map(|a| (0..lights_m.len()).map(move |b| (a, b)));
            let passes = |(a, b): (usize, usize)| distance_to_segment(lights_m[b], lights_m[a], at_m) < radius_m;
            let expected = all().any(|(a, b)| a != b && passes((a, b)));
            let found = in_the_way(&lights_m, at_m, radius_m);
            assert_eq!(found.is_some(), expected, "{lights_m:?} {at_m}");
            assert!(found.is_none_or(passes));
        }
        // Of points anywhere, at a light and about the place itself, too.
        for _ in 0..300 {
            let mut place = || DVec3::new(random.f64(), random.f64(), random.f64() * 0.1);
            let lights_m: Vec<DVec3> = (0..40).map(|_| place()).collect();
            let (at_m, step) = (place(), 0.6 * place());
            let ways = Ways::of(&lights_m, at_m);
            for point_m in [place(), lights_m[3], at_m, at_m + radius_m * step, at_m - radius_m * step] {
                let mut found: Vec<usize> = ways.past(point_m, radius_m).collect();
                found.sort_unstable();
                let passes = |k: &usize| distance_to_segment(point_m, lights_m[*k], at_m) < radius_m;
                assert_eq!(found, (0..lights_m.len()).filter(passes).collect::<Vec<_>>(), "{point_m} {at_m}");
            }
        }
        let pair = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y * 1e-3];
        assert_eq!(near_pair(&pair, 2e-3), Some((1, 2)));
    }
}
