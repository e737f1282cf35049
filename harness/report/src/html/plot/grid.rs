//! Grids of meters: isolux lines over false colours of the reference, and a map of every engine's deviation.

use std::collections::BTreeSet;

use itertools::Itertools;
use maud::{Markup, html};

use super::super::palette::Palette;
use super::super::percent;
use super::Group;
use super::axis::ticks;
use super::contour::{Segment, contour};
use super::{Marks, WIDTH, colours, figure};
use crate::svg::{label, line, number, text};
use crate::verdict_lines::is_relative;
use crate::words::{largest, off, rounded, significant as six_digits};
use luxproof_model::Report;
use luxproof_model::{Basis, Comparison};

/// Space left of the map for its coordinates, in user units.
const LEFT: f64 = 44.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 6.0;
/// Space between the map and the colour bar.
const BAR_GAP: f64 = 46.0;
/// Height of the colour bar and its labels.
const BAR: f64 = 52.0;
const MAX_MAP_HEIGHT: f64 = 300.0;
/// Fewer meters along a side make no map.
const MIN_METERS_PER_SIDE: usize = 3;
/// More cells are finer than a page shows.
const MAX_CELLS: u32 = 4096;
/// Cells of a colour bar.
const BAR_CELLS: u32 = 40;
/// Meters lie on a lattice if they are off by less than this part of a step.
const LATTICE_TOLERANCE: f64 = 1e-6;

pub(super) fn panels(report: &Report, group: &Group<'_>, palette: &Palette, marks: Marks) -> Vec<Markup> {
    let Some(basis) = group.basis() else { return vec![] };
    let mapped = mapped_comparisons(group, basis);
    let mut panels = vec![];
    for name in mapped.iter().map(|c| set_name(c)).collect::<BTreeSet<&str>>() {
        let engines = group.engines(palette);
        let of_engines: Vec<(&str, Vec<&Comparison>)> =
            engines.into_iter().map(|engine| (engine, set_of_engine(&mapped, name, engine))).collect();
        let found = of_engines.iter().find_map(|(_, set)| Some((set, Lattice::from_meters(set)?)));
        let Some((first, lattice)) = found else { continue };
        let scales = SharedScales::for_set(report, group, basis, name);
        let coarse = coarseness(&lattice, marks);
        let title = group.title(report, &format!("{name}, reference ({})", basis.name()));
        panels.push(isolux_map(&title, first, &lattice, &scales, coarse));
        for (engine, set) in of_engines.iter().filter(|(_, set)| set.len() == first.len()) {
            let title = group.title(report, &format!("{name}, {engine}"));
            panels.push(deviation_map(&title, set, &lattice, &scales, coarse));
        }
    }
    panels
}

/// The comparisons of a group that can be on a map: those with one basis and no direction.
fn mapped_comparisons<'a>(group: &Group<'a>, basis: Basis) -> Vec<&'a Comparison> {
    group.comparisons.iter().copied().filter(|c| c.gamma_deg.is_none() && c.basis() == Some(basis)).collect()
}

/// The comparisons of one engine at a set, in the order of its meters.
fn set_of_engine<'a>(mapped: &[&'a Comparison], name: &str, engine: &str) -> Vec<&'a Comparison> {
    let set = mapped.iter().copied().filter(|c| set_name(c) == name && c.key.engine == engine);
    set.sorted_by_key(|c| meter_index(c)).collect_vec()
}

/// How many meters along a side a cell of a map stands for.
fn coarseness(lattice: &Lattice, marks: Marks) -> usize {
    if marks == Marks::Seen { lattice.coarseness() } else { 1 }
}

