//! A finding as a folder: spec, photometry, native scene with its command, two reference readings,
//! and the text of an issue.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use luxproof_calculators::inverse_square;
use luxproof_photometry::angles_deg;
use luxproof_scene::{LuminaireModel, Meter, Scene, Transport};
use luxproof_simulator::{Accuracy, Stop, Uncertainty as SolverUncertainty, certified_until};
use serde::{Deserialize, Serialize};

use super::HuntError;
use super::draft::Draft;
use super::feature::Feature;
use super::oracle::{Oracle, OracleRunner, Sighting, Symptom};
use luxproof_audit::plan::{Export, Selection, plan};
use luxproof_engines::display_name;
use luxproof_model::Comparison;
use luxproof_model::ProcedureId;
use luxproof_process::files::FileError;
use luxproof_process::printable::{code_block, markdown};
use luxproof_process::process::interrupt_flag;
use luxproof_spec::procedures::{ReadingKind, Task};
use luxproof_spec::{Case, SpecError, from_yaml, yaml};

/// A confirmed fault in its smallest spec.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// The name of its folder.
    pub id: String,
    #[serde(flatten)]
    pub symptom: Symptom,
    pub engine_version: String,
    /// The features of the minimal spec.
    pub features: BTreeSet<Feature>,
    /// The relative deviation at the worst meter.
    pub deviation: Option<f64>,
    /// The known fault that explains it, where there is one.
    pub diagnosis: Option<String>,
    /// Its cause, where it is on record.
    pub known: Option<String>,
    /// The name of the spec in which it was found.
    pub found_in: String,
    /// The number of specs in which it was seen.
    pub seen: usize,
    /// The procedures in which it was seen.
    pub also: BTreeSet<ProcedureId>,
    /// Lines of the minimal spec.
    pub lines: usize,
    /// C planes and gamma angles of its largest table.
    pub table: [usize; 2],
    /// The number of specs that were tried while it was shrunk.
    pub attempts: usize,
    /// Whether no step makes the spec smaller.
    pub is_minimal: bool,
}

impl Finding {
    /// The features that distinguish its cause from others.
    fn cause(&self) -> impl Iterator<Item = &Feature> {
        self.features.iter().filter(|f| !f.is_plain())
    }

    /// Whether a spec with these features shows the symptom for the same cause.
    pub(super) fn accounts_for(&self, symptom: &Symptom, features: &BTreeSet<Feature>) -> bool {
        self.symptom.engine == symptom.engine
            && self.symptom.oracle == symptom.oracle
            && self.cause().all(|f| features.contains(f))
    }

    /// Whether a minimal spec with these features is the same finding.
    pub(super) fn is_same(&self, symptom: &Symptom, features: &BTreeSet<Feature>) -> bool {
        self.accounts_for(symptom, features)
            && features.iter().filter(|f| !f.is_plain()).all(|f| self.features.contains(f))
    }
}

/// A finding on record, and how it is recognised.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownFinding {
    pub engine: String,
    pub oracle: Oracle,
    /// The features that all of its minimal specs have.
    pub features: BTreeSet<Feature>,
    pub cause: String,
    pub source: String,
}

/// The findings on record.
const RECORD_YAML: &str = include_str!("../../data/findings.yaml");

impl KnownFinding {
    /// Parses the findings on record.
    pub(super) fn on_record() -> Result<Vec<Self>, SpecError> {
        let file = "reference/findings/known.yaml";
        from_yaml(RECORD_YAML).map_err(|what| SpecError::of(file, what, "correct the file and build again"))
    }

    /// Whether this entry explains a finding.
    pub(super) fn accounts_for(&self, finding: &Finding) -> bool {
        finding.symptom.engine == self.engine
            && finding.symptom.oracle == self.oracle
            && self.features.is_subset(&finding.features)
    }
}

/// How a finding was found and shrunk.
pub(super) struct ShrinkSummary {
    pub(super) attempts: usize,
    pub(super) is_minimal: bool,
    pub(super) diagnosis: Option<String>,
    pub(super) found_in: String,
}

