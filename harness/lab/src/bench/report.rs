//! Views of a bench report: a table for a terminal, Markdown and CSV.

use std::collections::BTreeMap;

use super::curve::{BenchPoint, Curve, Pareto, TARGET_ERRORS};
use super::{BenchReport, SettingEffect};
use crate::tables;
use luxproof_process::printable::{csv, markdown};

/// How a view shows tables and text.
struct ViewFormat {
    table: fn(Vec<String>, Vec<Vec<String>>) -> String,
    escape: fn(&str) -> String,
}

impl BenchReport {
    /// The report for a terminal.
    pub fn terminal(&self) -> String {
        self.write_text(&ViewFormat { table: tables::format_terminal, escape: str::to_owned })
    }

    /// The report as Markdown.
    pub fn markdown(&self) -> String {
        self.write_text(&ViewFormat { table: tables::format_escaped_markdown, escape: markdown })
    }

    /// Writes the report in the format of a view.
    fn write_text(&self, format: &ViewFormat) -> String {
        let versions: Vec<String> =
            self.engines.iter().map(|(id, version)| (format.escape)(&format!("{id} {version}"))).collect();
        let mut text = format!("{}.\n{}.\n\n", self.machine, versions.join(", "));
        for pareto in &self.pareto {
            text += &self.write_procedure(pareto, format);
        }
        if !self.settings.is_empty() {
            let head = ["case", "engine", "procedure", "setting", "effect", "deviation", "noise", "time"];
            let rows = self.settings.iter().map(setting_row).collect();
            text.push_str("What each setting does, against the default\n\n");
            text.push_str(&(format.table)(head.map(str::to_owned).to_vec(), rows));
            text.push('\n');
        }
        for why in &self.left_out {
            text.push_str(&format!("left out: {}\n", (format.escape)(why)));
        }
        text
    }

    /// Writes the curves of a case and procedure, with their reference and their Pareto front.
    fn write_procedure(&self, pareto: &Pareto, format: &ViewFormat) -> String {
        let Pareto { case, procedure, front } = pareto;
        let mut text = format!(
            "{}, {procedure}: seconds to a relative error (without start-up in brackets)\n\n",
            (format.escape)(case)
        );
        for reference in self.references.iter().filter(|r| r.case == *case && r.procedure == *procedure) {
            text.push_str(&format!(
                "Reference: simulator, {}; {} s. It may be {} off, root mean square over the meters; smaller errors are not reported.\n\n",
                reference.solver,
                seconds(reference.wall_s),
                percent(reference.floor)
            ));
        }
        let curves = self.curves.iter().filter(|c| c.key.case == *case && c.key.procedure == *procedure);
        text.push_str(&(format.table)(head(), curves.map(curve_row).collect()));
        let points: Vec<String> = front
            .iter()
            .map(|(name, t, e)| format!("{} ({}, {})", (format.escape)(name), seconds(*t), percent(*e)))
            .collect();
        text.push_str(&format!("\nPareto front, by rising time: {}\n\n", points.join("; ")));
        text
    }

    /// Every point of every curve as CSV.
    pub fn csv(&self) -> String {
        let mut text =
            "case,procedure,engine,preset,solver,effort,wall_s,cpu_s,peak_mib,relative_error,relative_error_low,\
                        relative_error_high,worst_error,variance,repetitions,start_up_s,set_up_s\n"
                .to_owned();
        for c in &self.curves {
            for p in &c.points {
                let peak = p.peak_mib.map_or(String::new(), |m| format!("{m:.1}"));
                let names = [&c.key.case, c.key.procedure.name(), &c.key.engine, &c.preset, &c.solver]
                    .map(|s| format!("\"{}\"", csv(s.to_owned()).replace('"', "\"\"")));
                let numbers =
                    [p.relative_error, p.relative_error_low, p.relative_error_high, p.worst_error, p.variance]
                        .map(|x| format!("{x:e}"));
                text.push_str(&format!(
                    "{},{},{},{},{peak},{},{},{},{}\n",
                    names.join(","),
                    p.effort,
                    p.wall_s,
                    p.cpu_s,
                    numbers.join(","),
                    p.repetitions,
                    c.start_up_s,
                    c.set_up_s
                ));
            }
        }
        text
    }
}

