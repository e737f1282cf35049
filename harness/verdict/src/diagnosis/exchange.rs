//! Right readings at other meters or of other jobs.
//!
//! Stated errors play no part here: what jobs of a batch exchange scatters from seed to seed like noise.

use itertools::Itertools;

use luxproof_model::Comparison;
use luxproof_model::{MeterId, ProcedureId};
use luxproof_spec::procedures::Task;

/// Relative distance within which a reading is the right one of another meter.
const MAX_DISTANCE: f64 = 2e-3;
/// Relative distance beyond which it is not the right one of its meter.
const MIN_DEVIATION: f64 = 0.02;
/// The fewest meters that show an exchange.
const MIN_METERS: usize = 4;
/// Exchanged meters that a description lists.
const LISTED_METERS: usize = 3;

/// A scene with its readings and right values, meter by meter.
struct Scene {
    procedure: ProcedureId,
    read: Vec<f64>,
    right: Vec<f64>,
}

impl Scene {
    /// The scene of a task; `None` where a reading or a reference is missing.
    fn from_comparisons(task: &Task, comparisons: &[&Comparison]) -> Option<Self> {
        let (mut read, mut right) = (vec![], vec![]);
        for target in &task.targets {
            let comparison = find_comparison(task.procedure, &target.id, comparisons)?;
            read.push(comparison.value?);
            right.push(comparison.reference.as_ref()?.value);
        }
        Some(Self { procedure: task.procedure, read, right })
    }
}

fn find_comparison<'a>(
    procedure: ProcedureId,
    meter: &MeterId,
    comparisons: &[&'a Comparison],
) -> Option<&'a Comparison> {
    comparisons.iter().copied().find(|c| c.key.procedure == procedure && c.meter == *meter)
}

/// Finds exchanges between meters of a scene or between scenes; describes what went wrong in each procedure.
pub fn exchanges(tasks: &[Task], comparisons: &[&Comparison]) -> Vec<(ProcedureId, String)> {
    let scenes: Vec<Scene> = tasks.iter().filter_map(|task| Scene::from_comparisons(task, comparisons)).collect();
    let mut found = find_batch_shift(&scenes);
    for scene in &scenes {
        if found.iter().any(|(procedure, _)| *procedure == scene.procedure) {
            continue;
        }
        let what = find_exchanged_scene(scene, &scenes).or_else(|| find_exchanged_meters(scene));
        found.extend(what.map(|what| (scene.procedure, what)));
    }
    found
}

/// Finds a scene that is answered with the readings of another.
fn find_exchanged_scene(scene: &Scene, scenes: &[Scene]) -> Option<String> {
    let other =
        scenes.iter().find(|o| o.procedure != scene.procedure && are_exchanged(&scene.read, &o.right, &scene.right))?;
    Some(format!("the job `{}` is answered with the readings of `{}`", scene.procedure, other.procedure))
}

/// Whether readings agree with other values and not with the right ones.
fn are_exchanged(read: &[f64], others: &[f64], right: &[f64]) -> bool {
    let floor = MAX_DISTANCE * others.iter().copied().fold(0.0, f64::max);
    read.len() >= MIN_METERS
        && read.len() == others.len()
        && read.iter().zip(others).all(|(a, b)| is_close(*a, *b, MAX_DISTANCE, floor))
        && read.iter().zip(right).filter(|(a, b)| !is_close(**a, **b, MIN_DEVIATION, floor)).count() > 1
}

/// Whether a value is within a relative distance of another, but at least of a floor.
fn is_close(value: f64, other: f64, distance: f64, floor: f64) -> bool {
    (value - other).abs() <= distance * other.abs().max(floor)
}

/// Finds readings of a whole batch that are moved by one meter.
fn find_batch_shift(scenes: &[Scene]) -> Vec<(ProcedureId, String)> {
    if scenes.len() < 2 {
        return vec![];
    }
    let read = scenes.iter().flat_map(|s| s.read.iter().copied()).collect_vec();
    let right = scenes.iter().flat_map(|s| s.right.iter().copied()).collect_vec();
    for (by, neighbour) in [(1, "the next"), (right.len().saturating_sub(1), "the one before")] {
        let mut moved = right.clone();
        moved.rotate_left(by.min(right.len()));
        if are_exchanged(&read, &moved, &right) {
            let what =
                format!("every meter reads what {neighbour} should, over the jobs of a batch as if they were one");
            return scenes.iter().map(|s| (s.procedure, what.clone())).collect();
        }
    }
    vec![]
}

