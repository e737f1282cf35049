//! Texts of strangers in messages and views: none colours a terminal, begins a line or is longer than a person reads.

use std::fs;
use std::io::Write as _;

use serde_json::{Value, json};

use crate::strangers::seal;
use crate::support::{Answer, Folder, LAMP, OWN, ROOM, TWO_METERS, sealed};

/// Colours a terminal, and begins a line that luxproof might have written.
const HOSTILE: &str = "a\u{1b}[31mb\r\nFORGED: all passed";
const DIRECT: &str = "procedures:\n  direct_illuminance: {meters: plane}\n";

fn spec() -> String {
    [ROOM, TWO_METERS, DIRECT].concat()
}

fn room() -> Folder {
    Folder::new(&[("spec.yaml", &spec()), ("lamp.ies", LAMP)])
}

/// A sound run of the room in `out`.
fn run_room() -> Folder {
    let folder = room();
    folder.run(&["--engines", OWN]).exits(0);
    folder
}

/// Asserts that an answer shows hostile texts as text; `what` names the case.
#[track_caller]
fn shows_text_alone(what: &str, answer: &Answer) {
    let shown = answer.stdout.clone() + &answer.stderr;
    assert!(!shown.contains('\u{1b}'), "{what}: {answer:?}");
    let frame = ['│', '╰', '─', '▶', '×', ' ', '\t'];
    assert!(!shown.lines().any(|line| line.trim_start_matches(frame).starts_with("FORGED")), "{what}: {answer:?}");
    // All is short: twenty kilobytes are four screens.
    assert!(shown.len() < 20_000, "{what}: {} bytes: {:.400}", shown.len(), shown);
}

/// The hostile text, then one of a megabyte.
fn texts() -> [String; 2] {
    [HOSTILE.to_owned(), format!("x{}", "y".repeat(1 << 20))]
}

#[test]
fn answers_to_the_conformance_pack_are_quoted_as_text() {
    let folder = Folder::new(&[]);
    let own = folder.luxproof(&["conformance", "answer"]).exits(0).json();
    for text in texts() {
        let mut changed: Vec<Value> = vec![];
        let mut change = |change: &dyn Fn(&mut Value)| {
            let mut answers = own.clone();
            change(&mut answers);
            changed.push(answers);
        };
        change(&|answers| answers["pack"] = json!(text));
        change(&|answers| answers["reader"]["name"] = json!(text));
        change(&|answers| answers["reader"]["version"] = json!(text));
        change(&|answers| answers["scale"] = json!(text));
        change(&|answers| answers[&text] = json!(1));
        change(&|answers| answers["files"][&text] = json!({"candela": [1]}));
        change(&|answers| answers["files"]["plain.ies"] = json!({"refused": text}));
        change(&|answers| answers["files"]["plain.ies"] = json!({"refused": text, "candela": [1]}));
        change(&|answers| answers["files"]["plain.ies"] = json!({"candela": text}));
        for (k, answers) in changed.iter().enumerate() {
            folder.write("answers.json", &answers.to_string());
            shows_text_alone(&format!("answers {k}"), &folder.luxproof(&["conformance", "check", "answers.json"]));
        }
    }
}

