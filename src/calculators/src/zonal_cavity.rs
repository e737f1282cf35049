//! Zonal cavity method: coefficients of utilization and of exitance of a room, modeled as three cavities.
//!
//! IES LM-57 and ANSI/IES LS-6 (lumen method). The module has the C0-C3 formulas and the 3 x 3 balance of the same
//! three surfaces, since each verifies the other. Zonal flux is integrated exactly over the bilinear table, where LM-57
//! takes mid-zone intensities.

use glam::{DMat3, DVec3};

use super::zonal_multiplier::ZonalMultipliers;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::geometry::configuration_factor::opposed_rectangles;

/// Coefficients of a luminaire in a room. Multiplied by lamp flux over floor area they give illuminance and exitance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// CU: mean illuminance of the work plane.
    pub utilization: f64,
    /// CCEC: mean exitance of the ceiling cavity's opening.
    pub ceiling_cavity_exitance: f64,
    /// WEC: mean exitance of the walls.
    pub wall_exitance: f64,
    /// WDRC: mean direct illuminance of the walls.
    pub wall_direct: f64,
    /// D: part of the downward flux that reaches the work plane directly.
    pub direct_ratio: f64,
}

/// Computes the coefficients by the closed C0-C3 formulas.
///
/// `zonal` over `lamp_lumens` gives the flux fractions; pass the luminaire's own flux for absolute photometry.
pub fn coefficients(
    zonal: &ZonalFlux,
    lamp_lumens: f64,
    cavity: &Cavity,
    reflectance: &CavityReflectances,
    multipliers: &ZonalMultipliers,
) -> Result<Coefficients, ZonalCavityError> {
    reflectance.check()?;
    let (down, up) = zonal.fractions(lamp_lumens)?;
    let (g, f) = (cavity.ratio, cavity.form_factor);
    let (w, c, b) = (reflectance.walls, reflectance.ceiling_cavity, reflectance.floor_cavity);
    if g <= 0.0 {
        return Ok(Coefficients::without_room_cavity(down, up, c, b));
    }
    let d = zonal.direct_ratio(&multipliers.at(g));
    let c1 = (1.0 - w) * (1.0 - f * f) * g / (2.5 * w * (1.0 - f * f) + g * f * (1.0 - w));
    let c2 = (1.0 - c) * (1.0 + f) / (1.0 + c * f);
    let c3 = (1.0 - b) * (1.0 + f) / (1.0 + b * f);
    let c0 = c1 + c2 + c3;
    let (walls, ceiling, floor) = ((1.0 - d) * down / (1.0 - w), up / (1.0 - c), d * down / (1.0 - b));
    Ok(Coefficients {
        utilization: 2.5 * w * c1 * c3 * walls / (g * (1.0 - b) * c0)
            + c * c2 * c3 * ceiling / ((1.0 - b) * c0)
            + (1.0 - b * c3 * (c1 + c2) / ((1.0 - b) * c0)) * floor,
        ceiling_cavity_exitance: 2.5 * w * c * c1 * c2 * walls / (g * (1.0 - c) * c0)
            + c * ceiling * (1.0 - c * c2 * (c1 + c3) / ((1.0 - c) * c0))
            + c * b * c2 * c3 * floor / ((1.0 - c) * c0),
        wall_exitance: 2.5 / g
            * (w * walls * (1.0 - 2.5 * w * c1 * (c2 + c3) / (g * (1.0 - w) * c0))
                + w * c * c1 * c2 * ceiling / ((1.0 - w) * c0)
                + w * b * c1 * c3 * floor / ((1.0 - w) * c0)),
        wall_direct: 2.5 * down * (1.0 - d) / g,
        direct_ratio: d,
    })
}

