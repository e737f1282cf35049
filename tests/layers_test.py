"""Whether ci/layers fails where it should, and only there: small trees of two crates, each planted with one fault."""

import subprocess
import tempfile
import unittest
from pathlib import Path

LAYERS = Path(__file__).resolve().parent.parent / "ci" / "layers"
CLEAN = {
    "src/lib.rs": "pub mod scene;\npub mod units;\n",
    "src/scene.rs": "use crate::units::Lux;\npub struct Scene { lux: Lux }\n",
    "src/units.rs": "pub struct Lux;\n",
    "harness/src/lib.rs": "pub mod judge;\npub mod record;\npub mod report;\n",
    "harness/src/main.rs": "use luxproof::report;\nfn main() { report::draw(); }\n",
    "harness/src/record.rs": "pub struct Reading;\n",
    "harness/src/judge/mod.rs": "mod rule;\nmod verdict;\npub use verdict::Verdict;\npub struct Task;\n"
    "pub fn judge() -> Verdict { rule::apply(Task) }\n",
    "harness/src/judge/rule.rs": "use super::{Task, Verdict};\npub fn apply(_: Task) -> Verdict { Verdict::Pass }\n",
    "harness/src/judge/verdict.rs": "use crate::record::Reading;\npub enum Verdict { Pass, Reading(Reading) }\n",
    "harness/src/report.rs": "use crate::{judge::{self as court, Verdict}, record};\n"
    "pub fn draw() { let _: (Verdict, record::Reading) = (court::judge(), record::Reading); }\n",
}
ARCHITECTURE = """\
Before.
<!-- layers: begin -->
```text
Lowest first. Beside a module stands what it imports, less what that imports in its turn.
luminaire
    units
    scene  units
luxproof
    record
    judge    record
    report   judge
    main.rs  report
```
<!-- layers: end -->
After.
"""


