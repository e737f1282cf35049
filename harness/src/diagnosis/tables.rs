//! Tables of candela as a wrong reader would have them.

use std::sync::Arc;

use luminaire::photometry::LuminousIntensityDistribution;
use luminaire::scene::Luminaire;

/// A table of more nodes than this is thinned out where only its reflected light counts.
const MANY_NODES: usize = 400;
/// What is left of it, each way.
const NODES_LEFT: usize = 13;

/// Its table as one of type C, whose angles any other reader takes for C and gamma.
fn in_type_c(luminaire: &Luminaire) -> LuminousIntensityDistribution {
    luminaire.photometry.distribution.in_type_c().distribution
}

/// Leaves the luminaire as it is, and says so, where a table's angles allow no other.
pub(super) fn replace(luminaire: &mut Luminaire, distribution: Option<LuminousIntensityDistribution>) -> bool {
    let Some(distribution) = distribution else { return false };
    luminaire.photometry = Arc::new(luminaire.photometry.with_distribution(distribution));
    true
}

/// Whether its light is the same in every plane.
pub(super) fn is_axial(luminaire: &Luminaire) -> bool {
    luminaire.photometry.distribution.c_deg().len() == 1
}

/// Reads the table at other angles: at its own nodes and their images, so that nothing is lost between them.
pub(super) fn remap(luminaire: &mut Luminaire, source: impl Fn(f64, f64) -> (f64, f64)) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    // Every map is its own inverse: nodes of C go to their mirror images about C 0 or C 90.
    let images = |c: &f64| [*c, (-c).rem_euclid(360.0), (180.0 - c).rem_euclid(360.0)];
    let c_deg = sorted(table.c_deg().iter().flat_map(images).chain([0.0, 360.0]).collect());
    let gamma_deg = sorted(table.gamma_deg().iter().flat_map(|g| [*g, source(0.0, *g).1]).collect());
    let at = |c: f64| gamma_deg.iter().map(move |g| (c, *g));
    let value = |(c, g): (f64, f64)| {
        let (c, g) = source(c, g);
        table.intensity(c, g).value()
    };
    let candela = c_deg.iter().flat_map(|c| at(*c)).map(value).collect();
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok())
}

pub(super) fn isotropic(luminaire: &mut Luminaire) -> bool {
    let mean = luminaire.photometry.distribution.flux().value() / (4.0 * std::f64::consts::PI);
    replace(luminaire, LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![mean; 2]).ok())
}

pub(super) fn averaged(luminaire: &mut Luminaire) -> bool {
    let table = &in_type_c(luminaire);
    let axial = LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), table.azimuth_average());
    replace(luminaire, axial.ok())
}

pub(super) fn extrapolated(luminaire: &mut Luminaire) -> bool {
    let table = &in_type_c(luminaire);
    let gamma = table.gamma_deg();
    let (first, last) = (gamma[0], gamma[gamma.len() - 1]);
    if first == 0.0 && last == 180.0 {
        return false;
    }
    let mut gamma_deg = gamma.to_vec();
    gamma_deg.splice(0..0, (first > 0.0).then_some(0.0));
    gamma_deg.extend((last < 180.0).then_some(180.0));
    let at_nodes = nodes(table, &gamma_deg, |c, g| table.intensity(c, g.clamp(first, last)).value());
    replace(luminaire, LuminousIntensityDistribution::new(table.c_deg().to_vec(), gamma_deg, at_nodes).ok())
}

/// Of all planes the first, all round.
pub(super) fn first_plane(luminaire: &mut Luminaire) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let axial = LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), table.plane(0).to_vec());
    !is_axial(luminaire) && replace(luminaire, axial.ok())
}

/// The candela of every node to a power, each as a part of the largest.
pub(super) fn raised(luminaire: &mut Luminaire, power: f64) -> bool {
    let table = &in_type_c(luminaire);
    let peak = table.max_intensity().value();
    let at_nodes = nodes(table, table.gamma_deg(), |c, g| peak * (table.intensity(c, g).value() / peak).powf(power));
    let is_even = at_nodes.iter().all(|candela| *candela == peak);
    let (c_deg, gamma_deg) = (table.c_deg().to_vec(), table.gamma_deg().to_vec());
    peak > 0.0 && !is_even && replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, at_nodes).ok())
}

/// What should be read at a gamma is read so many degrees farther from the nadir, as from a texture whose texels' edges are taken for their
/// centres: half a texel off, so that its last texel ends a whole one before the table.
pub(super) fn shifted(luminaire: &mut Luminaire, by_deg: f64) -> bool {
    let table = &in_type_c(luminaire);
    let gamma = table.gamma_deg();
    let (first, last) = (gamma[0], gamma[gamma.len() - 1]);
    let (low, high) = (first - 2.0 * by_deg.min(0.0), last - 2.0 * by_deg.max(0.0));
    if low >= high {
        return false;
    }
    let moved = gamma.iter().chain([&low, &high]).map(|g| g + by_deg).filter(|g| (first..=last).contains(g));
    let gamma_deg = sorted(moved.chain([first, last]).collect());
    let at_nodes = nodes(table, &gamma_deg, |c, g| table.intensity(c, (g - by_deg).clamp(low, high)).value());
    replace(luminaire, LuminousIntensityDistribution::new(table.c_deg().to_vec(), gamma_deg, at_nodes).ok())
}

