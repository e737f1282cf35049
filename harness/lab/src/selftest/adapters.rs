//! Faults of adapters, written from their description and not from the diagnosis: look-ups, laws, tables, places, read-outs, reflections.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use itertools::Itertools;
use luxproof_photometry::LuminousIntensityDistribution;
use luxproof_scene::geometry::Surface;
use luxproof_scene::{Bounces, Luminaire, Meter, Scene, Transport};
use luxproof_verdict::diagnosis::{Model, truth};

/// Steps of the grids on which a wrong look-up is sampled for reflected light, in degrees.
const FINE_STEP_DEG: f64 = 1.0;
/// How near the grids come to an angle where a look-up may jump, in degrees.
const BESIDE_DEG: f64 = 1e-6;

/// The readings of an adapter with a fault.
pub(super) type AdapterReader = Box<dyn Fn(&Model) -> Vec<f64>>;

/// A fault of an adapter.
pub(super) struct AdapterFault {
    /// Words of which a right name has at least one.
    pub(super) words: &'static [&'static str],
    pub(super) reader: AdapterReader,
}

/// Draws a fault of a group.
pub(super) type AdapterSampler = fn(&mut fastrand::Rng) -> AdapterFault;

/// The groups of faults.
pub(super) const GROUPS: [(&str, AdapterSampler); 6] = [
    ("look-up", draw_lookup),
    ("law", draw_law),
    ("table", draw_table),
    ("place", draw_place),
    ("read-out", draw_readout),
    ("reflection", draw_reflection),
];

fn between(random: &mut fastrand::Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.f64()
}

/// A value at some distance on either side of 1.
fn off_one(random: &mut fastrand::Rng, least: f64, most: f64) -> f64 {
    let by = 1.0 + between(random, least, most);
    if random.bool() { by } else { by.recip() }
}

/// The candela of a table in a direction, as an adapter looks it up.
type LookUp = Box<dyn Fn(&LuminousIntensityDistribution, f64, f64) -> f64>;

/// The index below an angle and the part of the way to the next.
fn locate(angles: &[f64], at: f64) -> (usize, f64) {
    let low = angles.partition_point(|a| *a <= at).clamp(1, angles.len() - 1) - 1;
    (low, ((at - angles[low]) / (angles[low + 1] - angles[low])).clamp(0.0, 1.0))
}

/// Looks up with other parts of the way in C and gamma.
fn weighted(c_part: fn(f64) -> f64, gamma_part: fn(f64) -> f64) -> LookUp {
    Box::new(move |table, c, gamma| {
        let ends = (table.gamma_deg()[0], table.gamma_deg()[table.gamma_deg().len() - 1]);
        if !(ends.0..=ends.1).contains(&gamma) {
            return 0.0;
        }
        let (c, gamma) = (locate(table.c_deg(), c), locate(table.gamma_deg(), gamma));
        let (v, w) = (c_part(c.1), gamma_part(gamma.1));
        let at = |i: usize, j: usize| table.plane(i)[j];
        (1.0 - v) * ((1.0 - w) * at(c.0, gamma.0) + w * at(c.0, gamma.0 + 1))
            + v * ((1.0 - w) * at(c.0 + 1, gamma.0) + w * at(c.0 + 1, gamma.0 + 1))
    })
}

fn linear(part: f64) -> f64 {
    part
}

fn nearest(part: f64) -> f64 {
    part.round()
}

fn floor(_: f64) -> f64 {
    0.0
}

fn smooth(part: f64) -> f64 {
    part * part * (3.0 - 2.0 * part)
}

