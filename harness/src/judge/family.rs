//! Failing claims of one family held to a family-wise error: Holm's step-down procedure (Scand. J. Statist. 6, 1979).
//!
//! The family is everything that one engine is held to in one procedure of one case, over all meters and references. To fail is
//! to claim that some reading lies outside its tolerance, and one false claim among 192 meters would fail the run: the chance of
//! any false claim is kept to the level of one test. Holm and not Sidak, since Sidak's steps need independent tests and meters
//! share the instrument and the reference.
//!
//! To pass needs no correction. That all readings lie within their tolerances is claimed only where each test says so: an
//! intersection-union test, whose error is at most that of its single tests, however many there are (Berger, Technometrics 24,
//! 1982).

/// Which of the hypotheses behind these p-values are rejected at a family-wise level.
pub fn rejected(p_values: &[f64], level: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut rejected = vec![false; p_values.len()];
    for (rank, &k) in order.iter().enumerate() {
        rejected[k] = p_values[k] <= level / (p_values.len() - rank) as f64;
        if !rejected[k] {
            break;
        }
    }
    rejected
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_down_until_the_first_that_holds() {
        // Holm's own rule by hand at 5 %: .05/4, .05/3, .05/2, .05.
        assert_eq!(rejected(&[0.01, 0.04, 0.03, 0.005], 0.05), [true, false, false, true]);
        assert_eq!(rejected(&[0.013, 0.9], 0.05), [true, false]);
        assert_eq!(rejected(&[f64::NAN, 0.001], 0.05), [false, true]);
        assert!(rejected(&[], 0.05).is_empty());
    }
}
