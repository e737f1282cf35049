//! Plan, read, report: what one process plans others read, in rounds, and the report is that of one run.

use std::fs;

use serde_json::Value;

use crate::support::{Folder, LAMP, MINE, ROOM, adapter, adapter_with_lines_before_readings};

const METERS: &str = "meters:
  plane: {points_m: [[1, 1, 0.8], [3, 2, 0.8], [5, 3.5, 0.1]], normal: [0, 0, 1]}
procedures:
  direct_illuminance: {meters: plane}
budget: {relative_error: 0.004, seconds: 200}
cases:
  - {name: bright}
  - {name: again}
  - {name: low, luminaires: {lamp: {at_m: [2.5, 2, 1.9]}}}
";

/// The adapter as a renderer that samples: off by so much, and by chance by what it is asked for. Its noise follows from its seed.
fn sampling(off: f64) -> String {
    let exact = adapter();
    let sampled = exact.replace(
        "        readings.append({\"meter\": meter[\"id\"], \"illuminance_lx\": lux, \"error_bound_lx\": 1e-12 * lux})\n",
        &format!(
            "        chance = random.Random(f\"{{job['seed']}} {{meter['id']}} {{job['budget']}} {{lux}}\")\n\
             \x20       error = job['budget']['relative_error'] * lux\n\
             \x20       readings.append({{\"meter\": meter[\"id\"], \"illuminance_lx\": (1 + {off}) * lux + chance.gauss(0, error),\n\
             \x20                        \"std_error_lx\": error, \"degrees_of_freedom\": 100}})\n"
        ),
    );
    assert_ne!(exact, sampled);
    sampled.replace("import math\n", "import math\nimport random\n")
}

struct Lab(Folder);

impl Lab {
    fn new(adapter: &str) -> Self {
        let spec = [ROOM, METERS, MINE].concat();
        Self(Folder::new(&[("spec.yaml", &spec), ("lamp.ies", LAMP), ("adapter.py", adapter)]))
    }

    /// The plan as it stands, kept as a round's.
    fn plan(&self, file: &str) -> Value {
        let answer = self.0.luxproof(&["--cache-dir", "shared", "plan", "spec.yaml", "--json", "--group-seconds", "5"]);
        self.0.write(file, &answer.exits(0).stdout);
        self.0.json(file)
    }

    fn read(&self, plan: &str, job: &str, more: &[&str]) -> crate::support::Answer {
        let args = ["--cache-dir", "shared", "read", "--plan", plan, job];
        self.0.luxproof(&[&args[..], more].concat())
    }

    /// Reads until nothing is open, each group in a process of its own; how many rounds that took.
    fn read_all(&self) -> usize {
        for round in 0.. {
            let file = format!("plan-{round}.json");
            let plan = self.plan(&file);
            let groups = plan["groups"].as_array().unwrap();
            if groups.is_empty() {
                return round;
            }
            assert!(round < 12, "{groups:?}");
            for group in groups {
                self.read(&file, group["id"].as_str().unwrap(), &[]).exits(0);
            }
        }
        unreachable!()
    }

    fn report_from_cache(&self) -> (Option<i32>, String) {
        let answer = self.0.luxproof(&["report", "--from", "shared", "spec.yaml", "--out", "joined"]);
        (answer.code, answer.stderr)
    }
}

/// A report less its times, and with how many others a job had them.
fn timeless(mut report: Value) -> Value {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(fields) => {
                for name in ["started", "wall_s", "cpu_s", "jobs_at_once", "checksum"] {
                    fields.remove(name);
                }
                fields.values_mut().for_each(strip);
            }
            Value::Array(items) => items.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut report);
    report
}

/// Where two values differ, and by what.
fn differences(a: &Value, b: &Value) -> Vec<String> {
    fn compare(at: &str, a: &Value, b: &Value, found: &mut Vec<String>) {
        match (a, b) {
            (Value::Object(x), Value::Object(y)) if x.len() == y.len() => {
                x.iter().for_each(|(name, v)| {
                    compare(&format!("{at}/{name}"), v, y.get(name).unwrap_or(&Value::Null), found);
                });
            }
            (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
                (0..x.len()).for_each(|k| compare(&format!("{at}/{k}"), &x[k], &y[k], found));
            }
            _ if a == b => {}
            _ => found.push(format!("{at}: {:.200} and {:.200}", a.to_string(), b.to_string())),
        }
    }
    let mut found = Vec::new();
    compare("", a, b, &mut found);
    found
}