/// From a gamma of 90 degrees on C is turned by half a circle: what is behind is projected through the centre.
pub(super) fn turned_behind(luminaire: &mut Luminaire) -> bool {
    const BEHIND: f64 = 90.0 + 1e-6;
    let table = luminaire.photometry.distribution.full_circle();
    if is_axial(luminaire) || table.gamma_deg().last().is_none_or(|last| *last <= BEHIND) {
        return false;
    }
    let opposite = table.c_deg().iter().map(|c| (c + 180.0).rem_euclid(360.0));
    let c_deg = sorted(table.c_deg().iter().copied().chain(opposite).chain([0.0, 360.0]).collect());
    let is_inside = |g: &f64| table.gamma_deg()[0] < *g;
    let gamma_deg: Vec<f64> =
        table.gamma_deg().iter().copied().chain([90.0, BEHIND].into_iter().filter(is_inside)).collect();
    let gamma_deg = sorted(gamma_deg);
    let turned = |c: f64, g: f64| if g >= BEHIND { (c + 180.0).rem_euclid(360.0) } else { c };
    let at = |c: &f64| gamma_deg.iter().map(|g| table.intensity(turned(*c, *g), *g).value()).collect::<Vec<_>>();
    let candela = c_deg.iter().flat_map(at).collect();
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok())
}

/// The same candela at angles that are taken to be evenly spaced, of C, of gamma, or of both.
pub(super) fn even_angles(luminaire: &mut Luminaire, in_c: bool, in_gamma: bool) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let even = |angles: &[f64], is_wanted: bool| -> Vec<f64> {
        let (first, last, steps) = (angles[0], angles[angles.len() - 1], (angles.len() - 1) as f64);
        let at = |k: usize| first + (last - first) * k as f64 / steps;
        if is_wanted { (0..angles.len()).map(at).collect() } else { angles.to_vec() }
    };
    let (c_deg, gamma_deg) = (even(table.c_deg(), in_c), even(table.gamma_deg(), in_gamma));
    let is_other = c_deg != table.c_deg() || gamma_deg != table.gamma_deg();
    let candela = (0..c_deg.len()).flat_map(|k| table.plane(k).to_vec()).collect();
    is_other && replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok())
}

/// Angles between those of a table, by which a curve is drawn.
const BETWEEN: u32 = 16;

/// Between the table's angles another curve than a straight line, from 0 to 1.
pub(super) fn rounded_off(luminaire: &mut Luminaire, [in_c, in_gamma]: [bool; 2], curve: fn(f64) -> f64) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let finer = |angles: &[f64], is_wanted: bool| -> Vec<(f64, f64)> {
        if !is_wanted {
            return angles.iter().map(|a| (*a, *a)).collect();
        }
        let between = |pair: &[f64]| {
            let (from, by) = (pair[0], pair[1] - pair[0]);
            (0..BETWEEN).map(move |k| {
                let v = f64::from(k) / f64::from(BETWEEN);
                (from + by * v, from + by * curve(v))
            })
        };
        let last = angles[angles.len() - 1];
        angles.windows(2).flat_map(between).chain([(last, last)]).collect()
    };
    let (c, gamma) = (finer(table.c_deg(), in_c), finer(table.gamma_deg(), in_gamma));
    let of_plane = |(_, c): &(f64, f64)| gamma.iter().map(|(_, g)| table.intensity(*c, *g).value()).collect::<Vec<_>>();
    let candela = c.iter().flat_map(of_plane).collect();
    let nodes = |of: &[(f64, f64)]| of.iter().map(|(node, _)| *node).collect();
    replace(luminaire, LuminousIntensityDistribution::new(nodes(&c), nodes(&gamma), candela).ok())
}

/// What a cubic takes for the value beyond a row's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beyond {
    /// Where the row closes, its own: the image of a pole, the next plane round. Else none.
    Closed,
    Dark,
    Nearest,
}

/// The values before and behind two neighbours, and these, in a row that goes on at its ends with others of its own.
fn four(row: &[f64], k: usize, [before, behind]: [Option<usize>; 2], beyond: Beyond) -> [f64; 4] {
    let end = |goes_on: Option<usize>, nearest: f64| match beyond {
        Beyond::Closed => goes_on.map_or(0.0, |of| row[of]),
        Beyond::Dark => 0.0,
        Beyond::Nearest => nearest,
    };
    let first = if k > 0 { row[k - 1] } else { end(before, row[k]) };
    let last = row.get(k + 2).copied().unwrap_or_else(|| end(behind, row[k + 1]));
    [first, row[k], row[k + 1], last]
}

