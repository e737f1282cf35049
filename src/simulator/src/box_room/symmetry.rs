//! Symmetries of a box and of the light in it: rows of the operator and first bounces are computed once an orbit.
//!
//! A box always has three mirrors and, with equal sides, the exchange of their axes: 48 operations in a cube. The geometry
//! keeps all of them, whatever the light does; the first bounce and the whole light field keep those that also leave
//! luminaires and reflectances as they are.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::Effort;
use super::grid::{Face, Grid};
use crate::stop::Stop;
use luxproof_photometry::{LuminousIntensityDistribution, Symmetry};
use luxproof_scene::Luminaire;
use luxproof_scene::geometry::{Room, Surface};

/// A symmetry of a box: mirrors, then perhaps axes exchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Operation {
    /// Bit k turns axis k round.
    mirrors: u8,
    /// Component k of an image is component `axes[k]` of what it is the image of.
    axes: [usize; 3],
}

/// All orders of three axes.
const PERMUTATIONS: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];

impl Operation {
    const IDENTITY: Self = Self { mirrors: 0, axes: PERMUTATIONS[0] };

    const fn turns(self, axis: usize) -> bool {
        self.mirrors >> axis & 1 == 1
    }

    /// The place of the image of the k-th of some nodes along an axis.
    fn along(self, axis: usize, count: usize, k: usize) -> usize {
        if self.turns(axis) { count - 1 - k } else { k }
    }

    /// The image of a direction.
    fn of_direction(self, d: DVec3) -> DVec3 {
        let d = d * DVec3::from_array([0, 1, 2].map(|axis| if self.turns(axis) { -1.0 } else { 1.0 }));
        DVec3::from_array(self.axes.map(|axis| d[axis]))
    }

    /// The same as a matrix, whose transpose is its inverse.
    fn matrix(self) -> DMat3 {
        let [x, y, z] = DVec3::AXES.map(|axis| self.of_direction(axis));
        DMat3::from_cols(x, y, z)
    }

    fn of_point(self, p: DVec3, size_m: DVec3) -> DVec3 {
        0.5 * size_m + self.of_direction(p - 0.5 * size_m)
    }

    fn of_face(self, face: Face) -> Face {
        let normal = self.of_direction(face.inward_normal());
        let axis = usize::from(normal.x == 0.0) + usize::from(normal.x == 0.0 && normal.y == 0.0);
        Face(2 * axis + usize::from(normal[axis] < 0.0))
    }
}

/// The symmetries of the room's shape.
fn of_geometry(size_m: DVec3) -> Vec<Operation> {
    let exchanges = PERMUTATIONS.into_iter().filter(|axes| (0..3).all(|k| size_m[axes[k]] == size_m[k]));
    exchanges.flat_map(|axes| (0..8).map(move |mirrors| Operation { mirrors, axes })).collect()
}

/// The symmetries of a room's shape, and which of them its light shares.
#[derive(Clone, Debug)]
pub(super) struct Symmetries {
    pub(super) of_room: Vec<Operation>,
    /// Places in `of_room`.
    pub(super) of_light: Vec<usize>,
}

impl Symmetries {
    /// `None` where it was stopped.
    pub(super) fn of(room: &Room, luminaires: &[Luminaire], stop: &Stop) -> Option<Self> {
        let of_room = of_geometry(room.size_m);
        let of_light = subgroup(&of_room, |k| {
            keeps_reflectances(of_room[k], room) && keeps_luminaires(of_room[k], room, luminaires, stop)
        });
        (!stop.is_due()).then_some(Self { of_room, of_light })
    }

    /// The mirrors alone that light shares, the one that leaves all as it is among them: bit k turns axis k round.
    pub(super) fn mirrors_of_light(&self) -> Vec<u8> {
        let operations = self.of_light.iter().map(|k| self.of_room[*k]);
        operations.filter(|op| op.axes == PERMUTATIONS[0]).map(|op| op.mirrors).collect()
    }

