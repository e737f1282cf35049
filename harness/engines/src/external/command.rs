//! Analysis of an adapter's command: the program's own files, and the runners that only start them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::code;
use luxproof_process::digest::hexadecimal;

/// Programs that run other programs, without version numbers.
const RUNNERS: &[&str] = &[
    "awk", "bash", "bun", "cargo", "conda", "dash", "deno", "docker", "dotnet", "env", "fish", "java", "julia", "ksh",
    "lua", "luajit", "make", "mono", "nice", "node", "npx", "octave", "perl", "php", "podman", "poetry", "pypy",
    "python", "r", "rscript", "ruby", "sh", "ssh", "stdbuf", "time", "timeout", "uv",
];

/// Words that make a line load another file, in the usual languages of adapters.
const IMPORTING: &[&str] = &[
    "import",
    "from",
    "require",
    "require_relative",
    "include",
    "use",
    "using",
    "source",
    "load",
    "library",
    "mod",
    "import_module",
    "__import__",
    "dofile",
    "run_path",
    "runpy",
    "exec",
    "open",
];

/// Options with a program's source text as their value.
const INLINE: &[&str] = &["-c", "-e", "-E", "-lc", "--eval"];

/// Returns the file that a word of a command names. A program without a folder is no such file, because PATH decides.
pub(super) fn file(folder: &Path, k: usize, word: &str) -> Option<PathBuf> {
    Some(folder.join(word)).filter(|path| (k > 0 || word.contains('/')) && path.is_file())
}

/// Returns the program's own files that a command names: as words, within quoted commands, as values of options, and as Python modules.
pub(super) fn own_files(command: &[String], folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for (k, word) in command.iter().enumerate() {
        let parts = word.split(|c: char| c.is_whitespace() || "'\"=;&|()<>".contains(c));
        let words = std::iter::once(word.as_str()).chain(parts.filter(|part| !part.is_empty()));
        let after_m = k > 0 && command[k - 1] == "-m";
        let named = words.filter_map(|word| file(folder, k, word));
        let named = named.chain(after_m.then(|| module(folder, word)).flatten());
        for path in named.filter(|path| !is_runner_file(path)) {
            if !found.contains(&path) {
                found.push(path);
            }
        }
    }
    found
}

/// Returns the file of a Python module.
fn module(folder: &Path, name: &str) -> Option<PathBuf> {
    let place = name.replace('.', "/");
    let files = [format!("{place}.py"), format!("{place}/__main__.py")];
    files.into_iter().map(|file| folder.join(file)).find(|path| path.is_file())
}

/// Returns the source text of a program that the command passes to a runner as a word.
fn inline(command: &[String]) -> Option<&String> {
    let option = command.windows(2).find(|pair| INLINE.contains(&pair[0].as_str()))?;
    is_runner(&command[0]).then_some(&option[1])
}

/// Returns whether it is unknown what a command runs: it names a runner, but no program for it.
pub(super) fn is_unknown(command: &[String], folder: &Path) -> bool {
    is_runner(&command[0]) && own_files(command, folder).is_empty() && inline(command).is_none()
}

/// Returns a hash or name for each file, program or text that makes the readings, whatever its path and however it is started.
///
/// Files that the named files import from their folders count, too.
pub(super) fn parts(command: &[String], folder: &Path) -> BTreeSet<String> {
    let mut parts: BTreeSet<String> = files(command, folder).iter().map(|(_, bytes)| hash(bytes)).collect();
    if !command[0].contains('/') && !is_runner(&command[0]) {
        parts.insert(command[0].clone());
    }
    if parts.is_empty() {
        parts.insert(inline(command).map_or_else(|| contents_of(command, folder), |text| hash(text.as_bytes())));
    }
    parts.into_iter().map(|part| format!("the program {part}")).collect()
}