/// The row of a setting.
fn setting_row(setting: &SettingEffect) -> Vec<String> {
    vec![
        setting.key.case.clone(),
        setting.key.engine.to_string(),
        setting.key.procedure.to_string(),
        format!("{} = {}", setting.setting, setting.value),
        setting.effect.label().to_owned(),
        setting.deviation.map_or("-".to_owned(), percent),
        setting.noise.map_or("-".to_owned(), percent),
        setting.time_ratio.map_or("-".to_owned(), |ratio| format!("x {ratio:.2}")),
    ]
}

/// The head of the table of curves.
fn head() -> Vec<String> {
    let mut head = vec!["engine".to_owned()];
    head.extend(TARGET_ERRORS.map(|t| format!("to {} %", 100.0 * t)));
    let rest = ["best error (95 %)", "in s", "cpu s", "MiB", "slope", "floor", "1/(var t)", "start-up, set-up s"];
    head.extend(rest.map(str::to_owned));
    head
}

/// The time to a target error, where it was reached.
fn time_to(times: &BTreeMap<String, Option<f64>>, target: f64) -> Option<f64> {
    times.get(&target.to_string()).copied().flatten()
}

/// The time to a target error, with the time without start-up in brackets.
fn target_cell(curve: &Curve, target: f64) -> String {
    match (time_to(&curve.time_to, target), time_to(&curve.time_to_net, target)) {
        (Some(all), Some(net)) if curve.start_up_s > 0.0 => format!("{} ({})", seconds(all), seconds(net)),
        (Some(all), _) => seconds(all),
        _ => "-".to_owned(),
    }
}

/// The cells of the most accurate point: error with its interval, seconds, processor seconds and
/// memory.
fn best_cells(point: &BenchPoint) -> [String; 4] {
    let [error, low, high] = [point.relative_error, point.relative_error_low, point.relative_error_high].map(percent);
    [
        format!("{error} ({low} .. {high})"),
        seconds(point.wall_s),
        seconds(point.cpu_s),
        point.peak_mib.map_or("-".to_owned(), |mib| format!("{mib:.0}")),
    ]
}

/// The row of a curve.
fn curve_row(c: &Curve) -> Vec<String> {
    let mut row = vec![c.name()];
    row.extend(TARGET_ERRORS.map(|target| target_cell(c, target)));
    let best = c.points.iter().min_by(|a, b| a.relative_error.total_cmp(&b.relative_error));
    row.extend(best.map_or_else(|| ["-"; 4].map(str::to_owned), best_cells));
    row.extend([
        c.slope.map_or("-".to_owned(), |s| format!("{s:.2}")),
        c.bias_floor.map_or("-".to_owned(), percent),
        c.efficiency.map_or("-".to_owned(), |e| format!("{e:.1e}")),
        if c.start_up_s > 0.0 { [c.start_up_s, c.set_up_s].map(seconds).join(", ") } else { "-".to_owned() },
    ]);
    row
}

/// Seconds with two or three digits.
fn seconds(s: f64) -> String {
    if s < 0.0995 {
        format!("{s:.1e}")
    } else if s < 9.95 {
        format!("{s:.2}")
    } else {
        format!("{s:.0}")
    }
}

/// A part in percent, with more digits where it is small.
fn percent(x: f64) -> String {
    match 100.0 * x {
        p if p >= 9.95 => format!("{p:.0} %"),
        p if p >= 0.0095 => format!("{p:.2} %"),
        0.0 => "0 %".to_owned(),
        p => format!("{p:.0e} %"),
    }
}