/// Maps the references of two cases at one set, on one colour scale.
///
/// Nothing where the set is no grid in both cases, or the references have different bases.
pub(in super::super) fn side_by_side(
    cases: &[Group<'_>; 2],
    (basis, name): (Basis, &str),
    palette: &Palette,
    marks: Marks,
) -> Vec<Markup> {
    let maps: Option<Vec<(Vec<&Comparison>, Lattice)>> =
        cases.iter().map(|group| reference_grid(group, basis, name, palette)).collect();
    let maps = maps.unwrap_or_default();
    let (low, high) = reference_range(maps.iter().flat_map(|(set, _)| set).copied());
    let scales = SharedScales { low, high, tolerance: None, caption: "one scale for both cases" };
    let mut drawn = vec![];
    for (group, (set, lattice)) in cases.iter().zip(&maps) {
        let title = format!("{}: {name}, reference ({})", group.case, basis.name());
        drawn.push(isolux_map(&title, set, lattice, &scales, coarseness(lattice, marks)));
    }
    drawn
}

/// A grid with its references, from the first engine that was compared at all of its meters.
fn reference_grid<'a>(
    group: &Group<'a>,
    basis: Basis,
    name: &str,
    palette: &Palette,
) -> Option<(Vec<&'a Comparison>, Lattice)> {
    let mapped = mapped_comparisons(group, basis);
    for engine in group.engines(palette) {
        let set = set_of_engine(&mapped, name, engine);
        if let Some(lattice) = Lattice::from_meters(&set) {
            return Some((set, lattice));
        }
    }
    None
}

/// The lowest and the highest reference.
fn reference_range<'a>(comparisons: impl Iterator<Item = &'a Comparison>) -> (f64, f64) {
    let values = comparisons.filter_map(|c| Some(c.reference.as_ref()?.value));
    values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)))
}

/// The scales that all maps of a set share, over all engines and all cases of its spec, so that maps can be compared.
struct SharedScales {
    low: f64,
    high: f64,
    /// The relative tolerance at all points, where there is one: the deviation at the ends of the scale.
    tolerance: Option<f64>,
    caption: &'static str,
}

impl SharedScales {
    fn for_set(report: &Report, group: &Group<'_>, basis: Basis, name: &str) -> Self {
        let all: Vec<&Comparison> = report
            .comparisons
            .iter()
            .filter(|c| c.key.procedure == group.procedure && spec_name(&c.key.case) == spec_name(group.case))
            .filter(|c| c.basis() == Some(basis) && c.gamma_deg.is_none() && set_name(c) == name)
            .collect();
        let (low, high) = reference_range(all.iter().copied());
        let tolerance = all.first().map(|c| c.tolerance.relative);
        let is_shared = |c: &&Comparison| is_relative(c) && Some(c.tolerance.relative) == tolerance;
        let tolerance = tolerance.filter(|_| all.iter().all(is_shared));
        let has_more_cases = all.iter().any(|c| c.key.case != group.case);
        let caption = if has_more_cases {
            "one scale for all engines and all cases of the spec"
        } else {
            "one scale for all engines"
        };
        Self { low, high, tolerance, caption }
    }

    /// Where a reference lies between the lowest and the highest.
    fn part(&self, value: f64) -> f64 {
        if self.high > self.low { (value - self.low) / (self.high - self.low) } else { 0.5 }
    }
}

/// The spec of a case: the first part of its name.
fn spec_name(case: &str) -> Option<&str> {
    case.split('/').next()
}

/// The set of a meter: `workplane` of `workplane[3]`.
fn set_name(c: &Comparison) -> &str {
    c.meter.0.rsplit_once('[').map_or(c.meter.0.as_str(), |(set, _)| set)
}

fn meter_index(c: &Comparison) -> usize {
    c.meter.0.rsplit_once('[').and_then(|(_, k)| k.trim_end_matches(']').parse().ok()).unwrap_or(usize::MAX)
}

/// A regular grid of meters, found from their positions: origin + i u + j v, i fastest.
struct Lattice {
    counts: [usize; 2],
    step_m: [f64; 2],
    /// First coordinate along each axis, and the name of the axis.
    axes: [(f64, String); 2],
}