    /// About how many numbers the operator of a grid stores.
    pub(super) fn matrix_entries(&self, size_m: DVec3, effort: &Effort) -> usize {
        let shared = self.of_light.len();
        Grid::count(size_m, effort).pow(2) / (shared * shared.max(8))
    }
}

/// The places of those of a group of operations that are members of a subgroup. Few members are looked at, since products of members are members;
/// products of a member and of one that is none are none.
fn subgroup(group: &[Operation], is_member: impl Fn(usize) -> bool) -> Vec<usize> {
    let images = images_of_uneven(group);
    let mut members: Vec<usize> = vec![];
    let mut others: BTreeSet<usize> = BTreeSet::new();
    for k in 0..group.len() {
        if members.contains(&k) || others.contains(&k) {
            continue;
        }
        if is_member(k) {
            members.push(k);
            // Each product of two, those that this adds among them.
            let mut next = 0;
            while let Some(&a) = members.get(next) {
                for b in members.clone() {
                    let products = products(group, &images, a, b).into_iter().flatten();
                    members.extend(products.filter(|c| !members.contains(c)).collect::<BTreeSet<usize>>());
                }
                next += 1;
            }
        } else {
            others.extend(members.iter().flat_map(|m| products(group, &images, k, *m)).flatten());
        }
    }
    members.sort_unstable();
    members
}

/// The images of a direction of three different components: no two of a group are the same.
fn images_of_uneven(group: &[Operation]) -> Vec<DVec3> {
    group.iter().map(|op| op.of_direction(DVec3::new(1.0, 2.0, 3.0))).collect()
}

/// The places of the products of two of a group of operations, in either order.
fn products(group: &[Operation], images: &[DVec3], a: usize, b: usize) -> [Option<usize>; 2] {
    [(a, b), (b, a)].map(|(last, first)| {
        let product = group[last].of_direction(images[first]);
        images.iter().position(|image| *image == product)
    })
}

/// The reflectance of a face.
pub(super) fn reflectance(room: &Room, face: Face) -> f64 {
    let surface = Surface::ALL.into_iter().find(|s| s.axis() == face.0 / 2 && s.is_far() == (face.0 % 2 == 1));
    surface.map_or(0.0, |s| room.reflectance.of(s))
}

fn keeps_reflectances(op: Operation, room: &Room) -> bool {
    Face::ALL.into_iter().all(|face| reflectance(room, face) == reflectance(room, op.of_face(face)))
}

fn keeps_luminaires(op: Operation, room: &Room, luminaires: &[Luminaire], stop: &Stop) -> bool {
    if op == Operation::IDENTITY {
        return true;
    }
    let mut free: Vec<_> = luminaires.iter().collect();
    luminaires.iter().take_while(|_| !stop.is_due()).all(|luminaire| {
        let image = op.of_point(luminaire.position_m, room.size_m);
        let rounding_m = 1e-13 * room.size_m.max_element();
        let partner = free.iter().position(|other| {
            (other.position_m - image).length() <= rounding_m && is_image(op, luminaire, other, stop)
        });
        partner.map(|k| free.swap_remove(k)).is_some()
    })
}

/// Whether `other` shines as the image of `luminaire` does: at every node and inside every cell of both tables.
fn is_image(op: Operation, luminaire: &Luminaire, other: &Luminaire, stop: &Stop) -> bool {
    let table = &luminaire.photometry.distribution;
    if table.symmetry() == Symmetry::Axial && Arc::ptr_eq(&luminaire.photometry, &other.photometry) {
        let axis = op.of_direction(luminaire.orientation.z_axis);
        return luminaire.flux_scale == other.flux_scale && (axis - other.orientation.z_axis).length() <= 1e-13;
    }
    let tolerance = 1e-12 * table.max_intensity().value() * luminaire.flux_scale;
    match Turn::of(op, luminaire, other) {
        Some(turn) => turn.leads_both_ways(luminaire, other, tolerance, stop),
        None => leads_both_ways(op, luminaire, other, tolerance),
    }
}

