//! Candela tables as a faulty reader takes them.
//!
//! Each function changes a luminaire's table and returns whether it did.

use std::sync::Arc;

use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::Luminaire;

/// Angles by which a curve between two angles of a table is drawn.
const ANGLES_PER_INTERVAL: u32 = 16;
/// Just above a gamma of 90 degrees.
const BEHIND_DEG: f64 = 90.0 + 1e-6;
/// Angles closer than this are the same, in degrees.
const SAME_ANGLE_DEG: f64 = 1e-9;

/// The table as one of type C, for readers that take any angles for C and gamma.
fn type_c_table(luminaire: &Luminaire) -> LuminousIntensityDistribution {
    luminaire.photometry.distribution.in_type_c().distribution
}

/// Replaces the table where there is a valid one.
pub(super) fn replace_distribution(
    luminaire: &mut Luminaire,
    distribution: Option<LuminousIntensityDistribution>,
) -> bool {
    let Some(distribution) = distribution else { return false };
    luminaire.photometry = Arc::new(luminaire.photometry.with_distribution(distribution));
    true
}

/// Replaces the table by one of these nodes, where they form a valid table.
fn replace_nodes(luminaire: &mut Luminaire, c_deg: Vec<f64>, gamma_deg: Vec<f64>, candela: Vec<f64>) -> bool {
    replace_distribution(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, candela).ok())
}

/// Whether the light is the same in every plane.
pub(super) fn is_axial(luminaire: &Luminaire) -> bool {
    luminaire.photometry.distribution.c_deg().len() == 1
}

/// Reads the table at other angles.
///
/// The new nodes are the table's own nodes and their images, so that nothing is lost between them.
pub(super) fn remap(luminaire: &mut Luminaire, source: impl Fn(f64, f64) -> (f64, f64)) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    // Every map is its own inverse, and sends nodes of C to their mirror images about C 0 or C 90.
    let mut c_deg = vec![0.0, 360.0];
    for c in table.c_deg() {
        c_deg.extend([*c, (-c).rem_euclid(360.0), (180.0 - c).rem_euclid(360.0)]);
    }
    let c_deg = sort_angles(c_deg);
    let gamma_deg = sort_angles(table.gamma_deg().iter().flat_map(|g| [*g, source(0.0, *g).1]).collect());
    let candela = sample_nodes(&c_deg, &gamma_deg, |c, g| {
        let (c, g) = source(c, g);
        table.intensity(c, g).value()
    });
    replace_nodes(luminaire, c_deg, gamma_deg, candela)
}

/// Replaces the table by the same intensity everywhere, with the same flux.
pub(super) fn make_isotropic(luminaire: &mut Luminaire) -> bool {
    let mean = luminaire.photometry.distribution.flux().value() / (4.0 * std::f64::consts::PI);
    replace_distribution(luminaire, LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![mean; 2]).ok())
}

pub(super) fn average_over_c(luminaire: &mut Luminaire) -> bool {
    let table = &type_c_table(luminaire);
    let axial = LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), table.azimuth_average());
    replace_distribution(luminaire, axial.ok())
}

/// Takes for every plane the mean of those listed, whatever part of the circle each stands for: those of the file, or those of the
/// full circle with both of its ends.
pub(super) fn average_planes(luminaire: &mut Luminaire, is_full_circle: bool) -> bool {
    let own = type_c_table(luminaire);
    let table = if is_full_circle { own.full_circle() } else { own };
    let count = table.c_deg().len() as f64;
    let mut row = vec![0.0; table.gamma_deg().len()];
    for plane in 0..table.c_deg().len() {
        row.iter_mut().zip(table.plane(plane)).for_each(|(sum, candela)| *sum += candela / count);
    }
    !is_axial(luminaire)
        && replace_distribution(luminaire, LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), row).ok())
}

/// Continues the table beyond its first and last gamma with the candela there.
pub(super) fn extrapolate(luminaire: &mut Luminaire) -> bool {
    let table = &type_c_table(luminaire);
    let gamma = table.gamma_deg();
    let (first, last) = (gamma[0], gamma[gamma.len() - 1]);
    if first == 0.0 && last == 180.0 {
        return false;
    }
    let mut gamma_deg = gamma.to_vec();
    gamma_deg.splice(0..0, (first > 0.0).then_some(0.0));
    gamma_deg.extend((last < 180.0).then_some(180.0));
    let candela = sample_nodes(table.c_deg(), &gamma_deg, |c, g| table.intensity(c, g.clamp(first, last)).value());
    replace_nodes(luminaire, table.c_deg().to_vec(), gamma_deg, candela)
}