impl Lattice {
    /// `None` where the meters are no regular grid.
    fn from_meters(set: &[&Comparison]) -> Option<Self> {
        if set.len() < MIN_METERS_PER_SIDE * MIN_METERS_PER_SIDE {
            return None;
        }
        let positions: Vec<glam::DVec3> = set.iter().map(|c| glam::DVec3::from_array(c.at_m)).collect();
        let origin = positions[0];
        let u = positions[1] - origin;
        // A row ends where the next meter is not one step along u.
        let steps = positions.windows(2).map(|pair| pair[1] - pair[0]);
        let along_u = 1 + steps.take_while(|step| (*step - u).length() <= LATTICE_TOLERANCE * u.length()).count();
        let along_v = set.len() / along_u;
        let is_large_enough = along_u >= MIN_METERS_PER_SIDE && along_v >= MIN_METERS_PER_SIDE;
        if !is_large_enough || along_u * along_v != set.len() || u.length() == 0.0 {
            return None;
        }
        let v = positions[along_u] - origin;
        let is_regular = positions.iter().enumerate().all(|(k, position)| {
            let expected = origin + u * (k % along_u) as f64 + v * (k / along_u) as f64;
            (*position - expected).length() <= LATTICE_TOLERANCE * (u.length() + v.length())
        });
        (is_regular && v.length() > 0.0).then(|| Self {
            counts: [along_u, along_v],
            step_m: [u.length(), v.length()],
            axes: [(u, "u"), (v, "v")].map(|(step, name)| axis(origin, step, name)),
        })
    }

    /// How many meters along a side a cell must stand for, so that there are not too many cells.
    fn coarseness(&self) -> usize {
        let excess = (self.counts[0] * self.counts[1]) as f64 / f64::from(MAX_CELLS);
        excess.sqrt().ceil().max(1.0) as usize
    }

    /// Groups the meters into blocks of `side` by `side`, and picks a meter of each.
    fn blocks<'a>(
        &self,
        set: &[&'a Comparison],
        side: usize,
        pick: impl Fn(&[&'a Comparison]) -> Option<&'a Comparison>,
    ) -> (Self, Vec<&'a Comparison>) {
        let counts = self.counts.map(|count| count.div_ceil(side));
        let blocks = (0..counts[0] * counts[1]).map(|k| self.block(set, side, [k % counts[0], k / counts[0]]));
        let picked = blocks.filter_map(|block| pick(&block)).collect();
        let middle = 0.5 * (side - 1) as f64;
        let axes = [0, 1].map(|k| (self.axes[k].0 + middle * self.step_m[k], self.axes[k].1.clone()));
        (Self { counts, step_m: self.step_m.map(|step| step * side as f64), axes }, picked)
    }

    /// The meters of one block; blocks at the edge may be smaller.
    fn block<'a>(&self, set: &[&'a Comparison], side: usize, [block_u, block_v]: [usize; 2]) -> Vec<&'a Comparison> {
        let [from_u, from_v] = [side * block_u, side * block_v];
        let to_u = (from_u + side).min(self.counts[0]);
        let to_v = (from_v + side).min(self.counts[1]);
        let mut meters = vec![];
        for v in from_v..to_v {
            let row = v * self.counts[0];
            meters.extend_from_slice(&set[row + from_u..row + to_u]);
        }
        meters
    }

    /// The lattice's size on the page.
    fn frame(&self) -> Frame {
        let size_m = [0, 1].map(|k| self.counts[k] as f64 * self.step_m[k]);
        let scale = ((WIDTH - LEFT - RIGHT) / size_m[0]).min(MAX_MAP_HEIGHT / size_m[1]);
        Frame { cell: self.step_m.map(|step| step * scale), size: size_m.map(|size| size * scale) }
    }

    /// Round coordinates along an axis, with their fractional indices.
    fn axis_ticks(&self, axis: usize) -> Vec<(f64, f64)> {
        let (first, step) = (self.axes[axis].0, self.step_m[axis]);
        let last = first + step * (self.counts[axis] - 1) as f64;
        ticks(first, last, 5).into_iter().map(|tick| (tick, (tick - first) / step)).collect()
    }
}

