//! Luminaires with several emitters: the choice of one, or the sum of all.
//!
//! Each emitter has an intensity distribution about its centre. Emitters with the same place and orientation add up to
//! one distribution. Other emitters do not, so that the path must name one of them.

use roxmltree::Node;

use super::{Light, Reader};
use crate::LuminousIntensityDistribution;
use crate::error::{Problem, ReadError};
use crate::xml::{child, content, is};

/// Parts of the names of elements that place an emitter or turn it.
const PLACING: [&str; 7] = ["Center", "Centre", "Position", "Location", "Orientation", "Rotation", "Offset"];

/// The largest number of values of a sum.
const MAX_VALUES: usize = 1_000_000;
/// The largest number of intensities that are looked up for a sum.
const MAX_LOOKUPS: usize = 50_000_000;

/// Width in degrees of the fall of a sum where the table of one emitter ends with light.
const EDGE_DEG: f64 = 1e-6;

impl Reader<'_> {
    /// Selects the emitter with this ID, description or number, or all where they share one place and orientation.
    pub(super) fn select_emitters<'d>(
        &self,
        root: Node<'d, 'd>,
        which: Option<&str>,
    ) -> Result<Vec<Node<'d, 'd>>, ReadError> {
        let emitters = root.children().filter(|node| is(*node, "Emitter"));
        let luminous: Vec<Node> = emitters.filter(|node| child(*node, "LuminousData").is_some()).collect();
        let Some(first) = luminous.first() else {
            let message = "no <Emitter> holds <LuminousData>".into();
            return Err(self.error(root, Problem::Xml { message }));
        };
        if let Some(which) = which {
            let mut numbered = luminous.iter().enumerate();
            let Some((_, named)) = numbered.find(|(k, node)| is_named(**node, k + 1, which)) else {
                let problem = Problem::NoSuchPart { name: which.to_string(), names: emitter_names(&luminous) };
                return Err(self.error(root, problem));
            };
            return Ok(vec![*named]);
        }
        match luminous.iter().find(|node| placement(**node) != placement(*first)) {
            None => Ok(luminous),
            Some(other) => Err(self.error(*other, Problem::Several { names: emitter_names(&luminous) })),
        }
    }
}

/// The names of emitters: their IDs, or else their numbers from 1.
fn emitter_names(emitters: &[Node]) -> Vec<String> {
    let numbered = emitters.iter().enumerate();
    numbered.map(|(k, node)| content(*node, "ID").unwrap_or_else(|| (k + 1).to_string())).collect()
}

/// Whether an emitter has this number, ID or description.
fn is_named(emitter: Node, number: usize, name: &str) -> bool {
    number.to_string() == name
        || ["ID", "Description"].iter().any(|element| content(emitter, element).as_deref() == Some(name))
}

/// All words of the elements that place or turn an emitter.
fn placement(emitter: Node) -> Vec<String> {
    let elements = emitter.children().filter(Node::is_element);
    let placing = elements.filter(|node| PLACING.iter().any(|part| node.tag_name().name().contains(part)));
    placing.flat_map(|element| element.descendants()).flat_map(node_words).collect()
}

/// The name, attributes and text of a node.
fn node_words(node: Node) -> Vec<String> {
    let attributes = node.attributes().map(|a| format!("{}={}", a.name(), a.value().trim()));
    let text = node.is_text().then(|| node.text().unwrap_or_default().trim().to_string());
    let name = node.is_element().then(|| node.tag_name().name().to_string());
    name.into_iter().chain(attributes).chain(text.filter(|text| !text.is_empty())).collect()
}

/// Sorted angles, each once.
fn sort_unique(mut angles: Vec<f64>) -> Vec<f64> {
    angles.sort_by(f64::total_cmp);
    angles.dedup();
    angles
}

/// Adds up the light of emitters in one place. A number that one emitter lacks is unknown for the sum.
pub(super) fn add_lights(lights: &[Light]) -> Result<Light, Problem> {
    let tables: Vec<LuminousIntensityDistribution> = lights.iter().map(|l| l.distribution.full_circle()).collect();
    let is_axial = lights.iter().all(|light| light.distribution.c_deg().len() == 1);
    let c_deg =
        if is_axial { vec![0.0] } else { sort_unique(tables.iter().flat_map(|t| t.c_deg().to_vec()).collect()) };
    let gamma_deg = sort_unique(tables.iter().flat_map(gammas_with_edges).collect());
    let values = c_deg.len().saturating_mul(gamma_deg.len());
    if values > MAX_VALUES || values.saturating_mul(lights.len()) > MAX_LOOKUPS {
        let what = format!("the sum of {} emitters on all their angles together, {values} values,", lights.len());
        return Err(Problem::Unsupported { what });
    }
    let mut candela = vec![0.0; values];
    for table in &tables {
        // These are in the order of gamma, the sum is in the order of planes.
        let addend = table.intensities(&c_deg, &gamma_deg);
        for (c, plane) in candela.chunks_mut(gamma_deg.len()).enumerate() {
            plane.iter_mut().enumerate().for_each(|(g, sum)| *sum += addend[g * c_deg.len() + c]);
        }
    }
    Ok(Light {
        distribution: LuminousIntensityDistribution::new(c_deg, gamma_deg, candela)?,
        lamp_lumens: lights.iter().map(|light| light.lamp_lumens).sum(),
        input_watts: lights.iter().map(|light| light.input_watts).sum(),
    })
}

/// The gamma angles of a table, and a dark one just beyond each lit end.
fn gammas_with_edges(table: &LuminousIntensityDistribution) -> Vec<f64> {
    let mut gamma_deg = table.gamma_deg().to_vec();
    let last = gamma_deg.len() - 1;
    for (g, beyond) in [(0, gamma_deg[0] - EDGE_DEG), (last, gamma_deg[last] + EDGE_DEG)] {
        let is_lit = (0..table.c_deg().len()).any(|c| table.plane(c)[g] > 0.0);
        if is_lit && (0.0..=180.0).contains(&beyond) {
            gamma_deg.push(beyond);
        }
    }
    gamma_deg
}
