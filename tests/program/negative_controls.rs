//! Negative controls: a deliberately wrong export, run on the real renderer, must fail its procedure.

use luxproof_spec::Trust;
use std::sync::Arc;

use luxproof_audit::SilentObserver;
use luxproof_audit::jobs::Running;
use luxproof_audit::measure::{Machine, Reader};
use luxproof_audit::plan::{Selection, plan};
use luxproof_engines::fixtures::test_root;
use luxproof_model::{Comparison, Verdict};
use luxproof_model::{ProcedureId, Recording};
use luxproof_photometry::{LuminousIntensityDistribution, Photometry};
use luxproof_spec::Case;
use luxproof_verdict::{Judge, KnownDeviations, Tolerances};

use crate::support::{Folder, root};

fn cachet() -> Case {
    Case::load(&root().join("reference/specs/cachet.yaml")).unwrap()
}

fn selection(engine: &str) -> Selection {
    let procedures = vec![ProcedureId::LuminousIntensity, ProcedureId::DirectIlluminance];
    Selection { engines: vec![engine.to_owned()], procedures, seed: 1 }
}

fn recordings(case: &Case, engine: &str) -> Vec<Recording> {
    let site = test_root();
    let out = Folder::for_renderers(&[]);
    let plan = plan(case, &selection(engine), &site).unwrap();
    let folder = out.path("");
    let reader = Reader { out: Some(folder.clone()), ..Reader::bare(&site, Machine::new(2)) };
    let running = Running { case, plan: &plan, folder: Some(&folder), reader, observer: &SilentObserver };
    let outcome = running.run().unwrap();
    let mine: Vec<Recording> = outcome.recordings.into_iter().filter(|r| r.key.engine == engine).collect();
    assert!(!mine.is_empty(), "{engine} did not run; run `luxproof engines install`");
    mine
}

/// What the exported scene is given instead of the true distribution.
fn tampered(case: &Case, wrong: impl Fn(&LuminousIntensityDistribution) -> LuminousIntensityDistribution) -> Case {
    let mut case = case.clone();
    for luminaire in &mut case.scene.luminaires {
        let distribution = wrong(&luminaire.photometry.distribution);
        luminaire.photometry = Arc::new(Photometry { distribution, ..(*luminaire.photometry).clone() });
    }
    case
}

/// The engine's readings of `exported`, judged by the references of `truth`.
fn judged(truth: &Case, exported: &Case, engine: &str) -> Vec<Comparison> {
    let tolerances = Tolerances::built_in().unwrap();
    let known = KnownDeviations::built_in().unwrap();
    let (overrides, trust) = (&truth.tolerances, Trust::Own);
    let judge = Judge { tolerances: &tolerances, known: &known, overrides, trust, published: None };
    let witness = recordings(truth, "iesna");
    let subject = recordings(exported, engine);
    let plan = plan(truth, &selection(engine), &test_root()).unwrap();
    let of_task = |task: &luxproof_spec::procedures::Task| {
        let both: Vec<&Recording> =
            witness.iter().chain(&subject).filter(|r| r.key.procedure == task.procedure).collect();
        judge.compare(task, &both)
    };
    plan.tasks.iter().flat_map(of_task).filter(|c| c.key.engine == engine).collect()
}

fn failed(comparisons: &[Comparison], procedure: ProcedureId) -> usize {
    comparisons.iter().filter(|c| c.key.procedure == procedure && c.verdict == Verdict::Fail).count()
}

fn wrong_exports_fail(engine: &str) {
    let truth = cachet();
    let right = judged(&truth, &truth, engine);
    assert!(right.iter().all(|c| c.verdict == Verdict::Pass), "{engine} must pass untampered: {right:#?}");

    let by_pi = judged(&truth, &tampered(&truth, |d| d.scaled(std::f64::consts::PI)), engine);
    assert_eq!(
        (failed(&by_pi, ProcedureId::LuminousIntensity), failed(&by_pi, ProcedureId::DirectIlluminance)),
        (7, 4)
    );

    let multiplier_dropped = judged(&truth, &tampered(&truth, |d| d.scaled(0.5)), engine);
    assert_eq!(failed(&multiplier_dropped, ProcedureId::LuminousIntensity), 7);

    let turned = judged(&truth, &tampered(&truth, turned_by_90), engine);
    // C 0 and C 90 agree at the horizon and at the zenith alone.
    assert_eq!(failed(&turned, ProcedureId::LuminousIntensity), 5);
    assert!(failed(&turned, ProcedureId::DirectIlluminance) >= 2);
}

fn turned_by_90(distribution: &LuminousIntensityDistribution) -> LuminousIntensityDistribution {
    let (c, gamma) = (distribution.c_deg().to_vec(), distribution.gamma_deg().to_vec());
    let at = |c: f64| gamma.iter().map(move |&g| distribution.intensity(c + 90.0, g).value());
    let candela = c.iter().flat_map(|&c| at(c)).collect();
    LuminousIntensityDistribution::new(c, gamma.clone(), candela).unwrap()
}

#[test]
fn wrong_exports_to_radiance_fail_their_procedure() {
    wrong_exports_fail("radiance");
}

#[test]
fn wrong_exports_to_povray_fail_their_procedure() {
    wrong_exports_fail("povray");
}

#[test]
fn wrong_exports_to_mitsuba_fail_their_procedure() {
    wrong_exports_fail("mitsuba");
}
