//! Lists of the meters of cached answers, by which a reader finds answers to a part of its question.
//!
//! A list is stored under the key of a question without its meters. A reader makes a question of each list, with
//! another key, and its entry is checked like any other. A list that is damaged, foreign, old or lost thus costs a
//! rendering at most, and never a wrong reading.

use std::collections::HashSet;
use std::time::SystemTime;

use glam::DVec3;
use luxproof_scene::Meter;
use serde::{Deserialize, Serialize};

use super::{Cache, Key};
use luxproof_engines::Sensor;
use luxproof_model::MeterId;
use luxproof_process::envelope::{self, Schema};
use luxproof_process::files;

const SCHEMA: Schema = Schema { of: "cache list of meters", version: 1 };

/// The extension of such files.
pub(super) const EXTENSION: &str = "meters";

/// The largest number of lists of a question.
const MAX_LISTS: usize = 8;
/// The largest number of meters in all lists of a question.
const MAX_METERS: usize = 50_000;

/// A meter of an answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ListedMeter {
    id: MeterId,
    position_m: [f64; 3],
    normal: [f64; 3],
}

impl Cache {
    /// The meters of each cached answer to a question, the latest answer first.
    pub fn listed(&self, question: &Key) -> Vec<Vec<Sensor>> {
        let path = self.path(question).with_extension(EXTENSION);
        let Ok(text) = files::read_bounded(&path, files::MAX_BYTES) else { return vec![] };
        let lists =
            envelope::open::<Vec<Vec<ListedMeter>>>(SCHEMA, &text).and_then(|sealed| sealed.about(&question.digits));
        let Ok(lists) = lists else { return vec![] };
        // Marks the file as used today; only pruning needs the date, so an error does not matter.
        std::fs::File::open(&path).and_then(|f| f.set_modified(SystemTime::now())).ok();
        lists.into_iter().map(|list| list.into_iter().map(Sensor::from).collect()).collect()
    }

    /// Adds the meters of an answer to a question. Of two runs that do so at the same time one is lost.
    pub fn list(&self, question: &Key, sensors: &[Sensor]) -> std::io::Result<()> {
        if sensors.len() > MAX_METERS {
            return Ok(());
        }
        let mut lists = self.listed(question);
        let new: HashSet<[u64; 6]> = sensors.iter().map(bits).collect();
        // A list with all of its meters among the new ones is redundant.
        lists.retain(|list| !list.iter().all(|sensor| new.contains(&bits(sensor))));
        lists.insert(0, sensors.to_vec());
        lists.truncate(MAX_LISTS);
        let mut meters = 0;
        lists.retain(|list| {
            meters += list.len();
            meters <= MAX_METERS
        });
        let lists: Vec<Vec<ListedMeter>> =
            lists.into_iter().map(|list| list.into_iter().map(ListedMeter::from).collect()).collect();
        let text = envelope::seal(SCHEMA, &question.digits, &lists)? + "\n";
        files::replace(&self.path(question).with_extension(EXTENSION), text.as_bytes())
    }
}

/// The bits of a meter's position and normal; two meters with the same bits are one, whatever their names.
pub(in crate::measure) fn bits(sensor: &Sensor) -> [u64; 6] {
    let DVec3 { x, y, z } = sensor.meter.position_m;
    let DVec3 { x: a, y: b, z: c } = sensor.meter.normal;
    [x, y, z, a, b, c].map(f64::to_bits)
}

impl From<Sensor> for ListedMeter {
    fn from(Sensor { id, meter }: Sensor) -> Self {
        Self { id, position_m: meter.position_m.to_array(), normal: meter.normal.to_array() }
    }
}

impl From<ListedMeter> for Sensor {
    fn from(ListedMeter { id, position_m, normal }: ListedMeter) -> Self {
        Self { id, meter: Meter { position_m: DVec3::from_array(position_m), normal: DVec3::from_array(normal) } }
    }
}
