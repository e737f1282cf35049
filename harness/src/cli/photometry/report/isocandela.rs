//! The isocandela diagram: lines of equal intensity over C and gamma.

use luminaire::photometry::Photometry;
use maud::html;

use super::super::web::{STYLE, Web};
use crate::report::svg::{label, number, text};

/// Lines in percent of the largest intensity, with their colours.
const LEVELS: [(f64, &str); 6] =
    [(90.0, "#7a0403"), (75.0, "#cb2b04"), (50.0, "#fb8022"), (25.0, "#2aaf6c"), (10.0, "#2b7cd3"), (5.0, "#30123b")];
/// Steps of the grid on which lines are followed, in degrees of C and of gamma.
const C_STEP: f64 = 2.0;
const GAMMA_STEP: f64 = 1.0;
const LEGEND: f64 = 34.0;

pub(super) fn diagram(file: &str, photometry: &Photometry) -> Result<String, &'static str> {
    let distribution = &photometry.distribution;
    let most = distribution.max_intensity().value();
    if most <= 0.0 {
        return Err("every intensity is zero");
    }
    let web = Web::new(distribution.flux_between(90.0, 180.0).value() > 0.0);
    let [width, height] = web.size(LEGEND);
    let lines = LEVELS.map(|(percent, colour)| (percent, colour, contour(photometry, &web, percent / 100.0 * most)));
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

/// Pieces of the line of one intensity, cell by cell (marching squares, the middle deciding saddles).
fn contour(photometry: &Photometry, web: &Web, level: f64) -> String {
    let c_deg: Vec<f64> = (0..=(360.0 / C_STEP) as u32).map(|k| C_STEP * f64::from(k) - 180.0).collect();
    let gamma_deg: Vec<f64> =
        (0..=(web.gamma_end_deg() / GAMMA_STEP) as u32).map(|k| GAMMA_STEP * f64::from(k)).collect();
    let candela = photometry.distribution.intensities(&c_deg, &gamma_deg);
    let columns = c_deg.len();
    let mut path = String::new();
    for (j, gamma) in gamma_deg.windows(2).enumerate() {
        for (i, c) in c_deg.windows(2).enumerate() {
            let corner = |di: usize, dj: usize| (c[di], gamma[dj], candela[(j + dj) * columns + i + di]);
            let round = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            let crossings: Vec<[f64; 2]> = (0..4)
                .filter_map(|k| {
                    let (a, b) = (round[k], round[(k + 1) % 4]);
                    let t = (level - a.2) / (b.2 - a.2);
                    ((a.2 >= level) != (b.2 >= level)).then(|| web.place(a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1)))
                })
                .collect();
            let middle = round.iter().map(|corner| corner.2).sum::<f64>() / 4.0;
            let pairs: &[[usize; 2]] = match crossings.len() {
                2 => &[[0, 1]],
                // A saddle: the middle belongs to the first corner, or not.
                4 if (middle >= level) == (round[0].2 >= level) => &[[0, 1], [2, 3]],
                4 => &[[3, 0], [1, 2]],
                _ => &[],
            };
            for [from, to] in pairs {
                let point = |k: usize| format!("{} {}", number(crossings[k][0]), number(crossings[k][1]));
                path.push_str(&format!("M{}L{}", point(*from), point(*to)));
            }
        }
    }
    path
}
