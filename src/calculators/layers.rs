//! A scene as IP-ED sees it: an empty room of mean reflectances, and the zonal flux of its luminaires by their height.

use std::sync::atomic::AtomicBool;

use super::NotApplicable;
use super::room_flux::RoomFluxes;
use super::zonal_cavity::{Cavity, CavityReflectances, Coefficients, ZonalFlux, coefficients};
use super::zonal_multiplier::ZonalMultipliers;
use crate::geometry::{Room, Surface};
use crate::scene::{Obstacle, Scene, flush};
use crate::units::{Lumen, LumenPerSquareMetre, Lux};

/// The zonal cavity solution that IP-ED rests on, for luminaires at one height and one height of work plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Exitances {
    /// Mean exitance of the ceiling cavity's opening, `M_cc`.
    pub ceiling_cavity: LumenPerSquareMetre,
    /// Mean exitance of the walls, `M_w`.
    pub walls: LumenPerSquareMetre,
    /// Mean illuminance of the work plane, direct and indirect.
    pub work_plane: Lux,
    /// Room, ceiling and floor cavity ratio: RCR, CCR, FCR.
    pub cavity_ratios: [f64; 3],
    /// Effective reflectances.
    pub reflectances: CavityReflectances,
    /// Coefficients by which flux over floor area is multiplied.
    pub coefficients: Coefficients,
    /// Flux of the luminaires.
    pub flux: Lumen,
    /// Their height in metres, where the ceiling cavity begins.
    pub luminaire_height_m: f64,
}

/// An empty room, and the zonal flux of its luminaires, those at one height added up.
///
/// Each height has cavities of its own, so that luminaires are solved apart and their light is added: one that is off changes
/// nothing, and two give what they give one by one.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    pub(super) room: Room,
    /// Of ceiling, walls and floor.
    reflectances: [f64; 3],
    by_height: Vec<Layer>,
    pub(super) objections: Vec<String>,
}

/// The luminaires at one height that are on.
#[derive(Clone, Debug, PartialEq)]
struct Layer {
    height_m: f64,
    zonal: ZonalFlux,
    /// The first of them, to name it.
    id: String,
    count: usize,
}

impl Layers {
    /// Of a scene's luminaires that are on, all of which must hang inside its room.
    pub fn of(scene: &Scene) -> Result<Self, NotApplicable> {
        Self::with(&RoomFluxes::default(), scene, None)
    }

    /// As [`Self::of`], with what is known of luminaires that hang tilted, until it is stopped.
    pub fn with(fluxes: &RoomFluxes, scene: &Scene, stop: Option<&AtomicBool>) -> Result<Self, NotApplicable> {
        let room = scene.room.ok_or_else(|| refuse("the scene has no room"))?;
        if scene.luminaires.is_empty() {
            return Err(refuse("the scene has no luminaire"));
        }
        if Surface::ALL.iter().all(|s| room.reflectance.of(*s) == 0.0)
            && scene.obstacles.iter().any(|o| o.reflectance > 0.0)
        {
            return Err(refuse("only bodies reflect, the room does not; the method knows surfaces of the room alone"));
        }
        let mut by_height: Vec<Layer> = vec![];
        let entering = fluxes.entering(&room, scene, stop).ok_or_else(|| refuse("it was stopped"))?;
        for (luminaire, zonal) in scene.luminaires.iter().zip(entering) {
            if zonal.down_lm() + zonal.up_lm() == 0.0 {
                continue;
            }
            if !room.contains(luminaire.position_m, 0.0) {
                return Err(refuse(format!("`{}` lies outside the room", luminaire.id)));
            }
            let (height_m, id) = (luminaire.position_m.z, luminaire.id.clone());
            match by_height.iter_mut().find(|layer| layer.height_m == height_m) {
                Some(layer) => (layer.zonal, layer.count) = (layer.zonal.plus(&zonal), layer.count + 1),
                None => by_height.push(Layer { height_m, zonal, id, count: 1 }),
            }
        }
        let reflectances = reflectances(scene, &room);
        Ok(Self { room, reflectances, by_height, objections: objections(scene, &room) })
    }

    /// Zonal cavity solutions for a work plane at `work_plane_m` above the floor, one a height of luminaires.
    pub fn exitances(&self, work_plane_m: f64) -> Result<Vec<Exitances>, NotApplicable> {
        self.by_height.iter().map(|layer| self.solve(layer, work_plane_m)).collect()
    }

