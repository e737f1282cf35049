//! Seeded repetitions of case S1 on the real renderers: unbiased, and with standard errors that are what they say.
//!
//! Few and small, so that every test run affords them; `luxproof selftest --repetitions` does as many as one likes on any spec, and
//! `benchmarks/repetitions.md` has its figures.

use super::cycles::Cycles;
use super::fixtures::{CONVERGED, S1_INDIRECT_LX, by_night, s1, warm, workbench};
use super::luxcore::LuxCore;
use super::mitsuba::Mitsuba;
use super::povray::PovRay;
use super::radiance::Radiance;
use super::*;

fn repetitions(engine: &dyn Engine, (key, value): (&str, serde_json::Value), budget: Budget) -> Vec<Measurement> {
    let site = Site::of_user().unwrap();
    let read = |seed| {
        let folder = tempfile::tempdir().unwrap();
        let bench = warm(workbench(site.clone(), folder.path()));
        let settings = BTreeMap::from([(key.to_owned(), value.clone())]);
        let job = Job { budget, seed, settings, ..s1(CONVERGED) };
        engine.read(&job, &bench).unwrap()
    };
    (1..=by_night(5, 3)).map(read).collect()
}

/// Each repetition rests on eight blocks, so that its deviation over its standard error is Student's t of 7 degrees of
/// freedom, whose variance is 7/5.
fn unbiased_with_honest_errors(found: &[Measurement], bias: f64) {
    let mut squares = 0.0;
    for (k, exact) in S1_INDIRECT_LX.into_iter().enumerate() {
        let off = |m: &Measurement| m.estimates[k].value - exact;
        let error = |m: &Measurement| m.estimates[k].uncertainty.standard_error().unwrap();
        let mean = found.iter().map(off).sum::<f64>() / found.len() as f64;
        let pooled = found.iter().map(|m| error(m).powi(2)).sum::<f64>().sqrt() / found.len() as f64;
        // 21 degrees of freedom: beyond 4.5 once in five thousand; 35 by night.
        assert!(mean.abs() < 4.5 * pooled + bias * exact, "point {k}: {mean} lx off, {pooled} lx pooled: {found:?}");
        let beyond = |m: &Measurement| (off(m).abs() - bias * exact).max(0.0) / error(m);
        squares += found.iter().map(|m| beyond(m).powi(2)).sum::<f64>();
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
