//! Case S2, a furnished office under luminous panels, on all three renderers against exact values.

use std::time::Duration;

use luxproof_audit::plan::{Selection, plan};
use luxproof_engines::fixtures::test_root;
use luxproof_engines::{JobDir, Support};
use luxproof_model::{Estimate, ProcedureId};
use luxproof_spec::{Budget, Case};

use crate::support::{Folder, is_night, root};

/// By clipped polygons.
const DIRECT_LX: [f64; 6] = [66.24407, 226.03927, 161.02976, 123.15923, 210.12365, 0.0];
/// By path tracing, within .005 to .024 lx.
const INDIRECT_LX: [f64; 6] = [51.0232, 53.0644, 48.966, 53.512, 50.245, 18.788];

/// What an engine reads of a procedure of case S2, and what it says beforehand of its own error, relative.
fn read(engine: &str, procedure: ProcedureId, budget: Budget, settings: &[(&str, u32)]) -> (Vec<Estimate>, f64) {
    let site = test_root();
    let case = Case { budget, ..Case::load(&root().join("reference/analytic/s2.yaml")).unwrap() };
    let selection = Selection { engines: vec![engine.into()], procedures: vec![procedure], seed: 1 };
    let plan = plan(&case, &selection, &site).unwrap();
    let mine = plan.runs.iter().find(|r| plan.engines[r.engine].engine.name() == engine);
    let run = mine.unwrap_or_else(|| panic!("{engine} does not run; run `luxproof engines install`"));
    let mut job = run.job.clone();
    job.settings.extend(settings.iter().map(|(k, v)| ((*k).to_owned(), (*v).into())));
    let engine = &plan.engines[run.engine].engine;
    let declared = match engine.supports(&job) {
        Support::Approximate { size, .. } => size.unwrap_or(0.0),
        Support::Yes => 0.0,
        Support::No(why) => panic!("{why}"),
    };
    let folder = Folder::for_renderers(&[]);
    let (scene_dir, log) = (folder.path(""), folder.path("log"));
    let bench = JobDir {
        site,
        scene_dir,
        log,
        jobs: 2,
        patience: Duration::from_secs(300),
        limit: Duration::from_secs(300),
        peak: luxproof_process::process::PeakMemory::default(),
        shared_precompute: luxproof_engines::SharedPrecompute::default(),
        idle: None,
        hidden: [].into(),
    };
    (engine.read(&job, &bench).unwrap().estimates, declared)
}

fn direct_light_within_1_percent(engine: &str) {
    let (found, _) = read(engine, ProcedureId::DirectIlluminance, Budget { relative_error: 0.004, seconds: 30.0 }, &[]);
    for (k, (estimate, exact)) in found.iter().zip(DIRECT_LX).enumerate() {
        assert!((estimate.value - exact).abs() <= 0.01 * exact, "{engine} at {k}: {estimate:?} for {exact}");
    }
}

/// Within 2 %, noise and what the engine itself declares apart.
fn reflected_light_within_2_percent(engine: &str, budget: Budget, settings: &[(&str, u32)]) {
    let (found, declared) = read(engine, ProcedureId::IndirectIlluminance, budget, settings);
    assert!(declared < 0.04, "{declared}");
    for (k, (estimate, exact)) in found.iter().zip(INDIRECT_LX).enumerate() {
        let error = estimate.uncertainty.standard_error().unwrap();
        assert!(error < 0.04 * exact, "{engine} at {k}: {estimate:?}");
        let allowed = declared.max(0.02) * exact + 3.0 * error;
        assert!((estimate.value - exact).abs() <= allowed, "{engine} at {k}: {estimate:?} for {exact}");
    }
}

const BUDGET: Budget = Budget { relative_error: 0.008, seconds: 20.0 };

#[test]
fn mitsuba_reads_the_furnished_office() {
    direct_light_within_1_percent("mitsuba");
    reflected_light_within_2_percent("mitsuba", BUDGET, &[]);
}

#[test]
fn radiance_reads_the_furnished_office() {
    direct_light_within_1_percent("radiance");
    reflected_light_within_2_percent("radiance", BUDGET, &[]);
}

#[test]
fn povray_reads_the_furnished_office() {
    direct_light_within_1_percent("povray");
    // Eight blocks of few rays, however busy the machine is.
    let budget = Budget { relative_error: 0.5, seconds: 1e6 };
    reflected_light_within_2_percent("povray", budget, &[("count", if is_night() { 50 } else { 20 })]);
}
