//! How often a diagnosis is right: faults drawn at random, kind by kind, in rooms drawn at random, judged and
//! explained like readings of a real engine, scenes of the calibration included.

use std::fmt;
use std::sync::Arc;

use glam::DVec3;
use luminaire::geometry::{Reflectances, Room};
use luminaire::photometry::{LuminousIntensityDistribution, Photometry};
use luminaire::scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};
use serde::Serialize;

use super::SelftestError;
use crate::diagnosis::{self, Cause, Examined, Fault, Model, truth};
use crate::judge::{Comparison, Judge, Policy, Verdict};
use crate::procedures::{Target, Task, known};
use crate::record::{MeterId, ProcedureId, Quantity, Reading, ReadingKey, Recording, Uncertainty};
use crate::spec::Case;
use crate::system::random::normal;

/// The subject's name, of which no deviation is on record.
const SUBJECT: &str = "subject";
/// Rooms and faults that are drawn at most for one that shows.
const DRAWS: usize = 30;
/// A fitted parameter counts as the true one within so many standard errors, and this share of it.
const WITHIN: (f64, f64) = (5.0, 0.03);

/// What becomes of the faults of each kind.
#[derive(Clone, Debug, Serialize)]
pub struct Naming {
    pub kinds: Vec<Named>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Named {
    pub kind: String,
    /// Whether the diagnosis knows such faults; of others silence is right.
    pub is_known: bool,
    pub failing: usize,
    /// The fault is named, and no other.
    pub right: usize,
    /// It is named among two or three that explain what is read equally well.
    pub among: usize,
    /// Only others are named.
    pub wrong: usize,
    pub silent: usize,
    /// The mean seconds of a diagnosis, and the most.
    pub mean_s: f64,
    pub worst_s: f64,
    /// What was said wrongly, and of what.
    pub errors: Vec<String>,
}

/// What an engine reads of a task.
type Reads = Box<dyn Fn(&Model) -> Vec<f64>>;

/// A fault that is put in.
struct Put {
    /// Parts of it, any of which may be named alone where it alone shows; none for what no diagnosis knows.
    parts: Vec<(Fault, Vec<f64>)>,
    reads: Reads,
}

/// Draws a fault for tasks of a case.
type Draw = fn(&[Task], &mut fastrand::Rng) -> Option<Put>;

const KINDS: [(&str, bool, Draw); 17] = [
    ("listed", true, |tasks, random| one_of(diagnosis::faults(&[tasks]), diagnosis::Fault::is_plain, random)),
    ("bounces", true, |tasks, random| one_of(diagnosis::faults(&[tasks]), |f| f.id == "bounces-cut", random)),
    ("order of meters", true, |tasks, random| {
        let orders = ["reversed", "next", "previous", "exchanged"];
        one_of(diagnosis::faults(&[tasks]), |f| orders.contains(&f.id), random)
    }),
    ("reflectance of a surface", true, |tasks, random| of_kind(tasks, "reflectance", random)),
    ("all reflectances", true, |tasks, random| of_kind(tasks, "reflectances", random)),
    ("place of a luminaire", true, |tasks, random| of_kind(tasks, "place", random)),
    ("turn about the vertical", true, |tasks, random| of_kind(tasks, "turn", random)),
    ("tilt", true, |tasks, random| of_kind(tasks, "tilt", random)),
    ("flux of one luminaire", true, |tasks, random| of_kind(tasks, "flux", random)),
    ("shift of all meters", true, |tasks, random| of_kind(tasks, "shifted", random)),
    ("two listed", true, two),
    ("control: lux to the power of 1.05", false, |_, _| Some(control(|m| scaled_power(&m.right, 1.05)))),
    ("control: squared lux", false, |_, _| Some(control(|m| m.right.iter().map(|r| r * r).collect()))),
    ("control: three surfaces at once", false, |_, random| {
        let by = [0; 3].map(|_| random.f64());
        Some(control(move |m| {
            relit(m, |scene| {
                let Some(room) = scene.room.as_mut().filter(|_| m.case == 0) else { return };
                let r = &mut room.reflectance;
                (r.floor, r.wall_x_min, r.ceiling) = (by[0], by[1], by[2]);
            })
        }))
    }),
    ("control: wrong table", false, |_, random| {
        let seed = random.u64(..);
        Some(control(move |m| relit(m, |scene| scene.luminaires.iter_mut().for_each(|l| scatter(l, seed)))))
    }),
    ("control: reflected light alone brighter", false, |_, random| {
        let factor = 1.03 + 0.3 * random.f64();
        let is_reflected = |m: &Model| matches!(m.task.transport, Transport::Indirect(_));
        Some(control(move |m| m.right.iter().map(|r| if is_reflected(m) { factor * r } else { *r }).collect()))
    }),
    ("control: scatter not stated", false, |_, random| {
        let seed = random.u64(..);
        Some(control(move |m| {
            let mut random = fastrand::Rng::with_seed(seed);
            m.right.iter().map(|r| (r * (1.0 + 0.1 * normal(&mut random))).max(0.0)).collect()
        }))
    }),
];

fn one_of(faults: Vec<Fault>, is_meant: impl Fn(&Fault) -> bool, random: &mut fastrand::Rng) -> Option<Put> {
    let meant: Vec<Fault> = faults.into_iter().filter(|f| is_meant(f) && f.id != "dark").collect();
    Some(put(random.choice(meant)?, vec![]))
}

fn put(fault: Fault, parameters: Vec<f64>) -> Put {
    let (change, values) = (fault.clone(), parameters.clone());
    let reads = move |m: &Model| change.readings(m, &values).unwrap_or_else(|| m.right.clone());
    Put { parts: vec![(fault, parameters)], reads: Box::new(reads) }
}

fn control(reads: impl Fn(&Model) -> Vec<f64> + 'static) -> Put {
    Put { parts: vec![], reads: Box::new(reads) }
}

/// A kind with parameters, drawn from what installers and exporters get wrong.
fn of_kind(tasks: &[Task], id: &str, random: &mut fastrand::Rng) -> Option<Put> {
    let fault = random.choice(diagnosis::kinds(&[tasks]).into_iter().filter(|f| f.id == id).collect::<Vec<_>>())?;
    let draw = |p: &diagnosis::Parameter| match p.unit {
        " m" => p.starts[0] + 0.3 * (2.0 * random.f64() - 1.0),
        " degrees" => {
            if p.starts.len() > 1 {
                360.0 * random.f64() - 180.0
            } else {
                30.0 * (2.0 * random.f64() - 1.0)
            }
        }
        _ => (p.starts[0] * (0.4 + 1.2 * random.f64())).clamp(p.range.0, p.range.1),
    };
    let parameters = fault.parameters.iter().map(draw).collect();
    Some(put(fault, parameters))
}

fn two(tasks: &[Task], random: &mut fastrand::Rng) -> Option<Put> {
    let mut listed: Vec<Fault> = diagnosis::faults(&[tasks]).into_iter().filter(Fault::is_plain).collect();
    let one = listed.swap_remove(random.usize(..listed.len()));
    let other = listed.swap_remove(random.usize(..listed.len()));
    if one.about == other.about || one.id == other.id {
        return None;
    }
    let both = put(one.and(&other), vec![]);
    Some(Put { parts: vec![(one, vec![]), (other, vec![])], ..both })
}

fn scaled_power(right: &[f64], power: f64) -> Vec<f64> {
    let mean = right.iter().sum::<f64>() / right.len() as f64;
    right.iter().map(|r| if *r > 0.0 { mean * (r / mean).powf(power) } else { 0.0 }).collect()
}

fn relit(model: &Model, change: impl Fn(&mut Scene)) -> Vec<f64> {
    let mut task = model.task.clone();
    change(&mut task.scene);
    truth(&task).unwrap_or_else(|| model.right.clone())
}

/// Every candela off by a tenth.
fn scatter(luminaire: &mut Luminaire, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    let table = &luminaire.photometry.distribution;
    let (c_deg, gamma_deg) = (table.c_deg().to_vec(), table.gamma_deg().to_vec());
    let at = |c: &f64| gamma_deg.iter().map(|g| table.intensity(*c, *g).value()).collect::<Vec<_>>();
    let candela = c_deg.iter().flat_map(at).map(|cd| (cd * (1.0 + 0.1 * normal(&mut random))).max(0.0)).collect();
    if let Ok(table) = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela) {
        luminaire.photometry = Arc::new(Photometry::of(table));
    }
}

