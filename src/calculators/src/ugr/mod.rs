//! Tables of the unified glare rating (UGR) of a luminaire in standard rooms.
//!
//! The rating is that of CIE 117-1995, equation 1, and the table that of CIE 190:2010:
//! `UGR = 8 lg (.25 / L_b sum L^2 w / p^2)`. The observer is at the middle of a wall and looks along the room. The
//! luminaires are in an even grid at the height H above the eye. Their spacing is H in CIE 190, and H / 4 in
//! catalogues, as EN 12464-1 requires. Values are *corrected*: for the luminaire's flux, not for 1000 lm.

mod background;
pub mod observer;
mod position;

#[cfg(test)]
mod tests;

pub use position::position_index;

use self::background::FirstFlux;
use luxproof_photometry::{NoLuminance, Photometry, Symmetry};

/// Width across the line of sight and depth along it, in units of H.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Across the line of sight.
    pub x: u32,
    /// Along it.
    pub y: u32,
}

impl Room {
    /// The room index k = X Y / (H (X + Y)).
    fn index(self) -> f64 {
        let (x, y) = (f64::from(self.x), f64::from(self.y));
        x * y / (x + y)
    }
}

/// The rooms of a table, in its order.
pub const ROOMS: [Room; 19] = {
    const fn room(x: u32, y: u32) -> Room {
        Room { x, y }
    }
    [
        room(2, 2),
        room(2, 3),
        room(2, 4),
        room(2, 6),
        room(2, 8),
        room(2, 12),
        room(4, 2),
        room(4, 3),
        room(4, 4),
        room(4, 6),
        room(4, 8),
        room(4, 12),
        room(8, 4),
        room(8, 6),
        room(8, 8),
        room(8, 12),
        room(12, 4),
        room(12, 6),
        room(12, 8),
    ]
};

/// Reflectances of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflectances {
    /// Ceiling.
    pub ceiling: f64,
    /// Walls.
    pub walls: f64,
    /// Reference plane.
    pub plane: f64,
}

/// The columns of a table, in its order.
pub const REFLECTANCES: [Reflectances; 5] = {
    const fn of(ceiling: f64, walls: f64) -> Reflectances {
        Reflectances { ceiling, walls, plane: 0.2 }
    }
    [of(0.7, 0.5), of(0.7, 0.3), of(0.5, 0.5), of(0.5, 0.3), of(0.3, 0.3)]
};

/// The spacing of luminaires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// H / 4: tables of catalogues.
    Quarter,
    /// H: the examples of CIE 190.
    Whole,
}

impl Spacing {
    /// Luminaires along a length H.
    const fn per_height(self) -> u32 {
        match self {
            Self::Quarter => 4,
            Self::Whole => 1,
        }
    }

    /// The spacing in units of H.
    pub fn over_height(self) -> f64 {
        1.0 / f64::from(self.per_height())
    }
}

/// Which side of the luminaire the observer looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum View {
    /// The long side.
    Crosswise,
    /// The end.
    Endwise,
}

/// One room of a table: a rating for each of [`REFLECTANCES`], `None` where no luminance reaches the observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UgrRow {
    /// The room.
    pub room: Room,
    /// Luminaires across the line of sight.
    pub crosswise: [Option<f64>; 5],
    /// Luminaires along it.
    pub endwise: [Option<f64>; 5],
}

/// The table of a luminaire.
#[derive(Clone, Debug, PartialEq)]
pub struct UgrTable {
    /// The plane of the observer in the crosswise view; in the endwise view it is 90 degrees further.
    pub crosswise_c_deg: f64,
    /// The spacing of luminaires.
    pub spacing: Spacing,
    /// A row for each of [`ROOMS`].
    pub rows: Vec<UgrRow>,
}

/// Why a luminaire has no table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoUgr {
    /// No light goes down to where an observer could see it.
    #[error("no light goes below the horizon towards the observer")]
    NothingBelow,
    /// No luminous area.
    #[error(transparent)]
    Luminance(#[from] NoLuminance),
    /// The table is of luminaires with two planes of symmetry.
    #[error(
        "the table is for luminaires that are symmetric about C 0 and about C 90, and this one is not within {percent:.0} % of its largest intensity"
    )]
    Lopsided {
        /// The largest allowed difference.
        percent: f64,
    },
}

/// The largest difference of a luminaire's four quarters, relative to the largest intensity. The table uses their mean.
const MAX_ASYMMETRY: f64 = 0.05;
/// H of the standard room in meters. Ratings do not depend on it: numerator and background fall with its square.
const HEIGHT_M: f64 = 2.0;

