//! Daylight through openings, integrated over the solid angle of the sky, in place of the area of the opening.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use glam::DVec3;
use luxproof_photometry::{Photometry, read_file};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Luminaire, LuminaireModel, Meter, Obstacle, Scene, Shape, Transport, orientation};
use luxproof_simulator::Accuracy;

use super::{GAUSS, doubt, reference};

pub(super) const HORIZONTAL_LX: f64 = 10_000.0;
const GROUND_CD_M2: f64 = 0.3 * HORIZONTAL_LX / PI;
/// The zenith angle of every sun.
const SUN_ZENITH_DEG: f64 = 30.0;

/// a to e of the types 1 to 15 of ISO 15469, its table 1.
const TYPES: [[f64; 5]; 15] = [
    [4.0, -0.7, 0.0, -1.0, 0.0],
    [4.0, -0.7, 2.0, -1.5, 0.15],
    [1.1, -0.8, 0.0, -1.0, 0.0],
    [1.1, -0.8, 2.0, -1.5, 0.15],
    [0.0, -1.0, 0.0, -1.0, 0.0],
    [0.0, -1.0, 2.0, -1.5, 0.15],
    [0.0, -1.0, 5.0, -2.5, 0.3],
    [0.0, -1.0, 10.0, -3.0, 0.45],
    [-1.0, -0.55, 2.0, -1.5, 0.15],
    [-1.0, -0.55, 5.0, -2.5, 0.3],
    [-1.0, -0.55, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 16.0, -3.0, 0.3],
    [-1.0, -0.15, 16.0, -3.0, 0.3],
    [-1.0, -0.15, 24.0, -2.8, 0.15],
];

/// A sky of ISO 15469.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sky {
    /// 1 to 16; the last is the traditional overcast sky.
    number: usize,
    sun_azimuth: f64,
    sun_zenith: f64,
    scale: f64,
}

impl Sky {
    /// One that gives an open horizontal plane 10 000 lx, in closed form where there is one.
    pub(super) fn new(number: usize, sun_deg: f64) -> Self {
        let (sun_azimuth, sun_zenith) = (sun_deg.to_radians(), SUN_ZENITH_DEG.to_radians());
        let mut sky = Self { number, sun_azimuth, sun_zenith, scale: 1.0 };
        let horizontal = match number {
            5 => PI,
            16 => 7.0 * PI / 9.0,
            _ => {
                let upwards = Meter { position_m: DVec3::ZERO, normal: DVec3::Z };
                let half_turn = [0.0, FRAC_PI_2, PI, 1.5 * PI, TAU];
                let mut sum = 0.0;
                over_directions(
                    &upwards,
                    &sky,
                    &half_turn,
                    |_| Some([0.0, FRAC_PI_2]),
                    30,
                    |towards, part| {
                        sum += part * sky.luminance(towards);
                    },
                );
                sum
            }
        };
        sky.scale = HORIZONTAL_LX / horizontal;
        sky
    }

    fn sun(&self) -> DVec3 {
        direction(self.sun_zenith, self.sun_azimuth)
    }

    /// In cd/m² towards a direction, or of the ground.
    fn luminance(&self, towards: DVec3) -> f64 {
        let zenith = towards.z.acos();
        if towards.z < 0.0 {
            return GROUND_CD_M2;
        }
        if self.number == 16 {
            return self.scale * (1.0 + 2.0 * zenith.cos()) / 3.0;
        }
        let [a, b, c, d, e] = TYPES[self.number - 1];
        let chi = towards.angle_between(self.sun());
        let gradation = 1.0 + a * (b / zenith.cos()).exp();
        let indicatrix = 1.0 + c * ((d * chi).exp() - (d * FRAC_PI_2).exp()) + e * chi.cos().powi(2);
        self.scale * gradation * indicatrix
    }
}

fn direction(zenith: f64, azimuth: f64) -> DVec3 {
    DVec3::new(zenith.sin() * azimuth.cos(), zenith.sin() * azimuth.sin(), zenith.cos())
}

