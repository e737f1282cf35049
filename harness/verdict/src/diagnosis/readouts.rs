//! Kinds of wrong read-outs: powers, thresholds, and steps that all readings are multiples of.

use super::engine_readings::EngineReadings;
use super::fault::{Fault, Parameter};
use super::faulty_task::{Model, Readout, Rounding};

/// The fewest different readings that show a common step.
const MIN_VALUES: usize = 4;
/// How near to a multiple of a step a reading is, as a part of the step.
const MAX_STEP_ERROR: f64 = 0.02;
/// Parts of the smallest reading, or of the smallest difference, that are tried as a step.
const MAX_PARTS: u32 = 8;
/// A step below this part of the smallest reading does not show.
const MIN_STEP_SHARE: f64 = 5e-3;

/// Lists the kinds of read-outs that need no reading.
pub(super) fn readout_kinds() -> Vec<Fault> {
    let power = Fault::new("readout", "readings are raised to the power of {0}, each as a part of {1}", |faulty, p| {
        faulty.readouts.push(Readout::Power { exponent: p[0], level: p[1] });
        true
    });
    let of_lux = Fault::new("readout", "readings in lux are raised to the power of {0}", |faulty, p| {
        faulty.readouts.push(Readout::Power { exponent: p[0], level: 1.0 });
        true
    });
    let level = |starts: &[f64]| Parameter {
        unit: " lx",
        starts: starts.to_vec(),
        step: 1e-3,
        range: (0.0, 1e9),
        period: None,
    };
    let at_least = Fault::new("readout", "readings are {0} at least", |faulty, p| {
        faulty.readouts.push(Readout::AtLeast(p[0]));
        true
    });
    let subtracted = Fault::new("readout", "{0} are subtracted from every reading", |faulty, p| {
        faulty.readouts.push(Readout::Plus(-p[0]));
        true
    });
    let exponent = Parameter { starts: vec![0.45, 0.9, 1.1, 2.2], ..Parameter::new("", 1.0, 0.02, (0.1, 10.0)) };
    vec![
        of_lux.about("power of readings").with_parameters([exponent.clone()]),
        // At a power of 1 the level has no effect, and at none does a fit begin at the brightest reading.
        power.about("power of readings").with_parameters([exponent, Parameter { step: 0.1, ..level(&[]) }]),
        at_least.about("least reading").with_parameters([level(&[0.1, 1.0, 10.0, 100.0])]),
        subtracted.about("offset").with_parameters([level(&[0.0])]),
    ]
}

/// Faults in which all readings are multiples of one step, where those of the sheets are, or also at most 255 times the step.
pub(super) fn step_faults(sheets: &[EngineReadings], models: &[Model]) -> Vec<Fault> {
    let mut failing = sheets.iter().filter(|sheet| sheet.fails);
    let Some(step) = failing.find_map(|sheet| find_step(lux(sheet, &models[sheet.model]))) else {
        return vec![];
    };
    let mut all = vec![];
    for (rounding, how) in [(Rounding::Nearest, "rounded to"), (Rounding::Down, "cut to"), (Rounding::Up, "raised to")]
    {
        let what = format!("readings are {how} multiples of {step:.4} lx");
        let of_8_bits = format!("{what}, at most 255 of them: they have 8 bits");
        all.push(Fault::new("readout", what, move |faulty, _| {
            faulty.readouts.push(Readout::Step(step, rounding));
            true
        }));
        all.push(Fault::new("readout", of_8_bits, move |faulty, _| {
            faulty.readouts.extend([Readout::Step(step, rounding), Readout::AtMost(255.0 * step)]);
            true
        }));
    }
    all
}

/// The illuminance that an engine reads for each reading of a sheet, whatever the reading's unit.
fn lux(sheet: &EngineReadings, model: &Model) -> Vec<f64> {
    sheet.read.iter().zip(&model.task.targets).map(|(read, target)| read / target.aspects[0].weight).collect()
}

