//! What a spec holds that may matter: the grammar leaves some of it out each round, coverage counts it, causes are told by it.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use itertools::Itertools;
use luminaire::photometry::{
    Details, Goniometer, LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry, angles_deg,
};
use luminaire::scene::{LuminaireModel, Meter, Obstacle, Scene, Shape, flush};
use serde::{Deserialize, Serialize};
use strum::{Display, VariantArray};

use super::draft::Draft;
use crate::procedures::{Angles, Asked};
use crate::record::ProcedureId;
use crate::spec::Case;

#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, VariantArray)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Feature {
    TinyRoom,
    HugeRoom,
    FlatRoom,
    PolygonRoom,
    SlantedWall,
    Reflecting,
    BrightRoom,
    UnequalWalls,
    BoxBody,
    MeshBody,
    NestedBodies,
    BodyOnSurface,
    ThinBody,
    ManyBodies,
    SeveralLuminaires,
    ManyLuminaires,
    SharedFile,
    SameSpot,
    Off,
    Dimmed,
    Azimuth,
    Tilt,
    Roll,
    UpsideDown,
    LuminaireNearSurface,
    LowLuminaire,
    Recessed,
    FlatOpening,
    BoxOpening,
    RoundOpening,
    UprightCylinder,
    Ellipsoid,
    LyingCylinder,
    Axial,
    Quadrant,
    BilateralC0,
    BilateralC90,
    AllPlanes,
    OddValue,
    FewGammas,
    FineTable,
    UnevenAngles,
    NarrowBeam,
    Uplight,
    EndsAt90,
    StartsLate,
    DarkPart,
    BrightTable,
    FaintTable,
    Eulumdat,
    TypeA,
    TypeB,
    Grid,
    ManyMeters,
    SkewNormal,
    LongNormal,
    Grazing,
    LooksAway,
    NearBody,
    BodyBehindLuminaire,
    BodyBehindMeter,
    NearSurface,
    NearLuminaire,
    OnAxis,
    OnPlaneOfTable,
    Intensity,
    ListedAngles,
    Direct,
    Indirect,
    Total,
    Cylindrical,
    Luminance,
    OpeningLuminance,
    Glare,
    FewBounces,
    Preset,
}

impl Feature {
    /// Whether every spec has this or something as plain in its place, so that it tells nothing of a cause.
    pub(super) const fn is_plain(self) -> bool {
        matches!(
            self,
            Self::Axial
                | Self::FewGammas
                | Self::EndsAt90
                | Self::Direct
                | Self::Intensity
                | Self::ListedAngles
                | Self::OnAxis
                | Self::OnPlaneOfTable
                | Self::Indirect
                | Self::Total
                | Self::Cylindrical
                | Self::Luminance
                | Self::OpeningLuminance
                | Self::Glare
                | Self::Uplight
        )
    }
}

/// Nearer than this, in metres, is near.
const NEAR_M: f64 = 0.051;
/// A cosine below this is grazing.
const GRAZING: f64 = 0.05;

/// All that a spec holds, by what its reader makes of it.
pub(super) fn features(draft: &Draft, case: &Case) -> BTreeSet<Feature> {
    let mut found = BTreeSet::new();
    let mut add = |feature: Feature, is_there: bool| {
        if is_there {
            found.insert(feature);
        }
    };
    of_room(&case.scene, &mut add);
    of_floor(draft, &mut add);
    of_bodies(&case.scene, &mut add);
    of_luminaires(draft, case, &mut add);
    for photometry in draft.tables() {
        of_table(photometry, &mut add);
    }
    of_meters(draft, case, &mut add);
    for (procedure, asked) in &case.procedures.0 {
        add(Feature::Intensity, *procedure == ProcedureId::LuminousIntensity);
        add(Feature::Direct, *procedure == ProcedureId::DirectIlluminance);
        add(Feature::Indirect, *procedure == ProcedureId::IndirectIlluminance);
        add(Feature::Total, *procedure == ProcedureId::TotalIlluminance);
        add(Feature::Cylindrical, *procedure == ProcedureId::CylindricalIlluminance);
        add(Feature::Luminance, *procedure == ProcedureId::Luminance);
        add(Feature::OpeningLuminance, *procedure == ProcedureId::OpeningLuminance);
        add(Feature::Glare, *procedure == ProcedureId::UnifiedGlareRating);
        match asked {
            Asked::Opening(_) => {}
            Asked::Angles(asked) => add(Feature::ListedAngles, matches!(asked.angles, Angles::Listed(_))),
            Asked::Meters(asked) => {
                add(Feature::FewBounces, asked.bounces != luminaire::scene::Bounces::Converged);
            }
        }
    }
    let is_set = case.engines.iter().flatten().any(|(_, settings)| settings.0.contains_key("preset"));
    add(Feature::Preset, is_set);
    found
}

