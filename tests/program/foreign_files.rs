//! Files that a command line names beside files of a stranger: no link leads elsewhere, no pipe is waited for, no folder
//! of links is walked for ever.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::cards::{CAPABILITIES, DIRECT};
use crate::support::{Answer, Folder, LAMP, OWN, ROOM, TWO_METERS};

const SECRET: &str = "SECRET-4c07";

/// A command that takes longer than this waits for something.
const PATIENCE: Duration = Duration::from_secs(60);

fn room() -> Folder {
    Folder::new(&[("spec.yaml", &[ROOM, TWO_METERS, DIRECT].concat()), ("lamp.ies", LAMP)])
}

/// What a command says, which must end in time.
#[track_caller]
fn answer_in_time(mut command: Command) -> Answer {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("it waits for ever: {command:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().unwrap().into()
}

fn make_pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// A folder outside of what a stranger gave, with a secret under each of these names.
fn outside(names: &[&str]) -> Folder {
    let folder = Folder::new(&[]);
    for name in names {
        folder.write(name, &format!("{SECRET}: {SECRET}\n"));
    }
    folder
}

/// Asserts a refusal for a link, which shows no word of the file that the link leads to.
#[track_caller]
fn refuses_link(answer: Answer) {
    let answer = answer.exits(2);
    assert!(answer.message().contains("a link"), "{answer:?}");
    assert!(!(answer.stdout.clone() + &answer.stderr).contains(SECRET), "{answer:?}");
}

#[test]
fn printed_tables_and_studies_that_are_not_trusted_are_no_links_and_not_quoted() {
    let (folder, secret) = (room(), outside(&["study.yaml"]));
    let target = secret.path("study.yaml");
    fs::create_dir(folder.path("study")).unwrap();
    symlink(&target, folder.path("study/study.yaml")).unwrap();
    symlink(&target, folder.path("copy.yaml")).unwrap();
    fs::create_dir(folder.path("plain")).unwrap();
    for name in ["plain/study.yaml", "plain.yaml"] {
        fs::copy(&target, folder.path(name)).unwrap();
    }
    let commands: [(&[&str], &[&str]); 2] = [
        (&["reproduce", "study"], &["reproduce", "plain"]),
        (&["reproduce", "cie171", "--printed", "copy.yaml"], &["reproduce", "cie171", "--printed", "plain.yaml"]),
    ];
    for (linked, plain) in commands {
        refuses_link(folder.luxproof(&[&["--untrusted"], linked].concat()));
        let answer = folder.luxproof(&[&["--untrusted"], plain].concat()).exits(2);
        assert!(!answer.stderr.contains(SECRET), "{answer:?}");
        // The user's own are shown.
        folder.luxproof(linked).exits(2).complains(SECRET);
    }
}

#[test]
fn plans_scenes_photometry_and_reports_that_are_not_trusted_are_no_links() {
    let (folder, secret) = (room(), outside(&["plan.json", "scene.obj", "lamp.ies", "report.json"]));
    for name in ["plan.json", "scene.obj"] {
        symlink(secret.path(name), folder.path(name)).unwrap();
    }
    fs::create_dir(folder.path("run")).unwrap();
    symlink(secret.path("report.json"), folder.path("run/report.json")).unwrap();
    symlink(secret.path(""), folder.path("linked")).unwrap();
    folder.write("capabilities.yaml", CAPABILITIES);
    let job = format!("iesna/{}", "0".repeat(64));
    let commands: [&[&str]; 7] = [
        &["read", &job],
        &["import", "scene.obj", "--out", "made"],
        &["import", "linked/scene.obj", "--out", "made"],
        &["photometry", "linked/lamp.ies"],
        &["photometry", "report", "linked/lamp.ies"],
        &["bundle", "run", "--out", "b"],
        &["cards", "run", "--capabilities", "capabilities.yaml", "--out", "site"],
    ];
    for command in commands {
        refuses_link(folder.luxproof(&[&["--untrusted"], command].concat()));
    }
}

#[test]
fn nothing_is_written_through_a_link_beside_files_of_a_stranger() {
    let (folder, elsewhere) = (room(), Folder::new(&[]));
    symlink(elsewhere.path(""), folder.path("linked")).unwrap();
    let commands: [&[&str]; 4] = [
        &["photometry", "lamp.ies", "--convert", "linked/lamp.ldt"],
        &["photometry", "lamp.ies", "--polar", "linked/lamp.svg"],
        &["photometry", "orient", "lamp.ies", "--turn", "90", "--out", "linked/lamp.ies"],
        &["photometry", "report", "lamp.ies", "--svg", "linked"],
    ];
    for command in commands {
        refuses_link(folder.luxproof(&[&["--untrusted"], command].concat()));
        assert_eq!(fs::read_dir(elsewhere.path("")).unwrap().count(), 0, "{command:?}");
        folder.luxproof(command).exits(0);
        fs::remove_file(fs::read_dir(elsewhere.path("")).unwrap().next().unwrap().unwrap().path()).unwrap();
        for left in fs::read_dir(elsewhere.path("")).unwrap() {
            fs::remove_file(left.unwrap().path()).unwrap();
        }
    }
}

#[test]
fn a_site_with_links_takes_no_submission_that_is_not_trusted() {
    let (folder, secret) = (room(), outside(&["report.json"]));
    folder.write("capabilities.yaml", CAPABILITIES);
    folder.run(&["--engines", OWN]).exits(0);
    folder.luxproof(&["bundle", "out", "--out", "b"]).exits(0);
    folder.luxproof(&["cards", "out", "--capabilities", "capabilities.yaml", "--out", "site"]).exits(0);
    let run = fs::read_dir(folder.path("site/runs")).unwrap().next().unwrap().unwrap().path();
    fs::remove_file(run.join("report.json")).unwrap();
    symlink(secret.path("report.json"), run.join("report.json")).unwrap();
    let answer = folder.luxproof(&["--untrusted", "cards", "add", "b", "--site", "site"]).exits(2);
    // It is refused before the link is read, which would be no report.
    assert!(answer.message().contains("report.json is a link"), "{answer:?}");
}

#[test]
fn no_pipe_is_waited_for() {
    let folder = room();
    make_pipe(&folder.path("bundle.zip"));
    fs::create_dir(folder.path("bundle")).unwrap();
    make_pipe(&folder.path("bundle/ro-crate-metadata.json"));
    for bundle in ["bundle.zip", "bundle/ro-crate-metadata.json"] {
        let answer = answer_in_time(folder.command(&["reproduce", bundle])).exits(2);
        assert!(answer.message().contains("it is no regular file"), "{answer:?}");
    }
    fs::create_dir(folder.path("out")).unwrap();
    make_pipe(&folder.path("out/.unfinished-pipe"));
    let run = ["run", "spec.yaml", "--engines", OWN, "--no-calibration", "--format", "html", "--out", "out"];
    answer_in_time(folder.command(&run)).exits(0);
    // The page of a run of a stranger is not written into a pipe.
    fs::remove_file(folder.path("out/report.html")).unwrap();
    make_pipe(&folder.path("out/report.html"));
    let answer = answer_in_time(folder.command(&[&run[..], &["--untrusted"]].concat())).exits(2);
    assert!(answer.message().contains("it is no regular file, and the specs are not trusted"), "{answer:?}");
}

#[test]
fn a_pattern_of_a_stranger_follows_no_linked_folder() {
    let (folder, secret) = (room(), outside(&["name-of-a-secret.yaml"]));
    for name in ["a", "b", "c"] {
        symlink(".", folder.path(name)).unwrap();
    }
    symlink(secret.path(""), folder.path("elsewhere")).unwrap();
    fs::create_dir_all(folder.path("deep/er")).unwrap();
    fs::copy(folder.path("lamp.ies"), folder.path("deep/er/lamp.ies")).unwrap();
    fs::copy(folder.path("spec.yaml"), folder.path("deep/er/other.yaml")).unwrap();
    for pattern in ["**/*.yaml", "*/*/*.yaml", "deep/*/*.yaml", "./**/other.yaml", "*/*/*/*/*/*/*/*/*/*/*/*/*/*.yaml"] {
        let answer = answer_in_time(folder.command(&["check", "--untrusted", pattern, "--engines", OWN]));
        assert!(!answer.stderr.contains("name-of-a-secret"), "{pattern}: {answer:?}");
        if pattern.contains("/*/*/*/*") {
            refuses_link(answer);
        } else {
            answer.exits(0).prints("other (deep/er/other.yaml)");
        }
    }
    // A folder that is a link itself is not listed.
    refuses_link(folder.luxproof(&["check", "--untrusted", "elsewhere", "--engines", OWN]));
}

/// An archive of files that hold nothing.
fn archive(path: &Path, names: impl Iterator<Item = String>) {
    let mut zip = zip::ZipWriter::new(fs::File::create(path).unwrap());
    let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for name in names {
        zip.start_file(name, stored).unwrap();
    }
    zip.finish().unwrap();
}

#[test]
fn an_archive_of_countless_folders_or_endless_lists_is_not_unpacked() {
    let folder = Folder::new(&[]);
    archive(&folder.path("deep.zip"), (0..6).map(|k| format!("{k}/{}file", "x/".repeat(1900))));
    let answer = answer_in_time(folder.command(&["reproduce", "deep.zip"])).exits(2);
    assert!(answer.message().contains("more than 10000 folders"), "{answer:?}");
    archive(&folder.path("long.zip"), (0..4000).map(|k| format!("{k:04}{}", "x".repeat(4000))));
    let answer = answer_in_time(folder.command(&["reproduce", "long.zip"])).exits(2);
    assert!(answer.message().contains("its list of files is too long"), "{answer:?}");
}

#[test]
fn a_policy_requires_a_few_engines() {
    let folder = room();
    let engines: Vec<String> = (0..101).map(|k| format!("engine-{k}")).collect();
    folder.write("luxproof.yaml", &format!("required_engines: [{}]\n", engines.join(", ")));
    for trust in [&[][..], &["--untrusted"]] {
        let answer = folder.luxproof(&[&["check", "spec.yaml", "--engines", OWN], trust].concat()).exits(2);
        assert!(answer.message().contains("requires more than 100 engines"), "{answer:?}");
    }
    folder.write("luxproof.yaml", &format!("required_engines: [{}]\n", engines[1..].join(", ")));
    let answer = folder.luxproof(&["check", "spec.yaml", "--engines", OWN]).exits(3);
    assert_eq!(answer.stdout.matches("REQUIRED").count(), 100);
}
