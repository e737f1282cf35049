//! Where a placeholder of a luminaire hangs, so that it is in the open and not in a slab or outside of an L.

use glam::{DVec2, DVec3};

use super::Imported;

/// Places along either side of the plan that are looked at.
const STEPS: usize = 9;

/// What is lower than this part of the scene's height is a slab, a shelf or a body.
const LOW: f64 = 0.25;

/// The highest place near the middle that has surfaces above and below it; the middle where there is none.
pub(super) fn lamp(scene: &Imported) -> DVec3 {
    let (low, high) = (scene.low_m, scene.high_m);
    let size = high - low;
    let middle = (low + high) / 2.0;
    // Off the middle by less than a step, where edges of triangles are.
    let part = |k: usize| (k as f64 + 0.5137) / STEPS as f64;
    let mut places: Vec<DVec2> = (0..STEPS * STEPS)
        .map(|k| low.truncate() + size.truncate() * DVec2::new(part(k % STEPS), part(k / STEPS)))
        .chain([middle.truncate()])
        .collect();
    places.sort_by(|a, b| a.distance(middle.truncate()).total_cmp(&b.distance(middle.truncate())));
    let gap = |place: &DVec2| {
        let heights = heights(scene, *place);
        let gaps = heights.windows(2).rev().map(|pair| (pair[0], pair[1]));
        gaps.into_iter().find(|(below, above)| above - below >= LOW * size.z && above > below)
    };
    let found = places.iter().find_map(|place| Some((*place, gap(place)?)));
    let (place, (below, above)) = found.unwrap_or((middle.truncate(), (low.z, high.z)));
    let drop = (0.2 * (above - below)).min(0.3);
    place.extend(if above > below { above - drop } else { scene.room.size_m.z / 2.0 })
}

/// Where a vertical line meets surfaces, from below.
fn heights(scene: &Imported, at: DVec2) -> Vec<f64> {
    let mut heights: Vec<f64> = if scene.told.room.is_of_scene { vec![scene.low_m.z, scene.high_m.z] } else { vec![] };
    for part in &scene.meshes {
        heights.extend(part.mesh.triangles.iter().filter_map(|t| {
            let [a, b, c] = t.map(|v| part.mesh.vertices_m[v as usize] + scene.origin_m);
            let flat = |p: DVec3, q: DVec3| (p.truncate() - at).perp_dot(q.truncate() - at);
            let weights = [flat(b, c), flat(c, a), flat(a, b)];
            let sum: f64 = weights.iter().sum();
            let is_met = sum != 0.0 && weights.iter().all(|w| w * sum >= 0.0);
            is_met.then(|| (weights[0] * a.z + weights[1] * b.z + weights[2] * c.z) / sum)
        }));
    }
    heights.sort_by(f64::total_cmp);
    heights
}
