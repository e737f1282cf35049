//! The unit of a spec's lengths: converted to metres once, before anything is built.

use glam::DVec3;
use luxproof_model::numbers::trimmed;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::{ArraySpec, GridSpec, LineSpec, LuminaireSpec, MeterSet, ObstacleSpec, RoomSpec, Spec};
use crate::procedures::ProcedureRequest;

/// The unit of all lengths in a spec, those of keys that end with `_m`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Metres.
    #[default]
    M,
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Feet of 0.3048 m.
    Ft,
    /// Inches of 0.0254 m.
    In,
}

impl LengthUnit {
    /// Metres in one.
    const fn in_metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::Ft => 0.3048,
            Self::In => 0.0254,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::Ft => "ft",
            Self::In => "in",
        }
    }

    /// A length in metres as the spec would write it, with its unit: `14.01 ft`.
    pub(super) fn length(self, length_m: f64) -> String {
        format!("{} {}", readable(length_m / self.in_metres()), self.name())
    }

    /// A point in metres as the spec would write it: `[14.01, 11, 3] ft`, without a unit where that is metres.
    pub(super) fn point(self, point_m: DVec3) -> String {
        let [x, y, z] = point_m.to_array().map(|length_m| readable(length_m / self.in_metres()));
        let unit = if self == Self::M { String::new() } else { format!(" {}", self.name()) };
        format!("[{x}, {y}, {z}]{unit}")
    }
}

/// A number with four decimals at most; more only where it is nearly, but not quite, a rounder one.
fn readable(number: f64) -> String {
    let short = trimmed(number, 4);
    let rounded: f64 = short.parse().unwrap_or(number);
    let off = (rounded - number).abs();
    if off > 1e-9 * number.abs().max(1.0) && off < 2e-6 { trimmed(number, 9) } else { short }
}

impl Spec {
    /// The same spec in metres. Meshes and photometric files have their own units and are not touched.
    #[must_use]
    pub(super) fn in_metres(mut self) -> Self {
        let metres = std::mem::take(&mut self.unit).in_metres();
        if metres == 1.0 {
            return self;
        }
        let scale = Scale(metres);
        scale.room(&mut self.room);
        for obstacle in &mut self.obstacles {
            scale.obstacle(obstacle);
        }
        for luminaire in &mut self.luminaires {
            scale.luminaire(luminaire);
        }
        for set in self.meters.values_mut() {
            scale.meters(set);
        }
        for asked in self.procedures.0.values_mut() {
            if let ProcedureRequest::Angles(asked) = asked {
                scale.length(&mut asked.distance_m);
            }
        }
        self
    }
}

/// A factor on lengths.
#[derive(Clone, Copy)]
struct Scale(f64);

impl Scale {
    fn length(self, length: &mut f64) {
        *length *= self.0;
    }

    fn point<const N: usize>(self, point: &mut [f64; N]) {
        for coordinate in point {
            self.length(coordinate);
        }
    }

    fn room(self, room: &mut RoomSpec) {
        if let Some(size) = &mut room.size_m {
            self.point(size);
        }
        for corner in room.floor_m.iter_mut().flatten() {
            self.point(corner);
        }
        if let Some(height) = &mut room.height_m {
            self.length(height);
        }
    }

    fn obstacle(self, obstacle: &mut ObstacleSpec) {
        if let Some(cuboid) = &mut obstacle.cuboid {
            self.point(&mut cuboid.min_m);
            self.point(&mut cuboid.max_m);
        }
        if let Some(mesh) = &mut obstacle.mesh {
            self.point(&mut mesh.at_m);
        }
    }

    fn luminaire(self, luminaire: &mut LuminaireSpec) {
        if let Some(place) = &mut luminaire.at_m {
            self.point(place);
        }
        if let Some(ArraySpec { origin_m, step_m, .. }) = &mut luminaire.array {
            self.point(origin_m);
            self.point(step_m);
        }
    }

