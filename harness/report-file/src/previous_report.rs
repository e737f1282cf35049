//! The earlier report in the place of a new one: it is renamed if it has readings that the new one lacks.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

use luxproof_model::ReadingKey;
use luxproof_model::Report;
use luxproof_process::files;

/// The parts of an earlier report that matter here.
#[derive(Deserialize)]
struct EarlierReport {
    started: String,
    spec: Spec,
    readings: Vec<ReadingHead>,
    #[serde(default)]
    recordings: Vec<RecordingHead>,
}

/// The spec of a report alone, because the rest may be long.
#[derive(Deserialize)]
struct ReportSubject {
    spec: Spec,
}

#[derive(Deserialize)]
struct Spec {
    path: String,
}

/// A reading without its value.
#[derive(Deserialize)]
struct ReadingHead {
    #[serde(flatten)]
    key: ReadingKey,
}

/// A recording without what it measured.
#[derive(Deserialize)]
struct RecordingHead {
    #[serde(flatten)]
    key: ReadingKey,
    seed: u64,
}

/// Parts of the report at a path; `None` where there is none.
fn read_parts<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_reader(files::open_stored(path).ok()?).ok()
}

/// The spec, or the specs, of the report at a path.
pub fn subject_at(path: &Path) -> Option<String> {
    read_parts(path).map(|report: ReportSubject| report.spec.path)
}

impl EarlierReport {
    /// Whether it is about another spec, or has readings that the new report lacks, those of another seed included.
    fn has_more_than(&self, report: &Report) -> bool {
        let seeds: BTreeMap<&ReadingKey, u64> = report.recordings.iter().map(|r| (&r.key, r.seed)).collect();
        if self.recordings.iter().any(|r| seeds.get(&r.key).is_some_and(|seed| *seed != r.seed)) {
            return true;
        }
        let keys: BTreeSet<&ReadingKey> = report.readings.iter().map(|reading| &reading.key).collect();
        self.spec.path != report.spec.path || self.readings.iter().any(|reading| !keys.contains(&reading.key))
    }
}

/// Renames an earlier report that has more than the new one, and returns its new path.
///
/// The name has the time when its run started, with a number where that name is taken.
pub(super) fn rename_earlier(report: &Report, path: &Path) -> io::Result<Option<PathBuf>> {
    let Some(earlier) = read_parts::<EarlierReport>(path).filter(|earlier| earlier.has_more_than(report)) else {
        return Ok(None);
    };
    let time: String = earlier.started.chars().filter(char::is_ascii_alphanumeric).collect();
    let names = (1..).map(|k| if k == 1 { format!("report-{time}.json") } else { format!("report-{time}-{k}.json") });
    let Some(free) = names.map(|name| path.with_file_name(name)).find(|path| !path.exists()) else { return Ok(None) };
    std::fs::rename(path, &free)?;
    Ok(Some(free))
}

#[cfg(test)]
mod tests {
    use super::*;
    use luxproof_model::{Estimate, Light, MeterId, ProcedureId, Quantity, Reading, Recording};
    use luxproof_model::{REPORT_VERSION, ReadingRecord};
    use luxproof_process::files::Durability;

    /// A report with one reading of each engine.
    fn report_of(engines: &[&str]) -> Report {
        let mut report = Report { luxproof: REPORT_VERSION, ..Report::default() };
        for engine in engines {
            report.readings.push(ReadingRecord {
                key: ReadingKey::new("room", ProcedureId::DirectIlluminance, *engine),
                model: "point".to_owned(),
                reading: Reading::new(MeterId::new("plane", 0), Quantity::Illuminance, Estimate::exact(1.0)),
            });
        }
        report
    }

    #[test]
    fn an_earlier_report_is_renamed_only_if_it_has_more() {
        let folder = tempfile::tempdir().unwrap();
        let (mut whole, mut part) = (report_of(&["iesna", "radiance"]), report_of(&["radiance"]));
        let write = |report: &mut Report| crate::keep_in(report, folder.path(), Durability::Usual).unwrap();
        assert_eq!(write(&mut part), None);
        assert_eq!(write(&mut whole), None);
        assert_eq!(write(&mut whole), None);
        let renamed = std::fs::read_to_string(write(&mut part).unwrap()).unwrap();
        assert!(crate::from_json(&renamed).unwrap().readings == whole.readings);
        // Another seed gives other readings.
        let key = ReadingKey::new("room", ProcedureId::DirectIlluminance, "radiance");
        part.recordings
            .push(Recording { seed: 1, ..Recording::of(key, Light::try_from("direct".to_owned()).unwrap()) });
        assert_eq!(write(&mut part), None);
        part.recordings[0].seed = 2;
        assert!(write(&mut part).is_some());
        part.spec.path = "another.yaml".to_owned();
        assert!(write(&mut part).is_some());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
    }
}
