//! Random and minimal tables of luminous intensity, including goniometer types A and B.

use std::collections::BTreeSet;

use itertools::Itertools;
use luxproof_photometry::{Goniometer, LuminousIntensityDistribution};

use super::feature::Feature;
use crate::draw::Draw;

/// Rounds a number to significant digits, as a file contains it.
pub(super) fn round_to_digits(x: f64, digits: i32) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    let written = format!("{x:.*e}", (digits - 1).max(0) as usize);
    written.parse().unwrap_or(x)
}

/// Draws a feature: one time in `one_in`, unless the round leaves it out.
fn draw_feature(draw: &mut Draw, allowed: &BTreeSet<Feature>, feature: Feature, one_in: usize) -> bool {
    allowed.contains(&feature) && draw.one_in(one_in)
}

/// The form of a random table: how luminous intensity depends on direction.
struct TableForm {
    number: usize,
    is_narrow: bool,
    peak_cd: f64,
    /// The exponent of the cosine.
    power: i32,
    /// How much the C planes differ.
    lean: f64,
}

impl TableForm {
    /// Draws a form. The order of the draws decides all specs of a seed, so it must not change.
    fn draw(draw: &mut Draw, allowed: &BTreeSet<Feature>) -> Self {
        let peak_cd = if draw_feature(draw, allowed, Feature::BrightTable, 6) {
            draw.magnitude(1e5, 1e8)
        } else if draw_feature(draw, allowed, Feature::FaintTable, 6) {
            draw.magnitude(1e-6, 0.5)
        } else {
            draw.magnitude(20.0, 5000.0)
        };
        let number = draw.0.usize(0..5);
        let is_narrow = draw_feature(draw, allowed, Feature::NarrowBeam, 4);
        let power = if is_narrow { 200 } else { draw.0.i32(1..6) };
        Self { number, is_narrow, peak_cd, power, lean: draw.within(0.1, 0.6) }
    }

    /// The luminous intensity in a direction; one form draws it.
    fn intensity_cd(&self, draw: &mut Draw, c_deg: f64, gamma_deg: f64) -> f64 {
        let Self { number, is_narrow, peak_cd: peak, power, lean } = *self;
        let (sin, cos) = gamma_deg.to_radians().sin_cos();
        match number {
            _ if is_narrow => peak * cos.max(0.0).powi(power) + peak * 1e-3,
            0 => peak * cos.max(0.0).powi(power),
            1 => peak,
            2 => peak * (0.2 + sin * sin) * (1.0 + lean * c_deg.to_radians().cos()),
            3 => peak * (0.3 + 0.7 * (cos + 1.0) / 2.0) * (1.0 + lean * (2.0 * c_deg.to_radians()).cos()),
            // Independent values show errors of interpolation that a smooth table hides.
            _ => peak * draw.within(0.05, 1.0),
        }
    }
}

/// Draws a table of any symmetry from the allowed features.
pub(super) fn draw_distribution(draw: &mut Draw, allowed: &BTreeSet<Feature>) -> LuminousIntensityDistribution {
    let gamma_deg = draw_gammas(draw, allowed);
    let c_deg = draw_planes(draw, allowed);
    let form = TableForm::draw(draw, allowed);
    let (gammas, count) = (gamma_deg.len(), gamma_deg.len() * c_deg.len());
    let mut candela: Vec<f64> = Vec::with_capacity(count);
    for &c in &c_deg {
        for &gamma in &gamma_deg {
            let intensity_cd = form.intensity_cd(draw, c, gamma);
            // The cosine of 90 degrees is not exactly zero; no goniometer measures the remainder.
            candela.push(if intensity_cd > 1e-12 * form.peak_cd { round_to_digits(intensity_cd, 4) } else { 0.0 });
        }
    }
    if c_deg.len() > 2 && draw_feature(draw, allowed, Feature::OddValue, 3) {
        // All planes are the same, except for one value of an inner plane.
        for c in 1..c_deg.len() {
            let (first, rest) = candela.split_at_mut(gammas);
            rest[(c - 1) * gammas..c * gammas].copy_from_slice(first);
        }
        let inner: Vec<usize> = (0..gammas).filter(|g| !is_pole(gamma_deg[*g])).collect();
        if !inner.is_empty() {
            let at = draw.0.usize(1..c_deg.len() - 1) * gammas + draw.one_of(&inner);
            candela[at] = round_to_digits(3.0 * candela[at] + form.peak_cd, 4);
        }
    }
    if draw_feature(draw, allowed, Feature::DarkPart, 4) {
        let from = draw.0.usize(0..gammas);
        (0..count).filter(|k| k % gammas >= from && from > 0).for_each(|k| candela[k] = 0.0);
    }
    // Nadir and zenith are one direction each, so that all planes must agree there.
    for k in (0..count).filter(|k| is_pole(gamma_deg[k % gammas])) {
        candela[k] = candela[k % gammas];
    }
    if c_deg.last() == Some(&360.0) {
        let (first, last) = (0, (c_deg.len() - 1) * gammas);
        candela.copy_within(first..gammas, last);
    }
    LuminousIntensityDistribution::new(c_deg, gamma_deg, candela)
        .unwrap_or_else(|e| unreachable!("tables made here are sound: {e}"))
}

