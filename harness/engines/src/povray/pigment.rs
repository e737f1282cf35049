//! A luminous intensity distribution as a POV-Ray pigment: the filter of a small sphere around a point light.
//!
//! The pattern value of a direction is gamma / 360 in the maps of one C plane and C / 720 in the map of planes; half the
//! range stays unused so that neither pole nor the last plane sits where POV-Ray wraps patterns. Both maps blend
//! linearly: together they are bilinear in degrees, as the table is defined (IES LM-63).

use std::fmt::Write;

use luxproof_photometry::{LuminousIntensityDistribution, Symmetry};

/// Entries that a map of POV-Ray holds at most (`MAX_BLEND_MAP_ENTRIES`).
pub(super) const MAX_ENTRIES: usize = 256;

/// Where a table ends with light short of a pole, it falls to zero within this.
pub(super) const EDGE_DEG: f64 = 1e-3;

/// `#declare <name> = pigment {...}` whose filter is intensity relative to the table's largest.
pub(super) fn declare(name: &str, distribution: &LuminousIntensityDistribution) -> String {
    let table = distribution.padded(EDGE_DEG);
    let table = if table.symmetry() == Symmetry::Axial { table } else { table.full_circle() };
    let largest = table.max_intensity().value();
    let mut text = String::new();
    let planes = table.c_deg().iter().enumerate();
    let pigments: Vec<String> = planes.map(|(c, _)| of_plane(table.gamma_deg(), table.plane(c), largest)).collect();
    if pigments.len() == 1 {
        return format!("#declare {name} = pigment {{\n{}}}\n", pigments[0]);
    }
    for (k, pigment) in pigments.iter().enumerate() {
        writeln!(text, "#declare {name}_C{k} = pigment {{\n{pigment}}}").ok();
    }
    writeln!(text, "#declare {name} = pigment {{\n  function {{ AngleC(x,y,z)/720 }} pigment_map {{").ok();
    for (k, c_deg) in table.c_deg().iter().enumerate() {
        writeln!(text, "    [{c_deg}/720 {name}_C{k}]").ok();
    }
    text.push_str("  }\n}\n");
    text
}

/// The pigment of one C plane; more angles than a map holds become several maps that meet at shared angles.
fn of_plane(gamma_deg: &[f64], candela: &[f64], largest: f64) -> String {
    let entries = gamma_deg.iter().zip(candela);
    let entries: Vec<String> =
        entries.map(|(gamma, cd)| format!("[{gamma}/360 rgbt <0,0,0,{}>]", cd / largest)).collect();
    let last = gamma_deg.len() - 1;
    if last < MAX_ENTRIES {
        return format!("    {}\n", color_map(&entries));
    }
    let mut text = "    function { AngleGamma(x,y,z)/360 } pigment_map {\n".to_owned();
    for first in (0..last).step_by(MAX_ENTRIES - 1) {
        let end = (first + MAX_ENTRIES - 1).min(last);
        let piece = color_map(&entries[first..=end]);
        for edge in [first, end] {
            writeln!(text, "    [{}/360 {piece}]", gamma_deg[edge]).ok();
        }
    }
    text.push_str("    }\n");
    text
}

/// A map of entries, four a line.
fn color_map(entries: &[String]) -> String {
    let rows: Vec<String> = entries.chunks(4).map(|row| format!("      {}\n", row.join(" "))).collect();
    format!("function {{ AngleGamma(x,y,z)/360 }} color_map {{\n{}    }}", rows.concat())
}
