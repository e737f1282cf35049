//! Compares UGR with rooms that are built luminaire by luminaire, and with the tables of CIE 190.

use std::f64::consts::PI;
use std::sync::Arc;

use approx::assert_relative_eq;
use glam::{DMat3, DVec3};

use super::background::{FirstFlux, transfer};
use super::observer::{Glare, NoGlare, rating};
use super::*;
use luxproof_photometry::units::Lux;
use luxproof_photometry::{LuminousIntensityDistribution, LuminousOpening};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, orientation};

fn panel(x_m: f64, y_m: f64, of: impl Fn(f64, f64) -> f64) -> Photometry {
    let c: Vec<f64> = (0..=18).map(|k| 5.0 * f64::from(k)).collect();
    let gamma: Vec<f64> = (0..=90).map(f64::from).collect();
    let candela = c.iter().flat_map(|c| gamma.iter().map(|g| of(*c, *g).max(0.0))).collect();
    let distribution = LuminousIntensityDistribution::new(c, gamma, candela).unwrap();
    Photometry { opening: LuminousOpening::Box { x_m, y_m, height_m: 0.0 }, ..Photometry::of(distribution) }
}

/// A diffuse panel, a louvre that cuts off and a batwing, small against the height.
fn luminaires() -> [Photometry; 3] {
    [
        panel(0.3, 0.1, |_, g| 900.0 * cos_deg(g)),
        panel(0.1, 0.25, |c, g| 700.0 * cos_deg(g).powf(1.0 + 2.0 * cos_deg(c).powi(2))),
        panel(0.15, 0.15, |c, g| {
            400.0 * (1.0 + (2.0 + cos_deg(2.0 * c)) * (1.5 * g).to_radians().sin().powi(2)) * cos_deg(g)
        }),
    ]
}

fn cos_deg(deg: f64) -> f64 {
    deg.to_radians().cos()
}

/// A room that is built luminaire by luminaire.
struct BuiltRoom {
    /// Across the line of sight, along it, and from the eye to the luminaires; the eye is the origin, the wall behind
    /// it.
    size_m: DVec3,
    luminaires_m: Vec<DVec3>,
}

impl BuiltRoom {
    fn new(room: Room, spacing: Spacing) -> Self {
        let height_m = 1.9;
        let (width_m, depth_m) = (f64::from(room.x) * height_m, f64::from(room.y) * height_m);
        let step = height_m * spacing.over_height();
        let mut luminaires_m = vec![];
        for i in 0..(width_m / step).round() as u32 {
            for j in 0..(depth_m / step).round() as u32 {
                let (x, y) = ((f64::from(i) + 0.5) * step, (f64::from(j) + 0.5) * step);
                luminaires_m.push(DVec3::new(x - 0.5 * width_m, y, height_m));
            }
        }
        Self { size_m: DVec3::new(width_m, depth_m, height_m), luminaires_m }
    }

    /// Sum of L^2 w / p^2; `axes` are the luminaire's x and y in the room.
    fn glare(&self, luminaire: &Photometry, axes: [DVec3; 2]) -> f64 {
        self.luminaires_m.iter().map(|place| glare_at(*place, luminaire, axes)).sum()
    }

    /// Part of the downward flux that falls on the reference plane within the room, ray by ray from every luminaire.
    fn direct_part(&self, luminaire: &Photometry, axes: [DVec3; 2]) -> f64 {
        let frame = DMat3::from_cols(axes[0], axes[1], DVec3::Z);
        let (mut inside, mut all) = (0.0, 0.0);
        for g in (0..90).map(|k| f64::from(k) + 0.5) {
            for c in (0..72).map(|k| 5.0 * (f64::from(k) + 0.5)) {
                let weight = luminaire.distribution.intensity(c, g).value() * g.to_radians().sin();
                let away = frame * luxproof_photometry::direction(c, g);
                let foot = away / -away.z * self.size_m.z;
                let hits = self.luminaires_m.iter().map(|place| *place + foot);
                inside += weight * hits.filter(|hit| self.contains(*hit)).count() as f64;
                all += weight * self.luminaires_m.len() as f64;
            }
        }
        inside / all
    }

    /// Whether a point of the reference plane lies within the room.
    fn contains(&self, point: DVec3) -> bool {
        point.x.abs() <= 0.5 * self.size_m.x && (0.0..=self.size_m.y).contains(&point.y)
    }

