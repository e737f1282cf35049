//! Holm's step-down procedure: it limits the family-wise error of failing claims (Scand. J. Statist. 6, 1979).
//!
//! A family is every test of one engine in one procedure of one case, over all meters and references. A failure claims that some
//! reading lies outside its tolerance. One false claim among 192 meters would fail the run, so the chance of any false claim is
//! limited to the level of one test. Holm's procedure is used because Sidak's steps need independent tests, and meters share
//! the instrument and the reference.
//!
//! A pass needs no correction. It claims that all readings lie within their tolerances, and only if each test says so. The error of
//! such an intersection-union test is at most that of its single tests, however many there are (Berger, Technometrics 24, 1982).

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

    #[test]
    fn a_later_step_has_a_larger_share_of_the_level() {
        // .05/4, .05/3, .05/2, .05 in turn; .05/4 throughout (Bonferroni) rejects two of them.
        assert_eq!(rejected(&[0.01, 0.015, 0.03, 0.005], 0.05), [true; 4]);
        // A later hypothesis does not make up for an earlier one (Hochberg, Biometrika 75 (1988)).
        assert_eq!(rejected(&[0.03, 0.04], 0.05), [false; 2]);
        // Between .05/4 and 1 - .95^(1/4) = .01274, Sidak's step for independent tests.
        assert_eq!(rejected(&[0.0126, 0.9, 0.9, 0.9], 0.05), [false; 4]);
        // At the level itself a hypothesis is rejected, and the smallest of several is tested first.
        assert_eq!(rejected(&[0.05], 0.05), [true]);
        assert_eq!(rejected(&[0.051, 0.025], 0.05), [false, true]);
    }
}
