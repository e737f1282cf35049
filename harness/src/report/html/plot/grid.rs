//! Grids of meters: isolux lines over false colours of the reference, and a map of every engine's deviation.

use std::collections::BTreeSet;

use itertools::Itertools;
use maud::{Markup, html};

use super::super::palette::Palette;
use super::super::percent;
use super::axis::ticks;
use super::contour::contour;
use super::{Group, Marks, WIDTH, colours, figure};
use crate::judge::{Basis, Comparison};
use crate::report::Report;
use crate::report::svg::{label, line, number, text};
use crate::report::words::{largest, off, round_step, rounded, significant as six_digits};

const LEFT: f64 = 44.0;
const RIGHT: f64 = 10.0;
/// Colour bar and its labels below the map.
const BAR: f64 = 52.0;
/// Fewer meters to a side than this are no map.
const LEAST: usize = 3;
/// More cells than this are finer than what a page shows.
const MOST_CELLS: u32 = 4096;

pub(super) fn panels(report: &Report, group: &Group<'_>, palette: &Palette, marks: Marks) -> Vec<Markup> {
    let Some(basis) = group.basis() else { return vec![] };
    let firm: Vec<&Comparison> =
        group.comparisons.iter().copied().filter(|c| c.gamma_deg.is_none() && c.basis() == Some(basis)).collect();
    let mut panels = vec![];
    for name in firm.iter().map(|c| set(c)).collect::<BTreeSet<&str>>() {
        let engines = group.engines(palette);
        let of_set = |engine: &str| of_set(&firm, name, engine);
        let Some((first, lattice)) = engines.iter().find_map(|e| Some((of_set(e), Lattice::of(&of_set(e))?))) else {
            continue;
        };
        let alike = Alike::of(report, group, basis, name);
        let title = group.title(report, &format!("{name}, reference ({})", basis.name()));
        let coarse = if marks == Marks::Seen { lattice.coarseness() } else { 1 };
        panels.push(isolux(&title, &first, &lattice, &alike, coarse));
        let maps: Vec<(&str, Vec<&Comparison>)> =
            engines.iter().map(|e| (*e, of_set(e))).filter(|(_, m)| m.len() == first.len()).collect();
        for (engine, mine) in &maps {
            panels.push(map(&group.title(report, &format!("{name}, {engine}")), mine, &lattice, &alike, coarse));
        }
    }
    panels
}

/// The comparisons of one engine at a set, in the order of its meters.
fn of_set<'a>(firm: &[&'a Comparison], name: &str, engine: &str) -> Vec<&'a Comparison> {
    let mine = firm.iter().copied().filter(|c| set(c) == name && c.key.engine == engine);
    mine.sorted_by_key(|c| index(c)).collect_vec()
}

/// What the references of two cases are at one set, on one colour scale; nothing where that is no grid in both, or they are of two kinds.
pub(in super::super) fn side_by_side(
    cases: &[Group<'_>; 2],
    (basis, name): (Basis, &str),
    palette: &Palette,
    marks: Marks,
) -> Vec<Markup> {
    let maps = cases.iter().map(|group| of_reference(group, basis, name, palette));
    let maps: Vec<(Vec<&Comparison>, Lattice)> = maps.collect::<Option<_>>().unwrap_or_default();
    let lit = maps.iter().flat_map(|(mine, _)| mine).filter_map(|c| Some(c.reference.as_ref()?.value));
    let (low, high) = lit.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    let alike = Alike { low, high, most: 0.0, whose: "one scale for both cases" };
    let draw = |(group, (mine, lattice)): (&Group<'_>, &(Vec<&Comparison>, Lattice))| {
        let coarse = if marks == Marks::Seen { lattice.coarseness() } else { 1 };
        let title = format!("{}: {name}, reference ({})", group.case, basis.name());
        isolux(&title, mine, lattice, &alike, coarse)
    };
    cases.iter().zip(&maps).map(draw).collect()
}

/// A grid with its references, by whichever engine was held against all of them.
fn of_reference<'a>(
    group: &Group<'a>,
    basis: Basis,
    name: &str,
    palette: &Palette,
) -> Option<(Vec<&'a Comparison>, Lattice)> {
    let is_firm = |c: &&Comparison| c.gamma_deg.is_none() && c.basis() == Some(basis);
    let firm = group.comparisons.iter().copied().filter(is_firm).collect_vec();
    let of_engine = |engine: &&str| {
        let mine = of_set(&firm, name, engine);
        Lattice::of(&mine).map(|lattice| (mine, lattice))
    };
    group.engines(palette).iter().find_map(of_engine)
}

