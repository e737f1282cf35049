//! The diffuse surface on which a meter lies: what it sends back of the light that the meter reads is the surface's luminance.

use std::collections::BTreeMap;

use glam::DVec3;

use super::{Meter, Obstacle, Scene, Shape};
use crate::geometry::bvh::{BvhError, Hit, Ray, TriangleBvh};
use crate::geometry::{Mesh, Surface};

/// The farthest a meter may be off the surface that it lies on, in metres.
pub const REACH_M: f64 = 2e-3;
/// Surfaces no farther apart than this, in parts of the scene's largest extent, are in one place: walls of a room of faces that lie
/// in one plane are twice as far apart (`enclosure`).
const TOGETHER: f64 = 5e-7;
/// The sine of the largest angle between a meter's normal and its surface's, .1 degree.
const ASKEW: f64 = 1.8e-3;

/// Every surface of a scene, by what it reflects.
pub struct Surfaces {
    groups: Vec<Group>,
    together_m: f64,
}

struct Group {
    reflectance: f64,
    tree: TriangleBvh,
}

/// Why a meter lies on no surface that would have a luminance.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoSurface {
    /// Nothing is near.
    #[error("lies on no surface: none is within {} mm of it", 1e3 * REACH_M)]
    Far,
    /// It looks elsewhere than its surface does.
    #[error("lies on a surface that faces another way: {normal}")]
    Turned {
        /// Of the surface, on the meter's side.
        normal: DVec3,
    },
    /// Which of them one sees is anybody's guess.
    #[error("lies where surfaces of reflectance {0} and {1} are in one place")]
    Several(f64, f64),
}

impl Surfaces {
    /// Those of the room and of its obstacles.
    pub fn new(scene: &Scene) -> Result<Self, BvhError> {
        // By the bits of a reflectance, which is no negative number.
        let mut meshes: BTreeMap<u64, Mesh> = BTreeMap::new();
        let mut add = |reflectance: f64, mesh| meshes.entry(reflectance.to_bits()).or_default().append(mesh);
        for (room, surface) in scene.room.iter().flat_map(|room| Surface::ALL.map(|surface| (room, surface))) {
            let vertices_m = room.corners(surface).to_vec();
            add(room.reflectance.of(surface), Mesh { vertices_m, triangles: vec![[0, 1, 2], [0, 2, 3]] });
        }
        for Obstacle { shape, reflectance } in &scene.obstacles {
            match shape {
                Shape::Box { min_m, max_m } => add(*reflectance, Mesh::cuboid(*min_m, *max_m)),
                Shape::Mesh { vertices_m, triangles } => add(*reflectance, whole(vertices_m, triangles)?),
            }
        }
        let corners = meshes.values().flat_map(|mesh| &mesh.vertices_m);
        let extent_m = corners.map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let groups = meshes.into_iter().map(|(bits, mesh)| Group::new(f64::from_bits(bits), &mesh));
        let groups = groups.collect::<Result<_, _>>()?;
        Ok(Self { groups, together_m: TOGETHER * extent_m })
    }

    /// How many reflectances there are; each is looked at for every meter.
    pub fn reflectances(&self) -> usize {
        self.groups.len()
    }

