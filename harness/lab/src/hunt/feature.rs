//! Features of specs that may cause a fault: the grammar leaves out some each round, coverage
//! counts them, and causes consist of them.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use itertools::Itertools;
use luxproof_photometry::{
    Details, Goniometer, LuminousIntensityDistribution, LuminousOpening, Photometry, Symmetry, angles_deg,
};
use luxproof_scene::{LuminaireModel, Meter, Obstacle, Scene, Shape, flush};
use serde::{Deserialize, Serialize};
use strum::{Display, VariantArray};

use super::draft::Draft;
use luxproof_model::ProcedureId;
use luxproof_spec::Case;
use luxproof_spec::procedures::{Angles, ProcedureRequest};

/// A property of a spec.
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
    /// Whether every spec has this feature or an equally plain one instead, so that it cannot
    /// distinguish causes.
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

/// A distance below this counts as near.
const NEAR_M: f64 = 0.051;
/// A distance of a meter below this from a luminaire counts as near.
const NEAR_LUMINAIRE_M: f64 = 0.3;
/// An angle of incidence counts as grazing where its cosine is below this.
const GRAZING_COSINE: f64 = 0.05;

/// The features that were found so far.
#[derive(Default)]
struct FoundFeatures(BTreeSet<Feature>);

impl FoundFeatures {
    /// Adds a feature where it is present.
    fn add(&mut self, feature: Feature, is_present: bool) {
        if is_present {
            self.0.insert(feature);
        }
    }
}

/// Finds all features of a spec, as its reader understands it.
pub(super) fn find_features(draft: &Draft, case: &Case) -> BTreeSet<Feature> {
    let mut found = FoundFeatures::default();
    add_room_features(&case.scene, &mut found);
    add_floor_features(draft, &mut found);
    add_body_features(&case.scene, &mut found);
    add_luminaire_features(draft, case, &mut found);
    for photometry in draft.tables() {
        add_table_features(photometry, &mut found);
    }
    add_meter_set_features(draft, case, &mut found);
    for (procedure, asked) in &case.procedures.0 {
        found.add(Feature::Intensity, *procedure == ProcedureId::LuminousIntensity);
        found.add(Feature::Direct, *procedure == ProcedureId::DirectIlluminance);
        found.add(Feature::Indirect, *procedure == ProcedureId::IndirectIlluminance);
        found.add(Feature::Total, *procedure == ProcedureId::TotalIlluminance);
        found.add(Feature::Cylindrical, *procedure == ProcedureId::CylindricalIlluminance);
        found.add(Feature::Luminance, *procedure == ProcedureId::Luminance);
        found.add(Feature::OpeningLuminance, *procedure == ProcedureId::OpeningLuminance);
        found.add(Feature::Glare, *procedure == ProcedureId::UnifiedGlareRating);
        match asked {
            ProcedureRequest::Opening(_) => {}
            ProcedureRequest::Angles(asked) => {
                found.add(Feature::ListedAngles, matches!(asked.angles, Angles::Listed(_)));
            }
            ProcedureRequest::Meters(asked) => {
                found.add(Feature::FewBounces, asked.bounces != luxproof_scene::Bounces::Converged);
            }
        }
    }
    let is_set = case.engines.iter().flatten().any(|(_, settings)| settings.0.contains_key("preset"));
    found.add(Feature::Preset, is_set);
    found.0
}

/// Adds the features of a polygon room.
fn add_floor_features(draft: &Draft, found: &mut FoundFeatures) {
    let Some(floor) = &draft.spec.room.floor_m else { return };
    found.add(Feature::PolygonRoom, true);
    let mut sides = floor.iter().zip(floor.iter().cycle().skip(1));
    found.add(Feature::SlantedWall, sides.any(|(a, b)| a[0] != b[0] && a[1] != b[1]));
}