class Layers(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        self.plant({"ARCHITECTURE.md": ARCHITECTURE, **CLEAN})

    def plant(self, files):
        for name, text in files.items():
            file = self.root / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)

    def add(self, name, text):
        self.plant({name: (self.root / name).read_text() + text})

    def layers(self, *options):
        """What it complains of; nothing where it passes."""
        run = subprocess.run([LAYERS, *options, self.root], capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode == 0, run.stderr == "", run.stderr)
        return run.stderr

    def complains(self, *parts):
        complaint = self.layers()
        for part in parts:
            self.assertIn(part, complaint)

    def test_a_clean_tree_passes_and_its_order_is_what_is_written(self):
        self.assertEqual(self.layers(), "")
        block = ARCHITECTURE.index("Lowest"), ARCHITECTURE.index("```\n<!-- layers: end")
        self.plant({"ARCHITECTURE.md": ARCHITECTURE[: block[0]] + ARCHITECTURE[block[1] :]})
        self.complains("ARCHITECTURE.md has another order than the code; run ci/layers --write")
        self.assertEqual(self.layers("--write"), "")
        self.assertEqual((self.root / "ARCHITECTURE.md").read_text(), ARCHITECTURE)

    def test_comments_strings_and_tests_do_not_count(self):
        self.add(
            "harness/src/record.rs",
            """
            //! use crate::judge::Verdict;
            /* crate::judge::judge(); /* crate::report::draw() */ crate::report::draw() */
            const TEXTS: [&str; 3] = ["crate::judge::judge()\\"", r#"" crate::report "#, "// "];
            fn chars<'a>(c: &'a char) -> bool { ['"', '\\'', '\\u{22}'].contains(c) }
            impl Reading { #[cfg(test)] fn judged(&self) { crate::judge::judge(); } }
            #[cfg(test)]
            use crate::judge::Verdict;
            #[cfg(test)]
            #[allow(unused)]
            mod tests { use crate::report::draw; }
            #[cfg(test)]
            mod more_tests;
            """,
        )
        self.plant({"harness/src/record/more_tests.rs": "use crate::report;\n"})
        self.assertEqual(self.layers(), "")

    def test_an_upward_import_fails_where_no_circle_shows_it(self):
        self.plant({"harness/src/report.rs": "pub fn draw() {}\n"})
        self.layers("--write")
        self.add("harness/src/judge/rule.rs", "fn draw() { crate::report::draw(); }\n")
        self.complains("harness/src/judge/rule.rs:3: judge imports report, which lies above it")

    def test_another_order_than_the_recorded_one_fails_until_it_is_written(self):
        self.add("harness/src/lib.rs", "mod files;\n")
        self.plant({"harness/src/files.rs": ""})
        self.complains("ci/layers --write")
        self.assertEqual(self.layers("--write"), "")

    def test_two_files_of_a_folder_that_import_each_other_fail(self):
        self.add("harness/src/judge/verdict.rs", "use super::rule;\n")
        self.complains(
            "a circle in harness/src/judge",
            "rule -> verdict: harness/src/judge/rule.rs:1",
            "verdict -> rule: harness/src/judge/verdict.rs:3",
        )

    def test_a_circle_does_not_hide_behind_a_renamed_reexport(self):
        self.add("harness/src/judge/mod.rs", "pub use rule::apply as decide;\n")
        self.add("harness/src/judge/verdict.rs", "fn again() { crate::judge::decide(todo!()); }\n")
        self.complains("rule -> verdict:", "verdict -> rule: harness/src/judge/verdict.rs:3")

    def test_a_circle_does_not_hide_behind_a_function_of_the_parent(self):
        self.add("harness/src/judge/verdict.rs", "fn again() { super::judge(); }\n")
        self.complains("verdict -> mod.rs's judge", "mod.rs's judge -> rule: harness/src/judge/mod.rs:5")

    def test_a_circle_across_three_folders_is_told_with_each_of_its_imports(self):
        self.add("harness/src/record.rs", "pub fn draw() {\n    crate::report::draw();\n}\n")
        self.plant({"harness/src/report.rs": "pub fn draw() -> crate::judge::Verdict { crate::judge::judge() }\n"})
        self.complains(
            "judge -> record: harness/src/judge/verdict.rs:1",
            "record -> report: harness/src/record.rs:3",
            "report -> judge: harness/src/report.rs:1",
        )

    def test_what_one_file_alone_may_know_fails_elsewhere_under_any_name(self):
        self.add("harness/src/report.rs", "use std::process;\nfn run() { process::Command::new(\"rm\"); }\n")
        self.complains("harness/src/report.rs:4: std::process::Command is for ")

    def test_witnesses_that_confer_fail_by_way_of_others_too(self):
        self.add("src/lib.rs", "mod simulator;\nmod calculators;\n")
        self.plant({"src/calculators.rs": "pub struct Ratio;\n", "src/simulator.rs": "use crate::scene::Scene;\n"})
        self.assertEqual(self.layers("--write"), "")
        self.add("src/scene.rs", "use crate::calculators::Ratio;\n")
        self.complains("simulator and calculators must not know of each other")

    def test_an_import_fails_in_whatever_shape_it_stands(self):
        clean = (self.root / "harness/src/record.rs").read_text()
        for shape in [
            "fn f() { for _ in 0..crate::report::count() {} }",
            "fn f(x: &[u8]) { &x[..=crate::report::COUNT]; }",
            "fn f() -> Reading { Reading { ..crate::report::reading() } }",
            "enum Kind { One }\nmy! { crate::report::draw() }",
            "enum Kind { One }\nstd::thread_local!(static N: u8 = 0, crate::report::draw());",
            '#[serde(with = "crate::report")]\nstruct Kept;',
            "struct Kept { #[cfg(test)] calls: fn(), other: crate::report::Other }",
            "fn f(#[cfg(test)] a: impl Fn(), b: crate::report::Other) {}",
        ]:
            with self.subTest(shape):
                self.plant({"harness/src/record.rs": f"{clean}{shape}\n"})
                self.complains("record imports report, which lies above it")

    def test_qualified_functions_and_statics_of_the_parent_have_their_own_names(self):
        clean = (self.root / "harness/src/judge/mod.rs").read_text()
        self.add("harness/src/judge/verdict.rs", "fn again() { super::again; }\n")
        for shape in ["pub const unsafe fn again() { rule::go() }", "pub static mut again: fn() = rule::go;"]:
            with self.subTest(shape):
                self.plant({"harness/src/judge/mod.rs": f"{clean}{shape}\n"})
                self.complains("mod.rs's again -> rule")

    def test_what_hides_code_from_this_script_fails(self):
        clean = (self.root / "harness/src/record.rs").read_text()
        self.plant({"harness/src/other.rs": "", "harness/src/record/part.rs": ""})
        for shape, says in [
            ('#[path = "other.rs"]\nmod part;', "`path` hides what is imported"),
            ('include!("part.in");', "`include` hides what is imported"),
            ("mod nowhere;", "`mod nowhere` has no file of its name"),
            ("use std::process::*;", "std::process::Command is for"),
            ("fn f() { ::std::process::Command::new(); }", "std::process::Command is for"),
            ("extern crate serde_yaml as y;", "serde_yaml is for"),
            ("fn f() { 0..serde_yaml::x(); }", "serde_yaml is for"),
        ]:
            with self.subTest(shape):
                self.plant({"harness/src/record.rs": f"{clean}{shape}\n"})
                self.complains(says)

    def test_a_glob_of_the_crate_fails(self):
        self.add("harness/src/report.rs", "use crate::judge::*;\n")
        self.complains("harness/src/report.rs:3: `use crate::judge::*` hides what is imported")


if __name__ == "__main__":
    unittest.main()
