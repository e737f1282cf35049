//! A finding as a folder to hand over: spec, photometry, native scene with its command, two witnesses, and an issue ready for the tracker.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use luminaire::calculators::inverse_square;
use luminaire::photometry::angles_deg;
use luminaire::scene::{LuminaireModel, Meter, Scene, Transport};
use luminaire::simulator::{Accuracy, Stop, Uncertainty as Solved, certified_until};
use serde::{Deserialize, Serialize};

use super::HuntError;
use super::draft::Draft;
use super::feature::Feature;
use super::oracle::{Oracle, Sighting, Symptom, Tribunal};
use crate::engines::display_name;
use crate::judge::Comparison;
use crate::plan::{Export, Selection, plan};
use crate::procedures::{Made, Task};
use crate::record::ProcedureId;
use crate::spec::{Case, SpecError, from_yaml, yaml};
use crate::system::files::FileError;
use crate::system::printable::{code_block, markdown};
use crate::system::process::interrupt_flag;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// The name of its folder.
    pub id: String,
    #[serde(flatten)]
    pub symptom: Symptom,
    pub engine_version: String,
    /// What the minimal spec still holds.
    pub features: BTreeSet<Feature>,
    /// Relative deviation where it is worst.
    pub deviation: Option<f64>,
    /// What explains it: a known fault, or nothing.
    pub diagnosis: Option<String>,
    /// Its cause, where it is on record.
    pub known: Option<String>,
    /// The spec of the hunt in which it was found.
    pub found_in: String,
    /// In how many specs it was seen.
    pub seen: usize,
    /// In which procedures besides.
    pub also: BTreeSet<ProcedureId>,
    /// Lines of the minimal spec.
    pub lines: usize,
    /// C planes and gamma angles of its largest table.
    pub table: [usize; 2],
    /// Specs that were tried to make it so small.
    pub looks: usize,
    /// Whether nothing more can go.
    pub is_minimal: bool,
}

impl Finding {
    /// What tells its cause from others.
    fn cause(&self) -> impl Iterator<Item = &Feature> {
        self.features.iter().filter(|f| !f.is_plain())
    }

    /// Whether a spec with these features would show the symptom for the same cause.
    pub(super) fn accounts_for(&self, symptom: &Symptom, features: &BTreeSet<Feature>) -> bool {
        self.symptom.engine == symptom.engine
            && self.symptom.oracle == symptom.oracle
            && self.cause().all(|f| features.contains(f))
    }

    /// Whether a minimal spec shows the same.
    pub(super) fn is_same(&self, symptom: &Symptom, features: &BTreeSet<Feature>) -> bool {
        self.accounts_for(symptom, features)
            && features.iter().filter(|f| !f.is_plain()).all(|f| self.features.contains(f))
    }
}

/// A finding that has been confirmed, by what it is recognised.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownFinding {
    pub engine: String,
    pub oracle: Oracle,
    /// What its minimal specs hold: all of these.
    pub features: BTreeSet<Feature>,
    pub cause: String,
    pub source: String,
}

const ON_RECORD: &str = include_str!("../../../data/findings.yaml");

impl KnownFinding {
    pub(super) fn on_record() -> Result<Vec<Self>, SpecError> {
        let file = "reference/findings/known.yaml";
        from_yaml(ON_RECORD).map_err(|what| SpecError::of(file, what, "correct the file and build again"))
    }

    pub(super) fn accounts_for(&self, finding: &Finding) -> bool {
        finding.symptom.engine == self.engine
            && finding.symptom.oracle == self.oracle
            && self.features.is_subset(&finding.features)
    }
}

/// What is told of how it was found.
pub(super) struct Told {
    pub(super) looks: usize,
    pub(super) is_minimal: bool,
    pub(super) diagnosis: Option<String>,
    pub(super) found_in: String,
}

/// The files of a native scene and the command that runs it.
type NativeScene = (Vec<PathBuf>, Option<String>);

/// A second opinion at the worst meter.
struct SecondWitness {
    who: &'static str,
    value_lx: f64,
    uncertainty: String,
}

/// Writes a finding's folder.
pub(super) fn write(
    tribunal: &Tribunal<'_>,
    draft: &Draft,
    sighting: &Sighting,
    told: &Told,
    folder: &Path,
    seed: u64,
) -> Result<Finding, HuntError> {
    let path = draft.write(folder, "spec").map_err(|e| FileError::of(folder, e))?;
    let case = Case::load(&path)?;
    let symptom = &sighting.symptom;
    let version = tribunal.instrument(&symptom.engine, &case).map(|i| i.version.text).unwrap_or_default();
    let finding = Finding {
        id: folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
        symptom: symptom.clone(),
        engine_version: version,
        features: BTreeSet::new(),
        deviation: sighting.size,
        diagnosis: told.diagnosis.clone(),
        known: None,
        found_in: told.found_in.clone(),
        seen: 1,
        also: BTreeSet::new(),
        lines: draft.lines(),
        table: draft.table(),
        looks: told.looks,
        is_minimal: told.is_minimal,
    };
    let scene = export(tribunal, &case, symptom, &folder.join("scene"), seed)?;
    let task = case.task(symptom.procedure);
    let witness = task.as_ref().and_then(|task| second_witness(task, sighting, seed));
    let issue = Issue { finding: &finding, draft, sighting, task: task.as_ref(), witness, scene }.text();
    let path = folder.join("issue.md");
    std::fs::write(&path, issue).map_err(|e| FileError::of(&path, e))?;
    Ok(finding)
}

