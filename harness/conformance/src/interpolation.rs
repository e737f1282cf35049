//! What named interpolations answer between the nodes of a type C table.

use luxproof_photometry::Goniometer;

use crate::mistake::Variant;
use crate::model_reader::{Bracket, bracket};
use crate::pack_file::{PackFile, Place};
use crate::table::Table;

/// The interpolations with a name.
pub(crate) const METHODS: [Variant; 5] =
    [Variant::Linear, Variant::LinearInCosine, Variant::Cubic, Variant::Smoothstep, Variant::Nearest];

/// The intensities in candela in the directions between nodes; `None` on nodes.
pub(crate) fn answers_between(file: &PackFile, method: Variant) -> Vec<Option<f64>> {
    let is_whole = file.table.goniometer == Goniometer::C;
    let factor = file.factor();
    let mut answers = vec![];
    for asked in &file.directions {
        let is_between = is_whole && asked.place == Place::Between;
        answers.push(is_between.then(|| interpolate(&file.table, method, asked.c_deg, asked.gamma_deg) * factor));
    }
    answers
}

/// The number of a table over the whole circle at an angle between its nodes.
fn interpolate(table: &Table, method: Variant, c_deg: f64, gamma_deg: f64) -> f64 {
    let c = bracket(&table.horizontal_deg, c_deg);
    let gamma = bracket(&table.vertical_deg, gamma_deg);
    let verticals = table.vertical_deg.len();
    // The last plane is the first again.
    let planes = table.horizontal_deg.len() - 1;
    let along_gamma = |plane: isize| {
        let plane = plane.rem_euclid(planes as isize) as usize;
        let row = &table.numbers[plane * verticals..][..verticals];
        let node = |k: isize| row[k.clamp(0, verticals as isize - 1) as usize];
        weigh(method, with_cosine(method, table, gamma, gamma_deg), node)
    };
    weigh(method, c, along_gamma)
}

/// The place along gamma, by cosines where the method says so.
fn with_cosine(method: Variant, table: &Table, place: Bracket, gamma_deg: f64) -> Bracket {
    if method != Variant::LinearInCosine || place.below == place.above {
        return place;
    }
    let [below, above] = [place.below, place.above].map(|k| table.vertical_deg[k].to_radians().cos());
    Bracket { fraction: (gamma_deg.to_radians().cos() - below) / (above - below), ..place }
}

/// The value at a place between nodes.
fn weigh(method: Variant, place: Bracket, node: impl Fn(isize) -> f64) -> f64 {
    let (below, t) = (place.below as isize, place.fraction);
    let [a, b] = [node(below), node(place.above as isize)];
    if place.below == place.above {
        return a;
    }
    match method {
        Variant::Nearest => {
            if t < 0.5 {
                a
            } else {
                b
            }
        }
        Variant::Smoothstep => a + t * t * (3.0 - 2.0 * t) * (b - a),
        Variant::Cubic => {
            let [before, after] = [node(below - 1), node(below + 2)];
            let slope = 0.5 * (b - before);
            let curve = before - 2.5 * a + 2.0 * b - 0.5 * after;
            let twist = 0.5 * (after - before) + 1.5 * (a - b);
            a + t * (slope + t * (curve + t * twist))
        }
        _ => a + t * (b - a),
    }
}
