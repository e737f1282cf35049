//! The text of a spec to begin with: a room, one luminaire, a plane of meters, and what is measured.

use std::path::Path;

use crate::import::{Desk, Place};
use crate::report::words::trimmed;

/// The spec, its values in braces.
const SPEC: &str = include_str!("first.yaml");

/// The name of the file that [`downlight`] is.
pub(super) const DOWNLIGHT: &str = "downlight.ies";

/// What a spec is made of; numbers as they are to stand there.
pub(super) struct First<'a> {
    /// Its first line, a comment.
    pub(super) about: &'a str,
    pub(super) file: &'a Path,
    pub(super) title: &'a str,
    /// Lines of YAML below `room`.
    pub(super) room: &'a str,
    /// Lines of YAML, or a comment on them.
    pub(super) obstacles: &'a str,
    pub(super) photometry: &'a Path,
    pub(super) place: Place,
}

impl First<'_> {
    pub(super) fn text(&self) -> String {
        let Place { lamp_m, low_m, high_m } = self.place;
        let Desk { origin_m, step_m, counts } = Desk::within(low_m, high_m);
        let number = |value: f64| trimmed(value, 4);
        let quoted = |text: &str| serde_json::to_string(text).unwrap_or_default();
        let file = self.file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let values = [
            ("about", self.about.to_owned()),
            ("room", self.room.to_owned()),
            ("cx", number(lamp_m.x)),
            ("cy", number(lamp_m.y)),
            ("cz", number(lamp_m.z)),
            ("ox", number(origin_m.x)),
            ("oy", number(origin_m.y)),
            ("dx", number(step_m[0])),
            ("dy", number(step_m[1])),
            ("nx", counts[0].to_string()),
            ("ny", counts[1].to_string()),
            ("desk", number(origin_m.z)),
            ("distance", "10".to_owned()),
            ("obstacles", self.obstacles.to_owned()),
            ("file", file),
            ("photometry", quoted(&self.photometry.to_string_lossy())),
            // Whatever it says is not replaced.
            ("title", quoted(self.title)),
        ];
        values.iter().fold(SPEC.to_owned(), |text, (name, value)| text.replace(&format!("{{{name}}}"), value))
    }
}

/// The lines of a box: its size, and the reflectances of floor, walls and ceiling.
pub(super) fn box_room([x, y, z]: [String; 3], [floor, walls, ceiling]: [String; 3]) -> String {
    format!(
        "  size_m: [{x}, {y}, {z}]                    # length along x, width along y, height\n  \
           reflectance: {{floor: {floor}, walls: {walls}, ceiling: {ceiling}}}    \
         # diffuse, 0 to 1; walls also {{x-: 0.5, x+: 0.5, y-: 0.5, y+: 0.5}}"
    )
}

/// The lines of a room that a mesh is: its file, and its groups with their reflectances.
pub(super) fn mesh_room<'a>(file: &str, groups: impl Iterator<Item = (&'a str, f64)>) -> String {
    let quoted = |text: &str| serde_json::to_string(text).unwrap_or_default();
    let group = |(name, rho): (&str, f64)| format!("\n    {}: {rho}", quoted(name));
    format!(
        "  mesh: {file}                             # faces that close it, in groups\n  \
           groups:                                    # the reflectance of each: diffuse, 0 to 1{}",
        groups.map(group).collect::<String>()
    )
}

/// The reflectances of walls at x-, x+, y- and y+ as a spec has them: one number where they are alike.
pub(super) fn walls(rho: [f64; 4], number: impl Fn(f64) -> String) -> String {
    let [a, b, c, d] = rho.map(number);
    if a == b && b == c && c == d { a } else { format!("{{x-: {a}, x+: {b}, y-: {c}, y+: {d}}}") }
}

/// A Lambertian downlight of 1000 cd straight down: 3141.6 lm in an opening of 0.6 m by 0.6 m.
pub(super) fn downlight() -> String {
    let gammas: Vec<f64> = (0..=36).map(|k| 2.5 * f64::from(k)).collect();
    let list = |values: &mut dyn Iterator<Item = f64>| {
        values.map(|v| trimmed(v, 4)).collect::<Vec<_>>().chunks(10).map(|c| c.join(" ")).collect::<Vec<_>>().join("\n")
    };
    let candela = list(&mut gammas.iter().map(|gamma| 1000.0 * gamma.to_radians().cos()));
    format!(
        "IESNA:LM-63-2002\n[TEST] none: made by luxproof\n[MANUFAC] nobody\n[LUMINAIRE] Lambertian downlight, 1000 cd\nTILT=NONE\n\
         1 -1 1 {} 1 1 2 0.6 0.6 0\n1 1 0\n{}\n0\n{candela}\n",
        gammas.len(),
        list(&mut gammas.iter().copied())
    )
}
