//! What the readings of one engine in one procedure of one case tell of their stated errors.

use serde::Serialize;

use super::Repeated;
use crate::judge::SINGLE_PRECISION;
use crate::record::{Agreement, Estimate, MeterId, ReadingKey, Uncertainty};

/// Ratios that verdicts bear: what lies between is honest, however few or many seeds there are.
pub(super) const PRACTICAL: (f64, f64) = (0.67, 1.5);

#[derive(Clone, Debug, Serialize)]
pub struct Group {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// Meters whose readings state an error of sampling: the others have nothing to hold a scatter against.
    pub counted: usize,
    pub not_counted: usize,
    /// Of all meters that count.
    pub all: Option<Agreement>,
    /// The meter that agrees least.
    pub worst: Option<Worst>,
    /// Meters whose readings are claimed to be determined and differ from seed to seed by more than their bounds.
    pub moving: Vec<MeterId>,
    pub finding: Finding,
    pub failure: Option<String>,
}

#[derive(Clone, Debug, Serialize)]
pub struct Worst {
    pub meter: MeterId,
    /// Its p-value times the meters that it is the worst of.
    pub p_value: f64,
    pub agreement: Agreement,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// The interval of the ratio lies within what verdicts bear.
    Honest,
    /// Nothing is against the stated errors, but their interval is wider than that: more seeds would tell.
    Open,
    TooSmall,
    TooLarge,
    /// What is claimed to be determined is not.
    Moves,
    /// No error of sampling is stated.
    NotSampled,
    /// It was not read.
    Failed,
}

impl Finding {
    pub const fn is_dishonest(self) -> bool {
        matches!(self, Self::TooSmall | Self::TooLarge | Self::Moves)
    }

    pub(super) fn of(agreement: Option<&Agreement>) -> Self {
        let is_narrow = |a: &Agreement| PRACTICAL.0 < a.low && a.high < PRACTICAL.1;
        if agreement.is_some_and(is_narrow) { Self::Honest } else { Self::Open }
    }

    pub(super) fn wrong(agreement: &Agreement) -> Self {
        if agreement.ratio > 1.0 { Self::TooSmall } else { Self::TooLarge }
    }

    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Honest => "ok",
            Self::Open => "open",
            Self::TooSmall => "DISHONEST: too small",
            Self::TooLarge => "DISHONEST: too large",
            Self::Moves => "DISHONEST: not determined",
            Self::NotSampled => "none stated",
            Self::Failed => "FAILED",
        }
    }
}

impl Group {
    pub(super) fn of(read: &Repeated) -> Self {
        let (counted, rest): (Vec<_>, Vec<_>) =
            read.meters.iter().zip(&read.readings).partition(|(_, readings)| counts(readings));
        let brightest = read.readings.iter().flatten().map(|e| e.value).fold(0.0, f64::max);
        let moving: Vec<MeterId> =
            rest.iter().filter(|(_, readings)| moves(readings, brightest)).map(|(id, _)| (*id).clone()).collect();
        let meters: Vec<Vec<Estimate>> = counted.iter().map(|(_, readings)| (*readings).clone()).collect();
        let all = Agreement::of(&meters, read.shared());
        let one = |(id, meter): (&&MeterId, &Vec<Estimate>)| {
            let agreement = Agreement::of(std::slice::from_ref(meter), None)?;
            let p_value = (agreement.p_value * meters.len() as f64).min(1.0);
            Some(Worst { meter: (**id).clone(), p_value, agreement })
        };
        let ids = counted.iter().map(|(id, _)| id);
        let worst = ids.zip(&meters).filter_map(one).min_by(|a, b| a.agreement.p_value.total_cmp(&b.agreement.p_value));
        let finding = match () {
            () if read.failure.is_some() => Finding::Failed,
            () if !moving.is_empty() => Finding::Moves,
            () if meters.is_empty() => Finding::NotSampled,
            () => Finding::of(all.as_ref()),
        };
        Self {
            key: read.key.clone(),
            counted: meters.len(),
            not_counted: rest.len(),
            all,
            worst: worst.filter(|_| meters.len() > 1),
            moving,
            finding,
            failure: read.failure.as_ref().map(ToString::to_string),
        }
    }
}

/// Whether a meter's readings state errors of sampling, two of them at least.
pub(super) fn counts(readings: &[Estimate]) -> bool {
    readings.iter().filter(|e| e.uncertainty.standard_error().is_some_and(|e| e > 0.0)).count() > 1
}

/// Whether readings differ that are claimed to be determined; what no sample met claims nothing.
fn moves(readings: &[Estimate], brightest: f64) -> bool {
    let claims = |e: &&Estimate| !e.uncertainty.is_sampled() && e.uncertainty != Uncertainty::Unstated;
    let claimed = readings.iter().filter(claims);
    let ends = claimed.map(|e| (e.value - e.uncertainty.bound(), e.value + e.uncertainty.bound()));
    let within = ends.reduce(|a, b| (a.0.max(b.0), a.1.min(b.1)));
    within.is_some_and(|(low, high)| low > high + SINGLE_PRECISION * brightest)
}
