//! `luxproof engines doctor --adapter`: adapters that are wrong on purpose, each with all of its faults reported in one run.

use crate::support::{Answer, Folder, adapter};

/// What is found of the example adapter with some of its text replaced.
fn examined(changes: &[(&str, &str)]) -> Answer {
    let text = changes.iter().fold(adapter(), |text, (from, to)| {
        assert!(text.contains(from), "no `{from}` in the example");
        text.replace(from, to)
    });
    let folder = Folder::new(&[("adapter.py", &text)]);
    folder.luxproof(&["engines", "doctor", "--adapter", "python3 -S adapter.py"])
}

/// The line of a topic and what is indented below it.
fn section(answer: &Answer, topic: &str) -> String {
    let lines = answer.stdout.lines().skip_while(|line| !line.starts_with("conformance: ")).skip(1);
    let mut mine = lines.skip_while(|line| !line.starts_with(&format!("  {topic} ")));
    let first = mine.next().unwrap_or_else(|| panic!("no {topic} in {}\n{}", answer.stdout, answer.stderr));
    let rest = mine.take_while(|line| line.starts_with("        ")).collect::<Vec<_>>().join(" ");
    format!("{} {rest}", &first[19..])
}

const TOPICS: [&str; 8] =
    ["protocol", "meters", "units", "orientation", "shadows", "reflected light", "noise", "claims"];

/// Exactly these topics are wrong, each for this reason.
#[track_caller]
fn assert_reported(changes: &[(&str, &str)], wrong: &[(&str, &str)]) {
    let answer = examined(changes);
    assert!(matches!(answer.code, Some(1 | 3)), "{:?}\n{}\n{}", answer.code, answer.stdout, answer.stderr);
    for topic in TOPICS {
        let found = section(&answer, topic);
        let reason = wrong.iter().find(|(of, _)| *of == topic).map(|(_, reason)| *reason);
        assert_eq!(found.starts_with("WRONG"), reason.is_some(), "{topic}: {found}\n{}", answer.stdout);
        assert!(found.contains(reason.unwrap_or_default()), "{topic}: {found}");
    }
}

const LUX: &str = "lux = illuminance_lx(";
const BOUND: &str = "\"error_bound_lx\": 1e-12 * lux";
const APPEND: &str = "        readings.append";
const SEEDED: (&str, &str) = ("def answer(job):", "import random\n\n\ndef answer(job):");

#[test]
fn a_right_adapter_is_sound_in_all_that_it_says_that_it_can() {
    let answer = examined(&[]);
    assert_eq!(answer.code, Some(0), "{}\n{}", answer.stdout, answer.stderr);
    assert!(answer.stdout.contains("conformance: inverse square 1, protocol 2 (batch)"), "{}", answer.stdout);
    for topic in ["protocol", "meters", "units", "orientation", "noise", "claims"] {
        assert!(section(&answer, topic).starts_with("sound"), "{}", answer.stdout);
    }
    for (topic, why) in [("shadows", "no `obstacles`"), ("reflected light", "no `bounces`")] {
        let found = section(&answer, topic);
        assert!(found.starts_with("not examined") && found.contains(why), "{found}");
    }
}

/// Which number stands for which fault is tested in `diagnosis::tests`, without a program.
#[test]
fn wrong_units_are_named() {
    assert_reported(&[(LUX, "lux = 4 * math.pi * illuminance_lx(")], &[("units", "factor 4 pi")]);
    assert_reported(&[(LUX, "lux = 1.03 * illuminance_lx(")], &[("units", "factor 1.0300, none of those known")]);
}

#[test]
fn tables_luminaires_and_meters_that_point_elsewhere_are_named() {
    for (from, to, says) in [
        ("math.atan2(y, x)) % 360.0", "math.atan2(-y, x)) % 360.0", "C runs the other way round"),
        ("for axis in lamp[\"axes\"])", "for axis in zip(*lamp[\"axes\"]))", "rotation is applied the wrong way round"),
        ("max(cosine, 0.0)", "abs(cosine)", "light from behind a meter counts, too"),
    ] {
        assert_reported(&[(from, to)], &[("orientation", says)]);
    }
}

