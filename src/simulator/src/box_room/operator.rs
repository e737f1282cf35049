//! The transport operator on light of one symmetry, part by part.
//!
//! Mirrors of the room leave the operator as it is, whatever the light does. So it takes what is even under a mirror to
//! what is even, and odd to odd: of light without any symmetry it is eight matrices of an eighth of the nodes.

use rayon::prelude::*;

use super::grid::Grid;
use super::kernel::Receiver;
use super::symmetry::Orbits;
use crate::gmres;
use crate::stop::Stop;

/// Sums of fewer rows take microseconds, which are not worth a second thread.
const FEW_ROWS: usize = 500;

/// Irradiance from exitance, both by orbit of the light's symmetries.
pub(super) struct Operator {
    /// The orbits on which each mirror moves those that stand for all others.
    moved: Vec<Vec<u32>>,
    /// A row for each of these: `[parity][orbit]`.
    rows: Vec<Vec<f64>>,
}

impl Operator {
    /// `None` where it was stopped.
    pub(super) fn new(grid: &Grid, room: &Orbits, light: &Orbits, stop: &Stop) -> Option<Self> {
        let moves = moves(room, light);
        let firsts: Vec<u32> =
            (0..light.sizes.len() as u32).filter(|k| moves.iter().all(|to| to[*k as usize] >= *k)).collect();
        let moved: Vec<Vec<u32>> =
            moves.iter().map(|to| firsts.iter().map(|first| to[*first as usize]).collect()).collect();
        let times = (0..firsts.len()).map(|k| moved.iter().filter(|to| to[k] == firsts[k]).count() * moved.len());
        let scale: Vec<f64> = times.map(|times| 1.0 / times as f64).collect();
        let images = room.images.iter();
        let onto: Vec<Vec<u32>> =
            images.map(|image| image.iter().map(|k| light.orbit[*k as usize]).collect()).collect();
        // Rows of one orbit of the room are one row, moved.
        let mut same = vec![vec![]; room.representatives.len()];
        for (place, first) in firsts.iter().enumerate() {
            let node = light.representatives[*first as usize];
            same[room.orbit[node] as usize].push((place, node as u32));
        }
        let rows_of = |(node, same): (&usize, &Vec<(usize, u32)>)| -> Option<Vec<(usize, Vec<f64>)>> {
            if stop.is_due() {
                return None;
            }
            let row = balanced_row(grid, &receiver_at(grid, *node));
            let moved_row = |(place, to): &(usize, u32)| {
                let mut folded = vec![0.0; light.sizes.len()];
                let image = room.images.iter().position(|image| image[*node] == *to);
                for (value, k) in row.iter().zip(image.into_iter().flat_map(|image| &onto[image])) {
                    folded[*k as usize] += value;
                }
                let mut parts = by_parity(&folded, &moved);
                for part in parts.chunks_exact_mut(scale.len()) {
                    part.iter_mut().zip(&scale).for_each(|(value, scale)| *value *= scale);
                }
                (*place, parts)
            };
            Some(same.iter().map(moved_row).collect())
        };
        let found: Vec<_> = room.representatives.par_iter().zip(&same).map(rows_of).collect::<Option<_>>()?;
        let mut rows = vec![vec![]; firsts.len()];
        for (place, row) in found.into_iter().flatten() {
            rows[place] = row;
        }
        Some(Self { moved, rows })
    }

    pub(super) fn apply(&self, exitance: &[f64]) -> Vec<f64> {
        let parts = by_parity(exitance, &self.moved);
        let count = self.rows.len();
        let sums: Vec<_> = if count < FEW_ROWS {
            self.rows.iter().map(|row| self.row_sums(row, &parts)).collect()
        } else {
            self.rows.par_iter().map(|row| self.row_sums(row, &parts)).collect()
        };
        let mut lux = vec![0.0; exitance.len()];
        for (k, to) in self.moved.iter().enumerate() {
            for (to, sums) in to.iter().zip(&sums) {
                lux[*to as usize] = sums[k];
            }
        }
        lux
    }
}

impl Operator {
    /// The sums of a row for what is even and odd under each mirror, as the orbits that these move them to have them.
    fn row_sums(&self, row: &[f64], parts: &[f64]) -> [f64; 8] {
        let count = self.rows.len();
        let mut sums = [0.0; 8];
        let pairs = row.chunks_exact(count).zip(parts.chunks_exact(count));
        sums.iter_mut().zip(pairs).for_each(|(sum, (row, part))| *sum = gmres::dot(row, part));
        add_and_subtract(&mut sums[..self.moved.len()], 1);
        sums
    }
}