fn draw_lookup(random: &mut fastrand::Rng) -> AdapterFault {
    let (scale, shift) = (off_one(random, 0.04, 0.2), between(random, 3.0, 12.0));
    let (look_up, words): (LookUp, &[&str]) = match random.u32(0..9) {
        0 => (weighted(linear, nearest), &["not interpolated in gamma"]),
        1 => (weighted(nearest, linear), &["not interpolated in C"]),
        2 => (weighted(floor, floor), &["next lower angle"]),
        3 => (weighted(linear, smooth), &["smoothstep"]),
        4 => (Box::new(move |t, c, g| weighted(linear, linear)(t, c, (scale * g).min(180.0))), &["gamma is looked up"]),
        5 => (Box::new(move |t, c, g| weighted(linear, linear)(t, c, (g - shift).max(0.0))), &["gamma is off"]),
        6 => (
            Box::new(|t, c, g| {
                f64::midpoint(weighted(linear, linear)(t, c, g), weighted(linear, linear)(t, 360.0 - c, g))
            }),
            &["nothing"],
        ),
        7 => (
            Box::new(|t, c, g| {
                let (low, part) = locate(t.gamma_deg(), g);
                let cosines = [t.gamma_deg()[low], t.gamma_deg()[low + 1]].map(|g| g.to_radians().cos());
                let way =
                    if part == 0.0 { 0.0 } else { (g.to_radians().cos() - cosines[0]) / (cosines[1] - cosines[0]) };
                let at = t.gamma_deg()[low] + way * (t.gamma_deg()[low + 1] - t.gamma_deg()[low]);
                weighted(linear, linear)(t, c, at)
            }),
            &["cosine of gamma, not by gamma"],
        ),
        _ => (
            Box::new(|t, c, g| {
                let (low, part) = locate(t.gamma_deg(), g);
                let [a, b] = [t.gamma_deg()[low], t.gamma_deg()[low + 1]].map(|g| weighted(linear, linear)(t, c, g));
                a.powf(1.0 - part) * b.powf(part)
            }),
            &["logarithms"],
        ),
    };
    AdapterFault { words, reader: by_look_up(look_up) }
}

/// Reads with another look-up: direct light by the look-up itself, reflected light by a fine table of it.
fn by_look_up(look_up: LookUp) -> AdapterReader {
    Box::new(move |model| {
        if model.task.transport == Transport::Direct {
            return read_direct(model, |l, meter| {
                let table = l.photometry.distribution.full_circle();
                let (c, gamma) = angles(l, meter.position_m);
                look_up(&table, c, gamma) * l.flux_scale * geometry(l, meter)
            });
        }
        relight(model, |scene| {
            for l in &mut scene.luminaires {
                let table = l.photometry.distribution.full_circle();
                let (c_deg, gamma_deg) = (fine_grid(table.c_deg(), 360.0), fine_grid(table.gamma_deg(), 180.0));
                let candela =
                    c_deg.iter().cartesian_product(&gamma_deg).map(|(c, g)| look_up(&table, c % 360.0, *g)).collect();
                if let Ok(fine) = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela) {
                    l.photometry = Arc::new(l.photometry.with_distribution(fine));
                }
            }
        })
    })
}

/// A grid from 0 on, with both sides of a table's angles and of their mid-points, where look-ups jump.
fn fine_grid(of_table: &[f64], most_deg: f64) -> Vec<f64> {
    let mut grid = (0..=(most_deg / FINE_STEP_DEG) as u32).map(|k| FINE_STEP_DEG * f64::from(k)).collect_vec();
    let middles = of_table.windows(2).map(|pair| f64::midpoint(pair[0], pair[1]));
    for angle in of_table.iter().copied().chain(middles) {
        grid.extend([angle - BESIDE_DEG, angle + BESIDE_DEG].iter().filter(|a| (0.0..=most_deg).contains(*a)));
    }
    grid.sort_by(f64::total_cmp);
    grid.dedup();
    grid
}

/// C and gamma of a point in the frame of a luminaire, in degrees.
fn angles(luminaire: &Luminaire, at: DVec3) -> (f64, f64) {
    let ray = luminaire.orientation.transpose() * (at - luminaire.position_m);
    (ray.y.atan2(ray.x).to_degrees().rem_euclid(360.0), ray.x.hypot(ray.y).atan2(-ray.z).to_degrees())
}

/// Cosine over squared distance; 0 behind a meter.
fn geometry(luminaire: &Luminaire, meter: &Meter) -> f64 {
    let towards = luminaire.position_m - meter.position_m;
    (towards.dot(meter.normal) / towards.length()).max(0.0) / towards.length_squared()
}

fn candela(luminaire: &Luminaire, at: DVec3) -> f64 {
    let (c, gamma) = angles(luminaire, at);
    luminaire.photometry.distribution.intensity(c, gamma).value() * luminaire.flux_scale
}

/// Direct light by another illuminance of each luminaire; what bodies hide stays dark.
fn read_direct(model: &Model, lux: impl Fn(&Luminaire, &Meter) -> f64) -> Vec<f64> {
    let luminaires = &model.task.scene.luminaires;
    let targets = model.task.targets.iter().zip(&model.right);
    let sum = |meter: &Meter| luminaires.iter().map(|l| lux(l, meter)).sum::<f64>();
    targets
        .map(|(target, right)| {
            let read: f64 = target.aspects.iter().map(|a| a.weight * sum(&a.meter)).sum();
            if *right == 0.0 && !model.task.scene.obstacles.is_empty() { 0.0 } else { read }
        })
        .collect()
}

