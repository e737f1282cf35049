//! Triangle meshes in `f64`, read from Wavefront OBJ files.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::obj::{Face, Obj};
use super::polygon::Triangulator;

/// A triangle mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertices in metres.
    pub vertices_m: Vec<DVec3>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Why a file gave no mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file cannot be opened.
    #[error("{path}: {reason}; check the path", path = path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        reason: String,
    },
    /// A line that no OBJ file has, or a polygon that is none.
    #[error("{path}:{line}: {reason}; repair the file, or export it again as Wavefront OBJ", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong there.
        reason: String,
    },
    /// A vertex with a coordinate that is no number to reckon with.
    #[error("{path}: vertex {vertex} (counted from 0) is {at:?}, which is not finite or beyond 1e90 m; repair the file", path = path.display(), at = at.to_array())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Index of the vertex.
        vertex: usize,
        /// What it is.
        at: DVec3,
    },
    /// No face at all.
    #[error("{path} holds no face; export the mesh with its faces", path = path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// The solid angle of a triangle seen from the origin, in steradians; negative where its back is seen.
///
/// A. van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125, eq. 8.
pub fn solid_angle_sr([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).atan2(below)
}

/// The part of the whole sphere that the faces of a closed body fill around a point inside it, but for gaps of rounded corners.
const CLOSED_PART: f64 = 0.999;
/// The part of half the sphere beyond which a triangle fills so much of it only because the point is on it.
const HALF_PART: f64 = 1.0 - 1e-9;

/// Whether a point lies inside a closed body of these triangles: its faces then fill the whole sphere around the point.
///
/// An open one, a lampshade say, leaves a part of it. What faces inwards is a room, as imported scenes have it. A point on a face
/// is not inside: a face that the point is on counts as nothing, and the others fill half of the sphere at most.
pub fn is_inside_closed(vertices_m: &[DVec3], triangles: &[[u32; 3]], point_m: DVec3) -> bool {
    let corners = triangles.iter().map(|t| t.map(|k| vertices_m[k as usize] - point_m));
    let seen = corners.map(solid_angle_sr).filter(|sr| sr.abs() < HALF_PART * 2.0 * std::f64::consts::PI);
    seen.sum::<f64>() > CLOSED_PART * 4.0 * std::f64::consts::PI
}

/// The farthest that a vertex may be off, so that a volume is a number.
const FAR_M: f64 = 1e90;

/// The point of a triangle that is closest to a point (Ericson, *Real-Time Collision Detection*, 2005, 5.1.5).
fn closest_on_triangle([a, b, c]: [DVec3; 3], p: DVec3) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + (ab * vb + ac * vc) / (va + vb + vc)
}

impl Mesh {
    /// The point of a mesh's triangles that is closest to a point, in metres; infinitely far where there is no triangle.
    pub fn closest_point_m(vertices_m: &[DVec3], triangles: &[[u32; 3]], point_m: DVec3) -> DVec3 {
        let closest = |triangle: &[u32; 3]| closest_on_triangle(triangle.map(|k| vertices_m[k as usize]), point_m);
        let all = triangles.iter().map(closest).filter(|p| p.is_finite());
        let nearest = all.min_by(|a, b| a.distance_squared(point_m).total_cmp(&b.distance_squared(point_m)));
        nearest.unwrap_or(DVec3::INFINITY)
    }

    /// Reads the faces of every object of an OBJ file, one unit a metre, polygons cut into triangles, concave ones too.
    ///
    /// Axes are taken as they stand, x, y, z with z up. Materials, normals, texture, points and lines are passed over.
    pub fn read_obj(path: &Path) -> Result<Self, MeshError> {
        let file =
            File::open(path).map_err(|error| MeshError::Unreadable { path: path.into(), reason: error.to_string() })?;
        Self::parse_obj(&mut BufReader::new(file), path)
    }

