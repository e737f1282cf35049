//! A photometric file of the pack: its table, its other fields, and the directions in which it is asked.

use glam::DVec3;
use luxproof_photometry::{Goniometer, angles_deg, direction};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::closed_form::ClosedForm;
use crate::document::Document;
use crate::mistake::Variant;
use crate::table::{Table, direction_of, round_to};

/// A photometric file and what is asked of its readers.
#[derive(Clone, Debug)]
pub struct PackFile {
    /// The name with its extension.
    pub name: &'static str,
    /// What the file provokes, in one sentence.
    pub feature: &'static str,
    pub(crate) form: ClosedForm,
    pub(crate) table: Table,
    pub(crate) document: Document,
    pub(crate) directions: Vec<AskedDirection>,
    /// The choices that readers have in this file, where no standard decides. The first is the one of `candela`.
    pub(crate) variants: Vec<Variant>,
}

/// A direction in the frame of the luminaire.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AskedDirection {
    pub(crate) c_deg: f64,
    pub(crate) gamma_deg: f64,
    /// H and V of a table of type A or B.
    pub(crate) own_deg: Option<(f64, f64)>,
    pub(crate) place: Place,
}

/// Where a direction is in the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// On a node of the table, or beyond its end: one answer is right.
    Exact,
    /// Between nodes: the interpolation decides.
    Between,
}

impl AskedDirection {
    pub(crate) const fn exact(c_deg: f64, gamma_deg: f64) -> Self {
        Self { c_deg, gamma_deg, own_deg: None, place: Place::Exact }
    }

    pub(crate) const fn between(c_deg: f64, gamma_deg: f64) -> Self {
        Self { c_deg, gamma_deg, own_deg: None, place: Place::Between }
    }

    /// A node of a table of type A or B.
    pub(crate) fn native(goniometer: Goniometer, h_deg: f64, v_deg: f64) -> Self {
        let (c, gamma) = angles_deg(direction_of(goniometer, h_deg, v_deg));
        let (c_deg, gamma_deg) = (round_to(c, 9), round_to(gamma, 9));
        Self { c_deg: c_deg.rem_euclid(360.0), gamma_deg, own_deg: Some((h_deg, v_deg)), place: Place::Exact }
    }

    /// The unit vector.
    pub(crate) fn vector(&self) -> DVec3 {
        direction(self.c_deg, self.gamma_deg)
    }
}

impl PackFile {
    /// Candela per number of the table.
    pub(crate) fn factor(&self) -> f64 {
        self.document.factor(&self.table, &[], None)
    }

    /// The largest intensity in candela.
    pub(crate) fn peak_cd(&self) -> f64 {
        self.table.max() * self.factor()
    }

    /// How far an answer may be off, in candela: room for numbers in single precision and textures of 16 bits.
    pub(crate) fn tolerance_cd(&self) -> f64 {
        1e-3 * self.peak_cd()
    }

    /// The bytes of the file.
    pub fn bytes(&self) -> Result<Vec<u8>, zip::result::ZipError> {
        self.document.bytes(self)
    }
}
