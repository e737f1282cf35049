//! How a spec gets smaller: each step gives candidates, from what saves most to what saves a digit; which of them fails still is for others.

use std::path::{Path, PathBuf};

use glam::DVec3;
use luminaire::photometry::{
    Details, Goniometer, LuminousIntensityDistribution, LuminousOpening, Photometry, lm63::Lm63Details,
};

use super::draft::{Draft, File};
use super::grammar::constant;
use super::oracle::Sighting;
use super::table::{is_single_valued, smallest, smallest_of_type, to_digits};
use crate::engines;
use crate::procedures::{AngleLists, Angles, Asked, Names};
use crate::spec::model::{
    Fraction, LuminaireSpec, MeterSet, ModelSpec, ReflectanceSpec, RoomSpec, RotationSpec, Walls,
};

pub(super) type Step = fn(&Draft) -> Vec<Draft>;

/// In the order in which they are tried, over and over until none of them helps.
pub(super) const ALL: &[Step] = &[
    fewer_luminaires,
    fewer_bodies,
    fewer_meters,
    plainer_files,
    fewer_planes,
    fewer_gammas,
    straighter_room,
    plainer_room,
    plainer_luminaires,
    rounder_values,
    plainer_openings,
    rounder_places,
    fewer_angles,
    trimmings,
];

fn with(draft: &Draft, change: impl FnOnce(&mut Draft)) -> Draft {
    let mut draft = draft.clone();
    change(&mut draft);
    draft
}

/// Only the engine and the procedure in question, at the one meter where it shows most; or at all meters, where one is too few.
pub(super) fn focused(draft: &Draft, sighting: &Sighting) -> Vec<Draft> {
    let symptom = &sighting.symptom;
    let alone = with(draft, |d| {
        d.spec.procedures.0.retain(|procedure, _| *procedure == symptom.procedure);
        d.spec.title = None;
        d.spec.published = None;
        if let Some(engines) = &mut d.spec.engines {
            engines.retain(|name, settings| symptom.engine == *name && !settings.0.is_empty());
        }
        d.spec.engines = d.spec.engines.take().filter(|engines| !engines.is_empty());
    });
    let Some(worst) = &sighting.comparison else { return vec![alone] };
    let at_worst = with(&alone, |d| {
        let Some(asked) = d.spec.procedures.0.get_mut(&symptom.procedure) else { return };
        d.spec.meters.clear();
        if let Some(names) = asked.meters_mut() {
            *names = Names::One("m".to_owned());
            let set = MeterSet { points_m: Some(vec![worst.at_m]), normal: Some(worst.normal), ..MeterSet::default() };
            d.spec.meters.insert("m".to_owned(), set);
        }
        if let (Asked::Angles(asked), Some((gamma, c))) = (&mut *asked, worst.gamma_deg.zip(worst.c_deg)) {
            asked.angles = Angles::Listed(AngleLists { gamma_deg: vec![gamma], c_deg: vec![c] });
        }
        if let Some(id) = asked.named().0 {
            d.spec.luminaires.retain(|l| l.id == id);
            d.spec.obstacles.clear();
        }
    });
    vec![at_worst, alone]
}

/// A list without ever smaller parts of it, one of its items at least being left; first only single items, where there are many.
fn fewer<T: Clone>(all: &[T], least: usize) -> Vec<Vec<T>> {
    let mut lists: Vec<Vec<T>> = vec![];
    if all.len() > 2 && least <= 1 {
        lists.extend(all.iter().map(|one| vec![one.clone()]));
    }
    let mut size = all.len().div_ceil(2);
    while size >= 1 && all.len() > least {
        for start in (0..all.len()).step_by(size) {
            let end = (start + size).min(all.len());
            let rest: Vec<T> = [&all[..start], &all[end..]].concat();
            if rest.len() >= least {
                lists.push(rest);
            }
        }
        size /= 2;
    }
    lists
}