/// Computes the coefficients by solving E = E0 + F rho E for floor, ceiling and walls, as a cross-check.
pub fn balance(
    zonal: &ZonalFlux,
    lamp_lumens: f64,
    cavity: &Cavity,
    reflectance: &CavityReflectances,
    multipliers: &ZonalMultipliers,
) -> Result<Coefficients, ZonalCavityError> {
    reflectance.check()?;
    let (down, up) = zonal.fractions(lamp_lumens)?;
    let (g, f) = (cavity.ratio, cavity.form_factor);
    if g <= 0.0 {
        return Ok(Coefficients::without_room_cavity(down, up, reflectance.ceiling_cavity, reflectance.floor_cavity));
    }
    let d = zonal.direct_ratio(&multipliers.at(g));
    let wall_area = g / 2.5;
    let a = (1.0 - f) / wall_area;
    let rho = DVec3::new(reflectance.floor_cavity, reflectance.ceiling_cavity, reflectance.walls);
    let factors =
        DMat3::from_cols(DVec3::new(0.0, f, a), DVec3::new(f, 0.0, a), DVec3::new(1.0 - f, 1.0 - f, 1.0 - 2.0 * a));
    let first = DVec3::new(d * down, up, (1.0 - d) * down / wall_area);
    let incident = (DMat3::IDENTITY - factors * DMat3::from_diagonal(rho)).inverse() * first;
    Ok(Coefficients {
        utilization: incident.x,
        ceiling_cavity_exitance: incident.y * rho.y,
        wall_exitance: incident.z * rho.z,
        wall_direct: first.z,
        direct_ratio: d,
    })
}

/// Flux in the 18 zones of 10 degrees, nadir first, in lumens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZonalFlux(pub [f64; 18]);

/// One of the three cavities: its depth relative to its plan, and the form factor of its two planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cavity {
    /// Cavity ratio, 5 h (L + W) / (L W) or 2.5 h perimeter / area.
    pub ratio: f64,
    /// Form factor between the two planes that bound it.
    pub form_factor: f64,
}

/// Reflectances of the room cavity's surfaces, each within 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CavityReflectances {
    /// Effective reflectance of the ceiling cavity.
    pub ceiling_cavity: f64,
    /// Mean reflectance of the walls.
    pub walls: f64,
    /// Effective reflectance of the floor cavity.
    pub floor_cavity: f64,
}

/// Why there are no coefficients.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ZonalCavityError {
    /// A reflectance that the formulas cannot take.
    #[error("the reflectance of the {surface} is {value}; the zonal cavity method needs 0 <= rho < 1")]
    Reflectance {
        /// Which surface.
        surface: &'static str,
        /// Its reflectance.
        value: f64,
    },
    /// A lamp flux that cannot divide the zonal flux.
    #[error("the lamp flux is {lumens} lm; coefficients need a positive one")]
    Flux {
        /// The flux given.
        lumens: f64,
    },
}

impl ZonalFlux {
    /// Zonal flux of a luminaire in its own, upright frame; exact for the bilinear table.
    pub fn of(distribution: &LuminousIntensityDistribution) -> Self {
        Self(std::array::from_fn(|zone| {
            let low = 10.0 * zone as f64;
            distribution.flux_between(low, low + 10.0).value()
        }))
    }

    /// The sum of two luminaires' zonal fluxes.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|zone| self.0[zone] + other.0[zone]))
    }

    /// The part below the horizon.
    #[must_use]
    pub fn downward(&self) -> Self {
        Self(std::array::from_fn(|zone| if zone < 9 { self.0[zone] } else { 0.0 }))
    }

    /// The zonal flux of a dimmed luminaire.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0.map(|flux| flux * factor))
    }

    /// Flux below the horizon in lumens.
    pub fn down_lm(&self) -> f64 {
        self.0[..9].iter().sum()
    }

    /// Flux above the horizon in lumens.
    pub fn up_lm(&self) -> f64 {
        self.0[9..].iter().sum()
    }

    /// D: the share of the downward flux that reaches the work plane directly, 0 without downward flux.
    pub fn direct_ratio(&self, multipliers: &[f64; 9]) -> f64 {
        let down = self.down_lm();
        if down <= 0.0 {
            return 0.0;
        }
        self.0.iter().zip(multipliers).map(|(flux, k)| flux * k).sum::<f64>() / down
    }

    /// Downward and upward flux over lamp flux.
    fn fractions(&self, lamp_lumens: f64) -> Result<(f64, f64), ZonalCavityError> {
        if lamp_lumens > 0.0 && lamp_lumens.is_finite() {
            Ok((self.down_lm() / lamp_lumens, self.up_lm() / lamp_lumens))
        } else {
            Err(ZonalCavityError::Flux { lumens: lamp_lumens })
        }
    }
}

impl Cavity {
    /// A cavity of the given ratio with the fitted form factor of LM-57 (a 1.6:1 plan).
    pub fn lm57(ratio: f64) -> Self {
        let form_factor =
            if ratio > 0.0 { 0.026 + 0.503 * (-0.270 * ratio).exp() + 0.470 * (-0.119 * ratio).exp() } else { 1.0 };
        Self { ratio, form_factor }
    }