/// What a clear pane lets through at an angle of incidence, added up reflection by reflection.
fn glass(incidence: f64) -> f64 {
    let inner = (incidence.sin() / 1.52).asin();
    let left = (-0.02 / inner.cos()).exp();
    let (less, more) = (incidence - inner, incidence + inner);
    let straight = (0.52_f64 / 2.52).powi(2);
    let faces = if more < 1e-6 {
        [straight; 2]
    } else {
        [(less.sin() / more.sin()).powi(2), (less.tan() / more.tan()).powi(2)]
    };
    let of = |r: f64| (0..200).map(|k| (1.0 - r).powi(2) * left * (r * left).powi(2 * k)).sum::<f64>();
    faces.into_iter().map(of).sum::<f64>() / 2.0
}

/// The integral of cos over the directions with zenith angles between two bounds in each azimuth, in parts.
///
/// Calls `add` with every direction and its part; `add` multiplies by luminance and transmittance. Bounds are smooth
/// between the azimuths `ends`; a cusp at the sun and a jump at the horizon are cut at.
fn over_directions(
    meter: &Meter,
    sky: &Sky,
    ends: &[f64],
    bounds: impl Fn(f64) -> Option<[f64; 2]>,
    panels: u32,
    mut add: impl FnMut(DVec3, f64),
) {
    let mut azimuths = ends.to_vec();
    if sky.number < 16 {
        azimuths.extend((-1..=1).map(|turn| sky.sun_azimuth + TAU * f64::from(turn)));
    }
    let (from, to) = (ends[0], ends[ends.len() - 1]);
    azimuths.retain(|a| (from..=to).contains(a));
    azimuths.sort_by(f64::total_cmp);
    let zeniths = [0.0, sky.sun_zenith, FRAC_PI_2, PI];
    for pair in azimuths.windows(2) {
        for (azimuth, width) in nodes(pair[0], pair[1], panels) {
            let Some([low, high]) = bounds(azimuth) else { continue };
            for zone in zeniths.windows(2) {
                let (low, high) = (low.max(zone[0]), high.min(zone[1]));
                if low >= high {
                    continue;
                }
                for (zenith, height) in nodes(low, high, panels) {
                    let towards = direction(zenith, azimuth);
                    let received = towards.dot(meter.normal).max(0.0);
                    add(towards, width * height * zenith.sin() * received);
                }
            }
        }
    }
}

/// Composite Gauss-Legendre quadrature, dense towards both ends, where cusps lie.
fn nodes(low: f64, high: f64, panels: u32) -> impl Iterator<Item = (f64, f64)> {
    let width = high - low;
    (0..panels).flat_map(move |k| {
        GAUSS.map(|(x, w)| {
            let u = (f64::from(k) + x) / f64::from(panels);
            (low + width * u * u * (3.0 - 2.0 * u), width * 6.0 * u * (1.0 - u) * w / f64::from(panels))
        })
    })
}

/// The illuminance by what shows through all of some flat convex frames, the last of them the opening's own.
pub(super) fn through(meter: &Meter, frames: &[[DVec3; 4]], sky: &Sky, passed: impl Fn(DVec3) -> f64) -> f64 {
    through_each(meter, frames, std::slice::from_ref(sky), passed)[0]
}

/// The same under each of some skies with the same sun; the first is one of those with a sun, if any is.
pub(super) fn through_each(
    meter: &Meter,
    frames: &[[DVec3; 4]],
    skies: &[Sky],
    passed: impl Fn(DVec3) -> f64,
) -> Vec<f64> {
    let frames: Vec<[DVec3; 4]> = frames.iter().map(|f| f.map(|c| c - meter.position_m)).collect();
    // Azimuths count from the middle of the first frame, and all round where a frame is straight above.
    let middle: DVec3 = frames[0].iter().sum();
    let to_middle = middle.y.atan2(middle.x);
    let corners = frames.iter().flatten().map(|c| {
        let turned = c.y.atan2(c.x) - to_middle;
        to_middle + turned - TAU * (turned / TAU).round()
    });
    let mut ends: Vec<f64> = corners.chain([to_middle - PI, to_middle + PI]).collect();
    ends.sort_by(f64::total_cmp);
    let bounds = |azimuth: f64| {
        let shown = frames.iter().map(|f| zenith_angles(f, azimuth));
        shown.reduce(|a, b| Some([a?[0].max(b?[0]), a?[1].min(b?[1])])).flatten()
    };
    let mut sums = vec![0.0; skies.len()];
    over_directions(meter, &skies[0], &ends, bounds, 10, |towards, part| {
        if part > 0.0 {
            let part = part * passed(towards);
            for (sum, sky) in sums.iter_mut().zip(skies) {
                *sum += part * sky.luminance(towards);
            }
        }
    });
    sums
}