/// The same by directions, whatever the axes of tables are.
fn leads_both_ways(op: Operation, luminaire: &Luminaire, other: &Luminaire, tolerance: f64) -> bool {
    let back = op.matrix().transpose();
    let mut directions = probes(luminaire).chain(probes(other).map(|d| back * d));
    directions.all(|d| {
        let (a, b) = (luminaire.intensity_towards(d).value(), other.intensity_towards(op.of_direction(d)).value());
        (a - b).abs() <= tolerance
    })
}

/// A symmetry that takes one luminaire's planes to planes of another, by their angles: C to `start_deg` more than C or less it, gamma to itself
/// or up for down.
#[derive(Clone, Copy, Debug)]
struct Turn {
    start_deg: f64,
    is_mirrored: bool,
    is_upside_down: bool,
}

impl Turn {
    /// `None` where the axes of the two tables are not one line, or planes are not those of type C.
    fn of(op: Operation, luminaire: &Luminaire, other: &Luminaire) -> Option<Self> {
        let is_native = [luminaire, other].into_iter().any(|l| l.photometry.distribution.is_native());
        let own = other.orientation.transpose() * op.matrix() * luminaire.orientation;
        let (x, y, z) = (own.x_axis, own.y_axis, own.z_axis);
        let is_along = z.x.hypot(z.y) <= 1e-13 && !is_native;
        is_along.then(|| Self {
            start_deg: x.y.atan2(x.x).to_degrees(),
            is_mirrored: x.x * y.y - x.y * y.x < 0.0,
            is_upside_down: z.z < 0.0,
        })
    }

    fn inverse(self) -> Self {
        Self { start_deg: if self.is_mirrored { self.start_deg } else { -self.start_deg }, ..self }
    }

    fn is_its_inverse(self) -> bool {
        self.is_mirrored || self.start_deg.rem_euclid(180.0) == 0.0
    }

    fn leads_both_ways(self, luminaire: &Luminaire, other: &Luminaire, tolerance: f64, stop: &Stop) -> bool {
        let is_one = Arc::ptr_eq(&luminaire.photometry, &other.photometry) && luminaire.flux_scale == other.flux_scale;
        let is_known_back = is_one && self.is_its_inverse();
        self.leads(luminaire, other, tolerance, stop)
            && (is_known_back || self.inverse().leads(other, luminaire, tolerance, stop))
    }

    /// Whether light at each probe of one luminaire is that of the other where this leads from there.
    fn leads(self, from: &Luminaire, to: &Luminaire, tolerance: f64, stop: &Stop) -> bool {
        let [here, there] = [from, to].map(|luminaire| &luminaire.photometry.distribution);
        let (cs, gammas) = probed_angles(&here.own_planes());
        let images: Vec<f64> = cs.iter().map(|c| self.start_deg + if self.is_mirrored { -c } else { *c }).collect();
        // Few at a time: what is none differs soon.
        gammas.chunks(PROBES.len()).take_while(|_| !stop.is_due()).all(|gammas| {
            let image_gammas = gammas.iter().map(|gamma| if self.is_upside_down { 180.0 - gamma } else { *gamma });
            let there = there.intensities(&images, &image_gammas.collect::<Vec<_>>());
            let pairs = here.intensities(&cs, gammas).into_iter().zip(there);
            pairs.map(|(a, b)| a * from.flux_scale - b * to.flux_scale).all(|d| d.abs() <= tolerance)
        })
    }
}

/// Where a bilinear piece of a table is looked at between two nodes: a little off them, too, where a table that starts with a step is not at the
/// mercy of rounding.
const PROBES: [f64; 5] = [0.001, 0.35, 0.5, 0.8, 0.999];

/// The angles C and gamma at which a table's pieces are looked at, in degrees.
fn probed_angles(full: &LuminousIntensityDistribution) -> (Vec<f64>, Vec<f64>) {
    (between_nodes(full.c_deg()), between_nodes(full.gamma_deg()))
}

/// The probes between each two nodes.
fn between_nodes(angles_deg: &[f64]) -> Vec<f64> {
    angles_deg.windows(2).flat_map(|w| PROBES.map(|t| w[0] + t * (w[1] - w[0]))).collect()
}