    /// The reflectance of the surface on which a meter lies, and whose way it looks.
    pub fn under(&self, meter: &Meter) -> Result<f64, NoSurface> {
        let Meter { position_m, normal } = *meter;
        let Some((reflectance, hit)) = self.nearest(position_m, -normal, REACH_M) else {
            let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
            let ways = std::iter::once(normal).chain(axes);
            let beside = ways.filter_map(|way| Some((way, self.nearest(position_m, way, REACH_M)?.1)));
            let nearest = beside.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance));
            return Err(nearest.map_or(NoSurface::Far, |(way, hit)| NoSurface::Turned { normal: facing(&hit, -way) }));
        };
        let own = facing(&hit, normal);
        if own.cross(normal).length() > ASKEW {
            return Err(NoSurface::Turned { normal: own });
        }
        // What is as near behind it, and what is so near before it that it may lie behind that.
        let behind = (-normal, hit.distance + self.together_m);
        let other = [behind, (normal, 3.0 * self.together_m)].into_iter().find_map(|(way, within_m)| {
            let others = self.groups.iter().filter(|group| group.reflectance != reflectance);
            others.filter(|group| group.closest(position_m, way, within_m).is_some()).map(|g| g.reflectance).next()
        });
        other.map_or(Ok(reflectance), |other| Err(NoSurface::Several(reflectance, other)))
    }

    /// The nearest surface along a unit vector, with its reflectance.
    fn nearest(&self, origin_m: DVec3, way: DVec3, within_m: f64) -> Option<(f64, Hit)> {
        let hits = self.groups.iter().filter_map(|g| Some((g.reflectance, g.closest(origin_m, way, within_m)?)));
        hits.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
    }
}

