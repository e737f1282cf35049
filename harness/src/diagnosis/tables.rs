//! Tables of candela as a wrong reader would have them.

use std::sync::Arc;

use luminaire::photometry::{LuminousIntensityDistribution, Photometry};
use luminaire::scene::Luminaire;

/// A table of more nodes than this is thinned out where only its reflected light counts.
const MANY_NODES: usize = 400;
/// What is left of it, each way.
const NODES_LEFT: usize = 13;

/// Leaves the luminaire as it is, and says so, where a table's angles allow no other.
pub(super) fn replace(luminaire: &mut Luminaire, distribution: Option<LuminousIntensityDistribution>) -> bool {
    let Some(distribution) = distribution else { return false };
    luminaire.photometry = Arc::new(Photometry { distribution, ..(*luminaire.photometry).clone() });
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
    let mut c_deg: Vec<f64> = table.c_deg().iter().flat_map(images).chain([0.0, 360.0]).collect();
    let mut gamma_deg: Vec<f64> = table.gamma_deg().iter().flat_map(|g| [*g, source(0.0, *g).1]).collect();
    for angles in [&mut c_deg, &mut gamma_deg] {
        angles.sort_by(f64::total_cmp);
        angles.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    }
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
    let table = &luminaire.photometry.distribution;
    let axial = LuminousIntensityDistribution::axial(table.gamma_deg().to_vec(), table.azimuth_average());
    replace(luminaire, axial.ok())
}

pub(super) fn extrapolated(luminaire: &mut Luminaire) -> bool {
    let table = &luminaire.photometry.distribution;
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

/// The candela of every node squared, the table's own unit a candela.
pub(super) fn squared(luminaire: &mut Luminaire) -> bool {
    let table = &luminaire.photometry.distribution;
    let at_nodes = nodes(table, table.gamma_deg(), |c, g| table.intensity(c, g).value().powi(2));
    let (c_deg, gamma_deg) = (table.c_deg().to_vec(), table.gamma_deg().to_vec());
    luminaire.flux_scale *= luminaire.flux_scale;
    replace(luminaire, LuminousIntensityDistribution::new(c_deg, gamma_deg, at_nodes).ok())
}

/// A table that reflected light is soon solved for: every so many nodes of a long one, and whether that changes it.
pub(super) fn thinned(luminaire: &mut Luminaire) -> bool {
    let table = &luminaire.photometry.distribution;
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
