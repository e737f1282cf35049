//! Meshes among the obstacles, each as a file of its own.

use glam::DVec3;
use luminaire::geometry::obj;
use luminaire::scene::Shape;

use super::frame::Frame;
use super::{Job, SceneFile};

#[derive(Clone, Copy, Debug)]
pub(super) enum Mesh {
    Obj,
    Ply,
}

/// The files of a job's meshes.
pub(super) fn files(job: &Job, frame: &Frame, format: Mesh) -> Vec<SceneFile> {
    let mesh = |(k, obstacle): (usize, &luminaire::scene::Obstacle)| match &obstacle.shape {
        Shape::Box { .. } => None,
        Shape::Mesh { vertices_m, triangles } => {
            let vertices: Vec<DVec3> = vertices_m.iter().map(|v| frame.to_scene(*v)).collect();
            let text = match format {
                Mesh::Obj => obj::write(ABOUT, &vertices, triangles),
                Mesh::Ply => ply(&vertices, triangles),
            };
            Some(SceneFile::text(&name(k, format), text))
        }
    };
    job.scene.obstacles.iter().enumerate().filter_map(mesh).collect()
}

/// The file of obstacle `k`.
pub(super) fn name(k: usize, format: Mesh) -> String {
    let ending = match format {
        Mesh::Obj => "obj",
        Mesh::Ply => "ply",
    };
    format!("obstacle-{k}.{ending}")
}

const ABOUT: &str = "an obstacle, in the coordinates of the scene";

fn ply(vertices: &[DVec3], triangles: &[[u32; 3]]) -> String {
    let header = format!(
        "ply\nformat ascii 1.0\ncomment {ABOUT}\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        triangles.len()
    );
    let vertex = |v: &DVec3| format!("{} {} {}\n", v.x, v.y, v.z);
    let face = |[a, b, c]: &[u32; 3]| format!("3 {a} {b} {c}\n");
    let lines = vertices.iter().map(vertex).chain(triangles.iter().map(face));
    std::iter::once(header).chain(lines).collect()
}
