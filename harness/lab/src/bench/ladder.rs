//! Ladders of effort: the budgets and settings that an engine is measured with.

use luxproof_scene::Transport;

use super::Settings;
use luxproof_engines::{Engine, Job, Measurement};
use luxproof_model::EngineName;
use luxproof_spec::Budget;

/// One effort of an engine.
pub(super) struct Rung {
    pub(super) preset: String,
    /// The budget in seconds, or one over the requested relative error.
    pub(super) effort: f64,
    pub(super) budget: Budget,
    /// A setting in addition to those of the spec.
    pub(super) setting: Option<(&'static str, serde_json::Value)>,
    pub(super) is_timed: bool,
}

/// The relative errors that the simulator is asked for.
const EMPTY_ERRORS: [f64; 5] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5];
const FURNISHED_ERRORS: [f64; 4] = [1e-1, 1e-2, 5e-3, 2e-3];
/// A relative error that no renderer reaches, so that the time decides.
const UNREACHED_ERROR: f64 = 1e-9;

/// A rung with a time budget, and with a preset where that is not empty.
fn timed_rung(preset: &str, seconds: f64) -> Rung {
    Rung {
        preset: preset.to_owned(),
        effort: seconds,
        budget: Budget { relative_error: UNREACHED_ERROR, seconds },
        setting: (!preset.is_empty()).then(|| ("preset", preset.into())),
        is_timed: true,
    }
}

/// A rung with a relative error.
fn error_rung(relative_error: f64) -> Rung {
    Rung {
        preset: String::new(),
        effort: 1.0 / relative_error,
        budget: Budget { relative_error, seconds: 60.0 },
        setting: Some(("relative_error", relative_error.into())),
        is_timed: false,
    }
}

/// Makes the ladder of an engine in a job: errors for the simulator, seconds and presets for
/// renderers.
pub(super) fn make_ladder(
    engine: &dyn Engine,
    job: &Job,
    is_furnished: bool,
    settings: &Settings,
    seconds: &[f64],
) -> Vec<Rung> {
    if engine.name() == EngineName::SIMULATOR {
        let errors: &[f64] = if is_furnished { &FURNISHED_ERRORS } else { &EMPTY_ERRORS };
        return errors.iter().map(|error| error_rung(*error)).collect();
    }
    let is_sampled = job.transport != Transport::Direct && engine.name() != EngineName::IESNA;
    let longest = seconds.iter().copied().fold(0.0, f64::max);
    let presets = engine.settings().iter().find(|k| k.key == "preset").map_or(&[][..], |k| k.values);
    // A spec that chooses a preset is measured with it only.
    let presets = if settings.contains_key("preset") { &[][..] } else { presets };
    let mut rungs: Vec<Rung> = vec![];
    let first = presets.first().copied().unwrap_or("");
    if is_sampled {
        rungs.extend(seconds.iter().map(|s| timed_rung(first, *s)));
    } else {
        rungs.push(timed_rung(first, longest.min(2.0)));
    }
    rungs.extend(presets.iter().skip(1).map(|p| timed_rung(p, longest)));
    rungs
}

impl Rung {
    /// The expected time in tenths of a second.
    pub(super) fn expected_steps(&self) -> u64 {
        (10.0 * if self.is_timed { self.budget.seconds.max(0.5) } else { 0.5 }).ceil() as u64
    }

    /// The settings of the spec with that of the rung.
    pub(super) fn settings(&self, settings: &Settings) -> Settings {
        let mut settings = settings.clone();
        if let Some((key, value)) = &self.setting {
            settings.insert((*key).to_owned(), value.clone());
        }
        settings
    }
}

/// The name of the solver that the engine used: the first words of its solver, method or variant.
pub(super) fn solver_name(measurement: &Measurement) -> String {
    let stated = ["solver", "method", "variant"].into_iter().find_map(|key| measurement.method.get(key));
    let text = stated.map_or("", String::as_str);
    text.split([',', ':']).next().unwrap_or_default().trim().to_owned()
}