/// Between which zenith angles a frame, relative to the meter, is seen in one azimuth.
fn zenith_angles(frame: &[DVec3; 4], azimuth: f64) -> Option<[f64; 2]> {
    let (ahead, aside) = (direction(FRAC_PI_2, azimuth), direction(FRAC_PI_2, azimuth + FRAC_PI_2));
    let mut found = vec![];
    for (k, p) in frame.iter().enumerate() {
        let q = frame[(k + 1) % 4];
        let (a, b) = (p.dot(aside), q.dot(aside));
        if (a < 0.0) != (b < 0.0) {
            let at = p.lerp(q, a / (a - b));
            if at.dot(ahead) >= 0.0 {
                found.push(at.dot(ahead).atan2(at.z));
            }
        }
    }
    match found[..] {
        [] => None,
        [only] => Some([0.0, only]),
        _ => Some([found.iter().copied().fold(PI, f64::min), found.iter().copied().fold(0.0, f64::max)]),
    }
}

/// A roof opening of the cases of chapters 5.9 and 5.10, turned about its middle.
pub(super) fn roof(side_m: f64, turn_deg: f64) -> [DVec3; 4] {
    let turn = orientation(turn_deg, 0.0, 0.0);
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[x, y]| DVec3::new(4.0, 4.0, 3.5) + turn * DVec3::new(x, y, 0.0) * side_m / 2.0)
}

/// An upright frame in the plane of an x.
pub(super) fn upright(x: f64, [left, right]: [f64; 2], [low, high]: [f64; 2]) -> [DVec3; 4] {
    [[left, low], [right, low], [right, high], [left, high]].map(|[y, z]| DVec3::new(x, y, z))
}

pub(super) fn clear(_: DVec3) -> f64 {
    1.0
}

pub(super) fn of_roof(towards: DVec3) -> f64 {
    glass(towards.z.acos())
}

pub(super) fn of_facade(towards: DVec3) -> f64 {
    glass(towards.x.acos())
}

#[test]
fn the_simulators_bounds_hold_where_the_horizon_shows_through_a_hole() {
    // The room of case 5.13 aside, four metres further down.
    let sky = Sky::new(16, 0.0);
    let frames = [6.0, 6.2].map(|x| upright(x, [3.0, 5.0], [2.5, 3.5]));
    let frames = [frames[0], frames[1], upright(7.2, [1.0, 7.0], [0.5, 3.5])];
    let wall = |[y, high_y]: [f64; 2], [z, high_z]: [f64; 2]| Obstacle {
        shape: Shape::Box { min_m: DVec3::new(6.0, y, z), max_m: DVec3::new(6.2, high_y, high_z) },
        reflectance: 0.0,
    };
    let (below, above) = (wall([0.0, 8.0], [0.0, 2.5]), wall([0.0, 8.0], [3.5, 5.0]));
    let beside = [[0.0, 3.0], [5.0, 8.0]].map(|y| wall(y, [2.5, 3.5]));
    let luminaire = Luminaire {
        id: "sky".into(),
        photometry: Arc::new(luminaire_of("5.13-aside")),
        position_m: DVec3::new(7.2, 4.0, 2.0),
        orientation: orientation(0.0, 90.0, 0.0),
        flux_scale: 1.0,
        model: LuminaireModel::Area,
    };
    let room = Room { size_m: DVec3::new(7.2, 8.0, 5.0), reflectance: Reflectances::with_equal_walls(0.0, 0.0, 0.0) };
    let obstacles = [below, above].into_iter().chain(beside).collect();
    let scene = Scene { room: Some(room), obstacles, luminaires: vec![luminaire] };
    let meter = |x: f64, y: f64, z: f64| {
        let normal = if y < 4.0 { DVec3::Y } else { DVec3::NEG_Y };
        Meter { position_m: DVec3::new(x, y, z), normal }
    };
    let meters: Vec<Meter> =
        [2.6, 2.8, 3.0, 3.1].iter().flat_map(|z| [meter(4.0, 2.0, *z), meter(3.0, 5.5, *z)]).collect();
    for relative_error in [1e-2, 3e-3, 1e-3] {
        let accuracy = Accuracy { relative_error, seed: 1 };
        let solution = luxproof_simulator::illuminance(&scene, &meters, Transport::Direct, &accuracy).unwrap();
        for (meter, found) in meters.iter().zip(&solution.estimates) {
            let (law, value) = (through(meter, &frames, &sky, clear), found.illuminance.value());
            // And what the table's straight lines leave out.
            let allowed = doubt(found.uncertainty) + 1.5e-4 * law;
            assert!((value - law).abs() <= allowed, "{relative_error} {meter:?}: {found:?} for {law}");
        }
    }
}

