//! Colour scales that keep their order without colour vision: cividis for amounts, purple to orange for deviations.
//!
//! Cividis: Nuñez, Anderton, Renslow, PLOS ONE 13 (2018) e0199239, nine of its colours; purple to orange: Brewer's `PuOr`.

type Rgb = [f64; 3];

const AMOUNTS: [u32; 9] = [0x00224e, 0x123570, 0x3b496c, 0x575d6d, 0x707173, 0x8a8678, 0xa59c74, 0xc3b369, 0xfee838];
const DEVIATIONS: [u32; 7] = [0x542788, 0x998ec3, 0xd8daeb, 0xf7f7f7, 0xfee0b6, 0xf1a340, 0xb35806];

/// The colour of an amount from 0 to 1.
pub(super) fn amount(part: f64) -> String {
    between(&AMOUNTS, part)
}

/// The colour of a deviation from -1 to 1.
pub(super) fn deviation(part: f64) -> String {
    between(&DEVIATIONS, 0.5 + 0.5 * part)
}

fn between(colours: &[u32], part: f64) -> String {
    let place = part.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let k = (place as usize).min(colours.len() - 2);
    let (a, b, t) = (channels(colours[k]), channels(colours[k + 1]), place - k as f64);
    let mixed = [0, 1, 2].map(|i| (a[i] + t * (b[i] - a[i])).round() as u8);
    format!("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2])
}

fn channels(colour: u32) -> Rgb {
    [16, 8, 0].map(|shift| f64::from((colour >> shift) & 0xff))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_and_the_middle_are_the_published_colours() {
        assert_eq!([amount(0.0), amount(1.0), amount(0.5)], ["#00224e", "#fee838", "#707173"]);
        assert_eq!([deviation(-1.0), deviation(0.0), deviation(9.0)], ["#542788", "#f7f7f7", "#b35806"]);
    }
}