/// The files of a native scene, and the command that runs it.
type NativeScene = (Vec<PathBuf>, Option<String>);

/// An independent reading of the worst meter.
struct IndependentReading {
    method: &'static str,
    value_lx: f64,
    uncertainty: String,
}

/// Writes the folder of a finding.
pub(super) fn write_folder(
    runner: &OracleRunner<'_>,
    draft: &Draft,
    sighting: &Sighting,
    summary: &ShrinkSummary,
    folder: &Path,
    seed: u64,
) -> Result<Finding, HuntError> {
    let path = draft.write(folder, "spec").map_err(|e| FileError::of(folder, e))?;
    let case = Case::load(&path)?;
    let symptom = &sighting.symptom;
    let version = runner.make_instrument(&symptom.engine, &case).map(|i| i.version.text).unwrap_or_default();
    let finding = Finding {
        id: folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
        symptom: symptom.clone(),
        engine_version: version,
        features: BTreeSet::new(),
        deviation: sighting.size,
        diagnosis: summary.diagnosis.clone(),
        known: None,
        found_in: summary.found_in.clone(),
        seen: 1,
        also: BTreeSet::new(),
        lines: draft.lines(),
        table: draft.table(),
        attempts: summary.attempts,
        is_minimal: summary.is_minimal,
    };
    let scene = export_scene(runner, &case, symptom, &folder.join("scene"), seed)?;
    let task = case.task(symptom.procedure);
    let independent = task.as_ref().and_then(|task| read_independently(task, sighting, seed));
    let issue = Issue { finding: &finding, draft, sighting, task: task.as_ref(), independent, scene }.write_text();
    let path = folder.join("issue.md");
    std::fs::write(&path, issue).map_err(|e| FileError::of(&path, e))?;
    Ok(finding)
}

/// Exports the native scene to a folder with a script that runs it; `None` where the engine has no
/// scene files.
fn export_scene(
    runner: &OracleRunner<'_>,
    case: &Case,
    symptom: &Symptom,
    folder: &Path,
    seed: u64,
) -> Result<Option<NativeScene>, HuntError> {
    let selection = Selection { engines: vec![symptom.engine.to_string()], procedures: vec![symptom.procedure], seed };
    let Ok(plan) = plan(case, &selection, runner.site) else { return Ok(None) };
    let Some(e) = plan.engines.iter().position(|p| p.engine.name() == symptom.engine) else { return Ok(None) };
    let Some(Export { files, command }) =
        plan.tasks.first().and_then(|task| plan.export(case, e, task, seed, runner.site).ok())
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

/// Reads the worst meter with the inverse-square law where it holds, else with path tracing.
/// Neither shares code with the simulator's other solvers.
fn read_independently(task: &Task, sighting: &Sighting, seed: u64) -> Option<IndependentReading> {
    let worst = sighting.comparison.as_ref()?;
    let target = task.targets.iter().find(|t| t.id == worst.meter && t.made == ReadingKind::Sum)?;
    if is_inverse_square(&task.scene, task.transport) {
        let parts = target.aspects.iter().map(|a| {
            Some(a.weight * inverse_square::direct_illuminance(&task.scene, &a.meter).ok()?.illuminance.value())
        });
        let value_lx = parts.collect::<Option<Vec<f64>>>()?.into_iter().sum();
        return Some(IndependentReading {
            method: "inverse-square law by hand",
            value_lx,
            uncertainty: "rounding".into(),
        });
    }
    let meters: Vec<Meter> = target.aspects.iter().map(|a| a.meter).collect();
    let accuracy = Accuracy { relative_error: 2e-3, seed };
    let deadline = std::time::Instant::now() + std::time::Duration::from_secs(20);
    let stop = Stop { flag: Some(interrupt_flag()), deadline: Some(deadline), ..Stop::NEVER };
    let solution = certified_until(&task.scene, &meters, task.transport, &accuracy, &stop).ok()?;
    let mut value_lx = 0.0;
    let mut error_lx = 0.0;
    for (aspect, estimate) in target.aspects.iter().zip(&solution.estimates) {
        let error = match estimate.uncertainty {
            SolverUncertainty::Bound(bound) => bound,
            SolverUncertainty::StandardError { value, .. } => value,
        };
        error_lx += aspect.weight.abs() * error;
        value_lx += aspect.weight * estimate.illuminance.value();
    }
    let uncertainty = format!("standard error {error_lx:.3e}");
    Some(IndependentReading { method: "path tracing", value_lx, uncertainty })
}

/// Whether the inverse-square law is exact: direct light of point luminaires without obstacles.
fn is_inverse_square(scene: &Scene, transport: Transport) -> bool {
    transport == Transport::Direct
        && scene.obstacles.is_empty()
        && scene.luminaires.iter().all(|l| l.model == LuminaireModel::Point)
}

/// The content of an issue.
struct Issue<'a> {
    finding: &'a Finding,
    draft: &'a Draft,
    sighting: &'a Sighting,
    task: Option<&'a Task>,
    independent: Option<IndependentReading>,
    scene: Option<NativeScene>,
}