/// Where each of the mirrors that keep the light's orbits together moves them, once for all that move them alike.
fn moves(room: &Orbits, light: &Orbits) -> Vec<Vec<u32>> {
    let mut moves: Vec<Vec<u32>> = vec![(0..light.sizes.len() as u32).collect()];
    for mirror in &room.images[1..8] {
        let of_nodes: Vec<u32> = mirror.iter().map(|image| light.orbit[*image as usize]).collect();
        let to: Vec<u32> = light.representatives.iter().map(|node| of_nodes[*node]).collect();
        let is_together = of_nodes.iter().zip(&light.orbit).all(|(image, orbit)| *image == to[*orbit as usize]);
        if is_together && !moves.contains(&to) {
            let further: Vec<_> = moves.iter().map(|before| before.iter().map(|k| to[*k as usize]).collect()).collect();
            moves.extend(further);
        }
    }
    moves
}

/// Sums of values and of what mirrors make of them, with either sign: `[parity][orbit]`.
fn by_parity(values: &[f64], moved: &[Vec<u32>]) -> Vec<f64> {
    let mut parts: Vec<f64> = moved.iter().flatten().map(|k| values[*k as usize]).collect();
    add_and_subtract(&mut parts, moved[0].len());
    parts
}

/// Walsh and Hadamard's transform of blocks.
fn add_and_subtract(values: &mut [f64], block: usize) {
    let mut half = block;
    while 2 * half <= values.len() {
        for both in values.chunks_exact_mut(2 * half) {
            let (a, b) = both.split_at_mut(half);
            for (a, b) in a.iter_mut().zip(b) {
                (*a, *b) = (*a + *b, *a - *b);
            }
        }
        half *= 2;
    }
}

pub(super) fn receiver_at(grid: &Grid, node: usize) -> Receiver {
    let face = grid.place(node).0;
    Receiver { position_m: grid.node(node).0, normal: face.inward_normal(), face: Some(face) }
}

/// A row of the operator, scaled to sum to 1: a receiver in a closed room sees nothing but the room.
///
/// Without it, quadrature errors of 1e-7 would outweigh the absorption of a room with reflectance .9999999.
pub(super) fn balanced_row(grid: &Grid, receiver: &Receiver) -> Vec<f64> {
    let mut row = vec![0.0; grid.len()];
    grid.add_row(receiver, &mut row);
    balance(&mut row);
    row
}

fn balance(row: &mut [f64]) {
    let sum: f64 = row.iter().sum();
    for value in row {
        *value /= sum;
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use glam::DVec3;

    use super::*;
    use crate::box_room::EFFORTS;
    use crate::box_room::symmetry::Symmetries;
    use crate::box_room::tests::{Random, random_scene, s1};

    #[test]
    fn parts_together_take_on_light_as_the_whole_does() {
        let mut turned = s1().0;
        // Light that is the same on either side of the plane x = y, and under no mirror of the room.
        turned.luminaires[0].position_m = DVec3::new(6.0, 6.0, 3.0);
        let mut half_turned = s1().0;
        half_turned.luminaires.extend(s1().0.luminaires);
        half_turned.luminaires[0].position_m = DVec3::new(6.0, 7.0, 3.0);
        half_turned.luminaires[1].position_m = DVec3::new(14.0, 13.0, 3.0);
        for (scene, symmetries) in [(random_scene(&mut Random(3)).0, 1), (s1().0, 8), (turned, 2), (half_turned, 2)] {
            let (room, effort) = (scene.room.unwrap(), &EFFORTS[3]);
            let found = Symmetries::of(&room, &scene.luminaires, &Stop::NEVER).unwrap();
            assert_eq!(found.of_light.len(), symmetries);
            let grid = Grid::new(room.size_m, effort);
            let orbits = Orbits::new(&grid, &found.of_room);
            let light = orbits.under(&found.of_light);
            let mut random = Random(5);
            let exitance: Vec<f64> = light.representatives.iter().map(|_| random.next()).collect();
            let lux = Operator::new(&grid, &orbits, &light, &Stop::NEVER).unwrap().apply(&exitance);
            let everywhere = light.unfold(&exitance);
            for (node, lux) in light.representatives.iter().zip(lux) {
                let row = balanced_row(&grid, &receiver_at(&grid, *node));
                // Rules on near elements are not the same for what the exchange of axes makes of them.
                assert_relative_eq!(lux, gmres::dot(&row, &everywhere), max_relative = 1e-6);
            }
        }
    }
}
