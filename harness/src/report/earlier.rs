//! The report that lies where a new one is to be written: it stays beside that if it says more.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::Report;
use crate::record::ReadingKey;
use crate::system::files;

/// What an earlier report says, as far as it matters here.
#[derive(Deserialize)]
struct Earlier {
    started: String,
    spec: Spec,
    readings: Vec<Read>,
}

/// The rest of a report may be long.
#[derive(Deserialize)]
struct Subject {
    spec: Spec,
}

#[derive(Deserialize)]
struct Spec {
    path: String,
}

#[derive(Deserialize)]
struct Read {
    #[serde(flatten)]
    key: ReadingKey,
}

/// What lies at a path, if it is a report at all.
fn read<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_reader(files::open_kept(path).ok()?).ok()
}

/// The spec, or the specs, that an earlier report is about.
pub(crate) fn subject_at(path: &Path) -> Option<String> {
    read(path).map(|report: Subject| report.spec.path)
}

impl Earlier {
    fn says_more_than(&self, report: &Report) -> bool {
        let said: BTreeSet<&ReadingKey> = report.readings.iter().map(|reading| &reading.key).collect();
        self.spec.path != report.spec.path || self.readings.iter().any(|reading| !said.contains(&reading.key))
    }
}

/// Gives an earlier report that says more a name of its own, after when its run started, and returns that.
pub(super) fn put_aside(report: &Report, path: &Path) -> io::Result<Option<PathBuf>> {
    let earlier = read(path).filter(|earlier: &Earlier| earlier.says_more_than(report));
    let Some(earlier) = earlier else { return Ok(None) };
    let time: String = earlier.started.chars().filter(char::is_ascii_alphanumeric).collect();
    let names = (1..).map(|k| if k == 1 { format!("report-{time}.json") } else { format!("report-{time}-{k}.json") });
    let free = names.map(|name| path.with_file_name(name)).find(|aside| !aside.exists());
    let Some(aside) = free else { return Ok(None) };
    std::fs::rename(path, &aside)?;
    Ok(Some(aside))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{MeterId, ProcedureId, Quantity, Reading, Uncertainty};
    use crate::report::ReadingRecord;
    use crate::system::files::Care;

    fn of(engines: &[&str]) -> Report {
        let reading = |engine: &&str| ReadingRecord {
            key: ReadingKey::new("room", ProcedureId::DirectIlluminance, *engine),
            model: "point".to_owned(),
            reading: Reading {
                meter: MeterId::new("plane", 0),
                quantity: Quantity::Illuminance,
                value: 1.0,
                uncertainty: Uncertainty::Exact,
            },
        };
        Report { luxproof: 1, readings: engines.iter().map(reading).collect(), ..Report::default() }
    }

    #[test]
    fn only_what_says_more_stays_beside_a_new_report() {
        let folder = tempfile::tempdir().unwrap();
        let (mut whole, mut part) = (of(&["iesna", "radiance"]), of(&["radiance"]));
        let keep = |report: &mut Report| report.keep_in(folder.path(), Care::Usual).unwrap();
        assert_eq!(keep(&mut part), None);
        assert_eq!(keep(&mut whole), None);
        assert_eq!(keep(&mut whole), None);
        let aside = keep(&mut part).unwrap();
        assert!(Report::from_json(&std::fs::read_to_string(aside).unwrap()).unwrap().report.readings == whole.readings);
        part.spec.path = "another.yaml".to_owned();
        assert!(keep(&mut part).is_some());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    }
}
