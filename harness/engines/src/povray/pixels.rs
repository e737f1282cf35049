//! POV-Ray's pixels read back as illuminance: pure decoding, with a check that every disc was seen.
//!
//! A meter's disc shows x = E / scale three times in one pixel: red .25 + x/2, green 16 x, blue 256 x. Once E is known
//! to a thousandth, it shows the deviation y = E / expected - 1 instead: red .75 + y/2, green .5 + 500 y, blue .25. The
//! offsets are light that only a disc emits: a pixel without them has missed its disc and seen a wall.

use std::cmp::Ordering;

/// What a disc shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Readout {
    /// Illuminance over this scale, in lux.
    Coarse(f64),
    /// Deviation from this illuminance, in lux.
    Fine(f64),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PixelValue {
    /// An illuminance in lux and half the step of the channel it came from.
    Value {
        lx: f64,
        resolution_lx: f64,
    },
    /// More than the scale can show.
    Above,
    /// Less than the finest channel resolves; at most this, in lux.
    Below(f64),
    Missed,
}

impl PixelValue {
    /// What several pictures of one disc show at most.
    pub(super) fn brightest(pictures: impl Iterator<Item = Self>) -> Self {
        let brightest = pictures.max_by(|a, b| a.rank().partial_cmp(&b.rank()).unwrap_or(Ordering::Equal));
        brightest.unwrap_or(Self::Missed)
    }

    /// Its place in the order of brightness: the kind, then the illuminance within a kind.
    const fn rank(&self) -> (u8, f64) {
        match *self {
            Self::Missed => (3, 0.0),
            Self::Above => (2, 0.0),
            Self::Value { lx, .. } => (1, lx),
            Self::Below(lx) => (0, lx),
        }
    }
}

pub(super) fn decode(readout: Readout, [red, green, blue]: [f64; 3]) -> PixelValue {
    match readout {
        Readout::Coarse(scale) => coarse(scale, red, green, blue),
        Readout::Fine(expected) => fine(expected, red, green, blue),
    }
}

fn coarse(scale: f64, red: f64, green: f64, blue: f64) -> PixelValue {
    if red >= CLIPPED {
        // White: nothing distinguishes a disc from a bright wall, and a second look decides.
        return if green >= CLIPPED && blue >= CLIPPED { PixelValue::Above } else { PixelValue::Missed };
    }
    let (x, gain) = [(blue, 256.0), (green, 16.0)]
        .into_iter()
        .find(|(level, _)| *level < CLIPPED)
        .map_or((2.0 * (red - 0.25), 0.5), |(level, gain)| (level / gain, gain));
    // Red tells the same value by its own offset.
    if (red - 0.25 - 0.5 * x).abs() > 2.0 / FULL + 1e-3 * x {
        return PixelValue::Missed;
    }
    if blue < FAINT {
        return PixelValue::Below(scale * (blue + 1.0 / FULL) / 256.0);
    }
    PixelValue::Value { lx: scale * x, resolution_lx: scale * 0.5 / FULL / gain }
}

fn fine(expected: f64, red: f64, green: f64, blue: f64) -> PixelValue {
    if (blue - 0.25).abs() > 2.0 / FULL {
        return PixelValue::Missed;
    }
    if red >= CLIPPED {
        return PixelValue::Above;
    }
    let within = green > 1.0 - CLIPPED && green < CLIPPED;
    let (y, gain) = if within { ((green - 0.5) / 500.0, 500.0) } else { (2.0 * (red - 0.75), 0.5) };
    if (red - 0.75 - 0.5 * y).abs() > 2.0 / FULL {
        return PixelValue::Missed;
    }
    PixelValue::Value { lx: expected * (1.0 + y), resolution_lx: expected * 0.5 / FULL / gain }
}

const FULL: f64 = 65535.0;
/// A channel at or above this may have been cut off.
const CLIPPED: f64 = 65500.0 / FULL;
/// A blue channel below this has too few steps to be a measure.
const FAINT: f64 = 64.0 / FULL;

#[cfg(test)]
mod tests {
    use super::*;

    fn quantised(rgb: [f64; 3]) -> [f64; 3] {
        rgb.map(|v| (v.clamp(0.0, 1.0) * FULL).round() / FULL)
    }

    #[test]
    fn what_a_disc_shows_is_read_back_within_the_stated_resolution() {
        for x in [1.2, 0.3, 0.05, 1e-3, 1e-5] {
            let PixelValue::Value { lx, resolution_lx } =
                decode(Readout::Coarse(40.0), quantised([0.25 + x / 2.0, 16.0 * x, 256.0 * x]))
            else {
                panic!("{x} was not read")
            };
            assert!((lx - 40.0 * x).abs() <= resolution_lx * 1.001, "{x}: {lx}");
        }
        for y in [0.2, 3e-4, -3e-4, 0.0, -0.9] {
            let seen = decode(Readout::Fine(7.0), quantised([0.75 + y / 2.0, 0.5 + 500.0 * y, 0.25]));
            let PixelValue::Value { lx, resolution_lx } = seen else { panic!("{y} was not read") };
            assert!((lx - 7.0 * (1.0 + y)).abs() <= resolution_lx * 1.001, "{y}: {lx}");
        }
    }

    #[test]
    fn darkness_and_too_much_light_are_not_values() {
        assert!(matches!(decode(Readout::Coarse(1.0), [0.25, 0.0, 0.0]), PixelValue::Below(_)));
        assert_eq!(decode(Readout::Coarse(1.0), [1.0, 1.0, 1.0]), PixelValue::Above);
        assert_eq!(decode(Readout::Fine(1.0), quantised([1.5, 1.0, 0.25])), PixelValue::Above);
    }

    #[test]
    fn a_pixel_that_missed_its_disc_differs_from_every_grey_wall() {
        for grey in [0.0, 0.1, 0.25, 0.5, 0.9] {
            assert_eq!(decode(Readout::Coarse(1.0), [grey; 3]), PixelValue::Missed, "{grey}");
            assert_eq!(decode(Readout::Fine(1.0), [grey; 3]), PixelValue::Missed, "{grey}");
        }
    }
}