    /// The same from a reader; `path` stands in messages only.
    pub fn parse_obj(reader: &mut impl BufRead, path: &Path) -> Result<Self, MeshError> {
        let mut whole = Self::default();
        Self::groups_of_obj(reader, path)?.into_iter().for_each(|(_, group)| whole.append(group));
        Ok(whole)
    }

    /// The faces of an OBJ file by the name of their group (`g`) or object (`o`), each name once.
    pub fn groups_of_obj(reader: &mut impl BufRead, path: &Path) -> Result<Vec<(String, Self)>, MeshError> {
        let malformed = |line, reason: String| MeshError::Malformed { path: path.into(), line, reason };
        let obj = Obj::read(reader).map_err(|fault| malformed(fault.line, fault.message))?;
        let mut groups: Vec<(String, Self)> = obj.groups.iter().map(|name| (name.clone(), Self::default())).collect();
        let mut faces: Vec<&Face> = obj.faces.iter().collect();
        faces.sort_by_key(|face| face.group);
        // Of each vertex the group that had it last, and its place there: what no face has is no part of a mesh, nor of its extent.
        let mut places = vec![(usize::MAX, 0); obj.vertices.len()];
        let mut triangulator = Triangulator::default();
        for face in faces {
            let corners = obj.corners_of(face);
            let at: Vec<DVec3> = corners.iter().map(|v| obj.vertices[*v as usize]).collect();
            if let Some((k, &at)) = at.iter().enumerate().find(|(_, v)| v.is_nan() || v.abs().max_element() > FAR_M) {
                return Err(MeshError::NotFinite { path: path.into(), vertex: corners[k] as usize, at });
            }
            let cut = triangulator.triangles(&at).map_err(|why| malformed(face.line, why.to_string()))?;
            let mesh = &mut groups[face.group].1;
            for triangle in cut {
                let vertices = triangle.map(|k| {
                    let v = corners[k] as usize;
                    if places[v].0 != face.group {
                        places[v] = (face.group, mesh.vertices_m.len() as u32);
                        mesh.vertices_m.push(obj.vertices[v]);
                    }
                    places[v].1
                });
                mesh.triangles.push(vertices);
            }
        }
        groups.retain(|(_, mesh)| !mesh.triangles.is_empty());
        if groups.is_empty() { Err(MeshError::Empty { path: path.into() }) } else { Ok(groups) }
    }

    /// Adds all of another.
    pub fn append(&mut self, other: Self) {
        let first = self.vertices_m.len() as u32;
        self.vertices_m.extend(other.vertices_m);
        self.triangles.extend(other.triangles.into_iter().map(|t| t.map(|v| first + v)));
    }

