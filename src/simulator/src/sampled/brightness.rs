//! Where surfaces are bright: a density from which shared surface points are drawn.
//!
//! Each surface is the image of the unit square, quartered where much light is. Any density gives the right mean, since every
//! sample is divided by it; a good one gives little scatter.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use glam::DVec3;

use super::surroundings::{Place, Surroundings};
use super::transport::Transporter;
use crate::sampler::{Sampler, mix};
use luxproof_scene::Meter;

/// Cells into which the surfaces are quartered before anything is known of their light.
const FIRST_CELLS: f64 = 512.0;
/// A cell with more than this part of all light is quartered.
const MAX_SHARE: f64 = 1.0 / 1024.0;
/// Rounds of quartering.
const ROUNDS: usize = 5;
/// Samples of the light in a cell.
const SAMPLES: u32 = 4;
/// Samples of a mesh, and the surfaces from which on its small triangles share them.
const MESH_SAMPLES: usize = 64;
/// The parts of the density that follow the cell, its surface's mean and the scene's mean. The last two cover what the few
/// samples of a cell did not meet.
const CELL_PART: f64 = 0.75;
const SURFACE_PART: f64 = 0.15;
const SCENE_PART: f64 = 0.1;

/// Cells near luminaires are quartered down to sides of this length. Luminaires lower than this above a surface hardly light it.
const MIN_SIDE_M: f64 = 0.06;
const MIN_HEIGHT_M: f64 = 0.002;
/// Meters that decide where points go, at most; what is nearer to them than this in metres is left to rays.
const MAX_VIEWS: usize = 256;
const NEAR_M: f64 = 0.5;

/// A square of a surface's unit square: quartered, or a leaf with its density.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Index of the first of four children; 0 for a leaf.
    first_child: u32,
    /// Points per square metre of all points.
    density: f64,
}

/// A leaf, as it is drawn.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    cell: u32,
    surface: u32,
    corner: [f64; 2],
    size: f64,
    brightness: f64,
}

impl Leaf {
    fn at(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        [self.corner[0] + a * self.size, self.corner[1] + b * self.size]
    }
}

/// The density of surface points.
#[derive(Clone, Debug)]
pub(super) struct BrightnessMap {
    /// The cells of each surface begin with its root.
    cells: Vec<Cell>,
    /// Root of each surface, if it reflects.
    roots: Vec<Option<u32>>,
    leaves: Vec<Leaf>,
    /// Probability of all leaves up to and including each.
    cumulative: Vec<f64>,
    /// Mean of the squared brightness over its squared mean, by area: how much light is in few places.
    pub(super) peak: f64,
}

impl BrightnessMap {
    /// `None` where nothing reflects any light. The number of samples depends on the scene alone.
    pub(super) fn new(transporter: &Transporter, seed: u64) -> Option<Self> {
        let surroundings = transporter.surroundings;
        let surfaces = &surroundings.surfaces;
        let reflects = |k: &usize| surfaces[*k].reflectance > 0.0 && surfaces[*k].area_m2 > 0.0;
        let total_m2: f64 = (0..surfaces.len()).filter(reflects).map(|k| surfaces[k].area_m2).sum();
        let mut map =
            Self { cells: vec![], roots: vec![None; surfaces.len()], leaves: vec![], cumulative: vec![], peak: 0.0 };
        let small_m2 = total_m2 / FIRST_CELLS / 8.0;
        let mut small: BTreeMap<Option<usize>, Vec<usize>> = BTreeMap::new();
        let mut open = vec![];
        for k in (0..surfaces.len()).filter(reflects) {
            let leaf = map.add_root(k);
            if surfaces[k].area_m2 < small_m2 && !surroundings.is_large_piece(k) {
                small.entry(surfaces[k].mesh).or_default().push(k);
                map.leaves.push(leaf);
            } else {
                open.push(leaf);
            }
        }
        let mut fixed: Vec<Leaf> = vec![];
        while let Some(leaf) = open.pop() {
            let area_m2 = leaf_area_m2(surroundings, &leaf);
            if area_m2 > total_m2 / FIRST_CELLS || is_near_lamp(transporter, &leaf, area_m2) {
                open.extend(map.quarter(&leaf));
            } else {
                fixed.push(leaf);
            }
        }
        for leaf in &mut fixed {
            leaf.brightness = sample_leaf(transporter, leaf, seed);
        }
        for round in 0..ROUNDS {
            let all: f64 = fixed.iter().map(|l| l.brightness * leaf_area_m2(surroundings, l)).sum();
            let (large, rest): (Vec<Leaf>, Vec<Leaf>) = fixed.into_iter().partition(|l| {
                l.brightness * leaf_area_m2(surroundings, l) > MAX_SHARE * all * f64::from(1 << round.min(1))
            });
            fixed = rest;
            for leaf in large {
                fixed.extend(map.quarter(&leaf).map(|mut child| {
                    child.brightness = sample_leaf(transporter, &child, seed ^ (round as u64 + 1));
                    child
                }));
            }
        }
        map.leaves.iter_mut().for_each(|leaf| leaf.brightness = f64::NAN);
        let means: BTreeMap<Option<usize>, f64> = small
            .iter()
            .map(|(mesh, sides)| {
                (*mesh, sample_sides(transporter, sides, mix(seed ^ mesh.map_or(0, |m| m as u64 + 7))))
            })
            .collect();
        for leaf in &mut map.leaves {
            leaf.brightness = means.get(&surfaces[leaf.surface as usize].mesh).copied().unwrap_or(0.0);
        }
        map.leaves.extend(fixed);
        map.leaves.sort_by_key(|leaf| (leaf.surface, leaf.cell));
        map.set_densities(surroundings)
    }