/// The scales that maps of one set have in common: of all engines, and of all cases of one spec, which are there to be compared.
struct Alike {
    low: f64,
    high: f64,
    /// Either way, in per cent.
    most: f64,
    whose: &'static str,
}

impl Alike {
    fn of(report: &Report, group: &Group<'_>, basis: Basis, name: &str) -> Self {
        let is_alike = |c: &&Comparison| {
            let is_of_spec = c.key.procedure == group.procedure && spec(&c.key.case) == spec(group.case);
            is_of_spec && c.basis() == Some(basis) && c.gamma_deg.is_none() && set(c) == name
        };
        let all = report.comparisons.iter().filter(is_alike).collect_vec();
        let lit = all.iter().filter_map(|c| Some(c.reference.as_ref()?.value));
        let (low, high) = lit.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        let most = all.iter().filter_map(|c| c.relative_deviation).map(|d| 100.0 * d.abs()).fold(0.0, f64::max);
        let has_cases = all.iter().any(|c| c.key.case != group.case);
        let whose =
            if has_cases { "one scale for all engines and all cases of the spec" } else { "one scale for all engines" };
        Self { low, high, most: round_step(most.clamp(1e-4, 100.0)), whose }
    }
}

/// The spec that a case is of.
fn spec(case: &str) -> Option<&str> {
    case.split('/').next()
}

fn set(c: &Comparison) -> &str {
    c.meter.0.rsplit_once('[').map_or(c.meter.0.as_str(), |(set, _)| set)
}

fn index(c: &Comparison) -> usize {
    c.meter.0.rsplit_once('[').and_then(|(_, k)| k.trim_end_matches(']').parse().ok()).unwrap_or(usize::MAX)
}

/// A regular grid of meters, read off their places: origin + i u + j v, i fastest.
struct Lattice {
    counts: [usize; 2],
    step_m: [f64; 2],
    /// First coordinate along each axis, and the axis' name.
    axes: [(f64, String); 2],
}

impl Lattice {
    fn of(mine: &[&Comparison]) -> Option<Self> {
        let at = |k: usize| glam::DVec3::from_array(mine[k].at_m);
        if mine.len() < LEAST * LEAST {
            return None;
        }
        let u = at(1) - at(0);
        let is_step = |k: &usize| (at(*k) - at(*k - 1) - u).length() <= 1e-6 * u.length();
        let along_u = 1 + (1..mine.len()).take_while(is_step).count();
        let along_v = mine.len() / along_u;
        if along_u < LEAST || along_v < LEAST || along_u * along_v != mine.len() || u.length() == 0.0 {
            return None;
        }
        let v = at(along_u) - at(0);
        let expected = |k: usize| at(0) + u * (k % along_u) as f64 + v * (k / along_u) as f64;
        let regular = (0..mine.len()).all(|k| (at(k) - expected(k)).length() <= 1e-6 * (u.length() + v.length()));
        (regular && v.length() > 0.0).then(|| Self {
            counts: [along_u, along_v],
            step_m: [u.length(), v.length()],
            axes: [(u, "u"), (v, "v")].map(|(step, name)| axis(at(0), step, name)),
        })
    }

    /// How many meters to a side a cell stands for, so that cells are not too many.
    fn coarseness(&self) -> usize {
        let cells_of_one = (self.counts[0] * self.counts[1]) as f64 / f64::from(MOST_CELLS);
        cells_of_one.sqrt().ceil().max(1.0) as usize
    }