fn ids(plan: &Value, are_read: bool) -> Vec<String> {
    let jobs = plan["jobs"].as_array().unwrap().iter().filter(|job| job["is_read"] == are_read);
    jobs.map(|job| job["id"].as_str().unwrap().to_owned()).collect()
}

/// What the adapter is to read of a case.
fn of_bright(plan: &Value) -> String {
    let is_it = |job: &&Value| job["engine"] == "mine" && job["cases"] == serde_json::json!(["spec/bright"]);
    plan["jobs"].as_array().unwrap().iter().find(is_it).unwrap()["id"].as_str().unwrap().to_owned()
}

#[test]
fn what_others_read_in_rounds_makes_the_report_of_one_run() {
    // Off by as much as is allowed, so that chance keeps it open for long.
    let lab = Lab::new(&sampling(0.0095));
    let code = lab.0.luxproof(&["run", "spec.yaml", "--out", "out"]).code;
    let first = lab.plan("plan.json");
    assert_eq!(ids(&first, false), ids(&lab.plan("again.json"), false));
    assert_eq!(ids(&first, true), [""; 0]);
    // Equal jobs of two cases are one.
    let jobs = first["jobs"].as_array().unwrap();
    assert!(jobs.iter().any(|job| job["cases"] == serde_json::json!(["spec/again", "spec/bright"])), "{jobs:?}");
    assert!(lab.read_all() >= 2);
    let (joined, reported) = lab.report_from_cache();
    assert_eq!((joined, reported.contains("not read yet")), (code, false), "{reported}");
    let looks = |report: &Value| report["readings"].to_string();
    let (run, joined) = (lab.0.json("out/report.json"), lab.0.json("joined/report.json"));
    assert_eq!(looks(&run), looks(&joined));
    assert_eq!(differences(&timeless(run), &timeless(joined)), [""; 0]);
}

/// What is read together is planned one by one, and asked for nowhere else.
#[test]
fn plans_and_reports_from_a_cache_start_nobody_who_reads_in_batches() {
    let asked =
        "def reply(request):\n    with open('asked', 'a') as log:\n        log.write(request['verb'] + '\\n')\n";
    let lab = Lab::new(&adapter().replace("def reply(request):\n", asked));
    let reads = || lab.0.read("asked").lines().filter(|verb| *verb == "read").count();
    // Those of the calibration are read together, and planned each.
    let plan = lab.plan("plan.json");
    let is_open = |job: &&Value| job["engine"] == "mine" && job["cases"] == serde_json::json!(["calibration"]);
    let open = plan["jobs"].as_array().unwrap().iter().filter(is_open).filter(|job| job["is_read"] == false);
    assert_eq!(open.count(), 3);
    assert_eq!(lab.report_from_cache().0, Some(3));
    assert_eq!(reads(), 0);
    lab.read_all();
    assert!(reads() > 0);
    lab.0.write("asked", "");
    assert_eq!(ids(&lab.plan("whole.json"), false), [""; 0]);
    assert_eq!(lab.report_from_cache().0, Some(0));
    assert_eq!(reads(), 0);
}

#[test]
fn a_reading_that_is_lost_is_missed_by_name_and_read_again() {
    let lab = Lab::new(&adapter());
    assert_eq!(lab.report_from_cache().0, Some(3));
    lab.read_all();
    assert_eq!(lab.report_from_cache().0, Some(0));
    let lost = ids(&lab.plan("whole.json"), true).into_iter().find(|id| id.starts_with("mine/")).unwrap();
    fs::remove_file(lab.0.path("shared").join(&lost).with_extension("json")).unwrap();
    let plan = lab.plan("plan.json");
    assert_eq!(ids(&plan, false), [lost.as_str()]);
    let (code, reported) = lab.report_from_cache();
    assert!(code == Some(3) && reported.contains("1 job to be read"), "{code:?} {reported}");
    // What a killed process had begun to write is no reading.
    fs::write(lab.0.path("shared").join(&lost).with_extension("json"), "{").unwrap();
    assert_eq!(ids(&lab.plan("plan.json"), false), [lost.as_str()]);
    lab.read("plan.json", &lost, &[]).exits(0).prints(&format!("read {lost}"));
    assert_eq!(lab.report_from_cache().0, Some(0));
}

