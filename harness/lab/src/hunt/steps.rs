//! Steps that make a spec smaller. Each step returns candidates, from those that save most to those
//! that save a digit; the shrinker tests which of them still fail.

use std::path::{Path, PathBuf};

use glam::DVec3;
use luxproof_photometry::{
    Details, Goniometer, LuminousIntensityDistribution, LuminousOpening, Photometry, lm63::Lm63Details,
};

use super::draft::{Draft, File};
use super::grammar::constant_table;
use super::oracle::Sighting;
use super::table::{is_single_valued, round_to_digits, smallest_files_of_type, smallest_tables};
use luxproof_model::ProcedureId;
use luxproof_spec::model::{
    BoxSpec, Fraction, LuminaireSpec, MeterSet, ModelSpec, ReflectanceSpec, RoomSpec, RotationSpec, Walls,
};
use luxproof_spec::procedures::{AngleLists, Angles, AtAngles, Names, ProcedureRequest};

/// A step: the smaller candidates of a draft.
pub(super) type Step = fn(&Draft) -> Vec<Draft>;

/// All steps in the order in which the shrinker tries them, until none of them helps.
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
/// A copy of a draft with a change.
fn with(draft: &Draft, change: impl FnOnce(&mut Draft)) -> Draft {
    let mut draft = draft.clone();
    change(&mut draft);
    draft
}

/// Keeps only the engine and the procedure of a symptom: first only the worst meter, then all
/// meters, where one is too few.
pub(super) fn focused(draft: &Draft, sighting: &Sighting) -> Vec<Draft> {
    let symptom = &sighting.symptom;
    let only_symptom = with(draft, |d| {
        d.spec.procedures.0.retain(|procedure, _| *procedure == symptom.procedure);
        d.spec.title = None;
        d.spec.published = None;
        if let Some(engines) = &mut d.spec.engines {
            engines.retain(|name, settings| symptom.engine == *name && !settings.0.is_empty());
        }
        d.spec.engines = d.spec.engines.take().filter(|engines| !engines.is_empty());
    });
    let Some(worst) = &sighting.comparison else { return vec![only_symptom] };
    let at_worst = with(&only_symptom, |d| {
        let Some(asked) = d.spec.procedures.0.get_mut(&symptom.procedure) else { return };
        d.spec.meters.clear();
        if let Some(names) = asked.meters_mut() {
            *names = Names::One("m".to_owned());
            let set = MeterSet { points_m: Some(vec![worst.at_m]), normal: Some(worst.normal), ..MeterSet::default() };
            d.spec.meters.insert("m".to_owned(), set);
        }
        if let (ProcedureRequest::Angles(asked), Some((gamma, c))) = (&mut *asked, worst.gamma_deg.zip(worst.c_deg)) {
            asked.angles = Angles::Listed(AngleLists { gamma_deg: vec![gamma], c_deg: vec![c] });
        }
        if let Some(id) = asked.named().0 {
            d.spec.luminaires.retain(|l| l.id == id);
            d.spec.obstacles.clear();
        }
    });
    vec![at_worst, only_symptom]
}

/// All lists without a part of a list; the parts get smaller, and at least `least` items stay.
/// Lists of single items come first.
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

/// Leaves out tolerances, settings of engines and the budget.
fn trimmings(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    if !draft.spec.tolerances.is_empty() {
        all.push(with(draft, |d| d.spec.tolerances.clear()));
    }
    if draft.spec.engines.as_ref().is_some_and(|e| e.keys().all(|name| luxproof_engines::entry(name).is_some())) {
        all.push(with(draft, |d| d.spec.engines = None));
    }
    all.push(with(draft, |d| d.spec.budget = luxproof_spec::Budget::default()));
    all
}

/// Leaves out luminaires.
fn fewer_luminaires(draft: &Draft) -> Vec<Draft> {
    let lists = fewer(&draft.spec.luminaires, 1);
    lists.into_iter().map(|luminaires| with(draft, |d| d.spec.luminaires = luminaires)).collect()
}

/// Leaves out bodies, or makes one of them black.
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

/// Leaves out sets of meters and single meters.
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

/// The draft with a change of one set of meters.
fn edit_set(draft: &Draft, name: &str, change: impl FnOnce(&mut MeterSet)) -> Draft {
    with(draft, |d| {
        if let Some(set) = d.spec.meters.get_mut(name) {
            change(set);
        }
    })
}