    fn solve(&self, layer: &Layer, work_plane_m: f64) -> Result<Exitances, NotApplicable> {
        let (height, zonal) = (layer.height_m, &layer.zonal);
        if height <= work_plane_m {
            return Err(refuse(format!(
                "`{}` hangs at {height} m, not above the meter at {work_plane_m} m: there is no room cavity between them",
                layer.id
            )));
        }
        let (width, length) = (self.room.size_m.x, self.room.size_m.y);
        let [base_ceiling, walls, base_floor] = self.reflectances;
        let cavity = |depth_m: f64| Cavity::lm57(super::zonal_cavity::cavity_ratio(width, length, depth_m));
        let (room_cavity, ceiling, floor) =
            (cavity(height - work_plane_m), cavity(self.room.size_m.z - height), cavity(work_plane_m));
        let reflectances = CavityReflectances {
            ceiling_cavity: ceiling.effective_reflectance(base_ceiling, walls),
            walls,
            floor_cavity: floor.effective_reflectance(base_floor, walls),
        };
        let flux = zonal.down_lm() + zonal.up_lm();
        let coefficients = coefficients(zonal, flux, &room_cavity, &reflectances, &ZonalMultipliers::LM57)
            .map_err(|error| refuse(error.to_string()))?;
        let per_area = flux / (width * length);
        Ok(Exitances {
            ceiling_cavity: LumenPerSquareMetre(coefficients.ceiling_cavity_exitance * per_area),
            walls: LumenPerSquareMetre(coefficients.wall_exitance * per_area),
            work_plane: Lux(coefficients.utilization * per_area),
            cavity_ratios: [room_cavity.ratio, ceiling.ratio, floor.ratio],
            reflectances,
            coefficients,
            flux: Lumen(flux),
            luminaire_height_m: height,
        })
    }

    /// Whether luminaires hang too far apart for their height.
    pub(super) fn unevenness(&self, work_plane_m: f64) -> Option<String> {
        let count: usize = self.by_height.iter().map(|layer| layer.count).sum();
        let lowest_m = self.by_height.iter().map(|layer| layer.height_m).reduce(f64::min)?;
        let spacing_m = (self.room.size_m.x * self.room.size_m.y / count as f64).sqrt();
        let allowed_m = SPACING_CRITERION * (lowest_m - work_plane_m);
        (spacing_m > allowed_m).then(|| {
            format!(
                "{count} luminaire(s) for {spacing_m:.1} m of spacing where even light needs at most {allowed_m:.1} m: \
                 the method spreads their flux evenly"
            )
        })
    }
}

/// Reflectances of ceiling, walls and floor, each the mean over its area with what is let into it; walls weighted with their length.
fn reflectances(scene: &Scene, room: &Room) -> [f64; 3] {
    let mean = |surfaces: &[Surface]| {
        let area_m2: f64 = surfaces.iter().map(|s| room.area_m2(*s)).sum();
        let bare: f64 = surfaces.iter().map(|s| room.area_m2(*s) * room.reflectance.of(*s)).sum();
        let replaced = |o: &Obstacle| {
            let surface = flush::lies_on(room, o).filter(|s| surfaces.contains(s))?;
            Some(o.shape.area_m2() * (o.reflectance - room.reflectance.of(surface)))
        };
        ((bare + scene.obstacles.iter().filter_map(replaced).sum::<f64>()) / area_m2).max(0.0)
    };
    let walls = [Surface::WallXMin, Surface::WallXMax, Surface::WallYMin, Surface::WallYMax];
    [mean(&[Surface::Ceiling]), mean(&walls), mean(&[Surface::Floor])]
}

/// Luminaires further apart than this times their height above the work plane do not light it evenly.
///
/// The usual upper end of spacing criteria (IES Lighting Handbook: 1.5 for wide distributions).
const SPACING_CRITERION: f64 = 1.5;

fn objections(scene: &Scene, room: &Room) -> Vec<String> {
    let mut found = vec![];
    let r = &room.reflectance;
    let walls = [r.wall_x_min, r.wall_x_max, r.wall_y_min, r.wall_y_max];
    if walls.iter().any(|wall| *wall != walls[0]) {
        found.push("the walls differ in reflectance; the method takes their mean".into());
    }
    let bodies = scene.obstacles.iter().filter(|o| flush::lies_on(room, o).is_none()).count();
    if bodies > 0 {
        found.push(format!("{bodies} obstacle(s) are left out"));
    }
    found
}

const METHOD: &str = "infinite plane - exitance difference method";

pub(super) fn refuse(reason: impl Into<String>) -> NotApplicable {
    NotApplicable { method: METHOD, reason: reason.into() }
}
