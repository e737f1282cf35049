//! Ladders of effort: what an engine is asked for, rung by rung.

use luminaire::scene::Transport;

use super::Settings;
use crate::engines::{Engine, Job, Measurement};
use crate::record::EngineName;
use crate::spec::Budget;

pub(super) struct Rung {
    pub(super) preset: String,
    /// Seconds of budget, or one over the relative error asked for.
    pub(super) effort: f64,
    pub(super) budget: Budget,
    /// A setting on top of the spec's.
    pub(super) setting: Option<(&'static str, serde_json::Value)>,
    pub(super) is_timed: bool,
}

/// Relative errors asked of the simulator.
const EMPTY: [f64; 5] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5];
const FURNISHED: [f64; 4] = [1e-1, 1e-2, 5e-3, 2e-3];
/// Never met: the time decides.
const UNREACHED: f64 = 1e-9;

pub(super) fn ladder(engine: &dyn Engine, job: &Job, furnished: bool, own: &Settings, seconds: &[f64]) -> Vec<Rung> {
    let plain = |preset: &str, seconds: f64| Rung {
        preset: preset.to_owned(),
        effort: seconds,
        budget: Budget { relative_error: UNREACHED, seconds },
        setting: (!preset.is_empty()).then(|| ("preset", preset.into())),
        is_timed: true,
    };
    if engine.name() == EngineName::SIMULATOR {
        let errors: &[f64] = if furnished { &FURNISHED } else { &EMPTY };
        let rung = |&relative_error: &f64| Rung {
            preset: String::new(),
            effort: 1.0 / relative_error,
            budget: Budget { relative_error, seconds: 60.0 },
            setting: Some(("relative_error", relative_error.into())),
            is_timed: false,
        };
        return errors.iter().map(rung).collect();
    }
    let sampled = job.transport != Transport::Direct && engine.name() != EngineName::IESNA;
    let longest = seconds.iter().copied().fold(0.0, f64::max);
    let presets = engine.knobs().iter().find(|k| k.key == "preset").map_or(&[][..], |k| k.values);
    // A spec that chooses a preset gets that one.
    let presets = if own.contains_key("preset") { &[][..] } else { presets };
    let mut rungs: Vec<Rung> = vec![];
    let first = presets.first().copied().unwrap_or("");
    if sampled {
        rungs.extend(seconds.iter().map(|s| plain(first, *s)));
    } else {
        rungs.push(plain(first, longest.min(2.0)));
    }
    rungs.extend(presets.iter().skip(1).map(|p| plain(p, longest)));
    rungs
}

impl Rung {
    /// Tenths of the seconds that it is expected to take.
    pub(super) fn expected_steps(&self) -> u64 {
        (10.0 * if self.is_timed { self.budget.seconds.max(0.5) } else { 0.5 }).ceil() as u64
    }

    pub(super) fn settings(&self, own: &Settings) -> Settings {
        let mut settings = own.clone();
        if let Some((key, value)) = &self.setting {
            settings.insert((*key).to_owned(), value.clone());
        }
        settings
    }
}

/// What solved it, as the engine says: the first words of its solver, or its method or variant.
pub(super) fn solver(measurement: &Measurement) -> String {
    let said = ["solver", "method", "variant"].into_iter().find_map(|key| measurement.method.get(key));
    let text = said.map_or("", String::as_str);
    text.split([',', ':']).next().unwrap_or_default().trim().to_owned()
}