/// The draft with a change of the angles that a procedure asks for.
fn edit_angles(draft: &Draft, procedure: ProcedureId, change: impl FnOnce(&mut AtAngles)) -> Draft {
    with(draft, |d| {
        if let Some(ProcedureRequest::Angles(asked)) = d.spec.procedures.0.get_mut(&procedure) {
            change(asked);
        }
    })
}

/// Leaves out angles and makes distances and angles rounder.
fn fewer_angles(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (procedure, asked) in &draft.spec.procedures.0 {
        let ProcedureRequest::Angles(asked) = asked else { continue };
        for distance_m in rounder(asked.distance_m) {
            all.push(edit_angles(draft, *procedure, |asked| asked.distance_m = distance_m));
        }
        if let Angles::Listed(AngleLists { gamma_deg, c_deg }) = &asked.angles {
            let gammas = fewer(gamma_deg, 1).into_iter().chain(rounder_list(gamma_deg));
            let planes = fewer(c_deg, 1).into_iter().chain(rounder_list(c_deg));
            let lists = gammas
                .map(|gamma_deg| AngleLists { gamma_deg, c_deg: c_deg.clone() })
                .chain(planes.map(|c_deg| AngleLists { gamma_deg: gamma_deg.clone(), c_deg }));
            all.extend(lists.map(|lists| edit_angles(draft, *procedure, |asked| asked.angles = Angles::Listed(lists))));
        }
    }
    all
}

/// Rounds a number to decimals; adding zero turns a negative zero into zero.
fn round_to_decimals(x: f64, decimals: i32) -> f64 {
    (x * 10_f64.powi(decimals)).round() / 10_f64.powi(decimals) + 0.0
}

/// Shorter numbers near a number, the shortest first.
fn rounder(x: f64) -> Vec<f64> {
    let mut all: Vec<f64> = vec![0.0];
    all.extend([0, 1, 2, 3, 4].map(|decimals| round_to_decimals(x, decimals)));
    all.extend([1, 2, 3].map(|digits| round_to_digits(x, digits)));
    all.retain(|y| y.to_string().len() < x.to_string().len());
    all.dedup();
    all
}

/// The list with one number rounder.
fn rounder_list(list: &[f64]) -> Vec<Vec<f64>> {
    (0..list.len()).flat_map(|k| rounder(list[k]).into_iter().map(move |x| replaced(list, k, x))).collect()
}

/// The list with another number at an index.
fn replaced(list: &[f64], k: usize, x: f64) -> Vec<f64> {
    let mut list = list.to_vec();
    list[k] = x;
    list
}

/// A point with rounder coordinates: first all of them, then one at a time.
fn rounder_points(point: [f64; 3]) -> Vec<[f64; 3]> {
    let mut all: Vec<[f64; 3]> = [0, 1, 2, 3].map(|n| point.map(|x| round_to_decimals(x, n))).to_vec();
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
fn first_wall(walls: &Walls) -> Fraction {
    match walls {
        Walls::All(rho) => *rho,
        Walls::Each(walls) => walls.x_min,
        Walls::Listed(walls) => walls.first().copied().unwrap_or(Fraction(0.0)),
    }
}

/// Gives all walls of a room the reflectance of the first one.
fn level_walls(room: &mut RoomSpec) {
    if let Some(reflectance) = &mut room.reflectance {
        reflectance.walls = Walls::All(first_wall(&reflectance.walls));
    }
}

/// Replaces a polygon room by the box around it, or leaves out one corner.
fn straighter_room(draft: &Draft) -> Vec<Draft> {
    let Some((floor, height)) = draft.spec.room.floor_m.as_ref().zip(draft.spec.room.height_m) else { return vec![] };
    let mut all = vec![with(draft, |d| {
        level_walls(&mut d.spec.room);
        let [x, y] = [0, 1].map(|k| floor.iter().map(|corner| corner[k]).fold(0.0, f64::max));
        let size_m = Some([x, y, height]);
        d.spec.room = RoomSpec { size_m, floor_m: None, height_m: None, ..std::mem::take(&mut d.spec.room) };
    })];
    // A triangle has no corner to spare.
    for k in 0..if floor.len() > 3 { floor.len() } else { 0 } {
        all.push(with(draft, |d| {
            level_walls(&mut d.spec.room);
            let left = floor.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, corner)| *corner);
            d.spec.room.floor_m = Some(left.collect());
        }));
    }
    all
}

