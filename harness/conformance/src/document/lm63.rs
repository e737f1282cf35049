//! LM-63 files of the pack.

use luxproof_photometry::Goniometer;
use luxproof_photometry::lm63::Edition;

use super::{SQUARE_METRES_PER_SQUARE_FOOT, number, wrap};
use crate::mistake::{Mistake, Variant};
use crate::pack_file::PackFile;

/// The fields of an LM-63 file around its table.
#[derive(Clone, Debug)]
pub(crate) struct Lm63 {
    pub(crate) edition: Edition,
    pub(crate) lamps: u32,
    /// -1 for absolute photometry.
    pub(crate) lumens_per_lamp: f64,
    pub(crate) multiplier: f64,
    pub(crate) ballast_factor: f64,
    /// The number behind the ballast factor: its meaning depends on the edition.
    pub(crate) third_number: f64,
    pub(crate) tilt: Tilt,
    /// Whether the dimensions are in feet.
    pub(crate) is_in_feet: bool,
    /// Width along C 90, length along C 0, height, in the unit of the file.
    pub(crate) dimensions: [f64; 3],
    pub(crate) layout: Layout,
}

/// Tilt factors, the same at every angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tilt {
    None,
    /// `TILT=INCLUDE` with 0.8 at 0, 45 and 90 degrees.
    Included,
}

/// The tilt factor of every angle.
const TILT_FACTOR: f64 = 0.8;

/// How the lines of a file are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    Usual,
    /// Numbers of a record over several lines, and lines that end within a plane.
    Wrapped,
    /// Keywords with text that looks like other lines.
    MisleadingKeywords,
}

impl Default for Lm63 {
    fn default() -> Self {
        Self {
            edition: Edition::Lm63_2002,
            lamps: 1,
            lumens_per_lamp: -1.0,
            multiplier: 1.0,
            ballast_factor: 1.0,
            third_number: 1.0,
            tilt: Tilt::None,
            is_in_feet: false,
            // A point: renderers that light from the opening answer the intensities themselves.
            dimensions: [0.0; 3],
            layout: Layout::Usual,
        }
    }
}

impl Lm63 {
    /// Candela per number of the table for a reader with these mistakes.
    pub(super) fn factor(&self, mistakes: &[Mistake], variant: Option<Variant>) -> f64 {
        let mut factor = 1.0;
        if !mistakes.contains(&Mistake::MultiplierIgnored) {
            factor *= self.multiplier;
        }
        if !mistakes.contains(&Mistake::BallastFactorIgnored) {
            factor *= self.ballast_factor;
        }
        let applies_third_number = match self.edition {
            Edition::Lm63_1986 | Edition::Lm63_1991 => !mistakes.contains(&Mistake::BallastLampFactorIgnored),
            Edition::Lm63_1995 | Edition::Lm63_2002 => variant == Some(Variant::ThirdNumberApplied),
            Edition::Lm63_2019 => mistakes.contains(&Mistake::FileGenerationApplied),
        };
        if applies_third_number {
            factor *= self.third_number;
        }
        if self.tilt == Tilt::Included && variant == Some(Variant::TiltApplied) {
            factor *= TILT_FACTOR;
        }
        if mistakes.contains(&Mistake::LampsMultiplied) {
            factor *= f64::from(self.lamps);
        }
        if mistakes.contains(&Mistake::LumensScaled) && self.lumens_per_lamp > 0.0 {
            factor *= f64::from(self.lamps) * self.lumens_per_lamp / 1000.0;
        }
        if mistakes.contains(&Mistake::MinusOneMultiplied) && self.lumens_per_lamp < 0.0 {
            factor *= self.lumens_per_lamp;
        }
        if mistakes.contains(&Mistake::FeetApplied) && self.is_in_feet {
            factor *= SQUARE_METRES_PER_SQUARE_FOOT;
        }
        factor
    }

    /// The dimensions in metres.
    pub(super) fn opening_m(&self) -> [f64; 3] {
        let metres = if self.is_in_feet { 0.3048 } else { 1.0 };
        self.dimensions.map(|extent| extent * metres)
    }

    /// The text of a file.
    pub(super) fn text(&self, file: &PackFile) -> String {
        let mut text = self.head(file);
        let table = &file.table;
        let kind = match table.goniometer {
            Goniometer::C => 1.0,
            Goniometer::B => 2.0,
            Goniometer::A => 3.0,
        };
        let counts = [table.vertical_deg.len() as f64, table.horizontal_deg.len() as f64];
        let units = if self.is_in_feet { 1.0 } else { 2.0 };
        let lamps = [f64::from(self.lamps), self.lumens_per_lamp, self.multiplier, counts[0], counts[1], kind, units];
        let factors = [self.ballast_factor, self.third_number, 50.0];
        if self.layout == Layout::Wrapped {
            let records = [&lamps[..], &self.dimensions, &factors, &table.vertical_deg, &table.horizontal_deg];
            for part in records.concat().chunks(4) {
                text += &wrap(part);
            }
            for row in table.rows() {
                text += &wrap(&row[..3]);
                text += &wrap(&row[3..]);
            }
            return text;
        }
        let record = [&lamps[..], &self.dimensions].concat();
        text += &wrap(&record);
        text += &wrap(&factors);
        text += &wrap(&table.vertical_deg);
        text += &wrap(&table.horizontal_deg);
        for row in table.rows() {
            text += &wrap(row);
        }
        text
    }

    /// The lines before the numbers.
    fn head(&self, file: &PackFile) -> String {
        let mut lines: Vec<String> = vec![];
        lines.extend(self.edition.first_line().map(str::to_owned));
        let [test, manufacturer] =
            if self.edition == Edition::Lm63_1986 { ["", ""] } else { ["[TEST] ", "[MANUFAC] "] };
        lines.push(format!("{test}luxproof conformance pack, {}", file.name));
        lines.push(format!("{manufacturer}luxproof"));
        if self.edition >= Edition::Lm63_2002 {
            lines.push("[TESTLAB] none: computed".into());
            lines.push("[ISSUEDATE] 2026-11-30".into());
        }
        if self.layout == Layout::MisleadingKeywords {
            lines.push("[OTHER] the line TILT=INCLUDE is not in this file".into());
            lines.push("[MORE] 1 1000 10 2 1 1 2 0 0 0".into());
        }
        match self.tilt {
            Tilt::None => lines.push("TILT=NONE".into()),
            Tilt::Included => {
                let factor = number(TILT_FACTOR);
                lines.push("TILT=INCLUDE".into());
                lines.extend(["1".into(), "3".into(), "0 45 90".into(), format!("{factor} {factor} {factor}")]);
            }
        }
        lines.join("\r\n") + "\r\n"
    }
}