fn trimmings(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    if !draft.spec.tolerances.is_empty() {
        all.push(with(draft, |d| d.spec.tolerances.clear()));
    }
    if draft.spec.engines.as_ref().is_some_and(|e| e.keys().all(|name| engines::entry(name).is_some())) {
        all.push(with(draft, |d| d.spec.engines = None));
    }
    all.push(with(draft, |d| d.spec.budget = crate::spec::Budget::default()));
    all
}

fn fewer_luminaires(draft: &Draft) -> Vec<Draft> {
    let lists = fewer(&draft.spec.luminaires, 1);
    lists.into_iter().map(|luminaires| with(draft, |d| d.spec.luminaires = luminaires)).collect()
}

fn fewer_bodies(draft: &Draft) -> Vec<Draft> {
    let lists = fewer(&draft.spec.obstacles, 0);
    let mut all: Vec<Draft> =
        lists.into_iter().map(|obstacles| with(draft, |d| d.spec.obstacles = obstacles)).collect();
    for k in 0..draft.spec.obstacles.len() {
        all.push(with(draft, |d| {
            let body = &mut d.spec.obstacles[k];
            let reflectance = body
                .cuboid
                .as_mut()
                .map(|b| &mut b.reflectance)
                .into_iter()
                .chain(body.mesh.as_mut().map(|m| &mut m.reflectance));
            reflectance.for_each(|rho| *rho = Fraction(0.0));
        }));
    }
    all
}

fn fewer_meters(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    let names: Vec<String> = draft.spec.meters.keys().cloned().collect();
    for left in fewer(&names, 1) {
        all.push(with(draft, |d| {
            d.spec.meters.retain(|name, _| left.contains(name));
            for asked in d.spec.procedures.0.values_mut() {
                if let Some(names) = asked.meters_mut() {
                    let named: Vec<String> =
                        names.iter().filter(|n| left.iter().any(|l| l == n)).map(str::to_owned).collect();
                    *names = match &named[..] {
                        [one] => Names::One(one.clone()),
                        _ => Names::Many(named),
                    };
                }
            }
        }));
    }
    for (name, set) in &draft.spec.meters {
        if let Some(points) = &set.points_m {
            let lists = fewer(points, 1).into_iter();
            all.extend(lists.map(|points| edit_set(draft, name, |set| set.points_m = Some(points))));
        } else if let Some(grid) = &set.grid {
            let one = vec![grid.origin_m];
            all.push(edit_set(draft, name, |set| (set.points_m, set.grid) = (Some(one), None)));
            let [nu, nv] = grid.counts;
            for counts in [
                [nu.div_ceil(2), nv],
                [nu, nv.div_ceil(2)],
                [nu.saturating_sub(1).max(1), nv],
                [nu, nv.saturating_sub(1).max(1)],
            ] {
                all.push(edit_set(draft, name, |set| {
                    if let Some(grid) = &mut set.grid {
                        grid.counts = counts;
                    }
                }));
            }
        }
    }
    all
}

fn edit_set(draft: &Draft, name: &str, change: impl FnOnce(&mut MeterSet)) -> Draft {
    with(draft, |d| {
        if let Some(set) = d.spec.meters.get_mut(name) {
            change(set);
        }
    })
}

fn fewer_angles(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (procedure, asked) in &draft.spec.procedures.0 {
        let Asked::Angles(asked) = asked else { continue };
        let edit = |change: &dyn Fn(&mut crate::procedures::AtAngles)| {
            with(draft, |d| {
                if let Some(Asked::Angles(asked)) = d.spec.procedures.0.get_mut(procedure) {
                    change(asked);
                }
            })
        };
        for distance_m in rounder(asked.distance_m) {
            all.push(edit(&|asked| asked.distance_m = distance_m));
        }
        if let Angles::Listed(AngleLists { gamma_deg, c_deg }) = &asked.angles {
            let listed = |gamma_deg: Vec<f64>, c_deg: Vec<f64>| Angles::Listed(AngleLists { gamma_deg, c_deg });
            for gamma in fewer(gamma_deg, 1).into_iter().chain(rounder_list(gamma_deg)) {
                all.push(edit(&|asked| asked.angles = listed(gamma.clone(), c_deg.clone())));
            }
            for c in fewer(c_deg, 1).into_iter().chain(rounder_list(c_deg)) {
                all.push(edit(&|asked| asked.angles = listed(gamma_deg.clone(), c.clone())));
            }
        }
    }
    all
}