#[test]
fn names_in_scenes_are_quoted_as_text() {
    let folder = Folder::new(&[]);
    let faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for text in texts() {
        // Lines of Wavefront end where the text's do, quotes of Radiance's do not.
        let word = text.replace(['\r', '\n'], " ");
        let gltf = |key: &str, value: Value| {
            let mut scene = json!({
                "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
                "materials": [{"name": "m"}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
                "bufferViews": [{"buffer": 0, "byteLength": 36}],
                "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
            });
            scene[key] = value;
            scene.to_string()
        };
        let profile = |uri: &str| json!({"EXT_lights_ies": {"lights": [{"uri": uri}]}});
        let light = json!([{"mesh": 0, "extensions": {"EXT_lights_ies": {"light": 0}}}]);
        let mut lit: Value = serde_json::from_str(&gltf("nodes", light)).unwrap();
        lit["extensions"] = profile(&text);
        let mut network = lit.clone();
        network["extensions"] = profile(&format!("http://{text}"));
        for (name, scene) in [
            ("s.rad", format!("void plastic \"{text}\" 0 0 5 .5 .5 .5 0 0\n\"{text}\" sphere s 0 0 4 1 1 1 0.5\n")),
            (
                "s.rad",
                format!(
                    "void glow \"{text}\" 0 0 4 1 1 1 0\nvoid plastic m 0 0 5 .5 .5 .5 0 0\n\"{text}\" sphere s 0 0 4 1 1 1 0.5\nm sphere s 0 0 4 1 1 1 0.5\n"
                ),
            ),
            ("s.rad", format!("void glass \"{text}\" 0 0 3 .5 .5 .5\n\"{text}\" sphere s 0 0 4 1 1 1 0.5\n")),
            ("s.rad", format!("\"{text}\" sphere s 0 0 4 1 1 1 0.5\n")),
            ("s.rad", format!("void \"{text}\" s 0 0 0\n")),
            ("s.rad", format!("void plastic m 0 0 \"{text}\"\n")),
            ("s.rad", format!("void mesh \"{text}\" 0 0 0\n")),
            ("s.rad", format!("!{word}\n")),
            ("s.obj", format!("mtllib {word}.mtl\n{faces}")),
            ("s.obj", format!("usemtl {word}\n{faces}")),
            ("s.obj", format!("mtllib a.mtl\nusemtl {word}\n{faces}")),
            ("s.obj", format!("g {word}\nv {word}\n")),
            ("s.gltf", gltf("asset", json!({"version": text}))),
            ("s.gltf", gltf("asset", json!(text))),
            ("s.gltf", gltf("materials", json!([{"name": text}]))),
            ("s.gltf", gltf("materials", json!([{"name": text, "alphaMode": text}]))),
            ("s.gltf", gltf("extensionsRequired", json!([text]))),
            ("s.gltf", gltf("extensionsUsed", json!(vec![text.clone(); 30]))),
            ("s.gltf", gltf("buffers", json!([{"byteLength": 36, "uri": text}]))),
            ("s.gltf", lit.to_string()),
            ("s.gltf", network.to_string()),
        ] {
            folder.write("a.mtl", &format!("newmtl {word}\nKd .5 .5 .5\nmap_Kd {word}\n"));
            folder.write(name, &scene);
            for more in [&[][..], &["--leave-out"], &["--reflectance", "none=0.5"]] {
                let import = [&["import", "--untrusted", name, "--out", "made", "--force"], more].concat();
                shows_text_alone(&format!("{name} {scene:.60}"), &folder.luxproof(&import));
            }
        }
    }
}

#[test]
fn titles_and_names_of_reports_are_one_line() {
    let folder = run_room();
    let whole = folder.report();
    for place in [
        "/spec/title",
        "/spec/path",
        "/tool_version",
        "/tool/version",
        "/cases/0/name",
        "/cases/0/spec/title",
        "/cases/0/spec/path",
        "/engines/0/id",
        "/engines/0/version",
        "/comparisons/0/meter",
        "/comparisons/0/engine",
        "/comparisons/0/case",
        "/comparisons/0/reference/source",
        "/recordings/0/case",
        "/recordings/0/model",
        "/sentences/0/text",
    ] {
        let mut report = whole.clone();
        let Some(text) = report.pointer_mut(place) else { continue };
        *text = HOSTILE.into();
        folder.write("theirs.json", &sealed(report));
        for view in [
            &["report", "theirs.json"][..],
            &["report", "theirs.json", "--all"],
            &["report", "theirs.json", "--format", "csv"],
            &["report", "theirs.json", "--format", "markdown"],
            &["report", "theirs.json", "--budget"],
            &["diff", "out", "theirs.json"],
            &["diff", "theirs.json", "out"],
            &["cards", "theirs.json", "--out", "site"],
        ] {
            shows_text_alone(&format!("{place} {view:?}"), &folder.luxproof(view));
        }
    }
}

#[test]
fn names_in_bundles_and_plans_are_one_line() {
    let folder = run_room();
    folder.luxproof(&["bundle", "out", "--out", "whole"]).exits(0);
    for text in texts() {
        for place in [
            "/specs/0",
            "/request/policy",
            "/request/engines/0",
            "/request/filter/0",
            "/request/profile",
            "/engines/0/id",
            "/tool/version",
            "/command",
            "/python_locks/0/name",
        ] {
            fs::remove_dir_all(folder.path("theirs")).ok();
            copy_folder(&folder, "whole", "theirs");
            let mut lock = folder.json("theirs/lock.json");
            if place.ends_with("/0") && place.starts_with("/request") {
                *lock.pointer_mut(place.trim_end_matches("/0")).unwrap() = json!([""]);
            }
            let Some(value) = lock.pointer_mut(place) else { panic!("no {place}") };
            *value = text.as_str().into();
            folder.write("theirs/lock.json", &lock.to_string());
            seal(&folder.path("theirs"));
            shows_text_alone(place, &folder.luxproof(&["reproduce", "theirs", "--out", "again"]));
        }
        let plan =
            folder.luxproof(&["plan", "--untrusted", "spec.yaml", "--engines", OWN, "--no-calibration", "--json"]);
        let plan = plan.exits(0).json();
        let job = plan["jobs"][0]["id"].as_str().unwrap();
        for place in [
            "/asked/specs/0",
            "/asked/engines/0",
            "/asked/policy",
            "/asked/profile",
            "/jobs/0/engine",
            "/jobs/0/cases/0",
            "/jobs/0/id",
            "/luxproof",
        ] {
            let mut changed = plan.clone();
            let Some(value) = changed.pointer_mut(place) else { panic!("no {place} in {plan}") };
            *value = text.as_str().into();
            folder.write("plan.json", &changed.to_string());
            shows_text_alone(place, &folder.luxproof(&["read", "--untrusted", "--plan", "plan.json", job]));
        }
    }
}

fn copy_folder(folder: &Folder, from: &str, to: &str) {
    fs::create_dir_all(folder.path(to)).unwrap();
    for entry in fs::read_dir(folder.path(from)).unwrap().map(|entry| entry.unwrap()) {
        let name = entry.file_name().into_string().unwrap();
        let (from, to) = (format!("{from}/{name}"), format!("{to}/{name}"));
        if entry.path().is_dir() {
            copy_folder(folder, &from, &to);
        } else {
            fs::copy(folder.path(&from), folder.path(&to)).unwrap();
        }
    }
}

#[test]
fn texts_of_specs_and_policies_are_quoted_as_text() {
    // As YAML escapes them.
    for text in [
        r#""a\e[31mb\r\nFORGED: all passed""#.to_owned(),
        r#""a\r\nFORGED: all passed""#.to_owned(),
        format!("\"{}\"", "y".repeat(100_000)),
    ] {
        for (from, to) in [
            ("title: a test room", format!("title: {text}")),
            ("title:", format!("hidden_variant: {{of: {text}, seed: 1}}\ntitle:")),
            ("luxproof: 1", format!("luxproof: {text}")),
            ("title:", format!("{text}: 1\ntitle:")),
            ("photometry: lamp.ies", format!("photometry: {text}")),
            ("id: lamp", format!("id: {text}")),
            ("plane:", format!("{text}:")),
            ("meters: plane", format!("meters: {text}")),
            ("procedures:", format!("published: {text}\nprocedures:")),
            ("procedures:", format!("engines: {{{text}: {{}}}}\nprocedures:")),
            ("procedures:", format!("engines: {{x: {{readings: {text}}}}}\nprocedures:")),
            ("procedures:", format!("cases: [{{name: {text}}}]\nprocedures:")),
            ("procedures:", format!("tolerances: {{{text}: {{relative: 1}}}}\nprocedures:")),
            ("procedures:", format!("obstacles: [{{mesh: {{file: {text}, reflectance: 0.5}}}}]\nprocedures:")),
        ] {
            let folder = room();
            folder.edit("spec.yaml", from, &to);
            shows_text_alone(&to, &folder.luxproof(&["check", "--untrusted", "spec.yaml"]));
        }
        let folder = room();
        for policy in [
            format!("required_engines: [{text}]\n"),
            format!("{text}: 1\n"),
            format!("tolerances: [{{procedure: {text}, relative: 1, source: x}}]\n"),
            format!("tolerances: [{{procedure: direct_illuminance, engine: {text}, relative: 1, source: {text}}}]\n"),
            format!(
                "known_deviations: [{{engine: iesna, procedure: direct_illuminance, expected: 1, uncertainty: 1, cause: {text}, source: {text}}}]\n"
            ),
            format!("tolerance_class: {text}\n"),
        ] {
            folder.write("luxproof.yaml", &policy);
            let check = ["check", "--untrusted", "spec.yaml", "--engines", OWN];
            shows_text_alone(&policy, &folder.luxproof(&check));
            shows_text_alone(
                &policy,
                &folder.luxproof(&[&check[..], &["--policy", "luxproof.yaml", "--profile", "x"]].concat()),
            );
        }
        for capabilities in [
            format!(
                "version: 1\ncapabilities: [{{id: {text}, group: a, title: b, question: c, cases: [{{case: a, procedures: [direct_illuminance]}}], minimum_cases: 1}}]\n"
            ),
            format!("version: {text}\n"),
            format!(
                "version: 1\ncapabilities: [{{id: a, group: {text}, title: {text}, question: {text}, cases: [{{case: {text}, procedures: [{text}]}}], minimum_cases: 1}}]\n"
            ),
        ] {
            folder.write("capabilities.yaml", &capabilities);
            let cards = ["cards", "out", "--capabilities", "capabilities.yaml", "--out", "site"];
            shows_text_alone(&capabilities, &folder.luxproof(&cards));
        }
    }
}

#[test]
fn headers_of_photometric_files_are_shown_as_text() {
    let folder = Folder::new(&[]);
    for text in texts() {
        let xml = text.replace('\u{1b}', "");
        let tm33 = format!(
            "<IESTM33-22><Header><Manufacturer>{xml}</Manufacturer><Description>{xml}</Description></Header><Emitter><Quantity>1</Quantity>\
             <LuminousData><LuminousIntensity><NumberHorz>1</NumberHorz><NumberVert>2</NumberVert><IntData h='0' v='0'>1</IntData><IntData h='0' v='90'>1</IntData>\
             </LuminousIntensity></LuminousData></Emitter></IESTM33-22>"
        );
        let unknown = tm33.replace("<Quantity>1</Quantity>", &format!("<Quantity>{xml}</Quantity>"));
        let gldf = |reference: &str| {
            let product = format!(
                "<Root><Header><Manufacturer>{xml}</Manufacturer></Header><GeneralDefinitions><Files><File id='a' type='localFileName'>{xml}</File><File id='b' type='{xml}'>b.ies</File></Files>\
                 <Photometries><Photometry id='p'><PhotometryFileReference fileId='{reference}'/></Photometry></Photometries></GeneralDefinitions></Root>"
            );
            let mut zip = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
            zip.start_file("product.xml", zip::write::SimpleFileOptions::default()).unwrap();
            zip.write_all(product.as_bytes()).unwrap();
            zip.finish().unwrap().into_inner()
        };
        for (name, bytes) in [
            ("a.ies", LAMP.replace("[TEST] made for this test", &format!("[MANUFAC] {text}")).into_bytes()),
            ("a.ies", LAMP.replace("TILT=NONE", &format!("TILT={text}")).into_bytes()),
            ("a.ies", LAMP.replace("IESNA:LM-63-2002", &text).into_bytes()),
            ("a.ies", LAMP.replace("100 80 0", &text).into_bytes()),
            ("a.ldt", text.clone().into_bytes()),
            ("a.xml", tm33.into_bytes()),
            ("a.xml", unknown.into_bytes()),
            ("a.xml", format!("<{}/>", text.replace(' ', "")).into_bytes()),
            ("a.gldf", gldf("a")),
            ("a.gldf", gldf("b")),
            ("a.gldf", gldf("c")),
        ] {
            fs::write(folder.path(name), bytes).unwrap();
            for more in [&[][..], &["--lint"]] {
                for trust in [&[][..], &["--untrusted"]] {
                    shows_text_alone(name, &folder.luxproof(&[&["photometry", name], more, trust].concat()));
                }
            }
        }
    }
}
