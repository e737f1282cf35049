//! Shortcuts: the least that has to be rendered for a run, and how the other readings follow from it.
//!
//! Built-in reference engines take no shortcut of symmetry, darkness or flat rooms. They read every meter, so that a
//! wrong shortcut shows in every comparison. Spot checks also render a random twentieth of what a run leaves out. A
//! user's program takes no shortcut at all: a filled-in reading would not be the program's.

mod bounces;
mod dark;
#[cfg(test)]
mod random_scenes_tests;
mod repeated;
mod symmetry;
#[cfg(test)]
mod tests;

use luxproof_engines::{Job, Measurement};
use luxproof_model::{Effort, Estimate};

pub(super) use repeated::PlannedJobs;

/// How the readings of a job follow from another job that is less work.
#[derive(Clone, Debug)]
pub struct Shortcut {
    /// The job to render; without sensors nothing is rendered.
    pub job: Job,
    /// For each sensor of the requested job where its reading comes from.
    pub fill: Vec<Fill>,
    /// By this factor the rendered job is too dark, where the jobs differ in flux.
    pub factor: f64,
    /// What is left out and why, for the report.
    pub omissions: Vec<Omission>,
}

/// Where the reading at a sensor comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Fill {
    /// From this sensor of the rendered job.
    Rendered(usize),
    /// From a sensor of the rendered job that it mirrors.
    Mirrors {
        /// The sensor that is rendered.
        sensor: usize,
        /// The symmetry that maps that sensor to this one.
        by: String,
    },
    /// No light gets there.
    Dark,
}

/// Something that is not rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Omission {
    /// Whether the shortcut leaves out meters or light paths.
    pub scope: super::Scope,
    pub reason: String,
    /// The share of the run's work that this saves, 0 to 1.
    pub share: f64,
}

impl Fill {
    /// The sensor of the rendered job that the reading comes from.
    const fn sensor(&self) -> Option<usize> {
        match self {
            Self::Rendered(k) | Self::Mirrors { sensor: k, .. } => Some(*k),
            Self::Dark => None,
        }
    }
}

impl Shortcut {
    /// No shortcut: every sensor is rendered.
    pub fn none(job: &Job) -> Self {
        let fill = (0..job.sensors.len()).map(Fill::Rendered).collect();
        Self { job: job.clone(), fill, factor: 1.0, omissions: vec![] }
    }

    /// The shortcut with the least work for a job.
    pub(super) fn of(job: &Job) -> Self {
        let mut shortcut = Self::none(job);
        bounces::shorten(&mut shortcut);
        // In free field the readings check a luminaire's table, so no shortcut may rest on the table.
        if job.scene.room.is_some() {
            dark::shorten(&mut shortcut, job);
            symmetry::shorten(&mut shortcut, job);
        }
        shortcut
    }

    /// The sensors with readings that are not simply rendered, from which spot checks are drawn.
    pub fn unseen(&self, asked: &Job) -> Vec<usize> {
        let is_altered = self.factor != 1.0 || self.job.transport != asked.transport;
        let fills = self.fill.iter().enumerate();
        fills.filter(|(_, fill)| is_altered || !matches!(fill, Fill::Rendered(_))).map(|(k, _)| k).collect()
    }

    /// The readings of the requested job, from those of the rendered one.
    pub fn complete(&self, rendered: Measurement, asked: &Job) -> Measurement {
        // An engine that failed may have fewer estimates than sensors.
        let sources = self.fill.iter().map(|fill| fill.sensor().filter(|k| *k < rendered.estimates.len()));
        let sensors: Vec<Option<(usize, f64)>> = sources.map(|k| Some((k?, self.factor))).collect();
        let estimates = sensors
            .iter()
            .map(|source| source.map_or(Estimate::DARK, |(k, factor)| rendered.estimates[k].times(factor)))
            .collect();
        let samples = rendered.samples.iter().map(|part| part.rearranged(&sensors)).collect();
        let mut effort = rendered.effort;
        effort.extend(self.traces(asked));
        Measurement { estimates, effort, samples, ..rendered }
    }

    /// The source of each filled-in reading, as entries of the effort, so that a user can repeat it.
    fn traces(&self, asked: &Job) -> Vec<(String, String)> {
        let (mut mirrored, mut dark) = (vec![], vec![]);
        for (fill, sensor) in self.fill.iter().zip(&asked.sensors) {
            match fill {
                Fill::Mirrors { sensor: k, by } => {
                    mirrored.push((&sensor.id, &self.job.sensors[*k].id, by.as_str()));
                }
                Fill::Dark => dark.push(sensor.id.to_string()),
                Fill::Rendered(_) => {}
            }
        }
        let rescaled = (self.factor != 1.0).then(|| self.factor.to_string());
        let symmetric = (!mirrored.is_empty()).then(|| Effort::mirrored_entry(mirrored.into_iter()));
        let traces: [(&str, Vec<String>); 2] =
            [("meters_without_light", dark), ("rescaled_by", rescaled.into_iter().collect())];
        let traces = traces.into_iter().filter(|(_, words)| !words.is_empty());
        traces.map(|(name, words)| (name.to_owned(), words.join(", "))).chain(symmetric).collect()
    }

    /// Removes the rendered sensors that are not wanted, and updates the source of every reading.
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
                Fill::Mirrors { sensor, by } => Fill::Mirrors { sensor: place[sensor], by },
                Fill::Dark => Fill::Dark,
            };
        }
        let mut keep = wanted.iter();
        self.job.sensors.retain(|_| keep.next().copied().unwrap_or(true));
    }

    /// Records what the shortcut leaves out.
    fn omit(&mut self, scope: super::Scope, share: f64, reason: String) {
        self.omissions.push(Omission { scope, reason, share });
    }
}
