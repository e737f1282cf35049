//! A program of the user's answers by itself: it cannot read what others answered in the same run.

use crate::support::{Folder, MINE, SKEW_LAMP, SKEW_ROOM, adapter, among};

/// Looks for the answers of our own solvers wherever a run leaves them, and says so where it finds any.
const THIEF: &str = r#"
import json, os, sys
request = json.load(sys.stdin)
if request.get("verb") == "probe":
    print(json.dumps({"protocol": 2, "name": "thief", "version": "1", "capabilities": ["batch", "bounces"]}))
    sys.exit()
places = []
folder = os.path.abspath(os.environ["LUXPROOF_SCENE_DIR"])
while folder != "/":
    folder = os.path.dirname(folder)
    places += [os.path.join(folder, part, name) for part in ("", "readings") for name in ("simulator.json", "iesna.json", "report.json")]
places += [os.path.join(os.environ.get("LUXPROOF_CACHE", "cache"), name) for name in ("simulator", "iesna")]
for top in ("out", "cache"):
    for folder, _, names in os.walk(top):
        places += [os.path.join(folder, name) for name in names if name.endswith(".json")]
try:
    with open(f"/proc/{os.getppid()}/environ", "rb") as around:
        around.read()
    with open(f"/proc/{os.getppid()}/cmdline", "rb") as said:
        words = said.read().decode().split("\0")
    places += [word.split("=", 1)[-1] for word in words]
except OSError:
    pass
for place in places:
    if "/scenes/mine/" in place or place.endswith("adapter.py"):
        continue
    try:
        text = open(place, errors="replace").read()
    except OSError:
        continue
    if "illuminance" in text:
        sys.exit(f"FOUND {place}")
sys.exit("found nothing")
"#;

fn folder(adapter: &str, more: &[(&str, &str)]) -> Folder {
    let spec = [SKEW_ROOM, "  indirect_illuminance: {meters: plane}\n", MINE].concat();
    Folder::new(&[&[("spec.yaml", spec.as_str()), ("lamp.ies", SKEW_LAMP), ("adapter.py", adapter)], more].concat())
}

#[test]
fn an_adapter_finds_no_answers_of_the_run_that_it_takes_part_in() {
    let folder = folder(THIEF, &[]);
    // The first run fills the cache; the second one finds answers there and in its own folder.
    for _ in 0..2 {
        let answer = folder.run(&["--format", "json"]);
        let (report, code) = answer.report();
        assert_eq!(code, Some(3));
        assert!(among(&report, "readings", &[("engine", "mine")]).is_empty());
        let reasons = among(&report, "engines", &[("id", "mine")])[0]["reason"].to_string();
        assert!(reasons.contains("found nothing") && !reasons.contains("FOUND"), "{reasons}");
    }
}

#[test]
fn an_adapter_imports_its_modules_next_to_the_folder_of_the_run() {
    let with_module = format!("import lamp_module\nassert lamp_module.IS_THERE\n{}", adapter());
    let folder = folder(&with_module, &[("lamp_module.py", "IS_THERE = open('lamp.ies').read() != ''\n")]);
    let (report, code) = folder.run(&["--format", "json"]).report();
    assert_eq!(code, Some(0), "{}", report["engines"]);
    assert_eq!(among(&report, "comparisons", &[("engine", "mine"), ("verdict", "pass")]).len(), 23);
}
