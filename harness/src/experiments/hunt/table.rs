//! Tables of luminous intensity at random, those of types A and B among them.

use std::collections::BTreeSet;

use itertools::Itertools as _;
use luminaire::photometry::{Goniometer, LuminousIntensityDistribution};

use super::feature::Feature;
use crate::experiments::draw::Draw;

/// A number of so many digits, as a file has it.
pub(super) fn to_digits(x: f64, digits: i32) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    let written = format!("{x:.*e}", (digits - 1).max(0) as usize);
    written.parse().unwrap_or(x)
}

/// A table of any symmetry, as even and as long as what is allowed.
pub(super) fn distribution(draw: &mut Draw, allowed: &BTreeSet<Feature>) -> LuminousIntensityDistribution {
    let has = |draw: &mut Draw, feature: Feature, one_in: usize| allowed.contains(&feature) && draw.one_in(one_in);
    let gamma_deg = gammas(draw, &has);
    let c_deg = planes(draw, allowed, &has);
    let peak = if has(draw, Feature::BrightTable, 6) {
        draw.magnitude(1e5, 1e8)
    } else if has(draw, Feature::FaintTable, 6) {
        draw.magnitude(1e-6, 0.5)
    } else {
        draw.magnitude(20.0, 5000.0)
    };
    let form = draw.0.usize(0..5);
    let narrow = has(draw, Feature::NarrowBeam, 4);
    let (power, lean) = (if narrow { 200 } else { draw.0.i32(1..6) }, draw.within(0.1, 0.6));
    let (gammas, count) = (gamma_deg.len(), gamma_deg.len() * c_deg.len());
    let value = |draw: &mut Draw, c: f64, gamma: f64| {
        let (sin, cos) = gamma.to_radians().sin_cos();
        match form {
            _ if narrow => peak * cos.max(0.0).powi(power) + peak * 1e-3,
            0 => peak * cos.max(0.0).powi(power),
            1 => peak,
            2 => peak * (0.2 + sin * sin) * (1.0 + lean * c.to_radians().cos()),
            3 => peak * (0.3 + 0.7 * (cos + 1.0) / 2.0) * (1.0 + lean * (2.0 * c.to_radians()).cos()),
            // No neighbour tells of another.
            _ => peak * draw.within(0.05, 1.0),
        }
    };
    let mut candela: Vec<f64> = Vec::with_capacity(count);
    for &c in &c_deg {
        for &gamma in &gamma_deg {
            let candela_there = value(draw, c, gamma);
            // The cosine of 90 degrees is not quite zero, but nobody measures that.
            candela.push(if candela_there > 1e-12 * peak { to_digits(candela_there, 4) } else { 0.0 });
        }
    }
    if c_deg.len() > 2 && has(draw, Feature::OddValue, 3) {
        // The same in all planes, but for one value of an inner one.
        for c in 1..c_deg.len() {
            let (first, rest) = candela.split_at_mut(gammas);
            rest[(c - 1) * gammas..c * gammas].copy_from_slice(first);
        }
        let inner: Vec<usize> = (0..gammas).filter(|g| !is_pole(gamma_deg[*g])).collect();
        if !inner.is_empty() {
            let at = draw.0.usize(1..c_deg.len() - 1) * gammas + draw.one_of(&inner);
            candela[at] = to_digits(3.0 * candela[at] + peak, 4);
        }
    }
    if has(draw, Feature::DarkPart, 4) {
        let from = draw.0.usize(0..gammas);
        (0..count).filter(|k| k % gammas >= from && from > 0).for_each(|k| candela[k] = 0.0);
    }
    // Nadir and zenith are one direction each, whatever the plane.
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

/// Whether all C planes meet there.
fn is_pole(gamma_deg: f64) -> bool {
    gamma_deg == 0.0 || gamma_deg == 180.0
}

/// Whether a table says one thing of each direction: at nadir and zenith all planes are one.
pub(super) fn is_single_valued(table: &LuminousIntensityDistribution) -> bool {
    let planes = 0..table.c_deg().len();
    let agree = |g: usize| planes.clone().all(|c| table.plane(c)[g] == table.plane(0)[g]);
    (0..table.gamma_deg().len()).filter(|g| is_pole(table.gamma_deg()[*g])).all(agree)
}

fn gammas(draw: &mut Draw, has: &impl Fn(&mut Draw, Feature, usize) -> bool) -> Vec<f64> {
    let end = if has(draw, Feature::EndsAt90, 2) { 90.0 } else { 180.0 };
    let start = if has(draw, Feature::StartsLate, 6) { draw.one_of(&[90.0, 10.0, 30.0]) } else { 0.0 };
    let end = if start == 90.0 { 180.0 } else { end };
    if has(draw, Feature::FewGammas, 3) {
        let middle = 0.5 * (start + end);
        return if draw.one_in(2) { vec![start, end] } else { vec![start, middle, end] };
    }
    let step = if has(draw, Feature::FineTable, 6) { 1.0 } else { draw.one_of(&[5.0, 10.0, 15.0, 30.0]) };
    let count = ((end - start) / step) as usize;
    let even: Vec<f64> = (0..=count).map(|k| (start + k as f64 * step).min(end)).collect();
    if has(draw, Feature::UnevenAngles, 4) && even.len() > 3 {
        let is_kept = |k: usize| k == 0 || k == count || !draw.one_in(3);
        let kept: Vec<bool> = (0..=count).map(is_kept).collect();
        return even.into_iter().zip(kept).filter_map(|(angle, kept)| kept.then_some(angle)).collect();
    }
    even
}

fn planes(draw: &mut Draw, allowed: &BTreeSet<Feature>, has: &impl Fn(&mut Draw, Feature, usize) -> bool) -> Vec<f64> {
    let symmetries =
        [Feature::Axial, Feature::Quadrant, Feature::BilateralC0, Feature::BilateralC90, Feature::AllPlanes];
    let there: Vec<Feature> = symmetries.into_iter().filter(|s| allowed.contains(s)).collect();
    let symmetry = if there.is_empty() { Feature::Axial } else { draw.one_of(&there) };
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
    if count > 3 && has(draw, Feature::UnevenAngles, 3) {
        let skipped = draw.0.usize(1..count);
        return even.into_iter().enumerate().filter_map(|(k, c)| (k != skipped).then_some(c)).collect();
    }
    even
}

/// A file of LM-63-2002 of type A or B, for which there is no writer: nobody but a goniometer makes them.
pub(super) fn of_type(draw: &mut Draw, kind: Goniometer) -> String {
    let vertical: &[f64] = if draw.one_in(2) { &[-90.0, -45.0, 0.0, 45.0, 90.0] } else { &[0.0, 30.0, 60.0, 90.0] };
    let horizontal: &[f64] = if draw.one_in(2) { &[-90.0, -30.0, 0.0, 60.0, 90.0] } else { &[0.0, 30.0, 90.0] };
    // Where all planes of a type meet, they say the same: at V = -90 and 90 of type A, at H = -90 and 90 of type B.
    let at_pole = to_digits(draw.within(10.0, 1000.0), 3);
    let is_pole = |h: f64, v: f64| match kind {
        Goniometer::A => v.abs() == 90.0,
        Goniometer::B => h.abs() == 90.0,
        Goniometer::C => is_pole(v),
    };
    let value = |h: f64, v: f64| if is_pole(h, v) { at_pole } else { to_digits(draw.within(10.0, 1000.0), 3) };
    lm63_of_type(kind, [vertical, horizontal], value)
}

/// The smallest files of a type: even light, and light that is another in one direction.
pub(super) fn smallest_of_type(kind: Goniometer) -> Vec<String> {
    let quarter: &[f64] = &[0.0, 90.0];
    let half: &[f64] = &[-90.0, 90.0];
    let even = |_: f64, _: f64| 100.0;
    let fading = |h: f64, v: f64| if h == 0.0 && v == 0.0 { 200.0 } else { 100.0 };
    let turned = |h: f64, v: f64| if h > 0.0 && v > 0.0 { 200.0 } else { 100.0 };
    let mut all = vec![];
    for angles in [[quarter, quarter], [half, quarter], [quarter, half], [half, half]] {
        all.extend([lm63_of_type(kind, angles, even), lm63_of_type(kind, angles, fading)]);
    }
    let three: &[f64] = &[-90.0, 0.0, 90.0];
    for angles in [[quarter, three], [three, quarter], [half, three], [three, half]] {
        all.extend([lm63_of_type(kind, angles, fading), lm63_of_type(kind, angles, turned)]);
    }
    all
}

fn lm63_of_type(
    kind: Goniometer,
    [vertical, horizontal]: [&[f64]; 2],
    mut candela: impl FnMut(f64, f64) -> f64,
) -> String {
    let number = match kind {
        Goniometer::A => 3,
        Goniometer::B => 2,
        Goniometer::C => 1,
    };
    let words = |all: &[f64]| all.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let mut row = |h: &f64| words(&vertical.iter().map(|v| candela(*h, *v)).collect::<Vec<_>>());
    let rows: Vec<String> = horizontal.iter().map(&mut row).collect();
    format!(
        "IESNA:LM-63-2002\r\nTILT=NONE\r\n1 -1 1 {} {} {number} 2 0 0 0\r\n1 1 0\r\n{}\r\n{}\r\n{}\r\n",
        vertical.len(),
        horizontal.len(),
        words(vertical),
        words(horizontal),
        rows.join("\r\n")
    )
}

/// The smallest tables of type C whose light is not even: one that fades, and one that differs in one plane alone.
pub(super) fn smallest() -> Vec<LuminousIntensityDistribution> {
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
                let dark = |k: usize, g: f64| k == odd && if is_pole(g) { g > 0.0 && c.len() == 1 } else { true };
                let value = |k: usize, g: f64| if dark(k, g) { level } else { 100.0 - level };
                let candela =
                    (0..c.len()).flat_map(|k| gamma.iter().map(move |g| (k, *g))).map(|(k, g)| value(k, g)).collect();
                all.extend(LuminousIntensityDistribution::new(c.to_vec(), gamma.to_vec(), candela));
            }
        }
    }
    all
}
