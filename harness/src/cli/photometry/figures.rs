//! The figures of a photometric report as a record: units in the keys, and in words why a figure is missing.

use std::path::Path;

use luminaire::calculators::ugr::{REFLECTANCES, Spacing, UgrTable};
use luminaire::photometry::{Beam, BeamPlane, BeamWidth, BugRating, PeakShape, Photometry};
use luminaire::units::Lumen;
use serde::Serialize;

/// Changes when a key changes its meaning or goes.
pub(super) const SCHEMA: &str = "luxproof-photometric-report/1";

/// Limits of the zones that reports add up, in degrees of gamma.
const SUMS_DEG: [[f64; 2]; 15] = [
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

/// A figure, or why there is none.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(super) enum Figure<T> {
    Is(T),
    No { not_available: String },
}

impl<T> Figure<T> {
    /// The figure in words, or the reason.
    pub(super) fn told(&self, of: impl FnOnce(&T) -> String) -> String {
        match self {
            Self::Is(figure) => of(figure),
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
    /// Width of the zones whose constants were used.
    pub(super) mid_zone_width_deg: Figure<f64>,
    /// Of 10 degrees.
    pub(super) zones: Vec<Zone>,
    pub(super) sums: Vec<Zone>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Zone {
    pub(super) from_deg: f64,
    pub(super) to_deg: f64,
    /// By zonal constants.
    pub(super) mid_zone_lm: Option<f64>,
    /// Of the interpolated table.
    pub(super) exact_lm: f64,
    /// By zonal constants less exact.
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
    /// `one`, `several` or `ring`: the axis is in their middle where they make one beam.
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
    /// The plane from which the observer looks at it crosswise.
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
    /// One for each of `reflectances`; `null` where no luminance reaches the observer.
    pub(super) crosswise: [Option<f64>; 5],
    pub(super) endwise: [Option<f64>; 5],
}

impl Figures {
    pub(super) fn of(file: &Path, photometry: &Photometry, spacing: Spacing) -> Self {
        let distribution = &photometry.distribution;
        let flux = distribution.flux();
        let beam = distribution.beam();
        let record = |beam: &Beam| BeamRecord::of(beam, photometry);
        let forward_c_deg = photometry.convention().forward_c_deg;
        let code = distribution.cie_flux_code(Lumen(photometry.lamp_lumens.unwrap_or(flux.value())));
        let spacing_record = |s: luminaire::photometry::SpacingCriteria| SpacingRecord {
            along_c0_c180: s.along_c0,
            along_c90_c270: s.along_c90,
            diagonal: s.diagonal,
        };
        Self {
            schema: SCHEMA,
            file: file.display().to_string(),
            format: photometry.format.clone(),
            luminaire: photometry.keyword("LUMINAIRE").or(photometry.keyword("LUMCAT")).map(str::to_owned),
            lamp_lumens: photometry.lamp_lumens,
            flux_lm: flux.value(),
            zonal_lumens: ZonalLumens::of(photometry),
            nema_type: beam.and_then(|beam| distribution.nema_types(&beam)).map(Nema::from).into(),
            beam: beam.as_ref().map(record).into(),
            bug: distribution.bug_rating(forward_c_deg).map(|rating| Bug::of(&rating, forward_c_deg)).into(),
            cie_flux_code_percent: code.ok_or("nothing goes below the horizon, or no flux to divide by").into(),
            spacing_criterion: distribution.spacing_criteria().map(spacing_record).into(),
            luminance: Luminances::of(photometry),
            ugr: UgrTable::of(photometry, spacing).map(|table| Ugr::of(&table)).into(),
        }
    }
}

impl ZonalLumens {
    fn of(photometry: &Photometry) -> Self {
        let distribution = &photometry.distribution;
        let (by_constants, flux_lm) = (distribution.mid_zone_flux(), distribution.flux().value());
        let zone = |from_deg: f64, to_deg: f64| {
            let exact_lm = distribution.flux_between(from_deg, to_deg).value();
            let mid_zone_lm = by_constants.as_ref().ok().map(|flux| flux.between(from_deg, to_deg).value());
            Zone {
                from_deg,
                to_deg,
                mid_zone_lm,
                exact_lm,
                difference_lm: mid_zone_lm.map(|lm| lm - exact_lm),
                percent_of_flux: (flux_lm > 0.0).then(|| 100.0 * exact_lm / flux_lm),
            }
        };
        let tens = (0..18).map(|k| 10.0 * f64::from(k));
        Self {
            zones: tens.map(|low| zone(low, low + 10.0)).collect(),
            sums: SUMS_DEG.map(|[from, to]| zone(from, to)).to_vec(),
            mid_zone_width_deg: by_constants.map(|flux| flux.width_deg).into(),
        }
    }
}

impl BeamRecord {
    fn of(beam: &Beam, photometry: &Photometry) -> Self {
        let width = |plane: BeamPlane, fraction: f64| -> Figure<Width> {
            photometry.distribution.beam_width(beam, plane, fraction).map(Width::from).into()
        };
        let widths = |plane| Widths { beam_angle: width(plane, 0.5), field_angle: width(plane, 0.1) };
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
            vertical_plane: widths(BeamPlane::Vertical),
            plane_across: widths(BeamPlane::Across),
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
    fn of(rating: &BugRating, forward_c_deg: f64) -> Self {
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
    fn of(photometry: &Photometry) -> Self {
        let c_deg = [0.0, 45.0, 90.0];
        let row = |gamma_deg: f64| LuminanceRow {
            gamma_deg,
            cd_per_m2: c_deg.map(|c| photometry.luminance_cd_per_m2(c, gamma_deg).into()),
        };
        Self { c_deg, rows: [45.0, 55.0, 65.0, 75.0, 85.0].map(row).to_vec() }
    }
}

impl Ugr {
    fn of(table: &UgrTable) -> Self {
        let room = |row: &luminaire::calculators::ugr::UgrRow| UgrRoom {
            x_over_height: row.room.x,
            y_over_height: row.room.y,
            crosswise: row.crosswise,
            endwise: row.endwise,
        };
        let surfaces = REFLECTANCES.map(|r| Surfaces { ceiling: r.ceiling, walls: r.walls, plane: r.plane }).to_vec();
        Self {
            spacing_over_height: table.spacing.over_height(),
            crosswise_c_deg: table.crosswise_c_deg,
            reflectances: surfaces,
            rooms: table.rows.iter().map(room).collect(),
        }
    }
}