/// Catmull and Rom's cubic from the second of four values, at 0, to the third, at 1.
fn cubic([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    b + 0.5 * x * (c - a + x * (2.0 * a - 5.0 * b + 4.0 * c - d + x * (3.0 * (b - c) + d - a)))
}

/// Between the table's angles cubics through four neighbours, by their numbers, whatever the angles between them.
pub(super) fn by_cubics(luminaire: &mut Luminaire, beyond: Beyond) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let (c, gamma) = (table.c_deg(), table.gamma_deg());
    let last = gamma.len() - 1;
    // A pole mirrors the row, and a circle goes on with its second plane.
    let poles = [(gamma[0] == 0.0).then_some(1), (gamma[last] == 180.0).then(|| last - 1)];
    let round = [Some(c.len() - 2), Some(1)];
    let curve = |row: &[f64], closes: [Option<usize>; 2]| -> Vec<f64> {
        let between = |k: usize| {
            let values = four(row, k, closes, beyond);
            (0..BETWEEN).map(move |v| cubic(values, f64::from(v) / f64::from(BETWEEN)))
        };
        (0..row.len() - 1).flat_map(between).chain(row.last().copied()).collect()
    };
    let angles = |of: &[f64]| -> Vec<f64> {
        let between = |pair: &[f64]| {
            let (from, step) = (pair[0], (pair[1] - pair[0]) / f64::from(BETWEEN));
            (0..BETWEEN).map(move |v| from + step * f64::from(v))
        };
        of.windows(2).flat_map(between).chain(of.last().copied()).collect()
    };
    let (c_deg, gamma_deg) = (angles(c), angles(gamma));
    let along: Vec<Vec<f64>> = (0..c.len()).map(|k| curve(table.plane(k), poles)).collect();
    let across = (0..gamma_deg.len()).map(|g| curve(&along.iter().map(|plane| plane[g]).collect::<Vec<_>>(), round));
    let across: Vec<Vec<f64>> = across.collect();
    let candela = (0..c_deg.len()).flat_map(|k| across.iter().map(move |row| row[k].max(0.0))).collect();
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok())
}

/// The table is dark at its last gamma itself, as where `<` was meant to be `<=`.
pub(super) fn dark_at_last_gamma(luminaire: &mut Luminaire) -> bool {
    let table = &in_type_c(luminaire);
    let gamma = table.gamma_deg();
    let (before, last) = (gamma[gamma.len() - 2], gamma[gamma.len() - 1]);
    let edge = last - 1e-6 * (last - before);
    let gamma_deg = [&gamma[..gamma.len() - 1], &[edge, last]].concat();
    let at_nodes = nodes(table, &gamma_deg, |c, g| if g < last { table.intensity(c, g).value() } else { 0.0 });
    replace(luminaire, LuminousIntensityDistribution::new(table.c_deg().to_vec(), gamma_deg, at_nodes).ok())
}

/// What is found by angles in radians among those in degrees.
pub(super) fn in_radians(luminaire: &mut Luminaire) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let steps = |end: u32| (0..=end).map(f64::from).collect::<Vec<f64>>();
    let (c_deg, gamma_deg) = (steps(360), steps(180));
    let at = |c: &f64, g: &f64| table.intensity(c.to_radians(), g.to_radians()).value();
    // C 360 is C 0.
    let candela = c_deg.iter().flat_map(|c| gamma_deg.iter().map(|g| at(&c.rem_euclid(360.0), g))).collect();
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok())
}

/// Angles in their order, each once.
fn sorted(mut angles: Vec<f64>) -> Vec<f64> {
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    angles
}

/// The candela of every node squared, the table's own unit a candela.
pub(super) fn squared(luminaire: &mut Luminaire) -> bool {
    let table = &in_type_c(luminaire);
    let at_nodes = nodes(table, table.gamma_deg(), |c, g| table.intensity(c, g).value().powi(2));
    let (c_deg, gamma_deg) = (table.c_deg().to_vec(), table.gamma_deg().to_vec());
    luminaire.flux_scale *= luminaire.flux_scale;
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, at_nodes).ok())
}

/// A table that reflected light is soon solved for: every so many nodes of a long one, and whether that changes it.
pub(super) fn thinned(luminaire: &mut Luminaire) -> bool {
    let table = &in_type_c(luminaire);
    if table.c_deg().len() * table.gamma_deg().len() <= MANY_NODES {
        return false;
    }
    let (c_deg, gamma_deg) = (spread(table.c_deg()), spread(table.gamma_deg()));
    let candela = c_deg.iter().flat_map(|c| gamma_deg.iter().map(|g| table.intensity(*c, *g).value())).collect();
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok())
}

fn spread(angles: &[f64]) -> Vec<f64> {
    let (last, kept) = (angles.len() - 1, angles.len().min(NODES_LEFT));
    (0..kept).map(|k| angles[(k * last).div_ceil((kept - 1).max(1)).min(last)]).collect()
}

fn nodes(table: &LuminousIntensityDistribution, gamma_deg: &[f64], candela: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let of_plane = |c: &f64| gamma_deg.iter().map(|g| candela(*c, *g)).collect::<Vec<_>>();
    table.c_deg().iter().flat_map(of_plane).collect()
}
