//! What follows from a comparison by itself.

use super::{Basis, Comparison};

impl Comparison {
    pub fn basis(&self) -> Option<Basis> {
        self.reference.as_ref().map(|r| r.basis)
    }

    pub fn basis_name(&self) -> &'static str {
        self.basis().map_or("none", Basis::name)
    }

    /// How far the reading may lie off, in its quantity's unit.
    pub fn allowed(&self) -> f64 {
        self.reference.as_ref().map_or(0.0, |r| self.tolerance.around(r.value))
    }

    /// The deviation over what is allowed; `None` where there is no deviation, or one that nothing is allowed of.
    pub fn normalized_error(&self) -> Option<f64> {
        match self.deviation? {
            0.0 => Some(0.0),
            deviation => Some(deviation / self.allowed()).filter(|e| e.is_finite()),
        }
    }
}