type Add<'a> = &'a mut dyn FnMut(Feature, bool);

fn of_floor(draft: &Draft, add: Add<'_>) {
    let Some(floor) = &draft.spec.room.floor_m else { return };
    add(Feature::PolygonRoom, true);
    let sides = floor.iter().zip(floor.iter().cycle().skip(1));
    add(Feature::SlantedWall, sides.into_iter().any(|(a, b)| a[0] != b[0] && a[1] != b[1]));
}

fn of_room(scene: &Scene, add: Add<'_>) {
    let Some(room) = scene.room else { return };
    let r = room.reflectance;
    let walls = [r.wall_x_min, r.wall_x_max, r.wall_y_min, r.wall_y_max];
    let brightest = walls.into_iter().chain([r.floor, r.ceiling]).fold(0.0, f64::max);
    add(Feature::TinyRoom, room.size_m.max_element() < 1.0);
    add(Feature::HugeRoom, room.size_m.max_element() > 50.0);
    add(Feature::FlatRoom, room.size_m.min_element() < 0.1 * room.size_m.max_element());
    add(Feature::Reflecting, brightest > 0.0);
    add(Feature::BrightRoom, brightest >= 0.9);
    add(Feature::UnequalWalls, !walls.iter().all_equal());
}

fn of_bodies(scene: &Scene, add: Add<'_>) {
    let bodies: Vec<&Obstacle> = scene.obstacles.iter().filter(|o| !flush::is_plate(o)).collect();
    let boxes = || {
        bodies.iter().filter_map(|o| match o.shape {
            Shape::Box { min_m, max_m } => Some([min_m, max_m]),
            Shape::Mesh { .. } => None,
        })
    };
    add(Feature::BoxBody, boxes().next().is_some());
    add(Feature::MeshBody, bodies.iter().any(|o| matches!(o.shape, Shape::Mesh { .. })));
    let overlap = |[[a, b], [c, d]]: [[DVec3; 2]; 2]| a.cmplt(d).all() && c.cmplt(b).all();
    add(Feature::NestedBodies, boxes().array_combinations().any(overlap));
    add(Feature::ThinBody, boxes().any(|[low, high]| (high - low).min_element() < 0.02));
    add(Feature::ManyBodies, bodies.len() > 3);
    let size_m = scene.room.map_or(DVec3::INFINITY, |r| r.size_m);
    add(Feature::BodyOnSurface, boxes().any(|[low, high]| low.cmple(DVec3::ZERO).any() || high.cmpge(size_m).any()));
}