/// Takes the first plane for all planes.
pub(super) fn keep_first_plane(luminaire: &mut Luminaire) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let axial = LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), table.plane(0).to_vec());
    !is_axial(luminaire) && replace_distribution(luminaire, axial.ok())
}

/// Raises the candela of every node to a power, each as a part of the largest.
pub(super) fn raise_candela(luminaire: &mut Luminaire, power: f64) -> bool {
    let table = &type_c_table(luminaire);
    let peak = table.max_intensity().value();
    let candela = sample_nodes(table.c_deg(), table.gamma_deg(), |c, g| {
        peak * (table.intensity(c, g).value() / peak).powf(power)
    });
    let is_even = candela.iter().all(|candela| *candela == peak);
    peak > 0.0 && !is_even && replace_nodes(luminaire, table.c_deg().to_vec(), table.gamma_deg().to_vec(), candela)
}

/// Reads at each gamma what belongs so many degrees nearer to the nadir.
///
/// A texture does so if it takes the edges of texels for their centres. It is half a texel off, so that its last
/// texel ends a whole one before the table.
pub(super) fn shift_gamma(luminaire: &mut Luminaire, by_deg: f64) -> bool {
    let table = &type_c_table(luminaire);
    let gamma = table.gamma_deg();
    let (first, last) = (gamma[0], gamma[gamma.len() - 1]);
    let (low, high) = (first - 2.0 * by_deg.min(0.0), last - 2.0 * by_deg.max(0.0));
    if low >= high {
        return false;
    }
    let moved = gamma.iter().chain([&low, &high]).map(|g| g + by_deg).filter(|g| (first..=last).contains(g));
    let gamma_deg = sort_angles(moved.chain([first, last]).collect());
    let candela =
        sample_nodes(table.c_deg(), &gamma_deg, |c, g| table.intensity(c, (g - by_deg).clamp(low, high)).value());
    replace_nodes(luminaire, table.c_deg().to_vec(), gamma_deg, candela)
}

/// Turns C by half a circle beyond a gamma of 90 degrees, as a projection through the centre does.
pub(super) fn turn_behind(luminaire: &mut Luminaire) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    if is_axial(luminaire) || table.gamma_deg().last().is_none_or(|last| *last <= BEHIND_DEG) {
        return false;
    }
    let mut c_deg = vec![0.0, 360.0];
    for c in table.c_deg() {
        c_deg.extend([*c, (c + 180.0).rem_euclid(360.0)]);
    }
    let c_deg = sort_angles(c_deg);
    let mut gamma_deg = table.gamma_deg().to_vec();
    gamma_deg.extend([90.0, BEHIND_DEG].into_iter().filter(|g| table.gamma_deg()[0] < *g));
    let gamma_deg = sort_angles(gamma_deg);
    let candela = sample_nodes(&c_deg, &gamma_deg, |c, g| {
        let c = if g >= BEHIND_DEG { (c + 180.0).rem_euclid(360.0) } else { c };
        table.intensity(c, g).value()
    });
    replace_nodes(luminaire, c_deg, gamma_deg, candela)
}

/// Leaves the candela and spaces the angles of C, of gamma, or of both evenly.
pub(super) fn space_angles_evenly(luminaire: &mut Luminaire, in_c: bool, in_gamma: bool) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let c_deg = if in_c { even_angles(table.c_deg()) } else { table.c_deg().to_vec() };
    let gamma_deg = if in_gamma { even_angles(table.gamma_deg()) } else { table.gamma_deg().to_vec() };
    let has_changed = c_deg != table.c_deg() || gamma_deg != table.gamma_deg();
    let candela = (0..c_deg.len()).flat_map(|k| table.plane(k).to_vec()).collect();
    has_changed && replace_nodes(luminaire, c_deg, gamma_deg, candela)
}

/// As many angles between the first and the last, evenly spaced.
fn even_angles(angles: &[f64]) -> Vec<f64> {
    let (first, last, steps) = (angles[0], angles[angles.len() - 1], (angles.len() - 1) as f64);
    (0..angles.len()).map(|k| first + (last - first) * k as f64 / steps).collect()
}

/// An angle of a new table, with the angle of the old table that its candela come from.
#[derive(Clone, Copy)]
struct AngleSource {
    node_deg: f64,
    source_deg: f64,
}

