//! Splits deviations between an approximate method and a renderer into shares of the two.

use luxproof_calculators::{DeviationSplit, Uncertain};
use luxproof_model::Split;
use luxproof_model::{EngineName, MeterId, Reading, Recording, Uncertainty};
use luxproof_photometry::units::Lux;
use luxproof_spec::procedures::Task;

/// Splits the deviation at every meter of a task where the IESNA method, the exact solution and a renderer have readings.
///
/// There are none where the IESNA method is itself the reference.
pub(super) fn split_deviations(task: &Task, recordings: &[&Recording], coverage: f64) -> Vec<Split> {
    let method = recordings.iter().find(|r| r.key.engine == EngineName::IESNA);
    let exact = recordings.iter().find(|r| r.key.engine == EngineName::SIMULATOR);
    let (Some(method), Some(exact)) = (method, exact) else { return vec![] };
    if task.reference().engine() != Some(&EngineName::SIMULATOR) {
        return vec![];
    }
    let method_name = luxproof_engines::method_of_iesna(task.transport);
    let mut splits = vec![];
    for renderer in recordings.iter().filter(|r| r.role.is_judged()) {
        let name = luxproof_engines::display_name(&renderer.key.engine);
        for rendered in renderer.readings.iter().filter(|r| r.uncertainty != Uncertainty::NotSeen) {
            let readings = find_reading(method, &rendered.meter).zip(find_reading(exact, &rendered.meter));
            let Some((by_method, by_exact)) = readings else { continue };
            let by_exact = with_interval(by_exact, coverage);
            let split = DeviationSplit::new(Lux(by_method.value), by_exact, with_interval(rendered, coverage));
            // Where there is next to no light, shares may not be finite.
            let Some(split) = split.filter(is_finite) else { continue };
            splits.push(Split {
                case: renderer.key.case.clone(),
                procedure: task.procedure,
                method: method_name.to_owned(),
                engine: renderer.key.engine.clone(),
                model: renderer.model.clone(),
                meter: rendered.meter.clone(),
                whole: split.whole,
                method_share: split.method,
                renderer_share: split.renderer,
                uncertainty: split.uncertainty,
                text: format!("{method_name} differs from {name} by {split}"),
            });
        }
    }
    splits
}

fn find_reading<'a>(recording: &'a Recording, meter: &MeterId) -> Option<&'a Reading> {
    recording.readings.iter().find(|reading| reading.meter == *meter)
}

/// A reading with the interval of a coverage factor.
fn with_interval(reading: &Reading, coverage: f64) -> Uncertain {
    Uncertain { value: Lux(reading.value), half_width: Lux(coverage * reading.uncertainty.standard()) }
}

fn is_finite(split: &DeviationSplit) -> bool {
    [split.whole, split.method, split.renderer, split.uncertainty].iter().all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use luxproof_model::{Estimate, Uncertainty};
    use luxproof_scene::{Bounces, Transport};

    fn recording(engine: &str, value: f64, std_error: f64) -> Recording {
        fixtures::recording(engine, &[Estimate { value, uncertainty: Uncertainty::sampled(std_error, None) }])
    }

    fn task(transport: Transport) -> Task {
        Task { procedure: luxproof_engines::fixtures::procedure_of(transport), transport, ..fixtures::task(0) }
    }

    #[test]
    fn a_deviation_is_split_with_its_uncertainty() {
        let all =
            [recording("iesna", 1.089, 0.0), recording("simulator", 1.002, 0.0), recording("radiance", 1.0, 5e-4)];
        let all: Vec<&Recording> = all.iter().collect();
        let found = split_deviations(&task(Transport::Indirect(Bounces::Converged)), &all, 2.0);
        assert_eq!(found.len(), 1);
        assert_eq!(
            found[0].text,
            "IP-ED differs from Radiance by +8.9 %: +8.7 % is the method's, +0.2 % the renderer's, +-0.1 %"
        );
        assert!((found[0].whole - found[0].method_share - found[0].renderer_share).abs() < 1e-15);
    }

    #[test]
    fn where_the_method_is_exact_there_is_nothing_to_split() {
        let all = [recording("iesna", 1.0, 0.0), recording("simulator", 1.0, 0.0), recording("radiance", 1.0, 0.0)];
        let all: Vec<&Recording> = all.iter().collect();
        assert!(split_deviations(&task(Transport::Direct), &all, 2.0).is_empty());
        assert!(split_deviations(&task(Transport::Indirect(Bounces::Converged)), &all[..2], 2.0).is_empty());
    }

    #[test]
    fn shares_have_the_intervals_of_renderer_and_exact_solution_at_their_coverage() {
        let all =
            [recording("iesna", 110.0, 9.0), recording("simulator", 100.0, 3.0), recording("radiance", 80.0, 4.0)];
        let reading = |k: usize| with_interval(&all[k].readings[0], 2.0);
        assert_eq!((reading(1).value.value(), reading(1).half_width.value()), (100.0, 6.0));
        let found = split_deviations(&task(Transport::Indirect(Bounces::Converged)), &all.each_ref(), 2.0);
        // Relative to the renderer: 30 of 80, of which 10 are the method's and 20 the renderer's.
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(close(found[0].whole, 0.375) && close(found[0].method_share, 0.125), "{found:?}");
        assert!(close(found[0].renderer_share, 0.25), "{found:?}");
        assert_eq!(find_reading(&all[0], &MeterId::new("grid", 1)), None);
    }

    #[test]
    fn there_is_no_split_of_what_was_not_seen_is_dark_or_has_no_reading_elsewhere() {
        let indirect = task(Transport::Indirect(Bounces::Converged));
        let split = |method: f64, renderer: Estimate, meters: usize| {
            let renderer = fixtures::recording("radiance", &vec![renderer; meters]);
            let all = [recording("iesna", method, 0.0), recording("simulator", 1.0, 0.0), renderer];
            split_deviations(&indirect, &all.each_ref(), 2.0).len()
        };
        assert_eq!(split(1.1, Estimate::exact(1.0), 1), 1);
        assert_eq!(split(1.1, Estimate::exact(1.0), 2), 1);
        assert_eq!(split(1.1, Estimate { value: 0.0, uncertainty: Uncertainty::NotSeen }, 1), 0);
        assert_eq!(split(1.1, Estimate::exact(0.0), 1), 0);
        assert_eq!(split(f64::INFINITY, Estimate::exact(1.0), 1), 0);
    }
}