fn of_luminaires(draft: &Draft, case: &Case, add: Add<'_>) {
    let all = &case.scene.luminaires;
    add(Feature::SeveralLuminaires, (2..5).contains(&all.len()));
    add(Feature::ManyLuminaires, all.len() >= 5);
    add(Feature::SharedFile, !draft.spec.luminaires.iter().map(|l| &l.photometry).all_unique());
    add(Feature::SameSpot, all.iter().array_combinations().any(|[a, b]| a.position_m == b.position_m));
    for spec in &draft.spec.luminaires {
        let turn = spec.rotate_deg;
        add(Feature::Azimuth, turn.azimuth != 0.0);
        add(Feature::Tilt, turn.tilt != 0.0);
        add(Feature::Roll, turn.roll != 0.0);
        add(Feature::UpsideDown, turn.tilt.abs() > 90.0);
        add(Feature::Off, spec.flux_scale == 0.0);
        add(Feature::Dimmed, spec.flux_scale != 0.0 && spec.flux_scale != 1.0);
    }
    for luminaire in all {
        if let Some(room) = &case.scene.room {
            let p = luminaire.position_m;
            let near_m = p.min(room.size_m - p).min_element();
            add(Feature::LuminaireNearSurface, near_m < NEAR_M);
            add(Feature::Recessed, near_m == 0.0);
            add(Feature::LowLuminaire, p.z < 0.5 * room.size_m.z);
        }
        if luminaire.model == LuminaireModel::Point {
            continue;
        }
        match luminaire.photometry.opening {
            LuminousOpening::Point => {}
            LuminousOpening::Box { height_m, .. } => {
                add(if height_m == 0.0 { Feature::FlatOpening } else { Feature::BoxOpening }, true);
            }
            LuminousOpening::Ellipse { height_m, .. } => {
                add(if height_m == 0.0 { Feature::RoundOpening } else { Feature::UprightCylinder }, true);
            }
            LuminousOpening::Ellipsoid { .. } => add(Feature::Ellipsoid, true),
            LuminousOpening::LyingCylinder { .. } => add(Feature::LyingCylinder, true),
        }
    }
}

fn of_table(photometry: &Photometry, add: Add<'_>) {
    let table = &photometry.distribution;
    let symmetry = match table.symmetry() {
        Symmetry::Axial => Feature::Axial,
        Symmetry::Quadrant => Feature::Quadrant,
        Symmetry::BilateralC0 => Feature::BilateralC0,
        Symmetry::BilateralC90 => Feature::BilateralC90,
        Symmetry::None => Feature::AllPlanes,
    };
    add(symmetry, true);
    match &photometry.details {
        Details::Eulumdat(_) => add(Feature::Eulumdat, true),
        Details::Lm63(details) => {
            add(Feature::TypeA, details.goniometer == Goniometer::A);
            add(Feature::TypeB, details.goniometer == Goniometer::B);
        }
        Details::None => {}
    }
    let (c_deg, gamma_deg) = (table.c_deg(), table.gamma_deg());
    let is_uneven = |angles: &[f64]| !angles.windows(2).map(|w| ((w[1] - w[0]) * 1e6).round() as i64).all_equal();
    add(Feature::FewGammas, gamma_deg.len() <= 3);
    add(Feature::FineTable, gamma_deg.len() > 90);
    add(Feature::UnevenAngles, is_uneven(gamma_deg) || is_uneven(c_deg));
    add(Feature::StartsLate, gamma_deg.first().is_some_and(|g| *g > 0.0));
    add(Feature::EndsAt90, gamma_deg.last().is_some_and(|g| *g <= 90.0));
    let values: Vec<f64> = (0..c_deg.len()).flat_map(|c| table.plane(c).to_vec()).collect();
    let brightest = table.max_intensity().value();
    let of_hemisphere = |c: usize| gamma_deg.iter().zip(table.plane(c)).any(|(g, i)| *g > 90.0 && *i > 0.0);
    let goes_up = || table.flux_between(90.0, 180.0).value() > 0.0;
    add(Feature::Uplight, if table.is_native() { goes_up() } else { (0..c_deg.len()).any(of_hemisphere) });
    add(Feature::DarkPart, values.contains(&0.0));
    add(Feature::BrightTable, brightest > 1e5);
    add(Feature::FaintTable, brightest > 0.0 && brightest < 1.0);
    let flux = table.flux().value();
    add(Feature::NarrowBeam, brightest > 0.0 && flux < 0.5 * brightest);
    add(Feature::OddValue, has_odd_value(table));
}

/// Whether one value is none of its neighbours' kind in a table that is the same in every plane otherwise.
fn has_odd_value(table: &LuminousIntensityDistribution) -> bool {
    let planes = table.c_deg().len();
    if planes < 3 {
        return false;
    }
    let differs = |g: usize| {
        let mut values: Vec<f64> = (0..planes).map(|c| table.plane(c)[g]).collect();
        values.sort_by(f64::total_cmp);
        let median = values[planes / 2];
        values.iter().filter(|v| **v != median).count()
    };
    let off: usize = (0..table.gamma_deg().len()).map(differs).sum();
    (1..=2).contains(&off)
}

