//! How often a diagnosis is right: random faults of each kind in random rooms. They are judged and
//! explained like the readings of a real engine, together with the scenes of the calibration.

use std::fmt;
use std::sync::Arc;

use glam::DVec3;
use itertools::Itertools;
use luxproof_photometry::{LuminousIntensityDistribution, Photometry};
use luxproof_scene::geometry::{Reflectances, Room};
use luxproof_scene::{Bounces, Luminaire, LuminaireModel, Meter, Scene, Transport, orientation};
use serde::Serialize;

use super::SelftestError;
use super::adapters::{self, AdapterFault, GROUPS};
use luxproof_model::{
    Comparison, Estimate, MeterId, ProcedureId, Quantity, Reading, ReadingKey, Recording, Uncertainty, Verdict,
};
use luxproof_process::random::normal;
use luxproof_spec::Case;
use luxproof_spec::procedures::{Target, Task, known};
use luxproof_verdict::diagnosis::{self, Cause, Examined, Fault, Model, truth};
use luxproof_verdict::{Judge, Policy};

/// The name of the engine under test; no deviation of it is on record.
const SUBJECT: &str = "subject";
/// The largest number of rooms and faults that are drawn for one that fails.
const MAX_DRAWS: usize = 30;
/// A fitted parameter counts as the true one within this number of standard errors plus this part
/// of it.
const MAX_STD_ERRORS: f64 = 5.0;
const MAX_RELATIVE_ERROR: f64 = 0.03;
/// The relative scatter of readings and of candelas in the controls.
const CONTROL_SCATTER_REL: f64 = 0.1;

/// How well the diagnosis names the faults of each kind.
#[derive(Clone, Debug, Serialize)]
pub struct Naming {
    pub kinds: Vec<NamingScore>,
}

/// How well the diagnosis names the faults of one kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NamingScore {
    pub kind: String,
    /// Whether the diagnosis knows such faults; for others silence is right.
    pub is_known: bool,
    pub failing: usize,
    /// The number of runs in which the fault is named, and no other.
    pub right: usize,
    /// The number of runs in which it is one of two or three that explain the readings equally
    /// well.
    pub among: usize,
    /// The number of runs in which only other faults are named.
    pub wrong: usize,
    pub silent: usize,
    /// The mean and the largest duration of a diagnosis in seconds.
    pub mean_s: f64,
    pub worst_s: f64,
    /// The wrong names, each with the fault.
    pub errors: Vec<String>,
}

/// Computes the readings of an engine with a fault.
type FaultyReader = Box<dyn Fn(&Model) -> Vec<f64>>;

/// A part of an injected fault with its parameters.
type FaultPart = (Fault, Vec<f64>);

/// A fault that is injected into readings.
struct InjectedFault {
    /// The parts of the fault; any of them may be named where only it shows. A fault that no
    /// diagnosis knows has none.
    parts: Vec<FaultPart>,
    /// Words of which a right name has at least one, for a fault that is written without the diagnosis.
    words: &'static [&'static str],
    reader: FaultyReader,
}

/// Draws a fault for the tasks of a case.
type FaultSampler = fn(&[Task], &mut fastrand::Rng) -> Option<InjectedFault>;