/// A mesh none of whose indices would become one into another.
fn whole(vertices_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<Mesh, BvhError> {
    let vertices = vertices_m.len();
    let mut corners = triangles.iter().enumerate().flat_map(|(triangle, t)| t.map(|vertex| (triangle, vertex)));
    match corners.find(|(_, vertex)| *vertex as usize >= vertices) {
        Some((triangle, vertex)) => Err(BvhError::NoSuchVertex { triangle, vertex, vertices }),
        None => Ok(Mesh { vertices_m: vertices_m.to_vec(), triangles: triangles.to_vec() }),
    }
}

impl Group {
    fn new(reflectance: f64, mesh: &Mesh) -> Result<Self, BvhError> {
        Ok(Self { reflectance, tree: TriangleBvh::new(&mesh.vertices_m, &mesh.triangles)? })
    }

    fn closest(&self, origin_m: DVec3, direction: DVec3, within_m: f64) -> Option<Hit> {
        self.tree.closest(&Ray { origin_m, direction }, within_m)
    }
}

/// A hit's normal on the side to which a vector points: either side of a surface reflects.
fn facing(hit: &Hit, way: DVec3) -> DVec3 {
    if hit.normal.dot(way) < 0.0 { -hit.normal } else { hit.normal }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Reflectances, Room};

    fn cuboid(min_m: [f64; 3], max_m: [f64; 3], reflectance: f64) -> Obstacle {
        Obstacle { shape: Shape::Box { min_m: min_m.into(), max_m: max_m.into() }, reflectance }
    }

    /// A room with a box on its floor, another beside it whose top is in the same plane, and a sheet that leans.
    fn surfaces() -> Surfaces {
        let mut reflectance = Reflectances::with_equal_walls(0.2, 0.5, 0.7);
        reflectance.wall_x_max = 0.6;
        let sheet = Obstacle {
            shape: Shape::Mesh {
                vertices_m: [[3.0, 1.0, 1.0], [4.0, 1.0, 2.0], [3.0, 2.0, 1.0]].map(DVec3::from).to_vec(),
                triangles: vec![[0, 1, 2]],
            },
            reflectance: 0.35,
        };
        let obstacles =
            vec![cuboid([1.0, 1.0, 0.0], [2.0, 2.0, 0.8], 0.3), cuboid([2.0, 1.0, 0.0], [2.5, 2.0, 0.8], 0.4), sheet];
        let room = Some(Room { size_m: DVec3::new(6.0, 4.0, 3.0), reflectance });
        Surfaces::new(&Scene { room, obstacles, luminaires: vec![] }).unwrap()
    }

    fn under(at: [f64; 3], normal: [f64; 3]) -> Result<f64, NoSurface> {
        surfaces().under(&Meter { position_m: at.into(), normal: DVec3::from(normal).normalize() })
    }

    #[test]
    fn every_surface_is_found_from_the_side_that_it_faces() {
        for (at, normal, rho) in [
            ([0.5, 0.5, 1e-3], [0.0, 0.0, 1.0], 0.2),
            ([0.5, 0.5, 1e-7], [0.0, 0.0, 1.0], 0.2),
            ([0.5, 0.5, 2.999], [0.0, 0.0, -1.0], 0.7),
            ([1e-3, 3.0, 1.0], [1.0, 0.0, 0.0], 0.5),
            ([5.999, 3.0, 1.0], [-1.0, 0.0, 0.0], 0.6),
            ([1.5, 1.5, 0.801], [0.0, 0.0, 1.0], 0.3),
            ([2.2, 1.5, 0.801], [0.0, 0.0, 1.0], 0.4),
            ([0.999, 1.5, 0.4], [-1.0, 0.0, 0.0], 0.3),
            // Either side of a sheet.
            ([3.25 - 7e-4, 1.25, 1.25 + 7e-4], [-1.0, 0.0, 1.0], 0.35),
            ([3.25 + 7e-4, 1.25, 1.25 - 7e-4], [1.0, 0.0, -1.0], 0.35),
            // In a corner of floor and wall each is what it is.
            ([1e-3, 0.5, 1e-3], [0.0, 0.0, 1.0], 0.2),
            ([1e-3, 0.5, 1e-3], [1.0, 0.0, 0.0], 0.5),
        ] {
            assert_eq!(under(at, normal), Ok(rho), "{at:?} {normal:?}");
        }
    }

    #[test]
    fn a_meter_off_every_surface_turned_or_on_two_has_none() {
        assert_eq!(under([0.5, 0.5, 0.01], [0.0, 0.0, 1.0]), Err(NoSurface::Far));
        assert_eq!(under([3.0, 3.0, 1.5], [0.0, 0.0, 1.0]), Err(NoSurface::Far));
        let up = Err(NoSurface::Turned { normal: DVec3::Z });
        for turned in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.01, 1.0]] {
            assert_eq!(under([0.5, 0.5, 1e-3], turned), up, "{turned:?}");
        }
        assert_eq!(under([0.5, 0.5, 1e-3], [0.0, 1e-3, 1.0]), Ok(0.2));
        let both = under([2.0, 1.5, 0.801], [0.0, 0.0, 1.0]).unwrap_err();
        assert!(matches!(both, NoSurface::Several(a, b) if (a - b).abs() > 0.05), "{both}");
    }

    /// A triangle at a height.
    fn plate(z: f64, reflectance: f64) -> Obstacle {
        let vertices_m = [[1.0, 1.0, z], [2.0, 1.0, z], [1.0, 2.0, z]].map(DVec3::from).to_vec();
        Obstacle { shape: Shape::Mesh { vertices_m, triangles: vec![[0, 1, 2]] }, reflectance }
    }

    /// The reflectance under a meter over a plate in a room of floor reflectance .2.
    fn read(plate: Obstacle, z: f64) -> Result<f64, NoSurface> {
        let room = Room { size_m: DVec3::splat(4.0), reflectance: Reflectances::with_equal_walls(0.2, 0.5, 0.7) };
        let scene = Scene { room: Some(room), obstacles: vec![plate], luminaires: vec![] };
        let meter = Meter { position_m: DVec3::new(1.25, 1.25, z), normal: DVec3::Z };
        Surfaces::new(&scene).unwrap().under(&meter)
    }

    #[test]
    fn a_plate_on_a_surface_is_detected_and_so_is_a_meter_behind_a_plate_in_front_of_it() {
        assert!(matches!(read(plate(0.0, 0.4), 1e-3), Err(NoSurface::Several(..))));
        assert_eq!(read(plate(0.0, 0.2), 1e-3), Ok(0.2));
        // As walls of one plane lie: the sheet is what one sees, and a meter between both is not on it.
        assert_eq!(read(plate(4e-6, 0.4), 1e-3), Ok(0.4));
        assert!(matches!(read(plate(4e-6, 0.4), 2e-6), Err(NoSurface::Several(..))));
    }
}
