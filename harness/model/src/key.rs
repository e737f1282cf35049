//! The names that identify a reading: case, procedure, engine and meter.

use std::borrow::{Borrow, Cow};
use std::fmt;
use std::ops::Deref;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray, VariantNames};

use super::Release;

/// The key of a recording: one engine in one procedure of one case.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct ReadingKey {
    pub case: String,
    pub procedure: ProcedureId,
    pub engine: EngineName,
}

impl ReadingKey {
    pub fn new(case: impl Into<String>, procedure: ProcedureId, engine: impl Into<EngineName>) -> Self {
        Self { case: case.into(), procedure, engine: engine.into() }
    }

    /// Whether it belongs to this procedure of this case, with any engine.
    pub fn is_of(&self, case: &str, procedure: ProcedureId) -> bool {
        self.case == case && self.procedure == procedure
    }
}

impl fmt::Display for ReadingKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} of {}", self.engine, self.procedure, self.case)
    }
}

/// A procedure; `luxproof_spec::procedures` describes what each measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[derive(IntoStaticStr, VariantArray, VariantNames, strum::Display)]
#[strum(serialize_all = "snake_case", const_into_str)]
pub enum ProcedureId {
    /// Procedure 1: the luminous intensity distribution, computed from illuminance.
    LuminousIntensity,
    /// Procedure 2: direct light of the luminaires.
    DirectIlluminance,
    /// Procedure 3: light that was reflected at least once.
    IndirectIlluminance,
    /// Direct and indirect light.
    TotalIlluminance,
    /// Mean over all vertical directions at a point (EN 12464-1).
    CylindricalIlluminance,
    /// Mean over a half cylinder that faces as the meter does (EN 13201-3).
    SemicylindricalIlluminance,
    /// Mean over a hemisphere that faces as the meter does (EN 13201-3).
    HemisphericalIlluminance,
    /// Mean over all directions at a point: scalar illuminance.
    SphericalIlluminance,
    /// The luminance of the diffuse surfaces on which meters lie.
    Luminance,
    /// The mean luminance of a luminous opening towards observers.
    OpeningLuminance,
    /// The glare rating of observers (CIE 117).
    UnifiedGlareRating,
    /// Calibration: the inverse-square law.
    Point,
    /// Calibration: a table without symmetry.
    Asymmetric,
    /// Calibration: several luminaires.
    Luminaires,
    /// Calibration: the shadow of a box.
    Shadow,
    /// Calibration: uniform reflected light.
    Furnace,
    /// Calibration: different reflectances.
    Reflectances,
}

impl ProcedureId {
    /// The procedures that a spec may request, in the order of reports.
    pub const ALL: &[Self] = <Self as VariantArray>::VARIANTS.split_at(11).0;

    /// Their names, in the same order.
    pub const NAMES: &[&str] = <Self as VariantNames>::VARIANTS.split_at(Self::ALL.len()).0;

    /// The name in specs, on command lines and in reports.
    pub const fn name(self) -> &'static str {
        self.into_str()
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no procedure `{name}`; there are {}", ProcedureId::NAMES.join(", "))]
pub struct UnknownProcedure {
    pub name: String,
}

impl FromStr for ProcedureId {
    type Err = UnknownProcedure;

    fn from_str(name: &str) -> Result<Self, UnknownProcedure> {
        Self::ALL.iter().copied().find(|p| p.name() == name).ok_or_else(|| UnknownProcedure { name: name.to_owned() })
    }
}

/// The name of an engine in specs, on the command line and in reports.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct EngineName(Cow<'static, str>);

impl EngineName {
    /// The name of a built-in engine.
    pub const fn new(name: &'static str) -> Self {
        Self(Cow::Borrowed(name))
    }

    /// The exact simulator, a reference for the others.
    pub const SIMULATOR: Self = Self::new("simulator");
    /// The IESNA methods, which are references where they are closed forms.
    pub const IESNA: Self = Self::new("iesna");

    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The engine's name without a release.
    pub fn family(&self) -> &str {
        family(&self.0)
    }

    /// The release in the name, where there is a valid one.
    pub fn release(&self) -> Option<Release> {
        self.0.split_once('@').and_then(|(_, release)| release.parse().ok())
    }
}

/// The part of an engine's name before the `@`, or all of it.
pub fn family(name: &str) -> &str {
    name.split_once('@').map_or(name, |(family, _)| family)
}

impl<T: Into<String>> From<T> for EngineName {
    fn from(name: T) -> Self {
        Self(Cow::Owned(name.into()))
    }
}

impl fmt::Display for EngineName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

impl Deref for EngineName {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl Borrow<str> for EngineName {
    fn borrow(&self) -> &str {
        self
    }
}

impl<T: AsRef<str> + ?Sized> PartialEq<T> for EngineName {
    fn eq(&self, other: &T) -> bool {
        self.as_str() == other.as_ref()
    }
}

/// A meter of a case: `<set>[k]`, or `<luminaire>[k]` for readings of luminous intensity.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct MeterId(pub String);

impl fmt::Display for MeterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

impl MeterId {
    /// The `k`-th meter of a set.
    pub fn new(set: &str, k: usize) -> Self {
        Self(format!("{set}[{k}]"))
    }

    /// The name of the meter's set.
    pub fn set_name(&self) -> &str {
        self.0.rsplit_once('[').map_or(&self.0, |(set, _)| set)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_procedure_is_found_by_the_name_that_files_carry() {
        for &procedure in ProcedureId::ALL {
            assert_eq!(procedure.name().parse(), Ok(procedure));
            assert_eq!(serde_json::to_value(procedure).unwrap(), procedure.name());
        }
        let text = "glare".parse::<ProcedureId>().unwrap_err().to_string();
        assert!(text.contains("`glare`") && text.contains("direct_illuminance"), "{text}");
    }

    #[test]
    fn a_key_is_of_its_case_and_procedure_alone() {
        let key = ReadingKey::new("room", ProcedureId::DirectIlluminance, "radiance");
        assert!(key.is_of("room", ProcedureId::DirectIlluminance));
        assert!(!key.is_of("hall", ProcedureId::DirectIlluminance));
        assert!(!key.is_of("room", ProcedureId::TotalIlluminance));
        assert_eq!(key.to_string(), "radiance direct_illuminance of room");
        assert_eq!(ProcedureId::ALL.last().map(|p| p.name()), Some("unified_glare_rating"));
    }

    #[test]
    fn the_name_of_an_engine_may_have_a_release() {
        let named = EngineName::from("radiance@1.3.1");
        assert_eq!((named.family(), named.as_str(), &*named), ("radiance", "radiance@1.3.1", "radiance@1.3.1"));
        assert_eq!(named.release().map(|r| r.to_string()).as_deref(), Some("1.3.1"));
        assert_eq!((EngineName::SIMULATOR.release(), EngineName::from("a@..").release()), (None, None));
        assert_eq!((family("povray"), family("povray@3.7")), ("povray", "povray"));
        assert!(named == *"radiance@1.3.1" && named != *"radiance");
        assert_eq!((named.to_string().as_str(), Borrow::<str>::borrow(&named)), ("radiance@1.3.1", "radiance@1.3.1"));
    }

    #[test]
    fn the_name_of_a_meter_begins_with_that_of_its_set() {
        let meter = MeterId::new("desk[left]", 12);
        assert_eq!((meter.to_string().as_str(), meter.set_name()), ("desk[left][12]", "desk[left]"));
        assert_eq!(MeterId("alone".to_owned()).set_name(), "alone");
    }
}