/// So many faults that show of each kind.
pub fn naming(runs: usize, seed: u64) -> Result<Naming, SelftestError> {
    let policy = Policy::built_in().map_err(|e| SelftestError(e.to_string()))?;
    let case = Case::default();
    let judge = policy.judge(&case, None);
    let calibration: Vec<Task> = known::tasks();
    let right: Vec<Option<Vec<f64>>> = calibration.iter().map(truth).collect();
    let of_kind = |(k, (kind, is_known, draw)): (usize, &(&str, bool, Draw))| {
        let mut named = Named { kind: (*kind).to_owned(), is_known: *is_known, ..Named::default() };
        let mut random = fastrand::Rng::with_seed(seed.wrapping_mul(1000).wrapping_add(k as u64));
        for _ in 0..runs * DRAWS {
            if named.failing < runs {
                one(&mut named, *draw, (&calibration, &right), &judge, &mut random);
            }
        }
        named
    };
    Ok(Naming { kinds: KINDS.iter().enumerate().map(of_kind).collect() })
}

fn one(
    named: &mut Named,
    draw: Draw,
    (calibration, known): (&[Task], &[Option<Vec<f64>>]),
    judge: &Judge<'_>,
    random: &mut fastrand::Rng,
) {
    let tasks = room(random);
    let Some(put) = draw(&tasks, random) else { return };
    let noise = 1e-3 * 10f64.powf(random.f64());
    let mut read = |case: usize, tasks: &[Task], right: &[Option<Vec<f64>>]| -> Vec<Comparison> {
        let of_task = |(task, right): (&Task, &Option<Vec<f64>>)| {
            let model = Model::new(case, task, right.clone()?);
            Some(compared(&model, &(put.reads)(&model), noise, judge, random))
        };
        tasks.iter().zip(right).filter_map(of_task).flatten().collect()
    };
    let right: Vec<_> = tasks.iter().map(truth).collect();
    let (mut mine, mut of_calibration) = (read(0, &tasks, &right), read(1, calibration, known));
    if !mine.iter().any(|c| c.verdict == Verdict::Fail) {
        return;
    }
    let start = std::time::Instant::now();
    let mut cases = [Examined::new(&tasks, &mut mine), Examined::new(calibration, &mut of_calibration)];
    let found = diagnosis::explain(&mut cases);
    let took_s = start.elapsed().as_secs_f64();
    named.worst_s = named.worst_s.max(took_s);
    named.mean_s += (took_s - named.mean_s) / (named.failing + 1) as f64;
    named.failing += 1;
    count(named, &put, &found);
}

