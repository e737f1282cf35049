//! EULUMDAT files of the pack.

use super::number;
use crate::mistake::{Mistake, Variant};
use crate::pack_file::PackFile;
use crate::table::{Table, round_to};

/// The fields of a EULUMDAT file around its table.
#[derive(Clone, Debug)]
pub(crate) struct Eulumdat {
    /// Isym: 0 none, 1 about the vertical axis, 2 in C 0 - C 180, 3 in C 90 - C 270, 4 in both.
    pub(crate) symmetry: u8,
    pub(crate) conversion_factor: f64,
    pub(crate) sets: Vec<LampSet>,
}

/// A set of lamps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LampSet {
    /// Negative for absolute photometry.
    pub(crate) lamps: i32,
    /// Of all its lamps together.
    pub(crate) lumens: f64,
}

impl LampSet {
    pub(crate) fn new(lamps: i32, lumens: f64) -> Self {
        Self { lamps, lumens }
    }
}

/// The C planes that every file lists.
const LISTED_PLANES: u32 = 8;
const PLANE_STEP_DEG: f64 = 45.0;

/// The luminous area in metres along C 90, along C 0 and upwards: the length of a EULUMDAT luminaire lies along C 90.
pub(super) const OPENING_M: [f64; 3] = [0.5, 0.2, 0.0];

impl Eulumdat {
    /// A file of one lamp of 8000 lm.
    pub(crate) fn with_symmetry(symmetry: u8) -> Self {
        Self { symmetry, conversion_factor: 1.0, sets: vec![LampSet::new(1, 8000.0)] }
    }

    /// Candela per number of the table for a reader with these mistakes.
    pub(super) fn factor(&self, table: &Table, mistakes: &[Mistake], variant: Option<Variant>) -> f64 {
        let (first, last) = (self.sets[0], self.sets[self.sets.len() - 1]);
        let lumens = match variant {
            Some(Variant::LastLampSet) => last.lumens,
            Some(Variant::LampSetsSummed) => self.sets.iter().map(|set| set.lumens).sum(),
            _ => first.lumens,
        };
        let mut factor = if mistakes.contains(&Mistake::LumensNotScaled) { 1.0 } else { lumens / 1000.0 };
        if !mistakes.contains(&Mistake::ConversionFactorIgnored) {
            factor *= self.conversion_factor;
        }
        if mistakes.contains(&Mistake::LampsMultiplied) {
            factor *= f64::from(first.lamps.unsigned_abs());
        }
        if mistakes.contains(&Mistake::MinusOneMultiplied) && first.lamps < 0 {
            factor *= f64::from(first.lamps);
        }
        let (downward, output) = self.ratios_percent(table);
        if mistakes.contains(&Mistake::OutputRatioApplied) {
            factor *= output / 100.0;
        }
        if mistakes.contains(&Mistake::DownwardFractionApplied) {
            factor *= downward / 100.0;
        }
        factor
    }

    /// Downward flux fraction and light output ratio in percent.
    pub(crate) fn ratios_percent(&self, table: &Table) -> (f64, f64) {
        let whole = table.solid_integral();
        let below = table.below_horizon().solid_integral();
        // A table in cd/klm integrates to lumens per kilolumen.
        let output = 100.0 * whole.linear * whole.copies * self.conversion_factor / 1000.0;
        (round_to(100.0 * below.linear / whole.linear, 1), round_to(output, 1))
    }

    /// The text of a file with this table.
    pub(super) fn text(&self, file: &PackFile, table: &Table) -> String {
        let step = table.vertical_deg[1] - table.vertical_deg[0];
        let kind = if self.symmetry == 1 { 1 } else { 3 };
        let mut lines = vec!["luxproof".into(), kind.to_string(), self.symmetry.to_string()];
        lines.extend([LISTED_PLANES.to_string(), number(PLANE_STEP_DEG), table.vertical_deg.len().to_string()]);
        lines.extend([number(step), "none: computed".into(), "luxproof conformance pack".into(), "1".into()]);
        lines.extend([file.name.into(), "2026-11-30".into()]);
        // The luminaire, its luminous area, and four luminous heights, in millimetres.
        lines.extend(["500", "200", "100", "500", "200", "0", "0", "0", "0"].map(String::from));
        let (downward, output) = self.ratios_percent(table);
        lines.extend([number(downward), number(output), number(self.conversion_factor), "0".into()]);
        lines.push(self.sets.len().to_string());
        for set in &self.sets {
            lines.extend([set.lamps.to_string(), "LED".into(), number(set.lumens), "3000".into()]);
            lines.extend(["80".into(), "50".into()]);
        }
        // Direct ratios: unknown.
        lines.extend(std::iter::repeat_n("0".to_string(), 10));
        lines.extend((0..LISTED_PLANES).map(|k| number(f64::from(k) * PLANE_STEP_DEG)));
        lines.extend(table.vertical_deg.iter().map(|gamma| number(*gamma)));
        // The plane 360 closes the circle and is not in the file.
        for (c, row) in table.horizontal_deg.iter().zip(table.rows()) {
            if *c < 360.0 {
                lines.extend(row.iter().map(|value| number(*value)));
            }
        }
        lines.join("\r\n") + "\r\n"
    }
}