/// The readings of a changed scene.
fn relight(model: &Model, change: impl Fn(&mut Scene)) -> Vec<f64> {
    let mut task = model.task.clone();
    change(&mut task.scene);
    truth(&task).unwrap_or_else(|| model.right.clone())
}

fn draw_law(random: &mut fastrand::Rng) -> AdapterFault {
    let (p, r) = (random.f64(), random.f64());
    let (attenuation, words): (Box<dyn Fn(f64) -> f64>, &[&str]) = match random.u32(0..10) {
        0 => (Box::new(move |d| d.powf(-(1.5 + 0.35 * p))), &["distance to the power"]),
        1 => (Box::new(move |d| d.powi(-2) * (1.0 - (d / (4.0 + 4.0 * r)).powi(4)).max(0.0)), &["fades out"]),
        2 => (Box::new(move |d| d.powi(-2) * (1.0 - (d / (4.0 + 6.0 * r)).powi(4)).max(0.0).powi(2)), &["fades out"]),
        3 => (Box::new(move |d| d.powi(-2) * (1.0 - (d / (6.0 + 9.0 * r)).powi(2)).max(0.0).powi(2)), &["fades out"]),
        4 => (Box::new(move |d| (d * d + (0.3 + r).powi(2)).recip()), &["d^2 + r^2"]),
        5 => (Box::new(move |d| d.max(1.8 + r).powi(-2)), &["distances count as"]),
        6 => (Box::new(move |d| (0.05 + 0.5 * r + d).powi(-2)), &["r + d"]),
        7 => (Box::new(|d| (1.0 + d).powi(-2)), &["r + d", "1 + d"]),
        8 => (Box::new(move |d| if d > 2.5 + 2.0 * r { 0.0 } else { d.powi(-2) }), &["no light arrives from beyond"]),
        _ => (Box::new(|d| d.powi(-3)), &["third power", "distance to the power"]),
    };
    AdapterFault { words, reader: by_law(attenuation) }
}

/// Direct light by another law of the distance.
fn by_law(attenuation: Box<dyn Fn(f64) -> f64>) -> AdapterReader {
    Box::new(move |model| {
        if model.task.transport != Transport::Direct {
            return model.right.clone();
        }
        read_direct(model, |l, meter| {
            let d = l.position_m.distance(meter.position_m);
            candela(l, meter.position_m) * geometry(l, meter) * d * d * attenuation(d)
        })
    })
}

/// A factor on the light of a luminaire.
type FactorOf = Box<dyn Fn(&Luminaire) -> f64>;

fn draw_table(random: &mut fastrand::Rng) -> AdapterFault {
    let peak = |l: &Luminaire| l.photometry.distribution.max_intensity().value();
    let flux = |l: &Luminaire| l.photometry.distribution.flux().value();
    let power = off_one(random, 0.1, 0.6);
    let (factor, words): (FactorOf, &[&str]) = match random.u32(0..11) {
        0 => (Box::new(move |l| 1.0 / peak(l)), &["divided by its peak"]),
        1 => (Box::new(move |l| 1.0 / flux(l)), &["divided by its flux"]),
        2 => (Box::new(move |l| 1000.0 / flux(l)), &["flux of 1000 lm"]),
        3 => (Box::new(move |l| flux(l) / peak(l)), &["flux over peak"]),
        4 => (Box::new(move |l| 683.0 / peak(l)), &["divided by its peak"]),
        5 => (Box::new(|_| 683.0 / (4.0 * PI)), &["683/(4 pi)"]),
        6 => (Box::new(|_| PI * PI), &["pi^2"]),
        7 => (Box::new(|_| 179.0 / PI), &["179/pi"]),
        8 => (Box::new(|l| l.photometry.lamp_lumens.unwrap_or(1000.0) / 1000.0), &["lamp lumens"]),
        9 => {
            return by_angle(
                move |_, gamma| gamma.to_radians().cos().abs().powf(power),
                &["cosine of gamma to the power", "cosine at the luminaire is applied"],
            );
        }
        _ => return by_value(power),
    };
    AdapterFault { words, reader: by_factor(factor) }
}

/// Luminaires with a factor on their light.
fn by_factor(factor: FactorOf) -> AdapterReader {
    Box::new(move |model| relight(model, |scene| scene.luminaires.iter_mut().for_each(|l| l.flux_scale *= factor(l))))
}

