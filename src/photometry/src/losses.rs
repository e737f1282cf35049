//! The losses of a written file: each difference between the photometry and what a reader gets back, with its cause.

use super::details::{Details, Edition, EulumdatDetails, Lm63Details, ThirdNumber};
use super::{FileFormat, LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry};

/// Finds every difference between a photometry and what a reader gets back, one sentence each.
pub(super) fn find_losses(original: &Photometry, again: &Photometry, format: FileFormat) -> Vec<String> {
    let mut losses = vec![];
    if original.distribution != again.distribution {
        distribution_losses(&original.distribution, &again.distribution, format, &mut losses);
    }
    if original.lamp_lumens != again.lamp_lumens {
        losses.push(format!("lamp lumens {:?} became {:?}", original.lamp_lumens, again.lamp_lumens));
    }
    if original.opening != again.opening {
        losses.push(opening_loss(&original.opening, &again.opening, format));
    }
    if original.input_watts != again.input_watts {
        losses.push(format!("input watts {:?} became {:?}", original.input_watts, again.input_watts));
    }
    keyword_losses(original, again, format, &mut losses);
    match &original.details {
        Details::Lm63(details) => lm63_losses(details, again, format, &mut losses),
        Details::Eulumdat(details) => eulumdat_losses(details, again, format, &mut losses),
        Details::None => {}
    }
    losses
}

/// The losses of a table: dropped planes, changes of its planes, and rounding.
fn distribution_losses(
    before: &LuminousIntensityDistribution,
    after: &LuminousIntensityDistribution,
    format: FileFormat,
    losses: &mut Vec<String>,
) {
    let name = format.name();
    if before.is_native() || after.is_native() {
        return native_losses(before, after, name, losses);
    }
    let (planes, written) = (before.c_deg().len(), after.c_deg().len());
    let is_open = before.symmetry() == Symmetry::None && before.plane(0) != before.plane(planes - 1);
    let closed = largest_difference(before.plane(0), before.plane(planes - 1));
    if is_open && after.plane(written - 1) == after.plane(0) {
        losses.push(format!(
            "the plane C 360 was dropped: {name} closes the circle with C 0, which differs from it by up to {closed:e} cd"
        ));
    } else if before.c_deg() != after.c_deg() && written == 1 {
        losses.push(format!(
            "the planes C 0 and C 360, which are one, were written as axial in {name}; the light is the same"
        ));
    } else if before.c_deg() != after.c_deg() {
        losses.push(format!(
            "the {planes} planes of a half were written out as {written} around the circle: {name} lists planes from C 0 \
             on, and the table has none there; the light is the same"
        ));
    }
    // Rounding shows at the planes of both. The dropped plane has its message above.
    let (full, again) = (before.full_circle(), after.full_circle());
    let shared =
        full.c_deg().iter().zip(again.c_deg()).take_while(|(a, b)| a == b && (!is_open || **a < 360.0)).count();
    let rounded = (0..shared).map(|c| largest_difference(full.plane(c), again.plane(c))).fold(0.0, f64::max);
    if rounded > 0.0 {
        losses.push(format!("intensities changed by up to {rounded:e} cd, which is the rounding of {name}'s numbers"));
    }
}

/// The losses of a table of type A or B.
fn native_losses(
    before: &LuminousIntensityDistribution,
    after: &LuminousIntensityDistribution,
    name: &str,
    losses: &mut Vec<String>,
) {
    let (largest_cd, share) = before.difference_from(after);
    let percent = 100.0 * largest_cd / before.max_intensity().value().max(f64::MIN_POSITIVE);
    let (kind, planes, gammas) = (before.goniometer(), after.c_deg().len(), after.gamma_deg().len());
    let became = if kind == after.goniometer() {
        format!("the table of type {kind:?} was rounded in the numbers of {name}, and differs")
    } else {
        format!("the table of type {kind:?} became {planes} C planes of {gammas} angles, which differ")
    };
    losses.push(format!(
        "{became} by up to {largest_cd:.2e} cd, {percent:.2} % of the largest intensity, and in {share:.1e} of the flux"
    ));
}