/// Draws a curve from 0 to 1 between the table's angles, instead of a straight line.
pub(super) fn draw_curve(luminaire: &mut Luminaire, [in_c, in_gamma]: [bool; 2], curve: fn(f64) -> f64) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let c = if in_c { curved_angles(table.c_deg(), curve) } else { unchanged_angles(table.c_deg()) };
    let gamma = if in_gamma { curved_angles(table.gamma_deg(), curve) } else { unchanged_angles(table.gamma_deg()) };
    let mut candela = vec![];
    for c in &c {
        candela.extend(gamma.iter().map(|gamma| table.intensity(c.source_deg, gamma.source_deg).value()));
    }
    replace_nodes(luminaire, nodes_deg(&c), nodes_deg(&gamma), candela)
}

fn nodes_deg(angles: &[AngleSource]) -> Vec<f64> {
    angles.iter().map(|angle| angle.node_deg).collect()
}

fn unchanged_angles(angles: &[f64]) -> Vec<AngleSource> {
    angles.iter().map(|a| AngleSource { node_deg: *a, source_deg: *a }).collect()
}

/// Finer angles, each with the angle that a curve between two neighbours leads to.
fn curved_angles(angles: &[f64], curve: fn(f64) -> f64) -> Vec<AngleSource> {
    let mut fine = vec![];
    for pair in angles.windows(2) {
        let (from, step) = (pair[0], pair[1] - pair[0]);
        for k in 0..ANGLES_PER_INTERVAL {
            let v = f64::from(k) / f64::from(ANGLES_PER_INTERVAL);
            fine.push(AngleSource { node_deg: from + step * v, source_deg: from + step * curve(v) });
        }
    }
    let last = angles[angles.len() - 1];
    fine.push(AngleSource { node_deg: last, source_deg: last });
    fine
}

/// What a cubic takes for the value beyond a row's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beyond {
    /// The row's continuation: the image of a pole, or the next plane round the circle; darkness where there is none.
    Closed,
    Dark,
    Nearest,
}

/// The four values about the interval from `k` to `k + 1`.
///
/// `continuations` are the indices of the values before and behind the row, where it continues.
fn four_values(row: &[f64], k: usize, continuations: [Option<usize>; 2], beyond: Beyond) -> [f64; 4] {
    let [before, behind] = continuations;
    let first = if k > 0 { row[k - 1] } else { value_beyond(row, before, row[k], beyond) };
    let last = row.get(k + 2).copied().unwrap_or_else(|| value_beyond(row, behind, row[k + 1], beyond));
    [first, row[k], row[k + 1], last]
}

fn value_beyond(row: &[f64], continuation: Option<usize>, nearest: f64, beyond: Beyond) -> f64 {
    match beyond {
        Beyond::Closed => continuation.map_or(0.0, |k| row[k]),
        Beyond::Dark => 0.0,
        Beyond::Nearest => nearest,
    }
}

/// Catmull and Rom's cubic from the second of four values, at 0, to the third, at 1.
fn cubic([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    b + 0.5 * x * (c - a + x * (2.0 * a - 5.0 * b + 4.0 * c - d + x * (3.0 * (b - c) + d - a)))
}

/// Draws cubics between the table's gamma angles, or between its C angles too, through four neighbours, by their numbers and not by
/// their angles.
pub(super) fn draw_cubics(luminaire: &mut Luminaire, in_c: bool, beyond: Beyond) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let (c, gamma) = (table.c_deg(), table.gamma_deg());
    let last = gamma.len() - 1;
    // A pole mirrors the row, and a circle continues with its second plane.
    let poles = [(gamma[0] == 0.0).then_some(1), (gamma[last] == 180.0).then(|| last - 1)];
    let circle = [Some(c.len() - 2), Some(1)];
    let (c_deg, gamma_deg) = (if in_c { fine_angles(c) } else { c.to_vec() }, fine_angles(gamma));
    let planes: Vec<Vec<f64>> = (0..c.len()).map(|k| fine_values(table.plane(k), poles, beyond)).collect();
    let mut rings = vec![];
    for g in 0..gamma_deg.len() {
        let ring: Vec<f64> = planes.iter().map(|plane| plane[g]).collect();
        rings.push(if in_c { fine_values(&ring, circle, beyond) } else { ring });
    }
    // A cubic may swing below zero, where a reader shows darkness.
    let candela = (0..c_deg.len()).flat_map(|k| rings.iter().map(move |ring| ring[k].max(0.0))).collect();
    replace_nodes(luminaire, c_deg, gamma_deg, candela)
}

