//! The isocandela diagram: lines of equal intensity over C and gamma.

use luxproof_photometry::Photometry;
use maud::html;

use super::super::web::{STYLE, Web};
use luxproof_report::svg::{label, number, text};

/// The drawn intensities in percent of the largest one, with their colours.
const LEVELS_PERCENT: [(f64, &str); 6] =
    [(90.0, "#7a0403"), (75.0, "#cb2b04"), (50.0, "#fb8022"), (25.0, "#2aaf6c"), (10.0, "#2b7cd3"), (5.0, "#30123b")];
/// Steps of the sampling grid in degrees.
const C_STEP_DEG: f64 = 2.0;
const GAMMA_STEP_DEG: f64 = 1.0;
const LEGEND_HEIGHT: f64 = 34.0;

/// Draws the diagram, or returns the reason why there is none.
pub(super) fn diagram(file: &str, photometry: &Photometry) -> Result<String, &'static str> {
    let distribution = &photometry.distribution;
    let most = distribution.max_intensity().value();
    if most <= 0.0 {
        return Err("every intensity is zero");
    }
    let web = Web::new(distribution.flux_between(90.0, 180.0).value() > 0.0);
    let [width, height] = web.size(LEGEND_HEIGHT);
    let lines =
        LEVELS_PERCENT.map(|(percent, colour)| (percent, colour, contour(photometry, &web, percent / 100.0 * most)));
    let title: String = file.chars().filter(|c| !c.is_control()).collect();
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } font-family="sans-serif" font-size="11" {
            style { (STYLE) ".iso{fill:none;stroke-width:1.4;stroke-linecap:round}" }
            rect width=(width) height=(height) fill="#ffffff" {}
            (text("title", "middle", [width / 2.0, 20.0], &format!("{title}: isocandela, largest {} cd", label(most))))
            (web.grid())
            @for (_, colour, path) in &lines { path class="iso" stroke=(colour) d=(path) {} }
            @for (k, (percent, colour, _)) in lines.iter().enumerate() {
                @let x = 52.0 + 92.0 * k as f64;
                @let y = height - 14.0;
                path class="iso" stroke=(colour) d={ "M" (x) " " (y) "h16" } {}
                (text("tick", "start", [x + 20.0, y + 4.0], &format!("{} ({percent} %)", label(percent / 100.0 * most))))
            }
        }
    };
    Ok(svg.into_string() + "\n")
}

/// Draws the line of one intensity cell by cell: marching squares, where the middle of a cell decides on saddles.
fn contour(photometry: &Photometry, web: &Web, level: f64) -> String {
    let c_deg: Vec<f64> = (0..=(360.0 / C_STEP_DEG) as u32).map(|k| C_STEP_DEG * f64::from(k) - 180.0).collect();
    let gamma_deg: Vec<f64> =
        (0..=(web.gamma_end_deg() / GAMMA_STEP_DEG) as u32).map(|k| GAMMA_STEP_DEG * f64::from(k)).collect();
    let candela = photometry.distribution.intensities(&c_deg, &gamma_deg);
    let columns = c_deg.len();
    let mut path = String::new();
    for (j, gamma) in gamma_deg.windows(2).enumerate() {
        for (i, c) in c_deg.windows(2).enumerate() {
            let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| Corner {
                c_deg: c[di],
                gamma_deg: gamma[dj],
                candela: candela[(j + dj) * columns + i + di],
            });
            let crossings: Vec<[f64; 2]> =
                (0..4).filter_map(|k| crossing(web, level, corners[k], corners[(k + 1) % 4])).collect();
            let middle = corners.iter().map(|corner| corner.candela).sum::<f64>() / 4.0;
            let pairs: &[[usize; 2]] = match crossings.len() {
                2 => &[[0, 1]],
                // A saddle: the middle is on the side of the first corner, or not.
                4 if (middle >= level) == (corners[0].candela >= level) => &[[0, 1], [2, 3]],
                4 => &[[3, 0], [1, 2]],
                _ => &[],
            };
            for pair in pairs {
                let [from, to] = pair.map(|k| format!("{} {}", number(crossings[k][0]), number(crossings[k][1])));
                path.push_str(&format!("M{from}L{to}"));
            }
        }
    }
    path
}

/// A corner of a cell of the sampling grid.
#[derive(Clone, Copy)]
struct Corner {
    c_deg: f64,
    gamma_deg: f64,
    candela: f64,
}

/// The place at which the intensity crosses a level between two corners, if it does.
fn crossing(web: &Web, level: f64, a: Corner, b: Corner) -> Option<[f64; 2]> {
    if (a.candela >= level) == (b.candela >= level) {
        return None;
    }
    let t = (level - a.candela) / (b.candela - a.candela);
    Some(web.place(a.c_deg + t * (b.c_deg - a.c_deg), a.gamma_deg + t * (b.gamma_deg - a.gamma_deg)))
}
