//! Colour scales for every kind of colour vision: cividis for amounts, purple to orange for deviations.
//!
//! Cividis: Nuñez, Anderton, Renslow, PLOS ONE 13 (2018) e0199239; purple to orange: Brewer's `PuOr`.

use colorous::{CIVIDIS, PURPLE_ORANGE};

/// The colour of an amount from 0 to 1.
pub(super) fn amount(part: f64) -> String {
    format!("#{:x}", CIVIDIS.eval_continuous(part.clamp(0.0, 1.0)))
}

/// The colour of a deviation from -1 to 1.
pub(super) fn deviation(part: f64) -> String {
    format!("#{:x}", PURPLE_ORANGE.eval_continuous(0.5 + 0.5 * part.clamp(-1.0, 1.0)))
}

#[cfg(test)]
#[test]
fn the_scales_run_from_end_to_end_and_stay_there_beyond() {
    assert_eq!([amount(0.0), amount(1.0), amount(0.5)], ["#002051", "#fde945", "#7f7b74"]);
    assert_eq!([deviation(-1.0), deviation(0.0), deviation(9.0)], ["#2d004b", "#f3eeea", "#7e3a08"]);
}
