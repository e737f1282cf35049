//! Laws of the ray caster: the tree loses no hit, closed meshes leak at no scale and from no distance.

use super::*;

/// A splitmix64 stream: enough randomness for test rays, the same everywhere.
struct Stream(u64);

impl Stream {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn cube(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.cube();
            if (1e-4..=1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
}

struct Mesh {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn placed(&self, scale: f64, at: DVec3) -> Self {
        Self { vertices: self.vertices.iter().map(|v| *v * scale + at).collect(), triangles: self.triangles.clone() }
    }

    fn bvh(&self) -> TriangleBvh {
        TriangleBvh::new(&self.vertices, &self.triangles).unwrap()
    }

    /// What the tree must find, by looking at every triangle.
    fn brute_force(&self, ray: &Ray, t_max: f64) -> Option<(f64, u32)> {
        let shear = Shear::along(ray);
        let mut best: Option<(f64, u32)> = None;
        for (k, t) in (0..).zip(&self.triangles) {
            let corners = t.map(|v| self.vertices[v as usize].to_array());
            match shear.distance(&corners) {
                Some(t) if t < best.map_or(t_max, |b| b.0) => best = Some((t, k)),
                _ => {}
            }
        }
        best
    }
}

/// Triangles of very different size and shape, slivers and axis-aligned ones among them.
fn soup(count: u32, stream: &mut Stream) -> Mesh {
    let mut vertices = vec![];
    for k in 0..count {
        let (at, size) = (stream.cube(), 10f64.powf(-3.0 * stream.unit()));
        let mut corners = [at, at + size * stream.cube(), at + size * stream.cube()];
        match k % 4 {
            1 => corners.iter_mut().for_each(|c| c[(k % 3) as usize] = at[(k % 3) as usize]),
            2 => corners[2] = corners[1] + 1e-6 * (corners[2] - corners[1]),
            _ => {}
        }
        vertices.extend(corners);
    }
    Mesh { vertices, triangles: (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect() }
}

/// A closed ball of `2 rings * around - ...` triangles.
fn ball(rings: u32, around: u32) -> Mesh {
    let mut vertices = vec![DVec3::NEG_Z];
    for r in 1..rings {
        for a in 0..around {
            let (gamma, c) = (
                std::f64::consts::PI * f64::from(r) / f64::from(rings),
                std::f64::consts::TAU * f64::from(a) / f64::from(around),
            );
            vertices.push(DVec3::new(gamma.sin() * c.cos(), gamma.sin() * c.sin(), -gamma.cos()));
        }
    }
    vertices.push(DVec3::Z);
    let top = vertices.len() as u32 - 1;
    let at = |r: u32, a: u32| 1 + (r - 1) * around + a % around;
    let mut triangles = vec![];
    for a in 0..around {
        triangles.push([0, at(1, a + 1), at(1, a)]);
        triangles.push([top, at(rings - 1, a), at(rings - 1, a + 1)]);
        for r in 1..rings - 1 {
            triangles.push([at(r, a), at(r, a + 1), at(r + 1, a + 1)]);
            triangles.push([at(r, a), at(r + 1, a + 1), at(r + 1, a)]);
        }
    }
    Mesh { vertices, triangles }
}

/// Rays of every kind that matters: from inside and far outside, along axes, at corners and along surfaces.
fn test_ray(k: usize, mesh: &Mesh, scale: f64, at: DVec3, stream: &mut Stream) -> Ray {
    let corner = mesh.vertices[stream.below(mesh.vertices.len())];
    let origin_m = match k % 5 {
        0 => at + 3.0 * scale * stream.cube(),
        1 => at + 1e3 * scale * stream.cube(),
        2 => corner,
        _ => at + scale * stream.cube(),
    };
    let aim = mesh.vertices[stream.below(mesh.vertices.len())];
    let direction = match k % 7 {
        0 => [DVec3::X, DVec3::NEG_Y, DVec3::Z][stream.below(3)],
        1 | 2 if (aim - origin_m).length() > 0.0 => (aim - origin_m).normalize(),
        3 => (stream.direction() * DVec3::new(1.0, 1.0, 1e-9)).normalize(),
        _ => stream.direction(),
    };
    Ray { origin_m, direction }
}

fn wrong_hits(mesh: &Mesh, scale: f64, at: DVec3, rays: usize, seed: u64) -> usize {
    let mesh = mesh.placed(scale, at);
    let bvh = mesh.bvh();
    let mut stream = Stream(seed);
    let mut wrong = 0;
    let mut hits = 0;
    for k in 0..rays {
        let ray = test_ray(k, &mesh, scale, at, &mut stream);
        let t_max = if k % 3 == 0 { 2.0 * scale * stream.unit() } else { f64::INFINITY };
        let expected = mesh.brute_force(&ray, t_max);
        let found = bvh.closest(&ray, t_max).map(|h| (h.distance, h.triangle));
        hits += usize::from(expected.is_some());
        wrong += usize::from(found != expected) + usize::from(bvh.occluded(&ray, t_max) != expected.is_some());
    }
    assert!(hits > rays / 10, "the rays must hit something: {hits} of {rays}");
    wrong
}

#[test]
fn two_million_rays_agree_with_brute_force_at_any_scale_and_offset() {
    let mut stream = Stream(1);
    let (soup, ball) = (soup(90, &mut stream), ball(8, 8));
    let placements = [
        (1.0, DVec3::ZERO),
        (10.0, DVec3::new(5.0, 4.0, 1.5)),
        (1.0, DVec3::new(1e5, -1e5, 1e5)),
        (1e-6, DVec3::ZERO),
        (1e6, DVec3::new(1e6, 0.0, 0.0)),
        (1e-3, DVec3::new(0.0, 1e5, 0.0)),
        (1.0, DVec3::splat(1e8)),
        (1e-9, DVec3::ZERO),
    ];
    for (k, (scale, at)) in placements.into_iter().enumerate() {
        for mesh in [&soup, &ball] {
            let wrong = wrong_hits(mesh, scale, at, 125_000, k as u64);
            assert_eq!(wrong, 0, "scale {scale}, offset {at}");
        }
    }
}

#[test]
fn a_tree_of_many_levels_loses_no_hit_either() {
    let mesh = ball(60, 50);
    assert!(mesh.triangles.len() > 5000);
    assert_eq!(wrong_hits(&mesh, 7.0, DVec3::new(1e4, 0.0, 0.0), 8000, 3), 0);
}

#[test]
fn no_ray_leaves_a_closed_mesh_even_through_its_corners_and_edges() {
    let mut stream = Stream(9);
    for (scale, at) in [(1.0, DVec3::ZERO), (1e-6, DVec3::ZERO), (1.0, DVec3::splat(1e5)), (1e6, DVec3::X)] {
        let mesh = ball(24, 24).placed(scale, at);
        let bvh = mesh.bvh();
        for k in 0..40_000 {
            let origin_m = at + 0.5 * scale * stream.cube();
            let [a, b, c] = mesh.triangles[stream.below(mesh.triangles.len())].map(|v| mesh.vertices[v as usize]);
            let aim = match k % 3 {
                0 => a,
                1 => a + stream.unit() * (b - a),
                _ => a + stream.unit() * (c - a),
            };
            let ray = Ray { origin_m, direction: aim - origin_m };
            let hit = bvh.closest(&ray, f64::INFINITY);
            assert!(hit.is_some() && bvh.occluded(&ray, f64::INFINITY), "scale {scale}, offset {at}, ray {ray:?}");
        }
    }
}

#[test]
fn distances_are_exact_where_single_precision_would_lose_them() {
    let at = DVec3::new(1e5, 2e5, 3e5);
    let mesh = ball(4, 4).placed(1.0, at);
    let hit = mesh.bvh().closest(&Ray { origin_m: at - 2.0 * DVec3::X, direction: DVec3::X }, 10.0).unwrap();
    assert!((hit.distance - 1.0).abs() < 1e-10, "{}", hit.distance);
    assert!(hit.normal.is_normalized() && hit.normal.x < 0.0);
}

#[test]
fn hits_at_or_beyond_the_far_end_do_not_count() {
    let mesh = Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2]] };
    let bvh = mesh.bvh();
    let ray = Ray { origin_m: DVec3::new(0.2, 0.2, 1.0), direction: DVec3::NEG_Z };
    assert_eq!(bvh.closest(&ray, 1.0), None);
    assert!(!bvh.occluded(&ray, 1.0));
    assert!(bvh.occluded(&ray, 1.0 + 1e-12));
    let start = Ray { origin_m: DVec3::new(0.2, 0.2, 0.0), direction: DVec3::NEG_Z };
    assert_eq!(bvh.closest(&start, 1e-9).map(|h| h.distance), Some(0.0));
}