/// Returns the files that a command names and those that they import from their folders, with their contents.
pub(super) fn files(command: &[String], folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let (mut paths, mut found) = (own_files(command, folder), vec![]);
    let mut next = 0;
    while let Some(path) = paths.get(next).cloned() {
        next += 1;
        // An empty file says nothing about a program: two empty files would make programs equal.
        let Some(bytes) = std::fs::read(&path).ok().filter(|bytes| !bytes.is_empty()) else { continue };
        for path in imports(&path, &bytes) {
            if !paths.contains(&path) {
                paths.push(path);
            }
        }
        found.push((path, bytes));
    }
    found
}

/// Returns the files in or below a source's folder that one of its lines imports, loads or names, in any language.
fn imports(path: &Path, source: &[u8]) -> Vec<PathBuf> {
    let (Some(folder), Ok(text)) = (path.parent(), std::str::from_utf8(source)) else { return vec![] };
    let mut found = vec![];
    for line in text.lines() {
        let words: Vec<&str> =
            line.split(|c| !is_word_character(c)).map(|word| word.trim_matches(['.', '/'])).collect();
        let imports = words.iter().filter_map(|word| word.rsplit('.').next()).any(|last| IMPORTING.contains(&last));
        for word in words.into_iter().filter(|word| !word.is_empty() && !IMPORTING.contains(word)) {
            if word.contains('.') {
                found.extend(Some(folder.join(word)).filter(|path| path.is_file()));
            }
            if imports {
                let module = folder.join(word.replace('.', "/"));
                found.extend(files_of(&module, |_| true));
                if let Some(parent) = module.parent() {
                    found.extend(files_of(parent, |file| file.file_stem() == module.file_name()));
                }
            }
        }
    }
    found.retain(|file| file != path);
    found
}

/// Returns whether a character may be part of a module's name or a file's path.
fn is_word_character(c: char) -> bool {
    c.is_alphanumeric() || "_-./".contains(c)
}

/// Returns the code files directly in a folder, sorted.
fn files_of(folder: &Path, is_wanted: impl Fn(&Path) -> bool) -> Vec<PathBuf> {
    let entries = folder.read_dir().into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = entries.filter(|path| is_wanted(path) && code::is_code(path)).collect();
    files.sort();
    files
}

/// Returns the hash of a command, with the contents of files instead of their names.
pub(super) fn contents_of(command: &[String], folder: &Path) -> String {
    let mut all = vec![];
    for (k, word) in command.iter().enumerate() {
        let read = file(folder, k, word).and_then(|path| std::fs::read(path).ok());
        let bytes = read.unwrap_or_else(|| word.clone().into_bytes());
        all.extend((bytes.len() as u64).to_le_bytes());
        all.extend(bytes);
    }
    hash(&all)
}

fn hash(bytes: &[u8]) -> String {
    format!("sha256:{}", &hexadecimal(&Sha256::digest(bytes))[..12])
}

/// Returns whether a file is an installed runner. A file of the same name next to a spec is the user's own.
fn is_runner_file(path: &Path) -> bool {
    let is_installed = path.parent().is_some_and(|folder| folder.ends_with("bin") || folder.ends_with("sbin"));
    is_installed && is_runner(&path.to_string_lossy())
}