/// Whether all C planes meet at a gamma angle.
fn is_pole(gamma_deg: f64) -> bool {
    gamma_deg == 0.0 || gamma_deg == 180.0
}

/// Whether a table has one value for each direction: all planes agree at nadir and zenith.
pub(super) fn is_single_valued(table: &LuminousIntensityDistribution) -> bool {
    let mut poles = (0..table.gamma_deg().len()).filter(|g| is_pole(table.gamma_deg()[*g]));
    poles.all(|g| (0..table.c_deg().len()).all(|c| table.plane(c)[g] == table.plane(0)[g]))
}

/// Draws the gamma angles of a table.
fn draw_gammas(draw: &mut Draw, allowed: &BTreeSet<Feature>) -> Vec<f64> {
    let end = if draw_feature(draw, allowed, Feature::EndsAt90, 2) { 90.0 } else { 180.0 };
    let start =
        if draw_feature(draw, allowed, Feature::StartsLate, 6) { draw.one_of(&[90.0, 10.0, 30.0]) } else { 0.0 };
    let end = if start == 90.0 { 180.0 } else { end };
    if draw_feature(draw, allowed, Feature::FewGammas, 3) {
        let middle = 0.5 * (start + end);
        return if draw.one_in(2) { vec![start, end] } else { vec![start, middle, end] };
    }
    let step =
        if draw_feature(draw, allowed, Feature::FineTable, 6) { 1.0 } else { draw.one_of(&[5.0, 10.0, 15.0, 30.0]) };
    let count = ((end - start) / step) as usize;
    let even: Vec<f64> = (0..=count).map(|k| (start + k as f64 * step).min(end)).collect();
    if draw_feature(draw, allowed, Feature::UnevenAngles, 4) && even.len() > 3 {
        // The two ends stay: they give the table its range.
        return even
            .into_iter()
            .enumerate()
            .filter(|(k, _)| *k == 0 || *k == count || !draw.one_in(3))
            .map(|(_, angle)| angle)
            .collect();
    }
    even
}

/// Draws the C planes of a table.
fn draw_planes(draw: &mut Draw, allowed: &BTreeSet<Feature>) -> Vec<f64> {
    let symmetries =
        [Feature::Axial, Feature::Quadrant, Feature::BilateralC0, Feature::BilateralC90, Feature::AllPlanes];
    let candidates: Vec<Feature> = symmetries.into_iter().filter(|s| allowed.contains(s)).collect();
    let symmetry = if candidates.is_empty() { Feature::Axial } else { draw.one_of(&candidates) };
    let [start, end] = match symmetry {
        Feature::Quadrant => [0.0, 90.0],
        Feature::BilateralC0 => [0.0, 180.0],
        Feature::BilateralC90 => [90.0, 270.0],
        Feature::AllPlanes => [0.0, 360.0],
        _ => return vec![0.0],
    };
    let step = draw.one_of(&[15.0, 22.5, 30.0, 45.0, 90.0]);
    let count = ((end - start) / step) as usize;
    let even: Vec<f64> = (0..=count).map(|k| start + k as f64 * step).collect();
    if count > 3 && draw_feature(draw, allowed, Feature::UnevenAngles, 3) {
        let skipped = draw.0.usize(1..count);
        return even.into_iter().enumerate().filter_map(|(k, c)| (k != skipped).then_some(c)).collect();
    }
    even
}

/// Draws an LM-63-2002 file of type A or B. The photometry crate has no writer for them: only
/// goniometers produce them.
pub(super) fn draw_lm63_of_type(draw: &mut Draw, kind: Goniometer) -> String {
    let vertical: &[f64] = if draw.one_in(2) { &[-90.0, -45.0, 0.0, 45.0, 90.0] } else { &[0.0, 30.0, 60.0, 90.0] };
    let horizontal: &[f64] = if draw.one_in(2) { &[-90.0, -30.0, 0.0, 60.0, 90.0] } else { &[0.0, 30.0, 90.0] };
    // All planes agree where they meet, as in a real file.
    let pole_cd = round_to_digits(draw.within(10.0, 1000.0), 3);
    write_lm63_of_type(kind, [vertical, horizontal], |h, v| {
        if is_pole_of_type(kind, h, v) { pole_cd } else { round_to_digits(draw.within(10.0, 1000.0), 3) }
    })
}

