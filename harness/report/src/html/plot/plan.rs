//! The floor plan of a case: room, bodies, luminaires and points, seen from above.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::axis::ticks;
use super::{WIDTH, figure};
use crate::svg::{label, line, number, text};
use luxproof_model::{FloorPlan, Report};

/// Space left of and above the plan, for its coordinates, in user units.
const LEFT: f64 = 44.0;
const TOP: f64 = 8.0;
const RIGHT: f64 = 10.0;
/// Space below the plan for its coordinates.
const BOTTOM: f64 = 38.0;
const MAX_HEIGHT: f64 = 320.0;
/// Free field around the parts of a scene without a room, in metres.
const MARGIN_M: f64 = 0.5;
/// Half the side of the mark of a luminaire without extent, in user units.
const POINT_MARK: f64 = 4.0;
/// More points than this are not drawn.
const MAX_POINTS: usize = 2000;

/// The positions of each set of points of a case.
type PointSets<'a> = BTreeMap<&'a str, Vec<[f64; 3]>>;

/// Draws the plan of each case; cases without a plan are omitted.
pub(in super::super) fn panels(report: &Report, most: usize) -> Vec<Markup> {
    let cases = report.cases.iter().filter_map(|case| Some((case.name.as_str(), case.plan.as_ref()?)));
    cases.take(most).map(|(name, plan)| panel(report, name, plan)).collect()
}

fn panel(report: &Report, case: &str, plan: &FloorPlan) -> Markup {
    let points = points_of_case(report, case);
    let frame = Frame::around(plan, &points);
    let title = format!("{}seen from above", report.of_suite(case, ": "));
    let drawing = html! {
        @if let Some([x, y]) = plan.room_m { (rectangle("room", [[0.0, 0.0], [x, y]], &frame, "room")) }
        @for body in &plan.bodies_m { (rectangle("body", *body, &frame, "body")) }
        @for luminaire in &plan.luminaires {
            polygon.luminaire points=(luminaire_outline(luminaire.corners_m, &frame)) {
                title { (luminaire.name) " at " (coordinates(luminaire.at_m)) }
            }
        }
        @for (set, positions) in &points { @for (k, at) in positions.iter().take(MAX_POINTS).enumerate() {
            @let [x, y] = frame.at([at[0], at[1]]);
            circle.point cx=(number(x)) cy=(number(y)) r="2.4" { title { (set) "[" (k) "] at " (coordinates(*at)) } }
        } }
        (axes(&frame))
    };
    let sets: Vec<String> = points.iter().map(|(set, positions)| format!("{set} ({})", positions.len())).collect();
    let luminaires = super::super::plural(plan.luminaires.len(), "luminaire");
    let caption = html! { (luminaires) " (yellow), points: " (sets.join(", ")) ". Hover for names and heights." };
    figure(&title, frame.height(), &drawing, &caption)
}

/// The positions of the points at which a case measures, by set, each once.
fn points_of_case<'a>(report: &'a Report, case: &str) -> PointSets<'a> {
    let mut points: PointSets<'a> = BTreeMap::new();
    let mut seen = std::collections::HashSet::new();
    // Directions of luminous intensity are far from the room.
    for c in report.comparisons.iter().filter(|c| c.key.case == case && c.gamma_deg.is_none()) {
        if seen.insert(&c.meter) {
            let set = c.meter.0.rsplit_once('[').map_or(c.meter.0.as_str(), |(set, _)| set);
            points.entry(set).or_default().push(c.at_m);
        }
    }
    points
}

fn coordinates(at_m: [f64; 3]) -> String {
    format!("({}) m", at_m.map(label).join(", "))
}

fn rectangle(class: &str, corners_m: [[f64; 2]; 2], frame: &Frame, name: &str) -> Markup {
    let [a, b] = corners_m.map(|corner| frame.at(corner));
    html! {
        rect class=(class) x=(number(a[0].min(b[0]))) y=(number(a[1].min(b[1]))) width=(number((b[0] - a[0]).abs())) height=(number((b[1] - a[1]).abs())) {
            title { (name) }
        }
    }
}

/// The outline of a luminaire; one without extent gets a small square.
fn luminaire_outline(corners_m: [[f64; 2]; 4], frame: &Frame) -> String {
    let corners = corners_m.map(|corner| frame.at(corner));
    let is_point = corners.iter().all(|corner| (corner[0] - corners[0][0]).hypot(corner[1] - corners[0][1]) < 2.0);
    let signs = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let drawn = if is_point {
        signs.map(|[x, y]| [corners[0][0] + POINT_MARK * x, corners[0][1] + POINT_MARK * y])
    } else {
        corners
    };
    drawn.map(|[x, y]| format!("{},{}", number(x), number(y))).join(" ")
}

/// The part of the floor that is drawn, and its scale.
struct Frame {
    low_m: [f64; 2],
    size_m: [f64; 2],
    /// User units per metre.
    scale: f64,
}

impl Frame {
    fn around(plan: &FloorPlan, points: &PointSets<'_>) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut include = |[x, y]: [f64; 2]| {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        };
        if let Some(size_m) = plan.room_m {
            include([0.0, 0.0]);
            include(size_m);
        } else {
            let luminaires = plan.luminaires.iter().flat_map(|luminaire| luminaire.corners_m);
            let points = points.values().flatten().map(|at| [at[0], at[1]]);
            for [x, y] in plan.bodies_m.iter().flatten().copied().chain(luminaires).chain(points) {
                include([x - MARGIN_M, y - MARGIN_M]);
                include([x + MARGIN_M, y + MARGIN_M]);
            }
        }
        if low[0] > high[0] {
            (low, high) = ([0.0; 2], [1.0; 2]);
        }
        let size_m = [high[0] - low[0], high[1] - low[1]];
        let scale = ((WIDTH - LEFT - RIGHT) / size_m[0]).min(MAX_HEIGHT / size_m[1]);
        Self { low_m: low, size_m, scale }
    }

    /// The place of a point on the page; y points up.
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let top_m = self.low_m[1] + self.size_m[1];
        [LEFT + (x - self.low_m[0]) * self.scale, TOP + (top_m - y) * self.scale]
    }

    fn bottom(&self) -> f64 {
        TOP + self.size_m[1] * self.scale
    }

    fn height(&self) -> f64 {
        self.bottom() + BOTTOM
    }
}

/// Coordinates along both axes.
fn axes(frame: &Frame) -> Markup {
    let [low, high] = [frame.low_m, [frame.low_m[0] + frame.size_m[0], frame.low_m[1] + frame.size_m[1]]];
    let bottom = frame.bottom();
    html! {
        @for tick in ticks(low[0], high[0], 6) {
            @let [x, _] = frame.at([tick, low[1]]);
            (line("tickline", [x, bottom], [x, bottom + 4.0])) (text("tick", "middle", [x, bottom + 16.0], &label(tick)))
        }
        @for tick in ticks(low[1], high[1], 5) {
            @let [_, y] = frame.at([low[0], tick]);
            (line("tickline", [LEFT - 4.0, y], [LEFT, y])) (text("tick", "end", [LEFT - 7.0, y + 4.0], &label(tick)))
        }
        (text("axis", "middle", [LEFT + 0.5 * frame.size_m[0] * frame.scale, bottom + 31.0], "x [m]"))
        text.axis text-anchor="middle" transform={ "translate(11 " (number(0.5 * (TOP + bottom))) ") rotate(-90)" } { "y [m]" }
    }
}
