//! From the angles of a measured table to the C planes of a distribution.

use super::error::{Problem, ReadError};
use super::goniometer::{Goniometer, Table};
use super::lint::Lints;
use super::text::Text;
use super::{DistributionError, LuminousIntensityDistribution};

/// A table of type A or B that ends with a larger part of its largest intensity is remarked on.
const LIT_EDGE: f64 = 0.01;

/// The distribution that a table means.
pub(crate) fn distribution(
    text: &Text,
    goniometer: Goniometer,
    table: Table,
    lints: &mut Lints,
) -> Result<LuminousIntensityDistribution, ReadError> {
    match goniometer {
        Goniometer::C => type_c(text, table, lints),
        Goniometer::A | Goniometer::B => type_a_or_b(text, goniometer, &table, lints),
    }
}

/// Angles from the horizon (A) or about a horizontal axis (B), which stay what they are.
fn type_a_or_b(
    text: &Text,
    goniometer: Goniometer,
    table: &Table,
    lints: &mut Lints,
) -> Result<LuminousIntensityDistribution, ReadError> {
    let (h_most, v_most) = if goniometer == Goniometer::A { (180.0, 90.0) } else { (90.0, 180.0) };
    let expected =
        "those of type A lie within -180 and 180 (horizontal), -90 and 90 (vertical), of type B the other way";
    for (axis, angles, most, at) in [
        ("horizontal", &table.horizontal_deg, h_most, table.horizontal_at),
        ("vertical", &table.vertical_deg, v_most, table.vertical_at),
    ] {
        let (first, last) = (angles[0], angles[angles.len() - 1]);
        if first < -most || last > most {
            return Err(text.error(at, Problem::AngleRange { axis, first, last, expected }));
        }
    }
    if let [only] = table.horizontal_deg[..] {
        let line = text.line_of(table.horizontal_at);
        lints.note("planes/single", line, format!("the only horizontal angle, {only}, was taken for every one"));
    }
    let distribution =
        native(goniometer, table).map_err(|error| text.error(table.candela_at, Problem::Distribution(error)))?;
    let edge = distribution.edge_intensity().value();
    let peak = distribution.max_intensity().value();
    if edge > LIT_EDGE * peak {
        let message = format!(
            "the table of type {goniometer:?} ends with up to {edge:.1} cd; beyond it the intensity counts as zero"
        );
        lints.note("planes/edge", text.line_of(table.horizontal_at), message);
    }
    Ok(distribution)
}

/// The distribution of a table of type A or B. Horizontal angles from 0 are those of one half, and a single one stands for all.
fn native(goniometer: Goniometer, table: &Table) -> Result<LuminousIntensityDistribution, DistributionError> {
    let rows: Vec<&[f64]> = table.candela.chunks(table.vertical_deg.len()).collect();
    let (horizontal_deg, rows): (Vec<f64>, Vec<&[f64]>) = match table.horizontal_deg[..] {
        [_] if goniometer == Goniometer::B => (vec![-90.0, 90.0], vec![rows[0]; 2]),
        // The same in all planes about the vertical is of type C as well.
        [_] => {
            let gamma_deg = table.vertical_deg.iter().map(|v| v + 90.0).collect();
            return LuminousIntensityDistribution::axial(gamma_deg, rows[0].to_vec());
        }
        [0.0, ..] => {
            let halves =
                table.horizontal_deg.iter().skip(1).rev().map(|h| -h).chain(table.horizontal_deg.iter().copied());
            (halves.collect(), rows.iter().skip(1).rev().chain(&rows).copied().collect())
        }
        _ => (table.horizontal_deg.clone(), rows),
    };
    if goniometer == Goniometer::A {
        let c_deg = horizontal_deg.iter().rev().map(|h| -h).collect();
        let gamma_deg = table.vertical_deg.iter().map(|v| 90.0 + v).collect();
        return LuminousIntensityDistribution::native(
            goniometer,
            c_deg,
            gamma_deg,
            rows.into_iter().rev().flatten().copied().collect(),
        );
    }
    let candela = (0..table.vertical_deg.len()).flat_map(|v| rows.iter().map(move |row| row[v])).collect();
    let gamma_deg = horizontal_deg.iter().map(|h| 90.0 + h).collect();
    LuminousIntensityDistribution::native(goniometer, table.vertical_deg.clone(), gamma_deg, candela)
}