/// The kinds of faults: name, whether the diagnosis knows them, sampler.
const KINDS: [(&str, bool, FaultSampler); 17] = [
    ("listed", true, |tasks, random| choose_fault(diagnosis::faults(&[tasks]), diagnosis::Fault::is_plain, random)),
    ("bounces", true, |tasks, random| choose_fault(diagnosis::faults(&[tasks]), |f| f.id == "bounces-cut", random)),
    ("order of meters", true, |tasks, random| {
        let orders = ["reversed", "next", "previous", "exchanged"];
        choose_fault(diagnosis::faults(&[tasks]), |f| orders.contains(&f.id), random)
    }),
    ("reflectance of a surface", true, |tasks, random| draw_fault_of_kind(tasks, "reflectance", random)),
    ("all reflectances", true, |tasks, random| draw_fault_of_kind(tasks, "reflectances", random)),
    ("place of a luminaire", true, |tasks, random| draw_fault_of_kind(tasks, "place", random)),
    ("turn about the vertical", true, |tasks, random| draw_fault_of_kind(tasks, "turn", random)),
    ("tilt", true, |tasks, random| draw_fault_of_kind(tasks, "tilt", random)),
    ("flux of one luminaire", true, |tasks, random| draw_fault_of_kind(tasks, "flux", random)),
    ("shift of all meters", true, |tasks, random| draw_fault_of_kind(tasks, "shifted", random)),
    ("two listed", true, draw_two_faults),
    ("control: lux to the power of 1.05", false, |_, _| Some(control(|m| scaled_power(&m.right, 1.05)))),
    ("squared lux", true, |_, _| {
        let reader = adapters::by_readout(Box::new(|lux| lux * lux));
        Some(InjectedFault { parts: vec![], words: &["raised to the power"], reader })
    }),
    ("control: three surfaces at once", false, |_, random| {
        let reflectances = [0; 3].map(|_| random.f64());
        Some(control(move |m| {
            relight(m, |scene| {
                // Only the room under test: three surfaces of the calibration scenes would be
                // another fault.
                let Some(room) = scene.room.as_mut().filter(|_| m.case == 0) else { return };
                let r = &mut room.reflectance;
                [r.floor, r.wall_x_min, r.ceiling] = reflectances;
            })
        }))
    }),
    ("control: wrong table", false, |_, random| {
        let seed = random.u64(..);
        Some(control(move |m| relight(m, |scene| scene.luminaires.iter_mut().for_each(|l| scatter_table(l, seed)))))
    }),
    ("reflected light alone brighter", true, |_, random| {
        let factor = 1.03 + 0.3 * random.f64();
        let brighter = control(move |m| {
            let is_reflected = matches!(m.task.transport, Transport::Indirect(_));
            m.right.iter().map(|r| if is_reflected { factor * r } else { *r }).collect()
        });
        Some(InjectedFault { words: &["in reflected light alone"], ..brighter })
    }),
    ("control: scatter not stated", false, |_, random| {
        let seed = random.u64(..);
        Some(control(move |m| {
            let mut random = fastrand::Rng::with_seed(seed);
            m.right.iter().map(|r| (r * (1.0 + CONTROL_SCATTER_REL * normal(&mut random))).max(0.0)).collect()
        }))
    }),
];

/// Chooses one of several faults at random; darkness is left out, because it hides all others.
fn choose_fault(
    faults: Vec<Fault>,
    is_candidate: impl Fn(&Fault) -> bool,
    random: &mut fastrand::Rng,
) -> Option<InjectedFault> {
    let candidates: Vec<Fault> = faults.into_iter().filter(|f| is_candidate(f) && f.id != "dark").collect();
    Some(inject_fault(random.choice(candidates)?, vec![]))
}

/// Injects a known fault with its parameters; readings in which it has no effect stay right.
fn inject_fault(fault: Fault, parameters: Vec<f64>) -> InjectedFault {
    let part = (fault.clone(), parameters.clone());
    let reader = Box::new(move |m: &Model| fault.readings(m, &parameters).unwrap_or_else(|| m.right.clone()));
    InjectedFault { parts: vec![part], words: &[], reader }
}

/// Injects a fault that no diagnosis knows.
fn control(reader: impl Fn(&Model) -> Vec<f64> + 'static) -> InjectedFault {
    InjectedFault { parts: vec![], words: &[], reader: Box::new(reader) }
}

/// Draws a parameter of a fault, in the range of what installers and exporters get wrong.
fn draw_parameter(parameter: &diagnosis::Parameter, random: &mut fastrand::Rng) -> f64 {
    match parameter.unit {
        " m" => parameter.starts[0] + 0.3 * (2.0 * random.f64() - 1.0),
        " degrees" if parameter.starts.len() > 1 => 360.0 * random.f64() - 180.0,
        " degrees" => 30.0 * (2.0 * random.f64() - 1.0),
        _ => {
            let (low, high) = parameter.range;
            (parameter.starts[0] * (0.4 + 1.2 * random.f64())).clamp(low, high)
        }
    }
}
/// Draws a fault of a kind that has parameters.
fn draw_fault_of_kind(tasks: &[Task], id: &str, random: &mut fastrand::Rng) -> Option<InjectedFault> {
    let fault = random.choice(diagnosis::kinds(&[tasks]).into_iter().filter(|f| f.id == id).collect::<Vec<_>>())?;
    let parameters = fault.parameters.iter().map(|p| draw_parameter(p, random)).collect();
    Some(inject_fault(fault, parameters))
}

