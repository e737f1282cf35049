//! The scene of IP-ED: an empty room of mean reflectances, and the zonal flux of its luminaires by height.

use std::sync::atomic::AtomicBool;

use super::NotApplicable;
use super::room_flux::RoomFluxes;
use super::zonal_cavity::{Cavity, CavityReflectances, Coefficients, ZonalFlux, cavity_ratio, coefficients};
use super::zonal_multiplier::ZonalMultipliers;
use luxproof_photometry::units::{Lumen, LumenPerSquareMetre, Lux};
use luxproof_scene::geometry::{Room, Surface};
use luxproof_scene::{Obstacle, Scene, flush};

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

/// An empty room, and the summed zonal flux of the luminaires at each height.
///
/// Each height has different cavities, so each is solved separately and their light is added. A luminaire that is off
/// thus changes nothing, and the light of two is the sum of the light of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    pub(super) room: Room,
    /// The reflectances of ceiling, walls and floor.
    reflectances: [f64; 3],
    by_height: Vec<Layer>,
    pub(super) objections: Vec<String>,
}

/// The luminaires at one height that are on.
#[derive(Clone, Debug, PartialEq)]
struct Layer {
    height_m: f64,
    zonal: ZonalFlux,
    /// The first of them, for error messages.
    id: String,
    count: usize,
}

impl Layers {
    /// The layers of a scene. Luminaires that are on must hang inside the room.
    pub fn of(scene: &Scene) -> Result<Self, NotApplicable> {
        Self::with(&RoomFluxes::default(), scene, None)
    }

    /// Makes layers as [`Self::of`] does, with stored fluxes of tilted luminaires, until `stop` becomes true.
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
        let reflectances = mean_reflectances(scene, &room);
        Ok(Self { room, reflectances, by_height, objections: objections(scene, &room) })
    }

    /// The zonal cavity solutions for a work plane at `work_plane_m` above the floor, one per height of luminaires.
    pub fn exitances(&self, work_plane_m: f64) -> Result<Vec<Exitances>, NotApplicable> {
        self.by_height.iter().map(|layer| self.solve(layer, work_plane_m)).collect()
    }

    /// The zonal cavity solution of one layer.
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
        let [room_cavity, ceiling, floor] = [height - work_plane_m, self.room.size_m.z - height, work_plane_m]
            .map(|depth_m| Cavity::lm57(cavity_ratio(width, length, depth_m)));
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

    /// The objection where luminaires are too far from each other for their height.
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

/// The mean reflectances of ceiling, walls and floor.
fn mean_reflectances(scene: &Scene, room: &Room) -> [f64; 3] {
    let walls = [Surface::WallXMin, Surface::WallXMax, Surface::WallYMin, Surface::WallYMax];
    [
        mean_reflectance(scene, room, &[Surface::Ceiling]),
        mean_reflectance(scene, room, &walls),
        mean_reflectance(scene, room, &[Surface::Floor]),
    ]
}

/// The mean reflectance of surfaces by area, with the bodies that lie flush in them.
fn mean_reflectance(scene: &Scene, room: &Room, surfaces: &[Surface]) -> f64 {
    let area_m2: f64 = surfaces.iter().map(|s| room.area_m2(*s)).sum();
    let bare: f64 = surfaces.iter().map(|s| room.area_m2(*s) * room.reflectance.of(*s)).sum();
    let changes = scene.obstacles.iter().filter_map(|o| flush_change(room, o, surfaces));
    ((bare + changes.sum::<f64>()) / area_m2).max(0.0)
}

/// By how much a flush body changes area times reflectance of its surface; `None` for other bodies and surfaces.
fn flush_change(room: &Room, obstacle: &Obstacle, surfaces: &[Surface]) -> Option<f64> {
    let surface = flush::lies_on(room, obstacle).filter(|s| surfaces.contains(s))?;
    Some(obstacle.shape.area_m2() * (obstacle.reflectance - room.reflectance.of(surface)))
}

/// The largest spacing of luminaires, over their height above the work plane, that lights it evenly.
///
/// The usual upper end of spacing criteria (IES Lighting Handbook: 1.5 for wide distributions).
const SPACING_CRITERION: f64 = 1.5;

/// The assumptions of the method that a scene violates.
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

/// The name of the method in errors.
const METHOD: &str = "infinite plane - exitance difference method";

/// The error of a scene or meter that the method cannot take.
pub(super) fn refuse(reason: impl Into<String>) -> NotApplicable {
    NotApplicable { method: METHOD, reason: reason.into() }
}