fn type_c(text: &Text, mut table: Table, lints: &mut Lints) -> Result<LuminousIntensityDistribution, ReadError> {
    let gammas = table.vertical_deg.len();
    let (first, last) = (table.vertical_deg[0], table.vertical_deg[gammas - 1]);
    if first < 0.0 || last > 180.0 {
        let expected = "those of type C lie within 0 (nadir) and 180 (zenith)";
        return Err(text.error(table.vertical_at, Problem::AngleRange { axis: "vertical", first, last, expected }));
    }
    if ![(0.0, 90.0), (90.0, 180.0), (0.0, 180.0)].contains(&(first, last)) {
        let message =
            format!("the vertical angles run from {first} to {last}; beyond them the intensity counts as zero");
        lints.note("planes/vertical-range", text.line_of(table.vertical_at), message);
    }
    normalise_planes(text, &mut table, lints)?;
    poles_agree(text, &table, lints);
    LuminousIntensityDistribution::new(table.horizontal_deg, table.vertical_deg, table.candela)
        .map_err(|error| text.error(table.candela_at, Problem::Distribution(error)))
}

/// Brings the horizontal angles to 0, 0-90, 0-180, 90-270 or 0-360, where that is what they mean.
fn normalise_planes(text: &Text, table: &mut Table, lints: &mut Lints) -> Result<(), ReadError> {
    let gammas = table.vertical_deg.len();
    let c = &mut table.horizontal_deg;
    let planes = c.len();
    let (first, last) = (c[0], c[planes - 1]);
    let line = || text.line_of(table.horizontal_at);
    if planes == 1 {
        if first != 0.0 {
            lints.note("planes/single", line(), format!("the only plane, {first}, was taken for every C"));
            c[0] = 0.0;
        }
        return Ok(());
    }
    match (first, last) {
        (0.0, 90.0 | 180.0) | (90.0, 270.0) => {}
        (0.0, 360.0) => {
            let differs = (0..gammas).any(|g| table.candela[g] != table.candela[(planes - 1) * gammas + g]);
            if differs {
                lints.warn("planes/open-circle", line(), "the planes 0 and 360 differ");
            }
        }
        (-90.0, 90.0) => {
            // Mirrored in C90-C270: C and 180 - C are one, so that the planes become 270 down to 90.
            lints.note("planes/negative", line(), "the planes from -90 to 90 were mirrored to 90 to 270");
            *c = c.iter().map(|c| 180.0 - c).collect();
            reverse(table, gammas);
        }
        (180.0, 360.0) => {
            lints.note("planes/second-half", line(), "the planes from 180 to 360 were mirrored to 0 to 180");
            *c = c.iter().map(|c| 360.0 - c).collect();
            reverse(table, gammas);
        }
        (-180.0, 180.0) if c.contains(&0.0) => {
            lints.note("planes/negative", line(), "the planes from -180 to 180 were turned to 0 to 360");
            let zero = c.iter().position(|c| *c == 0.0).unwrap_or(0);
            let positive: Vec<f64> = c[zero..].to_vec();
            let negative = c[1..=zero].iter().map(|c| c + 360.0);
            *c = positive.into_iter().chain(negative).collect();
            let front = table.candela[zero * gammas..].to_vec();
            let back = &table.candela[gammas..(zero + 1) * gammas];
            table.candela = front.into_iter().chain(back.iter().copied()).collect();
        }
        (0.0, _) if planes > 2 && last < 360.0 && closes(c) => {
            lints.warn("planes/open-circle", line(), "the plane 360 is missing; it was taken equal to plane 0");
            c.push(360.0);
            table.candela.extend_from_within(..gammas);
        }
        _ => {
            let expected = "those of type C are 0 alone, 0-90, 0-180, 90-270 or 0-360";
            let problem = Problem::AngleRange { axis: "horizontal", first, last, expected };
            return Err(text.error(table.horizontal_at, problem));
        }
    }
    Ok(())
}

/// Whether evenly spaced planes lack only the one at 360.
fn closes(c: &[f64]) -> bool {
    let step = c[1] - c[0];
    let even = c.windows(2).all(|w| (w[1] - w[0] - step).abs() < 1e-6);
    even && (c[c.len() - 1] + step - 360.0).abs() < 1e-6
}

fn reverse(table: &mut Table, gammas: usize) {
    table.horizontal_deg.reverse();
    table.candela = table.candela.chunks(gammas).rev().flatten().copied().collect();
}

/// At a pole every plane looks in the same direction.
fn poles_agree(text: &Text, table: &Table, lints: &mut Lints) {
    let gammas = table.vertical_deg.len();
    for (name, pole, g) in [("nadir", 0.0, 0), ("zenith", 180.0, gammas - 1)] {
        if table.vertical_deg[g] != pole {
            continue;
        }
        let values = table.candela.iter().skip(g).step_by(gammas).copied();
        let (least, most) = values.fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), v| (a.min(v), b.max(v)));
        // A hundredth: what rounding to whole candelas and the repeatability of goniometers explain.
        if most - least > 0.01 * most {
            let message = format!("the planes disagree about the {name}: {least} to {most} cd");
            lints.warn("planes/pole", text.line_of(table.candela_at), message);
        }
    }
}
