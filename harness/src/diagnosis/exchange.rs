//! Which reading is whose: readings that are right, but at other meters or of other jobs. Whatever they state of their errors; what jobs
//! of a batch exchange scatters from seed to seed like noise.

use itertools::Itertools;

use crate::judge::Comparison;
use crate::procedures::Task;
use crate::record::{MeterId, ProcedureId};

/// How near a reading must be to what another meter should read, in parts of it.
const NEAR: f64 = 2e-3;
/// How far it must be from what its own should.
const FAR: f64 = 0.02;
/// The fewest meters that show it.
const MIN_METERS: usize = 4;

/// A scene with what was read and what is right there, meter by meter.
struct Scene {
    procedure: ProcedureId,
    read: Vec<f64>,
    right: Vec<f64>,
}

impl Scene {
    fn of(task: &Task, comparisons: &[&Comparison]) -> Option<Self> {
        let of_meter = |id: &MeterId| comparisons.iter().find(|c| c.key.procedure == task.procedure && c.meter == *id);
        let pair = |id: &MeterId| of_meter(id).and_then(|c| Some((c.value?, c.reference.as_ref()?.value)));
        let pairs: Option<Vec<(f64, f64)>> = task.targets.iter().map(|t| pair(&t.id)).collect();
        let (read, right) = pairs?.into_iter().unzip();
        Some(Self { procedure: task.procedure, read, right })
    }
}

/// What is exchanged between the meters of a scene, or between scenes: of each in which it shows, what went wrong.
pub fn exchanges(tasks: &[Task], comparisons: &[&Comparison]) -> Vec<(ProcedureId, String)> {
    let scenes: Vec<Scene> = tasks.iter().filter_map(|task| Scene::of(task, comparisons)).collect();
    let mut found: Vec<(ProcedureId, String)> = vec![];
    found.extend(shifted(&scenes));
    for scene in &scenes {
        if found.iter().any(|(of, _)| *of == scene.procedure) {
            continue;
        }
        let other = scenes
            .iter()
            .find(|o| o.procedure != scene.procedure && is_in_place_of(&scene.read, &o.right, &scene.right));
        let what = match other {
            Some(other) => {
                Some(format!("the job `{}` is answered with the readings of `{}`", scene.procedure, other.procedure))
            }
            None => among_meters(scene),
        };
        found.extend(what.map(|what| (scene.procedure, what)));
    }
    found
}

/// Whether readings are these and not those.
fn is_in_place_of(read: &[f64], these: &[f64], those: &[f64]) -> bool {
    let brightest = these.iter().copied().fold(0.0, f64::max);
    let is_near = |(a, b): (&f64, &f64), by: f64| (a - b).abs() <= by * b.abs().max(NEAR * brightest);
    read.len() >= MIN_METERS
        && read.len() == these.len()
        && read.iter().zip(these).all(|pair| is_near(pair, NEAR))
        && read.iter().zip(those).filter(|pair| !is_near(*pair, FAR)).count() > 1
}

/// Whether the readings of all jobs, one after the other, are moved by one.
fn shifted(scenes: &[Scene]) -> Vec<(ProcedureId, String)> {
    let flat = |of: fn(&Scene) -> &Vec<f64>| scenes.iter().flat_map(|s| of(s).iter().copied()).collect_vec();
    let (read, right) = (flat(|s| &s.read), flat(|s| &s.right));
    for (by, whose) in [(1, "the next"), (right.len().saturating_sub(1), "the one before")] {
        let mut moved = right.clone();
        moved.rotate_left(by.min(right.len()));
        if scenes.len() > 1 && is_in_place_of(&read, &moved, &right) {
            let what = format!("every meter reads what {whose} should, over the jobs of a batch as if they were one");
            return scenes.iter().map(|s| (s.procedure, what.clone())).collect();
        }
    }
    vec![]
}

/// Readings that are those of the scene's meters, but not of theirs: the lists are one when sorted, and far enough apart to say whose is whose.
fn among_meters(scene: &Scene) -> Option<String> {
    let by_size = |of: &[f64]| (0..of.len()).sorted_by(|a, b| of[*a].total_cmp(&of[*b])).collect_vec();
    let (read, right) = (by_size(&scene.read), by_size(&scene.right));
    let mut whose = vec![0; read.len()];
    read.iter().zip(&right).for_each(|(at, of)| whose[*at] = *of);
    let taken: Vec<f64> = whose.iter().map(|of| scene.right[*of]).collect();
    let brightest = scene.right[*right.last()?];
    let gaps = right
        .iter()
        .tuple_windows()
        .map(|(a, b)| scene.right[*b] - scene.right[*a])
        .filter(|gap| *gap > NEAR * brightest);
    if gaps.count() < MIN_METERS.min(read.len() - 1) / 2 || !is_in_place_of(&scene.read, &taken, &scene.right) {
        return None;
    }
    let is_off = |at: &usize| (scene.read[*at] - scene.right[*at]).abs() > FAR * scene.right[*at].max(NEAR * brightest);
    let off = (0..whose.len()).filter(is_off).collect_vec();
    let told = off.iter().take(3).map(|at| format!("[{at}] reads what [{}] should", whose[*at])).join(", ");
    let more = if off.len() > 3 { format!(", and so {} more", off.len() - 3) } else { String::new() };
    Some(format!("readings are given to other meters than they are of, in `{}`: {told}{more}", scene.procedure))
}
