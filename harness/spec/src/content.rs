//! What a task is, whatever its files and luminaires are called: a hash over the content of what is measured.

use glam::{DMat3, DVec3};
use luxproof_scene::Shape;
use sha2::{Digest, Sha256};

use crate::procedures::Task;
use luxproof_process::digest::hexadecimal;

/// Figures count to nine decimals: angles go through sines, whose last digit is the machine's.
const PER_UNIT: f64 = 1e9;

/// SHA-256, in hexadecimal, of what is measured: room, bodies, luminaires with what their files say of light, the light that
/// counts, and where it is read. Names of files, cases, luminaires and meters, comments, engines and budgets are no part of it.
pub fn content(task: &Task) -> String {
    let mut hash = Sha256::new();
    add_part(&mut hash, task.procedure.name(), &[]);
    add_part(&mut hash, &task.light().to_string(), &[]);
    if let Some(room) = &task.scene.room {
        let r = room.reflectance;
        let walls = [r.wall_x_min, r.wall_x_max, r.wall_y_min, r.wall_y_max];
        add_part(&mut hash, "room", &[&room.size_m.to_array()[..], &walls, &[r.floor, r.ceiling]].concat());
    }
    for obstacle in &task.scene.obstacles {
        add_part(&mut hash, "obstacle", &[obstacle.reflectance]);
        match &obstacle.shape {
            Shape::Box { min_m, max_m } => add_part(&mut hash, "box", &flat(&[*min_m, *max_m])),
            Shape::Mesh { vertices_m, triangles } => {
                add_part(&mut hash, "vertices", &flat(vertices_m));
                add_part(
                    &mut hash,
                    "triangles",
                    &triangles.iter().flatten().map(|k| f64::from(*k)).collect::<Vec<_>>(),
                );
            }
        }
    }
    for luminaire in &task.scene.luminaires {
        let (photometry, DMat3 { x_axis, y_axis, z_axis }) = (&luminaire.photometry, luminaire.orientation);
        add_part(&mut hash, luminaire.model.name(), &flat(&[luminaire.position_m, x_axis, y_axis, z_axis]));
        add_part(&mut hash, &format!("{:?}", photometry.opening), &[luminaire.flux_scale]);
        let table = &photometry.distribution;
        if table.is_native() {
            add_part(&mut hash, &format!("type {:?}", table.goniometer()), &[]);
        }
        add_part(&mut hash, "C", table.c_deg());
        add_part(&mut hash, "gamma", table.gamma_deg());
        let mut candela: Vec<f64> = vec![];
        for (k, &c) in table.c_deg().iter().enumerate() {
            if table.is_native() {
                candela.extend(table.plane(k).to_vec());
            } else {
                candela.extend(table.gamma_deg().iter().map(|&gamma| table.intensity(c, gamma).value()));
            }
        }
        add_part(&mut hash, "candela", &candela);
    }
    for target in &task.targets {
        add_part(&mut hash, "target", &flat(&[target.meter.position_m, target.meter.normal]));
        add_part(&mut hash, "weights", &target.aspects.iter().map(|aspect| aspect.weight).collect::<Vec<_>>());
    }
    hexadecimal(&hash.finalize())
}

/// Adds a part to the hash: its name, how many figures it has, and the figures, rounded.
fn add_part(hash: &mut Sha256, name: &str, figures: &[f64]) {
    hash.update(format!("{name} {}\n", figures.len()));
    for x in figures {
        // Adding zero turns -0 into 0, which it equals.
        hash.update(((x * PER_UNIT).round() + 0.0).to_le_bytes());
    }
}

/// The coordinates of points, in one list.
fn flat(points: &[DVec3]) -> Vec<f64> {
    points.iter().flat_map(DVec3::to_array).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Case;
    use luxproof_model::ProcedureId;

    #[test]
    fn a_case_is_what_it_measures_whatever_it_is_called_and_nothing_else() {
        let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference");
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
