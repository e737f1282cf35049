//! Meshes among the obstacles, each as an OBJ file of its own.

use glam::DVec3;
use luminaire::scene::Shape;

use super::frame::Frame;
use super::{Job, SceneFile};

/// The files of a job's meshes.
pub(super) fn files(job: &Job, frame: &Frame) -> Vec<SceneFile> {
    let mesh = |(k, obstacle): (usize, &luminaire::scene::Obstacle)| match &obstacle.shape {
        Shape::Box { .. } => None,
        Shape::Mesh { vertices_m, triangles } => Some(SceneFile::text(&name(k), obj(vertices_m, triangles, frame))),
    };
    job.scene.obstacles.iter().enumerate().filter_map(mesh).collect()
}

/// The file of obstacle `k`.
pub(super) fn name(k: usize) -> String {
    format!("obstacle-{k}.obj")
}

fn obj(vertices_m: &[DVec3], triangles: &[[u32; 3]], frame: &Frame) -> String {
    let vertex = |v: &DVec3| {
        let [x, y, z] = frame.to_scene(*v).to_array();
        format!("v {x} {y} {z}\n")
    };
    let face = |[a, b, c]: &[u32; 3]| format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    let lines = vertices_m.iter().map(vertex).chain(triangles.iter().map(face));
    std::iter::once("# an obstacle, in the coordinates of the scene\n".to_owned()).chain(lines).collect()
}
