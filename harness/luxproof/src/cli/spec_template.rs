//! The text of a spec to begin with: a room, one luminaire, a plane of meters, and what is measured.

use std::path::Path;

use glam::DVec3;
use luxproof_report::words::trimmed;
use luxproof_scene_import::{MeterGrid, Place};
use luxproof_spec::en_12464_counts;

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
    /// Why `model: auto` chooses its model here; without it, the template leaves the model out.
    pub(super) model: Option<String>,
    /// Whether the luminaire lies in the plane of the ceiling.
    pub(super) is_recessed: bool,
    pub(super) desk: DeskMeters,
}

/// The meters at desk height.
#[derive(Clone, Debug)]
pub(super) enum DeskMeters {
    /// A coarse grid in the place.
    Coarse,
    /// Points of that grid, where bodies stand in the others.
    Points(Vec<DVec3>),
    /// As fine as EN 12464-1 requires, over a floor of this size with this margin along the walls.
    ByEn12464 { floor_m: [f64; 2], height_m: f64, margin_m: f64 },
}

impl DeskMeters {
    /// The lines of YAML of the set.
    fn text(&self, place: Place) -> String {
        match *self {
            Self::Coarse => {
                let MeterGrid { origin_m, step_m, counts } = MeterGrid::within(place.low_m, place.high_m);
                let [ox, oy, oz] = origin_m.to_array().map(number);
                let ([dx, dy], [nx, ny]) = (step_m.map(number), counts);
                format!(
                    "  desk:                                      # a grid at desk height; or points_m: [[1, 1, 0.75], ...]\n    \
                     grid: {{origin_m: [{ox}, {oy}, {oz}], u_m: [{dx}, 0, 0], v_m: [0, {dy}, 0], counts: [{nx}, {ny}]}}\n    \
                     normal: [0, 0, 1]                        # they face up"
                )
            }
            Self::Points(ref points_m) => {
                let points = points_m.iter().map(|p| format!("[{}]", p.to_array().map(number).join(", ")));
                format!(
                    "  desk:                                      # a grid at desk height, without the points inside bodies\n    \
                     points_m: [{}]\n    \
                     normal: [0, 0, 1]                        # they face up",
                    points.collect::<Vec<_>>().join(", ")
                )
            }
            Self::ByEn12464 { floor_m, height_m, margin_m } => {
                let [nx, ny] = en_12464_counts(floor_m.map(|side| side - 2.0 * margin_m));
                let (height, margin) = (number(height_m), number(margin_m));
                format!(
                    "  desk:                                      # {nx} x {ny} points by EN 12464-1; or points_m: [[1, 1, 0.75], ...]\n    \
                     surface: {{of: floor, distance_m: {height}, margin_m: {margin}}}   # counts: [4, 3] for fewer"
                )
            }
        }
    }
}

impl First<'_> {
    pub(super) fn text(&self) -> String {
        let lamp_m = self.place.lamp_m;
        let file = self.file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let values = [
            ("about", self.about.to_owned()),
            ("room", self.room.to_owned()),
            ("cx", number(lamp_m.x)),
            ("cy", number(lamp_m.y)),
            ("cz", number(lamp_m.z)),
            ("desk", self.desk.text(self.place)),
            ("model", self.model.as_ref().map_or_else(|| NO_MODEL.to_owned(), |why| model_line(why))),
            ("face", if self.is_recessed { FACE } else { "" }.to_owned()),
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

/// The template's line where it leaves the model out.
const NO_MODEL: &str = "# model: point                           # a point instead of the file's luminous opening";

/// The template's line on the face of a luminaire in the ceiling.
const FACE: &str =
    "\n    # face_reflectance: 0.8                  # of its face, 0 by default; changes reflected light by per cents";

/// The template's line for `model: auto`, with the reason for its choice.
fn model_line(why: &str) -> String {
    format!("model: auto                              # {why}")
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
    let groups = groups.map(|(name, rho)| format!("\n    {}: {rho}", quoted(name))).collect::<Vec<_>>().concat();
    format!(
        "  mesh: {file}                             # faces that close it, in groups\n  \
           groups:                                    # the reflectance of each: diffuse, 0 to 1{groups}"
    )
}

/// A number to four places.
fn number(value: f64) -> String {
    trimmed(value, 4)
}

/// A text in double quotes, as YAML and JSON both read it.
fn quoted(text: &str) -> String {
    serde_json::to_string(text).unwrap_or_default()
}

/// Numbers as lines of a photometric file, ten to a line.
fn number_lines(values: impl Iterator<Item = f64>) -> String {
    let numbers: Vec<String> = values.map(number).collect();
    numbers.chunks(10).map(|line| line.join(" ")).collect::<Vec<_>>().join("\n")
}

/// The reflectances of walls at x-, x+, y- and y+ as a spec has them: one number where they are alike.
pub(super) fn walls(rho: [f64; 4], number: impl Fn(f64) -> String) -> String {
    let [a, b, c, d] = rho.map(number);
    if a == b && b == c && c == d { a } else { format!("{{x-: {a}, x+: {b}, y-: {c}, y+: {d}}}") }
}

/// A Lambertian downlight of 1000 cd straight down: 3141.6 lm in a square opening of 0.6 m, or of the side for which there is room.
pub(super) fn downlight(room_for_m: f64) -> String {
    let side_m = number(room_for_m.min(0.6));
    let gammas: Vec<f64> = (0..=36).map(|k| 2.5 * f64::from(k)).collect();
    let candela = number_lines(gammas.iter().map(|gamma| 1000.0 * gamma.to_radians().cos()));
    format!(
        "IESNA:LM-63-2002\n[TEST] none: made by luxproof\n[MANUFAC] nobody\n[LUMINAIRE] Lambertian downlight, 1000 cd\nTILT=NONE\n\
         1 -1 1 {} 1 1 2 {side_m} {side_m} 0\n1 1 0\n{}\n0\n{candela}\n",
        gammas.len(),
        number_lines(gammas.iter().copied())
    )
}
