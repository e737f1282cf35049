//! Of which meters answers to one question are kept: a list that says where to look, and is never believed.
//!
//! A question without its meters has a list of the meters of each of its answers. Whoever finds a list makes of it a question with these
//! meters, whose key is its own and whose entry is checked like any other: a list that is damaged, foreign, old or lost costs a rendering at most.

use std::collections::HashSet;
use std::time::SystemTime;

use glam::DVec3;
use luminaire::scene::Meter;
use serde::{Deserialize, Serialize};

use super::{Cache, Key};
use crate::engines::Station;
use crate::record::MeterId;
use crate::system::envelope::{self, Schema};
use crate::system::files;

const SCHEMA: Schema = Schema { of: "cache list of meters", version: 1 };

/// How the names of such files end.
pub(super) const EXTENSION: &str = "meters";

/// Answers to a question that are listed at most, and meters of all of them.
const MOST_ANSWERS: usize = 8;
const MOST_METERS: usize = 50_000;

/// A meter as it was asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Listed {
    id: MeterId,
    position_m: [f64; 3],
    normal: [f64; 3],
}

impl Cache {
    /// The meters of each answer that may be kept to a question, the latest answer first.
    pub fn listed(&self, question: &Key) -> Vec<Vec<Station>> {
        let path = self.path(question).with_extension(EXTENSION);
        let Ok(text) = files::read_bounded(&path, files::MAX_BYTES) else { return vec![] };
        let lists = envelope::open::<Vec<Vec<Listed>>>(SCHEMA, &text).and_then(|sealed| sealed.about(&question.digits));
        let Ok(lists) = lists else { return vec![] };
        // As for entries: only pruning asks.
        std::fs::File::open(&path).and_then(|f| f.set_modified(SystemTime::now())).ok();
        lists.into_iter().map(|list| list.into_iter().map(Station::from).collect()).collect()
    }

    /// Lists an answer that is kept to a question. Of two runs that do so at once one is not heard.
    pub fn list(&self, question: &Key, stations: &[Station]) -> std::io::Result<()> {
        if stations.len() > MOST_METERS {
            return Ok(());
        }
        let mut lists = self.listed(question);
        let these: HashSet<[u64; 6]> = stations.iter().map(bits).collect();
        // What is all among these tells nothing more.
        lists.retain(|list| !list.iter().all(|station| these.contains(&bits(station))));
        lists.insert(0, stations.to_vec());
        lists.truncate(MOST_ANSWERS);
        let mut meters = 0;
        lists.retain(|list| {
            meters += list.len();
            meters <= MOST_METERS
        });
        let lists: Vec<Vec<Listed>> =
            lists.into_iter().map(|list| list.into_iter().map(Listed::from).collect()).collect();
        let text = envelope::seal(SCHEMA, &question.digits, &lists)? + "\n";
        files::replace(&self.path(question).with_extension(EXTENSION), text.as_bytes())
    }
}

/// What makes two meters one, whatever they are called: the same place and normal to the last bit.
pub(in crate::measure) fn bits(station: &Station) -> [u64; 6] {
    let DVec3 { x, y, z } = station.meter.position_m;
    let DVec3 { x: a, y: b, z: c } = station.meter.normal;
    [x, y, z, a, b, c].map(f64::to_bits)
}

impl From<Station> for Listed {
    fn from(Station { id, meter }: Station) -> Self {
        Self { id, position_m: meter.position_m.to_array(), normal: meter.normal.to_array() }
    }
}

impl From<Listed> for Station {
    fn from(Listed { id, position_m, normal }: Listed) -> Self {
        Self { id, meter: Meter { position_m: DVec3::from_array(position_m), normal: DVec3::from_array(normal) } }
    }
}
