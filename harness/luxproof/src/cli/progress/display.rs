//! The lines of the progress display, none wider than the terminal.

use std::time::Duration;

use luxproof_audit::measure::RunningJob;
use unicode_width::{UnicodeWidthChar, UnicodeWidthStr};

/// The largest width of the bar.
const BAR_WIDTH: usize = 24;
/// A narrower bar shows nothing.
const MIN_BAR_WIDTH: usize = 6;

/// What the display shows at a time.
#[derive(Clone, Debug)]
pub(super) struct Snapshot {
    pub(super) elapsed: Duration,
    /// Readings that are there, and all that are known so far.
    pub(super) done: usize,
    pub(super) all: usize,
    pub(super) left: String,
    /// The jobs that run now, each with the time that it has run and its name.
    pub(super) running: Vec<(Duration, String)>,
}

/// The space for the display.
#[derive(Clone, Copy, Debug)]
pub(super) struct Space {
    /// Columns that a line may fill.
    pub(super) width: usize,
    /// Lines for running jobs.
    pub(super) jobs: usize,
}

impl Snapshot {
    /// The bar and one line per running job.
    pub(super) fn lines(&self, Space { width, jobs }: Space) -> Vec<String> {
        let mut lines = vec![self.bar_line(width)];
        let fits = self.running.len() <= jobs;
        let shown = if fits { self.running.len() } else { jobs.saturating_sub(1) };
        let names = self.running.iter().take(shown);
        lines.extend(names.map(|(elapsed, name)| shorten(&format!("  [{}] {name}", clock(*elapsed)), width)));
        if !fits {
            lines.push(shorten(&format!("  and {} more", self.running.len() - shown), width));
        }
        lines
    }

    /// The line of the bar, which is as wide as the rest of the line allows.
    fn bar_line(&self, width: usize) -> String {
        let Self { elapsed, done, all, left, .. } = self;
        let start = format!("[{}] ", clock(*elapsed));
        let end = format!("{done}/{all}, {left}");
        let free = width.saturating_sub(start.width() + end.width() + 1);
        if free < MIN_BAR_WIDTH {
            return shorten(&format!("{start}{end}"), width);
        }
        format!("{start}{} {end}", bar(*done, *all, free.min(BAR_WIDTH)))
    }
}

/// A bar of this width with its brackets.
fn bar(done: usize, all: usize, width: usize) -> String {
    let inner = width - 2;
    let full = (inner * done.min(all)).checked_div(all).unwrap_or(0);
    let head = if full < inner { ">" } else { "" };
    format!("[{:<inner$}]", "=".repeat(full) + head)
}

/// Minutes and seconds, and hours where there are some.
fn clock(duration: Duration) -> String {
    let s = duration.as_secs();
    match s / 3600 {
        0 => format!("{:02}:{:02}", s / 60, s % 60),
        hours => format!("{hours}:{:02}:{:02}", s / 60 % 60, s % 60),
    }
}

/// The name of a running job.
pub(super) fn name_of_job(job: &RunningJob, detail: &str) -> String {
    let comma = if detail.is_empty() { "" } else { ", " };
    format!("{}: {} {}{comma}{detail}", job.key.case, job.key.engine, job.key.procedure)
}

/// A line that is cut where it is wider than the terminal.
pub(super) fn shorten(line: &str, width: usize) -> String {
    if line.width() <= width {
        return line.to_owned();
    }
    let mut cut = String::new();
    for letter in line.chars() {
        if cut.width() + letter.width().unwrap_or(0) + 3 > width {
            break;
        }
        cut.push(letter);
    }
    cut + &"...".chars().take(width).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot() -> Snapshot {
        let name = "calibration/a-scene-with-a-rather-long-name: mitsuba semicylindrical_illuminance, stage 2 of 4";
        Snapshot {
            elapsed: Duration::from_secs(72),
            done: 5,
            all: 13,
            left: "20 s to 2 min left".to_owned(),
            running: (0..4).map(|k| (Duration::from_secs(k), format!("{name} {k}"))).collect(),
        }
    }

    #[test]
    fn no_line_is_wider_than_the_terminal() {
        for width in 1..=200 {
            for line in snapshot().lines(Space { width, jobs: 4 }) {
                assert!(line.width() <= width, "{width}: {line}");
            }
        }
        let wide = shorten("室内照度の検証", 8);
        assert_eq!((wide.as_str(), wide.width()), ("室内...", 7));
    }

    #[test]
    fn the_display_has_a_bar_and_a_line_per_running_job() {
        let lines = snapshot().lines(Space { width: 79, jobs: 4 });
        assert_eq!(lines[0], "[01:12] [========>             ] 5/13, 20 s to 2 min left");
        assert_eq!(lines.len(), 5);
        assert_eq!(lines[4], "  [00:03] calibration/a-scene-with-a-rather-long-name: mitsuba semicylindric...");
        // With fewer slots than jobs, the last line counts the others.
        let lines = snapshot().lines(Space { width: 59, jobs: 2 });
        assert_eq!((lines.len(), lines[2].as_str()), (3, "  and 3 more"));
        assert_eq!(lines[0], "[01:12] [========>             ] 5/13, 20 s to 2 min left");
        // The bar gives way to the numbers.
        assert_eq!(snapshot().bar_line(40), "[01:12] [=>   ] 5/13, 20 s to 2 min left");
        assert_eq!(snapshot().bar_line(33), "[01:12] 5/13, 20 s to 2 min left");
    }

    #[test]
    fn the_bar_is_full_when_all_is_done() {
        assert_eq!([bar(0, 0, 6), bar(1, 2, 6), bar(3, 3, 6)], ["[>   ]", "[==> ]", "[====]"]);
    }
}