/// The first coordinate and the name of an axis; a step along no coordinate axis is measured by its length.
fn axis(origin: glam::DVec3, step: glam::DVec3, name: &str) -> (f64, String) {
    let names = ["x", "y", "z"];
    let along = (0..3).find(|&k| step[k] > 0.0 && (step[k] - step.length()).abs() < 1e-9 * step.length());
    along.map_or_else(|| (0.0, format!("along {name} [m]")), |k| (origin[k], format!("{} [m]", names[k])))
}

/// A map's place on the page, in user units.
struct Frame {
    cell: [f64; 2],
    size: [f64; 2],
}

impl Frame {
    /// Middle of a cell at fractional indices; v points up.
    fn at(&self, [i, j]: [f64; 2]) -> [f64; 2] {
        [LEFT + (i + 0.5) * self.cell[0], TOP + self.size[1] - (j + 0.5) * self.cell[1]]
    }

    fn bottom(&self) -> f64 {
        TOP + self.size[1]
    }

    /// Height of the whole panel.
    fn panel_height(&self) -> f64 {
        self.size[1] + BAR_GAP + BAR
    }
}

/// Draws the reference at each meter in false colours, with isolux lines.
fn isolux_map(title: &str, set: &[&Comparison], lattice: &Lattice, scales: &SharedScales, coarse: usize) -> Markup {
    let (lattice, set) = &lattice.blocks(set, coarse, |block| block.get(block.len() / 2).copied());
    let values: Vec<f64> = set.iter().map(|c| c.reference.as_ref().map_or(f64::NAN, |r| r.value)).collect();
    let SharedScales { low, high, .. } = *scales;
    let frame = lattice.frame();
    let levels: Vec<f64> = ticks(low, high, 6).into_iter().filter(|level| *level > low && *level < high).collect();
    let unit = set[0].quantity.unit();
    let ends = [(0.0, bar_end_label(low)), (1.0, bar_end_label(high))];
    let drawing = html! {
        (cells(
            set,
            lattice,
            &frame,
            |k| colours::amount(scales.part(values[k])),
            |k| format!("{} {unit}", six_digits(values[k])),
        ))
        (isolines(&values, lattice, &frame, &levels))
        (coordinates(lattice, &frame))
        (colour_bar(&frame, colours::amount, &ends, &format!("illuminance [{unit}]")))
    };
    let caption = html! { "Cells: the reference at each meter; lines: isolux, in " (unit) "."
        @if coarse > 1 { " One of " (coarse) " × " (coarse) " meters is drawn." }
    };
    figure(title, frame.panel_height(), &drawing, &caption)
}

/// Three significant digits are enough for the end of a colour bar.
fn bar_end_label(value: f64) -> String {
    label(rounded(value, 3).unwrap_or(value))
}

/// Draws the contours at all levels, each with a label where there is room for it.
fn isolines(values: &[f64], lattice: &Lattice, frame: &Frame, levels: &[f64]) -> Markup {
    let lines: Vec<Vec<Segment>> = levels.iter().map(|level| contour(values, lattice.counts, *level)).collect();
    let mut labels: Vec<LineLabel> = vec![];
    for (level, segments) in levels.iter().zip(&lines) {
        labels.extend(place_label(&label(*level), segments, frame, &labels));
    }
    html! {
        @for segments in &lines {
            path.isolux d=(segments.iter().map(|segment| segment_path(segment, frame)).collect::<String>()) {}
        }
        @for LineLabel { words, at: [x, y] } in &labels { (text("isolabel", "middle", [*x, y + 3.5], words)) }
    }
}

/// A label on a contour, about its middle.
struct LineLabel {
    words: String,
    at: [f64; 2],
}

