//! Readings at an edge of a wrong look-up: on a table's angle or midway between two, at a pole, at the table's end.
//!
//! There rounding decides which candela a program takes, and whether it takes any. Such a reading says nothing about the
//! look-up, so that a prediction leaves it blank.

use glam::DVec3;
use luxproof_scene::Meter;

use super::faulty_task::Law;
use luxproof_spec::procedures::Task;

/// How far meters are moved to find edges, in meters: more than rounding, less than a look-up changes without an edge.
const MOVED_M: f64 = 2e-5;
/// Directions that lie in no plane of a table but by chance.
const DIRECTIONS: [DVec3; 2] = [DVec3::new(0.48, 0.64, 0.6), DVec3::new(-0.6, 0.52, -0.608)];
/// A reading that changes by more than this part when its meter moves is at an edge.
const MAX_CHANGE: f64 = 2e-3;
/// How often a task with edges is solved for.
pub(super) const SOLUTIONS: u64 = 1 + 2 * DIRECTIONS.len() as u64;

/// Whether each reading of a task of direct light is at an edge.
pub(super) fn are_at_edges(task: &Task, law: Law) -> Vec<bool> {
    let mut found = vec![];
    for target in &task.targets {
        found.push(target.aspects.iter().any(|aspect| is_at_edge(task, law, &aspect.meter)));
    }
    found
}

fn is_at_edge(task: &Task, law: Law, meter: &Meter) -> bool {
    let (mut least, mut most) = (f64::INFINITY, 0.0);
    for direction in DIRECTIONS {
        for by in [direction * MOVED_M, direction * -MOVED_M] {
            let moved = Meter { position_m: meter.position_m + by, ..*meter };
            let lux = law.sum(&task.scene.luminaires, &moved);
            (least, most) = (f64::min(least, lux), f64::max(most, lux));
        }
    }
    most - least > MAX_CHANGE * most
}
