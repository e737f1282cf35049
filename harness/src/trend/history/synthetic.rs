//! Synthetic nights of known truth: constant deviations, normal noise, standard errors as eight blocks would state them.

use super::series::{History, Key, Series};
use crate::judge::{Basis, Verdict};
use crate::record::Quantity;
use crate::trend::history::Entry;

pub(super) const ENGINES: [&str; 5] = ["iesna", "mitsuba", "povray", "radiance", "simulator"];
pub(super) const PROCEDURES: [&str; 4] =
    ["direct_illuminance", "indirect_illuminance", "luminous_intensity", "total_illuminance"];

/// A history to be made: the defaults are a year of 2000 comparisons a night.
#[derive(Clone, Debug)]
pub(super) struct Synthetic {
    pub(super) nights: usize,
    pub(super) cases: usize,
    pub(super) meters: usize,
    pub(super) seed: u64,
    /// Share of the noise's variance that all meters of an engine, procedure and night have in common.
    pub(super) common: f64,
    /// The first night of a new version of Mitsuba.
    pub(super) new_version: Option<usize>,
    pub(super) shift: Option<Shift>,
}

/// A planted change of Mitsuba's indirect light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    pub(super) night: usize,
    pub(super) standard_errors: f64,
    /// How many cases it concerns, the first ones, and how many of their meters.
    pub(super) cases: usize,
    pub(super) meters: usize,
}

impl Default for Synthetic {
    fn default() -> Self {
        Self { nights: 365, cases: 5, meters: 20, seed: 1, common: 0.0, new_version: None, shift: None }
    }
}

impl Synthetic {
    /// The history itself.
    pub(super) fn history(&self) -> History {
        let mut random = Normal::new(self.seed);
        let mut series = vec![];
        for engine in ENGINES {
            for procedure in PROCEDURES {
                let common: Vec<f64> = (0..self.nights).map(|_| random.draw()).collect();
                for case in 0..self.cases {
                    for meter in 0..self.meters {
                        series.push(self.one(engine, procedure, case, meter, &common, &mut random));
                    }
                }
            }
        }
        History { nights: (0..self.nights).map(date).collect(), series, ..History::default() }
    }

    /// The lines of its file.
    pub(super) fn text(&self) -> String {
        let history = self.history();
        let mut text = String::new();
        for night in 0..self.nights {
            for series in &history.series {
                let is_new = series.key.engine == "mitsuba" && self.new_version.is_some_and(|n| night >= n);
                let version = if is_new { "1.1" } else { "1.0" };
                text += &serde_json::to_string(&entry(series, night, &history.nights[night], version)).unwrap();
                text += "\n";
            }
        }
        text
    }

    fn one(
        &self,
        engine: &str,
        procedure: &str,
        case: usize,
        meter: usize,
        common: &[f64],
        random: &mut Normal,
    ) -> Series {
        let (reference, error) = (100.0 + meter as f64, 0.05 * (1.0 + case as f64));
        let bias = 0.3 * random.draw();
        let shifted =
            |s: &Shift| (engine, procedure) == ("mitsuba", PROCEDURES[1]) && case < s.cases && meter < s.meters;
        let shift = self.shift.filter(shifted);
        let (own, shared) = ((1.0 - self.common).sqrt(), self.common.sqrt());
        let mut deviation = vec![];
        let mut std_error = vec![];
        for (night, common) in common.iter().enumerate().take(self.nights) {
            let moved = shift.filter(|s| night >= s.night).map_or(0.0, |s| s.standard_errors);
            deviation.push(bias + error * (own * random.draw() + shared * common + moved));
            let squares: f64 = (0..7).map(|_| random.draw().powi(2)).sum();
            std_error.push(error * (squares / 7.0).sqrt());
        }
        let key = Key {
            engine: engine.to_owned(),
            procedure: procedure.to_owned(),
            case: format!("suite/case-{case}"),
            model: "point".to_owned(),
            meter: format!("workplane[{meter}]"),
            basis: Some(Basis::Exact),
            source: "exact indirect light by radiosity, all bounces".to_owned(),
        };
        let verdicts = vec![Some(Verdict::Pass); self.nights];
        Series { key, deviation, std_error, reference: vec![reference; self.nights], verdicts }
    }
}

fn entry<'a>(series: &'a Series, night: usize, date: &'a str, version: &'a str) -> Entry<'a> {
    let key = &series.key;
    Entry {
        night: date.into(),
        case: key.case.as_str().into(),
        procedure: key.procedure.as_str().into(),
        engine: key.engine.as_str().into(),
        version: version.into(),
        model: key.model.as_str().into(),
        meter: key.meter.as_str().into(),
        quantity: Quantity::Illuminance,
        basis: key.basis,
        source: key.source.as_str().into(),
        value: Some(series.reference[night] + series.deviation[night]),
        std_error: Some(series.std_error[night]),
        reference: Some(series.reference[night]),
        deviation: Some(series.deviation[night]),
        u: Some(series.std_error[night]),
        verdict: Verdict::Pass,
    }
}

fn date(night: usize) -> String {
    let day = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(86_400 * (20_454 + night as u64));
    humantime::format_rfc3339_seconds(day).to_string()[..10].to_owned()
}

/// Standard normal numbers (Box and Muller 1958).
pub(super) struct Normal {
    random: fastrand::Rng,
    spare: Option<f64>,
}

impl Normal {
    pub(super) fn new(seed: u64) -> Self {
        Self { random: fastrand::Rng::with_seed(seed), spare: None }
    }

    pub(super) fn draw(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.random.f64()).ln()).sqrt();
        let (sine, cosine) = (std::f64::consts::TAU * self.random.f64()).sin_cos();
        self.spare = Some(radius * sine);
        radius * cosine
    }
}
