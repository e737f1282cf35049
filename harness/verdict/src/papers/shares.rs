//! Shares of method, photometry and renderer in the distance between a paper's calculation and its rendering.
//!
//! Between the two printed values lie readings of ours that differ in one thing each. Every share is one such step,
//! relative to the printed calculation, so that the shares add up exactly:
//!
//! printed calculation -> the same method on our file -> exact, all reflections -> exact, as many reflections as the paper ->
//! the same of the paper's luminaire model -> our run of its renderer -> printed rendering.

use luxproof_model::Share;

use luxproof_model::Estimate;
use luxproof_model::PublishedFlux;

/// The values between which the steps lie, in the order above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stages {
    pub printed_method: Estimate,
    pub method: Estimate,
    pub exact: Estimate,
    pub exact_cut: Estimate,
    pub exact_model: Estimate,
    pub rendered: Estimate,
    pub printed: Estimate,
}

/// The shares of whole, method, photometry, renderer and remainder, in this order.
///
/// The flux of the paper's luminaire is only known within an interval. A table of another flux may give the paper's
/// rendering too, and changes the method's value in proportion. The steps from the printed calculation to the method on
/// our file, and from there to the exact value, have this uncertainty in opposite directions.
pub fn shares(stages: &Stages, flux: Option<&PublishedFlux>, coverage: f64) -> [Share; 5] {
    let by_flux = flux.map_or(0.0, |f| f.half_width_lm / 3f64.sqrt() / f.value_lm * stages.method.value);
    let Stages { printed_method, method, exact, exact_cut, exact_model, rendered, printed } = *stages;
    let scale = ShareScale { unit: printed_method.value, coverage };
    [
        scale.share(&[(printed_method, printed)], 0.0),
        scale.share(&[(method, exact)], by_flux),
        scale.share(&[(printed_method, method), (exact_cut, exact_model)], by_flux),
        scale.share(&[(exact, exact_cut), (exact_model, rendered)], 0.0),
        scale.share(&[(rendered, printed)], 0.0),
    ]
}

/// What shares are relative to, and the coverage factor of their intervals.
struct ShareScale {
    unit: f64,
    coverage: f64,
}

impl ShareScale {
    /// The sum of some steps, with a further standard uncertainty.
    fn share(&self, steps: &[(Estimate, Estimate)], further_uncertainty: f64) -> Share {
        let value = steps.iter().map(|(from, to)| to.value - from.value).sum::<f64>() / self.unit;
        // A stage at which one step ends and the next begins cancels, with its error.
        let mut ends: Vec<Estimate> = vec![];
        for stage in steps.iter().flat_map(|(from, to)| [*from, *to]) {
            match ends.iter().position(|e| *e == stage) {
                Some(k) => drop(ends.remove(k)),
                None => ends.push(stage),
            }
        }
        let variance = ends.iter().map(|s| s.uncertainty.standard().powi(2)).sum::<f64>() + further_uncertainty.powi(2);
        Share { value, uncertainty: self.coverage * variance.sqrt() / self.unit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::Uncertainty;

    fn stage(value: f64, uncertainty: f64) -> Estimate {
        Estimate { value, uncertainty: Uncertainty::sampled(uncertainty, None) }
    }

    fn stages() -> Stages {
        Stages {
            printed_method: stage(2.25, 0.006),
            method: stage(2.042, 0.0),
            exact: stage(2.002, 1e-5),
            exact_cut: stage(1.983, 1e-5),
            exact_model: stage(1.9835, 3e-4),
            rendered: stage(1.985, 2e-3),
            printed: stage(1.98, 0.0058),
        }
    }

    #[test]
    fn the_shares_add_up_to_the_whole() {
        let [whole, parts @ ..] = shares(&stages(), None, 2.0);
        assert!((parts.iter().map(|s| s.value).sum::<f64>() - whole.value).abs() < 1e-15);
        assert!((whole.value - (1.98 / 2.25 - 1.0)).abs() < 1e-15);
    }

    #[test]
    fn a_method_that_is_right_and_a_renderer_that_is_have_no_share() {
        let mut same = stages();
        same.exact = same.method;
        same.exact_cut = stage(2.042, 0.0);
        same.exact_model = stage(2.042, 0.0);
        same.rendered = stage(2.042, 0.0);
        let [whole, method, photometry, renderer, remainder] = shares(&same, None, 2.0);
        assert_eq!((method.value, renderer.value), (0.0, 0.0));
        assert!((photometry.value + remainder.value - whole.value).abs() < 1e-15);
    }

    #[test]
    fn an_unknown_flux_makes_method_and_photometry_uncertain_but_not_the_rest() {
        let flux = PublishedFlux { value_lm: 4450.0, half_width_lm: 250.0, source: "test".into() };
        let [whole, method, photometry, renderer, _] = shares(&stages(), Some(&flux), 2.0);
        let expected = 2.0 * 250.0 / 3f64.sqrt() / 4450.0 * 2.042 / 2.25;
        assert!((method.uncertainty - expected).abs() < 1e-4, "{method:?}");
        assert!(photometry.uncertainty >= expected);
        assert!(whole.uncertainty < 0.01 && renderer.uncertainty < 0.01);
    }

    #[test]
    fn each_share_is_its_steps_relative_to_the_printed_calculation_with_the_errors_of_their_ends() {
        let stages = Stages {
            printed_method: stage(10.0, 1.0),
            method: stage(11.0, 2.0),
            exact: stage(13.0, 3.0),
            exact_cut: stage(16.0, 4.0),
            exact_model: stage(20.0, 5.0),
            rendered: stage(25.0, 6.0),
            printed: stage(31.0, 7.0),
        };
        // A tenth of 11, as a standard uncertainty.
        let flux = PublishedFlux { value_lm: 400.0, half_width_lm: 40.0 * 3f64.sqrt(), source: "test".into() };
        let by_flux = 1.21;
        let found = shares(&stages, Some(&flux), 3.0);
        for (share, value, variance) in [
            (&found[0], 2.1, 1.0 + 49.0),
            (&found[1], 0.2, 4.0 + 9.0 + by_flux),
            (&found[2], 0.1 + 0.4, 1.0 + 4.0 + 16.0 + 25.0 + by_flux),
            (&found[3], 0.3 + 0.5, 9.0 + 16.0 + 25.0 + 36.0),
            (&found[4], 0.6, 36.0 + 49.0),
        ] {
            assert!((share.value - value).abs() < 1e-12, "{share:?} {value}");
            assert!((share.uncertainty - 0.3 * f64::sqrt(variance)).abs() < 1e-12, "{share:?} {variance}");
        }
    }

    #[test]
    fn a_stage_between_two_steps_cancels_with_its_error() {
        let scale = ShareScale { unit: 10.0, coverage: 2.0 };
        let (from, between, to) = (stage(10.0, 3.0), stage(14.0, 9.0), stage(15.0, 4.0));
        let share = scale.share(&[(from, between), (between, to)], 0.0);
        assert!((share.value - 0.5).abs() < 1e-12 && (share.uncertainty - 1.0).abs() < 1e-12, "{share:?}");
    }
}
