//! TM-33 files of the pack.

use luxproof_photometry::Goniometer;

use super::number;
use crate::mistake::Mistake;
use crate::pack_file::PackFile;
use crate::table::PlaneLayout;

/// The fields of a TM-33 file around its table.
#[derive(Clone, Debug)]
pub(crate) struct Tm33 {
    pub(crate) multiplier: f64,
    /// Rated lumens of relative photometry; absolute photometry has none.
    pub(crate) rated_lumens: Option<f64>,
}

impl Tm33 {
    /// Candela per number of the table for a reader with these mistakes.
    pub(super) fn factor(&self, mistakes: &[Mistake]) -> f64 {
        let mut factor = if mistakes.contains(&Mistake::MultiplierIgnored) { 1.0 } else { self.multiplier };
        if let Some(lumens) = self.rated_lumens.filter(|_| mistakes.contains(&Mistake::LumensScaled)) {
            factor *= lumens / 1000.0;
        }
        factor
    }

    /// The text of a file.
    pub(super) fn text(&self, file: &PackFile) -> String {
        let table = &file.table;
        let kind = match table.goniometer {
            Goniometer::A => "CIE-A",
            Goniometer::B => "CIE-B",
            Goniometer::C => "CIE-C",
        };
        let symmetry = match table.layout() {
            PlaneLayout::Single => "Symm_Full",
            PlaneLayout::Quadrant => "Symm_Quad",
            PlaneLayout::Half => "Symm_Bi0",
            PlaneLayout::HalfAboutC90 => "Symm_Bi90",
            PlaneLayout::Full | PlaneLayout::Sector | PlaneLayout::MirroredSector => "Symm_None",
        };
        let mut lines = vec!["<?xml version=\"1.0\" encoding=\"UTF-8\"?>".to_owned()];
        lines.extend(["<IESTM33-22>", "<Version>1.1</Version>", "<Header>"].map(String::from));
        lines.extend(
            ["<Manufacturer>luxproof</Manufacturer>", "<Laboratory>none: computed</Laboratory>"].map(String::from),
        );
        lines.push(format!("<Comments>luxproof conformance pack, {}</Comments>", file.name));
        lines.extend(["</Header>", "<Emitter>", "<Quantity>1</Quantity>"].map(String::from));
        lines.extend(self.rated_lumens.map(|lumens| format!("<RatedLumens>{}</RatedLumens>", number(lumens))));
        lines.extend(["<InputWattage>50</InputWattage>".into(), "<LuminousData>".into()]);
        lines.push(format!("<PhotometryType>{kind}</PhotometryType>"));
        lines.extend(["<Metric>Luminous</Metric>".into(), format!("<SymmType>{symmetry}</SymmType>")]);
        lines.push("<LuminousIntensity>".into());
        lines.push(format!("<AbsolutePhotometry>{}</AbsolutePhotometry>", self.rated_lumens.is_none()));
        lines.push(format!("<Multiplier>{}</Multiplier>", number(self.multiplier)));
        lines.push(format!("<NumberHorz>{}</NumberHorz>", table.horizontal_deg.len()));
        lines.push(format!("<NumberVert>{}</NumberVert>", table.vertical_deg.len()));
        for (h, row) in table.horizontal_deg.iter().zip(table.rows()) {
            for (v, value) in table.vertical_deg.iter().zip(row) {
                lines.push(format!("<IntData h=\"{}\" v=\"{}\">{}</IntData>", number(*h), number(*v), number(*value)));
            }
        }
        lines.extend(["</LuminousIntensity>", "</LuminousData>", "</Emitter>", "</IESTM33-22>"].map(String::from));
        lines.join("\r\n") + "\r\n"
    }
}