#[test]
fn a_failure_is_tried_again_until_it_is_taken_for_the_answer() {
    let lab = Lab::new(&adapter_with_lines_before_readings("sys.exit('no light today')"));
    let code = lab.0.luxproof(&["run", "spec.yaml", "--out", "out"]).exits(3).code;
    let plan = lab.plan("plan.json");
    let open: Vec<String> = ids(&plan, false).into_iter().filter(|id| id.starts_with("mine/")).collect();
    for id in &open {
        lab.read("plan.json", id, &[]).exits(3).prints(&format!("failed {id}"));
        assert!(ids(&lab.plan("plan.json"), false).contains(id));
        lab.read("plan.json", id, &["--give-up"]).exits(0).prints(&format!("gave up {id}"));
        assert!(!ids(&lab.plan("plan.json"), false).contains(id));
    }
    lab.read_all();
    assert_eq!(lab.report_from_cache().0, code);
    let lost = |file: &str| lab.0.json(file)["summary"].clone();
    assert_eq!(lost("out/report.json"), lost("joined/report.json"));
}

#[test]
fn a_plan_of_other_specs_and_ids_that_are_none_are_refused() {
    let lab = Lab::new(&adapter());
    let id = of_bright(&lab.plan("plan.json"));
    lab.read("plan.json", "mine/12", &[]).exits(2).complains("no id of a job");
    lab.read("plan.json", &id.replace(&id[5..9], "0000"), &[]).exits(2).complains("has no job");
    lab.read("spec.yaml", &id, &[]).exits(2).complains("is no plan");
    lab.0.edit("spec.yaml", "at_m: [3, 2, 2.5]", "at_m: [3, 2, 2.4]");
    lab.read("plan.json", &id, &[]).exits(2).prints("plan again");
    // A program that was changed since gives other readings.
    let lab = Lab::new(&adapter());
    let id = of_bright(&lab.plan("plan.json"));
    lab.0.write("adapter.py", &(adapter() + "# changed\n"));
    lab.read("plan.json", &id, &[]).exits(2).prints("it needs mine");
}

#[test]
fn a_node_without_the_engine_gives_nothing_up_and_another_goes_on() {
    let lab = Lab::new(&adapter());
    let plan = lab.plan("plan.json");
    let open: Vec<String> = ids(&plan, false).into_iter().filter(|id| id.starts_with("mine/")).collect();
    let (there, gone) = (lab.0.path("adapter.py"), lab.0.path("gone.py"));
    fs::rename(&there, &gone).unwrap();
    for id in &open {
        lab.read("plan.json", id, &["--give-up"]).exits(2).prints(&format!("not asked for {id}"));
    }
    fs::rename(&gone, &there).unwrap();
    assert!(open.iter().all(|id| ids(&lab.plan("again.json"), false).contains(id)));
    lab.read_all();
    assert_eq!(lab.report_from_cache().0, Some(0));
}

#[test]
fn what_finds_the_disk_full_stays_open_and_is_read_when_there_is_room() {
    let lab = Lab::new(&adapter());
    let id = of_bright(&lab.plan("plan.json"));
    // Nothing can be written below a file.
    fs::create_dir_all(lab.0.path("shared")).unwrap();
    lab.0.write("shared/mine", "");
    lab.read("plan.json", &id, &["--give-up"]).exits(3).complains("could not be kept").prints(&format!("failed {id}"));
    fs::remove_file(lab.0.path("shared/mine")).unwrap();
    lab.read("plan.json", &id, &[]).exits(0).prints(&format!("read {id}"));
    lab.read_all();
    assert_eq!(lab.report_from_cache().0, Some(0));
}