fn of_meters(draft: &Draft, case: &Case, add: Add<'_>) {
    add(Feature::Grid, draft.spec.meters.values().any(|set| set.grid.is_some()));
    add(Feature::ManyMeters, case.meters.values().map(Vec::len).sum::<usize>() > 16);
    for normal in draft.spec.meters.values().filter_map(|set| set.normal) {
        let normal = DVec3::from(normal);
        add(Feature::SkewNormal, normal.to_array().iter().filter(|x| **x != 0.0).count() > 1);
        add(Feature::LongNormal, (normal.length() - 1.0).abs() > 1e-3);
    }
    for meter in case.meters.values().flatten() {
        of_meter(meter, &case.scene, add);
    }
}

fn of_meter(meter: &Meter, scene: &Scene, add: Add<'_>) {
    let p = meter.position_m;
    if let Some(room) = &scene.room {
        add(Feature::NearSurface, p.min(room.size_m - p).min_element() < NEAR_M);
    }
    let gap_m = |o: &Obstacle| match o.shape {
        Shape::Box { min_m, max_m } => p.clamp(min_m, max_m).distance(p),
        Shape::Mesh { .. } => f64::INFINITY,
    };
    add(Feature::NearBody, scene.obstacles.iter().any(|o| gap_m(o) < NEAR_M));
    for luminaire in &scene.luminaires {
        let ray = p - luminaire.position_m;
        let cosine = -ray.normalize().dot(meter.normal);
        add(Feature::Grazing, cosine.abs() < GRAZING);
        add(Feature::LooksAway, cosine < 0.0);
        add(Feature::NearLuminaire, ray.length() < 0.3);
        let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray);
        add(Feature::OnAxis, gamma.min(180.0 - gamma) < 1e-6);
        let off = (c.rem_euclid(90.0)).min(90.0 - c.rem_euclid(90.0));
        add(Feature::OnPlaneOfTable, off < 1e-6);
        let stretches: Vec<[f64; 2]> = scene.obstacles.iter().filter_map(|o| within(o, p, -ray)).collect();
        let is_clear = stretches.iter().all(|[enter, leave]| *leave < 0.0 || *enter > 1.0);
        add(Feature::BodyBehindLuminaire, is_clear && stretches.iter().any(|[enter, _]| *enter > 1.0));
        add(Feature::BodyBehindMeter, is_clear && stretches.iter().any(|[_, leave]| *leave < 0.0));
    }
}

/// Between which parts of a way, counted from its start, the line that it lies on is in a box.
fn within(body: &Obstacle, from_m: DVec3, way: DVec3) -> Option<[f64; 2]> {
    let Shape::Box { min_m, max_m } = body.shape else { return None };
    let (a, b) = ((min_m - from_m) / way, (max_m - from_m) / way);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    (enter < leave).then_some([enter, leave])
}

/// How much of the grammar specs have held, and together with what else.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeatureCoverage {
    pub specs: usize,
    /// In how many specs.
    pub features: BTreeMap<Feature, usize>,
    /// Pairs that met in a spec, by the first.
    pub pairs: BTreeMap<Feature, BTreeSet<Feature>>,
}

impl FeatureCoverage {
    pub(super) fn add(&mut self, features: &BTreeSet<Feature>) {
        self.specs += 1;
        for &feature in features {
            *self.features.entry(feature).or_default() += 1;
            self.pairs.entry(feature).or_default().extend(features.iter().filter(|other| **other > feature));
        }
    }

    /// How many pairs met, and how many pairs there are.
    pub fn pairs(&self) -> [usize; 2] {
        let n = Feature::VARIANTS.len();
        [self.pairs.values().map(BTreeSet::len).sum(), n * (n - 1) / 2]
    }

    /// Those that no spec has held yet.
    pub fn missing(&self) -> Vec<Feature> {
        Feature::VARIANTS.iter().copied().filter(|f| !self.features.contains_key(f)).collect()
    }
}
