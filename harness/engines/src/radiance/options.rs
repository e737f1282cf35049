//! The arguments of rtrace for each preset.

use luxproof_scene::Bounces;

use super::grazing;
use super::route::{Route, route};
use super::settings::Settings;
use crate::Job;
use crate::settings::Preset;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Options {
    pub(super) direct: Vec<String>,
    pub(super) total: Vec<String>,
    /// Direct light just as it is part of `total`: the difference is reflected light, free of the noise of the direct. Openings' scenes of
    /// reflected light have no such part.
    pub(super) part_of_total: Option<Vec<String>>,
}

/// Ambient divisions of a block where nothing else is known.
pub(super) const AUDIT_DIVISIONS: u32 = 16384;
pub(super) const FAST_DIVISIONS: u32 = 1024;

/// What is left of the light after the last bounce of a converged run, relative, where the limit on bounces allows.
const REMAINDER: f64 = 1e-7;
/// Bounces beyond which rtrace's recursion comes near the end of an 8 MiB stack.
const MAX_BOUNCES: u32 = 10_000;
/// Bounces of `preset: default` where all are asked for: rtrace's own default is none, and its default cache takes a few
/// seconds a meter with two (case S1), 20 with three.
const DEFAULT_BOUNCES: u32 = 2;

/// What a block of reflected light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ambient {
    pub(super) divisions: u32,
    /// Weight below which rays are at risk, in units of the weight of one division's ray.
    pub(super) risk: f64,
}

impl Ambient {
    /// The error at a given time is least near .1 to .2 where what divisions see first is even (case S1: 8e-6 s against 11e-6 at .5 and 2e-5
    /// at .01); at .8 rtrace would cut the divisions.
    pub(super) const LOW_RISK: f64 = 0.15;
    /// Where it is uneven most of the noise is that of the divisions, and rays behind them are better spared (benchmarks/efficiency.md).
    pub(super) const HIGH_RISK: f64 = 1.0;
}

/// Size of a part of an opening to its distance, as a ray that is reflected once sees it: rtrace divides the ratio that it is given by a ray's weight
/// (`flatpart` of its srcsamp.c). Error at a given time, squared: under a panel beside a wall a tenth of that without parts or less, elsewhere
/// the same; at .2 it is up to ten times as much again.
const SEEN_RATIO: f64 = 1.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sources {
    /// One sample to the centre: exact for points.
    Points,
    /// Samples over the parts of an opening, jittered, unbiased and read in blocks. In the middle of each part reflected light would be that of
    /// a point, off by 2 % under a panel of .6 m and by half near a wall: there an opening is mostly one part (see `SEEN_RATIO`).
    Openings,
    /// ies2rad's surfaces with rtrace's default subdivision, as they are used and were published.
    Ies2rad,
}

impl Sources {
    pub(super) fn of(job: &Job, settings: &Settings) -> Self {
        let mut routes = job.scene.luminaires.iter().map(|l| route(l, settings));
        if routes.clone().any(|route| route == Route::Opening) {
            Self::Openings
        } else if routes.any(Route::is_ies2rad) {
            Self::Ies2rad
        } else {
            Self::Points
        }
    }

    /// Arguments for direct light alone.
    pub(super) fn direct(self, ratio: f64) -> Vec<String> {
        let random = if self == Self::Openings { "-u+ " } else { "" };
        words(&format!("-I -ab 0 {random}{}", self.options(ratio)))
    }

    /// Options of rtrace, where openings are divided to a ratio at rays of weight 1. Every shadow is tested.
    fn options(self, ratio: f64) -> String {
        match self {
            Self::Points => "-ds 0 -dj 0 -dt 0 -dc 1".to_owned(),
            Self::Openings => format!("-ds {ratio} -dj 1 -dt 0 -dc 1"),
            Self::Ies2rad => "-ds 0.2 -dj 0 -dt 0 -dc 1".to_owned(),
        }
    }
}

fn words(text: &str) -> Vec<String> {
    text.split(' ').map(str::to_owned).collect()
}

impl Options {
    pub(super) fn of(job: &Job, settings: &Settings, ambient: Ambient) -> Self {
        let total = Self::total(job, settings, ambient);
        let sources = Sources::of(job, settings);
        let has_part = sources != Sources::Openings;
        // -I: irradiance at points.
        if settings.preset == Preset::Default {
            let direct = words("-I -ab 0");
            return Self { part_of_total: has_part.then(|| direct.clone()), direct, total };
        }
        Self {
            direct: sources.direct(grazing::ratio_of_all(job, settings)),
            total,
            part_of_total: has_part.then(|| words(&format!("-I -ab 0 {}", sources.options(0.0)))),
        }
    }

    /// Arguments for all light.
    pub(super) fn total(job: &Job, settings: &Settings, ambient: Ambient) -> Vec<String> {
        if settings.preset == Preset::Default {
            let bounces = match job.reflections() {
                Some(Bounces::AtMost(n)) => n,
                Some(Bounces::Converged) => DEFAULT_BOUNCES,
                None => 0,
            };
            return words(&format!("-I -ab {bounces}"));
        }
        // -u+: random numbers proper, since the fixed sequence of -u- repeats a bias of .3 % in every block (case S1,
        // up to 7 standard errors of 120 blocks). -aa 0: no cache; -as 0: no supersampling, which is biased;
        // -lr 0: Russian roulette below weight -lw.
        let Ambient { divisions, risk } = ambient;
        let ambient = format!("-u+ -aa 0 -ad {divisions} -as 0 -lr 0 -lw {:e}", risk / f64::from(divisions));
        let sources = Sources::of(job, settings).options(SEEN_RATIO / f64::from(divisions));
        words(&format!("-I -ab {} {sources} {ambient}", bounces(job)))
    }
}

/// `-ab`: how many bounces are followed.
pub(super) fn bounces(job: &Job) -> u32 {
    match job.reflections() {
        None => 0,
        Some(Bounces::AtMost(n)) => n,
        Some(Bounces::Converged) => {
            let rho = job.scene.largest_reflectance();
            let enough = if rho < 1.0 { (REMAINDER.ln() / rho.ln()).ceil() } else { f64::INFINITY };
            (enough.min(f64::from(MAX_BOUNCES)) as u32).max(1)
        }
    }
}

/// The largest part of the light that a converged run can miss for the limit on bounces.
pub(super) fn remainder(job: &Job) -> f64 {
    match job.reflections() {
        Some(Bounces::Converged) => job.scene.largest_reflectance().powi(bounces(job) as i32),
        _ => 0.0,
    }
}