#[test]
fn degenerate_input_is_an_error_or_is_left_out() {
    let nan = TriangleBvh::new(&[DVec3::ZERO, DVec3::X, DVec3::NAN], &[[0, 1, 2]]);
    assert_eq!(nan.err(), Some(BvhError::NotFinite { vertex: 2 }));
    let missing = TriangleBvh::new(&[DVec3::ZERO, DVec3::X], &[[0, 1, 2]]);
    assert_eq!(missing.err(), Some(BvhError::NoSuchVertex { triangle: 0, vertex: 2, vertices: 2 }));
    let flat = TriangleBvh::new(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 1], [0, 1, 2]]).unwrap();
    assert_eq!(flat.len(), 1);
    let none = TriangleBvh::new(&[], &[]).unwrap();
    assert!(none.is_empty());
    assert!(!none.occluded(&Ray { origin_m: DVec3::ZERO, direction: DVec3::X }, 1.0));
}

#[test]
fn a_pile_of_coincident_triangles_counts_as_its_first() {
    let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let pile: Vec<_> = (0..100_000).map(|k| [[0, 1, 2], [2, 1, 0], [1, 2, 0]][k % 3]).collect();
    let bvh = TriangleBvh::new(&vertices, &pile).unwrap();
    assert_eq!(bvh.len(), 1);
    let ray = Ray { origin_m: DVec3::new(0.2, 0.2, 1.0), direction: DVec3::NEG_Z };
    assert_eq!(bvh.closest(&ray, 2.0).map(|h| h.triangle), Some(0));
}

