//! Luminaires of several emitters: which one is meant, which ones add up, and their sum.
//!
//! Each emitter has an intensity distribution of its own about its own centre. Those that are not placed or turned apart shine
//! from one point, and far away their intensities add up; any others are no single distribution, and one must be named.

use roxmltree::Node;

use super::{Light, Reader};
use crate::photometry::LuminousIntensityDistribution;
use crate::photometry::error::{Problem, ReadError};
use crate::photometry::xml::{child, content, is};

/// Parts of the names of elements that place an emitter or turn it.
const PLACING: [&str; 7] = ["Center", "Centre", "Position", "Location", "Orientation", "Rotation", "Offset"];

/// The most values of a sum, and the most times that a value of an emitter is looked up for it.
const MAX_VALUES: usize = 1_000_000;
const MAX_LOOKUPS: usize = 50_000_000;

/// Over how many degrees a sum falls where the table of one emitter ends with light.
const EDGE_DEG: f64 = 1e-6;

impl Reader<'_> {
    /// The emitters that are read: the one that is named by its ID, its description or its number, or all where they share one
    /// centre and orientation.
    pub(super) fn emitters<'d>(&self, root: Node<'d, 'd>, which: Option<&str>) -> Result<Vec<Node<'d, 'd>>, ReadError> {
        let emitters = root.children().filter(|node| is(*node, "Emitter"));
        let luminous: Vec<Node> = emitters.filter(|node| child(*node, "LuminousData").is_some()).collect();
        let Some(first) = luminous.first() else {
            let message = "no <Emitter> holds <LuminousData>".into();
            return Err(self.error(root, Problem::Xml { message }));
        };
        let names = || {
            let name = |(k, node): (usize, &Node)| content(*node, "ID").unwrap_or_else(|| (k + 1).to_string());
            luminous.iter().enumerate().map(name).collect::<Vec<String>>()
        };
        if let Some(which) = which {
            let is_meant = |(k, node): &(usize, &Node)| {
                (k + 1).to_string() == which
                    || ["ID", "Description"].iter().any(|name| content(**node, name).as_deref() == Some(which))
            };
            let Some((_, one)) = luminous.iter().enumerate().find(is_meant) else {
                let (name, names) = (which.to_string(), names());
                return Err(self.error(root, Problem::NoSuchPart { name, names }));
            };
            return Ok(vec![*one]);
        }
        match luminous.iter().find(|node| placement(**node) != placement(*first)) {
            None => Ok(luminous),
            Some(apart) => Err(self.error(*apart, Problem::Several { names: names() })),
        }
    }
}

/// Everything that an emitter says of its place and orientation.
fn placement(emitter: Node) -> Vec<String> {
    let places = |node: &Node| PLACING.iter().any(|part| node.tag_name().name().contains(part));
    let elements = emitter.children().filter(Node::is_element).filter(places);
    let words = elements.flat_map(|element| element.descendants()).flat_map(|node| {
        let attributes = node.attributes().map(|a| format!("{}={}", a.name(), a.value().trim()));
        let text = node.is_text().then(|| node.text().unwrap_or_default().trim().to_string());
        let name = node.is_element().then(|| node.tag_name().name().to_string());
        name.into_iter().chain(attributes).chain(text.filter(|text| !text.is_empty())).collect::<Vec<_>>()
    });
    words.collect()
}

/// The light of emitters in one place. What not all of them say, nobody says of the sum.
pub(super) fn sum(lights: &[Light]) -> Result<Light, Problem> {
    let tables: Vec<LuminousIntensityDistribution> = lights.iter().map(|l| l.distribution.full_circle()).collect();
    let merged = |angles: Vec<f64>| {
        let mut angles = angles;
        angles.sort_by(f64::total_cmp);
        angles.dedup();
        angles
    };
    let is_axial = lights.iter().all(|light| light.distribution.c_deg().len() == 1);
    let c_deg = if is_axial { vec![0.0] } else { merged(tables.iter().flat_map(|t| t.c_deg().to_vec()).collect()) };
    let gamma_deg = merged(tables.iter().flat_map(gammas).collect());
    let values = c_deg.len().saturating_mul(gamma_deg.len());
    if values > MAX_VALUES || values.saturating_mul(lights.len()) > MAX_LOOKUPS {
        let what = format!("the sum of {} emitters on all their angles together, {values} values,", lights.len());
        return Err(Problem::Unsupported { what });
    }
    let mut candela = vec![0.0; values];
    for table in &tables {
        // Gamma by gamma.
        let one = table.intensities(&c_deg, &gamma_deg);
        for (c, plane) in candela.chunks_mut(gamma_deg.len()).enumerate() {
            plane.iter_mut().enumerate().for_each(|(g, sum)| *sum += one[g * c_deg.len() + c]);
        }
    }
    let total = |of: fn(&Light) -> Option<f64>| lights.iter().map(of).sum::<Option<f64>>();
    Ok(Light {
        distribution: LuminousIntensityDistribution::new(c_deg, gamma_deg, candela)?,
        lamp_lumens: total(|light| light.lamp_lumens),
        input_watts: total(|light| light.input_watts),
    })
}

/// A table's gamma angles and, beyond an end that is not dark, one at which it is.
fn gammas(table: &LuminousIntensityDistribution) -> Vec<f64> {
    let mut gamma_deg = table.gamma_deg().to_vec();
    let last = gamma_deg.len() - 1;
    let is_lit = |g: usize| (0..table.c_deg().len()).any(|c| table.plane(c)[g] > 0.0);
    for (g, beyond) in [(0, gamma_deg[0] - EDGE_DEG), (last, gamma_deg[last] + EDGE_DEG)] {
        if is_lit(g) && (0.0..=180.0).contains(&beyond) {
            gamma_deg.push(beyond);
        }
    }
    gamma_deg
}