impl UgrTable {
    /// The table of a luminaire.
    pub fn of(photometry: &Photometry, spacing: Spacing) -> Result<Self, NoUgr> {
        let distribution = &photometry.distribution;
        // A luminaire without luminous area has none in any direction.
        if let Err(NoLuminance::Point) = photometry.luminance_cd_per_m2(0.0, 45.0) {
            return Err(NoLuminance::Point.into());
        }
        if !matches!(distribution.detected_symmetry(MAX_ASYMMETRY), Symmetry::Axial | Symmetry::Quadrant) {
            return Err(NoUgr::Lopsided { percent: 100.0 * MAX_ASYMMETRY });
        }
        let crosswise_c_deg = crosswise_c_deg(photometry);
        let views = [View::Crosswise, View::Endwise]
            .map(|view| GlareTerms::in_plane(photometry, view.c_deg(crosswise_c_deg), spacing));
        if views.iter().all(GlareTerms::is_dark) {
            return Err(NoUgr::NothingBelow);
        }
        let mut rows = vec![];
        for room in ROOMS {
            let first = FirstFlux::of(distribution, room).ok_or(NoUgr::NothingBelow)?;
            let [crosswise, endwise] = [&views[0], &views[1]].map(|glare| ratings(room, first, glare));
            rows.push(UgrRow { room, crosswise, endwise });
        }
        Ok(Self { crosswise_c_deg, spacing, rows })
    }
}

/// The ratings of a room for each of [`REFLECTANCES`], in one view.
fn ratings(room: Room, first: FirstFlux, glare: &GlareTerms) -> [Option<f64>; 5] {
    let count = f64::from(room.x * room.y * glare.per_height * glare.per_height);
    REFLECTANCES.map(|reflectances| {
        let background = background::luminance(room, reflectances, first, count, HEIGHT_M);
        let argument = 0.25 / background * glare.sum_in(room);
        (argument > 0.0 && argument.is_finite()).then(|| 8.0 * argument.log10())
    })
}

impl View {
    /// The plane of the observer.
    fn c_deg(self, crosswise_c_deg: f64) -> f64 {
        match self {
            Self::Crosswise => crosswise_c_deg,
            Self::Endwise => crosswise_c_deg + 90.0,
        }
    }
}

/// The plane that looks at the long side of the opening; a square one has its lamps along the axis of the file's
/// format.
fn crosswise_c_deg(photometry: &Photometry) -> f64 {
    let [width, length, _] = photometry.opening.bounding_box_m();
    let axis_c_deg = if length > width {
        0.0
    } else if width > length {
        90.0
    } else {
        photometry.convention().lamp_axis_c_deg
    };
    (axis_c_deg + 90.0) % 180.0
}

/// L^2 w / p^2 of every luminaire of the largest room, with both sides of the line of sight together.
struct GlareTerms {
    /// Luminaires along a length H.
    per_height: u32,
    /// `terms[sideways][along]`.
    terms: Vec<Vec<f64>>,
}

impl GlareTerms {
    /// The terms for an observer in a plane of the luminaire, below it and in front of it.
    fn in_plane(photometry: &Photometry, c_deg: f64, spacing: Spacing) -> Self {
        let per_height = spacing.per_height();
        let across = ROOMS.iter().map(|room| room.x).max().unwrap_or(0) * per_height;
        let along = ROOMS.iter().map(|room| room.y).max().unwrap_or(0) * per_height;
        let mut terms = vec![];
        for column in 0..across.div_ceil(2) {
            let sideways = (f64::from(column) + 0.5) * spacing.over_height();
            let ahead = (0..along).map(|row| (f64::from(row) + 0.5) * spacing.over_height());
            terms.push(ahead.map(|ahead| 2.0 * term(photometry, c_deg, sideways, ahead)).collect());
        }
        Self { per_height, terms }
    }

    /// Whether no light reaches the observer.
    fn is_dark(&self) -> bool {
        self.terms.iter().flatten().all(|term| *term == 0.0)
    }

    /// The sum over a room.
    fn sum_in(&self, room: Room) -> f64 {
        let (half, deep) = ((room.x * self.per_height / 2) as usize, (room.y * self.per_height) as usize);
        self.terms[..half].iter().flat_map(|column| &column[..deep]).sum()
    }
}

/// L^2 w / p^2 = I^2 / (A r^2 p^2) of a luminaire at a place in units of H; 0 beyond the position table.
fn term(photometry: &Photometry, c_deg: f64, sideways: f64, ahead: f64) -> f64 {
    let Some(index) = position_index(sideways / ahead, 1.0 / ahead) else { return 0.0 };
    let turned = sideways.atan2(ahead).to_degrees();
    let square = sideways * sideways + ahead * ahead;
    let gamma_deg = square.sqrt().atan().to_degrees();
    // The same direction in the four quarters of a luminaire that is nearly symmetric.
    let images = [c_deg + turned, c_deg - turned, c_deg + 180.0 + turned, c_deg + 180.0 - turned];
    let candela = mean(images.map(|c| photometry.distribution.intensity(c, gamma_deg).value()));
    let area_m2 = mean(images.map(|c| photometry.projected_area_m2(c, gamma_deg)));
    let distance_m = HEIGHT_M * (square + 1.0).sqrt();
    if area_m2 > 0.0 { (candela / (distance_m * index)).powi(2) / area_m2 } else { 0.0 }
}

/// The mean of four values.
fn mean(values: [f64; 4]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