    /// The same for what meters see: brighter where light goes to them, whatever hides it. `None` where they see no light.
    pub(super) fn for_meters(&self, surroundings: &Surroundings, meters: &[Meter]) -> Option<Self> {
        let mut map = self.clone();
        let centres: Vec<(Place, f64)> = self
            .leaves
            .iter()
            .map(|leaf| {
                let surface = &surroundings.surfaces[leaf.surface as usize];
                let (normal, reflectance) = (surface.normal, surface.reflectance);
                let point_m = surface.point_at(leaf.at([0.5; 2]));
                let place = Place { point_m, normal, reflectance, surface: leaf.surface as usize };
                (place, leaf_area_m2(surroundings, leaf))
            })
            .collect();
        let mut squares = vec![0.0; self.leaves.len()];
        let step = meters.len().div_ceil(MAX_VIEWS).max(1);
        for meter in meters.iter().step_by(step) {
            let seen: Vec<f64> = centres.iter().map(|(place, area_m2)| view_per_m2(meter, place, *area_m2)).collect();
            let light: f64 =
                seen.iter().zip(&self.leaves).zip(&centres).map(|((s, l), (_, area))| s * l.brightness * area).sum();
            if light > 0.0 {
                squares.iter_mut().zip(&seen).for_each(|(square, s)| *square += (s / light).powi(2));
            }
        }
        for (leaf, square) in map.leaves.iter_mut().zip(&squares) {
            leaf.brightness *= square.sqrt();
        }
        map.cumulative.clear();
        map.set_densities(surroundings)
    }

    fn add_root(&mut self, surface: usize) -> Leaf {
        let cell = self.cells.len() as u32;
        self.cells.push(Cell::default());
        self.roots[surface] = Some(cell);
        Leaf { cell, surface: surface as u32, corner: [0.0; 2], size: 1.0, brightness: 0.0 }
    }

    fn quarter(&mut self, leaf: &Leaf) -> [Leaf; 4] {
        let first = self.cells.len() as u32;
        self.cells[leaf.cell as usize].first_child = first;
        self.cells.extend([Cell::default(); 4]);
        let size = 0.5 * leaf.size;
        std::array::from_fn(|k| {
            let corner = leaf.at([0.5 * (k % 2) as f64, 0.5 * (k / 2) as f64]);
            Leaf { cell: first + k as u32, corner, size, ..*leaf }
        })
    }

    /// Turns brightness into probabilities.
    fn set_densities(mut self, surroundings: &Surroundings) -> Option<Self> {
        let areas: Vec<f64> = self.leaves.iter().map(|l| leaf_area_m2(surroundings, l)).collect();
        let total_m2: f64 = areas.iter().sum();
        let mut light = vec![0.0; self.roots.len()];
        let (mut all, mut squares) = (0.0, 0.0);
        for (leaf, area_m2) in self.leaves.iter().zip(&areas) {
            light[leaf.surface as usize] += leaf.brightness * area_m2;
            all += leaf.brightness * area_m2;
            squares += leaf.brightness * leaf.brightness * area_m2;
        }
        if all <= 0.0 {
            return None;
        }
        self.peak = squares * total_m2 / (all * all);
        let mut sum = 0.0;
        for (leaf, area_m2) in self.leaves.iter().zip(&areas) {
            let surface_m2 = surroundings.surfaces[leaf.surface as usize].area_m2;
            let density = (CELL_PART * leaf.brightness + SURFACE_PART * light[leaf.surface as usize] / surface_m2)
                / all
                + SCENE_PART / total_m2;
            self.cells[leaf.cell as usize].density = density;
            sum += density * area_m2;
            self.cumulative.push(sum);
        }
        self.cells.iter_mut().for_each(|cell| cell.density /= sum);
        for c in &mut self.cumulative {
            *c /= sum;
        }
        Some(self)
    }

