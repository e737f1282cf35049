//! How direct light falls with distance, as engines that draw rather than measure have it.

/// The factor on intensity and cosine at a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DistanceLaw {
    /// The distance to this negative power; 2 is right.
    Power(f64),
    /// The inverse square, faded out towards a range: (1 - (d/range)^steepness)^power, and dark beyond.
    Window { range_m: f64, steepness: i32, power: i32 },
    /// 1/(d² + r²).
    Softened(f64),
    /// 1/max(d², r²).
    AtLeast(f64),
    /// 1/(r + d)^power.
    Shifted { by_m: f64, power: f64 },
    /// The inverse square up to this distance, and darkness beyond.
    CutOff(f64),
}

impl DistanceLaw {
    pub(super) const RIGHT: Self = Self::Power(2.0);

    pub(super) fn attenuation(self, distance_m: f64) -> f64 {
        let inverse_square = distance_m.powi(-2);
        match self {
            // The usual law without the rounding of a general power.
            Self::Power(2.0) => inverse_square,
            Self::Power(power) => distance_m.powf(-power),
            Self::Window { range_m, steepness, power } => {
                inverse_square * (1.0 - (distance_m / range_m).powi(steepness)).max(0.0).powi(power)
            }
            Self::Softened(radius_m) => (distance_m.powi(2) + radius_m.powi(2)).recip(),
            Self::AtLeast(radius_m) => distance_m.max(radius_m).powi(-2),
            Self::Shifted { by_m, power } => (by_m + distance_m).powf(-power),
            Self::CutOff(range_m) => {
                if distance_m > range_m {
                    0.0
                } else {
                    inverse_square
                }
            }
        }
    }
}