/// The values of a row at fine angles, by cubics.
fn fine_values(row: &[f64], continuations: [Option<usize>; 2], beyond: Beyond) -> Vec<f64> {
    let mut fine = vec![];
    for k in 0..row.len() - 1 {
        let values = four_values(row, k, continuations, beyond);
        fine.extend((0..ANGLES_PER_INTERVAL).map(|v| cubic(values, f64::from(v) / f64::from(ANGLES_PER_INTERVAL))));
    }
    fine.extend(row.last());
    fine
}

fn fine_angles(angles: &[f64]) -> Vec<f64> {
    let mut fine = vec![];
    for pair in angles.windows(2) {
        let (from, step) = (pair[0], (pair[1] - pair[0]) / f64::from(ANGLES_PER_INTERVAL));
        fine.extend((0..ANGLES_PER_INTERVAL).map(|v| from + step * f64::from(v)));
    }
    fine.extend(angles.last());
    fine
}

/// Makes the table dark at its last gamma itself, as `<` in place of `<=` does.
pub(super) fn darken_last_gamma(luminaire: &mut Luminaire) -> bool {
    let table = &type_c_table(luminaire);
    let gamma = table.gamma_deg();
    let (before, last) = (gamma[gamma.len() - 2], gamma[gamma.len() - 1]);
    let edge = last - 1e-6 * (last - before);
    let gamma_deg = [&gamma[..gamma.len() - 1], &[edge, last]].concat();
    let candela =
        sample_nodes(table.c_deg(), &gamma_deg, |c, g| if g < last { table.intensity(c, g).value() } else { 0.0 });
    replace_nodes(luminaire, table.c_deg().to_vec(), gamma_deg, candela)
}

/// Looks up angles in radians in a table of degrees.
pub(super) fn look_up_radians(luminaire: &mut Luminaire) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let c_deg: Vec<f64> = (0..=360).map(f64::from).collect();
    let gamma_deg: Vec<f64> = (0..=180).map(f64::from).collect();
    let candela = sample_nodes(&c_deg, &gamma_deg, |c, g| {
        // C 360 is C 0.
        table.intensity(c.rem_euclid(360.0).to_radians(), g.to_radians()).value()
    });
    replace_nodes(luminaire, c_deg, gamma_deg, candela)
}

/// Sorts angles and drops duplicates.
fn sort_angles(mut angles: Vec<f64>) -> Vec<f64> {
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|a, b| (*a - *b).abs() < SAME_ANGLE_DEG);
    angles
}

/// Squares the candela of every node, in candela.
pub(super) fn square_candela(luminaire: &mut Luminaire) -> bool {
    let table = &type_c_table(luminaire);
    let candela = sample_nodes(table.c_deg(), table.gamma_deg(), |c, g| table.intensity(c, g).value().powi(2));
    luminaire.flux_scale *= luminaire.flux_scale;
    replace_nodes(luminaire, table.c_deg().to_vec(), table.gamma_deg().to_vec(), candela)
}

/// Samples candela at all nodes, plane by plane.
fn sample_nodes(c_deg: &[f64], gamma_deg: &[f64], candela: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let mut samples = vec![];
    for c in c_deg {
        samples.extend(gamma_deg.iter().map(|g| candela(*c, *g)));
    }
    samples
}

/// The node that counts for all directions between two nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Neighbour {
    Nearest,
    Lower,
    Higher,
}

/// Part of an interval in which a table without interpolation changes from one node to the next.
const EDGE: f64 = 1e-6;

/// Takes the candela of a neighbouring node for every direction, along C, gamma or both.
pub(super) fn take_neighbours(luminaire: &mut Luminaire, [in_c, in_gamma]: [bool; 2], neighbour: Neighbour) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let (c, gamma) = (table.c_deg(), table.gamma_deg());
    let c = if in_c { stepped_angles(c, neighbour) } else { unchanged_angles(c) };
    let gamma = if in_gamma { stepped_angles(gamma, neighbour) } else { unchanged_angles(gamma) };
    replace_by_sources(luminaire, &table, &c, &gamma)
}