impl LineLabel {
    /// Half its width and height with its outline.
    fn half_size(&self) -> [f64; 2] {
        [3.3 * self.words.chars().count() as f64 + 3.0, 8.0]
    }

    fn overlaps(&self, other: &Self) -> bool {
        let (mine, others) = (self.half_size(), other.half_size());
        (0..2).all(|axis| (self.at[axis] - other.at[axis]).abs() < mine[axis] + others[axis])
    }
}

/// Places a label where its line comes nearest to the middle of the right half; `None` where every place is taken.
fn place_label(words: &str, segments: &[Segment], frame: &Frame, placed: &[LineLabel]) -> Option<LineLabel> {
    let wanted = [LEFT + 0.72 * frame.size[0], TOP + 0.5 * frame.size[1]];
    let mut places: Vec<[f64; 2]> = segments.iter().map(|segment| segment_middle(segment, frame)).collect();
    places.sort_by(|a, b| label_distance(*a, wanted).total_cmp(&label_distance(*b, wanted)));
    let labels = places.into_iter().map(|[x, y]| {
        let at = [x.clamp(LEFT + 12.0, LEFT + frame.size[0] - 12.0), y];
        LineLabel { words: words.to_owned(), at }
    });
    labels.into_iter().find(|label| !placed.iter().any(|other| label.overlaps(other)))
}

fn segment_path([a, b]: &Segment, frame: &Frame) -> String {
    let ([ax, ay], [bx, by]) = (frame.at(*a), frame.at(*b));
    format!("M{} {}L{} {}", number(ax), number(ay), number(bx), number(by))
}

fn segment_middle([a, b]: &Segment, frame: &Frame) -> [f64; 2] {
    frame.at([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])])
}

/// How far a place is from the wanted place of a label; height counts most, so that labels lie in one row.
fn label_distance(place: [f64; 2], wanted: [f64; 2]) -> f64 {
    0.2 * (place[0] - wanted[0]).abs() + (place[1] - wanted[1]).abs()
}

/// Draws the deviation of an engine at each meter.
fn deviation_map(title: &str, set: &[&Comparison], lattice: &Lattice, scales: &SharedScales, coarse: usize) -> Markup {
    let end = scales.tolerance.map_or("tolerance".to_owned(), |tolerance| label(100.0 * tolerance));
    let percents: Vec<f64> = set.iter().filter_map(|c| c.relative_deviation).map(|d| 100.0 * d).collect();
    let mean = percents.iter().sum::<f64>() / percents.len().max(1) as f64;
    let worst = largest(percents.iter().copied()).unwrap_or(0.0);
    let (lattice, set) = &lattice.blocks(set, coarse, worst_of_block);
    let frame = lattice.frame();
    let ends = [(0.0, format!("−{end}")), (0.5, "0".to_owned()), (1.0, format!("+{end}"))];
    let unit = if scales.tolerance.is_some() { " [%]" } else { "" };
    let drawing = html! {
        (cells(
            set,
            lattice,
            &frame,
            |k| set[k].normalized_error().map_or("none".to_owned(), colours::deviation),
            |k| off(set[k], percent).unwrap_or("no reading".to_owned()),
        ))
        (coordinates(lattice, &frame))
        (colour_bar(&frame, |t| colours::deviation(2.0 * t - 1.0), &ends, &format!("deviation{unit}; the ends are the tolerance")))
    };
    let caption = html! { "Mean " (percent(mean / 100.0)) ", worst " (percent(worst / 100.0)) "; " (scales.caption) "."
        @if coarse > 1 { " Each cell is the worst of " (coarse) " × " (coarse) " meters." }
    };
    figure(title, frame.panel_height(), &drawing, &caption)
}

/// The meter of a block with the largest deviation; one without a reading is worse than any.
fn worst_of_block<'a>(block: &[&'a Comparison]) -> Option<&'a Comparison> {
    block.iter().copied().max_by(|a, b| deviation_size(a).total_cmp(&deviation_size(b)))
}

