//! The text of a spec to begin with: a room, one luminaire, a plane of meters, and what is measured.

use std::path::Path;

use glam::DVec3;

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
    pub(super) size: [String; 3],
    /// Of floor, walls and ceiling.
    pub(super) reflectance: [String; 3],
    /// Lines of YAML, or a comment on them.
    pub(super) obstacles: &'a str,
    pub(super) photometry: &'a Path,
    pub(super) lamp_m: DVec3,
    /// What meters are to lie in: the room, or its scene.
    pub(super) low_m: DVec3,
    pub(super) high_m: DVec3,
}

impl First<'_> {
    /// The spec's text: desks of half a metre and more to a step.
    pub(super) fn text(&self) -> String {
        let extent = self.high_m - self.low_m;
        let counts = [extent.x, extent.y].map(|extent| extent.floor().clamp(3.0, 20.0));
        let step = [extent.x / counts[0], extent.y / counts[1]];
        let number = |value: f64| trimmed(value, 4);
        let desk = self.low_m.z + 0.75_f64.min(0.4 * extent.z);
        let quoted = |text: &str| serde_json::to_string(text).unwrap_or_default();
        let file = self.file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let [x, y, z] = self.size.clone();
        let [floor, walls, ceiling] = self.reflectance.clone();
        let values = [
            ("about", self.about.to_owned()),
            ("x", x),
            ("y", y),
            ("z", z),
            ("floor", floor),
            ("walls", walls),
            ("ceiling", ceiling),
            ("cx", number(self.lamp_m.x)),
            ("cy", number(self.lamp_m.y)),
            ("cz", number(self.lamp_m.z)),
            ("ox", number(self.low_m.x + step[0] / 2.0)),
            ("oy", number(self.low_m.y + step[1] / 2.0)),
            ("dx", number(step[0])),
            ("dy", number(step[1])),
            ("nx", number(counts[0])),
            ("ny", number(counts[1])),
            ("desk", number(desk)),
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