/// A table with a factor of C and gamma.
fn by_angle(factor: impl Fn(f64, f64) -> f64 + 'static, words: &'static [&'static str]) -> AdapterFault {
    let look_up: LookUp = Box::new(move |t, c, g| weighted(linear, linear)(t, c, g) * factor(c, g));
    AdapterFault { words, reader: by_look_up(look_up) }
}

/// A table with each node raised to a power, as a part of the largest.
fn by_value(power: f64) -> AdapterFault {
    let reader: AdapterReader =
        Box::new(move |model| relight(model, |scene| scene.luminaires.iter_mut().for_each(|l| raise_table(l, power))));
    AdapterFault { words: &["raised to the power"], reader }
}

/// Raises each node of a luminaire's table to a power, as a part of the largest.
fn raise_table(luminaire: &mut Luminaire, power: f64) {
    let table = luminaire.photometry.distribution.full_circle();
    let peak = table.max_intensity().value();
    let all = (0..table.c_deg().len()).flat_map(|k| table.plane(k).to_vec());
    let raised = all.map(|candela| peak * (candela / peak).powf(power)).collect();
    let raised = LuminousIntensityDistribution::new(table.c_deg().to_vec(), table.gamma_deg().to_vec(), raised);
    if let Ok(raised) = raised {
        luminaire.photometry = Arc::new(luminaire.photometry.with_distribution(raised));
    }
}

/// A change of one luminaire.
type ChangeLuminaire = Box<dyn Fn(usize, &mut Luminaire)>;

fn draw_place(random: &mut fastrand::Rng) -> AdapterFault {
    let (by, angle) = (between(random, 0.05, 0.3), between(random, 4.0, 25.0));
    let along = *random.choice(&[DVec3::X, DVec3::Y, DVec3::Z]).unwrap_or(&DVec3::Z);
    let (change, words): (ChangeLuminaire, &[&str]) = match random.u32(0..8) {
        0 | 1 => (
            Box::new(move |_, l| l.position_m -= by * along),
            &["luminaires are off", "luminaire is off", "meters are off"],
        ),
        2 => (
            Box::new(move |k, l| {
                if k == 0 {
                    l.position_m += by * along;
                }
            }),
            &["lamp 1 is off", "is off by", "are off by"],
        ),
        3 => (Box::new(move |_, l| l.orientation *= DMat3::from_rotation_z(angle.to_radians())), &["turned by"]),
        4 => (
            Box::new(move |k, l| {
                if k == 0 {
                    l.orientation = DMat3::from_rotation_x(angle.to_radians()) * l.orientation;
                }
            }),
            &["tilted by"],
        ),
        5 => (Box::new(|_, l| l.orientation = DMat3::IDENTITY), &["rotation is left out"]),
        6 => (
            Box::new(|_, l| l.orientation *= DMat3::from_cols(-DVec3::X, DVec3::Y, -DVec3::Z)),
            &["frame are taken as"],
        ),
        _ => return AdapterFault { words: &["meters are"], reader: by_meters(by * DVec3::Z) },
    };
    AdapterFault { words, reader: by_luminaires(change) }
}

/// Luminaires with a change of each.
fn by_luminaires(change: ChangeLuminaire) -> AdapterReader {
    Box::new(move |model| {
        relight(model, |scene| scene.luminaires.iter_mut().enumerate().for_each(|(k, l)| change(k, l)))
    })
}

fn by_meters(offset: DVec3) -> AdapterReader {
    Box::new(move |model| {
        let mut task = model.task.clone();
        task.targets.iter_mut().flat_map(|t| &mut t.aspects).for_each(|a| a.meter.position_m += offset);
        truth(&task).unwrap_or_else(|| model.right.clone())
    })
}

fn draw_readout(random: &mut fastrand::Rng) -> AdapterFault {
    let level = 10f64.powf(between(random, 0.5, 2.5));
    let power = off_one(random, 0.05, 0.5);
    let (read, words): (Box<dyn Fn(f64) -> f64>, &[&str]) = match random.u32(0..7) {
        0 => (Box::new(move |lux| lux.powf(power)), &["raised to the power"]),
        1 => (Box::new(move |lux| level * (lux / level).powf(1.0 / 2.2)), &["raised to the power"]),
        2 => (Box::new(move |lux| lux.min(level)), &["highlights are cut off"]),
        3 => (Box::new(move |lux| lux.max(0.3 * level)), &["at least"]),
        4 => (Box::new(move |lux| (lux - 0.02 * level).max(0.0)), &["subtracted"]),
        5 => (Box::new(move |lux| lux + 0.05 * level), &["are added"]),
        _ => (Box::new(move |lux| (lux / (0.05 * level)).round() * 0.05 * level), &["multiples of"]),
    };
    AdapterFault { words, reader: by_readout(read) }
}

/// Right light with a change of each value that is read.
pub(super) fn by_readout(read: Box<dyn Fn(f64) -> f64>) -> AdapterReader {
    Box::new(move |model| {
        let targets = model.task.targets.iter().zip(&model.right);
        targets.map(|(t, right)| t.aspects[0].weight * read(right / t.aspects[0].weight)).collect()
    })
}

/// Reflected light with a change of every reflectance.
fn by_reflectances(change: Box<dyn Fn(f64) -> f64>) -> AdapterReader {
    Box::new(move |model| {
        let is_direct = model.task.transport == Transport::Direct;
        if is_direct { model.right.clone() } else { relight(model, |scene| change_all(scene, &*change)) }
    })
}

/// Reflected light that stops after some reflections.
fn stop_after(model: &Model, bounces: u32) -> Vec<f64> {
    let mut task = model.task.clone();
    task.transport = Transport::Indirect(Bounces::AtMost(bounces));
    truth(&task).unwrap_or_else(|| model.right.clone())
}

fn draw_reflection(random: &mut fastrand::Rng) -> AdapterFault {
    let (factor, survival) = (between(random, 0.8, 0.96), between(random, 0.6, 0.9));
    let surface = *random.choice(&[Surface::Floor, Surface::Ceiling, Surface::WallXMin]).unwrap_or(&Surface::Floor);
    let is_followed = |model: &Model| model.task.transport == Transport::Indirect(Bounces::Converged);
    let (reader, words): (AdapterReader, &[&str]) = match random.u32(0..9) {
        0 | 1 => (
            by_reflectances(Box::new(move |r| factor * r)),
            &["every surface of every room reflects", "every surface reflects"],
        ),
        2 => (by_reflectances(Box::new(move |r| r.powf(1.0 + 0.5 * survival))), &["reflectances are raised"]),
        3 => (by_reflectances(Box::new(|r| r.powf(2.2))), &["to the power of 2.2"]),
        4 => (
            Box::new(move |model| {
                if !is_followed(model) || model.case != 0 {
                    return model.right.clone();
                }
                relight(model, |scene| {
                    if let Some(room) = &mut scene.room {
                        *room.reflectance.of_mut(surface) *= factor - 0.2;
                    }
                })
            }),
            &["reflects 0"],
        ),
        5 => (
            Box::new(move |model| if is_followed(model) { stop_after(model, 3) } else { model.right.clone() }),
            &["light stops after 3"],
        ),
        6 => (
            Box::new(move |model| {
                if !is_followed(model) {
                    return model.right.clone();
                }
                let (two, one) = (stop_after(model, 2), stop_after(model, 1));
                model.right.iter().zip(two).zip(one).map(|((all, two), one)| all - (two - one)).collect()
            }),
            &["reflection 2 is lost"],
        ),
        7 => (
            Box::new(move |model| {
                if !is_followed(model) {
                    return model.right.clone();
                }
                // Twelve reflections, each with its own solution, and the rest by their ratio.
                let sums = (1..=12).map(|k| stop_after(model, k)).collect_vec();
                (0..model.right.len())
                    .map(|k| {
                        let parts =
                            (0..12).map(|n| sums[n][k] - if n > 0 { sums[n - 1][k] } else { 0.0 }).collect_vec();
                        let kept =
                            parts.iter().enumerate().map(|(n, part)| part * survival.powi(n as i32)).sum::<f64>();
                        let rest = (model.right[k] - sums[11][k]) * survival.powi(12);
                        kept + rest
                    })
                    .collect()
            }),
            &["each reflection after the first"],
        ),
        _ => (
            Box::new(move |model| {
                let factor = if is_followed(model) { factor } else { 1.0 };
                model.right.iter().map(|r| factor * r).collect()
            }),
            &["in reflected light alone"],
        ),
    };
    AdapterFault { words, reader }
}

fn change_all(scene: &mut Scene, change: &dyn Fn(f64) -> f64) {
    let Some(room) = &mut scene.room else { return };
    for surface in Surface::ALL {
        let reflectance = room.reflectance.of_mut(surface);
        *reflectance = change(*reflectance);
    }
}