fn deviation_size(c: &Comparison) -> f64 {
    c.relative_deviation.map_or(f64::INFINITY, f64::abs)
}

/// Draws a rectangle for each meter, with its words as a tooltip.
fn cells(
    set: &[&Comparison],
    lattice: &Lattice,
    frame: &Frame,
    colour: impl Fn(usize) -> String,
    words: impl Fn(usize) -> String,
) -> Markup {
    html! {
        g.cells { @for (k, c) in set.iter().enumerate() {
            @let [x, y] = frame.at([(k % lattice.counts[0]) as f64, (k / lattice.counts[0]) as f64]);
            @let [left, top] = [x - 0.5 * frame.cell[0], y - 0.5 * frame.cell[1]];
            rect x=(number(left)) y=(number(top)) width=(number(frame.cell[0] + 0.3)) height=(number(frame.cell[1] + 0.3)) fill=(colour(k)) {
                title { (c.meter) ": " (words(k)) }
            }
        } }
    }
}

/// Draws the coordinates along both axes.
fn coordinates(lattice: &Lattice, frame: &Frame) -> Markup {
    let bottom = frame.bottom();
    html! {
        @for (t, i) in lattice.axis_ticks(0) {
            @let [x, _] = frame.at([i, 0.0]);
            (line("tickline", [x, bottom], [x, bottom + 4.0])) (text("tick", "middle", [x, bottom + 16.0], &label(t)))
        }
        @for (t, j) in lattice.axis_ticks(1) {
            @let [_, y] = frame.at([0.0, j]);
            (line("tickline", [LEFT - 4.0, y], [LEFT, y])) (text("tick", "end", [LEFT - 7.0, y + 4.0], &label(t)))
        }
        (text("axis", "middle", [LEFT + 0.5 * frame.size[0], bottom + 31.0], &lattice.axes[0].1))
        text.axis text-anchor="middle" transform={ "translate(11 " (number(TOP + 0.5 * frame.size[1])) ") rotate(-90)" } { (lattice.axes[1].1) }
    }
}

/// Draws a colour bar with labels at places from 0 to 1.
fn colour_bar(frame: &Frame, colour: impl Fn(f64) -> String, labels: &[(f64, String)], name: &str) -> Markup {
    let (top, width) = (frame.size[1] + BAR_GAP, frame.size[0]);
    let cell = 1.0 / f64::from(BAR_CELLS);
    html! {
        g.cells { @for k in 0..BAR_CELLS {
            @let part = f64::from(k) / f64::from(BAR_CELLS);
            rect x=(number(LEFT + width * part)) y=(number(top)) width=(number(width / f64::from(BAR_CELLS) + 0.4)) height="8" fill=(colour(part + 0.5 * cell)) {}
        } }
        @for (at, words) in labels {
            @let anchor = if *at == 0.0 { "start" } else if *at == 1.0 { "end" } else { "middle" };
            (text("tick", anchor, [LEFT + width * at, top + 21.0], words))
        }
        (text("axis", "middle", [LEFT + 0.5 * width, top + 35.0], name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_close_contours_do_not_overlap_and_one_without_room_is_left_out() {
        let lattice = Lattice {
            counts: [3, 3],
            step_m: [1.0, 1.0],
            axes: [(0.0, "x [m]".to_owned()), (0.0, "y [m]".to_owned())],
        };
        let frame = lattice.frame();
        // Three lines at the same place, of which each has two segments.
        let segments: Vec<Segment> = vec![[[1.0, 0.0], [1.0, 0.5]], [[1.0, 1.5], [1.0, 2.0]]];
        let mut labels: Vec<LineLabel> = vec![];
        for level in ["300", "350", "400"] {
            labels.extend(place_label(level, &segments, &frame, &labels));
        }
        assert_eq!(labels.iter().map(|label| label.words.as_str()).collect_vec(), ["300", "350"]);
        assert!(!labels[0].overlaps(&labels[1]));
    }
}