/// The native scene in a folder, and the command that runs it by hand.
fn export(
    tribunal: &Tribunal<'_>,
    case: &Case,
    symptom: &Symptom,
    folder: &Path,
    seed: u64,
) -> Result<Option<NativeScene>, HuntError> {
    let selection = Selection { engines: vec![symptom.engine.to_string()], procedures: vec![symptom.procedure], seed };
    let Ok(plan) = plan(case, &selection, tribunal.site) else { return Ok(None) };
    let Some(e) = plan.engines.iter().position(|p| p.engine.name() == symptom.engine) else { return Ok(None) };
    let Some(Export { files, command }) =
        plan.tasks.first().and_then(|task| plan.export(case, e, task, seed, tribunal.site).ok())
    else {
        return Ok(None);
    };
    if files.is_empty() {
        return Ok(None);
    }
    for file in &files {
        let path = folder.join(&file.name);
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        made.and_then(|()| std::fs::write(&path, &file.bytes)).map_err(|e| FileError::of(&path, e))?;
    }
    if let Some(command) = &command {
        let path = folder.join("by-hand.sh");
        let script = format!(
            "#!/bin/sh\n# What luxproof runs, by hand, in this folder.\ncd \"$(dirname \"$0\")\" && {command}\n"
        );
        std::fs::write(&path, script).map_err(|e| FileError::of(&path, e))?;
    }
    Ok(Some((files.iter().map(|f| PathBuf::from(&f.name)).collect(), command)))
}

/// The inverse-square law where it holds, path tracing elsewhere: neither shares a kernel with the simulator's other solvers.
fn second_witness(task: &Task, sighting: &Sighting, seed: u64) -> Option<SecondWitness> {
    let worst = sighting.comparison.as_ref()?;
    let target = task.targets.iter().find(|t| t.id == worst.meter && t.made == Made::Sum)?;
    if is_inverse_square(&task.scene, task.transport) {
        let parts = target.aspects.iter().map(|a| {
            Some(a.weight * inverse_square::direct_illuminance(&task.scene, &a.meter).ok()?.illuminance.value())
        });
        let value_lx = parts.collect::<Option<Vec<f64>>>()?.into_iter().sum();
        return Some(SecondWitness { who: "inverse-square law by hand", value_lx, uncertainty: "rounding".into() });
    }
    let meters: Vec<Meter> = target.aspects.iter().map(|a| a.meter).collect();
    let accuracy = Accuracy { relative_error: 2e-3, seed };
    let deadline = std::time::Instant::now() + std::time::Duration::from_secs(20);
    let stop = Stop { flag: Some(interrupt_flag()), deadline: Some(deadline), ..Stop::NEVER };
    let solution = certified_until(&task.scene, &meters, task.transport, &accuracy, &stop).ok()?;
    let pairs = || target.aspects.iter().zip(&solution.estimates);
    let error: f64 = pairs()
        .map(|(a, e)| match e.uncertainty {
            Solved::Bound(bound) => a.weight * bound,
            Solved::StandardError { value, .. } => a.weight * value,
        })
        .sum();
    let value_lx = pairs().map(|(a, e)| a.weight * e.illuminance.value()).sum();
    Some(SecondWitness { who: "path tracing", value_lx, uncertainty: format!("standard error {error:.3e}") })
}

fn is_inverse_square(scene: &Scene, transport: Transport) -> bool {
    transport == Transport::Direct
        && scene.obstacles.is_empty()
        && scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
}

/// All that an issue is written of.
struct Issue<'a> {
    finding: &'a Finding,
    draft: &'a Draft,
    sighting: &'a Sighting,
    task: Option<&'a Task>,
    witness: Option<SecondWitness>,
    scene: Option<NativeScene>,
}

