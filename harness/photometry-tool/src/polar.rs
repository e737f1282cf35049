//! The polar intensity diagram: C0-C180 solid, C90-C270 dashed; cd/klm for relative photometry, cd for absolute.

use luxproof_photometry::{LuminousIntensityDistribution, Photometry};
use maud::html;

use luxproof_report::svg::{Polar, text};

/// Lengths of the drawing in its own units.
const RADIUS: f64 = 200.0;
const MARGIN: f64 = 40.0;
const TITLE_HEIGHT: f64 = 34.0;
const LEGEND_HEIGHT: f64 = 44.0;
/// The first plane, the name and the class of each curve.
const CURVES: [(f64, &str, &str); 2] = [(0.0, "C0-C180", "curve"), (90.0, "C90-C270", "curve dashed")];
const STYLE: &str = ".grid{fill:none;stroke:#c8c8c8;stroke-width:.8}.tick{fill:#555}.halo{paint-order:stroke;stroke:#fff;stroke-width:3px}\
    .curve{fill:none;stroke:#c0272d;stroke-width:2}.dashed{stroke:#1f5fa8;stroke-dasharray:6 4}";

/// Draws the diagram.
pub(super) fn diagram(file: &str, photometry: &Photometry) -> String {
    let distribution = &photometry.distribution;
    let (unit, factor) = match photometry.lamp_lumens {
        Some(lumens) if lumens > 0.0 => ("cd/klm", 1000.0 / lumens),
        _ => ("cd", 1.0),
    };
    let gamma_deg = &distribution.gammas_of_half_planes()[..];
    // The drawing of a downlight ends just above the horizon.
    let is_uplight = [0.0, 90.0, 180.0, 270.0].into_iter().any(|c| is_lit_above(distribution, c, gamma_deg));
    let above = if is_uplight { RADIUS } else { 0.0 };
    let (width, height) = (2.0 * (RADIUS + MARGIN), above + RADIUS + 2.0 * MARGIN + TITLE_HEIGHT + LEGEND_HEIGHT);
    let (centre, legend) = ([RADIUS + MARGIN, above + MARGIN + TITLE_HEIGHT], height - LEGEND_HEIGHT + 16.0);
    let paper = Polar::new(centre, RADIUS, factor * distribution.max_intensity().value(), [is_uplight, true]);
    let title = photometry.keyword("LUMINAIRE").and_then(|name| name.lines().next()).unwrap_or(file);
    let title: String = title.chars().filter(|c| !c.is_control()).collect();
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } font-family="sans-serif" font-size="11" {
            style { (STYLE) }
            rect width=(width) height=(height) fill="#ffffff" {}
            (text("title", "middle", [width / 2.0, 20.0], &format!("{title}, {:.0} lm", distribution.flux().value())))
            (paper.grid())
            @for (k, (c_deg, name, class)) in CURVES.into_iter().enumerate() {
                @let [front, back] = [c_deg, c_deg + 180.0].map(|c| half_plane(distribution, c, gamma_deg, factor));
                (paper.outline(class, (gamma_deg, &front), Some((gamma_deg, &back))))
                @let x = MARGIN + 120.0 * k as f64;
                path class=(class) d={ "M" (x) " " (legend) "h28" } {}
                (text("name", "start", [x + 34.0, legend + 4.0], name))
            }
            (text("unit", "end", [2.0 * RADIUS + MARGIN, legend + 4.0], unit))
        }
    };
    svg.into_string() + "\n"
}

/// The intensities of a half plane, in the unit of the diagram.
fn half_plane(table: &LuminousIntensityDistribution, c_deg: f64, gamma_deg: &[f64], factor: f64) -> Vec<f64> {
    gamma_deg.iter().map(|g| factor * table.intensity(c_deg, *g).value()).collect()
}

/// Whether a half plane has light above the horizon.
fn is_lit_above(table: &LuminousIntensityDistribution, c_deg: f64, gamma_deg: &[f64]) -> bool {
    gamma_deg.iter().any(|g| *g > 90.0 && table.intensity(c_deg, *g).value() > 0.0)
}