impl Issue<'_> {
    /// Writes the whole issue as Markdown.
    fn write_text(&self) -> String {
        let Finding { symptom, engine_version, diagnosis, deviation, .. } = self.finding;
        let (engine, quantity) = (display_name(&symptom.engine), symptom.procedure.title().to_lowercase());
        let percent = deviation.map(|d| format!(" by {:+.3} %", 100.0 * d)).unwrap_or_default();
        let mut text =
            format!("# {engine}: {quantity}: {}{percent}\n\nVersion: {}\n\n", symptom.oracle, markdown(engine_version));
        text += "## What\n\n";
        text += &self.describe_scene();
        text += "\n## Expected and actual\n\n";
        text += &self.write_readings();
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
        text += &self.write_steps();
        text += &format!(
            "\nWith luxproof: `luxproof run spec.yaml --engines {}`, where `spec.yaml` is\n\n{}",
            symptom.engine,
            code_block("yaml", &yaml(&self.draft.spec))
        );
        for (name, file) in &self.draft.files {
            // Larger files are in the folder and would hide the rest of the issue.
            if file.bytes.len() < 4000 {
                let content = code_block("", &String::from_utf8_lossy(&file.bytes));
                text += &format!("\n{}:\n\n{content}", markdown(&name.display().to_string()));
            }
        }
        text
    }

    /// Describes the scene in a sentence.
    fn describe_scene(&self) -> String {
        let spec = &self.draft.spec;
        let room =
            spec.room.size_m.map_or_else(|| "A room".to_owned(), |[x, y, z]| format!("A room of {x} x {y} x {z} m"));
        let (lamps, bodies) = (spec.luminaires.len(), spec.obstacles.len());
        let mut text = format!("{room} with {lamps} luminaire(s) and {bodies} further bodies.");
        if let Some(message) = &self.sighting.text {
            write!(text, " {}.", markdown(message)).ok();
        }
        text + "\n"
    }

    /// Writes the readings of the worst meter as a table.
    fn write_readings(&self) -> String {
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
        if let Some(value) = value {
            let engine = display_name(&self.finding.symptom.engine);
            text += &reading_row(&engine, *value, unit, &format!("{uncertainty:?}"));
        }
        if let Some(reference) = reference {
            let uncertainty = format!("standard {:.3e}", reference.uncertainty);
            text += &reading_row(&reference.source, reference.value, unit, &uncertainty);
        }
        if let Some(reading) = &self.independent {
            text += &reading_row(reading.method, reading.value_lx, unit, &reading.uncertainty);
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
        text += &self.write_arithmetic(worst);
        text
    }

    /// Writes out the inverse-square law for few luminaires, so that a reader can check it by hand.
    fn write_arithmetic(&self, worst: &Comparison) -> String {
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

    /// Writes how to reproduce the finding without luxproof.
    fn write_steps(&self) -> String {
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

/// A row of the table of readings.
fn reading_row(source: &str, value: f64, unit: &str, uncertainty: &str) -> String {
    format!("| {} | {value:.9} {unit} | {uncertainty} |\n", markdown(source))
}