/// The largest difference of two planes in candela.
fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The change of an opening and its cause.
fn opening_loss(before: &LuminousOpening, after: &LuminousOpening, format: FileFormat) -> String {
    let name = format.name();
    let dimensions = before.bounding_box_m().into_iter().zip(after.bounding_box_m());
    let is_rounded = std::mem::discriminant(before) == std::mem::discriminant(after)
        && dimensions.into_iter().all(|(a, b)| (a - b).abs() <= 1e-12 * a.abs());
    let cause = match format {
        _ if is_rounded => format!("its dimensions are rounded in the units of {name}"),
        FileFormat::Eulumdat => "EULUMDAT has boxes of some width and upright round openings alone".to_owned(),
        FileFormat::Lm63(_) => format!("{name} has no signs for such a shape"),
        FileFormat::Tm33 => format!("{name} has the dimensions of the luminaire alone, not of its opening"),
    };
    format!("the luminous opening, {}, became {}: {cause}", describe_opening(before), describe_opening(after))
}

/// Shape and dimensions of an opening in words.
fn describe_opening(opening: &LuminousOpening) -> String {
    let shape = match opening {
        LuminousOpening::Point => return "a point".into(),
        LuminousOpening::Box { .. } => "a box",
        LuminousOpening::Ellipse { x_m, y_m, .. } if x_m == y_m => "a circle",
        LuminousOpening::Ellipse { .. } => "an ellipse",
        LuminousOpening::Ellipsoid { .. } => "an ellipsoid",
        LuminousOpening::LyingCylinder { .. } => "a lying cylinder",
    };
    // Rounded to a micrometre: dimensions in feet have many digits.
    let [width, length, height] = opening.bounding_box_m().map(|m| (m * 1e6).round() / 1e6);
    format!("{shape} of {length} m along C0, {width} m along C90 and {height} m high")
}

/// Whether two texts have the same words.
fn has_same_words(a: &str, b: &str) -> bool {
    a.split_whitespace().eq(b.split_whitespace())
}

/// The change of a keyword that the file does not give back, as the end of a sentence.
fn keyword_change(key: &str, value: &str, again: &Photometry, format: FileFormat) -> String {
    let name = format.name();
    let found = again.keywords.iter().find(|(other, _)| other == key).map(|(_, text)| text.as_str());
    let renamed =
        again.keywords.iter().find(|(other, text)| other != key && has_same_words(text, value) && !value.is_empty());
    match (found, renamed, format) {
        (Some(text), _, _) if has_same_words(text, value) => match format {
            FileFormat::Eulumdat => "its lines were joined: EULUMDAT has one".into(),
            FileFormat::Lm63(edition) if text.contains('\n') => {
                format!("broken into lines of at most {} characters, as {name} has it", edition.line_limit())
            }
            FileFormat::Lm63(_) | FileFormat::Tm33 => {
                format!("blanks between its words or lines are not kept in {name}")
            }
        },
        (Some(_), _, FileFormat::Eulumdat) => "given more than once, and EULUMDAT has one line for it".into(),
        (_, Some((other, _)), FileFormat::Lm63(Edition::Lm63_1986)) if key.is_empty() => {
            format!("written as [{other}]: as it stands it would be read otherwise")
        }
        (_, Some((other, _)), _) if key.is_empty() => {
            format!("written as [{other}]: {name} has no lines without keyword")
        }
        (_, Some((other, _)), _) => format!("written as [{other}]: {name} does not define it"),
        (_, None, FileFormat::Eulumdat) => "dropped: EULUMDAT has no line for it".into(),
        (_, None, FileFormat::Lm63(_) | FileFormat::Tm33) => format!("changed: {name} has no such name or text"),
    }
}