/// Angles with steps between them, each with the node that counts there.
fn stepped_angles(angles: &[f64], neighbour: Neighbour) -> Vec<AngleSource> {
    let mut stepped = vec![];
    for pair in angles.windows(2) {
        let (from, step) = (pair[0], pair[1] - pair[0]);
        let edge = match neighbour {
            Neighbour::Nearest => from + 0.5 * step,
            Neighbour::Lower => pair[1] - EDGE * step,
            Neighbour::Higher => from + EDGE * step,
        };
        stepped.push(AngleSource { node_deg: from, source_deg: from });
        if neighbour != Neighbour::Higher {
            stepped.push(AngleSource { node_deg: edge - 0.5 * EDGE * step, source_deg: from });
        }
        if neighbour != Neighbour::Lower {
            stepped.push(AngleSource { node_deg: edge + 0.5 * EDGE * step, source_deg: pair[1] });
        }
    }
    let last = angles[angles.len() - 1];
    stepped.push(AngleSource { node_deg: last, source_deg: last });
    stepped
}

/// Replaces the table by nodes that take their candela from other angles of it.
fn replace_by_sources(
    luminaire: &mut Luminaire,
    table: &LuminousIntensityDistribution,
    c: &[AngleSource],
    gamma: &[AngleSource],
) -> bool {
    let mut candela = vec![];
    for c in c {
        candela.extend(gamma.iter().map(|gamma| table.intensity(c.source_deg, gamma.source_deg).value()));
    }
    replace_nodes(luminaire, nodes_deg(c), nodes_deg(gamma), candela)
}

/// Reads at each node what belongs a number of steps farther, along C or gamma; the ends stay.
pub(super) fn move_nodes(luminaire: &mut Luminaire, [in_c, in_gamma]: [bool; 2], steps: f64) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    if in_c && is_axial(luminaire) {
        return false;
    }
    let (c, gamma) = (table.c_deg(), table.gamma_deg());
    let c = if in_c { moved_angles(c, steps) } else { unchanged_angles(c) };
    let gamma = if in_gamma { moved_angles(gamma, steps) } else { unchanged_angles(gamma) };
    replace_by_sources(luminaire, &table, &c, &gamma)
}

fn moved_angles(angles: &[f64], steps: f64) -> Vec<AngleSource> {
    let last = angles.len() - 1;
    // Half a step moves the middle between nodes to a node.
    let indices = (0..=2 * last).map(|k| 0.5 * k as f64);
    indices
        .map(|index| AngleSource { node_deg: angle_at(angles, index), source_deg: angle_at(angles, index + steps) })
        .collect()
}

/// Returns the angle at a fractional index, linear between nodes and constant beyond the ends.
fn angle_at(angles: &[f64], index: f64) -> f64 {
    let last = angles.len() - 1;
    let index = index.clamp(0.0, last as f64);
    let (low, part) = (index.floor() as usize, index.fract());
    angles[low] + part * (angles[(low + 1).min(last)] - angles[low])
}

/// Interpolates candela by their logarithms along gamma.
pub(super) fn interpolate_by_logarithm(luminaire: &mut Luminaire) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let (c_deg, gamma_deg) = (table.c_deg().to_vec(), fine_angles(table.gamma_deg()));
    let mut candela = vec![];
    for k in 0..c_deg.len() {
        candela.extend(fine_by_logarithm(table.plane(k)));
    }
    replace_nodes(luminaire, c_deg, gamma_deg, candela)
}

/// The values of a row at fine angles, by geometric means; a node of darkness makes its intervals dark.
fn fine_by_logarithm(row: &[f64]) -> Vec<f64> {
    let mut fine = vec![];
    for pair in row.windows(2) {
        for k in 0..ANGLES_PER_INTERVAL {
            let part = f64::from(k) / f64::from(ANGLES_PER_INTERVAL);
            fine.push(if k == 0 { pair[0] } else { pair[0].powf(1.0 - part) * pair[1].powf(part) });
        }
    }
    fine.extend(row.last());
    fine
}

/// Interpolates candela linearly in the cosine of gamma.
pub(super) fn interpolate_by_cosine(luminaire: &mut Luminaire) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let mut gamma = vec![];
    for pair in table.gamma_deg().windows(2) {
        let [from, to] = [pair[0], pair[1]].map(|angle: f64| angle.to_radians().cos());
        for k in 0..ANGLES_PER_INTERVAL {
            let node_deg = pair[0] + (pair[1] - pair[0]) * f64::from(k) / f64::from(ANGLES_PER_INTERVAL);
            let part = (node_deg.to_radians().cos() - from) / (to - from);
            gamma.push(AngleSource { node_deg, source_deg: pair[0] + part * (pair[1] - pair[0]) });
        }
    }
    let last = table.gamma_deg()[table.gamma_deg().len() - 1];
    gamma.push(AngleSource { node_deg: last, source_deg: last });
    let c = unchanged_angles(table.c_deg());
    replace_by_sources(luminaire, &table, &c, &gamma)
}

