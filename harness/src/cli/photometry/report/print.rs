//! A photometric report for people.

use std::fmt;

use super::super::figures::{
    BeamRecord, Bug, Figure, Figures, Luminances, Surfaces, Ugr, UgrRoom, Width, Widths, ZonalLumens, Zone,
};
use crate::report::words::trimmed;

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.file)?;
        let mut row = |name: &str, value: String| writeln!(f, "  {name:<22} {value}");
        row("format", self.format.clone())?;
        if let Some(luminaire) = &self.luminaire {
            row("luminaire", luminaire.lines().next().unwrap_or_default().to_owned())?;
        }
        row("flux", format!("{:.1} lm", self.flux_lm))?;
        let axis = |b: &BeamRecord| {
            let at = |[c, gamma]: [f64; 2]| format!("C {}° gamma {}°", trimmed(c, 2), trimmed(gamma, 2));
            let (axis, peak) = ([b.axis_c_deg, b.axis_gamma_deg], [b.peak_c_deg, b.peak_gamma_deg]);
            let whose = match (b.peaks, b.is_one_beam) {
                ("one", _) => "the largest intensity".to_owned(),
                ("ring", true) => format!("the middle of a ring at gamma {}° with the largest", trimmed(peak[1], 2)),
                ("ring", false) => "one direction of a ring with the largest".to_owned(),
                (_, true) => format!("the middle of directions like {} with the largest", at(peak)),
                (_, false) => "one of several directions with the largest".to_owned(),
            };
            format!("{}: {whose}, {:.1} cd", at(axis), b.peak_cd)
        };
        row("beam axis", self.beam.told(axis))?;
        if let Figure::Is(beam) = &self.beam {
            row("  vertical plane", widths(&beam.vertical_plane))?;
            row("  plane across", widths(&beam.plane_across))?;
        }
        row("NEMA type", self.nema_type.told(|nema| nema.designation.clone()))?;
        row("BUG rating", self.bug.told(bug))?;
        row("CIE flux code", self.cie_flux_code_percent.told(|code| code.map(|n| format!("{n:.0}")).join(" ")))?;
        row(
            "spacing criterion",
            self.spacing_criterion.told(|s| {
                format!("0-180 {:.2}, 90-270 {:.2}, diagonal {:.2}", s.along_c0_c180, s.along_c90_c270, s.diagonal)
            }),
        )?;
        zones(f, &self.zonal_lumens)?;
        luminances(f, &self.luminance)?;
        match &self.ugr {
            Figure::Is(table) => ugr(f, table),
            Figure::No { .. } => writeln!(f, "\nUGR: {}", self.ugr.told(|_| String::new())),
        }
    }
}

fn widths(widths: &Widths) -> String {
    let angle = |figure: &Figure<Width>| {
        figure.told(|w| format!("{:.1}° ({:.1} + {:.1})", w.full_deg, w.one_side_deg, w.other_side_deg))
    };
    format!("beam angle (50 %) {}; field angle (10 %) {}", angle(&widths.beam_angle), angle(&widths.field_angle))
}

fn bug(bug: &Bug) -> String {
    let columns = if bug.is_quadrilaterally_symmetric {
        "quadrilaterally symmetric, types V and VS".to_owned()
    } else if bug.glare_if_symmetric == bug.glare_if_asymmetric {
        "asymmetric, types I to IV".to_owned()
    } else {
        format!("asymmetric, types I to IV; G{} were it of type V", bug.glare_if_symmetric)
    };
    let list = |zones: &[f64]| zones.iter().map(|lm| format!("{lm:.0}")).collect::<Vec<_>>().join(" ");
    format!(
        "{} ({columns}; forward is C {}°; forward {}, back {}, up {} lm)",
        bug.rating,
        bug.forward_c_deg,
        list(&bug.forward_lm),
        list(&bug.back_lm),
        list(&bug.up_lm)
    )
}

fn zones(f: &mut fmt::Formatter<'_>, zones: &ZonalLumens) -> fmt::Result {
    let method = match &zones.mid_zone_width_deg {
        Figure::Is(width) => format!("zonal constants of {width}° zones"),
        Figure::No { not_available } => format!("by zonal constants not available: {not_available}"),
    };
    writeln!(
        f,
        "\nzonal lumens ({method})\n  {:>9} {:>11} {:>11} {:>10} {:>7}",
        "gamma", "mid-zone", "exact", "difference", "%"
    )?;
    let line = |f: &mut fmt::Formatter<'_>, zone: &Zone| {
        let optional =
            |value: Option<f64>, decimals: usize| value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"));
        let signed = |lm: f64| if lm.abs() < 0.05 { "0.0".to_owned() } else { format!("{lm:+.1}") };
        let difference = zone.difference_lm.map_or("-".to_owned(), signed);
        writeln!(
            f,
            "  {:>9} {:>11} {:>11.1} {difference:>10} {:>7}",
            format!("{}-{}", zone.from_deg, zone.to_deg),
            optional(zone.mid_zone_lm, 1),
            zone.exact_lm,
            optional(zone.percent_of_flux, 1)
        )
    };
    zones.zones.iter().try_for_each(|zone| line(f, zone))?;
    writeln!(f)?;
    zones.sums.iter().try_for_each(|zone| line(f, zone))
}

fn luminances(f: &mut fmt::Formatter<'_>, table: &Luminances) -> fmt::Result {
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
        row.cd_per_m2.iter().try_for_each(|figure| write!(f, " {:>10}", figure.told(|v| format!("{v:.0}"))))?;
        writeln!(f)?;
    }
    Ok(())
}

fn ugr(f: &mut fmt::Formatter<'_>, table: &Ugr) -> fmt::Result {
    let (crosswise, endwise) = (table.crosswise_c_deg, (table.crosswise_c_deg + 90.0) % 180.0);
    writeln!(
        f,
        "\nUGR, corrected, S/H {} (CIE 190); seen crosswise from C {crosswise}°, endwise from C {endwise}°",
        table.spacing_over_height
    )?;
    let percent = |of: fn(&Surfaces) -> f64| {
        table.reflectances.iter().map(|r| format!("{:>5.0}", 100.0 * of(r))).collect::<Vec<_>>().concat()
    };
    for (name, values) in
        [("ceiling", percent(|r| r.ceiling)), ("walls", percent(|r| r.walls)), ("plane", percent(|r| r.plane))]
    {
        writeln!(f, "  {name:<9}{values}  {values}")?;
    }
    let rating = |rating: &Option<f64>| rating.map_or(format!("{:>5}", "-"), |ugr| format!("{ugr:>5.1}"));
    let side = |ratings: &[Option<f64>; 5]| ratings.each_ref().map(rating).concat();
    let line = |f: &mut fmt::Formatter<'_>, room: &UgrRoom| {
        let name = format!("{}H x {}H", room.x_over_height, room.y_over_height);
        writeln!(f, "  {name:<9}{}  {}", side(&room.crosswise), side(&room.endwise))
    };
    table.rooms.iter().try_for_each(|room| line(f, room))
}
