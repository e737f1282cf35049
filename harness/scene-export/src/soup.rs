//! The surfaces of a scene as meshes of one reflectance.

use glam::DVec3;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Scene, Shape};

/// A mesh of one diffuse reflectance, in metres, z up.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    pub(crate) name: String,
    pub(crate) reflectance: f64,
    pub(crate) vertices_m: Vec<DVec3>,
    /// Counter-clockwise seen from the side that light reaches.
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// The six surfaces of the room, then the bodies.
pub(crate) fn meshes(scene: &Scene) -> Vec<Mesh> {
    let mut meshes = vec![];
    if let Some(room) = &scene.room {
        for surface in Surface::ALL {
            let corners = room.corners(surface);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[1]);
            let faces_in = normal.dot(surface.inward_normal()) > 0.0;
            let triangles = if faces_in { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
            meshes.push(Mesh {
                name: surface.name().into(),
                reflectance: room.reflectance.of(surface),
                vertices_m: corners.to_vec(),
                triangles: triangles.to_vec(),
            });
        }
    }
    for (k, obstacle) in scene.obstacles.iter().enumerate() {
        let (vertices_m, triangles) = match &obstacle.shape {
            Shape::Box { min_m, max_m } => cuboid(*min_m, *max_m),
            Shape::Mesh { vertices_m, triangles } => (vertices_m.clone(), triangles.clone()),
        };
        meshes.push(Mesh { name: format!("obstacle-{k}"), reflectance: obstacle.reflectance, vertices_m, triangles });
    }
    meshes
}

/// The corners and outward triangles of a box; bit `a` of a corner's index says which end of axis `a` it is at.
fn cuboid(min_m: DVec3, max_m: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corners_m = (0..8_u32).map(|index| {
        let is_high = glam::BVec3::new(index & 1 != 0, index & 2 != 0, index & 4 != 0);
        DVec3::select(is_high, max_m, min_m)
    });
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    (corners_m.collect(), triangles)
}
