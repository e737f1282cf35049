//! The adapter protocol: requests, and the answer to a probe. Nothing here starts a program.

use luxproof_scene::{LuminaireModel, Transport};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::form::ExternalJob;
use super::json::{chatter, from_json};
use crate::{Job, recess};
use luxproof_process::printable;

/// The version of the adapter protocol. There is one version.
pub(super) const PROTOCOL: u32 = 2;

/// What an adapter reads on its standard input.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(tag = "verb", rename_all = "snake_case")]
pub enum ExternalRequest {
    /// What are you?
    Probe,
    /// Take the readings of these jobs: one, or several where it can `batch`.
    Read {
        /// Each with a name of its own in `job`.
        jobs: Vec<ExternalJob>,
        /// Threads or processes that it may use at a time.
        threads: usize,
    },
}

impl ExternalRequest {
    pub fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        serde_json::to_vec_pretty(self)
    }
}

/// What an adapter answers to `{"verb": "probe"}`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
pub struct ExternalProbe {
    /// 2.
    protocol: u32,
    /// What it drives, as its makers write it.
    pub(super) name: String,
    /// The version of that.
    pub(super) version: String,
    /// What it can: `area` (luminous openings), `obstacles`, `bounces` (reflected light), `ies` (it reads the photometric file, not the
    /// table), `threads` (it uses as many as it is given), `batch` (it takes several jobs at once).
    #[serde(default)]
    capabilities: Vec<String>,
    /// What it has in common with other engines, by name.
    #[serde(default)]
    pub(super) shares: Vec<String>,
    /// Files and folders that make its readings besides those of its command, from the folder in which it runs.
    #[serde(default)]
    pub(super) depends_on: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Capability {
    Area,
    Obstacles,
    Bounces,
    Threads,
    Batch,
}

/// All words that are known; `ies` asks for nothing, since every job has the file and the table.
const WORDS: [&str; 6] = ["area", "obstacles", "bounces", "threads", "batch", "ies"];
/// What tells a few names from a flood.
const MAX_WORD: usize = 200;

impl ExternalProbe {
    /// Parses the answer to a probe. An error says what is wrong with it.
    pub(super) fn parse(stdout: &[u8]) -> Result<Self, String> {
        let answer: serde_json::Value =
            from_json(stdout).map_err(|error| chatter(stdout).unwrap_or_else(|| format!("it is no JSON ({error})")))?;
        match answer.get("protocol") {
            None => return Err("it has no `protocol`".to_owned()),
            Some(version) if version.as_u64() == Some(PROTOCOL.into()) => {}
            Some(version) => return Err(format!("`protocol: {version}` is not supported")),
        }
        let probe: Self = serde_path_to_error::deserialize(answer).map_err(|error| error.to_string())?;
        if probe.name.trim().is_empty() || probe.version.trim().is_empty() {
            return Err("`name` and `version` must not be empty".to_owned());
        }
        Ok(probe.printable())
    }

    fn printable(self) -> Self {
        let line = |text: &String| printable::line(text, MAX_WORD);
        let shares = self.shares.iter().map(line).collect();
        Self { name: line(&self.name), version: line(&self.version), shares, ..self }
    }

    /// Its capabilities as a list.
    pub(super) fn words(&self) -> String {
        let words = self.capabilities.join(", ");
        if words.is_empty() { "no capabilities".to_owned() } else { printable::line(&words, MAX_WORD) }
    }

    pub(super) fn can(&self, capability: Capability) -> bool {
        self.capabilities.iter().any(|word| word == WORDS[capability as usize])
    }

    /// Capabilities that nobody knows, with those that there are.
    pub(super) fn unknown_words(&self) -> Option<String> {
        let unknown: Vec<&str> = self.capabilities.iter().map(String::as_str).filter(|w| !WORDS.contains(w)).collect();
        let words = printable::line(&unknown.join(", "), MAX_WORD);
        (!unknown.is_empty())
            .then(|| format!("capabilities that are not known: {words}; there are {}", WORDS.join(", ")))
    }

    /// Why a job is not for it, by what it says that it can.
    pub(super) fn objection(&self, job: &Job) -> Option<String> {
        let job = recess::separate(job);
        let has_openings = job.scene.luminaires.iter().any(|l| l.model != LuminaireModel::Point);
        let asked = [
            (Capability::Area, has_openings, "luminous openings"),
            (Capability::Obstacles, !job.scene.obstacles.is_empty(), "obstacles"),
            (Capability::Bounces, job.transport != Transport::Direct, "reflected light"),
        ];
        let (lacking, _, what) = asked.into_iter().find(|(c, is_asked, _)| *is_asked && !self.can(*c))?;
        Some(format!("{what}: its capabilities have no `{}`", WORDS[lacking as usize]))
    }
}
