//! Rays a second against scene size, and the time and memory to build the tree: `cargo bench -p luxproof-physics-tests --bench bvh`.

use divan::counter::ItemsCount;
use divan::{AllocProfiler, Bencher};
use glam::DVec3;
use luxproof_scene::geometry::bvh::{Ray, TriangleBvh};

#[global_allocator]
static ALLOCATIONS: AllocProfiler = AllocProfiler::system();

/// Triangles, about.
const SIZES: [u32; 5] = [48, 1_000, 10_000, 100_000, 1_000_000];
const RAYS: usize = 4096;

fn main() {
    divan::main();
}

/// A ball with a rough surface in a 10 m cube: half of the rays from around it meet it, at every distance and angle.
fn rough_ball(triangles: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let around = f64::from(triangles).sqrt().round() as u32;
    let rings = (triangles / (2 * around)).max(2);
    let mut vertices = vec![];
    for ring in 0..=rings {
        for a in 0..around {
            let (sin_g, cos_g) = (std::f64::consts::PI * f64::from(ring) / f64::from(rings)).sin_cos();
            let (sin_c, cos_c) = (std::f64::consts::TAU * f64::from(a) / f64::from(around)).sin_cos();
            let rough = 3.0 + 0.2 * (f64::from(ring * 7919 + a * 104_729) * 0.618_034).fract();
            vertices.push(DVec3::splat(5.0) + rough * DVec3::new(sin_g * cos_c, sin_g * sin_c, cos_g));
        }
    }
    let at = |ring: u32, a: u32| ring * around + a % around;
    let quads = (0..rings).flat_map(|r| (0..around).map(move |a| (r, a)));
    let halves = |(r, a)| [[at(r, a), at(r + 1, a), at(r + 1, a + 1)], [at(r, a), at(r + 1, a + 1), at(r, a + 1)]];
    (vertices, quads.flat_map(halves).collect())
}

/// Incoherent rays from all over the cube, by an additive recurrence.
fn rays() -> Vec<Ray> {
    let at = |k: usize, step: f64| (0.5 + step * k as f64).fract();
    let ray = |k| {
        let origin_m = 10.0 * DVec3::new(at(k, 0.8191725134), at(k, 0.6710436067), at(k, 0.5497004779));
        let (z, c) = (2.0 * at(k, 0.7548776662) - 1.0, std::f64::consts::TAU * at(k, 0.5698402910));
        let across = (1.0 - z * z).sqrt();
        Ray { origin_m, direction: DVec3::new(across * c.cos(), across * c.sin(), z) }
    };
    (0..RAYS).map(ray).collect()
}

#[divan::bench(args = SIZES)]
fn closest(bencher: Bencher, triangles: u32) {
    let tree = tree(triangles);
    let rays = rays();
    bencher
        .counter(ItemsCount::new(RAYS))
        .bench(|| rays.iter().filter_map(|r| tree.closest(r, f64::INFINITY)).map(|h| h.distance).sum::<f64>());
}

#[divan::bench(args = SIZES)]
fn occluded(bencher: Bencher, triangles: u32) {
    let tree = tree(triangles);
    let rays = rays();
    bencher.counter(ItemsCount::new(RAYS)).bench(|| rays.iter().filter(|r| tree.occluded(r, f64::INFINITY)).count());
}

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn build(bencher: Bencher, triangles: u32) {
    let (vertices, faces) = rough_ball(triangles);
    bencher.counter(ItemsCount::new(faces.len())).bench(|| TriangleBvh::new(&vertices, &faces).is_ok());
}

fn tree(triangles: u32) -> TriangleBvh {
    let (vertices, faces) = rough_ball(triangles);
    match TriangleBvh::new(&vertices, &faces) {
        Ok(tree) => tree,
        Err(error) => panic!("the bench's own mesh builds no tree: {error}"),
    }
}
