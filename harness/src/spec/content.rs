//! What a task is, whatever its files and luminaires are called: a hash over the content of what is measured.

use glam::{DMat3, DVec3};
use luminaire::scene::Shape;
use sha2::{Digest, Sha256};

use crate::procedures::Task;
use crate::system::digest::hexadecimal;

/// Figures count to nine decimals: angles go through sines, whose last digit is the machine's.
const PER_UNIT: f64 = 1e9;

/// SHA-256, in hexadecimal, of what is measured: room, bodies, luminaires with what their files say of light, the light that
/// counts, and where it is read. Names of files, cases, luminaires and meters, comments, engines and budgets are no part of it.
pub fn content(task: &Task) -> String {
    let mut hash = Sha256::new();
    let mut part = |name: &str, figures: &[f64]| {
        hash.update(format!("{name} {}\n", figures.len()));
        for x in figures {
            // Adding zero makes -0 the zero that it equals.
            hash.update(((x * PER_UNIT).round() + 0.0).to_le_bytes());
        }
    };
    part(task.procedure.name(), &[]);
    part(&task.light().to_string(), &[]);
    if let Some(room) = &task.scene.room {
        let r = room.reflectance;
        let walls = [r.wall_x_min, r.wall_x_max, r.wall_y_min, r.wall_y_max];
        part("room", &[&room.size_m.to_array()[..], &walls, &[r.floor, r.ceiling]].concat());
    }
    for obstacle in &task.scene.obstacles {
        part("obstacle", &[obstacle.reflectance]);
        match &obstacle.shape {
            Shape::Box { min_m, max_m } => part("box", &flat(&[*min_m, *max_m])),
            Shape::Mesh { vertices_m, triangles } => {
                part("vertices", &flat(vertices_m));
                part("triangles", &triangles.iter().flatten().map(|k| f64::from(*k)).collect::<Vec<_>>());
            }
        }
    }
    for luminaire in &task.scene.luminaires {
        let (photometry, DMat3 { x_axis, y_axis, z_axis }) = (&luminaire.photometry, luminaire.orientation);
        part(luminaire.model.name(), &flat(&[luminaire.position_m, x_axis, y_axis, z_axis]));
        part(&format!("{:?}", photometry.opening), &[luminaire.flux_scale]);
        let table = &photometry.distribution;
        let along = |(k, &c): (usize, &f64)| -> Vec<f64> {
            if table.is_native() {
                return table.plane(k).to_vec();
            }
            table.gamma_deg().iter().map(|&gamma| table.intensity(c, gamma).value()).collect()
        };
        if table.is_native() {
            part(&format!("type {:?}", table.goniometer()), &[]);
        }
        part("C", table.c_deg());
        part("gamma", table.gamma_deg());
        part("candela", &table.c_deg().iter().enumerate().flat_map(along).collect::<Vec<_>>());
    }
    for target in &task.targets {
        part("target", &flat(&[target.meter.position_m, target.meter.normal]));
        part("weights", &target.aspects.iter().map(|aspect| aspect.weight).collect::<Vec<_>>());
    }
    hexadecimal(&hash.finalize())
}

fn flat(points: &[DVec3]) -> Vec<f64> {
    points.iter().flat_map(DVec3::to_array).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::record::ProcedureId;
    use crate::spec::Case;

    #[test]
    fn a_case_is_what_it_measures_whatever_it_is_called_and_nothing_else() {
        let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference");
        let text = std::fs::read_to_string(reference.join("specs/axial.yaml")).unwrap();
        let luminaires = reference.join("luminaires/");
        let text = text.replace("../luminaires/", luminaires.to_str().unwrap());
        let folder = tempfile::tempdir().unwrap();
        let of = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            let path = folder.path().join("copy.yaml");
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            content(&Case::load(&path).unwrap().task(ProcedureId::DirectIlluminance).unwrap())
        };
        let original = Case::load(&reference.join("specs/axial.yaml")).unwrap();
        let original = content(&original.task(ProcedureId::DirectIlluminance).unwrap());
        assert_eq!(of("luxproof: 1", "# A copy.\nluxproof: 1"), original);
        assert_eq!(of("relative_error: 0.0005", "relative_error: 0.004"), original);
        assert_ne!(of("axial.ies", "isotropic.ies"), original);
        assert_ne!(of("size_m: [20, 20, 20]", "size_m: [20, 20, 21]"), original);
        assert_ne!(of("ceiling: {points_m: [[2, 2, 17]", "ceiling: {points_m: [[2, 2.001, 17]"), original);
    }
}
