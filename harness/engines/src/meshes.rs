//! Meshes among the obstacles, each written to a separate file.

use glam::DVec3;
use luxproof_scene::Shape;
use luxproof_scene::geometry::obj;

use super::frame::Frame;
use super::{Job, SceneFile};

/// The format of a file of a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) enum Mesh {
    Obj,
    Ply,
}

/// Returns the files of a job's meshes.
pub(super) fn files(job: &Job, frame: &Frame, format: Mesh) -> Vec<SceneFile> {
    let mut files = vec![];
    for (k, obstacle) in job.scene.obstacles.iter().enumerate() {
        let Shape::Mesh { vertices_m, triangles } = &obstacle.shape else { continue };
        let vertices: Vec<DVec3> = vertices_m.iter().map(|v| frame.to_scene(*v)).collect();
        let text = match format {
            Mesh::Obj => obj::write(ABOUT, &vertices, triangles),
            Mesh::Ply => ply(&vertices, triangles),
        };
        files.push(SceneFile::text(&name(k, format), text));
    }
    files
}

/// Returns the name of the file of obstacle `k`.
pub(super) fn name(k: usize, format: Mesh) -> String {
    let ending = match format {
        Mesh::Obj => "obj",
        Mesh::Ply => "ply",
    };
    format!("obstacle-{k}.{ending}")
}

const ABOUT: &str = "an obstacle, in the coordinates of the scene";

/// Writes a mesh in the text form of PLY.
fn ply(vertices: &[DVec3], triangles: &[[u32; 3]]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment {ABOUT}\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        triangles.len()
    );
    for v in vertices {
        text += &format!("{} {} {}\n", v.x, v.y, v.z);
    }
    for [a, b, c] in triangles {
        text += &format!("3 {a} {b} {c}\n");
    }
    text
}
