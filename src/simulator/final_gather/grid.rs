//! Where reflected light is known on the faces: polynomials on rectangles that are narrow along the room's edges, where
//! it changes like x ln x.

use glam::{DVec2, DVec3};

use super::bicubic::{Bicubic, NODES};
use super::face::{Cover, Face, mean_wall_m2};
use super::surroundings::Surroundings;

/// Width of the strips along a room's edges, of the shorter side of a face.
const STRIP: f64 = 1.0 / 16.0;
/// Sides of rectangles between the strips at most, of the room's mean wall.
const SIDE: f64 = 0.3;
/// Cuts that bodies on a face add at most; beyond, rectangles stay partly covered.
const MOST_CUTS: usize = 10;
/// Cuts closer than this to another, of the face, are left out.
const APART: f64 = 0.02;

/// The rectangles of all faces.
#[derive(Debug)]
pub(super) struct Grid {
    faces: Vec<Face>,
    cuts: Vec<[Vec<f64>; 2]>,
    /// Number of the first rectangle of each face.
    first: Vec<usize>,
    pub(super) bicubic: Bicubic,
    /// The side that rectangles have at most.
    side_m: f64,
    /// Bodies that stand on each face, as rectangles.
    covers: Vec<Vec<[DVec2; 2]>>,
}

/// A place in a rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) rectangle: u32,
    /// In 0..1 along both sides.
    pub(super) t: [f32; 2],
}

impl Grid {
    pub(super) fn new(surroundings: &Surroundings) -> Self {
        let faces = surroundings.faces.clone();
        let size_m = surroundings.room.map_or(DVec3::ZERO, |room| room.size_m);
        let side_m = SIDE * mean_wall_m2(size_m).sqrt();
        let covers: Vec<Vec<[DVec2; 2]>> = faces.iter().map(|face| surroundings.covers(face)).collect();
        let cut = |index: usize, k: usize| {
            let face = &faces[index];
            let [low, high] = face.corners_m.map(|c| c[k]);
            let (length, end) = (high - low, face.on(size_m)[k]);
            let strip = STRIP * face.size_m().min_element();
            let [from, to] =
                [if low == 0.0 { low + strip } else { low }, if high == end { high - strip } else { high }];
            let inner = ((to - from) / side_m).ceil().max(1.0);
            let mut cuts: Vec<f64> = (0..=inner as usize).map(|j| from + (to - from) * j as f64 / inner).collect();
            cuts.extend([low, high]);
            let edges = covers[index].iter().flatten().map(|p| p[k]).filter(|edge| *edge > low && *edge < high);
            let before = cuts.len();
            for edge in edges {
                let is_apart = cuts.iter().all(|c| (c - edge).abs() > APART * length);
                if is_apart && cuts.len() < before + MOST_CUTS {
                    cuts.push(edge);
                }
            }
            cuts.sort_by(f64::total_cmp);
            cuts.dedup();
            cuts
        };
        let cuts: Vec<[Vec<f64>; 2]> = (0..faces.len()).map(|face| [cut(face, 0), cut(face, 1)]).collect();
        let mut first = vec![0];
        for [a, b] in &cuts {
            first.push(first[first.len() - 1] + (a.len() - 1) * (b.len() - 1));
        }
        Self { faces, cuts, first, bicubic: Bicubic::new(), side_m, covers }
    }

    /// Rectangles of all faces.
    pub(super) fn len(&self) -> usize {
        self.first[self.faces.len()]
    }

    /// The place in its rectangle of a point on a face.
    pub(super) fn spot(&self, face: usize, point_m: DVec3) -> Spot {
        let at_m = self.faces[face].on(point_m);
        let place = |k: usize| {
            let cuts = &self.cuts[face][k];
            let j = cuts.partition_point(|c| *c <= at_m[k]).clamp(1, cuts.len() - 1) - 1;
            (j, ((at_m[k] - cuts[j]) / (cuts[j + 1] - cuts[j])) as f32)
        };
        let ((i, u), (j, v)) = (place(0), place(1));
        let rectangle = self.first[face] + i * (self.cuts[face][1].len() - 1) + j;
        Spot { rectangle: rectangle as u32, t: [u, v] }
    }

    /// Face, corner and size of a rectangle.
    fn rectangle(&self, index: usize) -> (usize, DVec2, DVec2) {
        let face = self.first.partition_point(|f| *f <= index) - 1;
        let across = self.cuts[face][1].len() - 1;
        let (i, j) = ((index - self.first[face]) / across, (index - self.first[face]) % across);
        let [a, b] = &self.cuts[face];
        let corner = DVec2::new(a[i], b[j]);
        (face, corner, DVec2::new(a[i + 1], b[j + 1]) - corner)
    }

    /// Longer side of a rectangle.
    pub(super) fn longer_m(&self, index: usize) -> f64 {
        self.rectangle(index).2.max_element()
    }

    /// Area of a rectangle in parts of the largest that is made.
    pub(super) fn part(&self, index: usize) -> f64 {
        self.rectangle(index).2.element_product() / (self.side_m * self.side_m)
    }

    /// The face of a rectangle, and its nodes.
    pub(super) fn nodes(&self, index: usize) -> (&Face, [DVec3; NODES]) {
        let (face, corner, size) = self.rectangle(index);
        let face = &self.faces[face];
        (face, std::array::from_fn(|k| face.off(corner + self.bicubic.node(k) * size)))
    }

    /// How much of a rectangle bodies cover.
    pub(super) fn cover(&self, index: usize) -> Cover {
        let (face, corner_m, size_m) = self.rectangle(index);
        Cover::of(&self.covers[face], corner_m, size_m)
    }
}