impl Issue<'_> {
    fn text(&self) -> String {
        let Finding { symptom, engine_version, diagnosis, deviation, .. } = self.finding;
        let (engine, quantity) = (display_name(&symptom.engine), symptom.procedure.row().title.to_lowercase());
        let off = deviation.map(|d| format!(" by {:+.3} %", 100.0 * d)).unwrap_or_default();
        let mut text =
            format!("# {engine}: {quantity}: {}{off}\n\nVersion: {}\n\n", symptom.oracle, markdown(engine_version));
        text += "## What\n\n";
        text += &self.scene_in_words();
        text += "\n## Expected and actual\n\n";
        text += &self.readings();
        text += "\n## Cause\n\n";
        text += &match diagnosis {
            Some(diagnosis) => {
                format!(
                    "The readings of the larger scene in which it was found are those of this fault: {}\n",
                    markdown(diagnosis)
                )
            }
            None => "Unexplained: no known fault reads so.\n".to_owned(),
        };
        text += "\n## How to reproduce\n\n";
        text += &self.by_hand();
        text += &format!(
            "\nWith luxproof: `luxproof run spec.yaml --engines {}`, where `spec.yaml` is\n\n{}",
            symptom.engine,
            code_block("yaml", &yaml(&self.draft.spec))
        );
        for (name, file) in &self.draft.files {
            if file.bytes.len() < 4000 {
                let content = code_block("", &String::from_utf8_lossy(&file.bytes));
                text += &format!("\n{}:\n\n{content}", markdown(&name.display().to_string()));
            }
        }
        text
    }

    fn scene_in_words(&self) -> String {
        let spec = &self.draft.spec;
        let room =
            spec.room.size_m.map_or_else(|| "A room".to_owned(), |[x, y, z]| format!("A room of {x} x {y} x {z} m"));
        let (lamps, bodies) = (spec.luminaires.len(), spec.obstacles.len());
        let mut text = format!("{room} with {lamps} luminaire(s) and {bodies} further bodies.");
        if let Some(said) = &self.sighting.text {
            write!(text, " {}.", markdown(said)).ok();
        }
        text + "\n"
    }

    fn readings(&self) -> String {
        let Some(worst) = &self.sighting.comparison else {
            return format!("A reading is expected; {}.\n", self.sighting.symptom.oracle);
        };
        let Comparison { at_m, normal, value, uncertainty, reference, budget, .. } = worst;
        let unit = worst.quantity.unit();
        let mut text = format!("At {at_m:?} m, facing {normal:?}");
        if let Some((gamma, c)) = worst.gamma_deg.zip(worst.c_deg) {
            write!(text, " (C {c}, gamma {gamma})").ok();
        }
        text += ":\n\n| who | value | uncertainty |\n|---|---|---|\n";
        let mut row = |who: &str, value: f64, uncertainty: &str| {
            text += &format!("| {} | {value:.9} {unit} | {uncertainty} |\n", markdown(who));
        };
        if let Some(value) = value {
            row(&display_name(&self.finding.symptom.engine), *value, &format!("{uncertainty:?}"));
        }
        if let Some(reference) = reference {
            row(&reference.source, reference.value, &format!("standard {:.3e}", reference.uncertainty));
        }
        if let Some(witness) = &self.witness {
            row(witness.who, witness.value_lx, &witness.uncertainty);
        }
        if let Some((deviation, budget)) = worst.deviation.zip(budget.as_ref()) {
            let allowed = worst.allowed();
            write!(
                text,
                "\nOff by {deviation:.6e} {unit}, of which {allowed:.3e} is allowed and {:.3e} may be uncertainty.\n",
                budget.expanded
            )
            .ok();
        }
        text += &self.arithmetic(worst);
        text
    }

    /// The inverse-square law in figures, for few luminaires: anybody can repeat it.
    fn arithmetic(&self, worst: &Comparison) -> String {
        let Some(task) = self.task.filter(|t| is_inverse_square(&t.scene, t.transport)) else { return String::new() };
        let Some(target) = task.targets.iter().find(|t| t.id == worst.meter) else { return String::new() };
        let [aspect] = &target.aspects[..] else { return String::new() };
        if task.scene.luminaires.len() > 3 {
            return String::new();
        }
        let mut text = "\nBy hand, E = I cos / d²:\n\n".to_owned();
        for luminaire in &task.scene.luminaires {
            let ray = aspect.meter.position_m - luminaire.position_m;
            let (c, gamma) = angles_deg(luminaire.orientation.transpose() * ray);
            let cosine = (-ray.normalize().dot(aspect.meter.normal)).max(0.0);
            let candela = luminaire.intensity_towards(ray).value();
            let lux = inverse_square::from_luminaire(luminaire, &aspect.meter).value();
            text += &format!(
                "- {}: d = {:.6} m, C {c:.4}, gamma {gamma:.4}: I = {candela:.6} cd (bilinear), cos = {cosine:.6}: {lux:.9} lx\n",
                markdown(&luminaire.id),
                ray.length()
            );
        }
        text
    }

    fn by_hand(&self) -> String {
        let Some((files, command)) = &self.scene else {
            return "Its readings come from no scene of files.\n".to_owned();
        };
        let names: Vec<String> = files.iter().map(|f| markdown(&f.display().to_string())).collect();
        let command =
            command.as_ref().map_or_else(|| ".\n".to_owned(), |c| format!("; in it run\n\n{}", code_block("sh", c)));
        let law = match &self.finding.symptom.oracle {
            Oracle::Law { law, .. } => format!("This is the scene before it is changed as the law `{law}` says. "),
            _ => String::new(),
        };
        format!("{law}The native scene lies in `scene/`: {}{command}", names.join(", "))
    }
}