/// Draws two faults at once; `None` where both change the same thing.
fn draw_two_faults(tasks: &[Task], random: &mut fastrand::Rng) -> Option<InjectedFault> {
    let mut listed: Vec<Fault> = diagnosis::faults(&[tasks]).into_iter().filter(Fault::is_plain).collect();
    let one = listed.swap_remove(random.usize(..listed.len()));
    let other = listed.swap_remove(random.usize(..listed.len()));
    if one.about == other.about || one.id == other.id {
        return None;
    }
    let both = inject_fault(one.and(&other), vec![]);
    Some(InjectedFault { parts: vec![(one, vec![]), (other, vec![])], ..both })
}

/// Raises readings to a power and scales them to the same mean.
fn scaled_power(right: &[f64], power: f64) -> Vec<f64> {
    let mean = right.iter().sum::<f64>() / right.len() as f64;
    right.iter().map(|r| if *r > 0.0 { mean * (r / mean).powf(power) } else { 0.0 }).collect()
}

/// The readings of a changed scene.
fn relight(model: &Model, change: impl Fn(&mut Scene)) -> Vec<f64> {
    let mut task = model.task.clone();
    change(&mut task.scene);
    truth(&task).unwrap_or_else(|| model.right.clone())
}

/// Scatters every candela of a table by a tenth.
fn scatter_table(luminaire: &mut Luminaire, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    let table = &luminaire.photometry.distribution;
    let (c_deg, gamma_deg) = (table.c_deg().to_vec(), table.gamma_deg().to_vec());
    let mut candela = Vec::with_capacity(c_deg.len() * gamma_deg.len());
    for (c, g) in c_deg.iter().cartesian_product(&gamma_deg) {
        let right = table.intensity(*c, *g).value();
        candela.push((right * (1.0 + CONTROL_SCATTER_REL * normal(&mut random))).max(0.0));
    }
    if let Ok(table) = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela) {
        luminaire.photometry = Arc::new(Photometry::of(table));
    }
}

/// Injects a number of faults of each kind that fail, and counts how many are named.
pub fn naming(runs: usize, seed: u64) -> Result<Naming, SelftestError> {
    let policy = Policy::built_in().map_err(|e| SelftestError(e.to_string()))?;
    let case = Case::default();
    let judge = policy.judge(&case, None);
    let calibration: Vec<Task> = known::tasks();
    let right: Vec<Option<Vec<f64>>> = calibration.iter().map(truth).collect();
    let mut kinds = vec![];
    for (k, (kind, is_known, sampler)) in KINDS.iter().enumerate() {
        let mut score = NamingScore { kind: (*kind).to_owned(), is_known: *is_known, ..NamingScore::default() };
        let mut random = fastrand::Rng::with_seed(seed.wrapping_mul(1000).wrapping_add(k as u64));
        for _ in 0..runs * MAX_DRAWS {
            if score.failing < runs {
                run_fault(&mut score, *sampler, (&calibration, &right), &judge, &mut random);
            }
        }
        kinds.push(score);
    }
    kinds.extend(adapter_scores(runs, seed, (&calibration, &right), &judge));
    Ok(Naming { kinds })
}