/// Adds the features of a room's size and reflectances.
fn add_room_features(scene: &Scene, found: &mut FoundFeatures) {
    let Some(room) = scene.room else { return };
    let r = room.reflectance;
    let walls = [r.wall_x_min, r.wall_x_max, r.wall_y_min, r.wall_y_max];
    let brightest = walls.into_iter().chain([r.floor, r.ceiling]).fold(0.0, f64::max);
    found.add(Feature::TinyRoom, room.size_m.max_element() < 1.0);
    found.add(Feature::HugeRoom, room.size_m.max_element() > 50.0);
    found.add(Feature::FlatRoom, room.size_m.min_element() < 0.1 * room.size_m.max_element());
    found.add(Feature::Reflecting, brightest > 0.0);
    found.add(Feature::BrightRoom, brightest >= 0.9);
    found.add(Feature::UnequalWalls, !walls.iter().all_equal());
}

/// The corners of an obstacle that is a box.
fn box_of(obstacle: &Obstacle) -> Option<[DVec3; 2]> {
    match obstacle.shape {
        Shape::Box { min_m, max_m } => Some([min_m, max_m]),
        Shape::Mesh { .. } => None,
    }
}

/// Whether two boxes have a common volume.
fn boxes_overlap([[a, b], [c, d]]: [[DVec3; 2]; 2]) -> bool {
    a.cmplt(d).all() && c.cmplt(b).all()
}

/// Adds the features of bodies, without the plates that close recessed luminaires.
fn add_body_features(scene: &Scene, found: &mut FoundFeatures) {
    let bodies: Vec<&Obstacle> = scene.obstacles.iter().filter(|o| !flush::is_plate(o)).collect();
    let boxes: Vec<[DVec3; 2]> = bodies.iter().filter_map(|o| box_of(o)).collect();
    found.add(Feature::BoxBody, !boxes.is_empty());
    found.add(Feature::MeshBody, bodies.iter().any(|o| matches!(o.shape, Shape::Mesh { .. })));
    found.add(Feature::NestedBodies, boxes.iter().copied().array_combinations().any(boxes_overlap));
    found.add(Feature::ThinBody, boxes.iter().any(|[low, high]| (high - low).min_element() < 0.02));
    found.add(Feature::ManyBodies, bodies.len() > 3);
    let size_m = scene.room.map_or(DVec3::INFINITY, |r| r.size_m);
    found.add(
        Feature::BodyOnSurface,
        boxes.iter().any(|[low, high]| low.cmple(DVec3::ZERO).any() || high.cmpge(size_m).any()),
    );
}

/// Adds the features of luminaires: their number, position, rotation, flux and openings.
fn add_luminaire_features(draft: &Draft, case: &Case, found: &mut FoundFeatures) {
    let all = &case.scene.luminaires;
    found.add(Feature::SeveralLuminaires, (2..5).contains(&all.len()));
    found.add(Feature::ManyLuminaires, all.len() >= 5);
    found.add(Feature::SharedFile, !draft.spec.luminaires.iter().map(|l| &l.photometry).all_unique());
    found.add(Feature::SameSpot, all.iter().array_combinations().any(|[a, b]| a.position_m == b.position_m));
    for spec in &draft.spec.luminaires {
        let turn = spec.rotate_deg;
        found.add(Feature::Azimuth, turn.azimuth != 0.0);
        found.add(Feature::Tilt, turn.tilt != 0.0);
        found.add(Feature::Roll, turn.roll != 0.0);
        found.add(Feature::UpsideDown, turn.tilt.abs() > 90.0);
        found.add(Feature::Off, spec.flux_scale == 0.0);
        found.add(Feature::Dimmed, spec.flux_scale != 0.0 && spec.flux_scale != 1.0);
    }
    for luminaire in all {
        if let Some(room) = &case.scene.room {
            let p = luminaire.position_m;
            let near_m = p.min(room.size_m - p).min_element();
            found.add(Feature::LuminaireNearSurface, near_m < NEAR_M);
            found.add(Feature::Recessed, near_m == 0.0);
            found.add(Feature::LowLuminaire, p.z < 0.5 * room.size_m.z);
        }
        if luminaire.model == LuminaireModel::Point {
            continue;
        }
        match luminaire.photometry.opening {
            LuminousOpening::Point => {}
            LuminousOpening::Box { height_m, .. } => {
                found.add(if height_m == 0.0 { Feature::FlatOpening } else { Feature::BoxOpening }, true);
            }
            LuminousOpening::Ellipse { height_m, .. } => {
                found.add(if height_m == 0.0 { Feature::RoundOpening } else { Feature::UprightCylinder }, true);
            }
            LuminousOpening::Ellipsoid { .. } => found.add(Feature::Ellipsoid, true),
            LuminousOpening::LyingCylinder { .. } => found.add(Feature::LyingCylinder, true),
        }
    }
}

