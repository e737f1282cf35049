//! The text form of a photometric report.

use std::fmt;

use super::super::figures::{
    BeamRecord, Bug, Figure, Figures, Luminances, SpacingRecord, Ugr, Widths, ZonalLumens, Zone,
};
use luxproof_process::printable::quoted;
use luxproof_report::words::trimmed;

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.file)?;
        write_row(f, "format", &self.format)?;
        if let Some(luminaire) = &self.luminaire {
            write_row(f, "luminaire", &quoted(luminaire.lines().next().unwrap_or_default()))?;
        }
        write_row(f, "flux", &format!("{:.1} lm", self.flux_lm))?;
        write_row(f, "beam axis", &self.beam.describe(describe_axis))?;
        if let Figure::Is(beam) = &self.beam {
            write_row(f, "  vertical plane", &describe_widths(&beam.vertical_plane))?;
            write_row(f, "  plane across", &describe_widths(&beam.plane_across))?;
        }
        write_row(f, "NEMA type", &self.nema_type.describe(|nema| nema.designation.clone()))?;
        write_row(f, "BUG rating", &self.bug.describe(describe_bug))?;
        write_row(f, "CIE flux code", &self.cie_flux_code_percent.describe(|code| list_whole(code)))?;
        write_row(f, "spacing criterion", &self.spacing_criterion.describe(SpacingRecord::describe))?;
        write_zones(f, &self.zonal_lumens)?;
        write_luminances(f, &self.luminance)?;
        match &self.ugr {
            Figure::Is(table) => write_ugr(f, table),
            Figure::No { .. } => writeln!(f, "\nUGR: {}", self.ugr.describe(|_| String::new())),
        }
    }
}

/// Writes one row of the first table.
fn write_row(f: &mut fmt::Formatter<'_>, name: &str, value: &str) -> fmt::Result {
    writeln!(f, "  {name:<22} {value}")
}

/// Whole numbers separated by blanks.
fn list_whole(numbers: &[f64]) -> String {
    numbers.iter().map(|n| format!("{n:.0}")).collect::<Vec<_>>().join(" ")
}

/// A direction.
fn describe_direction([c, gamma]: [f64; 2]) -> String {
    format!("C {}° gamma {}°", trimmed(c, 2), trimmed(gamma, 2))
}

/// The beam axis and its relation to the peaks.
fn describe_axis(beam: &BeamRecord) -> String {
    let (axis, peak) = ([beam.axis_c_deg, beam.axis_gamma_deg], [beam.peak_c_deg, beam.peak_gamma_deg]);
    let relation = match (beam.peaks, beam.is_one_beam) {
        ("one", _) => "the largest intensity".to_owned(),
        ("ring", true) => format!("the middle of a ring at gamma {}° with the largest", trimmed(peak[1], 2)),
        ("ring", false) => "one direction of a ring with the largest".to_owned(),
        (_, true) => format!("the middle of directions like {} with the largest", describe_direction(peak)),
        (_, false) => "one of several directions with the largest".to_owned(),
    };
    format!("{}: {relation}, {:.1} cd", describe_direction(axis), beam.peak_cd)
}

/// Beam and field angle with both of their sides.
fn describe_widths(widths: &Widths) -> String {
    let [beam_angle, field_angle] = [&widths.beam_angle, &widths.field_angle].map(|figure| {
        figure.describe(|w| format!("{:.1}° ({:.1} + {:.1})", w.full_deg, w.one_side_deg, w.other_side_deg))
    });
    format!("beam angle (50 %) {beam_angle}; field angle (10 %) {field_angle}")
}

/// The BUG rating with its zones.
fn describe_bug(bug: &Bug) -> String {
    let columns = if bug.is_quadrilaterally_symmetric {
        "quadrilaterally symmetric, types V and VS".to_owned()
    } else if bug.glare_if_symmetric == bug.glare_if_asymmetric {
        "asymmetric, types I to IV".to_owned()
    } else {
        format!("asymmetric, types I to IV; G{} were it of type V", bug.glare_if_symmetric)
    };
    format!(
        "{} ({columns}; forward is C {}°; forward {}, back {}, up {} lm)",
        bug.rating,
        bug.forward_c_deg,
        list_whole(&bug.forward_lm),
        list_whole(&bug.back_lm),
        list_whole(&bug.up_lm)
    )
}