/// World directions to every interior point of a table that its bilinear pieces are known by.
fn probes(luminaire: &Luminaire) -> impl Iterator<Item = DVec3> {
    let full = luminaire.photometry.distribution.own_planes();
    let (cs, gammas) = probed_angles(&full);
    (0..cs.len() * gammas.len())
        .map(move |k| luminaire.orientation * full.own_direction(cs[k / gammas.len()], gammas[k % gammas.len()]))
}

/// Node images under a group, and which nodes stand for their orbits.
#[derive(Clone, Debug)]
pub(super) struct Orbits {
    /// `images[operation][node]`.
    pub(super) images: Vec<Vec<u32>>,
    /// One node an orbit, rising.
    pub(super) representatives: Vec<usize>,
    /// The place in `representatives` of each node's orbit.
    pub(super) orbit: Vec<u32>,
    /// How many nodes each orbit has.
    pub(super) sizes: Vec<f64>,
}

impl Orbits {
    pub(super) fn new(grid: &Grid, group: &[Operation]) -> Self {
        Self::of_images(grid.len(), group.iter().map(|op| images(grid, *op)).collect())
    }

    fn of_images(count: usize, images: Vec<Vec<u32>>) -> Self {
        let (mut representatives, mut orbit, mut sizes) = (vec![], vec![0; count], vec![]);
        // The least node of an orbit stands for it; it comes first.
        let mut least: Vec<u32> = (0..count as u32).collect();
        for image in &images {
            for (least, image) in least.iter_mut().zip(image) {
                *least = (*least).min(*image);
            }
        }
        for (node, least) in least.into_iter().enumerate() {
            if least as usize == node {
                orbit[node] = representatives.len() as u32;
                representatives.push(node);
                sizes.push(0.0);
            } else {
                orbit[node] = orbit[least as usize];
            }
            sizes[orbit[node] as usize] += 1.0;
        }
        Self { images, representatives, orbit, sizes }
    }

    /// The orbits under a part of the group.
    pub(super) fn under(&self, operations: &[usize]) -> Self {
        Self::of_images(self.orbit.len(), operations.iter().map(|k| self.images[*k].clone()).collect())
    }

    /// Means by orbit of values at all nodes.
    pub(super) fn means(&self, values: &[f64]) -> Vec<f64> {
        let mut means = vec![0.0; self.sizes.len()];
        for (value, orbit) in values.iter().zip(&self.orbit) {
            means[*orbit as usize] += value / self.sizes[*orbit as usize];
        }
        means
    }

    /// Values at all nodes from values by orbit.
    pub(super) fn unfold(&self, values: &[f64]) -> Vec<f64> {
        self.orbit.iter().map(|orbit| values[*orbit as usize]).collect()
    }
}

