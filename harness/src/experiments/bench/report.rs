//! Views of a bench report: a table for a terminal, Markdown, CSV.

use super::curve::{Curve, TARGETS};
use super::{BenchReport, Reference};
use crate::experiments::tables;
use crate::system::printable::{csv, markdown};

impl BenchReport {
    pub fn terminal(&self) -> String {
        self.text(tables::terminal, str::to_owned)
    }

    pub fn markdown(&self) -> String {
        self.text(tables::markdown, markdown)
    }

    /// With words as the view shows them.
    fn text(&self, table: impl Fn(Vec<String>, Vec<Vec<String>>) -> String, shown: fn(&str) -> String) -> String {
        let versions: Vec<String> =
            self.engines.iter().map(|(id, version)| shown(&format!("{id} {version}"))).collect();
        let mut text = format!("{}.\n{}.\n\n", self.machine, versions.join(", "));
        for pareto in &self.pareto {
            let mine = |c: &&Curve| c.key.case == pareto.case && c.key.procedure == pareto.procedure;
            let curves: Vec<&Curve> = self.curves.iter().filter(mine).collect();
            text.push_str(&format!(
                "{}, {}: seconds to a relative error (start-up apart in brackets)\n\n",
                shown(&pareto.case),
                pareto.procedure
            ));
            let same = |r: &&Reference| r.case == pareto.case && r.procedure == pareto.procedure;
            for reference in self.references.iter().filter(same) {
                text.push_str(&format!(
                    "Reference: simulator, {}; {} s. It may be {} off, root mean square over the meters; smaller errors are not told.\n\n",
                    reference.solver,
                    seconds(reference.wall_s),
                    percent(reference.floor)
                ));
            }
            text.push_str(&table(head(), curves.iter().map(|c| row(c)).collect()));
            let point =
                |(name, t, e): &(String, f64, f64)| format!("{} ({}, {})", shown(name), seconds(*t), percent(*e));
            let front: Vec<String> = pareto.front.iter().map(point).collect();
            text.push_str(&format!("\nPareto front, by rising time: {}\n\n", front.join("; ")));
        }
        if !self.knobs.is_empty() {
            let head = ["case", "engine", "procedure", "setting", "effect", "deviation", "noise", "time"];
            let rows = self.knobs.iter().map(|k| {
                vec![
                    k.key.case.clone(),
                    k.key.engine.to_string(),
                    k.key.procedure.to_string(),
                    format!("{} = {}", k.knob, k.value),
                    k.effect.words().to_owned(),
                    k.deviation.map_or("-".to_owned(), percent),
                    k.noise.map_or("-".to_owned(), percent),
                    k.time_ratio.map_or("-".to_owned(), |r| format!("x {r:.2}")),
                ]
            });
            text.push_str("What each setting does, against the default\n\n");
            text.push_str(&table(head.map(str::to_owned).to_vec(), rows.collect()));
            text.push('\n');
        }
        for why in &self.left_out {
            text.push_str(&format!("left out: {}\n", shown(why)));
        }
        text
    }

    pub fn csv(&self) -> String {
        let mut text =
            "case,procedure,engine,preset,solver,effort,wall_s,cpu_s,peak_mib,relative_error,relative_error_low,\
                        relative_error_high,worst_error,variance,repetitions,start_up_s,set_up_s\n"
                .to_owned();
        for c in &self.curves {
            for p in &c.points {
                let peak = p.peak_mib.map_or(String::new(), |m| format!("{m:.1}"));
                let own = [&c.key.case, c.key.procedure.name(), &c.key.engine, &c.preset, &c.solver]
                    .map(|s| format!("\"{}\"", csv(s.to_owned()).replace('"', "\"\"")));
                let numbers =
                    [p.relative_error, p.relative_error_low, p.relative_error_high, p.worst_error, p.variance]
                        .map(|x| format!("{x:e}"));
                text.push_str(&format!(
                    "{},{},{},{},{peak},{},{},{},{}\n",
                    own.join(","),
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

fn head() -> Vec<String> {
    let mut head = vec!["engine".to_owned()];
    head.extend(TARGETS.map(|t| format!("to {} %", 100.0 * t)));
    let rest = ["best error (95 %)", "in s", "cpu s", "MiB", "slope", "floor", "1/(var t)", "start-up, set-up s"];
    head.extend(rest.map(str::to_owned));
    head
}

fn row(c: &Curve) -> Vec<String> {
    let mut row = vec![c.name()];
    row.extend(TARGETS.map(|t| {
        let at = |times: &std::collections::BTreeMap<String, Option<f64>>| times.get(&t.to_string()).copied().flatten();
        match (at(&c.time_to), at(&c.time_to_net)) {
            (Some(all), Some(net)) if c.start_up_s > 0.0 => format!("{} ({})", seconds(all), seconds(net)),
            (Some(all), _) => seconds(all),
            _ => "-".to_owned(),
        }
    }));
    let best = c.points.iter().min_by(|a, b| a.relative_error.total_cmp(&b.relative_error));
    let cell = |f: &dyn Fn(&super::BenchPoint) -> String| best.map_or("-".to_owned(), f);
    let known = |value: Option<f64>, f: fn(f64) -> String| value.map_or("-".to_owned(), f);
    row.extend([
        cell(&|p| {
            let ends = [p.relative_error, p.relative_error_low, p.relative_error_high].map(percent);
            format!("{} ({} .. {})", ends[0], ends[1], ends[2])
        }),
        cell(&|p| seconds(p.wall_s)),
        cell(&|p| seconds(p.cpu_s)),
        cell(&|p| known(p.peak_mib, |m| format!("{m:.0}"))),
        known(c.slope, |s| format!("{s:.2}")),
        known(c.bias_floor, percent),
        known(c.efficiency, |e| format!("{e:.1e}")),
        if c.start_up_s > 0.0 { [c.start_up_s, c.set_up_s].map(seconds).join(", ") } else { "-".to_owned() },
    ]);
    row
}

fn seconds(s: f64) -> String {
    if s < 0.0995 {
        format!("{s:.1e}")
    } else if s < 9.95 {
        format!("{s:.2}")
    } else {
        format!("{s:.0}")
    }
}

fn percent(x: f64) -> String {
    match 100.0 * x {
        p if p >= 9.95 => format!("{p:.0} %"),
        p if p >= 0.0095 => format!("{p:.2} %"),
        0.0 => "0 %".to_owned(),
        p => format!("{p:.0e} %"),
    }
}