/// Writes the zonal lumens.
fn write_zones(f: &mut fmt::Formatter<'_>, zones: &ZonalLumens) -> fmt::Result {
    let method = match &zones.mid_zone_width_deg {
        Figure::Is(width) => format!("zonal constants of {width}° zones"),
        Figure::No { not_available } => format!("by zonal constants not available: {not_available}"),
    };
    writeln!(
        f,
        "\nzonal lumens ({method})\n  {:>9} {:>11} {:>11} {:>10} {:>7}",
        "gamma", "mid-zone", "exact", "difference", "%"
    )?;
    zones.zones.iter().try_for_each(|zone| write_zone(f, zone))?;
    writeln!(f)?;
    zones.sums.iter().try_for_each(|zone| write_zone(f, zone))
}

/// Writes one zone.
fn write_zone(f: &mut fmt::Formatter<'_>, zone: &Zone) -> fmt::Result {
    let range = format!("{}-{}", zone.from_deg, zone.to_deg);
    let [mid_zone, percent] = [zone.mid_zone_lm, zone.percent_of_flux].map(one_decimal_or_dash);
    let difference = match zone.difference_lm {
        // A rounded zero would print a sign.
        Some(lm) if lm.abs() < 0.05 => "0.0".to_owned(),
        Some(lm) => format!("{lm:+.1}"),
        None => "-".to_owned(),
    };
    writeln!(f, "  {range:>9} {mid_zone:>11} {:>11.1} {difference:>10} {percent:>7}", zone.exact_lm)
}

/// A number to one decimal, or a dash for none.
fn one_decimal_or_dash(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |v| format!("{v:.1}"))
}

/// Writes the table of luminances, or the reason why there is none.
fn write_luminances(f: &mut fmt::Formatter<'_>, table: &Luminances) -> fmt::Result {
    let reason = table.rows.iter().flat_map(|row| &row.cd_per_m2).find_map(|figure| match figure {
        Figure::No { not_available } => Some(not_available),
        Figure::Is(_) => None,
    });
    if let Some(reason) = reason {
        return writeln!(f, "\nluminance: not available: {reason}");
    }
    write!(f, "\nmean luminance, cd/m²\n  {:>9}", "gamma")?;
    table.c_deg.iter().try_for_each(|c| write!(f, " {:>10}", format!("C {c}°")))?;
    writeln!(f)?;
    for row in &table.rows {
        write!(f, "  {:>9}", format!("{}°", row.gamma_deg))?;
        row.cd_per_m2.iter().try_for_each(|figure| write!(f, " {:>10}", figure.describe(|v| format!("{v:.0}"))))?;
        writeln!(f)?;
    }
    Ok(())
}

/// Writes the UGR table.
fn write_ugr(f: &mut fmt::Formatter<'_>, table: &Ugr) -> fmt::Result {
    let (crosswise, endwise) = (table.crosswise_c_deg, (table.crosswise_c_deg + 90.0) % 180.0);
    writeln!(
        f,
        "\nUGR, corrected, S/H {} (CIE 190); seen crosswise from C {crosswise}°, endwise from C {endwise}°",
        table.spacing_over_height
    )?;
    let reflectances = &table.reflectances;
    for (name, values) in [
        ("ceiling", percent_columns(reflectances.iter().map(|r| r.ceiling))),
        ("walls", percent_columns(reflectances.iter().map(|r| r.walls))),
        ("plane", percent_columns(reflectances.iter().map(|r| r.plane))),
    ] {
        writeln!(f, "  {name:<9}{values}  {values}")?;
    }
    for room in &table.rooms {
        let name = format!("{}H x {}H", room.x_over_height, room.y_over_height);
        writeln!(f, "  {name:<9}{}  {}", rating_columns(room.crosswise), rating_columns(room.endwise))?;
    }
    Ok(())
}

/// Fractions in columns of whole percents.
fn percent_columns(fractions: impl Iterator<Item = f64>) -> String {
    fractions.map(|fraction| format!("{:>5.0}", 100.0 * fraction)).collect::<Vec<_>>().concat()
}

/// Ratings in columns, with a dash for none.
fn rating_columns(ratings: [Option<f64>; 5]) -> String {
    ratings.map(|rating| format!("{:>5}", one_decimal_or_dash(rating))).concat()
}
