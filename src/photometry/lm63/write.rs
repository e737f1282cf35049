//! Writer of LM-63-2002 and LM-63-2019 files: type C, metres, all multipliers one.

use super::opening::to_dimensions;
use super::{Edition, Lm63Details, Tilt, parse};
use crate::photometry::write::{lines, number, one_line};
use crate::photometry::{Details, Photometry, Written};

/// Writes ANSI/IESNA LM-63-02.
pub fn write_2002(photometry: &Photometry) -> Written {
    write(photometry, Edition::Lm63_2002)
}

/// Writes ANSI/IES LM-63-19.
pub fn write_2019(photometry: &Photometry) -> Written {
    write(photometry, Edition::Lm63_2019)
}

fn write(photometry: &Photometry, edition: Edition) -> Written {
    let mut text = String::new();
    if let Some(first) = edition.first_line() {
        text.push_str(first);
        text.push_str("\r\n");
    }
    keywords(photometry, &mut text);
    let details = details(photometry, edition);
    match &details.tilt {
        None => text.push_str("TILT=NONE\r\n"),
        Some(tilt) => tilt_records(tilt, &mut text),
    }
    let distribution = &photometry.distribution;
    let (c_deg, gamma_deg) = (distribution.c_deg(), distribution.gamma_deg());
    // A shape that the format lacks becomes its bounding box; the check below says so.
    let [width, length, height] =
        to_dimensions(&photometry.opening).unwrap_or_else(|| photometry.opening.bounding_box_m()).map(number);
    let (lamps, lumens) = (details.lamps.to_string(), number(details.lumens_per_lamp));
    let (gammas, planes) = (gamma_deg.len().to_string(), c_deg.len().to_string());
    // Multiplier, type C, metres.
    let (multiplier, kind, units) = ("1".into(), "1".into(), "2".into());
    text.push_str(&[lamps, lumens, multiplier, gammas, planes, kind, units, width, length, height].join(" "));
    text.push_str("\r\n");
    text.push_str(&lines([1.0, details.file_generation_type, photometry.input_watts.unwrap_or(0.0)]));
    text.push_str(&lines(gamma_deg.iter().copied()));
    text.push_str(&lines(c_deg.iter().copied()));
    for plane in 0..c_deg.len() {
        text.push_str(&lines(distribution.plane(plane).iter().copied()));
    }
    Written::checked(photometry, text, parse)
}

fn keywords(photometry: &Photometry, text: &mut String) {
    let mut line = |key: &str, value: &str| {
        let mut values = value.split('\n').map(one_line);
        let key = one_line(key).replace(['[', ']'], "");
        let first = values.next().unwrap_or_default();
        text.push_str(format!("[{}] {first}", if key.is_empty() { "OTHER" } else { &key }).trim_end());
        text.push_str("\r\n");
        for more in values {
            text.push_str(format!("[MORE] {more}").trim_end());
            text.push_str("\r\n");
        }
    };
    for (key, value) in &photometry.keywords {
        line(key, value);
    }
    if let Details::Eulumdat(details) = &photometry.details
        && let Some(set) = details.lamp_sets.first()
        && !set.kind.is_empty()
        && photometry.keyword("LAMP").is_none()
    {
        line("LAMP", &set.kind);
    }
}

/// The file's own details where they still agree with the rest, else the plainest ones.
fn details(photometry: &Photometry, edition: Edition) -> Lm63Details {
    let plain = Lm63Details {
        edition,
        goniometer: super::Goniometer::C,
        lamps: 1,
        lumens_per_lamp: photometry.lamp_lumens.unwrap_or(-1.0),
        file_generation_type: 1.0,
        tilt: None,
    };
    match &photometry.details {
        Details::Lm63(details) => {
            let lumens = f64::from(details.lamps) * details.lumens_per_lamp;
            let agrees = match photometry.lamp_lumens {
                Some(lamp_lumens) => lumens == lamp_lumens,
                None => details.lumens_per_lamp < 0.0,
            };
            // 2002 reserves the field and wants 1 there.
            let file_generation_type = if edition == Edition::Lm63_2019 { details.file_generation_type } else { 1.0 };
            let tilt = details.tilt.clone();
            if agrees {
                Lm63Details { edition, file_generation_type, ..details.clone() }
            } else {
                Lm63Details { file_generation_type, tilt, ..plain }
            }
        }
        Details::Eulumdat(details) => {
            let lamps = details.lamp_sets.first().map_or(1, |set| set.lamps.unsigned_abs().max(1));
            match photometry.lamp_lumens {
                Some(lumens) if f64::from(lamps) * (lumens / f64::from(lamps)) == lumens => {
                    Lm63Details { lamps, lumens_per_lamp: lumens / f64::from(lamps), ..plain }
                }
                Some(_) => plain,
                None => Lm63Details { lamps, ..plain },
            }
        }
        Details::None => plain,
    }
}

fn tilt_records(tilt: &Tilt, text: &mut String) {
    text.push_str("TILT=INCLUDE\r\n");
    text.push_str(&lines([f64::from(tilt.geometry)]));
    text.push_str(&lines([tilt.angles_deg.len() as f64]));
    text.push_str(&lines(tilt.angles_deg.iter().copied()));
    text.push_str(&lines(tilt.factors.iter().copied()));
}