/// Rounder numbers near one, the roundest first.
fn rounder(x: f64) -> Vec<f64> {
    let decimals = |n: i32| (x * 10_f64.powi(n)).round() / 10_f64.powi(n) + 0.0;
    let mut all: Vec<f64> = vec![0.0];
    all.extend([0, 1, 2, 3, 4].map(decimals));
    all.extend([1, 2, 3].map(|n| to_digits(x, n)));
    all.retain(|y| y.to_string().len() < x.to_string().len());
    all.dedup();
    all
}

fn rounder_list(list: &[f64]) -> Vec<Vec<f64>> {
    (0..list.len()).flat_map(|k| rounder(list[k]).into_iter().map(move |x| replaced(list, k, x))).collect()
}

fn replaced(list: &[f64], k: usize, x: f64) -> Vec<f64> {
    let mut list = list.to_vec();
    list[k] = x;
    list
}

/// A point with rounder coordinates: all of them, then one by one.
fn rounder_points(point: [f64; 3]) -> Vec<[f64; 3]> {
    let decimals = |n: i32| point.map(|x| (x * 10_f64.powi(n)).round() / 10_f64.powi(n) + 0.0);
    let mut all: Vec<[f64; 3]> = [0, 1, 2, 3].map(decimals).to_vec();
    for k in 0..3 {
        all.extend(rounder(point[k]).into_iter().map(|x| {
            let mut point = point;
            point[k] = x;
            point
        }));
    }
    all
}

/// The reflectance of the first wall.
fn one_wall(walls: &Walls) -> Fraction {
    match walls {
        Walls::All(rho) => *rho,
        Walls::Each(walls) => walls.x_min,
        Walls::Listed(walls) => walls.first().copied().unwrap_or(Fraction(0.0)),
    }
}

/// Of a room over a polygon: the box around it, or a corner less.
fn straighter_room(draft: &Draft) -> Vec<Draft> {
    let Some((floor, height)) = draft.spec.room.floor_m.as_ref().zip(draft.spec.room.height_m) else { return vec![] };
    let farthest = |k: usize| floor.iter().map(|corner| corner[k]).fold(0.0, f64::max);
    let alike = |room: &mut RoomSpec| {
        if let Some(reflectance) = &mut room.reflectance {
            reflectance.walls = Walls::All(one_wall(&reflectance.walls));
        }
    };
    let as_box = with(draft, |d| {
        alike(&mut d.spec.room);
        let size_m = Some([farthest(0), farthest(1), height]);
        d.spec.room = RoomSpec { size_m, floor_m: None, height_m: None, ..std::mem::take(&mut d.spec.room) };
    });
    let without = |k: usize| {
        with(draft, |d| {
            alike(&mut d.spec.room);
            let left = floor.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, corner)| *corner);
            d.spec.room.floor_m = Some(left.collect());
        })
    };
    let corners = if floor.len() > 3 { floor.len() } else { 0 };
    std::iter::once(as_box).chain((0..corners).map(without)).collect()
}

