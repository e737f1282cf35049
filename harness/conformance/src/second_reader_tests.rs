//! A reader in Python that shares no code with luxproof: right, and with each mistake in turn.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use strum::IntoEnumIterator as _;

use super::{Mistake, Submission, judge, written_files};

/// The answers of the second reader by the name of its mistake; without a name it is right.
fn answers() -> BTreeMap<String, Submission> {
    let folder = tempfile::tempdir().unwrap();
    for file in written_files().unwrap() {
        let path = folder.path().join(&file.path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, file.bytes).unwrap();
    }
    let reader = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reader.py");
    let output = Command::new("python3").arg("-S").arg(reader).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_second_reader_is_right_and_each_of_its_mistakes_is_named() {
    let answers = answers();
    assert_eq!(answers.len(), Mistake::iter().count() + 1);
    for (name, submission) in &answers {
        let judgement = judge(submission).unwrap();
        let found: Vec<&str> = judgement.mistakes().into_keys().map(Mistake::id).collect();
        let expected: Vec<&str> = [name.as_str()].into_iter().filter(|name| !name.is_empty()).collect();
        assert_eq!(found, expected, "{judgement:#?}");
        assert_eq!(judgement.is_passed(), name.is_empty(), "{name}: {judgement:#?}");
        // Every wrong file is explained.
        let explained = judgement.mistakes().into_values().next().unwrap_or_default();
        let wrong: Vec<&str> = judgement.files.iter().filter(|file| file.is_fault()).map(|file| file.file).collect();
        assert_eq!(explained, wrong, "{name}");
    }
}