/// Whether the steps between angles differ by more than rounding.
fn is_uneven(angles: &[f64]) -> bool {
    !angles.windows(2).map(|w| ((w[1] - w[0]) * 1e6).round() as i64).all_equal()
}

/// Whether a luminaire emits light above the horizontal.
fn emits_upwards(table: &LuminousIntensityDistribution) -> bool {
    // The angles of other goniometer types are not gamma, so only flux answers for them.
    if table.is_native() {
        return table.flux_between(90.0, 180.0).value() > 0.0;
    }
    let mut planes = 0..table.c_deg().len();
    planes.any(|c| table.gamma_deg().iter().zip(table.plane(c)).any(|(g, i)| *g > 90.0 && *i > 0.0))
}

/// Adds the features of a photometric table.
fn add_table_features(photometry: &Photometry, found: &mut FoundFeatures) {
    let table = &photometry.distribution;
    let symmetry = match table.symmetry() {
        Symmetry::Axial => Feature::Axial,
        Symmetry::Quadrant => Feature::Quadrant,
        Symmetry::BilateralC0 => Feature::BilateralC0,
        Symmetry::BilateralC90 => Feature::BilateralC90,
        Symmetry::None => Feature::AllPlanes,
    };
    found.add(symmetry, true);
    match &photometry.details {
        Details::Eulumdat(_) => found.add(Feature::Eulumdat, true),
        Details::Lm63(details) => {
            found.add(Feature::TypeA, details.goniometer == Goniometer::A);
            found.add(Feature::TypeB, details.goniometer == Goniometer::B);
        }
        Details::None => {}
    }
    let (c_deg, gamma_deg) = (table.c_deg(), table.gamma_deg());
    found.add(Feature::FewGammas, gamma_deg.len() <= 3);
    found.add(Feature::FineTable, gamma_deg.len() > 90);
    found.add(Feature::UnevenAngles, is_uneven(gamma_deg) || is_uneven(c_deg));
    found.add(Feature::StartsLate, gamma_deg.first().is_some_and(|g| *g > 0.0));
    found.add(Feature::EndsAt90, gamma_deg.last().is_some_and(|g| *g <= 90.0));
    let values: Vec<f64> = (0..c_deg.len()).flat_map(|c| table.plane(c).to_vec()).collect();
    let brightest = table.max_intensity().value();
    found.add(Feature::Uplight, emits_upwards(table));
    found.add(Feature::DarkPart, values.contains(&0.0));
    found.add(Feature::BrightTable, brightest > 1e5);
    found.add(Feature::FaintTable, brightest > 0.0 && brightest < 1.0);
    let flux = table.flux().value();
    found.add(Feature::NarrowBeam, brightest > 0.0 && flux < 0.5 * brightest);
    found.add(Feature::OddValue, has_odd_value(table));
}

/// How many planes have a value at a gamma angle that is not the median of all planes.
fn odd_values_at(table: &LuminousIntensityDistribution, gamma: usize) -> usize {
    let mut values: Vec<f64> = (0..table.c_deg().len()).map(|c| table.plane(c)[gamma]).collect();
    values.sort_by(f64::total_cmp);
    let median = values[values.len() / 2];
    values.iter().filter(|v| **v != median).count()
}

/// Whether a table is the same in every plane, except for one or two values.
fn has_odd_value(table: &LuminousIntensityDistribution) -> bool {
    if table.c_deg().len() < 3 {
        return false;
    }
    let odd: usize = (0..table.gamma_deg().len()).map(|g| odd_values_at(table, g)).sum();
    (1..=2).contains(&odd)
}