/// Of a room that is a box.
fn plainer_room(draft: &Draft) -> Vec<Draft> {
    let Some((now, size)) = draft.spec.room.reflectance.clone().zip(draft.spec.room.size_m) else { return vec![] };
    let black = ReflectanceSpec { floor: Fraction(0.0), walls: Walls::All(Fraction(0.0)), ceiling: Fraction(0.0) };
    let mut all = vec![with(draft, |d| d.spec.room.reflectance = Some(black))];
    let part = |change: &dyn Fn(&mut ReflectanceSpec)| {
        let mut reflectance = now.clone();
        change(&mut reflectance);
        with(draft, |d| d.spec.room.reflectance = Some(reflectance))
    };
    let wall = one_wall(&now.walls);
    all.push(part(&|r| r.walls = Walls::All(Fraction(0.0))));
    all.push(part(&|r| r.walls = Walls::All(wall)));
    all.extend(rounder(wall.0).into_iter().map(|x| part(&|r| r.walls = Walls::All(Fraction(x)))));
    all.extend(rounder(now.floor.0).into_iter().map(|x| part(&|r| r.floor = Fraction(x))));
    all.extend(rounder(now.ceiling.0).into_iter().map(|x| part(&|r| r.ceiling = Fraction(x))));
    let whole = size.map(f64::ceil);
    all.extend(
        [[whole.into_iter().fold(1.0, f64::max); 3], whole]
            .into_iter()
            .chain(rounder_points(size))
            .map(|size_m| with(draft, |d| d.spec.room.size_m = Some(size_m))),
    );
    all
}

fn plainer_luminaires(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (k, luminaire) in draft.spec.luminaires.iter().enumerate() {
        let mut push =
            |change: &dyn Fn(&mut LuminaireSpec)| all.push(with(draft, |d| change(&mut d.spec.luminaires[k])));
        push(&|l| l.rotate_deg = RotationSpec::default());
        push(&|l| l.flux_scale = 1.0);
        push(&|l| l.model = ModelSpec::Point);
        let first = &draft.spec.luminaires[0].photometry;
        push(&|l| l.photometry.clone_from(first));
        let RotationSpec { azimuth, tilt, roll } = luminaire.rotate_deg;
        for angle in rounder(azimuth) {
            push(&|l| l.rotate_deg.azimuth = angle);
        }
        for angle in rounder(tilt) {
            push(&|l| l.rotate_deg.tilt = angle);
        }
        for angle in rounder(roll) {
            push(&|l| l.rotate_deg.roll = angle);
        }
        for factor in rounder(luminaire.flux_scale) {
            push(&|l| l.flux_scale = factor);
        }
    }
    all
}

fn rounder_places(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (k, luminaire) in draft.spec.luminaires.iter().enumerate() {
        let places = luminaire.at_m.into_iter().flat_map(rounder_points);
        all.extend(places.map(|at_m| with(draft, |d| d.spec.luminaires[k].at_m = Some(at_m))));
    }
    for (k, body) in draft.spec.obstacles.iter().enumerate() {
        if let Some(cuboid) = &body.cuboid {
            let edit = |change: &dyn Fn(&mut crate::spec::model::BoxSpec)| {
                with(draft, |d| {
                    if let Some(cuboid) = &mut d.spec.obstacles[k].cuboid {
                        change(cuboid);
                    }
                })
            };
            all.extend(rounder_points(cuboid.min_m).into_iter().map(|p| edit(&|b| b.min_m = p)));
            all.extend(rounder_points(cuboid.max_m).into_iter().map(|p| edit(&|b| b.max_m = p)));
        }
    }
    for (name, set) in &draft.spec.meters {
        let Some(own) = set.normal else { continue };
        let normal = DVec3::from(own);
        let longest = normal.abs().max_element();
        let axis = normal.to_array().map(|x| if x.abs() == longest { x.signum() } else { 0.0 });
        let normals = [axis, normal.normalize().to_array()].into_iter().chain(rounder_points(own));
        all.extend(normals.map(|normal| edit_set(draft, name, |set| set.normal = Some(normal))));
        for (k, point) in set.points_m.iter().flatten().enumerate() {
            all.extend(rounder_points(*point).into_iter().map(|p| {
                edit_set(draft, name, |set| {
                    if let Some(points) = &mut set.points_m {
                        points[k] = p;
                    }
                })
            }));
        }
    }
    all
}