#[test]
fn nested_triangles_of_every_size_are_all_hit() {
    // Sizes 2^0 to 2^-400 about one corner: the worst case for a tree's depth.
    for count in [10, 40, 400] {
        let corners = (0..count).flat_map(|k| [DVec3::ZERO, 2f64.powi(-k) * DVec3::X, 2f64.powi(-k) * DVec3::Y]);
        let triangles = (0..count as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let bvh = Mesh { vertices: corners.collect(), triangles }.bvh();
        for k in 0..count {
            let at = 0.3 * 2f64.powi(-k);
            let ray = Ray { origin_m: DVec3::new(at, at, 1.0), direction: DVec3::NEG_Z };
            assert!(bvh.occluded(&ray, 2.0));
        }
    }
}

fn on_grid(at: [i32; 3]) -> DVec3 {
    DVec3::from(at.map(f64::from))
}

/// The normal of a triangle with corners on a grid, without rounding.
fn grid_normal(corners: [[i32; 3]; 3]) -> DVec3 {
    let [a, b, c] = corners.map(on_grid);
    (b - a).cross(c - a)
}

proptest::proptest! {
    /// Few triangles with corners on a coarse grid, so that rays along axes and from surfaces meet edges, corners and ties.
    ///
    /// Rays in the plane of a triangle are left out: where they meet it is noise, with or without a tree.
    #[test]
    fn the_tree_finds_what_every_triangle_one_by_one_gives(
        corners in proptest::collection::vec(proptest::array::uniform3(-3_i32..=3), 3..40),
        origins in proptest::collection::vec(proptest::array::uniform3(-8_i32..=8), 24),
        directions in proptest::collection::vec(proptest::array::uniform3(-2_i32..=2), 24),
        magnitude in -40_i32..=40,
        offset in -3_i32..=6,
    ) {
        let (scale, at) = (10f64.powi(magnitude), 10f64.powi(magnitude + offset) * DVec3::new(1.0, -0.3, 0.7));
        let vertices = corners.iter().map(|c| on_grid(*c) * scale + at).collect();
        let mut mesh = Mesh { vertices, triangles: vec![] };
        let triangles = (0..mesh.vertices.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]);
        mesh.triangles = triangles.filter(|t| has_area(t.map(|k| mesh.vertices[k as usize]))).collect();
        let bvh = mesh.bvh();
        let normals: Vec<DVec3> = mesh.triangles.iter().map(|t| grid_normal(t.map(|k| corners[k as usize]))).collect();
        for (origin, direction) in origins.into_iter().zip(directions) {
            let direction = on_grid(direction);
            if direction == DVec3::ZERO || normals.iter().any(|normal| normal.dot(direction) == 0.0) {
                continue;
            }
            let ray = Ray { origin_m: 0.5 * scale * on_grid(origin) + at, direction };
            let expected = mesh.brute_force(&ray, f64::INFINITY);
            let found = bvh.closest(&ray, f64::INFINITY).map(|h| (h.distance, h.triangle));
            proptest::prop_assert_eq!(found, expected);
            proptest::prop_assert_eq!(bvh.occluded(&ray, f64::INFINITY), expected.is_some());
        }
    }
}