/// What a program that is written anew gets wrong beside the list of known faults.
#[test]
fn faults_of_axes_tables_and_luminaires_are_named() {
    let interpolated = "    (g, v), (c, u) = gamma, plane\n";
    let coarse = format!("{interpolated}    u, v = round(u), round(v)\n");
    let rotation = "    x, y, z = (sum(a * r for a, r in zip(axis, ray)) for axis in lamp[\"axes\"])\n";
    let untilted = "    a = math.atan2(lamp[\"axes\"][2][1], lamp[\"axes\"][2][0])\n    roll = math.atan2(lamp[\"axes\"][1][2], -lamp[\"axes\"][0][2])\n    \
                    a += roll\n    axes = [[math.cos(a), math.sin(a), 0], [-math.sin(a), math.cos(a), 0], [0, 0, 1]]\n    \
                    x, y, z = (sum(p * r for p, r in zip(axis, ray)) for axis in axes)\n";
    let meter = "illuminance_lx(job[\"luminaires\"], meter)";
    let exchanged = "illuminance_lx(job[\"luminaires\"], {key: [meter[key][k] for k in (0, 2, 1)] for key in (\"position_m\", \"normal\")})";
    for (from, to, topic, says) in [
        (interpolated, coarse.as_str(), "orientation", "the table is not interpolated"),
        (rotation, untilted, "orientation", "tilt of luminaires is left out"),
        (meter, exchanged, "orientation", "x, y, z of meters and their normals are taken as x, z, y"),
        ("/ square\n", "/ square ** 1.5\n", "units", "the third power of distance"),
    ] {
        let answer = examined(&[(from, to)]);
        let found = section(&answer, topic);
        assert!(found.starts_with("WRONG") && found.contains(says), "{says}: {}", answer.stdout);
    }
    let last = "illuminance_lx(job[\"luminaires\"][-1:], meter)";
    let answer = examined(&[(meter, last)]);
    assert!(section(&answer, "orientation").contains("the last alone gives light"), "{}", answer.stdout);
}

#[test]
fn meters_that_read_nothing_without_a_known_cause_are_listed_with_their_normals() {
    let answer = examined(&[(LUX, "lux = 0.0 if 0.5 < meter[\"normal\"][0] < 0.9 else illuminance_lx(")]);
    let line = answer.stdout.lines().find(|line| line.contains("0 is read at ")).unwrap_or_default();
    assert!(line.contains("] (normal [0.") && line.contains("nothing that is known explains it"), "{}", answer.stdout);
}