/// What was said is right where every cause is a part of the fault.
fn count(named: &mut Named, put: &Put, found: &[Vec<Cause>]) {
    let said: Vec<&Vec<Cause>> = found.iter().filter(|causes| !causes.is_empty()).collect();
    if said.is_empty() {
        named.silent += 1;
    } else if said.iter().all(|causes| causes.iter().all(|c| is_meant(c, put))) {
        named.right += 1;
    } else if said.iter().all(|causes| causes.iter().any(|c| is_meant(c, put))) {
        named.among += 1;
    } else {
        named.wrong += 1;
        let what = |(f, p): &(Fault, Vec<f64>)| format!("{} {p:?}", f.what);
        let texts: Vec<String> = said.iter().flat_map(|causes| causes.iter().map(Cause::text)).collect();
        named.errors.push(format!("{:?} was called {texts:?}", put.parts.iter().map(what).collect::<Vec<_>>()));
    }
}

fn is_meant(cause: &Cause, put: &Put) -> bool {
    let near = |(value, error): &(f64, f64), right: &f64| {
        (value - right).abs() <= WITHIN.0 * error + WITHIN.1 * right.abs().max(0.1)
    };
    let is_part = |(fault, parameters): &(Fault, Vec<f64>)| {
        let is_named = if parameters.is_empty() { cause.what == fault.what } else { cause.about == fault.about };
        is_named && cause.parameters.iter().zip(parameters).all(|(found, right)| near(found, right))
    };
    let are_both = || cause.id == "two" && put.parts.iter().all(|(fault, _)| cause.what.contains(&fault.what));
    put.parts.iter().any(is_part) || (put.parts.len() > 1 && are_both())
}

fn compared(model: &Model, read: &[f64], noise: f64, judge: &Judge<'_>, random: &mut fastrand::Rng) -> Vec<Comparison> {
    let error = |r: &f64| if model.task.transport == Transport::Direct { 1e-5 * r } else { noise * r };
    let values: Vec<(f64, f64)> = read.iter().map(|r| ((r + error(r) * normal(random)).max(0.0), error(r))).collect();
    let exact: Vec<(f64, f64)> = model.right.iter().map(|r| (*r, 0.0)).collect();
    let recording = |engine: &str, values: &[(f64, f64)]| Recording {
        model: model.task.model(),
        readings: model
            .task
            .targets
            .iter()
            .zip(values)
            .map(|(target, (value, error))| Reading {
                meter: target.id.clone(),
                quantity: model.task.quantity,
                value: *value,
                uncertainty: if *error == 0.0 { Uncertainty::Bound(0.0) } else { Uncertainty::sampled(*error, None) },
            })
            .collect(),
        ..Recording::of(ReadingKey::new("case", model.task.procedure, engine), model.task.light())
    };
    let all = [recording("iesna", &exact), recording("simulator", &exact), recording(SUBJECT, &values)];
    let mut comparisons = judge.compare(&model.task, &all.iter().collect::<Vec<_>>());
    comparisons.retain(|c| c.key.engine == SUBJECT);
    comparisons
}

