//! From the angles of a measured table to the C planes of a distribution.

use super::error::{Problem, ReadError};
use super::goniometer::{Goniometer, Table};
use super::lint::Lints;
use super::text::Text;
use super::{DistributionError, LuminousIntensityDistribution};

/// The lint on a lit end appears above this fraction of the largest intensity.
const LIT_END_FRACTION: f64 = 0.01;

/// Builds the distribution of a measured table.
pub(crate) fn build_distribution(
    text: &Text,
    goniometer: Goniometer,
    table: Table,
    lints: &mut Lints,
) -> Result<LuminousIntensityDistribution, ReadError> {
    match goniometer {
        Goniometer::C => build_type_c(text, table, lints),
        Goniometer::A | Goniometer::B => build_type_a_or_b(text, goniometer, &table, lints),
    }
}

/// Builds the distribution of a type A or B table, in its native angles.
fn build_type_a_or_b(
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
        let message = format!(
            "the only horizontal angle, {only}, was taken for all from -90 to 90, the range of LM-63; LM-63 defines a \
             single plane for type C alone"
        );
        lints.warn("planes/single", text.line_of(table.horizontal_at), message);
    }
    let distribution = arrange_native(goniometer, table)
        .map_err(|error| text.error(table.candela_at, Problem::Distribution(error)))?;
    let edge = distribution.edge_intensity().value();
    let peak = distribution.max_intensity().value();
    if edge > LIT_END_FRACTION * peak {
        let message = format!(
            "the table of type {goniometer:?} ends with up to {edge:.1} cd, {:.1} % of its peak; beyond it the intensity \
             counts as zero",
            100.0 * edge / peak
        );
        // The lint above concerns a table of a single horizontal angle.
        if table.horizontal_deg.len() > 1 {
            lints.warn("planes/edge", text.line_of(table.horizontal_at), message);
        }
    }
    Ok(distribution)
}