/// Makes surfaces of a box room black or rounder, and its size rounder.
fn plainer_room(draft: &Draft) -> Vec<Draft> {
    let Some((now, size)) = draft.spec.room.reflectance.clone().zip(draft.spec.room.size_m) else { return vec![] };
    let black = ReflectanceSpec { floor: Fraction(0.0), walls: Walls::All(Fraction(0.0)), ceiling: Fraction(0.0) };
    let mut all = vec![with(draft, |d| d.spec.room.reflectance = Some(black))];
    let wall = first_wall(&now.walls);
    let mut parts = vec![
        ReflectanceSpec { walls: Walls::All(Fraction(0.0)), ..now.clone() },
        ReflectanceSpec { walls: Walls::All(wall), ..now.clone() },
    ];
    parts
        .extend(rounder(wall.0).into_iter().map(|x| ReflectanceSpec { walls: Walls::All(Fraction(x)), ..now.clone() }));
    parts.extend(rounder(now.floor.0).into_iter().map(|x| ReflectanceSpec { floor: Fraction(x), ..now.clone() }));
    parts.extend(rounder(now.ceiling.0).into_iter().map(|x| ReflectanceSpec { ceiling: Fraction(x), ..now.clone() }));
    all.extend(parts.into_iter().map(|part| with(draft, |d| d.spec.room.reflectance = Some(part))));
    let whole = size.map(f64::ceil);
    all.extend(
        [[whole.into_iter().fold(1.0, f64::max); 3], whole]
            .into_iter()
            .chain(rounder_points(size))
            .map(|size_m| with(draft, |d| d.spec.room.size_m = Some(size_m))),
    );
    all
}

/// The draft with a change of one luminaire.
fn edit_luminaire(draft: &Draft, k: usize, change: impl FnOnce(&mut LuminaireSpec)) -> Draft {
    with(draft, |d| change(&mut d.spec.luminaires[k]))
}

/// Removes rotation, dimming, openings and differing files of luminaires, or makes their numbers
/// rounder.
fn plainer_luminaires(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (k, luminaire) in draft.spec.luminaires.iter().enumerate() {
        all.push(edit_luminaire(draft, k, |l| l.rotate_deg = RotationSpec::default()));
        all.push(edit_luminaire(draft, k, |l| l.flux_scale = 1.0));
        all.push(edit_luminaire(draft, k, |l| l.model = ModelSpec::Point));
        let first = &draft.spec.luminaires[0].photometry;
        all.push(edit_luminaire(draft, k, |l| l.photometry.clone_from(first)));
        let RotationSpec { azimuth, tilt, roll } = luminaire.rotate_deg;
        for angle in rounder(azimuth) {
            all.push(edit_luminaire(draft, k, |l| l.rotate_deg.azimuth = angle));
        }
        for angle in rounder(tilt) {
            all.push(edit_luminaire(draft, k, |l| l.rotate_deg.tilt = angle));
        }
        for angle in rounder(roll) {
            all.push(edit_luminaire(draft, k, |l| l.rotate_deg.roll = angle));
        }
        for factor in rounder(luminaire.flux_scale) {
            all.push(edit_luminaire(draft, k, |l| l.flux_scale = factor));
        }
    }
    all
}

/// The draft with a change of one body, where that is a box.
fn edit_box(draft: &Draft, k: usize, change: impl FnOnce(&mut BoxSpec)) -> Draft {
    with(draft, |d| {
        if let Some(cuboid) = &mut d.spec.obstacles[k].cuboid {
            change(cuboid);
        }
    })
}