fn is_runner(program: &str) -> bool {
    let name = Path::new(program).file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    RUNNERS.contains(&name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.' || c == '-'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(command: &[&str]) -> Vec<String> {
        command.iter().map(|word| (*word).to_owned()).collect()
    }

    /// Makes a folder of two scripts, a copy of the first, a package, an environment and a program.
    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("package")).unwrap();
        std::fs::create_dir_all(folder.path().join("venv/bin")).unwrap();
        for (name, text) in [
            ("a.py", "one"),
            ("copy.py", "one"),
            ("b.py", "two"),
            ("package/__main__.py", "three"),
            ("venv/bin/python3", "python"),
            ("tool", "tool"),
            ("x.json", ""),
        ] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    #[test]
    fn whatever_starts_a_script_it_is_one_program() {
        let folder = folder();
        let of = |command: &[&str]| parts(&words(command), folder.path());
        let one = of(&["python3", "a.py"]);
        assert_eq!(one.len(), 1);
        for command in [
            &["python3", "-u", "a.py"][..],
            &["python3.12", "-B", "copy.py", "x.json"],
            &["./venv/bin/python3", "a.py"],
            &["/usr/bin/env", "python3", "a.py"],
            &["env", "PYTHONHASHSEED=0", "nice", "venv/bin/python3", "a.py"],
            &["python3", "-u", "-m", "a"],
            &["sh", "-c", "exec python3 -u ./a.py"],
            &["env", "--script=a.py"],
        ] {
            assert!(!of(command).is_disjoint(&one), "{command:?}: {:?}", of(command));
        }
        for command in [
            &["python3", "b.py"][..],
            &["./venv/bin/python3", "b.py"],
            &["python3", "-m", "package"],
            &["sh", "-c", "cat"],
            &["./tool", "-u"],
            &["mycalc"],
        ] {
            assert!(of(command).is_disjoint(&one), "{command:?}");
        }
        assert!(!of(&["./tool", "-u"]).is_disjoint(&of(&["./tool"])));
        assert!(!of(&["mycalc", "--fast"]).is_disjoint(&of(&["mycalc"])));
        assert!(of(&["sh", "-c", "cat"]).is_disjoint(&of(&["sh", "-c", "tac"])));
    }

    /// The parts of a script in a folder that imports something, beside a module that imports the kernel.
    fn parts_of_python(folder: &Path, source: &str) -> BTreeSet<String> {
        let place = folder.file_name().unwrap().display();
        std::fs::write(folder.join("a.py"), format!("# {place}\n{source}")).unwrap();
        std::fs::write(folder.join("between.py"), format!("# {place}\nimport kernel")).unwrap();
        parts(&words(&["python3", "a.py"]), folder)
    }

    #[test]
    fn programs_that_import_one_module_are_one() {
        let root = tempfile::tempdir().unwrap();
        for place in ["one/lib", "two/lib"] {
            std::fs::create_dir_all(root.path().join(place)).unwrap();
        }
        let write = |name: &str, text: &str| std::fs::write(root.path().join(name), text).unwrap();
        let (kernel, deep) = ("def answer(job): ...", "def deep(): ...");
        write("one/kernel.py", kernel);
        write("two/kernel.py", kernel);
        write("one/lib/deep.py", deep);
        write("two/lib/deep.py", deep);
        for source in [
            "import json, kernel",
            "from kernel import answer as a",
            "from .kernel import answer",
            "import lib.deep",
            "from lib import deep",
            "import between",
            "exec(open('kernel.py').read())",
            "path = 'kernel.py'",
            "importlib.import_module('kernel')",
        ] {
            let [one, two] = ["one", "two"].map(|place| parts_of_python(&root.path().join(place), source));
            assert!(!one.is_disjoint(&two), "{source}");
        }
        for source in ["import json, sys", "kernel = 3", "# a is not the kernel of it"] {
            let [one, two] = ["one", "two"].map(|place| parts_of_python(&root.path().join(place), source));
            assert!(one.is_disjoint(&two), "{source}");
        }
    }

    #[test]
    fn what_runs_programs_and_names_none_is_not_known() {
        let folder = folder();
        let is_unknown = |command: &[&str]| is_unknown(&words(command), folder.path());
        for command in
            [&["python3", "-m", "elsewhere"][..], &["ssh", "host", "calc"], &["./venv/bin/python3", "-m", "x"]]
        {
            assert!(is_unknown(command), "{command:?}");
        }
        for command in
            [&["python3", "a.py"][..], &["python3", "-m", "package"], &["./tool"], &["mycalc"], &["sh", "-c", "cat"]]
        {
            assert!(!is_unknown(command), "{command:?}");
        }
    }
}
