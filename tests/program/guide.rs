//! README and the guide in docs/: every command in them runs, in the order of docs/SUMMARY.md, with the engines that it names.
//!
//! Blocks marked `console` hold commands behind `$ `; a block marked `yaml NAME` is a file that the commands after it use. All
//! commands run in one folder that looks like the root of a checkout. Four things differ from what a reader does: `cargo install`
//! builds what `cargo test` has built already, `ci/nightly` gets that program by LUXPROOF, `panel.ies` of README is a
//! reference luminaire, and `xdg-open` opens nothing.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::process::Command;

use crate::support::{Answer, Folder, root};

/// README and the pages of the guide, in their order.
fn pages() -> Vec<String> {
    let summary = fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let listed =
        summary.split("](").skip(1).filter_map(|rest| rest.split(')').next()).map(|page| format!("docs/{page}"));
    std::iter::once("README.md".to_owned()).chain(listed).collect()
}

/// A step of the guide.
#[derive(Debug, PartialEq)]
enum Step {
    /// A command, and the lines that stand below it.
    Run(String, Vec<String>),
    Write(String, String),
}

/// The steps of a page.
fn steps(page: &str) -> Vec<Step> {
    let mut steps = vec![];
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        let Some(info) = line.strip_prefix("```").filter(|i| !i.is_empty()) else { continue };
        let block: Vec<&str> = lines.by_ref().take_while(|l| *l != "```").collect();
        match info.split_once(' ') {
            None if info == "console" => {
                let mut commands =
                    block.split(|l| l.starts_with("$ ")).skip(1).map(|of| of.iter().map(|l| (*l).to_owned()).collect());
                let shown = block.iter().filter_map(|l| l.strip_prefix("$ ")).map(str::to_owned);
                steps.extend(shown.map(|command| Step::Run(command, commands.next().unwrap_or_default())));
            }
            Some(("yaml" | "text", name)) => steps.push(Step::Write(name.to_owned(), block.join("\n") + "\n")),
            _ => (),
        }
    }
    steps
}

#[test]
fn steps_are_the_commands_and_files_of_a_page() {
    let page = "text\n```console\n$ one two\noutput\n$ three\n```\n```yaml a.yaml\nb: 1\n```\n```text\n$ no\n```\n";
    let run = |c: &str, shown: &[&str]| Step::Run(c.to_owned(), shown.iter().map(|l| (*l).to_owned()).collect());
    let write = Step::Write("a.yaml".to_owned(), "b: 1\n".to_owned());
    assert_eq!(steps(page), [run("one two", &["output"]), run("three", &[]), write]);
}

/// A folder like the root of a checkout, with `luxproof` and `cargo` on its own path.
fn checkout() -> Folder {
    let folder = Folder::for_renderers(&[]);
    for name in ["reference", "ci", "docs", "harness", "Cargo.toml", "README.md"] {
        symlink(root().join(name), folder.path(name)).unwrap();
    }
    let bin = folder.path("bin");
    fs::create_dir(&bin).unwrap();
    symlink(env!("CARGO_BIN_EXE_luxproof"), bin.join("luxproof")).unwrap();
    // Compiled it is already.
    let cargo = format!(
        "#!/bin/sh\n[ \"$*\" = 'install --locked --path harness/luxproof' ] || exit 2\nexec {} metadata --locked --no-deps --format-version 1 --manifest-path {}/harness/luxproof/Cargo.toml > /dev/null\n",
        env!("CARGO"),
        root().display()
    );
    // No test opens a browser.
    for (name, script) in [("cargo", cargo.as_str()), ("xdg-open", "#!/bin/sh\n")] {
        fs::write(bin.join(name), script).unwrap();
        fs::set_permissions(bin.join(name), fs::Permissions::from_mode(0o755)).unwrap();
    }
    folder
}

/// Every line of the report that README shows is printed, apart from its numbers and widths.
fn prints_what_the_readme_shows(readme: &str, stdout: &str) {
    let shown = readme.split("```text\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let printed: Vec<String> = stdout.lines().map(without_numbers).collect();
    // The title also names the commit and whether sources differ from it.
    let missing: Vec<&str> = shown.lines().skip(1).filter(|line| !printed.contains(&without_numbers(line))).collect();
    assert!(
        shown.lines().count() >= 10 && missing.is_empty(),
        "README shows what no run prints: {missing:#?}\n{stdout}"
    );
}

/// The words of a line that have no digit.
fn without_numbers(line: &str) -> String {
    let words = line.split_whitespace().filter(|word| !word.contains(|c: char| c.is_ascii_digit()));
    words.collect::<Vec<_>>().join(" ")
}

#[test]
fn every_command_of_the_guide_runs() {
    let folder = checkout();
    fs::create_dir(folder.path("luxproof-out")).unwrap();
    fs::copy(root().join("reference/luminaires/lambertian-06m.ies"), folder.path("panel.ies")).unwrap();
    let path = format!("{}:{}", folder.path("bin").display(), std::env::var("PATH").unwrap());
    let mut count = 0;
    for name in pages() {
        let page = fs::read_to_string(root().join(&name)).unwrap();
        for step in steps(&page) {
            match step {
                Step::Write(file, text) => folder.write(&file, &text),
                Step::Run(command, shown) => {
                    let mut shell = Command::new("sh");
                    shell.args(["-c", &command]).current_dir(folder.path("")).env("PATH", &path);
                    shell.env("LUXPROOF", env!("CARGO_BIN_EXE_luxproof")).env("LUXPROOF_CACHE", folder.path("cache"));
                    let Answer { code, stdout, stderr } = Answer::of(&mut shell);
                    assert_eq!(code, Some(0), "{name}: `{command}`\n{stdout}\n{stderr}");
                    if name == "README.md" && command.starts_with("luxproof run ") {
                        prints_what_the_readme_shows(&page, &stdout);
                    }
                    for line in shown {
                        let is_it = |printed: &str| {
                            let (head, tail) = line.split_once("...").unwrap_or((&line, ""));
                            printed.starts_with(head)
                                && printed.ends_with(tail)
                                && (line.contains("...") || printed == line)
                        };
                        assert!(stdout.lines().any(is_it), "{name}: `{command}` prints no `{line}`\n{stdout}");
                    }
                    count += 1;
                }
            }
        }
    }
    assert!(count >= 20, "only {count} commands were found");
    // What the pages say is there, is there.
    for file in [
        "5.2-point/report.html",
        "5.3-area/junit.xml",
        "spec.schema.json",
        "mine-site/index.html",
        "shared.zip",
        "try/site/index.html",
    ] {
        let length = fs::metadata(folder.path("luxproof-out").join(file)).map(|m| m.len());
        assert!(length.is_ok_and(|l| l > 100), "{file}");
    }
    let history = folder.read("luxproof-out/try/history.jsonl");
    assert!(history.contains("\"night\":\"2026-01-31\"") && history.contains("\"night\":\"2026-02-01\""));
}

#[test]
fn links_between_the_pages_lead_somewhere() {
    let mut count = 0;
    for name in pages() {
        let page = fs::read_to_string(root().join(&name)).unwrap();
        let folder = root().join(&name).parent().unwrap().to_owned();
        for target in page.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = target.split('#').next().unwrap();
            if !file.is_empty() && !file.contains("://") {
                assert!(folder.join(file).exists(), "{name}: {target}");
                count += 1;
            }
        }
    }
    assert!(count >= 100, "only {count} links were found");
}