    /// Indirect luminance of the walls in cd/m2 for flux that first falls on the plane and on the walls, in lumens: by
    /// following it from reflection to reflection, with a view factor integrated over distances between points.
    fn background(&self, on_plane: f64, on_walls: f64, reflectances: Reflectances) -> f64 {
        let (x, y, h) = (self.size_m.x, self.size_m.y, self.size_m.z);
        let cells = 400;
        let mut facing = 0.0;
        for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
            let (u, v) = ((f64::from(i) + 0.5) / f64::from(cells) * x, (f64::from(j) + 0.5) / f64::from(cells) * y);
            let cell = x * y / f64::from(cells * cells);
            facing += 4.0 * cell * (x - u) * (y - v) * h * h / (PI * (u * u + v * v + h * h).powi(2));
        }
        facing /= x * y;
        let walls = 2.0 * h * (x + y);
        let wall_to_plane = (1.0 - facing) * x * y / walls;
        let (mut plane, mut ceiling, mut wall, mut indirect) = (on_plane, 0.0, on_walls, 0.0);
        for _ in 0..200 {
            let (p, c, w) = (plane * reflectances.plane, ceiling * reflectances.ceiling, wall * reflectances.walls);
            plane = c * facing + w * wall_to_plane;
            ceiling = p * facing + w * wall_to_plane;
            wall = (p + c) * (1.0 - facing) + w * (1.0 - 2.0 * wall_to_plane);
            indirect += wall;
        }
        indirect / walls / PI
    }

    fn rating(&self, luminaire: &Photometry, axes: [DVec3; 2], part: f64, reflectances: Reflectances) -> f64 {
        let down = luminaire.distribution.flux().value() * self.luminaires_m.len() as f64;
        let behind = self.background(part * down, (1.0 - part) * down, reflectances);
        8.0 * (0.25 / behind * self.glare(luminaire, axes)).log10()
    }
}

/// L^2 w / p^2 of one luminaire, as a sum over patches of its opening.
fn glare_at(place: DVec3, luminaire: &Photometry, axes: [DVec3; 2]) -> f64 {
    const PATCHES: i32 = 4;
    let [width, length, _] = luminaire.opening.bounding_box_m();
    let frame = DMat3::from_cols(axes[0], axes[1], DVec3::Z);
    let (ahead, aside, above) = (place.y, place.x.abs(), place.z);
    let Some(index) = position_index(aside / ahead, above / ahead) else { return 0.0 };
    let (mut angle, mut bright) = (0.0, 0.0);
    for (i, j) in (0..PATCHES).flat_map(|i| (0..PATCHES).map(move |j| (i, j))) {
        let [along, across] = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(PATCHES) - 0.5);
        let to_eye = -(place + axes[0] * along * length + axes[1] * across * width);
        let cosine = -to_eye.normalize().z;
        let area = length * width / f64::from(PATCHES * PATCHES);
        let candela = luminaire.distribution.intensity_towards(frame.transpose() * to_eye).value();
        let solid = area * cosine / to_eye.length_squared();
        angle += solid;
        bright += solid * candela / (length * width * cosine);
    }
    (bright / angle).powi(2) * angle / (index * index)
}

/// The luminaire's x and y in the room for an observer who looks at its long side and at its end.
fn axes(luminaire: &Photometry) -> [[DVec3; 2]; 2] {
    let [width, length, _] = luminaire.opening.bounding_box_m();
    let (x_across, x_along) = ([DVec3::X, DVec3::Y], [DVec3::Y, -DVec3::X]);
    if length >= width { [x_across, x_along] } else { [x_along, x_across] }
}

fn cells(row: &UgrRow) -> impl Iterator<Item = (usize, usize, f64)> {
    let views = [row.crosswise, row.endwise].into_iter().enumerate();
    views.flat_map(|(view, ratings)| ratings.into_iter().enumerate().map(move |(k, rating)| (view, k, rating.unwrap())))
}