/// A room with one to three luminaires, a grid of meters and some on walls, read as a spec would ask.
fn room(random: &mut fastrand::Rng) -> Vec<Task> {
    let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
    let size_m = DVec3::new(between(4.0, 9.0), between(3.0, 7.0), between(2.6, 4.0));
    let reflectance = Reflectances {
        floor: between(0.1, 0.4),
        ceiling: between(0.5, 0.85),
        wall_x_min: between(0.2, 0.7),
        wall_x_max: between(0.2, 0.7),
        wall_y_min: between(0.2, 0.7),
        wall_y_max: between(0.2, 0.7),
    };
    let count = [1, 1, 2, 3][(4.0 * between(0.0, 1.0)) as usize % 4];
    let luminaires: Vec<Luminaire> = (0..count)
        .map(|k| {
            let place = DVec3::new(between(0.25, 0.75), between(0.25, 0.75), between(0.65, 0.85));
            Luminaire {
                id: format!("lamp {}", k + 1),
                photometry: Arc::new(table(&mut between)),
                position_m: place * size_m,
                orientation: orientation(
                    between(-180.0, 180.0),
                    if between(0.0, 1.0) < 0.3 { between(5.0, 40.0) } else { 0.0 },
                    0.0,
                ),
                flux_scale: if between(0.0, 1.0) < 0.3 { between(0.5, 0.95) } else { 1.0 },
                model: LuminaireModel::Point,
            }
        })
        .collect();
    let scene = Scene { room: Some(Room { size_m, reflectance }), obstacles: vec![], luminaires };
    let grid = (0..12).map(|k| {
        let at = DVec3::new((f64::from(k % 4) + 0.5) / 4.0, (f64::from(k / 4) + 0.5) / 3.0, 0.0) * size_m;
        (MeterId::new("grid", k as usize), Meter { position_m: at + DVec3::Z * 0.8, normal: DVec3::Z })
    });
    let wall = [0.3, 0.55, 0.75].iter().enumerate().map(|(k, y)| {
        let at = DVec3::new(0.2, y * size_m.y, 1.0 + 0.4 * k as f64);
        (MeterId::new("wall", k), Meter { position_m: at, normal: DVec3::X })
    });
    let targets: Vec<Target> = grid.chain(wall).map(|(id, meter)| Target::of_one(id, meter, 1.0)).collect();
    let task = |procedure, transport| Task {
        procedure,
        scene: scene.clone(),
        transport,
        quantity: Quantity::Illuminance,
        targets: targets.clone(),
    };
    vec![
        task(ProcedureId::DirectIlluminance, Transport::Direct),
        task(ProcedureId::IndirectIlluminance, Transport::Indirect(Bounces::Converged)),
    ]
}

/// A smooth table without symmetry, of a luminaire that shines down, up or both ways.
fn table(between: &mut impl FnMut(f64, f64) -> f64) -> Photometry {
    let (down, up, swing, twist, lumens) =
        (between(0.2, 1.0), between(0.0, 0.6), between(0.0, 0.6), between(0.0, 0.4), between(800.0, 4000.0));
    let candela = |c: f64, g: f64| {
        let (c, g) = (c.to_radians(), g.to_radians());
        let lobe = if g.cos() > 0.0 { down * g.cos() } else { -up * g.cos() } + 0.1;
        300.0 * lobe * (1.0 + g.sin() * (swing * c.cos() + twist * (2.0 * c).sin()))
    };
    let c_deg: Vec<f64> = (0..=6).map(|k| 60.0 * f64::from(k)).collect();
    let gamma_deg: Vec<f64> = (0..=6).map(|k| 30.0 * f64::from(k)).collect();
    let all = c_deg.iter().flat_map(|c| gamma_deg.iter().map(|g| candela(*c % 360.0, *g))).collect();
    let table = LuminousIntensityDistribution::new(c_deg, gamma_deg, all);
    let table = table.unwrap_or_else(|e| unreachable!("angles written down here are sound: {e}"));
    Photometry { lamp_lumens: Some(lumens), ..Photometry::of(table) }
}

impl fmt::Display for Naming {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| fault | failing | right | right or another | wrong | silent | seconds: mean, most |")?;
        writeln!(f, "|---|---:|---:|---:|---:|---:|---:|")?;
        for n in &self.kinds {
            let Named { kind, failing, right, among, wrong, silent, mean_s, worst_s, .. } = n;
            writeln!(f, "| {kind} | {failing} | {right} | {among} | {wrong} | {silent} | {mean_s:.1}, {worst_s:.1} |")?;
        }
        Ok(())
    }
}