/// Finds readings that belong to other meters of the scene.
///
/// The sorted readings agree with the sorted right values, whose distances are large enough to tell the meters.
fn find_exchanged_meters(scene: &Scene) -> Option<String> {
    let (read, right) = (sort_indices(&scene.read), sort_indices(&scene.right));
    let mut source = vec![0; read.len()];
    for (meter, other) in read.iter().zip(&right) {
        source[*meter] = *other;
    }
    let assigned: Vec<f64> = source.iter().map(|other| scene.right[*other]).collect();
    let floor = MAX_DISTANCE * scene.right[*right.last()?];
    let gaps = right.iter().tuple_windows().filter(|(a, b)| scene.right[**b] - scene.right[**a] > floor).count();
    if gaps < MIN_METERS.min(read.len() - 1) / 2 || !are_exchanged(&scene.read, &assigned, &scene.right) {
        return None;
    }
    let exchanged = (0..source.len())
        .filter(|k| (scene.read[*k] - scene.right[*k]).abs() > MIN_DEVIATION * scene.right[*k].max(floor))
        .collect_vec();
    let listed = exchanged.iter().take(LISTED_METERS).map(|k| format!("[{k}] reads what [{}] should", source[*k]));
    let listed = listed.collect_vec().join(", ");
    let more = exchanged.len().saturating_sub(LISTED_METERS);
    let more = if more > 0 { format!(", and so {more} more") } else { String::new() };
    Some(format!("readings are given to other meters than they are of, in `{}`: {listed}{more}", scene.procedure))
}

/// The indices of values in the order of their size.
fn sort_indices(values: &[f64]) -> Vec<usize> {
    (0..values.len()).sorted_by(|a, b| values[*a].total_cmp(&values[*b])).collect_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    fn scene(procedure: ProcedureId, read: &[f64], right: &[f64]) -> Scene {
        Scene { procedure, read: read.to_vec(), right: right.to_vec() }
    }

    const DIRECT: ProcedureId = ProcedureId::DirectIlluminance;
    const TOTAL: ProcedureId = ProcedureId::TotalIlluminance;

    #[test]
    fn readings_of_other_meters_are_named() {
        let right = [10.0, 20.0, 30.0, 40.0, 50.0];
        let swapped = scene(DIRECT, &[20.0, 10.0, 30.02, 40.0, 50.0], &right);
        assert_eq!(
            find_exchanged_meters(&swapped).unwrap(),
            "readings are given to other meters than they are of, in `direct_illuminance`: [0] reads what [1] should, [1] reads what [0] should"
        );
        let turned = scene(DIRECT, &[50.0, 40.0, 30.0, 20.0, 10.0], &right);
        let text = find_exchanged_meters(&turned).unwrap();
        assert!(text.ends_with(
            "[0] reads what [4] should, [1] reads what [3] should, [3] reads what [1] should, and so 1 more"
        ));
        // Right readings, one wrong reading, values that no meter has, and few meters show none.
        for (read, right) in [
            (&right[..], &right[..]),
            (&[20.0, 20.0, 30.0, 40.0, 50.0], &right),
            (&[20.2, 10.0, 30.0, 40.0, 50.0], &right),
            (&[20.0, 10.0, 30.0], &right[..3]),
            // Equal right values tell nothing.
            (&[10.0, 10.0, 10.0, 20.0, 10.0], &[10.0, 10.0, 10.0, 10.0, 20.0]),
        ] {
            assert_eq!(find_exchanged_meters(&scene(DIRECT, read, right)), None, "{read:?}");
        }
    }

    #[test]
    fn readings_of_another_job_are_named() {
        let (one, other) = ([10.0, 20.0, 30.0, 40.0], [15.0, 25.0, 35.0, 45.0]);
        let scenes = [scene(DIRECT, &other, &one), scene(TOTAL, &other, &other)];
        let text = "the job `direct_illuminance` is answered with the readings of `total_illuminance`";
        assert_eq!(find_exchanged_scene(&scenes[0], &scenes).unwrap(), text);
        assert_eq!(find_exchanged_scene(&scenes[1], &scenes), None);
        // A fifth of a percent from the other is near, and one meter that differs is no other job.
        let near = other.map(|value| 1.0019 * value);
        assert!(are_exchanged(&near, &other, &one));
        assert!(!are_exchanged(&other.map(|value| 1.0021 * value), &other, &one));
        assert!(!are_exchanged(&one, &one, &[10.0, 20.0, 30.0, 41.0]));
        assert!(are_exchanged(&one, &one, &[10.0, 20.0, 31.0, 41.0]));
    }

    #[test]
    fn a_batch_that_is_moved_by_a_meter_is_named_in_all_of_its_jobs() {
        let scenes = [
            scene(DIRECT, &[20.0, 30.0, 40.0], &[10.0, 20.0, 30.0]),
            scene(TOTAL, &[50.0, 60.0, 10.0], &[40.0, 50.0, 60.0]),
        ];
        let found = find_batch_shift(&scenes);
        assert_eq!(found.iter().map(|(procedure, _)| *procedure).collect_vec(), [DIRECT, TOTAL]);
        assert!(found[0].1.starts_with("every meter reads what the next should"), "{found:?}");
        let back = [
            scene(DIRECT, &[60.0, 10.0, 20.0], &[10.0, 20.0, 30.0]),
            scene(TOTAL, &[30.0, 40.0, 50.0], &[40.0, 50.0, 60.0]),
        ];
        assert!(find_batch_shift(&back)[0].1.contains("what the one before should"));
        assert!(find_batch_shift(&scenes[..1]).is_empty() && find_batch_shift(&[]).is_empty());
    }
}