/// The losses of keywords, one sentence for each kind of change.
fn keyword_losses(original: &Photometry, again: &Photometry, format: FileFormat, losses: &mut Vec<String>) {
    if original.keywords == again.keywords {
        return;
    }
    let lamp_kind = match &again.details {
        Details::Eulumdat(details) => details.lamp_sets.first().map(|set| set.kind.as_str()),
        Details::None | Details::Lm63(_) => None,
    };
    let mut rest: Vec<&(String, String)> = again.keywords.iter().collect();
    // Each change with the names of the keywords that it concerns.
    let mut changes: Vec<(String, Vec<String>)> = vec![];
    for keyword in &original.keywords {
        if let Some(k) = rest.iter().position(|other| *other == keyword) {
            rest.remove(k);
        } else if !(keyword.0 == "LAMP" && lamp_kind == Some(&keyword.1)) {
            let change = keyword_change(&keyword.0, &keyword.1, again, format);
            let name = if keyword.0.is_empty() { "a label line".into() } else { format!("[{}]", keyword.0) };
            match changes.iter_mut().find(|(other, _)| *other == change) {
                Some((_, names)) => names.push(name),
                None => changes.push((change, vec![name])),
            }
        }
    }
    let unchanged = original.keywords.iter().filter(|keyword| again.keywords.contains(keyword));
    let unchanged_again = again.keywords.iter().filter(|keyword| original.keywords.contains(keyword));
    if changes.is_empty() && !unchanged.eq(unchanged_again) {
        losses.push(format!("keywords stand in the order of {}", format.name()));
    }
    losses.extend(changes.into_iter().map(|(change, names)| format!("{} {change}", names.join(", "))));
}

/// The losses of the fields that only LM-63 has.
fn lm63_losses(before: &Lm63Details, again: &Photometry, format: FileFormat, losses: &mut Vec<String>) {
    let name = format.name();
    let after = if let Details::Lm63(details) = &again.details { Some(details) } else { None };
    match before.third_number {
        ThirdNumber::FileGeneration(value)
            if value != 1.0 && after.map(|a| a.third_number) != Some(before.third_number) =>
        {
            losses.push(format!("the file generation type {value} was dropped: {name} has no field for it"));
        }
        ThirdNumber::Reserved(value) if value != 1.0 => {
            let edition = before.edition.name();
            losses.push(format!(
                "the number {value} behind the ballast factor was dropped: {edition} reserves the field, so that it means nothing"
            ));
        }
        _ => {}
    }
    if let Some(after) = after
        && (before.lamps, before.lumens_per_lamp) != (after.lamps, after.lumens_per_lamp)
    {
        losses.push(format!("{} lamps became {}", before.lamps, after.lamps));
    }
    if after.is_none() && format == FileFormat::Tm33 && before.lamps != 1 {
        losses
            .push(format!("that there are {} lamps was dropped: {name} was given their lumens together", before.lamps));
    }
    match (&before.tilt, after.map(|after| &after.tilt)) {
        (Some(_), None) => losses.push(format!("the tilt factors were dropped: {name} has none")),
        (before, Some(after)) if before != after => losses.push("the tilt factors changed".into()),
        _ => {}
    }
}

/// The losses of the fields that only EULUMDAT has, where the file fills them in.
fn eulumdat_losses(before: &EulumdatDetails, again: &Photometry, format: FileFormat, losses: &mut Vec<String>) {
    if let Details::Eulumdat(after) = &again.details {
        if before != after.as_ref() {
            losses.push("fields that only EULUMDAT has changed".into());
        }
        return;
    }
    let set = before.lamp_sets.first();
    let [c0, rest @ ..] = before.luminous_heights_mm;
    let others = before.lamp_sets.len().saturating_sub(1);
    let fields: [(bool, String); 8] = [
        (before.luminaire_mm != [0.0; 3], "the luminaire's dimensions".into()),
        (rest != [c0; 3], "luminous heights that differ from side to side (the largest is kept)".into()),
        (before.downward_flux_percent != 0.0, "the declared downward flux fraction".into()),
        (before.output_ratio_percent != 0.0, "the declared light output ratio".into()),
        (before.direct_ratios != [0.0; 10], "direct ratios".into()),
        (before.measured_tilt_deg != 0.0, "the tilt during measurement".into()),
        (set.is_some_and(|set| !(set.colour.is_empty() && set.rendering.is_empty())), "the lamps' colour".into()),
        (others > 0, format!("{others} of {} lamp sets", before.lamp_sets.len())),
    ];
    let filled: Vec<String> = fields.into_iter().filter(|(is_filled, _)| *is_filled).map(|(_, field)| field).collect();
    if !filled.is_empty() {
        losses.push(format!("dropped, since {} has no fields for them: {}", format.name(), filled.join(", ")));
    }
}