#[test]
fn readings_that_are_right_elsewhere_are_reported_with_their_meter() {
    let answers = "    return {\"answers\": [{\"job\": job[\"job\"], **answer(job)} for job in request[\"jobs\"]]}";
    let shifted = "    done = [answer(job) for job in request[\"jobs\"]]
    all = [r[\"illuminance_lx\"] for one in done for r in one.get(\"readings\", [])]
    all = all[1:] + all[:1]
    for one in done:
        for reading in one.get(\"readings\", []):
            reading[\"illuminance_lx\"] = all.pop(0)
    return {\"answers\": [{\"job\": job[\"job\"], **one} for job, one in zip(request[\"jobs\"], done)]}";
    let readings = "    return {\"readings\": readings,";
    let swapped = "    if len(readings) > 2:\n        one, other = readings[1], readings[2]\n        \
                   one[\"illuminance_lx\"], other[\"illuminance_lx\"] = other[\"illuminance_lx\"], one[\"illuminance_lx\"]\n    \
                   return {\"readings\": readings,";
    for (from, to, topic, says) in [
        (answers, shifted, "claims", "its readings depend on what else it is asked"),
        (readings, swapped, "meters", "[1] reads what [2] should, [2] reads what [1] should"),
    ] {
        let answer = examined(&[(from, to)]);
        let found = section(&answer, topic);
        assert!(found.starts_with("WRONG") && found.contains(says), "{says}: {}", answer.stdout);
    }
}

#[test]
fn missing_meters_and_invalid_numbers_are_reported() {
    let last = "    return {\"readings\": readings,";
    for (from, to, says) in [
        (last, "    return {\"readings\": readings[:-1],", "readings for"),
        (LUX, "lux = float(\"nan\") if meter[\"id\"].endswith(\"[2]\") else illuminance_lx(", "read NaN lx"),
    ] {
        assert_reported(&[(from, to)], &[("meters", says)]);
    }
}

#[test]
fn noise_that_is_not_as_stated_and_false_claims_are_reported() {
    let noisy = |stated: f64| {
        format!(
            "        error = 1e-3 * lux\n        lux += error * random.Random(f\"{{job['seed']}} {{meter['id']}}\").gauss(0, 1)\n        \
             error *= {stated}\n{APPEND}"
        )
    };
    let sampled = "\"std_error_lx\": error, \"degrees_of_freedom\": 60";
    let honest = examined(&[SEEDED, (APPEND, &noisy(1.0)), (BOUND, sampled)]);
    assert!(section(&honest, "noise").starts_with("sound"), "{}", honest.stdout);
    assert_reported(&[SEEDED, (APPEND, &noisy(0.2)), (BOUND, sampled)], &[("noise", "times too small")]);
    // At some meters none is stated, and they scatter like the others.
    let some = "\"std_error_lx\": 0 if meter[\"id\"].endswith(\"2]\") else error, \"degrees_of_freedom\": 60";
    assert_reported(&[SEEDED, (APPEND, &noisy(1.0)), (BOUND, some)], &[("claims", "an error of zero at")]);
    assert_reported(
        &[SEEDED, (APPEND, &noisy(1.0)), (BOUND, "\"exact\": True")],
        &[("claims", "claims readings without any scatter")],
    );
}

/// Within the tolerance nothing fails, and nothing scatters: yet what is claimed does not hold.
#[test]
fn bounds_that_exclude_known_values_are_reported() {
    let off = (LUX, "lux = 1.004 * illuminance_lx(");
    for claim in ["\"error_bound_lx\": 1e-3 * lux", "\"exact\": True"] {
        let says = "readings that it calls exact or bounded are off by more than that, by 4.0e-3";
        assert_reported(&[off, (BOUND, claim)], &[("claims", says)]);
    }
    assert_eq!(examined(&[off, (BOUND, "\"error_bound_lx\": 5e-3 * lux")]).code, Some(0));
    // What rounding leaves of a right angle is no light.
    assert_eq!(examined(&[("max(cosine, 0.0)", "max(cosine, 1e-17)")]).code, Some(0));
}

#[test]
fn a_broken_protocol_is_reported() {
    let probe = "    if request[\"verb\"] == \"probe\":\n";
    assert_reported(
        &[(probe, &format!("{probe}        return {{\"protocol\": 7}}\n"))],
        &[("protocol", "`protocol: 7` is not supported")],
    );
    assert_reported(
        &[("[\"batch\"]", "[\"batch\", \"shadow\"]")],
        &[("protocol", "capabilities that are not known: shadow")],
    );
    let after = ("sys.stdout)", "sys.stdout)\nprint(\"done\")");
    assert_reported(&[after], &[("protocol", "it prints `done` after its answer")]);
    let quoted = ("\"illuminance_lx\": lux,", "\"illuminance_lx\": str(lux),");
    assert_reported(&[quoted], &[("protocol", "illuminance_lx`: no number, where one belongs")]);
    let one = "    assert request[\"verb\"] == \"probe\" or len(request[\"jobs\"]) == 1, \"one job at a time\"\n";
    assert_reported(&[(probe, &format!("{one}{probe}"))], &[("protocol", "its capabilities have `batch`, but")]);
    // One scene alone ends it: that of several luminaires.
    let crash = "def answer(job):\n    assert len(job[\"luminaires\"]) == 1, \"one lamp at a time\"\n";
    assert_reported(&[("def answer(job):\n", crash)], &[("protocol", "one lamp at a time")]);
    let folder = Folder::new(&[]);
    folder
        .luxproof(&["engines", "doctor", "--adapter", "./gone"])
        .exits(3)
        .prints("neither beside the spec nor on PATH");
    folder
        .luxproof(&["--untrusted", "engines", "doctor", "--adapter", "true"])
        .exits(2)
        .complains("--adapter starts a program");
    // What follows the command is luxproof's own, or it is said what to do.
    let unquoted = ["engines", "doctor", "--adapter", "python3", "mine.py"];
    folder.luxproof(&unquoted).exits(2).complains("arguments in quotes: --adapter \"python3");
    folder.luxproof(&["engines", "doctor", "--adapter", "./gone", "--out", "kept"]).exits(3);
    assert!(folder.path("kept").is_dir());
}