fn luminaire_of(variant: &str) -> Photometry {
    read_file(&reference("cie171/luminaires").join(format!("{variant}.ies"))).unwrap()
}

/// How far a luminaire is off the law of its sky, as a part of its largest intensity.
fn deviation(luminaire: &Photometry, sky: &Sky, area_m2: f64, is_facade: bool, has_glass: bool) -> f64 {
    let Photometry { distribution, .. } = luminaire;
    let turned = orientation(0.0, if is_facade { 90.0 } else { 0.0 }, 0.0);
    let outwards = if is_facade { DVec3::X } else { DVec3::Z };
    let mut off = 0.0_f64;
    // Directions that lie on no angle of a table, and none nearer to the horizon of a facade than its planes.
    for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))) {
        let towards = direction((0.5 + f64::from(i)) * PI / 40.0, (0.37 + f64::from(j)) * TAU / 40.0);
        let cosine = towards.dot(outwards);
        if cosine <= 0.0 {
            continue;
        }
        let pane = if has_glass { glass(cosine.acos()) } else { 1.0 };
        let law = sky.luminance(towards) * area_m2 * cosine * pane;
        off = off.max((distribution.intensity_towards(turned.transpose() * -towards).value() - law).abs());
    }
    off / distribution.max_intensity().value()
}

/// Sizes of cases: the case, its size, its area in square metres, whether it is a facade, and whether it has glass.
const SIZES: [(&str, &str, f64, bool, bool); 10] = [
    ("5.9", "1m", 1.0, false, false),
    ("5.9", "4m", 16.0, false, false),
    ("5.10", "1m", 1.0, false, true),
    ("5.10", "4m", 16.0, false, true),
    ("5.11", "2x1m", 2.0, true, false),
    ("5.11", "4x3m", 12.0, true, false),
    ("5.12", "2x1m", 2.0, true, true),
    ("5.12", "4x3m", 12.0, true, true),
    ("5.13", "2x1m", 48.0, true, false),
    ("5.14", "2x1m", 900.0, true, false),
];

#[test]
fn the_openings_send_in_the_light_of_their_skies() {
    for number in 1..=16 {
        let sky = Sky::new(number, 0.0);
        let has_sun = number < 16 && TYPES[number - 1][2] != 0.0;
        for (case, size, area_m2, is_facade, has_glass) in SIZES {
            let name = format!("{case}-{size}-sky-{number}");
            let luminaire = luminaire_of(&name);
            let off = deviation(&luminaire, &sky, area_m2, is_facade, has_glass);
            // What straight lines between the angles leave out, near the sun and near the horizon of a facade most.
            let allowed = match (is_facade, has_sun) {
                (false, false) => 1e-4,
                (false, true) | (true, false) => 3e-3,
                (true, true) => 6e-3,
            };
            assert!(off < allowed, "{name}: {off}");
            // Through a bare roof comes the illuminance of an open plane.
            let flux = luminaire.distribution.flux().value();
            if case == "5.9" {
                assert!((flux / (HORIZONTAL_LX * area_m2) - 1.0).abs() < 5e-4, "{name}: {flux}");
            }
        }
    }
}

#[test]
fn the_openings_aside_send_in_the_light_of_their_skies() {
    let (sunny, overcast) = (Sky::new(12, 45.0), Sky::new(16, 0.0));
    let files = [
        ("5.11-aside", sunny, 2.0, false, 4e-3),
        ("5.12-aside", sunny, 2.0, true, 4e-3),
        ("5.13-aside", overcast, 18.0, false, 1e-3),
        ("5.14-aside", overcast, 54.0, false, 1e-3),
    ];
    for (name, sky, area_m2, has_glass, allowed) in files {
        let off = deviation(&luminaire_of(name), &sky, area_m2, true, has_glass);
        assert!(off < allowed, "{name}: {off}");
    }
}
