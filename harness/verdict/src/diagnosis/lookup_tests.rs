//! Wrong look-ups as programs have them, written without the diagnosis: each is named, whatever it does at its edges.

use std::f64::consts::PI;

use glam::DVec3;
use itertools::Itertools;
use luxproof_engines::fixtures;
use luxproof_photometry::LuminousIntensityDistribution as Table;
use luxproof_scene::{Luminaire, Meter, Transport, orientation};
use luxproof_spec::procedures::{Target, known};

use super::tests::causes;
use super::*;
use luxproof_model::MeterId;

/// The candela at C and gamma, as a program finds them.
type LookUp = fn(&Table, f64, f64) -> f64;

/// The index below an angle and the part of the way to the next.
fn locate(angles: &[f64], at: f64) -> Option<(usize, f64)> {
    let last = angles.len() - 1;
    let k = angles.partition_point(|a| *a <= at).clamp(1, last) - 1;
    (angles[0]..=angles[last]).contains(&at).then(|| (k, (at - angles[k]) / (angles[k + 1] - angles[k])))
}

fn weighted(table: &Table, c: f64, gamma: f64, part: fn(f64) -> f64) -> f64 {
    let (Some((i, u)), Some((j, v))) = (locate(table.c_deg(), c), locate(table.gamma_deg(), gamma)) else { return 0.0 };
    let (u, v) = (part(u), part(v));
    let [here, next] = [i, i + 1].map(|i| (1.0 - v) * table.plane(i)[j] + v * table.plane(i)[j + 1]);
    (1.0 - u) * here + u * next
}

fn linear(table: &Table, c: f64, gamma: f64) -> f64 {
    weighted(table, c, gamma, |part| part)
}

/// Half an index more along gamma, at most the last.
fn half_an_index_on(table: &Table, c: f64, gamma: f64) -> f64 {
    let angles = table.gamma_deg();
    let last = angles.len() - 1;
    let index = locate(angles, gamma).map_or(0.0, |(k, part)| (k as f64 + part + 0.5).min(last as f64));
    let k = (index as usize).min(last - 1);
    linear(table, c, angles[k] + (index - k as f64) * (angles[k + 1] - angles[k]))
}

/// Catmull and Rom's cubic along gamma; the first and the last value repeat.
fn cubic(table: &Table, c: f64, gamma: f64) -> f64 {
    let (Some((i, u)), Some((j, v))) = (locate(table.c_deg(), c), locate(table.gamma_deg(), gamma)) else { return 0.0 };
    let [here, next] = [i, i + 1].map(|i| {
        let row = table.plane(i);
        let [a, b, c, d] = [row[j.saturating_sub(1)], row[j], row[j + 1], row[(j + 2).min(row.len() - 1)]];
        let bent = 3.0 * (b - c) + d - a;
        (b + 0.5 * v * (c - a + v * (2.0 * a - 5.0 * b + 4.0 * c - d + v * bent))).max(0.0)
    });
    (1.0 - u) * here + u * next
}

/// The mean of all listed planes.
fn mean_of_planes(table: &Table, _: f64, gamma: f64) -> f64 {
    let planes = table.c_deg();
    planes.iter().map(|c| linear(table, *c, gamma)).sum::<f64>() / planes.len() as f64
}

/// Two luminaires of different tables, of which one is dimmed, over meters that see both.
fn tasks() -> Vec<Task> {
    let mut dimmed = fixtures::luminaire("dimmed", DVec3::new(4.0, 3.0, 2.5), fixtures::quadrant());
    (dimmed.orientation, dimmed.flux_scale) = (orientation(25.0, 15.0, 0.0), 0.7);
    let other = fixtures::luminaire("other", DVec3::new(1.0, 1.5, 2.7), fixtures::lopsided());
    let mut job = fixtures::s1(Transport::Direct);
    job.scene.luminaires = vec![dimmed, other];
    let mut targets = vec![];
    for k in 0..12 {
        let position_m = DVec3::new(0.4 + 0.5 * f64::from(k), 0.7 + f64::from(7 * k % 5), 0.3 + 0.05 * f64::from(k));
        targets.push(Target::of_one(MeterId::new("m", k as usize), Meter { position_m, normal: DVec3::Z }, 1.0));
    }
    let task = Task {
        procedure: job.procedure,
        scene: job.scene,
        transport: Transport::Direct,
        quantity: luxproof_model::Quantity::Illuminance,
        targets,
    };
    let free_field = known::tasks().into_iter().filter(|t| t.transport == Transport::Direct);
    std::iter::once(task).chain(free_field.filter(|t| t.scene.obstacles.is_empty())).collect()
}

/// Reads by a look-up, and each table times a factor.
fn read(model: &Model, look_up: LookUp, factor: fn(&Table) -> f64) -> Vec<f64> {
    let mut read = vec![];
    for target in &model.task.targets {
        let mut sum = 0.0;
        for (aspect, l) in target.aspects.iter().cartesian_product(&model.task.scene.luminaires) {
            sum += aspect.weight * illuminance(l, &aspect.meter, look_up, factor);
        }
        read.push(sum);
    }
    read
}