/// The furthest that a table is from built rooms.
fn furthest(luminaire: &Photometry) -> f64 {
    let mut worst: f64 = 0.0;
    let table = UgrTable::of(luminaire, Spacing::Quarter).unwrap();
    for row in &table.rows {
        let (built, sparse) = (BuiltRoom::new(row.room, Spacing::Quarter), BuiltRoom::new(row.room, Spacing::Whole));
        let sides = axes(luminaire);
        let parts = sides.map(|side| sparse.direct_part(luminaire, side));
        let part = 0.5 * (parts[0] + parts[1]);
        for (view, column, rating) in cells(row) {
            let expected = built.rating(luminaire, sides[view], part, REFLECTANCES[column]);
            worst = worst.max((rating - expected).abs());
        }
    }
    worst
}

/// CIE 190's geometric multipliers are of luminaires spaced by H: that arrangement lights the background in both.
#[test]
fn ratings_are_those_of_rooms_built_luminaire_by_luminaire() {
    for luminaire in luminaires() {
        let worst = furthest(&luminaire);
        assert!(worst < 0.03, "{worst}");
    }
    // What is no longer small against the height is still so to the printed digit.
    let long = panel(1.2, 0.3, |c, g| 3000.0 * g.to_radians().cos().powf(1.0 + 0.5 * c.to_radians().sin()));
    let worst = furthest(&long);
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn transfer_factors_are_the_printed_ones_of_table_5() {
    // CIE 190:2010, table 5: F_T,FW, F_T,WW - 1, F_T,CW for 70/50/20 and 30/30/20.
    for (x, y, bright, dark) in [
        (2, 2, [0.220, 0.422, 0.646], [0.157, 0.181, 0.227]),
        (2, 12, [0.160, 0.290, 0.443], [0.113, 0.124, 0.161]),
        (4, 8, [0.115, 0.211, 0.307], [0.081, 0.092, 0.114]),
        (8, 8, [0.083, 0.155, 0.215], [0.058, 0.069, 0.081]),
        (12, 8, [0.071, 0.133, 0.183], [0.049, 0.059, 0.069]),
    ] {
        for (printed, reflectances) in [(bright, REFLECTANCES[0]), (dark, REFLECTANCES[4])] {
            for (found, printed) in transfer(Room { x, y }, reflectances).into_iter().zip(printed) {
                assert!((found - printed).abs() < 6e-4, "{x} {y} {reflectances:?}: {found} {printed}");
            }
        }
    }
}

#[test]
fn geometric_multipliers_give_the_part_that_rays_of_spaced_luminaires_give() {
    for luminaire in luminaires() {
        for room in ROOMS {
            let built = BuiltRoom::new(room, Spacing::Whole);
            let parts = axes(&luminaire).map(|side| built.direct_part(&luminaire, side));
            let first = FirstFlux::of(&luminaire.distribution, room).unwrap();
            let found = first.plane / (first.plane + first.walls);
            assert!((found - 0.5 * (parts[0] + parts[1])).abs() < 0.008, "{room:?} {found} {parts:?}");
        }
    }
}

#[test]
fn ratings_follow_the_logarithm_of_flux_and_area() {
    let [panel, ..] = luminaires();
    let table =
        |photometry: &Photometry| UgrTable::of(photometry, Spacing::Quarter).unwrap().rows[10].crosswise[0].unwrap();
    let bright = Photometry { distribution: panel.distribution.scaled(3.0), ..panel.clone() };
    assert_relative_eq!(table(&bright) - table(&panel), 8.0 * 3f64.log10(), max_relative = 1e-9);
    let wide = Photometry { opening: LuminousOpening::Box { x_m: 0.6, y_m: 0.2, height_m: 0.0 }, ..panel.clone() };
    assert_relative_eq!(table(&wide) - table(&panel), -8.0 * 4f64.log10(), max_relative = 1e-9);
}

#[test]
fn crosswise_is_across_the_long_side_in_either_format() {
    let [lying_x, lying_y, square] = luminaires();
    let plane = |p: &Photometry| UgrTable::of(p, Spacing::Whole).unwrap().crosswise_c_deg;
    assert_eq!([plane(&lying_x), plane(&lying_y)], [90.0, 0.0]);
    // Of a square one the format says where its lamps lie.
    assert_eq!(plane(&square), 90.0);
    let ldt =
        luxproof_photometry::eulumdat::parse(luxproof_photometry::eulumdat::write(&square).text.as_bytes()).unwrap();
    assert_eq!(plane(&ldt), 0.0);
}

#[test]
fn there_is_a_reason_where_there_is_no_table() {
    let [panel, ..] = luminaires();
    let point = Photometry { opening: LuminousOpening::Point, ..panel.clone() };
    assert_eq!(UgrTable::of(&point, Spacing::Quarter), Err(NoLuminance::Point.into()));
    let up = LuminousIntensityDistribution::axial(vec![95.0, 180.0], vec![0.0, 100.0]).unwrap();
    assert_eq!(
        UgrTable::of(&Photometry { distribution: up, ..panel.clone() }, Spacing::Quarter),
        Err(NoUgr::NothingBelow)
    );
    let lopsided =
        LuminousIntensityDistribution::new(vec![0.0, 180.0], vec![0.0, 90.0], vec![9.0, 9.0, 9.0, 0.0]).unwrap();
    let table = UgrTable::of(&Photometry { distribution: lopsided, ..panel }, Spacing::Quarter);
    assert!(matches!(table, Err(NoUgr::Lopsided { .. })), "{table:?}");
}

fn hung(photometry: &Photometry, position_m: DVec3, azimuth_deg: f64) -> Luminaire {
    Luminaire {
        id: "panel".into(),
        photometry: Arc::new(photometry.clone()),
        position_m,
        orientation: orientation(azimuth_deg, 0.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Area,
    }
}

/// Looks along +y from the origin.
const EYE: Meter = Meter { position_m: DVec3::ZERO, normal: DVec3::Y };

#[test]
fn an_observer_in_a_standard_room_has_the_rating_of_the_table() {
    for photometry in luminaires() {
        let table = UgrTable::of(&photometry, Spacing::Whole).unwrap();
        for row in &table.rows {
            let built = BuiltRoom::new(row.room, Spacing::Whole);
            let first = FirstFlux::of(&photometry.distribution, row.room).unwrap();
            let count = built.luminaires_m.len() as f64;
            for (turned_deg, ratings) in [(0.0, row.crosswise), (90.0, row.endwise)] {
                // The plane in which the eye lies is turned to where it is, at -y.
                let azimuth_deg = -90.0 - table.crosswise_c_deg - turned_deg;
                let luminaires =
                    built.luminaires_m.iter().map(|place| hung(&photometry, *place, azimuth_deg)).collect();
                let seen = Glare::seen(&Scene { luminaires, ..Scene::default() }, &EYE).unwrap();
                for (k, reflectances) in REFLECTANCES.iter().enumerate() {
                    let behind = background::luminance(row.room, *reflectances, first, count, built.size_m.z);
                    assert_relative_eq!(
                        rating(seen.sum, Lux(PI * behind)),
                        ratings[k].unwrap(),
                        max_relative = 1e-9,
                        epsilon = 1e-9
                    );
                }
            }
        }
    }
}

fn scene_of(panel: &Photometry, places: &[[f64; 3]]) -> Scene {
    let luminaires = places.iter().map(|p| hung(panel, DVec3::from(*p), 0.0)).collect();
    Scene { luminaires, ..Scene::default() }
}

#[test]
fn what_is_behind_below_hidden_or_edge_on_does_not_glare() {
    let panel = panel(0.3, 0.1, |_, g| 900.0 * g.to_radians().cos());
    let one = Glare::seen(&scene_of(&panel, &[[0.5, 4.0, 1.5]]), &EYE).unwrap();
    // L = 900 / .03; w = .03 cos / r^2, p by the table.
    let r = DVec3::new(0.5, 4.0, 1.5).length();
    let by_hand = (900.0 / 0.03 / position_index(0.125, 0.375).unwrap()).powi(2) * 0.03 * 1.5 / r.powi(3);
    // The table is linear between angles, which are one degree from each other.
    assert_relative_eq!(one.sum, by_hand, max_relative = 2e-4);
    assert_eq!(one.openings, 1);
    let others =
        [[0.5, 4.0, 1.5], [0.5, -4.0, 1.5], [0.5, 4.0, -1.5], [0.5, 0.7, 1.5], [20.0, 4.0, 1.5], [0.0, 4.0, 0.0]];
    assert_eq!(Glare::seen(&scene_of(&panel, &others), &EYE), Ok(one));
    let mut hidden = scene_of(&panel, &[[0.5, 4.0, 1.5]]);
    let shape = Shape::Box { min_m: DVec3::new(-1.0, 2.0, 0.0), max_m: DVec3::new(1.0, 2.1, 2.0) };
    hidden.obstacles.push(Obstacle { shape, reflectance: 0.5 });
    assert_eq!(Glare::seen(&hidden, &EYE), Err(NoGlare::NothingSeen));
    // A head that is raised by an angle sees the room turned down by it.
    let (sin, cos) = 0.2_f64.sin_cos();
    let raised = Meter { normal: DVec3::new(0.0, cos, sin), ..EYE };
    let seen = Glare::seen(&scene_of(&panel, &[[0.0, 4.0, 1.5]]), &raised).unwrap();
    let above = (1.5_f64.atan2(4.0) - 0.2).tan();
    let level = Glare::seen(&scene_of(&panel, &[[0.0, 4.0, 1.5]]), &EYE).unwrap();
    let indices = [0.375, above].map(|above| position_index(0.0, above).unwrap());
    assert_relative_eq!(seen.sum / level.sum, (indices[0] / indices[1]).powi(2), max_relative = 1e-9);
    assert_eq!(
        Glare::seen(&scene_of(&panel, &[[0.5, 4.0, 1.5]]), &Meter { normal: DVec3::Z, ..EYE }),
        Err(NoGlare::Upright)
    );
    let mut point = scene_of(&panel, &[[0.5, 4.0, 1.5]]);
    point.luminaires[0].photometry = Arc::new(Photometry { opening: LuminousOpening::Point, ..panel.clone() });
    assert_eq!(Glare::seen(&point, &EYE), Err(NoGlare::NoArea("panel".to_owned())));
}

#[test]
fn an_uplight_behind_an_eye_and_below_it_does_not_glare() {
    // Sideways and up over along are those of a place in front, since all three have the other sign.
    let panel = panel(0.3, 0.1, |_, g| 900.0 * g.to_radians().cos());
    for place in [[0.5, -4.0, -1.5], [0.1, -0.8, -0.3]] {
        let mut scene = scene_of(&panel, &[place]);
        scene.luminaires[0].orientation = orientation(0.0, 180.0, 0.0);
        assert!(scene.luminaires[0].intensity_towards(-DVec3::from(place)).value() > 0.0);
        assert_eq!(Glare::seen(&scene, &EYE), Err(NoGlare::NothingSeen), "{place:?}");
    }
}

#[test]
fn the_openings_that_count_have_their_number_and_solid_angles() {
    let panel = panel(0.3, 0.1, |_, g| 900.0 * g.to_radians().cos());
    let places = [[0.5, 4.0, 1.5], [0.0, 3.0, 1.0], [-1.0, 6.0, 2.0], [0.0, -3.0, 1.0]];
    let seen = Glare::seen(&scene_of(&panel, &places), &EYE).unwrap();
    // Area times cosine over the squared distance, of a panel that lies level: .03 z / r^3.
    let sizes = [0, 1, 2].map(|k| 0.03 * places[k][2] / DVec3::from(places[k]).length().powi(3));
    let [least, most] = [f64::min, f64::max].map(|pick| sizes.into_iter().reduce(pick).unwrap());
    assert_eq!(seen.openings, 3);
    assert_relative_eq!(seen.solid_angles_sr[0], least, max_relative = 1e-9);
    assert_relative_eq!(seen.solid_angles_sr[1], most, max_relative = 1e-9);
    // An eye that looks along x sees the same there.
    let turned = places.map(|[x, y, z]| [y, -x, z]);
    let along_x = Glare::seen(&scene_of(&panel, &turned), &Meter { normal: DVec3::X, ..EYE }).unwrap();
    assert_relative_eq!(along_x.sum, seen.sum, max_relative = 1e-9);
    // And one elsewhere the same about it.
    let elsewhere = DVec3::new(7.0, -2.0, 1.2);
    let moved = places.map(|place| (DVec3::from(place) + elsewhere).to_array());
    let there = Glare::seen(&scene_of(&panel, &moved), &Meter { position_m: elsewhere, ..EYE }).unwrap();
    assert_relative_eq!(there.sum, seen.sum, max_relative = 1e-9);
}

#[test]
fn a_rating_is_eight_times_the_logarithm_of_a_quarter_of_the_sum_over_the_background() {
    // L_b = E / pi = 10 cd/m2: 8 lg(.25 * 4000 / 10) = 16.
    assert_relative_eq!(rating(4000.0, Lux(10.0 * PI)), 16.0, max_relative = 1e-12);
}
