//! Synthetic nights with a known truth: constant deviations, normal noise, standard errors of eight blocks.

use super::line::{Line, Numbers};
use super::series::{History, Key, Series};
use luxproof_model::{Basis, Verdict};
use luxproof_model::{MeterId, ProcedureId, Quantity, ReadingKey};
use luxproof_process::clock::timestamp;
use luxproof_process::random::normal;

const ENGINES: [&str; 5] = ["iesna", "mitsuba", "povray", "radiance", "simulator"];
const PROCEDURES: [ProcedureId; 4] = [
    ProcedureId::DirectIlluminance,
    ProcedureId::IndirectIlluminance,
    ProcedureId::LuminousIntensity,
    ProcedureId::TotalIlluminance,
];

/// Whether two numbers are the same but for rounding.
pub(super) fn is_near(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-9 * expected.abs().max(1.0)
}

/// The series of a meter with a constant reference.
pub(super) fn series(reference: f64, std_error: &[f64], deviation: &[f64]) -> Series {
    let key = Key {
        reading: ReadingKey::new("room", ProcedureId::IndirectIlluminance, "mine"),
        model: String::new(),
        meter: MeterId::new("desk", 0),
        basis: None,
        source: String::new(),
    };
    let (reference, verdicts) = (vec![reference; deviation.len()], vec![None; deviation.len()]);
    Series { key, deviation: deviation.to_vec(), std_error: std_error.to_vec(), reference, verdicts }
}

/// The parameters of a synthetic history; the default is a year of 2000 comparisons a night.
#[derive(Clone, Debug)]
pub(super) struct Synthetic {
    pub(super) nights: usize,
    pub(super) cases: usize,
    pub(super) meters: usize,
    pub(super) seed: u64,
    /// Share of the noise's variance that all meters of an engine, procedure and night share.
    pub(super) common: f64,
    pub(super) distribution: Distribution,
    /// The first night of a new version of Mitsuba.
    pub(super) new_version: Option<usize>,
    pub(super) shift: Option<Shift>,
    pub(super) drift: Option<Drift>,
}

/// The distribution of the noise, with mean 0 and a standard deviation near 1.
#[derive(Clone, Copy, Debug)]
pub(super) enum Distribution {
    Normal,
    /// Lognormal with a sigma of 1.2: a skewness of 11.
    Skewed,
    /// The ratio of two normal numbers, with a denominator of at least 0.2: up to twenty standard errors.
    HeavyTailed,
}

impl Distribution {
    fn draw(self, random: &mut fastrand::Rng) -> f64 {
        match self {
            Self::Normal => normal(random),
            Self::Skewed => ((1.2 * normal(random)).exp() - 0.72_f64.exp()) / 3.7,
            Self::HeavyTailed => normal(random) / normal(random).abs().max(0.2),
        }
    }
}

/// A planted drift of Mitsuba's indirect light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drift {
    /// The first night that shows it, and the first on which it no longer grows.
    pub(super) nights: (usize, usize),
    /// Relative to the reference, a night.
    pub(super) a_night: f64,
    /// How many of the first cases have it.
    pub(super) cases: usize,
}

/// A planted change of Mitsuba's indirect light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    pub(super) night: usize,
    /// The first night that no longer has it.
    pub(super) until: usize,
    pub(super) standard_errors: f64,
    /// How many of the first cases have it, and how many of their first meters.
    pub(super) cases: usize,
    pub(super) meters: usize,
}

impl Default for Synthetic {
    fn default() -> Self {
        Self {
            nights: 365,
            cases: 5,
            meters: 20,
            seed: 1,
            common: 0.0,
            distribution: Distribution::Normal,
            new_version: None,
            shift: None,
            drift: None,
        }
    }
}

impl Synthetic {
    pub(super) fn history(&self) -> History {
        let mut random = fastrand::Rng::with_seed(self.seed);
        let mut series = vec![];
        for engine in ENGINES {
            for procedure in PROCEDURES {
                let common: Vec<f64> = (0..self.nights).map(|_| normal(&mut random)).collect();
                for case in 0..self.cases {
                    let reading = ReadingKey::new(format!("suite/case-{case}"), procedure, engine);
                    for meter in 0..self.meters {
                        series.push(self.series(&reading, case, meter, &common, &mut random));
                    }
                }
            }
        }
        History { nights: (0..self.nights).map(date).collect(), series, ..History::default() }
    }

    pub(super) fn text(&self) -> String {
        let history = self.history();
        let mut text = String::new();
        for (night, date) in history.nights.iter().enumerate() {
            for series in history.series.chunks(self.meters) {
                text += &(self.line(series, night, date).text().unwrap() + "\n");
            }
        }
        text
    }

    fn line<'a>(&self, meters: &'a [Series], night: usize, date: &'a str) -> Line<'a> {
        let key = &meters[0].key;
        let is_new = key.reading.engine == "mitsuba" && self.new_version.is_some_and(|n| night >= n);
        let mut line = Line::new(date, &key.reading, Quantity::Illuminance, Verdict::Pass);
        line.version = if is_new { "1.1" } else { "1.0" }.into();
        (line.model, line.basis, line.source) = (key.model.as_str().into(), key.basis, key.source.as_str().into());
        for series in meters {
            let (reference, deviation) = (series.reference[night], series.deviation[night]);
            let std_error = series.std_error[night];
            line.push(&series.key.meter, Numbers { reference, deviation, std_error, u: std_error });
        }
        line
    }

    /// The series of one meter.
    fn series(&self, of: &ReadingKey, case: usize, meter: usize, common: &[f64], random: &mut fastrand::Rng) -> Series {
        let (reference, error) = (100.0 + meter as f64, 0.05 * (1.0 + case as f64));
        let bias = 0.3 * normal(random);
        let is_subject = of.engine == "mitsuba" && of.procedure == PROCEDURES[1];
        let shift = self.shift.filter(|s| is_subject && case < s.cases && meter < s.meters);
        let drift = self.drift.filter(|d| is_subject && case < d.cases);
        let (independent, shared) = ((1.0 - self.common).sqrt(), self.common.sqrt());
        let (mut deviation, mut std_error) = (vec![], vec![]);
        for (night, common) in common.iter().enumerate().take(self.nights) {
            let moved = shift.filter(|s| (s.night..s.until).contains(&night)).map_or(0.0, |s| s.standard_errors);
            let along = drift.map_or(0.0, |Drift { nights: (first, end), a_night, .. }| {
                a_night * reference * (night + 1).clamp(first, end).saturating_sub(first) as f64
            });
            deviation
                .push(bias + error * (independent * self.distribution.draw(random) + shared * common + moved) + along);
            let squares: f64 = (0..7).map(|_| normal(random).powi(2)).sum();
            std_error.push(error * (squares / 7.0).sqrt());
        }
        let key = Key {
            reading: of.clone(),
            model: "point".to_owned(),
            meter: MeterId::new("workplane", meter),
            basis: Some(Basis::Simulator),
            source: "exact indirect light by radiosity, all bounces".to_owned(),
        };
        let verdicts = vec![Some(Verdict::Pass); self.nights];
        Series { key, deviation, std_error, reference: vec![reference; self.nights], verdicts }
    }
}

fn date(night: usize) -> String {
    let day = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(86_400 * (20_454 + night as u64));
    timestamp(day).chars().take(10).collect()
}
