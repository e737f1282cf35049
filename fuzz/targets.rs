//! What every reader promises of any bytes: no panic, and what is refused is refused with its place. One function a reader, for cargo-fuzz
//! (`fuzz_targets/`) and for `tests/program/any_bytes.rs`.

use std::fs;
use std::path::Path;

use glam::DVec3;
use luxproof_engines::{ExternalAnswers, Job, Sensor};
use luxproof_model::{EngineName, MeterId, ProcedureId, Report};
use luxproof_photometry::{Tolerance, eulumdat, lm63, tm33};
use luxproof_report::{Detail, Letters, Screen, Style, csv, junit, markdown, page, terminal};
use luxproof_scene::geometry::Mesh;
use luxproof_scene::{Meter, Scene, Transport};
use luxproof_scene_import::{Options, import};
use luxproof_spec::{Budget, Case, Trust};
use luxproof_trend::baseline::Baseline;
use luxproof_trend::history::{History, changes, site};

pub(crate) type Target = fn(&[u8]);

/// All of them, by the names of their folders of seeds.
pub(crate) const ALL: [(&str, Target); 14] = [
    ("lm63", lm63),
    ("eulumdat", eulumdat),
    ("tm33", tm33),
    ("gldf", gldf),
    ("obj", obj),
    ("spec", spec),
    ("report", report),
    ("history", history),
    ("baseline", baseline),
    ("answer", answer),
    ("radiance_scene", radiance_scene),
    ("obj_scene", obj_scene),
    ("gltf_scene", gltf_scene),
    ("usd_scene", usd_scene),
];

/// What was read survives being written.
pub(crate) fn lm63(bytes: &[u8]) {
    match lm63::parse_with(bytes, |_| Ok(b"1 2 0 90 1 .9".to_vec())) {
        Ok(read) => {
            assert!(read.distribution.flux().value() >= 0.0);
            let written = lm63::write_2019(&read);
            let again = lm63::parse(written.text.as_bytes()).expect("a written file is legal");
            assert_eq!(again.distribution, read.distribution);
            assert_eq!(again.lamp_lumens, read.lamp_lumens);
        }
        Err(error) => assert!(error.line >= 1 && error.column >= 1),
    }
}

/// What was read survives being written.
pub(crate) fn eulumdat(bytes: &[u8]) {
    match eulumdat::parse(bytes) {
        Ok(read) => {
            assert!(read.distribution.flux().value() >= 0.0);
            let written = eulumdat::write(&read);
            let again = eulumdat::parse(written.text.as_bytes()).expect("a written file is legal");
            // Planes that are no mirror images of each other cannot be listed again; that must be said.
            let same = again.distribution == read.distribution;
            assert!(same || !written.losses.is_empty());
            assert_eq!(again.distribution.gamma_deg(), read.distribution.gamma_deg());
        }
        Err(error) => assert!(error.line >= 1 && error.column >= 1),
    }
}

/// What was read survives being written, and can be written as LM-63.
pub(crate) fn tm33(bytes: &[u8]) {
    match tm33::parse(bytes) {
        Ok(read) => {
            assert!(read.distribution.flux().value() >= 0.0);
            let written = lm63::write_2019(&read);
            let again = lm63::parse(written.text.as_bytes()).expect("a written file is legal");
            assert_eq!(again.distribution, read.distribution);
            let again = tm33::parse(tm33::write(&read).text.as_bytes()).expect("a written file is legal");
            assert_eq!((again.distribution, again.lamp_lumens), (read.distribution, read.lamp_lumens));
        }
        Err(error) => assert!(error.line >= 1 && error.column >= 1),
    }
}

/// Of any kind, whatever is let pass: what is read without tolerance is read with it, and is the same.
pub(crate) fn gldf(bytes: &[u8]) {
    for name in ["any.gldf", "any.gldf#b", "any.xml#1", "any.ldt", "any.ies"] {
        let read =
            |tolerance| luxproof_photometry::read_tolerantly_by(Path::new(name), &|_| Ok(bytes.to_vec()), tolerance);
        match (read(Tolerance::Strict), read(Tolerance::Harmless)) {
            (Ok(strict), tolerant) => {
                assert!(strict.distribution.flux().value() >= 0.0);
                assert_eq!(tolerant.map(|read| read.distribution), Ok(strict.distribution));
            }
            (Err(error), Ok(tolerant)) => {
                let is_told = tolerant.lints.iter().any(|lint| lint.code.starts_with(luxproof_photometry::FORGIVEN));
                assert!(is_told, "{error}");
                assert_eq!(
                    lm63::write_2019(&tolerant).losses.iter().filter(|loss| loss.contains("intensit")).count(),
                    0
                );
            }
            (Err(error), Err(_)) => assert!(!error.message().is_empty() && !error.help().is_empty()),
        }
    }
}

