//! The code that a program may load: scripts, modules and libraries below the folders that it starts from.

use std::collections::{BTreeSet, VecDeque};
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// More files of code than this are not looked at.
const MOST_FILES: usize = 10_000;
/// Nor are more files and folders of any kind: a spec may lie in somebody's home.
const MOST_ENTRIES: usize = 200_000;

/// What names a script, a module, a library or what these are made of. What compilers leave beside Python's sources is none.
const SUFFIXES: &[&str] = &[
    "awk", "bash", "bat", "beam", "c", "cc", "cjs", "class", "clj", "cpp", "cs", "cts", "cu", "cxx", "dll", "dylib",
    "egg", "erl", "ex", "exe", "exs", "f", "f90", "fish", "go", "groovy", "h", "hpp", "hs", "jar", "java", "jl", "js",
    "jsx", "kt", "kts", "ksh", "lua", "m", "mjs", "ml", "mts", "pas", "php", "pl", "pm", "ps1", "py", "pyd", "pyw",
    "pyx", "pyz", "r", "rb", "rkt", "rs", "scala", "scm", "sed", "sh", "so", "swift", "tcl", "ts", "tsx", "wasm",
    "whl", "zig", "zsh",
];

/// What a run of luxproof writes beside its report: scenes are made of a job, and are no code of the program's.
const OUTPUT: &[&str] = &["logs", "readings", "scenes"];

/// Code below some folders, the nearest first.
pub(super) struct Code {
    /// Each with its name from the folder that it lies below.
    pub(super) files: Vec<(PathBuf, PathBuf)>,
    /// Whether that is all there is.
    pub(super) is_all: bool,
}

/// The code below these folders, links followed; `except` and what lies below it is somebody else's.
pub(super) fn below(roots: &[PathBuf], except: &Path) -> Code {
    let mut code = Code { files: vec![], is_all: true };
    // What was seen by its real place: links may lead in circles.
    let mut seen: BTreeSet<PathBuf> = except.canonicalize().into_iter().collect();
    let mut looked_at = 0;
    let mut waiting: VecDeque<(&Path, PathBuf)> = roots.iter().map(|root| (root.as_path(), root.clone())).collect();
    while let Some((root, folder)) = waiting.pop_front() {
        if !folder.canonicalize().is_ok_and(|real| seen.insert(real)) {
            continue;
        }
        let mut entries: Vec<PathBuf> =
            folder.read_dir().into_iter().flatten().flatten().map(|e| e.path()).take(MOST_ENTRIES).collect();
        entries.sort();
        looked_at += entries.len();
        let is_of_a_run = is_of_a_run(&folder);
        for path in entries {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let Ok(data) = path.metadata() else { continue };
            if data.is_dir() {
                let is_output = is_of_a_run && OUTPUT.contains(&name.as_str());
                if !name.starts_with('.') && name != "__pycache__" && !is_output {
                    waiting.push_back((root, path));
                }
            } else if is_code(&path) {
                code.files.push((path.strip_prefix(root).unwrap_or(&path).to_owned(), path));
            }
        }
        if code.files.len() > MOST_FILES || looked_at >= MOST_ENTRIES {
            code.files.truncate(MOST_FILES);
            code.is_all = false;
            break;
        }
    }
    code
}

/// By its suffix, or as an executable file without one; a version is none.
pub(super) fn is_code(path: &Path) -> bool {
    let Ok(data) = path.metadata() else { return false };
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let suffix = Path::new(&name).extension().and_then(|s| s.to_str()).unwrap_or_default();
    let is_version = suffix.chars().all(|c| c.is_ascii_digit());
    let is_executable = data.permissions().mode() & 0o111 != 0;
    data.is_file() && (SUFFIXES.contains(&suffix) || name.contains(".so.") || is_version && is_executable)
}

/// Whether luxproof wrote into this folder: its report tells, or all folders of a run that was killed before.
fn is_of_a_run(folder: &Path) -> bool {
    let mut head = [0; 64];
    let read = File::open(folder.join("report.json")).and_then(|mut file| file.read(&mut head)).unwrap_or(0);
    let head: String = String::from_utf8_lossy(&head[..read]).split_whitespace().collect();
    head.starts_with("{\"luxproof\":") || OUTPUT.iter().all(|name| folder.join(name).is_dir())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    fn names(roots: &[PathBuf], except: &Path) -> Vec<String> {
        below(roots, except).files.into_iter().map(|(name, _)| name.display().to_string()).collect()
    }

    #[test]
    fn code_is_found_at_any_depth_and_nothing_else_is() {
        let kept = tempfile::tempdir().unwrap();
        let folder = kept.path().join("spec");
        for path in [
            "run.sh",
            "a/b/c/deep.PY",
            "lib/libm.so.6",
            "table.txt",
            "job.json",
            "a/x.pyc",
            "tool",
            "tool-1.2",
            "data",
            ".git/hook.sh",
            "a/__pycache__/x.py",
            "engines/driver.py",
            "out/scenes/mine/made.py",
            "out/logs/x.sh",
            "out/kept.py",
            "killed/scenes/made.py",
            "killed/logs/x",
            "killed/readings/x",
            "scenes/mine.py",
        ] {
            fs::create_dir_all(folder.join(path).parent().unwrap()).unwrap();
            fs::write(folder.join(path), "one").unwrap();
        }
        fs::write(folder.join("out/report.json"), "{\n  \"luxproof\": 1,\n  \"engines\": []\n}").unwrap();
        for tool in ["tool", "tool-1.2"] {
            fs::set_permissions(folder.join(tool), fs::Permissions::from_mode(0o755)).unwrap();
        }
        let roots = [folder.clone(), folder.join("a")];
        let mut wanted =
            vec!["run.sh", "tool", "tool-1.2", "lib/libm.so.6", "out/kept.py", "scenes/mine.py", "b/c/deep.PY"];
        wanted.sort_unstable();
        let mut found = names(&roots, &folder.join("engines"));
        found.sort_unstable();
        assert_eq!(found, wanted);
        // A folder that is linked counts, and no circle is gone round twice.
        let elsewhere = kept.path().join("elsewhere");
        fs::create_dir(&elsewhere).unwrap();
        fs::write(elsewhere.join("linked.py"), "").unwrap();
        symlink(&elsewhere, folder.join("vendor")).unwrap();
        symlink(&folder, elsewhere.join("circle")).unwrap();
        assert_eq!(names(std::slice::from_ref(&folder), &folder.join("engines")).len(), wanted.len() + 1);
    }

    #[test]
    fn a_folder_with_too_many_files_is_marked_incomplete() {
        let folder = tempfile::tempdir().unwrap();
        let roots = [folder.path().to_owned()];
        fs::write(folder.path().join("a.py"), "").unwrap();
        assert!(below(&roots, Path::new("/none")).is_all);
        for k in 0..MOST_FILES {
            fs::write(folder.path().join(format!("{k}.py")), "").unwrap();
        }
        let code = below(&roots, Path::new("/none"));
        assert!(!code.is_all && code.files.len() == MOST_FILES);
    }
}
