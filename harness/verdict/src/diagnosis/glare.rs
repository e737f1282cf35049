//! Why glare ratings fail: a constant offset is a factor in the formula, `UGR = 8 lg(0.25 / Lb x sum of L² omega / p²)` (CIE 117).

use std::f64::consts::PI;

use luxproof_model::{Comparison, Verdict};

/// Ratings of one offset differ by less than this.
const SAME_OFFSET: f64 = 0.03;
/// An offset within this of that of a known factor is that factor's.
const NEAR_OFFSET: f64 = 0.03;
/// The factor of the logarithm in UGR.
const UGR_SCALE: f64 = 8.0;
/// The fewest ratings that show a common offset.
const MIN_RATINGS: usize = 2;

/// Factors on the argument of the logarithm.
const FACTORS: [(&str, f64); 10] = [
    ("the background luminance is pi times too large: its illuminance is taken for its luminance", 1.0 / PI),
    ("the background luminance is pi times too small", PI),
    ("the factor 0.25 is left out", 4.0),
    ("the factor 0.25 is applied twice", 0.25),
    ("the luminance of luminaires is pi times too large", PI * PI),
    ("the luminance of luminaires is pi times too small", 1.0 / (PI * PI)),
    ("something counts twice", 2.0),
    ("something counts half", 0.5),
    ("the luminance of luminaires is 179 times too large", 179.0 * 179.0),
    ("the luminance of luminaires and of the background is 179 times too large", 179.0),
];

/// Explains ratings that are all off by the same; `None` where they are not.
pub(super) fn explain_ratings(comparisons: &[&Comparison]) -> Option<String> {
    let is_failing = comparisons.iter().any(|c| c.verdict == Verdict::Fail);
    let offsets: Option<Vec<f64>> = comparisons.iter().map(|c| c.deviation).collect();
    let offsets = offsets.filter(|offsets| is_failing && offsets.len() >= MIN_RATINGS)?;
    let mean = offsets.iter().sum::<f64>() / offsets.len() as f64;
    let noise = comparisons.iter().filter_map(|c| Some(c.budget.as_ref()?.expanded)).fold(SAME_OFFSET, f64::max);
    if offsets.iter().any(|offset| (offset - mean).abs() > noise) {
        return None;
    }
    let known = FACTORS.iter().find(|(_, factor)| (UGR_SCALE * factor.log10() - mean).abs() < NEAR_OFFSET.max(noise));
    let factor = 10f64.powf(mean / UGR_SCALE);
    let what = known.map_or_else(
        || format!("factor {factor:.3} in the formula, none of those known"),
        |(what, _)| (*what).to_owned(),
    );
    Some(format!("{what}: all {} ratings are {mean:+.2} off", offsets.len()))
}