/// Every photometric file with what it says, once each.
fn tables(draft: &Draft) -> Vec<(PathBuf, Photometry)> {
    draft.files.iter().filter_map(|(name, file)| Some((name.clone(), file.photometry.clone()?))).collect()
}

/// The draft with another photometric file in the place of one.
fn refiled(draft: &Draft, name: &Path, photometry: &Photometry) -> Draft {
    filed(draft, name, File::lm63(photometry))
}

fn filed(draft: &Draft, name: &Path, file: File) -> Draft {
    let new = name.with_extension("ies");
    with(draft, |d| {
        d.files.remove(name);
        d.files.insert(new.clone(), file);
        for luminaire in d.spec.luminaires.iter_mut().filter(|l| l.photometry == name) {
            luminaire.photometry.clone_from(&new);
        }
    })
}

fn retabled(
    draft: &Draft,
    name: &Path,
    old: &Photometry,
    table: Option<LuminousIntensityDistribution>,
) -> Option<Draft> {
    // A table that says several things of one direction fails for that alone.
    let table = table.filter(|table| is_single_valued(table) || !is_single_valued(&old.distribution))?;
    let plain = Photometry { opening: old.opening, ..Photometry::of(table) };
    Some(refiled(draft, name, &plain))
}

/// LM-63 without keywords, and the plainest tables of all.
fn plainer_files(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let bright = to_digits(old.distribution.max_intensity().value(), 1);
        let plain = [([0.0, 90.0], 100.0), ([0.0, 180.0], 100.0), ([0.0, 90.0], bright), ([0.0, 180.0], bright)];
        all.extend(plain.into_iter().filter_map(|(gamma, cd)| retabled(draft, &name, &old, constant(gamma, cd))));
        all.extend(retabled(draft, &name, &old, Some(old.distribution.clone())));
        all.extend(smallest().into_iter().filter_map(|table| retabled(draft, &name, &old, Some(table))));
        // What fails for its type alone keeps it.
        if let Details::Lm63(Lm63Details { goniometer: kind @ (Goniometer::A | Goniometer::B), .. }) = old.details {
            let files = smallest_of_type(kind).into_iter().map(|text| File::of_lm63(text.into_bytes()));
            all.extend(files.map(|file| filed(draft, &name, file)));
        }
    }
    all
}

fn fewer_planes(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let table = &old.distribution;
        let (c_deg, gamma) = (table.c_deg(), table.gamma_deg());
        if c_deg.len() < 2 {
            continue;
        }
        let made = |c: &[usize]| {
            let values = c.iter().flat_map(|k| table.plane(*k).to_vec()).collect();
            let angles = if let [_] = c { vec![0.0] } else { c.iter().map(|k| c_deg[*k]).collect() };
            table.with_table(angles, gamma.to_vec(), values).ok()
        };
        let planes: Vec<usize> = (0..c_deg.len()).collect();
        let singles = planes.iter().map(|k| vec![*k]);
        let up_to = |last: f64| planes.iter().copied().filter(move |k| c_deg[*k] <= last).collect::<Vec<_>>();
        let parts = [up_to(90.0), up_to(180.0)].into_iter();
        // The ends are what the symmetry is told by.
        let inner = &planes[1..planes.len() - 1];
        let thinned =
            fewer(inner, 0).into_iter().map(|inner| [&planes[..1], &inner[..], &planes[planes.len() - 1..]].concat());
        let lists = singles.chain(parts).chain(thinned).filter(|list| !list.is_empty());
        all.extend(lists.filter_map(|list| retabled(draft, &name, &old, made(&list))));
    }
    all
}

fn fewer_gammas(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let table = &old.distribution;
        let gamma = table.gamma_deg();
        let made = |kept: &[usize]| {
            let row = |c: usize| kept.iter().map(move |g| table.plane(c)[*g]);
            let values = (0..table.c_deg().len()).flat_map(row).collect();
            table.with_table(table.c_deg().to_vec(), kept.iter().map(|g| gamma[*g]).collect(), values).ok()
        };
        let angles: Vec<usize> = (0..gamma.len()).collect();
        let ends = vec![0, gamma.len() - 1];
        let lists = std::iter::once(ends).chain(fewer(&angles, 2));
        all.extend(lists.filter_map(|kept| retabled(draft, &name, &old, made(&kept))));
    }
    all
}