    fn meters(self, set: &mut MeterSet) {
        for point in set.points_m.iter_mut().flatten() {
            self.point(point);
        }
        if let Some(GridSpec { origin_m, u_m, v_m, .. }) = &mut set.grid {
            for vector in [origin_m, u_m, v_m] {
                self.point(vector);
            }
        }
        if let Some(LineSpec { from_m, to_m, .. }) = &mut set.line {
            self.point(from_m);
            self.point(to_m);
        }
        if let Some(grid) = &mut set.surface {
            self.length(&mut grid.distance_m);
            self.length(&mut grid.margin_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::LengthUnit;
    use crate::{Case, find_lints};

    /// A room of 16.4 x 13.1 x 9.2 of a unit, with the luminaire in the ceiling's plane and a point on a desk.
    fn room(unit: &str, factor: f64) -> Case {
        read(unit, factor).unwrap()
    }

    fn read(unit: &str, factor: f64) -> Result<Case, crate::SpecError> {
        let folder = tempfile::tempdir().unwrap();
        let lamp = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/luminaires/isotropic.ies");
        let [x, y, z, desk] = [16.4, 13.1, 9.2, 2.5].map(|length| length * factor);
        let text = format!(
            "luxproof: 1\n{unit}room: {{size_m: [{x}, {y}, {z}], reflectance: {{floor: 0.2, walls: 0.5, ceiling: 0.7}}}}\n\
             luminaires: [{{id: a, photometry: {}, at_m: [{}, {}, {}]}}]\n\
             meters:\n  a: {{points_m: [[{desk}, {desk}, {desk}]], normal: [0, 0, 1]}}\n  \
             b: {{surface: {{of: floor, distance_m: {desk}, margin_m: {}}}}}\n\
             procedures:\n  direct_illuminance: {{meters: [a, b]}}\n  \
             luminous_intensity: {{luminaire: a, distance_m: {}}}\n",
            lamp.display(),
            x / 2.0,
            y / 2.0,
            0.9 * z,
            0.5 * factor,
            30.0 * factor,
        );
        let path = folder.path().join("spec.yaml");
        std::fs::write(&path, text).unwrap();
        Case::load(&path)
    }

    #[test]
    fn a_unit_by_its_whole_name_is_answered_with_its_symbol() {
        for (word, symbol) in [("feet", "ft"), ("Inches", "in"), ("metres", "m"), ("millimeters", "mm")] {
            let message = read(&format!("unit: {word}\n"), 1.0).unwrap_err().to_string();
            assert!(message.contains(&format!("did you mean `{symbol}`?")), "{message}");
        }
    }

    #[test]
    fn lengths_are_written_in_the_unit_of_the_spec_without_the_noise_of_their_conversion() {
        let feet = DVec3::new(14.01, 11.0, 3.0) * 0.3048;
        assert_eq!(LengthUnit::Ft.point(feet), "[14.01, 11, 3] ft");
        assert_eq!(LengthUnit::M.point(DVec3::new(1.849_999_999_999_999_9, 1.0 / 3.0, -0.0)), "[1.85, 0.3333, 0]");
        assert_eq!(
            (LengthUnit::Ft.length(0.4572), LengthUnit::Mm.length(0.4572)),
            ("1.5 ft".into(), "457.2 mm".into())
        );
        // A point just outside does not look as if it were on the wall.
        assert_eq!(LengthUnit::M.length(3.000_000_5), "3.0000005 m");
    }

    #[test]
    fn every_length_is_of_the_unit() {
        let metres = room("", 0.3048);
        for (unit, factor) in [("ft", 1.0), ("in", 12.0), ("cm", 30.48), ("mm", 304.8), ("m", 0.3048)] {
            let found = room(&format!("unit: {unit}\n"), factor);
            let pairs = found.meters.values().flatten().zip(metres.meters.values().flatten());
            for (a, b) in pairs {
                assert!(a.position_m.distance(b.position_m) < 1e-12, "{unit}");
            }
            let [a, b] = [&found, &metres].map(|case| case.scene.room.unwrap().size_m);
            assert!(a.distance(b) < 1e-12, "{unit}");
            let [a, b] = [&found, &metres].map(|case| case.tasks().flat_map(|t| t.targets).count());
            assert_eq!(a, b, "{unit}");
            assert!(found.scene.luminaires[0].position_m.distance(metres.scene.luminaires[0].position_m) < 1e-12);
        }
        assert!(find_lints(&[metres]).is_empty());
        assert!(find_lints(&[room("", 1.0)])[0].message.contains("are these feet?"));
        let in_metres = find_lints(&[room("unit: ft\n", 0.3048)]);
        assert!(in_metres[0].message.contains("are its lengths metres, not feet?"), "{}", in_metres[0].message);
    }
}