/// Arranges a type A or B table in native angles.
///
/// Horizontal angles from 0 on are one mirrored half. A single horizontal angle stands for all from -90 to 90.
fn arrange_native(goniometer: Goniometer, table: &Table) -> Result<LuminousIntensityDistribution, DistributionError> {
    let rows: Vec<&[f64]> = table.candela.chunks(table.vertical_deg.len()).collect();
    let (horizontal_deg, rows): (Vec<f64>, Vec<&[f64]>) = match table.horizontal_deg[..] {
        [_] => (vec![-90.0, 90.0], vec![rows[0]; 2]),
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

/// Builds the distribution of a type C table.
fn build_type_c(text: &Text, mut table: Table, lints: &mut Lints) -> Result<LuminousIntensityDistribution, ReadError> {
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
    check_poles(text, &table, lints);
    check_lit_ends(&table.vertical_deg, &table.candela, text.line_of(table.vertical_at), lints);
    LuminousIntensityDistribution::new(table.horizontal_deg, table.vertical_deg, table.candela)
        .map_err(|error| text.error(table.candela_at, Problem::Distribution(error)))
}

/// Converts the horizontal angles to 0, 0-90, 0-180, 90-270 or 0-360, or refuses them.
fn normalise_planes(text: &Text, table: &mut Table, lints: &mut Lints) -> Result<(), ReadError> {
    let gammas = table.vertical_deg.len();
    let c = &mut table.horizontal_deg;
    let planes = c.len();
    let (first, last) = (c[0], c[planes - 1]);
    let line = text.line_of(table.horizontal_at);
    if planes == 1 {
        if first != 0.0 {
            lints.note("planes/single", line, format!("the only plane, {first}, was taken for every C"));
            c[0] = 0.0;
        }
        return Ok(());
    }
    match (first, last) {
        (0.0, 90.0 | 180.0) | (90.0, 270.0) => {}
        (0.0, 360.0) => {
            let differs = (0..gammas).any(|g| table.candela[g] != table.candela[(planes - 1) * gammas + g]);
            if differs {
                let last = &table.candela[(planes - 1) * gammas..];
                let difference = last.iter().zip(&table.candela).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                let peak = table.candela.iter().copied().fold(0.0, f64::max);
                let message = format!(
                    "the planes 0 and 360 differ by up to {difference:.1} cd, {:.2} % of the peak",
                    100.0 * difference / peak
                );
                lints.warn("planes/open-circle", line, message);
            }
        }
        (-90.0, 90.0) => {
            // The mirror C90-C270 takes C to 180 - C, so that the planes become 270 down to 90.
            lints.note("planes/negative", line, "the planes from -90 to 90 were mirrored to 90 to 270");
            *c = c.iter().map(|c| 180.0 - c).collect();
            reverse_planes(table, gammas);
        }
        (180.0, 360.0) => {
            lints.note("planes/second-half", line, "the planes from 180 to 360 were mirrored to 0 to 180");
            *c = c.iter().map(|c| 360.0 - c).collect();
            reverse_planes(table, gammas);
        }
        (-180.0, 180.0) if c.contains(&0.0) => {
            lints.note("planes/negative", line, "the planes from -180 to 180 were turned to 0 to 360");
            let zero = c.iter().position(|c| *c == 0.0).unwrap_or(0);
            let positive: Vec<f64> = c[zero..].to_vec();
            let negative = c[1..=zero].iter().map(|c| c + 360.0);
            *c = positive.into_iter().chain(negative).collect();
            let front = table.candela[zero * gammas..].to_vec();
            let back = &table.candela[gammas..(zero + 1) * gammas];
            table.candela = front.into_iter().chain(back.iter().copied()).collect();
        }
        (0.0, _) if planes > 2 && last < 360.0 && lacks_last_plane(c) => {
            lints.warn("planes/open-circle", line, "the plane 360 is missing; it was taken equal to plane 0");
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
fn lacks_last_plane(c: &[f64]) -> bool {
    let step = c[1] - c[0];
    let even = c.windows(2).all(|w| (w[1] - w[0] - step).abs() < 1e-6);
    even && (c[c.len() - 1] + step - 360.0).abs() < 1e-6
}

/// Reverses the order of the planes.
fn reverse_planes(table: &mut Table, gammas: usize) {
    table.horizontal_deg.reverse();
    table.candela = table.candela.chunks(gammas).rev().flatten().copied().collect();
}

/// Reports light at the first and last vertical angle of a type C table, beyond which every intensity counts as zero.
///
/// LM-63 and EULUMDAT let a table of one hemisphere end at the horizon, with light or without.
pub(crate) fn check_lit_ends(gamma_deg: &[f64], candela: &[f64], line: usize, lints: &mut Lints) {
    let gammas = gamma_deg.len();
    let peak = candela.iter().copied().fold(0.0, f64::max);
    for (g, pole) in [(0, 0.0), (gammas - 1, 180.0)] {
        let (gamma, end) = (gamma_deg[g], candela.iter().skip(g).step_by(gammas).copied().fold(0.0, f64::max));
        if gamma == pole || gamma == 90.0 || end <= LIT_END_FRACTION * peak {
            continue;
        }
        let percent = 100.0 * end / peak;
        let message = format!(
            "the table ends at {gamma} degrees with {end:.1} cd, {percent:.1} % of its peak; beyond it is dark"
        );
        lints.warn("planes/edge", line, message);
    }
}

/// Warns where the planes disagree about a pole, which is one direction for all of them.
fn check_poles(text: &Text, table: &Table, lints: &mut Lints) {
    let gammas = table.vertical_deg.len();
    for (name, pole, g) in [("nadir", 0.0, 0), ("zenith", 180.0, gammas - 1)] {
        if table.vertical_deg[g] != pole {
            continue;
        }
        let values = table.candela.iter().skip(g).step_by(gammas).copied();
        let (least, most) = values.fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), v| (a.min(v), b.max(v)));
        // Rounding to whole candelas and the repeatability of goniometers explain a hundredth.
        if most - least > 0.01 * most {
            let message = format!("the planes disagree about the {name}: {least} to {most} cd");
            lints.warn("planes/pole", text.line_of(table.candela_at), message);
        }
    }
}
