//! Laws of surfaces: the division of a wall does not matter, and a closed room of one reflectance has a known mean.

use glam::DVec3;
use luxproof_calculators::inverse_square;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{LuminaireModel, Obstacle, Shape, Transport};

use super::furnace::furnace;
use super::{Against, Law, Light, Variant};
use luxproof_engines::Job;

/// The laws, in the order of reports.
pub(super) const LAWS: &[Law] = &[
    Law {
        id: "wall_patches",
        what: "a wall covered with thin plates of its own reflectance: the same reflected light",
        unit: "plates",
        magnitudes: &[1.0, 4.0, 16.0, 64.0],
        light: Light::Reflected,
        variant: |job, plates| cover_wall(job, plates.sqrt() as usize, 1.0, 1e-5),
    },
    Law {
        id: "thin_panel",
        what: "a plate of the wall's own reflectance on it, ever thinner: the same reflected light",
        unit: "thickness / room",
        magnitudes: &[1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9],
        light: Light::Reflected,
        variant: |job, thickness| cover_wall(job, 1, 0.5, thickness),
    },
    Law {
        id: "sliver",
        what: "a strip of the wall's own reflectance on it, ever narrower: the same reflected light",
        unit: "aspect",
        magnitudes: &[10.0, 1e2, 1e4, 1e6],
        light: Light::Reflected,
        variant: |job, aspect| cover_wall(job, 1, 1.0 / aspect, 1e-5_f64.min(0.1 / aspect)),
    },
    Law {
        id: "reflectance",
        what: "a closed room of one reflectance: the mean of reflected light is flux x rho / (area x (1 - rho))",
        unit: "rho",
        magnitudes: &[0.0, 0.5, 0.9, 0.99, 0.999, 1.0 - 1e-6, 1.0 - 1e-9],
        light: Light::Reflected,
        variant: |job, rho| furnace(without_bodies(job), rho),
    },
    Law {
        id: "near_ceiling",
        what: "luminaires ever closer below the ceiling of a closed room of one reflectance: the same mean of reflected light",
        unit: "m",
        magnitudes: &[1.0, 0.1, 1e-2, 1e-3, 1e-6, 0.0],
        light: Light::Reflected,
        variant: |job, below_m| {
            let mut job = without_bodies(job);
            let height_m = job.scene.room?.size_m.z;
            job.scene.luminaires.iter_mut().for_each(|l| l.position_m.z = height_m - below_m);
            if below_m < height_m { furnace(job, 0.5) } else { None }
        },
    },
];

/// The job without bodies, and with its luminaires as points.
fn without_bodies(job: &Job) -> Job {
    let mut job = job.clone();
    job.scene.obstacles.clear();
    job.scene.luminaires.iter_mut().for_each(|l| l.model = LuminaireModel::Point);
    job
}

/// Covers the wall x = 0 with `n` x `n` plates; each is `part` as wide as its share of the wall.
///
/// `None` where a meter, a luminaire or a body is too close to the wall.
fn cover_wall(job: &Job, n: usize, part: f64, thickness: f64) -> Option<Variant> {
    let room = job.scene.room?;
    let thick = thickness * room.size_m.max_element();
    let reflectance = room.reflectance.of(Surface::WallXMin);
    let mut job = job.clone();
    let meters = job.sensors.iter().map(|s| s.meter.position_m.x);
    let nearest = meters.chain(job.scene.luminaires.iter().map(|l| l.position_m.x)).fold(f64::INFINITY, f64::min);
    let is_blocked = job.scene.obstacles.iter().any(|o| match &o.shape {
        Shape::Box { min_m, .. } => min_m.x <= thick,
        Shape::Mesh { vertices_m, .. } => vertices_m.iter().any(|v| v.x <= thick),
    });
    if nearest <= 100.0 * thick || is_blocked {
        return None;
    }
    let share = room.size_m / n as f64;
    for k in 0..n * n {
        let (i, j) = ((k % n) as f64, (k / n) as f64);
        let (y, z) = ((i + 0.5 * (1.0 - part)) * share.y, j * share.z);
        // Neighboring plates share their edges to the last digit.
        let far_y = if part == 1.0 { (i + 1.0) * share.y } else { y + part * share.y };
        let min_m = DVec3::new(0.0, y, z);
        let max_m = DVec3::new(thick, far_y, (j + 1.0) * share.z).min(room.size_m);
        job.scene.obstacles.push(Obstacle { shape: Shape::Box { min_m, max_m }, reflectance });
    }
    matches!(job.transport, Transport::Indirect(_)).then_some(Variant { job, against: Against::Base(1.0) })
}

/// Direct light of point luminaires in an empty room: the inverse-square law.
pub(super) fn known_direct(job: Job) -> Option<Variant> {
    let mut known = vec![];
    for sensor in &job.sensors {
        known.push(inverse_square::direct_illuminance(&job.scene, &sensor.meter).ok()?.illuminance.value());
    }
    Some(Variant { job, against: Against::Known(known) })
}
