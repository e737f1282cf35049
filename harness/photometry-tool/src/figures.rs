//! The figures of a photometric report as a record: units in the keys, and a reason for each missing figure.

use std::path::Path;

use luxproof_calculators::ugr::{REFLECTANCES, Spacing, UgrRow, UgrTable};
use luxproof_photometry::units::Lumen;
use luxproof_photometry::{
    Beam, BeamPlane, BeamWidth, BugRating, LuminousIntensityDistribution, MidZoneFlux, PeakShape, Photometry,
    SpacingCriteria,
};
use serde::Serialize;

/// Changes when a key changes its meaning or goes.
pub(super) const SCHEMA: &str = "luxproof-photometric-report/1";

/// Limits of the summed zones in degrees of gamma.
const SUM_LIMITS_DEG: [[f64; 2]; 15] = [
    [0.0, 20.0],
    [0.0, 30.0],
    [0.0, 40.0],
    [0.0, 60.0],
    [0.0, 80.0],
    [0.0, 90.0],
    [60.0, 80.0],
    [60.0, 90.0],
    [70.0, 80.0],
    [80.0, 90.0],
    [90.0, 110.0],
    [90.0, 120.0],
    [90.0, 150.0],
    [90.0, 180.0],
    [0.0, 180.0],
];

/// A figure, or the reason why there is none.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(super) enum Figure<T> {
    Is(T),
    No { not_available: String },
}

impl<T> Figure<T> {
    /// The figure that follows from this one, or the reason why this one is missing.
    pub(super) fn and_then<U>(&self, follow: impl FnOnce(&T) -> Figure<U>) -> Figure<U> {
        match self {
            Self::Is(figure) => follow(figure),
            Self::No { not_available } => Figure::No { not_available: not_available.clone() },
        }
    }

    /// Formats the figure, or the reason.
    pub(super) fn describe(&self, format: impl FnOnce(&T) -> String) -> String {
        match self {
            Self::Is(figure) => format(figure),
            Self::No { not_available } => format!("not available: {not_available}"),
        }
    }
}