/// The node that each node falls on under a symmetry of the box.
fn images(grid: &Grid, operation: Operation) -> Vec<u32> {
    let to = [0, 1, 2].map(|axis| operation.axes.iter().position(|from| *from == axis).unwrap_or(axis));
    let mut images = Vec::with_capacity(grid.len());
    for face in Face::ALL {
        let (n, u, v) = face.axes();
        let end = face.0 % 2;
        let image = Face(2 * to[n] + if operation.turns(n) { 1 - end } else { end });
        let (count_u, count_v) = grid.counts(face);
        let [stride_u, stride_v] = [u, v].map(|axis| if image.axes().1 == to[axis] { grid.counts(image).1 } else { 1 });
        for i in 0..count_u {
            let start = grid.offsets[image.0] + operation.along(u, count_u, i) * stride_u;
            images.extend((0..count_v).map(|j| (start + operation.along(v, count_v, j) * stride_v) as u32));
        }
    }
    images
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use luxproof_photometry::Photometry;
    use luxproof_scene::LuminaireModel;

    #[test]
    fn every_subgroup_of_a_cubes_symmetries_is_found_by_few_long_looks() {
        let group = of_geometry(DVec3::ONE);
        let images = images_of_uneven(&group);
        for a in 0..group.len() {
            for b in 0..group.len() {
                // All words of the two.
                let mut right = vec![0];
                let mut next = 0;
                while let Some(&word) = right.get(next) {
                    for letter in [a, b] {
                        let longer = products(&group, &images, letter, word)[0].unwrap();
                        if !right.contains(&longer) {
                            right.push(longer);
                        }
                    }
                    next += 1;
                }
                right.sort_unstable();
                // A look at what is none ends at the first direction that differs.
                let long = Cell::new(0);
                let found = subgroup(&group, |k| {
                    long.set(long.get() + u32::from(right.contains(&k)));
                    right.contains(&k)
                });
                assert_eq!(found, right, "{a} {b}");
                // The one that leaves all as it is, and each that is found at least doubles what is known.
                assert!(long.get() <= 1 + right.len().ilog2(), "{a} {b}: {} long looks", long.get());
            }
        }
    }

    /// Seven angles from one to another.
    fn even_angles(first: f64, last: f64) -> Vec<f64> {
        (0..=6).map(|k| first + (last - first) * f64::from(k) / 6.0).collect()
    }

    /// A luminaire in the centre of the unit cube.
    fn centred(photometry: &Arc<Photometry>, orientation: DMat3) -> Luminaire {
        Luminaire {
            id: "l".into(),
            photometry: photometry.clone(),
            position_m: DVec3::splat(0.5),
            orientation,
            flux_scale: 1.0,
            model: LuminaireModel::Point,
        }
    }

    #[test]
    fn what_is_an_image_by_angles_is_one_by_directions() {
        let ranges = [(0.0, 90.0), (0.0, 180.0), (90.0, 270.0), (0.0, 360.0)];
        let gammas = [(0.0, 180.0), (20.0, 90.0)];
        // Light of two lobes, of four, of one turned aside, and of none that a symmetry keeps.
        let lobes: [fn(f64, f64) -> f64; 4] = [
            |c, g| 3.0 + (2.0 * c).cos() * g.sin(),
            |c, g| 3.0 + (4.0 * c).cos() * (2.0 * g).sin().powi(2),
            |c, g| 3.0 + c.sin() * g.sin() + g.cos(),
            |c, g| 3.0 + (c - 0.3).cos() * g.sin() + (3.0 * c).sin(),
        ];
        let mut tables = vec![];
        for (first, last) in ranges {
            for (low, high) in gammas {
                for lobe in lobes {
                    let (cs, gammas) = (even_angles(first, last), even_angles(low, high));
                    let pairs = cs.iter().flat_map(|c| gammas.iter().map(move |gamma| (*c, *gamma)));
                    let candela = pairs.map(|(c, gamma)| lobe((c % 360.0).to_radians(), gamma.to_radians())).collect();
                    let table = LuminousIntensityDistribution::new(cs, gammas, candela).unwrap();
                    tables.push(Arc::new(Photometry::of(table)));
                }
            }
        }
        let upside_down = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let turned = [0.0, 45.0, 90.0, 180.0, 30.0].map(|deg: f64| DMat3::from_rotation_z(deg.to_radians()));
        let ways: Vec<DMat3> = turned.into_iter().flat_map(|way| [way, way * upside_down]).collect();
        let (group, stop) = (of_geometry(DVec3::ONE), Stop::NEVER);
        let (mut images, mut others) = (0, 0);
        for table in &tables {
            for (a, b) in ways.iter().flat_map(|a| ways.iter().map(move |b| (a, b))) {
                let [one, other] = [a, b].map(|way| centred(table, *way));
                for op in &group {
                    let Some(turn) = Turn::of(*op, &one, &other) else { continue };
                    let by_angles = turn.leads_both_ways(&one, &other, 1e-11, &stop);
                    assert_eq!(by_angles, leads_both_ways(*op, &one, &other, 1e-11), "{op:?} {turn:?} {table:?}");
                    let count = if by_angles { &mut images } else { &mut others };
                    *count += 1;
                }
            }
        }
        assert!(images > 1000 && others > 1000, "{images} {others}");
    }
}