/// Scores the faults of adapters, group by group, in rooms of one, two and four luminaires.
fn adapter_scores(
    runs: usize,
    seed: u64,
    calibration: (&[Task], &[Option<Vec<f64>>]),
    judge: &Judge<'_>,
) -> Vec<NamingScore> {
    let mut scores = vec![];
    for (k, (group, sampler)) in GROUPS.into_iter().enumerate() {
        for luminaires in [1, 2, 4] {
            let kind = format!("adapter: {group}, luminaires: {luminaires}");
            let mut score = NamingScore { kind, is_known: true, ..NamingScore::default() };
            let mut random =
                fastrand::Rng::with_seed(seed.wrapping_mul(1000).wrapping_add(100 + 10 * k as u64 + luminaires));
            for _ in 0..runs * MAX_DRAWS {
                if score.failing < runs {
                    let tasks = draw_room_with(&mut random, luminaires as usize);
                    let AdapterFault { words, reader } = sampler(&mut random);
                    let fault = InjectedFault { parts: vec![], words, reader };
                    diagnose_fault(&mut score, &tasks, &fault, calibration, judge, &mut random);
                }
            }
            scores.push(score);
        }
    }
    scores
}

/// Judges the readings of all tasks of a case with a fault.
fn judge_case(
    case: usize,
    (tasks, right): (&[Task], &[Option<Vec<f64>>]),
    (fault, noise): (&InjectedFault, f64),
    judge: &Judge<'_>,
    random: &mut fastrand::Rng,
) -> Vec<Comparison> {
    let mut comparisons = vec![];
    for (task, right) in tasks.iter().zip(right) {
        let Some(right) = right else { continue };
        let model = Model::new(case, task, right.clone());
        comparisons.extend(judge_readings(&model, &(fault.reader)(&model), noise, judge, random));
    }
    comparisons
}

/// Draws a room and a fault, and scores the diagnosis where the fault fails in the room.
fn run_fault(
    score: &mut NamingScore,
    sampler: FaultSampler,
    (calibration, calibration_right): (&[Task], &[Option<Vec<f64>>]),
    judge: &Judge<'_>,
    random: &mut fastrand::Rng,
) {
    let tasks = draw_room(random);
    let Some(fault) = sampler(&tasks, random) else { return };
    diagnose_fault(score, &tasks, &fault, (calibration, calibration_right), judge, random);
}

/// Scores the diagnosis of a fault in a room where it fails there.
fn diagnose_fault(
    score: &mut NamingScore,
    tasks: &[Task],
    fault: &InjectedFault,
    (calibration, calibration_right): (&[Task], &[Option<Vec<f64>>]),
    judge: &Judge<'_>,
    random: &mut fastrand::Rng,
) {
    let noise = 1e-3 * 10f64.powf(random.f64());
    let right: Vec<_> = tasks.iter().map(truth).collect();
    let mut in_room = judge_case(0, (tasks, &right), (fault, noise), judge, random);
    let mut in_calibration = judge_case(1, (calibration, calibration_right), (fault, noise), judge, random);
    if !in_room.iter().any(|c| c.verdict == Verdict::Fail) {
        return;
    }
    let start = std::time::Instant::now();
    let mut cases = [Examined::new(tasks, &mut in_room), Examined::new(calibration, &mut in_calibration)];
    let found = diagnosis::explain(&mut cases);
    let took_s = start.elapsed().as_secs_f64();
    score.worst_s = score.worst_s.max(took_s);
    score.mean_s += (took_s - score.mean_s) / (score.failing + 1) as f64;
    score.failing += 1;
    count_diagnosis(score, fault, &found);
}

/// Counts a diagnosis: it is right where every cause is a part of the fault.
fn count_diagnosis(score: &mut NamingScore, fault: &InjectedFault, found: &[Vec<Cause>]) {
    let named: Vec<&Vec<Cause>> = found.iter().filter(|causes| !causes.is_empty()).collect();
    if named.is_empty() {
        score.silent += 1;
    } else if named.iter().all(|causes| causes.iter().all(|c| is_cause(c, fault))) {
        score.right += 1;
    } else if named.iter().all(|causes| causes.iter().any(|c| is_cause(c, fault))) {
        score.among += 1;
    } else {
        score.wrong += 1;
        let words = fault.words.iter().map(|word| (*word).to_owned());
        let parts: Vec<String> = fault.parts.iter().map(|(f, p)| format!("{} {p:?}", f.what)).chain(words).collect();
        let texts: Vec<String> = named.iter().flat_map(|causes| causes.iter().map(Cause::text)).collect();
        score.errors.push(format!("{parts:?} was called {texts:?}"));
    }
}

