//! Tables in the angles that files have: horizontal and vertical of types A and B.

use super::write::inverse;
use super::{Goniometer, LuminousIntensityDistribution};

/// A table as a file has it; of type C its angles are C and gamma.
pub(super) struct Filed {
    pub(super) goniometer: Goniometer,
    pub(super) horizontal_deg: Vec<f64>,
    pub(super) vertical_deg: Vec<f64>,
    /// `candela[horizontal][vertical]`.
    pub(super) candela: Vec<Vec<f64>>,
}

impl Filed {
    pub(super) fn of_type_c(table: &LuminousIntensityDistribution) -> Self {
        let candela = (0..table.c_deg().len()).map(|c| table.plane(c).to_vec()).collect();
        let (horizontal_deg, vertical_deg) = (table.c_deg().to_vec(), table.gamma_deg().to_vec());
        Self { goniometer: Goniometer::C, horizontal_deg, vertical_deg, candela }
    }

    /// In its own type; `None` where its angles are not within what that has.
    pub(super) fn of(table: &LuminousIntensityDistribution) -> Option<Self> {
        let goniometer = table.goniometer();
        let [horizontal_deg, vertical_deg] = table.file_angles_deg();
        let (columns, rows) = (0..table.c_deg().len(), 0..table.gamma_deg().len());
        let (h_most, v_most, candela) = match goniometer {
            Goniometer::C => return Some(Self::of_type_c(table)),
            Goniometer::A => (180.0, 90.0, columns.rev().map(|c| table.plane(c).to_vec()).collect()),
            Goniometer::B => {
                let row = |g: usize| columns.clone().map(|c| table.plane(c)[g]).collect();
                (90.0, 180.0, rows.map(row).collect())
            }
        };
        let is_within = |angles: &[f64], most: f64| angles.iter().all(|angle| angle.abs() <= most);
        let all = is_within(&horizontal_deg, h_most) && is_within(&vertical_deg, v_most);
        all.then_some(Self { goniometer, horizontal_deg, vertical_deg, candela })
    }

    /// Without the negative horizontal angles of types A and B, where they mirror the positive ones.
    pub(super) fn halved(self) -> Self {
        let (h, rows) = (&self.horizontal_deg, &self.candela);
        let mirrors = h.iter().zip(h.iter().rev()).all(|(a, b)| *a == -*b) && rows.iter().eq(rows.iter().rev());
        let zero = h.iter().position(|h| *h == 0.0).filter(|_| mirrors && h.len() > 1);
        let Some(zero) = zero.filter(|_| self.goniometer != Goniometer::C) else { return self };
        let horizontal_deg = h[zero..].to_vec();
        Self { horizontal_deg, candela: rows[zero..].to_vec(), ..self }
    }
}

impl LuminousIntensityDistribution {
    /// Horizontal and vertical angles of the file in degrees: of type C, C and gamma. Halves that mirror each other are both there.
    pub fn file_angles_deg(&self) -> [Vec<f64>; 2] {
        // The angle from the horizontal that is read as this one from the axis.
        let from_horizontal = || self.gamma_deg().iter().map(|g| inverse(*g, g - 90.0, |x| 90.0 + x)).collect();
        match self.goniometer() {
            Goniometer::C => [self.c_deg().to_vec(), self.gamma_deg().to_vec()],
            Goniometer::A => [self.c_deg().iter().rev().map(|c| -c).collect(), from_horizontal()],
            Goniometer::B => [from_horizontal(), self.c_deg().to_vec()],
        }
    }
}