/// Whether all planes of a goniometer type meet in a direction: at V = -90 and 90 of type A, at H =
/// -90 and 90 of type B.
fn is_pole_of_type(kind: Goniometer, h_deg: f64, v_deg: f64) -> bool {
    match kind {
        Goniometer::A => v_deg.abs() == 90.0,
        Goniometer::B => h_deg.abs() == 90.0,
        Goniometer::C => is_pole(v_deg),
    }
}

/// Twice as much light straight ahead as elsewhere.
fn intensity_fading_cd(h_deg: f64, v_deg: f64) -> f64 {
    if h_deg == 0.0 && v_deg == 0.0 { 200.0 } else { 100.0 }
}

/// Twice as much light on one side as elsewhere, which shows a wrong orientation.
fn intensity_turned_cd(h_deg: f64, v_deg: f64) -> f64 {
    if h_deg > 0.0 && v_deg > 0.0 { 200.0 } else { 100.0 }
}

/// The smallest files of a type: even light, and light with another value in one direction.
pub(super) fn smallest_files_of_type(kind: Goniometer) -> Vec<String> {
    let quarter: &[f64] = &[0.0, 90.0];
    let half: &[f64] = &[-90.0, 90.0];
    let mut all = vec![];
    for angles in [[quarter, quarter], [half, quarter], [quarter, half], [half, half]] {
        all.extend([
            write_lm63_of_type(kind, angles, |_, _| 100.0),
            write_lm63_of_type(kind, angles, intensity_fading_cd),
        ]);
    }
    let three: &[f64] = &[-90.0, 0.0, 90.0];
    for angles in [[quarter, three], [three, quarter], [half, three], [three, half]] {
        all.extend([
            write_lm63_of_type(kind, angles, intensity_fading_cd),
            write_lm63_of_type(kind, angles, intensity_turned_cd),
        ]);
    }
    all
}

/// Numbers as a line of a photometric file.
fn join_numbers(all: impl Iterator<Item = f64>) -> String {
    all.map(|x| x.to_string()).join(" ")
}

/// Writes an LM-63-2002 file of a goniometer type with the intensity in each direction (horizontal,
/// vertical angle).
fn write_lm63_of_type(
    kind: Goniometer,
    [vertical, horizontal]: [&[f64]; 2],
    mut candela: impl FnMut(f64, f64) -> f64,
) -> String {
    let number = match kind {
        Goniometer::A => 3,
        Goniometer::B => 2,
        Goniometer::C => 1,
    };
    let rows: Vec<String> = horizontal.iter().map(|h| join_numbers(vertical.iter().map(|v| candela(*h, *v)))).collect();
    format!(
        "IESNA:LM-63-2002\r\nTILT=NONE\r\n1 -1 1 {} {} {number} 2 0 0 0\r\n1 1 0\r\n{}\r\n{}\r\n{}\r\n",
        vertical.len(),
        horizontal.len(),
        join_numbers(vertical.iter().copied()),
        join_numbers(horizontal.iter().copied()),
        rows.join("\r\n")
    )
}

/// The smallest uneven tables of type C: one that fades, and one that differs in one plane only.
pub(super) fn smallest_tables() -> Vec<LuminousIntensityDistribution> {
    let planes: [&[f64]; 8] = [
        &[0.0],
        &[0.0, 90.0],
        &[0.0, 180.0],
        &[90.0, 270.0],
        &[0.0, 30.0, 90.0],
        &[0.0, 30.0, 180.0],
        &[0.0, 180.0, 360.0],
        &[0.0, 90.0, 180.0, 270.0, 360.0],
    ];
    let gammas: [&[f64]; 5] = [&[0.0, 90.0], &[0.0, 180.0], &[90.0, 180.0], &[0.0, 30.0, 90.0], &[0.0, 90.0, 180.0]];
    let mut all = vec![];
    for (c, gamma) in planes.into_iter().cartesian_product(gammas) {
        let ends = [0, c.len() - 1];
        for odd in (0..c.len()).filter(|k| c.len() <= 2 || !ends.contains(k)) {
            for level in [0.0, 100.0] {
                let mut candela = Vec::with_capacity(c.len() * gamma.len());
                for (k, g) in (0..c.len()).cartesian_product(gamma) {
                    // At a pole a single plane cannot differ from the others, except where it is
                    // the only one.
                    let is_odd = k == odd && (!is_pole(*g) || (*g > 0.0 && c.len() == 1));
                    candela.push(if is_odd { level } else { 100.0 - level });
                }
                all.extend(LuminousIntensityDistribution::new(c.to_vec(), gamma.to_vec(), candela));
            }
        }
    }
    all
}