    /// Points per square metre at a place, as a part of all points.
    pub(super) fn density_per_m2(&self, surroundings: &Surroundings, place: &Place) -> f64 {
        let Some(root) = self.roots[place.surface] else { return 0.0 };
        let mut cell = &self.cells[root as usize];
        if cell.first_child == 0 {
            return cell.density;
        }
        let mut at = surroundings.surfaces[place.surface].coordinates_of(place.point_m);
        while cell.first_child != 0 {
            let mut child = 0;
            for (k, x) in at.iter_mut().enumerate() {
                *x *= 2.0;
                if *x >= 1.0 {
                    child += 1 << k;
                    *x -= 1.0;
                }
            }
            cell = &self.cells[cell.first_child as usize + child];
        }
        cell.density
    }

    /// A place and its density; `None` where the place is covered.
    pub(super) fn draw_at(&self, surroundings: &Surroundings, x: f64, at: [f64; 2]) -> Option<(Place, f64)> {
        let k = self.cumulative.partition_point(|c| *c <= x).min(self.leaves.len() - 1);
        let leaf = &self.leaves[k];
        let place = surroundings.uncovered_place(leaf.surface as usize, leaf.at(at))?;
        Some((place, self.cells[leaf.cell as usize].density))
    }
}

/// Whether a cell is so large that a luminaire before it may light a small part of it alone.
fn is_near_lamp(transporter: &Transporter, leaf: &Leaf, area_m2: f64) -> bool {
    let surface = &transporter.surroundings.surfaces[leaf.surface as usize];
    if area_m2 < MIN_SIDE_M * MIN_SIDE_M {
        return false;
    }
    let centre_m = surface.point_at(leaf.at([0.5; 2]));
    let reach_m = 0.5 * area_m2.sqrt();
    transporter.lamps.bounds_m().any(|[low_m, high_m]| {
        let highest_m = DVec3::select(surface.normal.cmpgt(DVec3::ZERO), *high_m, *low_m);
        let height_m = (highest_m - centre_m).dot(surface.normal);
        let away_m = (*low_m - centre_m).max(centre_m - *high_m).max(DVec3::ZERO).length();
        height_m > MIN_HEIGHT_M && (away_m - reach_m).max(0.0) < reach_m
    })
}

/// The part of a cell's light that reaches a meter, for each square metre: from its centre, no nearer than the cell is large.
fn view_per_m2(meter: &Meter, place: &Place, area_m2: f64) -> f64 {
    let away = place.point_m - meter.position_m;
    let size_m = area_m2.sqrt();
    let (a, b) = (away.dot(meter.normal), -away.dot(place.normal));
    // A cell whose centre is behind may have a part before the meter.
    if a < -size_m || b < -size_m {
        return 0.0;
    }
    let square = away.length_squared() + area_m2 + NEAR_M * NEAR_M;
    (a.max(0.0) + 0.25 * size_m) * (b.max(0.0) + 0.25 * size_m) / (PI * square * square)
}

/// Root mean square of the light that a cell sends out, in lm/m².
fn sample_leaf(transporter: &Transporter, leaf: &Leaf, seed: u64) -> f64 {
    let seed = mix(seed ^ mix(u64::from(leaf.cell) + 1));
    let square: f64 = (0..SAMPLES)
        .map(|index| {
            let mut sampler = Sampler::new(seed, index);
            let at = leaf.at(sampler.next_pair());
            let place = transporter.surroundings.uncovered_place(leaf.surface as usize, at);
            place.map_or(0.0, |place| transporter.exitance(&place, &mut sampler, &mut 0).powi(2))
        })
        .sum();
    (square / f64::from(SAMPLES)).sqrt()
}

/// The same of many small surfaces together.
fn sample_sides(transporter: &Transporter, sides: &[usize], seed: u64) -> f64 {
    let count = MESH_SAMPLES.min(4 * sides.len());
    let square: f64 = (0..count)
        .map(|index| {
            let mut sampler = Sampler::new(seed, index as u32);
            let side = sides[((sampler.next() * sides.len() as f64) as usize).min(sides.len() - 1)];
            let place = transporter.surroundings.uncovered_place(side, sampler.next_pair());
            place.map_or(0.0, |place| transporter.exitance(&place, &mut sampler, &mut 0).powi(2))
        })
        .sum();
    (square / count as f64).sqrt()
}

/// The area of a leaf in square metres.
fn leaf_area_m2(surroundings: &Surroundings, leaf: &Leaf) -> f64 {
    surroundings.surfaces[leaf.surface as usize].area_m2 * leaf.size * leaf.size
}