    /// The lattice of blocks of so many meters to a side, and the meter of each that is picked.
    fn blocks<'a>(
        &self,
        mine: &[&'a Comparison],
        side: usize,
        pick: impl Fn(&[&'a Comparison]) -> Option<&'a Comparison>,
    ) -> (Self, Vec<&'a Comparison>) {
        let counts = self.counts.map(|count| count.div_ceil(side));
        let block = |k: usize| {
            let [from_u, from_v] = [side * (k % counts[0]), side * (k / counts[0])];
            let row = |v: usize| {
                let to_u = (from_u + side).min(self.counts[0]);
                mine[v * self.counts[0] + from_u..v * self.counts[0] + to_u].iter().copied()
            };
            pick(&(from_v..(from_v + side).min(self.counts[1])).flat_map(row).collect_vec())
        };
        let picked = (0..counts[0] * counts[1]).filter_map(block).collect();
        let middle = 0.5 * (side - 1) as f64;
        let axes = [0, 1].map(|k| (self.axes[k].0 + middle * self.step_m[k], self.axes[k].1.clone()));
        (Self { counts, step_m: self.step_m.map(|step| step * side as f64), axes }, picked)
    }

    fn frame(&self) -> Frame {
        let cells = [0, 1].map(|k| self.counts[k] as f64 * self.step_m[k]);
        let scale = ((WIDTH - LEFT - RIGHT) / cells[0]).min(300.0 / cells[1]);
        Frame { cell: [self.step_m[0] * scale, self.step_m[1] * scale], size: [cells[0] * scale, cells[1] * scale] }
    }
}

/// A step along a coordinate axis has that coordinate; any other its own length.
fn axis(origin: glam::DVec3, step: glam::DVec3, name: &str) -> (f64, String) {
    let names = ["x", "y", "z"];
    let along = (0..3).find(|&k| step[k] > 0.0 && (step[k] - step.length()).abs() < 1e-9 * step.length());
    along.map_or_else(|| (0.0, format!("along {name} [m]")), |k| (origin[k], format!("{} [m]", names[k])))
}

struct Frame {
    cell: [f64; 2],
    size: [f64; 2],
}

impl Frame {
    /// Middle of a cell at fractional indices; v points up.
    fn at(&self, i: f64, j: f64) -> [f64; 2] {
        [LEFT + (i + 0.5) * self.cell[0], 6.0 + self.size[1] - (j + 0.5) * self.cell[1]]
    }
}

fn isolux(title: &str, mine: &[&Comparison], lattice: &Lattice, alike: &Alike, coarse: usize) -> Markup {
    let (lattice, mine) = &lattice.blocks(mine, coarse, |block| block.get(block.len() / 2).copied());
    let values: Vec<f64> = mine.iter().map(|c| c.reference.as_ref().map_or(f64::NAN, |r| r.value)).collect();
    let Alike { low, high, .. } = *alike;
    let frame = lattice.frame();
    let part = |v: f64| if high > low { (v - low) / (high - low) } else { 0.5 };
    let levels: Vec<f64> = ticks(low, high, 6).into_iter().filter(|l| *l > low && *l < high).collect();
    let unit = mine[0].quantity.unit();
    // Three significant digits are enough for the end of a colour bar.
    let end = |value: f64| label(rounded(value, 3).unwrap_or(value));
    let drawing = html! {
        (cells(mine, lattice, &frame, |k| colours::amount(part(values[k])), |k| format!("{} {unit}", six_digits(values[k]))))
        @for level in &levels { (isoline(&values, lattice, &frame, *level)) }
        (coordinates(lattice, &frame))
        (colour_bar(&frame, colours::amount, &[(0.0, end(low)), (1.0, end(high))], &format!("illuminance [{unit}]")))
    };
    let caption = html! { "Cells: the reference at each meter; lines: isolux, in " (unit) "."
        @if coarse > 1 { " One of " (coarse) " × " (coarse) " meters is drawn." }
    };
    figure(title, frame.size[1] + 46.0 + BAR, &drawing, &caption)
}

fn isoline(values: &[f64], lattice: &Lattice, frame: &Frame, level: f64) -> Markup {
    let segments = contour(values, lattice.counts, level);
    let place = |p: [f64; 2]| frame.at(p[0], p[1]);
    let stretch = |[a, b]: &[[f64; 2]; 2]| {
        let (a, b) = (place(*a), place(*b));
        format!("M{} {}L{} {}", number(a[0]), number(a[1]), number(b[0]), number(b[1]))
    };
    let path = segments.iter().map(stretch).join("");
    // Its label: where the line comes nearest to the middle of the right half.
    let wanted = [LEFT + 0.72 * frame.size[0], 6.0 + 0.5 * frame.size[1]];
    let middle = |[a, b]: &[[f64; 2]; 2]| place([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
    let distance = |p: [f64; 2]| 0.2 * (p[0] - wanted[0]).abs() + (p[1] - wanted[1]).abs();
    let at = segments.iter().map(middle).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    html! {
        path.isolux d=(path) {}
        @if let Some([x, y]) = at { (text("isolabel", "middle", [x.clamp(LEFT + 12.0, LEFT + frame.size[0] - 12.0), y + 3.5], &label(level))) }
    }
}

fn map(title: &str, mine: &[&Comparison], lattice: &Lattice, alike: &Alike, coarse: usize) -> Markup {
    let most = alike.most;
    let inside: Vec<f64> = mine.iter().filter_map(|c| c.relative_deviation).map(|d| 100.0 * d).collect();
    let amount = |c: &Comparison| c.relative_deviation.map_or(f64::INFINITY, f64::abs);
    let (lattice, mine) =
        &lattice.blocks(mine, coarse, |block| block.iter().copied().max_by(|a, b| amount(a).total_cmp(&amount(b))));
    let frame = lattice.frame();
    let in_percent = |k: usize| mine[k].relative_deviation.map(|d| 100.0 * d);
    let colour = |k: usize| in_percent(k).map_or("none".to_owned(), |p| colours::deviation(p / most));
    let words = |k: usize| off(mine[k], percent).unwrap_or("no reading".to_owned());
    let mean = inside.iter().sum::<f64>() / inside.len().max(1) as f64;
    let worst = largest(inside.iter().copied()).unwrap_or(0.0);
    let ends = [(0.0, format!("−{}", label(most))), (0.5, "0".to_owned()), (1.0, format!("+{}", label(most)))];
    let drawing = html! {
        (cells(mine, lattice, &frame, colour, words))
        (coordinates(lattice, &frame))
        (colour_bar(&frame, |t| colours::deviation(2.0 * t - 1.0), &ends, "deviation from the reference [%]"))
    };
    let caption = html! { "Mean " (percent(mean / 100.0)) ", worst " (percent(worst / 100.0)) "; " (alike.whose) "."
        @if coarse > 1 { " Each cell is the worst of " (coarse) " × " (coarse) " meters." }
    };
    figure(title, frame.size[1] + 46.0 + BAR, &drawing, &caption)
}

fn cells(
    mine: &[&Comparison],
    lattice: &Lattice,
    frame: &Frame,
    colour: impl Fn(usize) -> String,
    words: impl Fn(usize) -> String,
) -> Markup {
    let corner = |k: usize| {
        let [x, y] = frame.at((k % lattice.counts[0]) as f64, (k / lattice.counts[0]) as f64);
        [x - 0.5 * frame.cell[0], y - 0.5 * frame.cell[1]]
    };
    html! {
        g.cells { @for k in 0..mine.len() {
            @let [x, y] = corner(k);
            rect x=(number(x)) y=(number(y)) width=(number(frame.cell[0] + 0.3)) height=(number(frame.cell[1] + 0.3)) fill=(colour(k)) {
                title { (mine[k].meter) ": " (words(k)) }
            }
        } }
    }
}

fn coordinates(lattice: &Lattice, frame: &Frame) -> Markup {
    let along = |k: usize| {
        let (first, step) = (lattice.axes[k].0, lattice.step_m[k]);
        let last = first + step * (lattice.counts[k] - 1) as f64;
        ticks(first, last, 5).into_iter().map(move |t| (t, (t - first) / step))
    };
    let bottom = 6.0 + frame.size[1];
    html! {
        @for (t, i) in along(0) {
            @let [x, _] = frame.at(i, 0.0);
            (line("tickline", [x, bottom], [x, bottom + 4.0])) (text("tick", "middle", [x, bottom + 16.0], &label(t)))
        }
        @for (t, j) in along(1) {
            @let [_, y] = frame.at(0.0, j);
            (line("tickline", [LEFT - 4.0, y], [LEFT, y])) (text("tick", "end", [LEFT - 7.0, y + 4.0], &label(t)))
        }
        (text("axis", "middle", [LEFT + 0.5 * frame.size[0], bottom + 31.0], &lattice.axes[0].1))
        text.axis text-anchor="middle" transform={ "translate(11 " (number(6.0 + 0.5 * frame.size[1])) ") rotate(-90)" } { (lattice.axes[1].1) }
    }
}

fn colour_bar(frame: &Frame, colour: impl Fn(f64) -> String, ends: &[(f64, String)], name: &str) -> Markup {
    let (top, width) = (frame.size[1] + 46.0, frame.size[0]);
    let part = |k: u32| f64::from(k) / 40.0;
    html! {
        g.cells { @for k in 0..40 { rect x=(number(LEFT + width * part(k))) y=(number(top)) width=(number(width / 40.0 + 0.4)) height="8" fill=(colour(part(k) + 0.0125)) {} } }
        @for (at, words) in ends {
            (text("tick", if *at == 0.0 { "start" } else if *at == 1.0 { "end" } else { "middle" }, [LEFT + width * at, top + 21.0], words))
        }
        (text("axis", "middle", [LEFT + 0.5 * width, top + 35.0], name))
    }
}