/// Every triangle has its corners, and they are finite.
pub(crate) fn obj(mut bytes: &[u8]) {
    if let Ok(mesh) = Mesh::parse_obj(&mut bytes, Path::new("any.obj")) {
        assert!(mesh.triangles.iter().flatten().all(|v| (*v as usize) < mesh.vertices_m.len()));
        assert!(mesh.vertices_m.iter().all(|v| v.is_finite()) && !mesh.volume_m3().is_infinite());
    }
}

/// A file of these bytes in a folder of its own, with what they may name beside it.
fn parse_file<T>(name: &str, bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    const LAMP: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0\n1 1 0\n0 60 90\n0\n100 80 0\n";
    let folder = tempfile::tempdir().expect("there is a temporary folder");
    let path = folder.path().join(name);
    let written = fs::write(folder.path().join("lamp.ies"), LAMP).and_then(|()| fs::write(&path, bytes));
    written.expect("it can be written");
    read(&path)
}

/// As a stranger's; the message names the file.
pub(crate) fn spec(bytes: &[u8]) {
    if let Err(error) = parse_file("any.yaml", bytes, |path| Case::load_all(path, Trust::Stranger)) {
        assert!(error.to_string().contains("any.yaml") || error.to_string().contains("lamp.ies"), "{error}");
    }
}

/// A text is refused or read. Every view can be drawn of what has the form of a report, also with a wrong checksum.
pub(crate) fn report(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Err(error) = luxproof_report_file::from_json(text) {
        assert!(!error.to_string().is_empty());
    }
    let Ok(report) = &serde_json::from_str::<Report>(text) else { return };
    terminal(report, Screen::new(Style::Plain, Detail::All, Letters::Unicode, None), None);
    for view in [markdown(report, None), junit(report), csv(report), page(report, &[])] {
        assert!(!view.is_empty());
    }
    report.exit();
}

/// Also of formats that have no checksums: the site can be drawn of it.
pub(crate) fn history(bytes: &[u8]) {
    if let Ok(history) = parse_file("any.jsonl", bytes, History::read) {
        site(&history, &changes(&history), &[]);
    }
}

pub(crate) fn baseline(bytes: &[u8]) {
    if let Err(error) = parse_file("any.json", bytes, Baseline::read) {
        assert!(error.to_string().contains("any.json"), "{error}");
    }
}

/// Commands of it are not run.
pub(crate) fn radiance_scene(bytes: &[u8]) {
    scene("any.rad", bytes);
}

/// It may name itself as its material library.
pub(crate) fn obj_scene(bytes: &[u8]) {
    scene("any.obj", bytes);
}

pub(crate) fn gltf_scene(bytes: &[u8]) {
    scene("any.gltf", bytes);
    scene("any.glb", bytes);
}

/// A profile that it names may be itself.
pub(crate) fn usd_scene(bytes: &[u8]) {
    scene("any.usda", bytes);
}

/// What is taken of a scene lies in its room and is written as it is; what is refused is refused with the file named.
fn scene(name: &str, bytes: &[u8]) {
    let options = Options { leaves_out: true, trust: Trust::Stranger, ..Options::default() };
    match parse_file(name, bytes, |path| import(path, &options)) {
        Ok(imported) => {
            let size_m = DVec3::from(imported.summary.room.size_m);
            let inside = |at: DVec3| at.cmpge(DVec3::ZERO).all() && at.cmple(size_m).all();
            assert!(size_m.is_finite() && inside(imported.place.lamp_m));
            for part in &imported.meshes {
                assert!((0.0..=1.0).contains(&part.reflectance) && !part.mesh.triangles.is_empty());
                assert!(part.mesh.vertices_m.iter().all(|v| inside(*v + imported.origin_m)));
                let again = Mesh::parse_obj(&mut part.obj().as_bytes(), Path::new("again.obj"));
                assert_eq!(again.expect("it is a mesh").triangles.len(), part.mesh.triangles.len());
            }
            assert!(imported.summary.to_string().contains(name));
        }
        Err(faults) => assert!(faults.to_string().contains("any."), "{faults}"),
    }
}

/// What an adapter prints that was asked for two meters: readings of both, or an error.
pub(crate) fn answer(bytes: &[u8]) {
    let meter = Meter { position_m: DVec3::ONE, normal: DVec3::Z };
    let job = Job {
        case: "any".to_owned(),
        procedure: ProcedureId::DirectIlluminance,
        scene: Scene::default(),
        sensors: (0..2).map(|k| Sensor { id: MeterId::new("m", k), meter }).collect(),
        transport: Transport::Direct,
        budget: Budget::default(),
        seed: 1,
        settings: std::collections::BTreeMap::new(),
    };
    let answers = ExternalAnswers::measurements(bytes, &[&job], &EngineName::from("any"));
    for measurement in answers.into_iter().flatten().flatten() {
        assert_eq!(measurement.estimates.len(), 2);
        assert!(measurement.estimates.iter().all(|e| e.value.is_finite() && e.uncertainty.is_finite()));
    }
}