impl<T, E: std::fmt::Display> From<Result<T, E>> for Figure<T> {
    fn from(result: Result<T, E>) -> Self {
        match result {
            Ok(figure) => Self::Is(figure),
            Err(reason) => Self::No { not_available: reason.to_string() },
        }
    }
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Figures {
    pub(super) schema: &'static str,
    pub(super) file: String,
    pub(super) format: String,
    pub(super) luminaire: Option<String>,
    pub(super) lamp_lumens: Option<f64>,
    pub(super) flux_lm: f64,
    pub(super) zonal_lumens: ZonalLumens,
    pub(super) beam: Figure<BeamRecord>,
    pub(super) nema_type: Figure<Nema>,
    pub(super) bug: Figure<Bug>,
    pub(super) cie_flux_code_percent: Figure<[f64; 5]>,
    pub(super) spacing_criterion: Figure<SpacingRecord>,
    pub(super) luminance: Luminances,
    pub(super) ugr: Figure<Ugr>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct ZonalLumens {
    /// Width of the zones of the zonal constants.
    pub(super) mid_zone_width_deg: Figure<f64>,
    /// Zones of 10 degrees.
    pub(super) zones: Vec<Zone>,
    pub(super) sums: Vec<Zone>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Zone {
    pub(super) from_deg: f64,
    pub(super) to_deg: f64,
    /// By zonal constants.
    pub(super) mid_zone_lm: Option<f64>,
    /// The flux of the interpolated table.
    pub(super) exact_lm: f64,
    /// The flux by zonal constants minus the exact one.
    pub(super) difference_lm: Option<f64>,
    pub(super) percent_of_flux: Option<f64>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct BeamRecord {
    pub(super) axis_c_deg: f64,
    pub(super) axis_gamma_deg: f64,
    pub(super) peak_cd: f64,
    pub(super) peak_c_deg: f64,
    pub(super) peak_gamma_deg: f64,
    /// `one`, `several` or `ring`. The axis is the middle of several peaks of one beam.
    pub(super) peaks: &'static str,
    pub(super) is_one_beam: bool,
    pub(super) vertical_plane: Widths,
    pub(super) plane_across: Widths,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Widths {
    /// To half the largest intensity.
    pub(super) beam_angle: Figure<Width>,
    /// To a tenth.
    pub(super) field_angle: Figure<Width>,
}

#[derive(Clone, Copy, Debug, Serialize)]
#[allow(clippy::struct_field_names, reason = "units stand in the keys")]
pub(super) struct Width {
    pub(super) full_deg: f64,
    /// Upwards or towards C 0; across: towards C 90.
    pub(super) one_side_deg: f64,
    pub(super) other_side_deg: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Nema {
    pub(super) horizontal: u8,
    pub(super) vertical: u8,
    /// `6H x 5V`.
    pub(super) designation: String,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Bug {
    /// `B2-U0-G1`.
    pub(super) rating: String,
    pub(super) backlight: u8,
    pub(super) uplight: u8,
    pub(super) glare: u8,
    pub(super) is_quadrilaterally_symmetric: bool,
    pub(super) glare_if_symmetric: u8,
    pub(super) glare_if_asymmetric: u8,
    pub(super) forward_c_deg: f64,
    /// 0-30, 30-60, 60-80 and 80-90 degrees.
    pub(super) forward_lm: [f64; 4],
    pub(super) back_lm: [f64; 4],
    /// 90-100 and 100-180 degrees.
    pub(super) up_lm: [f64; 2],
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct SpacingRecord {
    pub(super) along_c0_c180: f64,
    pub(super) along_c90_c270: f64,
    pub(super) diagonal: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Luminances {
    pub(super) c_deg: [f64; 3],
    pub(super) rows: Vec<LuminanceRow>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct LuminanceRow {
    pub(super) gamma_deg: f64,
    pub(super) cd_per_m2: [Figure<f64>; 3],
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Ugr {
    pub(super) spacing_over_height: f64,
    /// The plane of the observer's crosswise view.
    pub(super) crosswise_c_deg: f64,
    pub(super) reflectances: Vec<Surfaces>,
    pub(super) rooms: Vec<UgrRoom>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Surfaces {
    pub(super) ceiling: f64,
    pub(super) walls: f64,
    pub(super) plane: f64,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct UgrRoom {
    pub(super) x_over_height: u32,
    pub(super) y_over_height: u32,
    /// One rating for each of `reflectances`; `null` where no luminance reaches the observer.
    pub(super) crosswise: [Option<f64>; 5],
    pub(super) endwise: [Option<f64>; 5],
}

impl Figures {
    /// Computes all figures.
    pub(super) fn compute(file: &Path, photometry: &Photometry, spacing: Spacing) -> Self {
        let distribution = &photometry.distribution;
        let flux = distribution.flux();
        let beam = distribution.beam();
        let forward_c_deg = photometry.convention().forward_c_deg;
        Self {
            schema: SCHEMA,
            file: file.display().to_string(),
            format: photometry.format.clone(),
            luminaire: photometry.keyword("LUMINAIRE").or(photometry.keyword("LUMCAT")).map(str::to_owned),
            lamp_lumens: photometry.lamp_lumens,
            flux_lm: flux.value(),
            zonal_lumens: ZonalLumens::compute(&photometry.distribution),
            nema_type: beam.and_then(|beam| distribution.nema_types(&beam)).map(Nema::from).into(),
            beam: beam_record(distribution),
            bug: distribution.bug_rating(forward_c_deg).map(|rating| Bug::new(&rating, forward_c_deg)).into(),
            cie_flux_code_percent: flux_code(photometry),
            spacing_criterion: spacing_record(distribution),
            luminance: Luminances::compute(photometry),
            ugr: UgrTable::of(photometry, spacing).map(|table| Ugr::from(&table)).into(),
        }
    }
}

/// The beam with its angles.
pub(super) fn beam_record(distribution: &LuminousIntensityDistribution) -> Figure<BeamRecord> {
    distribution.beam().map(|beam| BeamRecord::compute(&beam, distribution)).into()
}

/// The CIE flux code in percent.
pub(super) fn flux_code(photometry: &Photometry) -> Figure<[f64; 5]> {
    let lamp_lm = photometry.lamp_lumens.map_or_else(|| photometry.distribution.flux(), Lumen);
    let code = photometry.distribution.cie_flux_code(lamp_lm);
    code.ok_or("nothing goes below the horizon, or no flux to divide by").into()
}

/// The spacing criteria.
pub(super) fn spacing_record(distribution: &LuminousIntensityDistribution) -> Figure<SpacingRecord> {
    distribution.spacing_criteria().map(SpacingRecord::from).into()
}

impl SpacingRecord {
    /// The criteria as one line.
    pub(super) fn describe(&self) -> String {
        let Self { along_c0_c180, along_c90_c270, diagonal } = self;
        format!("0-180 {along_c0_c180:.2}, 90-270 {along_c90_c270:.2}, diagonal {diagonal:.2}")
    }
}

impl From<SpacingCriteria> for SpacingRecord {
    fn from(criteria: SpacingCriteria) -> Self {
        Self { along_c0_c180: criteria.along_c0, along_c90_c270: criteria.along_c90, diagonal: criteria.diagonal }
    }
}

impl ZonalLumens {
    /// Computes the flux in zones of 10 degrees and in their customary sums.
    fn compute(distribution: &LuminousIntensityDistribution) -> Self {
        let by_constants = distribution.mid_zone_flux();
        let mid_zones = by_constants.as_ref().ok();
        let tens = (0..18).map(|k| 10.0 * f64::from(k));
        Self {
            zones: tens.map(|low| Zone::compute(distribution, mid_zones, [low, low + 10.0])).collect(),
            sums: SUM_LIMITS_DEG.map(|limits_deg| Zone::compute(distribution, mid_zones, limits_deg)).to_vec(),
            mid_zone_width_deg: by_constants.map(|flux| flux.width_deg).into(),
        }
    }
}

impl Zone {
    /// Computes the flux of one zone, exactly and by zonal constants.
    fn compute(
        distribution: &LuminousIntensityDistribution,
        mid_zones: Option<&MidZoneFlux>,
        [from_deg, to_deg]: [f64; 2],
    ) -> Self {
        let flux_lm = distribution.flux().value();
        let exact_lm = distribution.flux_between(from_deg, to_deg).value();
        let mid_zone_lm = mid_zones.map(|flux| flux.between(from_deg, to_deg).value());
        Self {
            from_deg,
            to_deg,
            mid_zone_lm,
            exact_lm,
            difference_lm: mid_zone_lm.map(|lm| lm - exact_lm),
            percent_of_flux: (flux_lm > 0.0).then(|| 100.0 * exact_lm / flux_lm),
        }
    }
}

impl Widths {
    /// Computes the beam and field angle in a plane.
    fn compute(distribution: &LuminousIntensityDistribution, beam: &Beam, plane: BeamPlane) -> Self {
        let [beam_angle, field_angle] =
            [0.5, 0.1].map(|fraction| distribution.beam_width(beam, plane, fraction).map(Width::from).into());
        Self { beam_angle, field_angle }
    }
}

impl BeamRecord {
    /// Computes the widths of a beam.
    fn compute(beam: &Beam, distribution: &LuminousIntensityDistribution) -> Self {
        Self {
            axis_c_deg: beam.c_deg,
            axis_gamma_deg: beam.gamma_deg,
            peak_cd: beam.peak.value(),
            peak_c_deg: beam.peak_deg[0],
            peak_gamma_deg: beam.peak_deg[1],
            is_one_beam: beam.is_one_beam,
            peaks: match beam.shape {
                PeakShape::One => "one",
                PeakShape::Several(_) => "several",
                PeakShape::Ring => "ring",
            },
            vertical_plane: Widths::compute(distribution, beam, BeamPlane::Vertical),
            plane_across: Widths::compute(distribution, beam, BeamPlane::Across),
        }
    }
}

impl From<BeamWidth> for Width {
    fn from(width: BeamWidth) -> Self {
        let BeamWidth { one_side_deg, other_side_deg } = width;
        Self { full_deg: width.full_deg(), one_side_deg, other_side_deg }
    }
}

impl From<[u8; 2]> for Nema {
    fn from([horizontal, vertical]: [u8; 2]) -> Self {
        Self { horizontal, vertical, designation: format!("{horizontal}H x {vertical}V") }
    }
}

impl Bug {
    /// The record of a rating.
    fn new(rating: &BugRating, forward_c_deg: f64) -> Self {
        let (backlight, uplight, glare) = (rating.backlight, rating.uplight, rating.glare());
        Self {
            rating: format!("B{backlight}-U{uplight}-G{glare}"),
            backlight,
            uplight,
            glare,
            is_quadrilaterally_symmetric: rating.is_symmetric,
            glare_if_symmetric: rating.glare_symmetric,
            glare_if_asymmetric: rating.glare_asymmetric,
            forward_c_deg,
            forward_lm: rating.zones.forward.map(Lumen::value),
            back_lm: rating.zones.back.map(Lumen::value),
            up_lm: rating.zones.up.map(Lumen::value),
        }
    }
}

impl Luminances {
    /// Computes the customary table of luminances.
    fn compute(photometry: &Photometry) -> Self {
        let c_deg = [0.0, 45.0, 90.0];
        let rows = [45.0, 55.0, 65.0, 75.0, 85.0].map(|gamma_deg| LuminanceRow {
            gamma_deg,
            cd_per_m2: c_deg.map(|c| photometry.luminance_cd_per_m2(c, gamma_deg).into()),
        });
        Self { c_deg, rows: rows.to_vec() }
    }
}

impl From<&UgrRow> for UgrRoom {
    fn from(row: &UgrRow) -> Self {
        Self { x_over_height: row.room.x, y_over_height: row.room.y, crosswise: row.crosswise, endwise: row.endwise }
    }
}

impl From<&UgrTable> for Ugr {
    fn from(table: &UgrTable) -> Self {
        let surfaces = REFLECTANCES.map(|r| Surfaces { ceiling: r.ceiling, walls: r.walls, plane: r.plane }).to_vec();
        Self {
            spacing_over_height: table.spacing.over_height(),
            crosswise_c_deg: table.crosswise_c_deg,
            reflectances: surfaces,
            rooms: table.rows.iter().map(UgrRoom::from).collect(),
        }
    }
}