/// What counts where a wrong gamma lies beyond the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EndOfGamma {
    Dark,
    /// The nearest gamma from 0 to 180 degrees; the table may end before.
    WithinSphere,
    /// The nearest gamma of the table.
    WithinTable,
}

/// Looks up another gamma: a multiple of the right one plus some degrees.
pub(super) fn read_other_gamma(luminaire: &mut Luminaire, factor: f64, plus_deg: f64, end: EndOfGamma) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let gamma_deg = table.gamma_deg();
    let (first, last) = (gamma_deg[0], gamma_deg[gamma_deg.len() - 1]);
    // Just beyond the table's ends it may be dark at once.
    let step = EDGE * (last - first);
    let images = gamma_deg.iter().copied().chain([first - step, last + step, 0.0, 180.0]);
    let within = images.map(|g| (g - plus_deg) / factor).filter(|g| (0.0..=180.0).contains(g));
    let nodes = sort_angles(within.chain([0.0, 180.0]).collect());
    let candela = sample_nodes(table.c_deg(), &nodes, |c, gamma| {
        let other = factor * gamma + plus_deg;
        let taken = match end {
            EndOfGamma::Dark => other,
            EndOfGamma::WithinSphere => other.clamp(0.0, 180.0),
            EndOfGamma::WithinTable => other.clamp(first, last),
        };
        // Rounding does not lead out of the table.
        let is_near_end = (taken - taken.clamp(first, last)).abs() < SAME_ANGLE_DEG;
        table.intensity(c, if is_near_end { taken.clamp(first, last) } else { taken }).value()
    });
    replace_nodes(luminaire, table.c_deg().to_vec(), nodes, candela)
}

/// Multiplies candela by a power of the cosine of gamma, in degrees that are fine enough for straight lines.
pub(super) fn multiply_by_cosine(luminaire: &mut Luminaire, power: f64, is_dark_behind: bool) -> bool {
    let table = luminaire.photometry.distribution.full_circle();
    let gamma_deg = fine_angles(table.gamma_deg());
    let candela = sample_nodes(table.c_deg(), &gamma_deg, |c, g| {
        let is_lit = g <= BEHIND_DEG || !is_dark_behind;
        if is_lit {
            table.intensity(c, g).value() * g.to_radians().cos().abs().max(MIN_COSINE).powf(power)
        } else {
            0.0
        }
    });
    replace_nodes(luminaire, table.c_deg().to_vec(), gamma_deg, candela)
}

/// A negative power of the cosine has no limit at 90 degrees.
const MIN_COSINE: f64 = 1e-3;

/// What counts beyond the last plane of a table that covers a part of the circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EndOfPlanes {
    Dark,
    Last,
    Repeated,
}

/// Continues the table beyond its last plane otherwise than by symmetry; returns whether it has a symmetry.
pub(super) fn continue_planes(luminaire: &mut Luminaire, end: EndOfPlanes) -> bool {
    let own = &type_c_table(luminaire);
    let last = own.c_deg()[own.c_deg().len() - 1];
    if is_axial(luminaire) || last > 359.0 {
        return false;
    }
    let table = own.full_circle();
    let mut c_deg: Vec<f64> = own.c_deg().to_vec();
    match end {
        EndOfPlanes::Dark => c_deg.extend([last + EDGE, 360.0 - EDGE, 360.0]),
        EndOfPlanes::Last => c_deg.extend([360.0 - EDGE, 360.0]),
        EndOfPlanes::Repeated => {
            let turns = (360.0 / last).ceil() as u32;
            for turn in (1..turns).map(f64::from) {
                c_deg.extend(own.c_deg().iter().map(|c| c + turn * last + EDGE));
                // The last plane counts up to the first of the next turn.
                c_deg.push((turn + 1.0) * last - EDGE);
            }
            c_deg.retain(|c| *c < 360.0);
            c_deg.push(360.0);
        }
    }
    let c_deg = sort_angles(c_deg);
    let candela = sample_nodes(&c_deg, table.gamma_deg(), |c, g| {
        let c = c.rem_euclid(360.0);
        match end {
            _ if c <= last => table.intensity(c, g).value(),
            EndOfPlanes::Dark => 0.0,
            EndOfPlanes::Last => table.intensity(last, g).value(),
            EndOfPlanes::Repeated => table.intensity(c.rem_euclid(last), g).value(),
        }
    });
    replace_nodes(luminaire, c_deg, table.gamma_deg().to_vec(), candela)
}