/// Makes positions and normals rounder.
fn rounder_places(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (k, luminaire) in draft.spec.luminaires.iter().enumerate() {
        let places = luminaire.at_m.into_iter().flat_map(rounder_points);
        all.extend(places.map(|at_m| with(draft, |d| d.spec.luminaires[k].at_m = Some(at_m))));
    }
    for (k, body) in draft.spec.obstacles.iter().enumerate() {
        if let Some(cuboid) = &body.cuboid {
            all.extend(rounder_points(cuboid.min_m).into_iter().map(|p| edit_box(draft, k, |b| b.min_m = p)));
            all.extend(rounder_points(cuboid.max_m).into_iter().map(|p| edit_box(draft, k, |b| b.max_m = p)));
        }
    }
    for (name, set) in &draft.spec.meters {
        let Some(old) = set.normal else { continue };
        let normal = DVec3::from(old);
        let longest = normal.abs().max_element();
        let axis = normal.to_array().map(|x| if x.abs() == longest { x.signum() } else { 0.0 });
        let normals = [axis, normal.normalize().to_array()].into_iter().chain(rounder_points(old));
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

/// Every photometric file that could be read, with its content.
fn tables(draft: &Draft) -> Vec<(PathBuf, Photometry)> {
    draft.files.iter().filter_map(|(name, file)| Some((name.clone(), file.photometry.clone()?))).collect()
}

/// The draft with a photometric file replaced by another one in LM-63.
fn replace_photometry(draft: &Draft, name: &Path, photometry: &Photometry) -> Draft {
    replace_file(draft, name, File::lm63(photometry))
}

/// The draft with a file replaced; it becomes an `.ies` file, and all luminaires that name it
/// follow.
fn replace_file(draft: &Draft, name: &Path, file: File) -> Draft {
    let new = name.with_extension("ies");
    with(draft, |d| {
        d.files.remove(name);
        d.files.insert(new.clone(), file);
        for luminaire in d.spec.luminaires.iter_mut().filter(|l| l.photometry == name) {
            luminaire.photometry.clone_from(&new);
        }
    })
}

/// The draft with another table in a photometric file; `None` where there is no table or a worse
/// one.
fn replace_table(
    draft: &Draft,
    name: &Path,
    old: &Photometry,
    table: Option<LuminousIntensityDistribution>,
) -> Option<Draft> {
    // A table that has several values in one direction fails for that reason only.
    let table = table.filter(|table| is_single_valued(table) || !is_single_valued(&old.distribution))?;
    let plain = Photometry { opening: old.opening, ..Photometry::of(table) };
    Some(replace_photometry(draft, name, &plain))
}

/// Replaces files by even or minimal tables, or by LM-63 without keywords.
fn plainer_files(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let bright = round_to_digits(old.distribution.max_intensity().value(), 1);
        let plain = [([0.0, 90.0], 100.0), ([0.0, 180.0], 100.0), ([0.0, 90.0], bright), ([0.0, 180.0], bright)];
        all.extend(
            plain.into_iter().filter_map(|(gamma, cd)| replace_table(draft, &name, &old, constant_table(gamma, cd))),
        );
        all.extend(replace_table(draft, &name, &old, Some(old.distribution.clone())));
        all.extend(smallest_tables().into_iter().filter_map(|table| replace_table(draft, &name, &old, Some(table))));
        // A fault of a goniometer type needs a file of that type.
        if let Details::Lm63(Lm63Details { goniometer: kind @ (Goniometer::A | Goniometer::B), .. }) = old.details {
            let files = smallest_files_of_type(kind).into_iter().map(|text| File::from_lm63(text.into_bytes()));
            all.extend(files.map(|file| replace_file(draft, &name, file)));
        }
    }
    all
}

/// The table with only some of its planes.
fn select_planes(table: &LuminousIntensityDistribution, planes: &[usize]) -> Option<LuminousIntensityDistribution> {
    let values = planes.iter().flat_map(|k| table.plane(*k).to_vec()).collect();
    // A single plane is C 0, whatever it was: the reader accepts no other.
    let angles = if let [_] = planes { vec![0.0] } else { planes.iter().map(|k| table.c_deg()[*k]).collect() };
    table.with_table(angles, table.gamma_deg().to_vec(), values).ok()
}

/// Leaves out C planes of tables.
fn fewer_planes(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let table = &old.distribution;
        let c_deg = table.c_deg();
        if c_deg.len() < 2 {
            continue;
        }
        let planes: Vec<usize> = (0..c_deg.len()).collect();
        let singles = planes.iter().map(|k| vec![*k]);
        let parts = [90.0, 180.0].map(|last| planes.iter().copied().filter(|k| c_deg[*k] <= last).collect::<Vec<_>>());
        // The first and the last plane determine the symmetry, so both stay.
        let inner = &planes[1..planes.len() - 1];
        let thinned =
            fewer(inner, 0).into_iter().map(|inner| [&planes[..1], &inner[..], &planes[planes.len() - 1..]].concat());
        let lists = singles.chain(parts).chain(thinned).filter(|list| !list.is_empty());
        all.extend(lists.filter_map(|list| replace_table(draft, &name, &old, select_planes(table, &list))));
    }
    all
}

/// The table with only some of its gamma angles.
fn select_gammas(table: &LuminousIntensityDistribution, rows: &[usize]) -> Option<LuminousIntensityDistribution> {
    let planes = 0..table.c_deg().len();
    let values = planes.flat_map(|c| rows.iter().map(move |g| table.plane(c)[*g])).collect();
    let angles = rows.iter().map(|g| table.gamma_deg()[*g]).collect();
    table.with_table(table.c_deg().to_vec(), angles, values).ok()
}

