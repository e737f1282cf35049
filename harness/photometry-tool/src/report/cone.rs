//! The cone diagram: the width of the beam at distances along its axis, and the illuminance in its middle.

use luxproof_photometry::{Beam, BeamPlane, BeamWidth, Photometry};
use maud::{Markup, html};

use luxproof_report::svg::{label, line, number, text};

/// Distances along the axis in metres.
const DISTANCES_M: [f64; 5] = [1.0, 2.0, 3.0, 4.0, 5.0];
/// The largest angle to a side that has a foot within the drawing.
const MAX_SIDE_DEG: f64 = 80.0;
/// Lengths of the drawing in its own units.
const COLUMN_WIDTH: f64 = 260.0;
const TOP: f64 = 64.0;
const CONE_HEIGHT: f64 = 300.0;
const STYLE: &str = ".cone{fill:#f3c969;fill-opacity:.45;stroke:#a9740f}.grid{fill:none;stroke:#c8c8c8;stroke-width:.8}.tick{fill:#555}";

/// Draws the diagram, or returns the reason why there is none.
pub(super) fn diagram(file: &str, photometry: &Photometry) -> Result<String, String> {
    let distribution = &photometry.distribution;
    let beam = distribution.beam().map_err(|reason| reason.to_string())?;
    let planes = [
        ("vertical plane", drawable_width(photometry, &beam, BeamPlane::Vertical)?),
        ("plane across", drawable_width(photometry, &beam, BeamPlane::Across)?),
    ];
    let on_axis = distribution.intensity(beam.c_deg, beam.gamma_deg).value();
    let (wide, high) = (2.0 * COLUMN_WIDTH + 110.0, TOP + CONE_HEIGHT + 30.0);
    let title: String = file.chars().filter(|c| !c.is_control()).collect();
    let axis = format!("axis C {}° gamma {}°", label(beam.c_deg), label(beam.gamma_deg));
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (wide) " " (high) } font-family="sans-serif" font-size="11" {
            style { (STYLE) }
            rect width=(wide) height=(high) fill="#ffffff" {}
            (text("title", "middle", [wide / 2.0, 20.0], &format!("{title}: cone to half the largest intensity, {axis}")))
            @for (k, (name, width)) in planes.iter().enumerate() { (cone(20.0 + COLUMN_WIDTH * k as f64, name, *width)) }
            (text("tick", "end", [wide - 14.0, TOP - 14.0], "E on the axis"))
            @for distance in DISTANCES_M {
                @let y = TOP + CONE_HEIGHT * distance / DISTANCES_M[4];
                @let lux = on_axis / (distance * distance);
                (text("tick", "end", [wide - 14.0, y + 4.0], &format!("{distance} m: {} lx", label(lux))))
            }
        }
    };
    Ok(svg.into_string() + "\n")
}

/// The width of the beam in a plane, or the reason why it cannot be drawn.
fn drawable_width(photometry: &Photometry, beam: &Beam, plane: BeamPlane) -> Result<BeamWidth, String> {
    let width = photometry.distribution.beam_width(beam, plane, 0.5).map_err(|reason| reason.to_string())?;
    let widest = width.one_side_deg.max(width.other_side_deg);
    if widest > MAX_SIDE_DEG {
        return Err(format!(
            "the beam reaches {widest:.1} degrees to a side, of which no cone has a foot within {MAX_SIDE_DEG}"
        ));
    }
    Ok(width)
}

/// The scale and axis of the cone in one plane.
struct ConeFrame {
    middle: f64,
    per_metre: f64,
}

impl ConeFrame {
    /// The place of a point at a distance along the axis, with a signed tangent of its angle to the axis.
    fn place(&self, tangent: f64, distance: f64) -> [f64; 2] {
        [self.middle + tangent * distance * self.per_metre, TOP + CONE_HEIGHT * distance / DISTANCES_M[4]]
    }
}

/// A point of an SVG path.
fn path_point([x, y]: [f64; 2]) -> String {
    format!("{} {}", number(x), number(y))
}

/// Draws the section of one plane. Each side has its angle; the scale fits the plane.
fn cone(left: f64, name: &str, width: BeamWidth) -> Markup {
    let spread = [width.one_side_deg, width.other_side_deg].map(|deg| deg.to_radians().tan());
    let per_metre = 0.5 * (COLUMN_WIDTH - 40.0) / (DISTANCES_M[4] * spread[0].max(spread[1]).max(0.2));
    let middle = left + 0.5 * (COLUMN_WIDTH - 20.0);
    let frame = ConeFrame { middle, per_metre };
    let feet =
        DISTANCES_M.map(|distance| (distance, frame.place(-spread[1], distance), frame.place(spread[0], distance)));
    let (_, last_other, last_one) = feet[4];
    html! {
        (text("tick", "middle", [middle, TOP - 14.0], &format!("{name}, {:.1}°", width.full_deg())))
        path.cone d={ "M" (path_point([middle, TOP])) "L" (path_point(last_one)) "L" (path_point(last_other)) "Z" } {}
        (line("grid", [middle, TOP], [middle, TOP + CONE_HEIGHT]))
        @for (distance, other, one) in feet {
            (line("grid", other, one))
            @let diameter = (spread[0] + spread[1]) * distance;
            (text("tick", "middle", [middle, one[1] + 12.0], &format!("{diameter:.2} m")))
        }
    }
}
