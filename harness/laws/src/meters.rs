//! Laws of meters: readings are exact however near a surface, an edge, a corner or a luminaire the meter is.

use glam::DVec3;
use luxproof_scene::{LuminaireModel, Meter, Transport};

use super::surfaces::known_direct;
use super::{Against, Law, Light, Variant};
use luxproof_engines::{Job, Sensor};
use luxproof_model::MeterId;

/// The law of meters near a surface; others differ in their meters.
const NEAR_SURFACE: Law = Law {
    id: "meter_near_surface",
    what: "meters ever closer to floor, ceiling and a wall: what the exact values are there",
    unit: "m",
    magnitudes: &[0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6],
    light: Light::Either,
    variant: |job, off_m| {
        let size_m = job.scene.room?.size_m;
        let (u, v) = (0.31, 0.42);
        let meters = [
            (DVec3::new(u * size_m.x, v * size_m.y, off_m), DVec3::Z),
            (DVec3::new(u * size_m.x, v * size_m.y, size_m.z - off_m), DVec3::NEG_Z),
            (DVec3::new(off_m, v * size_m.y, u * size_m.z), DVec3::X),
        ];
        with_meters(job, &meters)
    },
};

/// The laws, in the order of reports.
pub(super) const LAWS: &[Law] = &[
    NEAR_SURFACE,
    Law {
        id: "meter_near_edge",
        what: "meters ever closer to edges of the room: what the exact values are there",
        variant: |job, off_m| {
            let size_m = job.scene.room?.size_m;
            let low = DVec3::new(off_m, 0.42 * size_m.y, off_m);
            let high = DVec3::new(off_m, 0.42 * size_m.y, size_m.z - off_m);
            with_meters(job, &[(low, DVec3::Z), (low, DVec3::X), (high, DVec3::NEG_Z)])
        },
        ..NEAR_SURFACE
    },
    Law {
        id: "meter_near_corner",
        what: "meters ever closer to corners of the room: what the exact values are there",
        variant: |job, off_m| {
            let size_m = job.scene.room?.size_m;
            let (low, high) = (DVec3::splat(off_m), size_m - off_m);
            with_meters(job, &[(low, DVec3::Z), (low, DVec3::ONE.normalize()), (high, DVec3::NEG_Z)])
        },
        ..NEAR_SURFACE
    },
    Law {
        id: "meter_near_luminaire",
        what: "meters ever closer to a point luminaire: the inverse-square law",
        unit: "m",
        magnitudes: &[1.0, 0.1, 1e-2, 1e-3, 1e-4],
        light: Light::Direct,
        variant: |job, distance_m| {
            let mut job = job.clone();
            let from = job.scene.luminaires.iter().find(|l| l.model == LuminaireModel::Point)?.position_m;
            let paths = [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.48, 0.64, -0.6)];
            let meters = paths.map(|path| Meter { position_m: from + distance_m * path, normal: -path });
            job.sensors = sensors(&meters);
            known_direct(job)
        },
    },
];

/// Sensors at meters, by their index.
fn sensors(meters: &[Meter]) -> Vec<Sensor> {
    meters.iter().enumerate().map(|(k, meter)| Sensor { id: MeterId::new("m", k), meter: *meter }).collect()
}

/// The job with other meters, given by position and normal; the closed form or the exact simulation is their reference.
fn with_meters(job: &Job, meters: &[(DVec3, DVec3)]) -> Option<Variant> {
    job.scene.room?;
    let mut job = job.clone();
    let meters: Vec<Meter> = meters.iter().map(|&(position_m, normal)| Meter { position_m, normal }).collect();
    job.sensors = sensors(&meters);
    if job.transport == Transport::Direct
        && let Some(known) = known_direct(job.clone())
    {
        return Some(known);
    }
    Some(Variant { job, against: Against::Witness })
}