/// Whether a cause is the injected fault or a part of it.
fn is_cause(cause: &Cause, fault: &InjectedFault) -> bool {
    if fault.words.iter().any(|word| cause.what.contains(word)) {
        return true;
    }
    let names_all = cause.id == "two" && fault.parts.iter().all(|(part, _)| cause.what.contains(&part.what));
    fault.parts.iter().any(|part| is_part(cause, part)) || (fault.parts.len() > 1 && names_all)
}

/// Whether a cause is a part of a fault, with parameters near the true ones.
fn is_part(cause: &Cause, (fault, parameters): &FaultPart) -> bool {
    let is_named = if parameters.is_empty() { cause.what == fault.what } else { cause.about == fault.about };
    is_named && cause.parameters.iter().zip(parameters).all(|(found, right)| is_near(*found, *right))
}

/// Whether a fitted value with its standard error is near the true one.
fn is_near((value, error): (f64, f64), right: f64) -> bool {
    (value - right).abs() <= MAX_STD_ERRORS * error + MAX_RELATIVE_ERROR * right.abs().max(0.1)
}

/// The recording of an engine that reads values with standard errors in a task.
fn make_recording(task: &Task, engine: &str, values: &[(f64, f64)]) -> Recording {
    let readings = task.targets.iter().zip(values).map(|(target, (value, error))| {
        let uncertainty = if *error == 0.0 { Uncertainty::Bound(0.0) } else { Uncertainty::sampled(*error, None) };
        Reading::new(target.id.clone(), task.quantity, Estimate { value: *value, uncertainty })
    });
    Recording {
        model: task.model(),
        readings: readings.collect(),
        ..Recording::of(ReadingKey::new("case", task.procedure, engine), task.light())
    }
}

/// Adds noise to readings and judges them against two exact engines.
fn judge_readings(
    model: &Model,
    read: &[f64],
    noise: f64,
    judge: &Judge<'_>,
    random: &mut fastrand::Rng,
) -> Vec<Comparison> {
    let noise = if model.task.transport == Transport::Direct { 1e-5 } else { noise };
    let mut values: Vec<(f64, f64)> = vec![];
    for r in read {
        let error = noise * r;
        values.push(((r + error * normal(random)).max(0.0), error));
    }
    let exact: Vec<(f64, f64)> = model.right.iter().map(|r| (*r, 0.0)).collect();
    let all = [("iesna", &exact), ("simulator", &exact), (SUBJECT, &values)]
        .map(|(engine, values)| make_recording(&model.task, engine, values));
    let mut comparisons = judge.compare(&model.task, &all.iter().collect::<Vec<_>>());
    comparisons.retain(|c| c.key.engine == SUBJECT);
    comparisons
}

/// A number between two bounds.
fn between(random: &mut fastrand::Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.f64()
}

/// Draws a luminaire in the upper part of a room, sometimes tilted or dimmed.
fn draw_luminaire(random: &mut fastrand::Rng, index: usize, size_m: DVec3) -> Luminaire {
    let [x, y] = [(); 2].map(|()| between(random, 0.25, 0.75));
    let part = DVec3::new(x, y, between(random, 0.65, 0.85));
    let photometry = Arc::new(draw_photometry(random));
    let azimuth = between(random, -180.0, 180.0);
    let tilt = if between(random, 0.0, 1.0) < 0.3 { between(random, 5.0, 40.0) } else { 0.0 };
    Luminaire {
        id: format!("lamp {}", index + 1),
        photometry,
        position_m: part * size_m,
        orientation: orientation(azimuth, tilt, 0.0),
        flux_scale: if between(random, 0.0, 1.0) < 0.3 { between(random, 0.5, 0.95) } else { 1.0 },
        model: LuminaireModel::Point,
    }
}