/// Adds the features of meter sets and of each meter.
fn add_meter_set_features(draft: &Draft, case: &Case, found: &mut FoundFeatures) {
    found.add(Feature::Grid, draft.spec.meters.values().any(|set| set.grid.is_some()));
    found.add(Feature::ManyMeters, case.meters.values().map(Vec::len).sum::<usize>() > 16);
    for normal in draft.spec.meters.values().filter_map(|set| set.normal) {
        let normal = DVec3::from(normal);
        found.add(Feature::SkewNormal, normal.to_array().iter().filter(|x| **x != 0.0).count() > 1);
        found.add(Feature::LongNormal, (normal.length() - 1.0).abs() > 1e-3);
    }
    for meter in case.meters.values().flatten() {
        add_meter_features(meter, &case.scene, found);
    }
}

/// Adds the features of where a meter is and where it faces.
fn add_meter_features(meter: &Meter, scene: &Scene, found: &mut FoundFeatures) {
    let p = meter.position_m;
    if let Some(room) = &scene.room {
        found.add(Feature::NearSurface, p.min(room.size_m - p).min_element() < NEAR_M);
    }
    let mut boxes = scene.obstacles.iter().filter_map(box_of);
    found.add(Feature::NearBody, boxes.any(|[min_m, max_m]| p.clamp(min_m, max_m).distance(p) < NEAR_M));
    for luminaire in &scene.luminaires {
        let ray = p - luminaire.position_m;
        let cosine = -ray.normalize().dot(meter.normal);
        found.add(Feature::Grazing, cosine.abs() < GRAZING_COSINE);
        found.add(Feature::LooksAway, cosine < 0.0);
        found.add(Feature::NearLuminaire, ray.length() < NEAR_LUMINAIRE_M);
        let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray);
        found.add(Feature::OnAxis, gamma.min(180.0 - gamma) < 1e-6);
        let offset_deg = (c.rem_euclid(90.0)).min(90.0 - c.rem_euclid(90.0));
        found.add(Feature::OnPlaneOfTable, offset_deg < 1e-6);
        let stretches: Vec<[f64; 2]> = scene.obstacles.iter().filter_map(|o| intersect_box(o, p, -ray)).collect();
        let is_clear = stretches.iter().all(|[enter, leave]| *leave < 0.0 || *enter > 1.0);
        found.add(Feature::BodyBehindLuminaire, is_clear && stretches.iter().any(|[enter, _]| *enter > 1.0));
        found.add(Feature::BodyBehindMeter, is_clear && stretches.iter().any(|[_, leave]| *leave < 0.0));
    }
}

/// The two parameters of a ray at which it enters and leaves a box; 0 is its start, 1 its end.
fn intersect_box(body: &Obstacle, from_m: DVec3, way: DVec3) -> Option<[f64; 2]> {
    let [min_m, max_m] = box_of(body)?;
    let (a, b) = ((min_m - from_m) / way, (max_m - from_m) / way);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    (enter < leave).then_some([enter, leave])
}

/// Which features specs had, and in which pairs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeatureCoverage {
    pub specs: usize,
    /// The number of specs that had each feature.
    pub features: BTreeMap<Feature, usize>,
    /// The pairs of features that met in a spec, under the first of them.
    pub pairs: BTreeMap<Feature, BTreeSet<Feature>>,
}

impl FeatureCoverage {
    /// Counts the features of one spec.
    pub(super) fn add(&mut self, features: &BTreeSet<Feature>) {
        self.specs += 1;
        for &feature in features {
            *self.features.entry(feature).or_default() += 1;
            self.pairs.entry(feature).or_default().extend(features.iter().filter(|other| **other > feature));
        }
    }

    /// The number of pairs that met, and the number of all pairs.
    pub fn pairs(&self) -> [usize; 2] {
        let n = Feature::VARIANTS.len();
        [self.pairs.values().map(BTreeSet::len).sum(), n * (n - 1) / 2]
    }

    /// The features that no spec had yet.
    pub fn missing(&self) -> Vec<Feature> {
        Feature::VARIANTS.iter().copied().filter(|f| !self.features.contains_key(f)).collect()
    }
}
