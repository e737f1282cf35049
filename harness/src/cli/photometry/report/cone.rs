//! The cone diagram: how wide the beam is at distances along its axis, and the illuminance in its middle.

use luminaire::photometry::{BeamPlane, BeamWidth, Photometry};
use maud::{Markup, html};

use crate::report::svg::{label, line, number, text};

/// Distances along the axis in metres.
const DISTANCES_M: [f64; 5] = [1.0, 2.0, 3.0, 4.0, 5.0];
/// A beam that reaches further to a side has no foot that can be drawn.
const WIDEST_DEG: f64 = 80.0;
const COLUMN: f64 = 260.0;
const TOP: f64 = 64.0;
const DEEP: f64 = 300.0;
const STYLE: &str = ".cone{fill:#f3c969;fill-opacity:.45;stroke:#a9740f}.grid{fill:none;stroke:#c8c8c8;stroke-width:.8}.tick{fill:#555}";

pub(super) fn diagram(file: &str, photometry: &Photometry) -> Result<String, String> {
    let distribution = &photometry.distribution;
    let beam = distribution.beam().map_err(|reason| reason.to_string())?;
    let width = |plane: BeamPlane| {
        let width = distribution.beam_width(&beam, plane, 0.5).map_err(|reason| reason.to_string())?;
        let widest = width.one_side_deg.max(width.other_side_deg);
        if widest > WIDEST_DEG {
            return Err(format!(
                "the beam reaches {widest:.1} degrees to a side, of which no cone has a foot within {WIDEST_DEG}"
            ));
        }
        Ok(width)
    };
    let planes = [("vertical plane", width(BeamPlane::Vertical)?), ("plane across", width(BeamPlane::Across)?)];
    let on_axis = distribution.intensity(beam.c_deg, beam.gamma_deg).value();
    let (wide, high) = (2.0 * COLUMN + 110.0, TOP + DEEP + 30.0);
    let title: String = file.chars().filter(|c| !c.is_control()).collect();
    let axis = format!("axis C {}° gamma {}°", label(beam.c_deg), label(beam.gamma_deg));
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (wide) " " (high) } font-family="sans-serif" font-size="11" {
            style { (STYLE) }
            rect width=(wide) height=(high) fill="#ffffff" {}
            (text("title", "middle", [wide / 2.0, 20.0], &format!("{title}: cone to half the largest intensity, {axis}")))
            @for (k, (name, width)) in planes.iter().enumerate() { (cone(20.0 + COLUMN * k as f64, name, *width)) }
            (text("tick", "end", [wide - 14.0, TOP - 14.0], "E on the axis"))
            @for distance in DISTANCES_M {
                @let y = TOP + DEEP * distance / DISTANCES_M[4];
                @let lux = on_axis / (distance * distance);
                (text("tick", "end", [wide - 14.0, y + 4.0], &format!("{distance} m: {} lx", label(lux))))
            }
        }
    };
    Ok(svg.into_string() + "\n")
}

/// One plane's section; the two sides keep their own angles, the scale is the plane's own.
fn cone(left: f64, name: &str, width: BeamWidth) -> Markup {
    let spread = [width.one_side_deg, width.other_side_deg].map(|deg| deg.to_radians().tan());
    let per_metre = 0.5 * (COLUMN - 40.0) / (DISTANCES_M[4] * spread[0].max(spread[1]).max(0.2));
    let middle = left + 0.5 * (COLUMN - 20.0);
    let foot = |side: usize, distance: f64| {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        [middle + sign * spread[side] * distance * per_metre, TOP + DEEP * distance / DISTANCES_M[4]]
    };
    let point = |[x, y]: [f64; 2]| format!("{} {}", number(x), number(y));
    let end = DISTANCES_M[4];
    html! {
        (text("tick", "middle", [middle, TOP - 14.0], &format!("{name}, {:.1}°", width.full_deg())))
        path.cone d={ "M" (point([middle, TOP])) "L" (point(foot(0, end))) "L" (point(foot(1, end))) "Z" } {}
        (line("grid", [middle, TOP], [middle, TOP + DEEP]))
        @for distance in DISTANCES_M {
            (line("grid", foot(1, distance), foot(0, distance)))
            @let diameter = (spread[0] + spread[1]) * distance;
            (text("tick", "middle", [middle, foot(0, distance)[1] + 12.0], &format!("{diameter:.2} m")))
        }
    }
}
