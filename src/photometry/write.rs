//! What writing a photometric file yields: its text, and in words whatever the format could not hold.

use std::fmt::Write as _;

use super::details::{Details, Lm63Details};
use super::{Photometry, ReadError};

/// A photometric file as text, and what is lost in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file, lines ended by CR LF.
    pub text: String,
    /// What reading the text again does not give back, one sentence each; empty where it gives back everything.
    pub losses: Vec<String>,
}

impl Written {
    /// Reads the text back and states every difference.
    pub(super) fn checked(
        original: &Photometry,
        text: String,
        read: impl FnOnce(&[u8]) -> Result<Photometry, ReadError>,
    ) -> Self {
        let losses = match read(text.as_bytes()) {
            Ok(again) => losses(original, &again),
            Err(error) => vec![format!("the written file cannot be read: {error}")],
        };
        Self { text, losses }
    }
}

/// Every difference between what was written and what was read back.
fn losses(original: &Photometry, again: &Photometry) -> Vec<String> {
    let mut losses = vec![];
    if original.distribution != again.distribution {
        losses.push(distribution_loss(original, again));
    }
    if original.lamp_lumens != again.lamp_lumens {
        losses.push(format!("lamp lumens {:?} became {:?}", original.lamp_lumens, again.lamp_lumens));
    }
    if original.opening != again.opening {
        losses.push(format!("the luminous opening {:?} became {:?}", original.opening, again.opening));
    }
    if original.input_watts != again.input_watts {
        losses.push(format!("input watts {:?} became {:?}", original.input_watts, again.input_watts));
    }
    keyword_losses(original, again, &mut losses);
    detail_losses(original, again, &mut losses);
    losses
}

fn distribution_loss(original: &Photometry, again: &Photometry) -> String {
    let (before, after) = (&original.distribution, &again.distribution);
    if (before.c_deg(), before.gamma_deg()) != (after.c_deg(), after.gamma_deg()) {
        let (planes, now) = (before.c_deg().len(), after.c_deg().len());
        return format!("{planes} C planes ({:?}) became {now} ({:?})", before.symmetry(), after.symmetry());
    }
    let planes = 0..before.c_deg().len();
    let deviation = |c| before.plane(c).iter().zip(after.plane(c)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let worst = planes.map(deviation).fold(0.0, f64::max);
    format!("intensities changed by up to {worst:e} cd in rounding")
}

fn keyword_losses(original: &Photometry, again: &Photometry, losses: &mut Vec<String>) {
    if original.keywords == again.keywords {
        return;
    }
    let lamp_kind = match &again.details {
        Details::Eulumdat(details) => details.lamp_sets.first().map(|set| set.kind.as_str()),
        Details::None | Details::Lm63(_) => None,
    };
    let mut rest: Vec<&(String, String)> = again.keywords.iter().collect();
    let mut lost = vec![];
    for keyword in &original.keywords {
        if let Some(k) = rest.iter().position(|other| *other == keyword) {
            rest.remove(k);
        } else if !(keyword.0 == "LAMP" && lamp_kind == Some(&keyword.1)) {
            lost.push(if keyword.0.is_empty() { "a label line".into() } else { format!("[{}]", keyword.0) });
        }
    }
    losses.push(if lost.is_empty() {
        "keywords were added or their order changed".into()
    } else {
        format!("keywords lost or changed: {}", lost.join(", "))
    });
}

fn detail_losses(original: &Photometry, again: &Photometry, losses: &mut Vec<String>) {
    match (&original.details, &again.details) {
        (Details::Lm63(before), Details::Lm63(after)) => {
            // The edition is what was asked for.
            let before = Lm63Details { edition: after.edition, ..before.clone() };
            if before.goniometer != after.goniometer {
                losses.push(format!("a table of type {:?} was written as type C", before.goniometer));
            }
            if (before.lamps, before.lumens_per_lamp) != (after.lamps, after.lumens_per_lamp) {
                losses.push(format!("{} lamps became {}", before.lamps, after.lamps));
            }
            if before.file_generation_type != after.file_generation_type {
                losses.push(format!("the file generation type {} was dropped", before.file_generation_type));
            }
            if before.tilt != after.tilt {
                losses.push("the tilt factors changed".into());
            }
        }
        (Details::Eulumdat(before), Details::Eulumdat(after)) => {
            if before != after {
                losses.push("fields that only EULUMDAT has changed".into());
            }
        }
        (Details::Lm63(before), _) => {
            if before.tilt.is_some() {
                losses.push("the tilt factors were dropped".into());
            }
        }
        (Details::Eulumdat(_), _) => losses.push(
            "dropped: luminaire dimensions, declared ratios, direct ratios, tilt and all but the first lamp set".into(),
        ),
        (Details::None, _) => {}
    }
}

/// A number in the shortest decimal form that reads back as itself.
pub(super) fn number(value: f64) -> String {
    // Minus zero would survive, and surprise.
    if value == 0.0 { "0".into() } else { value.to_string() }
}

/// A number `x`, as short in decimals as may be, that `forward` takes exactly to `target`; else the nearest.
pub(super) fn inverse(target: f64, estimate: f64, forward: impl Fn(f64) -> f64) -> f64 {
    let rounded = (0..17).filter_map(|digits| {
        let mut text = String::new();
        write!(text, "{estimate:.digits$e}").ok()?;
        text.parse::<f64>().ok()
    });
    let neighbours =
        [estimate.next_up(), estimate.next_down(), estimate.next_up().next_up(), estimate.next_down().next_down()];
    rounded.chain(neighbours).find(|x| forward(*x) == target).unwrap_or(estimate)
}

/// Numbers in lines of at most 128 characters, which every edition and reader allows.
pub(super) fn lines(values: impl IntoIterator<Item = f64>) -> String {
    let mut text = String::new();
    let mut width = 0;
    for value in values {
        let number = number(value);
        if width > 0 && width + 1 + number.len() > 128 {
            text.push_str("\r\n");
            width = 0;
        }
        if width > 0 {
            text.push(' ');
            width += 1;
        }
        width += number.len();
        text.push_str(&number);
    }
    text.push_str("\r\n");
    text
}

/// Text that fits one line.
pub(super) fn one_line(text: &str) -> String {
    text.split(['\r', '\n']).map(str::trim).collect::<Vec<_>>().join(" ").trim().to_string()
}