fn rounder_values(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let table = &old.distribution;
        let values: Vec<f64> = (0..table.c_deg().len()).flat_map(|c| table.plane(c).to_vec()).collect();
        let made = |values: Vec<f64>| table.with_table(table.c_deg().to_vec(), table.gamma_deg().to_vec(), values).ok();
        let mut lists: Vec<Vec<f64>> = [1, 2].map(|n| values.iter().map(|x| to_digits(*x, n)).collect()).to_vec();
        // A hundred times as bright or dark is another hundred candela.
        let scale = 100.0 / to_digits(table.max_intensity().value(), 1).max(f64::MIN_POSITIVE);
        lists.push(values.iter().map(|x| to_digits(x * scale, 2)).collect());
        if values.len() <= 16 {
            for k in 0..values.len() {
                lists.push(replaced(&values, k, 0.0));
                lists.push(replaced(&values, k, to_digits(values[k], 1)));
            }
        }
        all.extend(lists.into_iter().filter_map(|values| retabled(draft, &name, &old, made(values))));
        let angles = rounder_list(table.gamma_deg()).into_iter();
        let turned = |gamma: Vec<f64>| table.with_table(table.c_deg().to_vec(), gamma, values.clone()).ok();
        all.extend(angles.filter_map(|gamma| retabled(draft, &name, &old, turned(gamma))));
    }
    all
}

fn plainer_openings(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let one = |x: f64| to_digits(x, 1);
        let openings = match old.opening {
            LuminousOpening::Point => vec![],
            LuminousOpening::Box { x_m, y_m, height_m } => vec![
                LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 },
                LuminousOpening::Box { x_m, y_m, height_m: 0.0 },
                LuminousOpening::Box { x_m: one(x_m), y_m: one(x_m), height_m: one(height_m) },
                LuminousOpening::Box { x_m: one(x_m), y_m: one(y_m), height_m: one(height_m) },
            ],
            LuminousOpening::Ellipse { x_m, y_m, height_m } => vec![
                LuminousOpening::Ellipse { x_m: one(x_m), y_m: one(x_m), height_m: 0.0 },
                LuminousOpening::Ellipse { x_m: one(x_m), y_m: one(y_m), height_m: one(height_m) },
            ],
            LuminousOpening::Ellipsoid { x_m, y_m, z_m } => vec![
                LuminousOpening::Ellipsoid { x_m: one(x_m), y_m: one(x_m), z_m: one(x_m) },
                LuminousOpening::Ellipsoid { x_m: one(x_m), y_m: one(y_m), z_m: one(z_m) },
            ],
            LuminousOpening::LyingCylinder { axis, length_m, diameter_m } => {
                vec![LuminousOpening::LyingCylinder { axis, length_m: one(length_m), diameter_m: one(diameter_m) }]
            }
        };
        let point = (old.opening != LuminousOpening::Point).then_some(LuminousOpening::Point);
        let openings = point.into_iter().chain(openings);
        all.extend(
            openings.map(|opening| {
                refiled(draft, &name, &Photometry { opening, ..Photometry::of(old.distribution.clone()) })
            }),
        );
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_of_a_list_can_go_alone_and_in_larger_parts() {
        let lists = fewer(&[1, 2, 3, 4], 1);
        for list in [vec![1], vec![3, 4], vec![1, 2], vec![1, 3, 4], vec![1, 2, 3]] {
            assert!(lists.contains(&list), "{list:?} of {lists:?}");
        }
        assert_eq!(fewer(&[1], 0), [Vec::<i32>::new()]);
        assert!(fewer(&[1], 1).is_empty());
        assert!(rounder(0.123456).contains(&0.1) && rounder(5.0).is_empty());
    }
}
