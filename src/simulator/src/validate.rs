//! What a scene and its meters must fulfil before any solver sees them: a silently wrong value is worse than an error.

use glam::DVec3;

use super::{Accuracy, SimulatorError};
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Meter, Scene, Shape};

/// Meters nearer to a surface than this fraction of the room lie on it.
const ON_SURFACE: f64 = 1e-12;

pub(super) fn accuracy(accuracy: &Accuracy) -> Result<(), SimulatorError> {
    if accuracy.relative_error.is_finite() && accuracy.relative_error > 0.0 {
        return Ok(());
    }
    let problem = format!("is {}", accuracy.relative_error);
    invalid("the relative error asked for", problem, "give a positive number")
}

pub(super) fn scene(scene: &Scene) -> Result<(), SimulatorError> {
    if let Some(room) = &scene.room {
        if !(room.size_m.is_finite() && room.size_m.cmpgt(DVec3::ZERO).all()) {
            let problem = format!("measures {} m", room.size_m);
            return invalid("the room", problem, "give three positive lengths");
        }
        for surface in Surface::ALL {
            reflectance(surface.name(), room.reflectance.of(surface))?;
        }
        let all = Surface::ALL.map(|s| room.reflectance.of(s));
        if all.iter().all(|rho| *rho == 1.0) {
            let problem = "reflects all light on all six surfaces".to_owned();
            return invalid("the room", problem, "some reflectance must be below 1, or the light never ends");
        }
    }
    for (k, obstacle) in scene.obstacles.iter().enumerate() {
        let what = format!("obstacle {k}");
        reflectance(&what, obstacle.reflectance)?;
        match &obstacle.shape {
            Shape::Box { min_m, max_m } => {
                if !(min_m.is_finite() && max_m.is_finite() && max_m.cmpgt(*min_m).all()) {
                    return invalid(&what, format!("spans {min_m} to {max_m}"), "give each axis a positive extent");
                }
            }
            Shape::Mesh { vertices_m, triangles } => {
                let count = vertices_m.len();
                if vertices_m.iter().any(|v| !v.is_finite()) || triangles.iter().flatten().any(|i| *i as usize >= count)
                {
                    let problem = "has a vertex that is missing or not finite".to_owned();
                    return invalid(&what, problem, "repair the mesh");
                }
            }
        }
    }
    for luminaire in &scene.luminaires {
        let what = format!("luminaire {}", luminaire.id);
        let (p, scale) = (luminaire.position_m, luminaire.flux_scale);
        if !(p.is_finite() && luminaire.orientation.is_finite()) {
            return invalid(&what, format!("stands at {p}"), "give finite coordinates and angles");
        }
        let product = luminaire.orientation * luminaire.orientation.transpose() - glam::DMat3::IDENTITY;
        if product.to_cols_array().iter().any(|x| x.abs() > 1e-9) {
            return invalid(&what, "is turned by a matrix that is no rotation".to_owned(), "use scene::orientation");
        }
        if !(scale.is_finite() && scale >= 0.0) {
            return invalid(&what, format!("has a flux scale of {scale}"), "give a number that is not negative");
        }
        if scene.room.is_some_and(|room| !room.contains(p, 0.0)) {
            return invalid(&what, format!("stands at {p}, outside the room"), "move it inside");
        }
    }
    Ok(())
}

pub(super) fn meters(scene: &Scene, meters: &[Meter]) -> Result<(), SimulatorError> {
    for (k, meter) in meters.iter().enumerate() {
        let what = format!("meter {k}");
        let p = meter.position_m;
        if !p.is_finite() || !meter.normal.is_finite() || (meter.normal.length() - 1.0).abs() > 1e-9 {
            let problem = format!("at {p} faces {}", meter.normal);
            return invalid(&what, problem, "give finite coordinates and a normal of length 1");
        }
        if scene.room.is_some_and(|room| !room.contains(p, ON_SURFACE * room.size_m.max_element())) {
            let problem = format!("at {p} lies on a surface of the room or outside it");
            return invalid(&what, problem, "move it inside, a stated distance off the surface");
        }
        if let Some(body) = scene.obstacles.iter().position(|o| holds(&o.shape, p)) {
            let problem = format!("at {p} lies in or on obstacle {body}");
            return invalid(&what, problem, "move it off, a stated distance from the surface");
        }
        if let Some(luminaire) = scene.luminaires.iter().find(|l| l.position_m == p) {
            let problem = format!("lies in the photometric centre of luminaire {}", luminaire.id);
            return invalid(&what, problem, "move it away");
        }
    }
    Ok(())
}

fn holds(shape: &Shape, p: DVec3) -> bool {
    matches!(shape, Shape::Box { min_m, max_m } if p.cmpge(*min_m).all() && p.cmple(*max_m).all())
}

fn reflectance(what: &str, rho: f64) -> Result<(), SimulatorError> {
    if (0.0..=1.0).contains(&rho) {
        return Ok(());
    }
    invalid(what, format!("has a reflectance of {rho}"), "give a number from 0 to 1")
}

fn invalid<T>(what: &str, problem: String, remedy: &'static str) -> Result<T, SimulatorError> {
    Err(SimulatorError::Invalid { what: what.to_owned(), problem, remedy })
}
