//! How a comparison that may be looked at several times spends its error: alpha spending over planned looks.
//!
//! Lan and Demets (Biometrika 70, 1983) let each look spend a part of the error that is fixed in advance; the parts add up to the
//! whole, so that by Bonferroni's inequality the chance of a wrong decision at any look is no larger than that of one test. Half
//! of it goes to the look that decides what is near an edge, half of what is left to the next: the first look, where that is as accurate
//! as was asked, and the last, where looks begin coarsely.

use crate::record::Spending;

/// Looks at a sampled reading at most: each asks the engine for more.
pub const LOOKS: u32 = 4;

/// The part of its error that a decision may spend at a look, counted from 1; the parts of all looks add up to 1.
pub fn share_of_error(spending: Spending, look: u32) -> f64 {
    let look = look.clamp(1, LOOKS);
    let halvings = match spending {
        Spending::AtOnce => look,
        Spending::InTheEnd => LOOKS + 1 - look,
    };
    0.5_f64.powi(i32::try_from(halvings.min(LOOKS - 1)).unwrap_or(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_looks_together_spend_the_error_once() {
        for (spending, most) in [(Spending::AtOnce, 1), (Spending::InTheEnd, LOOKS)] {
            let total: f64 = (1..=LOOKS).map(|look| share_of_error(spending, look)).sum();
            assert!((total - 1.0).abs() < 1e-15, "{total}");
            assert!((share_of_error(spending, most) - 0.5).abs() < 1e-15);
        }
    }
}