/// The meters of a room: a grid at 0.8 m and three on a wall.
fn place_meters(size_m: DVec3) -> Vec<Target> {
    let mut targets = vec![];
    for k in 0..12 {
        let at = DVec3::new((f64::from(k % 4) + 0.5) / 4.0, (f64::from(k / 4) + 0.5) / 3.0, 0.0) * size_m;
        let meter = Meter { position_m: at + DVec3::Z * 0.8, normal: DVec3::Z };
        targets.push(Target::of_one(MeterId::new("grid", k as usize), meter, 1.0));
    }
    for (k, y) in [0.3, 0.55, 0.75].into_iter().enumerate() {
        let at = DVec3::new(0.2, y * size_m.y, 1.0 + 0.4 * k as f64);
        let meter = Meter { position_m: at, normal: DVec3::X };
        targets.push(Target::of_one(MeterId::new("wall", k), meter, 1.0));
    }
    targets
}

/// Draws a room with one to three luminaires, and asks for direct and indirect illuminance.
fn draw_room(random: &mut fastrand::Rng) -> Vec<Task> {
    let count = [1, 1, 2, 3][(4.0 * between(random, 0.0, 1.0)) as usize % 4];
    draw_room_with(random, count)
}

/// Draws a room with so many luminaires.
fn draw_room_with(random: &mut fastrand::Rng, count: usize) -> Vec<Task> {
    let [x, y] = [(4.0, 9.0), (3.0, 7.0)].map(|(low, high)| between(random, low, high));
    let size_m = DVec3::new(x, y, between(random, 2.6, 4.0));
    let floor = between(random, 0.1, 0.4);
    let ceiling = between(random, 0.5, 0.85);
    let [wall_x_min, wall_x_max, wall_y_min, wall_y_max] = [(); 4].map(|()| between(random, 0.2, 0.7));
    let reflectance = Reflectances { floor, ceiling, wall_x_min, wall_x_max, wall_y_min, wall_y_max };
    let luminaires: Vec<Luminaire> = (0..count).map(|k| draw_luminaire(random, k, size_m)).collect();
    let scene = Scene { room: Some(Room { size_m, reflectance }), obstacles: vec![], luminaires };
    let targets = place_meters(size_m);
    let direct = Task {
        procedure: ProcedureId::DirectIlluminance,
        scene,
        transport: Transport::Direct,
        quantity: Quantity::Illuminance,
        targets,
    };
    let indirect = Task {
        procedure: ProcedureId::IndirectIlluminance,
        transport: Transport::Indirect(Bounces::Converged),
        ..direct.clone()
    };
    vec![direct, indirect]
}

/// Draws a smooth table without symmetry, of a luminaire that emits down, up or both ways.
fn draw_photometry(random: &mut fastrand::Rng) -> Photometry {
    let down = between(random, 0.2, 1.0);
    let up = between(random, 0.0, 0.6);
    let swing = between(random, 0.0, 0.6);
    let twist = between(random, 0.0, 0.4);
    let lumens = between(random, 800.0, 4000.0);
    let c_deg: Vec<f64> = (0..=6).map(|k| 60.0 * f64::from(k)).collect();
    let gamma_deg: Vec<f64> = (0..=6).map(|k| 30.0 * f64::from(k)).collect();
    let mut candela = vec![];
    for (c, g) in c_deg.iter().cartesian_product(&gamma_deg) {
        // The planes 0 and 360 are one.
        let (c, g) = ((*c % 360.0).to_radians(), g.to_radians());
        let lobe = if g.cos() > 0.0 { down * g.cos() } else { -up * g.cos() } + 0.1;
        candela.push(300.0 * lobe * (1.0 + g.sin() * (swing * c.cos() + twist * (2.0 * c).sin())));
    }
    let table = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela)
        .unwrap_or_else(|e| unreachable!("angles written down here are sound: {e}"));
    Photometry { lamp_lumens: Some(lumens), ..Photometry::of(table) }
}

impl fmt::Display for Naming {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| fault | failing | right | right or another | wrong | silent | seconds: mean, most |")?;
        writeln!(f, "|---|---:|---:|---:|---:|---:|---:|")?;
        for n in &self.kinds {
            let NamingScore { kind, failing, right, among, wrong, silent, mean_s, worst_s, .. } = n;
            writeln!(f, "| {kind} | {failing} | {right} | {among} | {wrong} | {silent} | {mean_s:.1}, {worst_s:.1} |")?;
        }
        Ok(())
    }
}