/// Leaves out gamma angles of tables.
fn fewer_gammas(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let table = &old.distribution;
        let angles: Vec<usize> = (0..table.gamma_deg().len()).collect();
        let ends = vec![0, angles.len() - 1];
        let lists = std::iter::once(ends).chain(fewer(&angles, 2));
        all.extend(lists.filter_map(|rows| replace_table(draft, &name, &old, select_gammas(table, &rows))));
    }
    all
}

/// The table with other values.
fn replace_values(table: &LuminousIntensityDistribution, values: Vec<f64>) -> Option<LuminousIntensityDistribution> {
    table.with_table(table.c_deg().to_vec(), table.gamma_deg().to_vec(), values).ok()
}

/// Makes values and gamma angles of tables rounder.
fn rounder_values(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        let table = &old.distribution;
        let values: Vec<f64> = (0..table.c_deg().len()).flat_map(|c| table.plane(c).to_vec()).collect();
        let mut lists: Vec<Vec<f64>> = [1, 2].map(|n| values.iter().map(|x| round_to_digits(*x, n)).collect()).to_vec();
        // Scaling the whole table to about a hundred candela keeps its form.
        let scale = 100.0 / round_to_digits(table.max_intensity().value(), 1).max(f64::MIN_POSITIVE);
        lists.push(values.iter().map(|x| round_to_digits(x * scale, 2)).collect());
        if values.len() <= 16 {
            for k in 0..values.len() {
                lists.push(replaced(&values, k, 0.0));
                lists.push(replaced(&values, k, round_to_digits(values[k], 1)));
            }
        }
        all.extend(
            lists.into_iter().filter_map(|values| replace_table(draft, &name, &old, replace_values(table, values))),
        );
        for gamma in rounder_list(table.gamma_deg()) {
            let turned = table.with_table(table.c_deg().to_vec(), gamma, values.clone()).ok();
            all.extend(replace_table(draft, &name, &old, turned));
        }
    }
    all
}

/// Rounds a length to one digit.
fn one_digit(x_m: f64) -> f64 {
    round_to_digits(x_m, 1)
}

/// Smaller or rounder openings than one.
fn plainer_opening(opening: LuminousOpening) -> Vec<LuminousOpening> {
    let plainer = match opening {
        LuminousOpening::Point => return vec![],
        LuminousOpening::Box { x_m, y_m, height_m } => vec![
            LuminousOpening::Box { x_m: 1.0, y_m: 1.0, height_m: 0.0 },
            LuminousOpening::Box { x_m, y_m, height_m: 0.0 },
            LuminousOpening::Box { x_m: one_digit(x_m), y_m: one_digit(x_m), height_m: one_digit(height_m) },
            LuminousOpening::Box { x_m: one_digit(x_m), y_m: one_digit(y_m), height_m: one_digit(height_m) },
        ],
        LuminousOpening::Ellipse { x_m, y_m, height_m } => vec![
            LuminousOpening::Ellipse { x_m: one_digit(x_m), y_m: one_digit(x_m), height_m: 0.0 },
            LuminousOpening::Ellipse { x_m: one_digit(x_m), y_m: one_digit(y_m), height_m: one_digit(height_m) },
        ],
        LuminousOpening::Ellipsoid { x_m, y_m, z_m } => vec![
            LuminousOpening::Ellipsoid { x_m: one_digit(x_m), y_m: one_digit(x_m), z_m: one_digit(x_m) },
            LuminousOpening::Ellipsoid { x_m: one_digit(x_m), y_m: one_digit(y_m), z_m: one_digit(z_m) },
        ],
        LuminousOpening::LyingCylinder { axis, length_m, diameter_m } => {
            vec![LuminousOpening::LyingCylinder {
                axis,
                length_m: one_digit(length_m),
                diameter_m: one_digit(diameter_m),
            }]
        }
    };
    [LuminousOpening::Point].into_iter().chain(plainer).collect()
}

/// Replaces luminous openings by points, or by smaller or rounder openings.
fn plainer_openings(draft: &Draft) -> Vec<Draft> {
    let mut all = vec![];
    for (name, old) in tables(draft) {
        all.extend(plainer_opening(old.opening).into_iter().map(|opening| {
            replace_photometry(draft, &name, &Photometry { opening, ..Photometry::of(old.distribution.clone()) })
        }));
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
