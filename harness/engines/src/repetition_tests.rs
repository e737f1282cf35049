//! Seeded repetitions of case S1 on the real renderers: unbiased, and with standard errors that are what they say.
//!
//! Few and small, so that every test run affords them; `luxproof selftest --repetitions` does as many as one likes on any spec, and
//! `benchmarks/repetitions.md` has its figures.

use super::cycles::Cycles;
use super::fixtures::{CONVERGED, S1_INDIRECT_LX, by_night, job_dir, s1, test_root_of, warm};
use super::luxcore::LuxCore;
use super::mitsuba::Mitsuba;
use super::povray::PovRay;
use super::radiance::Radiance;
use super::*;

fn repetitions(engine: &dyn Engine, (key, value): (&str, serde_json::Value), budget: Budget) -> Vec<Measurement> {
    let site = test_root_of(engine);
    let settings = BTreeMap::from([(key.to_owned(), value)]);
    let jobs = (1..=by_night(5, 3)).map(|seed| Job { budget, seed, settings: settings.clone(), ..s1(CONVERGED) });
    jobs.map(|job| {
        let folder = tempfile::tempdir().unwrap();
        engine.read(&job, &warm(job_dir(site.clone(), folder.path()))).unwrap()
    })
    .collect()
}

/// Each repetition rests on eight blocks, so that its deviation over its standard error is Student's t of 7 degrees of
/// freedom, whose variance is 7/5.
fn unbiased_with_honest_errors(found: &[Measurement], bias: f64) {
    let mut squares = 0.0;
    for (k, exact) in S1_INDIRECT_LX.into_iter().enumerate() {
        let estimates: Vec<_> = found.iter().map(|m| m.estimates[k]).collect();
        let offs: Vec<f64> = estimates.iter().map(|e| e.value - exact).collect();
        let errors: Vec<f64> = estimates.iter().map(|e| e.uncertainty.standard_error().unwrap()).collect();
        let mean = offs.iter().sum::<f64>() / found.len() as f64;
        let pooled = errors.iter().map(|error| error.powi(2)).sum::<f64>().sqrt() / found.len() as f64;
        // 21 degrees of freedom: beyond 4.5 once in five thousand; 35 by night.
        assert!(mean.abs() < 4.5 * pooled + bias * exact, "point {k}: {mean} lx off, {pooled} lx pooled: {found:?}");
        let beyond = offs.iter().zip(errors).map(|(off, error)| (off.abs() - bias * exact).max(0.0) / error);
        squares += beyond.map(|z| z.powi(2)).sum::<f64>();
    }
    let count = (S1_INDIRECT_LX.len() * found.len()) as f64;
    // Standard errors stated at half their size would give four times 7/5.
    assert!(squares < 3.0 * 1.4 * count, "sum of squared z {squares} for {count}: {found:?}");
}

#[test]
fn renderers_repeat_within_their_standard_errors_and_their_named_bias() {
    let fast = || ("preset", "fast".into());
    // Eight blocks of so few rays, however busy the machine is.
    let endless = Budget { relative_error: 0.5, seconds: 1e6 };
    let cases: [(&dyn Engine, _, _, _); 5] = [
        (&Mitsuba::default(), fast(), Budget::default(), 0.0),
        (&Radiance, fast(), Budget::default(), 0.0),
        (&Cycles, fast(), Budget::default(), 0.0),
        (&LuxCore, fast(), Budget::default(), 0.0),
        (&PovRay, ("count", 50.into()), endless, 0.005),
    ];
    for (engine, setting, budget, bias) in cases {
        unbiased_with_honest_errors(&repetitions(engine, setting, budget), bias);
    }
}