    /// Adds a triangle, with corners of its own.
    pub fn push(&mut self, corners_m: [DVec3; 3]) {
        let first = self.vertices_m.len() as u32;
        self.vertices_m.extend(corners_m);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// The same mesh moved by `offset_m`.
    #[must_use]
    pub fn moved(mut self, offset_m: DVec3) -> Self {
        self.vertices_m.iter_mut().for_each(|v| *v += offset_m);
        self
    }

    /// The twelve triangles of an axis-aligned box, facing outwards.
    pub fn cuboid(min_m: DVec3, max_m: DVec3) -> Self {
        let corner = |k: u32| DVec3::select(glam::BVec3::new(k & 1 != 0, k & 2 != 0, k & 4 != 0), max_m, min_m);
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Self {
            vertices_m: (0..8).map(corner).collect(),
            triangles: quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
        }
    }

    /// The volume that a closed mesh encloses, in cubic metres; negative where its faces look inwards.
    pub fn volume_m3(&self) -> f64 {
        let corner = |v: u32| self.vertices_m[v as usize] - self.vertices_m[0];
        self.triangles.iter().map(|[a, b, c]| corner(*a).cross(corner(*b)).dot(corner(*c)) / 6.0).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn parse(text: &str) -> Result<Mesh, MeshError> {
        Mesh::parse_obj(&mut text.as_bytes(), Path::new("desk.obj"))
    }

    #[test]
    fn a_cuboid_encloses_its_volume_facing_outwards() {
        let mesh = Mesh::cuboid(DVec3::new(1.0, 1.0, 0.0), DVec3::new(2.6, 1.8, 0.75));
        assert_relative_eq!(mesh.volume_m3(), 1.6 * 0.8 * 0.75, max_relative = 1e-12);
        let moved = mesh.clone().moved(DVec3::new(100.0, -3.0, 7.0));
        assert_relative_eq!(moved.volume_m3(), mesh.volume_m3(), max_relative = 1e-11);
        assert_eq!(moved.vertices_m[0], DVec3::new(101.0, -2.0, 7.0));
    }

    /// Two triangles of a sheet fill half of the sphere each, or so, around a point on the edge between them.
    #[test]
    fn nothing_is_inside_a_sheet_or_on_a_face() {
        let cuboid = Mesh::cuboid(DVec3::new(-0.3, -0.1, 0.0), DVec3::new(0.3, 0.1, 0.2));
        for turn_deg in 0..180 {
            let turn = glam::DQuat::from_rotation_z(f64::from(turn_deg).to_radians());
            let at_m = DVec3::new(4.5, 1.0, 3.0);
            let is_inside = |triangles: &[[u32; 3]], point_m: DVec3| {
                let vertices_m: Vec<DVec3> = cuboid.vertices_m.iter().map(|v| at_m + turn * *v).collect();
                is_inside_closed(&vertices_m, triangles, at_m + turn * point_m)
            };
            let bottom = cuboid.triangles.iter().filter(|t| t.iter().all(|k| cuboid.vertices_m[*k as usize].z == 0.0));
            let bottom: Vec<[u32; 3]> = bottom.copied().collect();
            let turned: Vec<[u32; 3]> = bottom.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
            for sheet in [bottom, turned] {
                assert_eq!(sheet.len(), 2);
                assert!(!is_inside(&sheet, DVec3::ZERO), "{turn_deg}");
            }
            for outside in [DVec3::ZERO, DVec3::new(0.0, 0.0, -1e-6), DVec3::new(0.0, 0.0, 0.201)] {
                assert!(!is_inside(&cuboid.triangles, outside), "{turn_deg} {outside}");
            }
            for inside in [DVec3::new(0.0, 0.0, 1e-6), DVec3::new(0.29, -0.09, 0.19), DVec3::new(0.0, 0.0, 0.1)] {
                assert!(is_inside(&cuboid.triangles, inside), "{turn_deg} {inside}");
            }
        }
    }

    #[test]
    fn coordinates_keep_double_precision_and_polygons_become_triangles() {
        let text = "# two objects\nmtllib missing.mtl\no a\nv 0 0 0.1234567890123456\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\n\
                    f 1 2 3 4\no b\nv 0 0 5\nf 5 -4 2\n";
        let mesh = parse(text).unwrap();
        assert_eq!(mesh.triangles.len(), 3);
        assert_eq!(mesh.vertices_m[0].z, 0.1234567890123456);
        let last = mesh.triangles[2].map(|v| mesh.vertices_m[v as usize]);
        assert_eq!(last, [DVec3::new(0.0, 0.0, 5.0), DVec3::X, DVec3::X]);
    }

    #[test]
    fn what_is_no_mesh_is_refused_with_the_file_named() {
        for (text, expected) in [
            ("v 0 0 0\n", "holds no face"),
            ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
            ("v 0 0 1e308\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "[0.0, 0.0, 1e308], which is not finite or beyond 1e90 m"),
            (
                "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
                "desk.obj:4: there is no vertex 9: the file has 3; repair the file",
            ),
            ("v 0 0 x\n", "desk.obj:1: `x` is no number"),
            ("v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 1 0\nf 1 2 3 4\n", "desk.obj:5: its edges cross"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("desk.obj"), "{text}: {message}");
        }
        let absent = Mesh::read_obj(Path::new("no/such.obj")).unwrap_err().to_string();
        assert!(absent.contains("no/such.obj"), "{absent}");
    }
}