    /// A rectangular cavity with its exact form factor.
    pub fn rectangular(width_m: f64, length_m: f64, height_m: f64) -> Self {
        let form_factor = if height_m > 0.0 { opposed_rectangles(width_m, length_m, height_m) } else { 1.0 };
        Self { ratio: cavity_ratio(width_m, length_m, height_m), form_factor }
    }

    /// Effective reflectance of the opening of this cavity with the given base and walls (LM-57).
    pub fn effective_reflectance(&self, base: f64, walls: f64) -> f64 {
        if self.ratio <= 0.0 {
            return base;
        }
        let (r, f) = (2.5 / self.ratio, self.form_factor);
        let once = r * (1.0 - f) * (1.0 - f);
        (base * walls * f * (2.0 * r * (1.0 - f) - f) + base * f * f + walls * once)
            / (1.0 - base * walls * once - walls * (1.0 - 2.0 * r * (1.0 - f)))
    }
}

/// 5 h (L + W) / (L W).
pub fn cavity_ratio(width_m: f64, length_m: f64, height_m: f64) -> f64 {
    5.0 * height_m * (width_m + length_m) / (width_m * length_m)
}

impl CavityReflectances {
    /// Refuses reflectances outside 0..1.
    fn check(&self) -> Result<(), ZonalCavityError> {
        let surfaces =
            [("ceiling cavity", self.ceiling_cavity), ("walls", self.walls), ("floor cavity", self.floor_cavity)];
        for (surface, value) in surfaces {
            if !(0.0..1.0).contains(&value) {
                return Err(ZonalCavityError::Reflectance { surface, value });
            }
        }
        Ok(())
    }
}

impl Coefficients {
    /// The coefficients where the luminaires lie in the work plane, so that light only crosses between two cavities.
    fn without_room_cavity(down: f64, up: f64, ceiling: f64, floor: f64) -> Self {
        let crossing = 1.0 - ceiling * floor;
        Self {
            utilization: (down + ceiling * up) / crossing,
            ceiling_cavity_exitance: ceiling * (up + floor * down) / crossing,
            wall_exitance: 0.0,
            wall_direct: 0.0,
            direct_ratio: 1.0,
        }
    }
}

/// Coefficients of utilization over room cavity ratios and reflectances, as photometric reports print them.
#[derive(Clone, Debug, PartialEq)]
pub struct UtilizationTable {
    /// Effective reflectance of the floor cavity.
    pub floor_cavity: f64,
    /// (effective ceiling cavity reflectance, wall reflectance) of each column.
    pub columns: Vec<(f64, f64)>,
    /// Coefficients for room cavity ratio 0, 1, ... 10, one a column.
    pub rows: Vec<Vec<Coefficients>>,
}

impl UtilizationTable {
    /// The customary table: floor cavity .20, ceiling cavity .80 .70 .50 .30 .10 .0, walls .70 .50 .30 .10.
    ///
    /// Room cavity ratios are 0 to 10. The columns are those that photometric reports print.
    pub fn customary(zonal: &ZonalFlux, lamp_lumens: f64) -> Result<Self, ZonalCavityError> {
        let columns: Vec<(f64, f64)> = [
            (0.80, &[0.70, 0.50, 0.30, 0.10][..]),
            (0.70, &[0.70, 0.50, 0.30, 0.10]),
            (0.50, &[0.50, 0.30, 0.10]),
            (0.30, &[0.50, 0.30, 0.10]),
            (0.10, &[0.50, 0.30, 0.10]),
            (0.0, &[0.0]),
        ]
        .iter()
        .flat_map(|(ceiling, walls)| walls.iter().map(|wall| (*ceiling, *wall)))
        .collect();
        let floor_cavity = 0.20;
        let mut rows = vec![];
        for ratio in 0..=10 {
            let cavity = Cavity::lm57(f64::from(ratio));
            let mut row = vec![];
            for &(ceiling_cavity, walls) in &columns {
                let reflectance = CavityReflectances { ceiling_cavity, walls, floor_cavity };
                row.push(coefficients(zonal, lamp_lumens, &cavity, &reflectance, &ZonalMultipliers::LM57)?);
            }
            rows.push(row);
        }
        Ok(Self { floor_cavity, columns, rows })
    }
}

#[cfg(test)]
#[path = "zonal_cavity_tests.rs"]
mod tests;
