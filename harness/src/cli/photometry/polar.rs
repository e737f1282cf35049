//! The polar intensity diagram: C0-C180 solid, C90-C270 dashed; cd/klm for relative photometry, cd for absolute.

use luminaire::photometry::Photometry;
use maud::html;

use crate::report::svg::{Polar, text};

const RADIUS: f64 = 200.0;
const MARGIN: f64 = 40.0;
/// Heights of the title above and the legend below.
const TITLE: f64 = 34.0;
const LEGEND: f64 = 44.0;
const CURVES: [(f64, &str, &str); 2] = [(0.0, "C0-C180", "curve"), (90.0, "C90-C270", "curve dashed")];
const STYLE: &str = ".grid{fill:none;stroke:#c8c8c8;stroke-width:.8}.tick{fill:#555}.halo{paint-order:stroke;stroke:#fff;stroke-width:3px}\
    .curve{fill:none;stroke:#c0272d;stroke-width:2}.dashed{stroke:#1f5fa8;stroke-dasharray:6 4}";

pub(super) fn diagram(file: &str, photometry: &Photometry) -> String {
    let distribution = &photometry.distribution;
    let (unit, factor) = match photometry.lamp_lumens {
        Some(lumens) if lumens > 0.0 => ("cd/klm", 1000.0 / lumens),
        _ => ("cd", 1.0),
    };
    let gamma_deg = &distribution.gammas_of_half_planes()[..];
    let curve = |c: f64| gamma_deg.iter().map(|g| factor * distribution.intensity(c, *g).value()).collect::<Vec<_>>();
    let is_lit = |c: f64| gamma_deg.iter().any(|g| *g > 90.0 && distribution.intensity(c, *g).value() > 0.0);
    // A downlight is drawn to just above the horizon.
    let upward = [0.0, 90.0, 180.0, 270.0].into_iter().any(is_lit);
    let above = if upward { RADIUS } else { 0.0 };
    let (width, height) = (2.0 * (RADIUS + MARGIN), above + RADIUS + 2.0 * MARGIN + TITLE + LEGEND);
    let (centre, legend) = ([RADIUS + MARGIN, above + MARGIN + TITLE], height - LEGEND + 16.0);
    let paper = Polar::new(centre, RADIUS, factor * distribution.max_intensity().value(), [upward, true]);
    let title = photometry.keyword("LUMINAIRE").and_then(|name| name.lines().next()).unwrap_or(file);
    let title: String = title.chars().filter(|c| !c.is_control()).collect();
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } font-family="sans-serif" font-size="11" {
            style { (STYLE) }
            rect width=(width) height=(height) fill="#ffffff" {}
            (text("title", "middle", [width / 2.0, 20.0], &format!("{title}, {:.0} lm", distribution.flux().value())))
            (paper.grid())
            @for (k, (c_deg, name, class)) in CURVES.into_iter().enumerate() {
                (paper.outline(class, (gamma_deg, &curve(c_deg)), Some((gamma_deg, &curve(c_deg + 180.0)))))
                @let x = MARGIN + 120.0 * k as f64;
                path class=(class) d={ "M" (x) " " (legend) "h28" } {}
                (text("name", "start", [x + 34.0, legend + 4.0], name))
            }
            (text("unit", "end", [2.0 * RADIUS + MARGIN, legend + 4.0], unit))
        }
    };
    svg.into_string() + "\n"
}
