//! Tables in the angles of LM-63 and TM-33 files: horizontal and vertical for types A and B.

use super::write::invert;
use super::{Goniometer, LuminousIntensityDistribution};

/// A table in the angles and order of a file; for type C the angles are C and gamma.
pub(super) struct FileTable {
    pub(super) goniometer: Goniometer,
    pub(super) horizontal_deg: Vec<f64>,
    pub(super) vertical_deg: Vec<f64>,
    /// `candela[horizontal][vertical]`.
    pub(super) candela: Vec<Vec<f64>>,
}

impl FileTable {
    /// The table of a type C distribution.
    pub(super) fn from_type_c(table: &LuminousIntensityDistribution) -> Self {
        let candela = (0..table.c_deg().len()).map(|c| table.plane(c).to_vec()).collect();
        let (horizontal_deg, vertical_deg) = (table.c_deg().to_vec(), table.gamma_deg().to_vec());
        Self { goniometer: Goniometer::C, horizontal_deg, vertical_deg, candela }
    }

    /// The table in its native type; `None` where its angles are outside the range of that type.
    pub(super) fn from_distribution(table: &LuminousIntensityDistribution) -> Option<Self> {
        let goniometer = table.goniometer();
        let [horizontal_deg, vertical_deg] = table.file_angles_deg();
        let (columns, rows) = (0..table.c_deg().len(), 0..table.gamma_deg().len());
        let (h_most, v_most, candela) = match goniometer {
            Goniometer::C => return Some(Self::from_type_c(table)),
            Goniometer::A => (180.0, 90.0, columns.rev().map(|c| table.plane(c).to_vec()).collect()),
            Goniometer::B => {
                let transposed = rows.map(|g| columns.clone().map(|c| table.plane(c)[g]).collect());
                (90.0, 180.0, transposed.collect())
            }
        };
        let is_in_range = horizontal_deg.iter().all(|angle: &f64| angle.abs() <= h_most)
            && vertical_deg.iter().all(|angle: &f64| angle.abs() <= v_most);
        is_in_range.then_some(Self { goniometer, horizontal_deg, vertical_deg, candela })
    }

    /// The table without the negative horizontal angles of types A and B, where they mirror the positive ones.
    pub(super) fn without_mirrored_half(self) -> Self {
        let (h, rows) = (&self.horizontal_deg, &self.candela);
        let is_mirrored = h.iter().zip(h.iter().rev()).all(|(a, b)| *a == -*b) && rows.iter().eq(rows.iter().rev());
        let zero = h.iter().position(|h| *h == 0.0).filter(|_| is_mirrored && h.len() > 1);
        let Some(zero) = zero.filter(|_| self.goniometer != Goniometer::C) else { return self };
        let horizontal_deg = h[zero..].to_vec();
        Self { horizontal_deg, candela: rows[zero..].to_vec(), ..self }
    }
}

impl LuminousIntensityDistribution {
    /// Horizontal and vertical angles of the file in degrees; for type C, C and gamma. Mirrored halves are both included.
    pub fn file_angles_deg(&self) -> [Vec<f64>; 2] {
        match self.goniometer() {
            Goniometer::C => [self.c_deg().to_vec(), self.gamma_deg().to_vec()],
            Goniometer::A => {
                [self.c_deg().iter().rev().map(|c| -c).collect(), angles_from_horizontal(self.gamma_deg())]
            }
            Goniometer::B => [angles_from_horizontal(self.gamma_deg()), self.c_deg().to_vec()],
        }
    }
}

/// The angles from the horizontal that the reader takes back to exactly these angles from the axis.
fn angles_from_horizontal(from_axis_deg: &[f64]) -> Vec<f64> {
    from_axis_deg.iter().map(|g| invert(*g, g - 90.0, |x| 90.0 + x)).collect()
}
