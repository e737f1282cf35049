//! How honest the stated errors of one engine are in one procedure of one case.

use serde::Serialize;

use super::RepeatedReadings;
use luxproof_model::{Estimate, MeterId, ReadingKey, Uncertainty};
use luxproof_statistics::{Agreement, SINGLE_PRECISION};

/// The ratios of scatter to stated error that verdicts tolerate. Errors between them are honest,
/// however many seeds there are.
pub(super) const TOLERATED_RATIOS: (f64, f64) = (0.67, 1.5);

/// The finding for one engine in one procedure of one case.
#[derive(Clone, Debug, Serialize)]
pub struct Group {
    #[serde(flatten)]
    pub key: ReadingKey,
    /// The number of meters with a stated sampling error; the others have nothing to compare a
    /// scatter with.
    pub counted: usize,
    pub not_counted: usize,
    /// The agreement over all meters that count.
    pub all: Option<Agreement>,
    /// The meter that agrees least.
    pub worst: Option<WorstMeter>,
    /// The meters whose readings claim to be deterministic but differ between seeds by more than
    /// their bounds.
    pub moving: Vec<MeterId>,
    pub finding: Finding,
    pub failure: Option<String>,
}

/// The meter with the least agreement.
#[derive(Clone, Debug, Serialize)]
pub struct WorstMeter {
    pub meter: MeterId,
    /// Its p-value times the number of meters that it is chosen from.
    pub p_value: f64,
    pub agreement: Agreement,
}

/// Whether stated errors are honest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
    /// The interval of the ratio is within what verdicts tolerate.
    Honest,
    /// Nothing speaks against the stated errors, but the interval is wider than that; more seeds
    /// would decide.
    Open,
    TooSmall,
    TooLarge,
    /// Readings that claim to be deterministic are not.
    Moves,
    /// No sampling error is stated.
    NotSampled,
    /// The engine failed.
    Failed,
}

impl Finding {
    /// Whether the stated errors are proven wrong.
    pub const fn is_dishonest(self) -> bool {
        matches!(self, Self::TooSmall | Self::TooLarge | Self::Moves)
    }

    /// The finding where no error is proven wrong.
    pub(super) fn from_agreement(agreement: Option<&Agreement>) -> Self {
        let (least, most) = TOLERATED_RATIOS;
        if agreement.is_some_and(|a| least < a.low && a.high < most) { Self::Honest } else { Self::Open }
    }

    /// The finding where the stated errors are proven wrong.
    pub(super) fn from_rejected(agreement: &Agreement) -> Self {
        if agreement.ratio > 1.0 { Self::TooSmall } else { Self::TooLarge }
    }

    /// The text for it in a table.
    pub(super) const fn label(self) -> &'static str {
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
    pub(super) fn from_readings(read: &RepeatedReadings) -> Self {
        let (counted, rest): (Vec<_>, Vec<_>) =
            read.meters.iter().zip(&read.readings).partition(|(_, readings)| states_sampling_error(readings));
        let brightest = read.readings.iter().flatten().map(|e| e.value).fold(0.0, f64::max);
        let moving: Vec<MeterId> =
            rest.iter().filter(|(_, readings)| moves(readings, brightest)).map(|(id, _)| (*id).clone()).collect();
        let meters: Vec<Vec<Estimate>> = counted.iter().map(|(_, readings)| (*readings).clone()).collect();
        let all = Agreement::of(&meters, read.shared_noise());
        let agreements = counted.iter().filter_map(|(id, readings)| worst_candidate(id, readings, meters.len()));
        let worst = agreements.min_by(|a, b| a.agreement.p_value.total_cmp(&b.agreement.p_value));
        let finding = match () {
            () if read.failure.is_some() => Finding::Failed,
            () if !moving.is_empty() => Finding::Moves,
            () if meters.is_empty() => Finding::NotSampled,
            () => Finding::from_agreement(all.as_ref()),
        };
        Self {
            key: read.key.clone(),
            counted: meters.len(),
            not_counted: rest.len(),
            all,
            // The only meter is the same as all meters.
            worst: worst.filter(|_| meters.len() > 1),
            moving,
            finding,
            failure: read.failure.as_ref().map(ToString::to_string),
        }
    }
}

/// The agreement of one of several meters; `None` where its readings do not suffice.
fn worst_candidate(id: &MeterId, readings: &[Estimate], meters: usize) -> Option<WorstMeter> {
    let agreement = Agreement::of(&[readings.to_vec()], None)?;
    // The worst of many meters is bad by chance more often than a given one (Bonferroni).
    let p_value = (agreement.p_value * meters as f64).min(1.0);
    Some(WorstMeter { meter: id.clone(), p_value, agreement })
}

/// Whether at least two readings of a meter state a sampling error.
pub(super) fn states_sampling_error(readings: &[Estimate]) -> bool {
    readings.iter().filter(|e| e.uncertainty.standard_error().is_some_and(|e| e > 0.0)).count() > 1
}

/// Whether readings differ that claim to be deterministic. A reading that no sample reached claims
/// nothing.
fn moves(readings: &[Estimate], brightest: f64) -> bool {
    let claimed = readings.iter().filter(|e| !e.uncertainty.is_sampled() && e.uncertainty != Uncertainty::Unstated);
    let ends = claimed.map(|e| (e.value - e.uncertainty.bound(), e.value + e.uncertainty.bound()));
    // The intervals of all readings have a common part unless one of them is wrong.
    let common = ends.reduce(|a, b| (a.0.max(b.0), a.1.min(b.1)));
    common.is_some_and(|(low, high)| low > high + SINGLE_PRECISION * brightest)
}