/// Finds the largest step that all values are multiples of.
fn find_step(lux: Vec<f64>) -> Option<f64> {
    let mut values: Vec<f64> = lux.into_iter().filter(|read| *read > 0.0).collect();
    values.sort_by(f64::total_cmp);
    values.dedup_by(|a, b| (*a - *b).abs() < 1e-4 * *b);
    if values.len() < MIN_VALUES {
        return None;
    }
    let differences = values.windows(2).map(|pair| pair[1] - pair[0]);
    let smallest = differences.fold(values[0], f64::min);
    let mut steps = (1..=MAX_PARTS).map(|parts| smallest / f64::from(parts));
    steps.find_map(|step| Some(refine_step(&values, step)).filter(|step| is_common_step(&values, *step)))
}

/// Refines a step by each reading in turn, the smallest first.
fn refine_step(values: &[f64], step: f64) -> f64 {
    values.iter().fold(step, |step, value| {
        let count = (value / step).round();
        if count >= 1.0 && (value / step - count).abs() < 0.25 { value / count } else { step }
    })
}

fn is_common_step(values: &[f64], step: f64) -> bool {
    let is_multiple = |value: &f64| (value / step - (value / step).round()).abs() < MAX_STEP_ERROR;
    step > MIN_STEP_SHARE * values[0] && values.iter().all(is_multiple)
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_step_is_found_that_all_readings_are_multiples_of() {
        // The smallest difference is 1, of which 1.5 and 2.5 are no multiples.
        let found = find_step(vec![4.0, 1.5, 2.5, 7.0]).unwrap();
        assert!((found - 0.5).abs() < 1e-12, "{found}");
        // Rounding of a hundredth of the step is none; darkness and repetitions do not count.
        let found = find_step(vec![0.0, 3.003, 5.997, 9.002, 9.002, 12.0]).unwrap();
        assert!((found - 3.0).abs() < 2e-3, "{found}");
        assert_eq!(find_step(vec![0.0, 3.0, 3.0, 6.0, 9.0]), None);
        assert_eq!(find_step(vec![1.0, 2f64.sqrt(), 3f64.sqrt(), 7f64.sqrt()]), None);
        // A step far below the readings shows nothing: 1 is less than a two-hundredth of 300.
        assert_eq!(find_step(vec![300.0, 301.0, 302.0, 305.0]), None);
        assert!(find_step(vec![100.0, 101.0, 102.0, 105.0]).is_some());
    }

    #[test]
    fn a_step_is_refined_by_readings_that_are_near_a_multiple() {
        for (values, refined) in [
            // Twice 1.05; three tenths of a step away is no multiple, and less than half a step is none of it.
            (&[2.1][..], 1.05),
            (&[2.3], 1.0),
            (&[0.4], 1.0),
            (&[0.8], 0.8),
            // 5 / 1.05 = 4.76 counts as five.
            (&[2.1, 5.0], 1.0),
        ] {
            assert!((refine_step(values, 1.0) - refined).abs() < 1e-12, "{values:?}");
        }
    }

    #[test]
    fn a_step_is_common_within_two_hundredths_and_above_a_two_hundredth_of_the_least_reading() {
        for (values, is_common) in [
            (&[1.0, 2.019][..], true),
            (&[1.0, 1.981], true),
            (&[1.0, 2.021], false),
            (&[1.0, 1.979], false),
            (&[199.0], true),
            (&[200.0], false),
            (&[201.0], false),
        ] {
            assert_eq!(is_common_step(values, 1.0), is_common, "{values:?}");
        }
    }

    #[test]
    fn four_different_readings_show_a_step() {
        assert!(find_step(vec![2.0, 4.0, 6.0, 10.0]).is_some_and(|step| (step - 2.0).abs() < 1e-12));
        assert_eq!(find_step(vec![2.0, 4.0, 6.0]), None);
        // Readings within a ten-thousandth are one.
        assert_eq!(find_step(vec![2.0, 4.0, 6.0, 6.000_5]), None);
        assert!(find_step(vec![2.0, 4.0, 6.0, 6.000_5, 10.0]).is_some_and(|step| (step - 2.0).abs() < 1e-3));
        // An eighth of the smallest difference is the smallest step tried.
        assert!(find_step(vec![8.0, 17.0, 28.0, 41.0]).is_some_and(|step| (step - 1.0).abs() < 1e-12));
        assert_eq!(find_step(vec![9.0, 19.0, 30.0, 43.0]), None);
    }
}