/// The illuminance by a look-up in the table of the full circle, which is dimmed already, as adapters get it.
fn illuminance(l: &Luminaire, meter: &Meter, look_up: LookUp, factor: fn(&Table) -> f64) -> f64 {
    let table = l.photometry.distribution.full_circle().scaled(l.flux_scale);
    let offset = meter.position_m - l.position_m;
    let ray = l.orientation.transpose() * offset;
    let c = ray.y.atan2(ray.x).to_degrees().rem_euclid(360.0);
    let gamma = ray.x.hypot(ray.y).atan2(-ray.z).to_degrees();
    let cosine = (-offset.dot(meter.normal) / offset.length()).max(0.0);
    factor(&table) * look_up(&table, c, gamma) * cosine / offset.length_squared()
}

#[track_caller]
fn assert_named(look_up: LookUp, factor: fn(&Table) -> f64, words: &str) {
    let named = causes(&tasks(), &|model| read(model, look_up, factor));
    assert!(named.len() == 1 && named[0].what.contains(words), "{words}: {named:?}");
}

fn one(_: &Table) -> f64 {
    1.0
}

#[test]
fn the_reader_of_these_tests_is_right() {
    assert_eq!(causes(&tasks(), &|model| read(model, linear, one)), []);
}

/// A program with reflections that takes the nearest angles, by the simulator with a table of steps.
#[test]
fn a_table_without_interpolation_is_named_where_reflected_light_shows_it_too() {
    let tasks = known::tasks().into_iter().filter(|t| t.scene.obstacles.is_empty()).collect_vec();
    let found = causes(&tasks, &|m| {
        if m.task.transport == Transport::Direct {
            return read(m, |t, c, g| weighted(t, c, g, |part| if part < 0.5 { 0.0 } else { 1.0 }), one);
        }
        let mut task = m.task.clone();
        task.scene.luminaires.iter_mut().for_each(take_nearest);
        truth(&task).unwrap()
    });
    assert!(!found.is_empty() && found.iter().all(|c| c.what.contains("the nearest angle counts")), "{found:?}");
}

/// Angles with two more around the middle of each interval.
fn with_steps(angles: &[f64]) -> Vec<f64> {
    let middles = angles.windows(2).map(|pair| f64::midpoint(pair[0], pair[1]));
    let steps = middles.flat_map(|middle| [middle - 5e-4, middle + 5e-4]);
    angles.iter().copied().chain(steps).sorted_by(f64::total_cmp).collect()
}

/// Steps midway between the angles of a table, each side of a step a thousandth of a degree wide.
fn take_nearest(luminaire: &mut Luminaire) {
    let table = luminaire.photometry.distribution.full_circle();
    let (c_deg, gamma_deg) = (with_steps(table.c_deg()), with_steps(table.gamma_deg()));
    let nodes = c_deg.iter().cartesian_product(&gamma_deg);
    let candela = nodes.map(|(c, g)| weighted(&table, *c, *g, f64::round)).collect();
    let stepped = Table::new(c_deg, gamma_deg, candela).unwrap();
    luminaire.photometry = std::sync::Arc::new(luminaire.photometry.with_distribution(stepped));
}

#[test]
fn tables_without_interpolation_are_named_whichever_way_they_round() {
    let (nearest, lower) = ("in C and gamma: the nearest angle counts", "in C and gamma: the next lower angle counts");
    assert_named(|t, c, g| weighted(t, c, g, |part| if part <= 0.5 { 0.0 } else { 1.0 }), one, nearest);
    assert_named(|t, c, g| weighted(t, c, g, f64::round), one, nearest);
    // At the last angle of a table it takes the one before.
    assert_named(|t, c, g| weighted(t, c, g, |_| 0.0), one, lower);
}

#[test]
fn a_wrong_gamma_is_named_whatever_happens_beyond_the_table() {
    let scaled = "gamma is looked up 1.0800";
    assert_named(|t, c, g| linear(t, c, 1.08 * g), one, scaled);
    assert_named(|t, c, g| linear(t, c, (1.08 * g).min(180.0)), one, scaled);
    assert_named(|t, c, g| linear(t, c, (1.08 * g).min(t.gamma_deg()[t.gamma_deg().len() - 1])), one, scaled);
    assert_named(|t, c, g| linear(t, c, (g - 4.0).max(0.0)), one, "gamma is off by 4.0000");
    assert_named(|t, c, g| linear(t, c, g + 4.0), one, "gamma is off by -4.0000");
    assert_named(half_an_index_on, one, "gamma is off by half a step");
}

#[test]
fn other_curves_and_means_of_planes_are_named() {
    assert_named(cubic, one, "in gamma a cubic");
    assert_named(mean_of_planes, one, "the mean of the table's planes, each counted once");
}

#[test]
fn a_cosine_at_the_luminaire_is_named_where_it_is_dark_behind_too() {
    assert_named(|t, c, g| linear(t, c, g) * g.to_radians().cos().abs(), one, "cosine at the luminaire is applied");
    let words = "multiplied by the cosine of gamma to the power of 1.0000";
    assert_named(|t, c, g| linear(t, c, g) * g.to_radians().cos().max(0.0), one, words);
}

#[test]
fn a_normalised_table_is_named_with_any_number_and_where_dimming_is_lost() {
    assert_named(linear, |t| 100.0 / t.max_intensity().value(), "divided by its peak, and all by factor 100");
    assert_named(linear, |t| 1.0 / t.flux().value(), "divided by its flux");
    assert_named(linear, |t| t.flux().value() / (PI * t.max_intensity().value()), "scaled by flux/(pi peak)");
}
