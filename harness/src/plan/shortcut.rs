//! Shortcuts: the least that has to be rendered for a run, and how the other readings follow from it; pure.
//!
//! Our own witnesses take none of symmetry, darkness or flat rooms: they read every meter as it was asked, so that a claim that is
//! wrong shows in every comparison, besides in the spot checks, which render a random twentieth of what a run leaves out. A user's
//! program takes none at all: what a shortcut fills in is what light does, and not what the program says of it.

mod bounces;
mod dark;
mod repeated;
mod symmetry;
#[cfg(test)]
mod tests;

use crate::engines::{Job, Measurement};
use crate::record::Estimate;

pub(super) use repeated::Repeated;

/// How the readings of a job follow from another job that is less work.
#[derive(Clone, Debug)]
pub struct Shortcut {
    /// What is rendered; no stations: nothing.
    pub job: Job,
    /// One a station of the job that was asked.
    pub fill: Vec<Fill>,
    /// What is rendered is this many times too dark: the jobs differ in flux.
    pub factor: f64,
    /// What is left out and why, for the report.
    pub omissions: Vec<Omission>,
}

/// Where the reading at a station comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Fill {
    /// It is that of a station of the job that is rendered.
    Rendered(usize),
    /// It is that of a station of the job that is rendered, which it mirrors.
    Mirrors {
        /// The station that is rendered.
        station: usize,
        /// The symmetry that takes that station to this one.
        by: String,
    },
    /// No light gets there.
    Dark,
}

/// Something that is not rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Omission {
    /// Whether it is meters or light paths that are left out.
    pub scope: super::Scope,
    pub reason: String,
    /// The part of the run's work that this saves, 0 to 1.
    pub share: f64,
}

impl Shortcut {
    /// Everything is rendered.
    pub fn none(job: &Job) -> Self {
        let fill = (0..job.stations.len()).map(Fill::Rendered).collect();
        Self { job: job.clone(), fill, factor: 1.0, omissions: vec![] }
    }

    /// The least work for a job.
    pub(super) fn of(job: &Job) -> Self {
        let mut shortcut = Self::none(job);
        bounces::shorten(&mut shortcut);
        // A luminaire alone in free field is read for its table, which no shortcut may assume.
        if job.scene.room.is_some() {
            dark::shorten(&mut shortcut, job);
            symmetry::shorten(&mut shortcut, job);
        }
        shortcut
    }

    /// The stations of the job that was asked whose readings are not simply rendered: what spot checks choose from.
    pub fn unseen(&self, asked: &Job) -> Vec<usize> {
        let altered = self.factor != 1.0 || self.job.transport != asked.transport;
        let is = |f: &Fill| altered || !matches!(f, Fill::Rendered(_));
        self.fill.iter().enumerate().filter(|(_, f)| is(f)).map(|(k, _)| k).collect()
    }

    /// The readings of the job that was asked, from those of the job that was rendered.
    pub fn complete(&self, rendered: Measurement, asked: &Job) -> Measurement {
        let source = |fill: &Fill| match fill {
            Fill::Rendered(k) | Fill::Mirrors { station: k, .. } if *k < rendered.estimates.len() => {
                Some((*k, self.factor))
            }
            _ => None,
        };
        let stations: Vec<Option<(usize, f64)>> = self.fill.iter().map(source).collect();
        let read = |(k, factor): (usize, f64)| rendered.estimates[k].times(factor);
        let estimates = stations.iter().map(|source| source.map_or(Estimate::DARK, read)).collect();
        let samples = rendered.samples.iter().map(|part| part.rearranged(&stations)).collect();
        let mut effort = rendered.effort;
        effort.extend(self.traces(asked));
        Measurement { estimates, effort, samples, ..rendered }
    }

    /// Which meter's reading is which other's, for whoever repeats it.
    fn traces(&self, asked: &Job) -> Vec<(String, String)> {
        let fills = || self.fill.iter().zip(&asked.stations);
        let mirrored = fills().filter_map(|(fill, station)| match fill {
            Fill::Mirrors { station: k, by } => Some(format!("{} is {} ({by})", station.id, self.job.stations[*k].id)),
            Fill::Rendered(_) | Fill::Dark => None,
        });
        let dark = fills().filter(|(fill, _)| **fill == Fill::Dark).map(|(_, station)| station.id.to_string());
        let rescaled = (self.factor != 1.0).then(|| self.factor.to_string());
        let traces: [(&str, Vec<String>); 3] = [
            ("mirrored_meters", mirrored.collect()),
            ("meters_without_light", dark.collect()),
            ("rescaled_by", rescaled.into_iter().collect()),
        ];
        let told = traces.into_iter().filter(|(_, words)| !words.is_empty());
        told.map(|(name, words)| (name.to_owned(), words.join(", "))).collect()
    }

    /// Keeps of the rendered stations those that `wanted` says, and tells every fill where they are now.
    fn render_only(&mut self, wanted: &[bool], instead: impl Fn(usize) -> Fill) {
        let mut place = vec![0];
        place.extend(wanted.iter().scan(0, |kept, w| {
            *kept += usize::from(*w);
            Some(*kept)
        }));
        for fill in &mut self.fill {
            let Fill::Rendered(k) = *fill else { continue };
            let source = if wanted[k] { Fill::Rendered(k) } else { instead(k) };
            *fill = match source {
                Fill::Rendered(k) => Fill::Rendered(place[k]),
                Fill::Mirrors { station, by } => Fill::Mirrors { station: place[station], by },
                Fill::Dark => Fill::Dark,
            };
        }
        let mut keep = wanted.iter();
        self.job.stations.retain(|_| keep.next().copied().unwrap_or(true));
    }

    fn omit(&mut self, scope: super::Scope, share: f64, reason: String) {
        self.omissions.push(Omission { scope, reason, share });
    }
}
