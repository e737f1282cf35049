//! One colour and one mark an engine, the same in every plot and table; told apart without colour vision and in print.
//!
//! Colours after Okabe and Ito, "Color Universal Design" (2008), darkened on paper and lightened on black until text in them
//! keeps a contrast of 4.5 to 1.

use itertools::Itertools;
use maud::{Markup, html};

use super::super::Report;
use crate::engines;
use crate::record::{EngineName, EngineStatus};

/// Colours on paper and on black of engines that are none of ours; the last is for those that only another file knows.
const SPARE: [(&str, &str); 3] = [("#a8457f", "#e294c3"), ("#5f6e00", "#b5c447"), ("#7a6a58", "#c9b8a4")];

/// Colours on paper and on black: those of our own engines first, for good, so that two reports read alike.
fn colours() -> impl Iterator<Item = (&'static str, &'static str)> {
    engines::ALL.iter().map(|entry| entry.colour).chain(SPARE)
}

const OWN: usize = engines::ALL.len();
const COLOURS: usize = OWN + SPARE.len();

fn fixed(engine: &str) -> Option<usize> {
    engines::ALL.iter().position(|entry| entry.name == *engine)
}

pub(super) struct Palette {
    engines: Vec<(EngineName, usize)>,
}

impl Palette {
    pub(super) fn of(report: &Report) -> Self {
        let mut spare = (OWN..COLOURS).cycle();
        let index = |e: &EngineStatus| fixed(&e.id).or_else(|| spare.next()).unwrap_or(COLOURS - 1);
        Self { engines: report.engines.iter().map(|e| e.id.clone()).zip(report.engines.iter().map(index)).collect() }
    }

    /// Custom properties `--e0` ... for the style sheet.
    pub(super) fn style() -> String {
        let colour = |(k, (paper, black)): (usize, (&str, &str))| format!("--e{k}:light-dark({paper},{black});");
        let colours: String = colours().enumerate().map(colour).collect();
        let uses = |k| format!(".e{k}{{fill:var(--e{k})}}.ring .e{k},.line.e{k}{{stroke:var(--e{k})}}");
        format!(":root{{{colours}}}{}", (0..COLOURS).map(uses).collect::<String>())
    }

    /// Index of an engine's colour and mark; engines that only another file knows take what is left.
    pub(super) fn index(&self, engine: &str) -> usize {
        let found = self.engines.iter().find(|(id, _)| *id == *engine).map(|(_, k)| *k);
        found.or_else(|| fixed(engine)).unwrap_or(COLOURS - 1)
    }

    /// Each once, in the report's order; those that are not in it come last, by name.
    pub(super) fn sorted<'a>(&self, engines: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
        engines.sorted().dedup().sorted_by_key(|e| self.order(e)).collect()
    }

    pub(super) fn order(&self, engine: &str) -> usize {
        self.engines.iter().position(|(id, _)| *id == *engine).unwrap_or(self.engines.len())
    }

    pub(super) fn mark(&self, engine: &str, [x, y]: [f64; 2], radius: f64) -> Markup {
        let index = self.index(engine);
        html! { path class={ "mark e" (index) } d=(shape(index, x, y, radius)) {} }
    }

    /// Every mark once, for [`Self::label`] to refer to.
    pub(super) fn marks() -> Markup {
        html! {
            svg.marks aria-hidden="true" { @for k in 0..COLOURS {
                symbol id={ "k" (k) } viewBox="0 0 12 12" { path class={ "mark e" (k) } d=(shape(k, 6.0, 6.0, 4.4)) {} }
            } }
        }
    }

    pub(super) fn label(&self, engine: &str) -> Markup {
        let index = self.index(engine);
        html! {
            span.engine { svg.key aria-hidden="true" { use href={ "#k" (index) } {} } (engine) }
        }
    }
}

/// Outline of a mark: circle, square, triangle, diamond, triangle upside down, pentagon, hexagon, bar, upright bar, cross.
fn shape(index: usize, x: f64, y: f64, r: f64) -> String {
    let polygon = |corners: u32, turn_deg: f64, size: f64| {
        let corner = |k: u32| {
            let (sin, cos) = (turn_deg + 360.0 * f64::from(k) / f64::from(corners)).to_radians().sin_cos();
            format!("{:.1} {:.1}", x + size * sin, y - size * cos)
        };
        format!("M{}Z", (0..corners).map(corner).collect::<Vec<_>>().join("L"))
    };
    match index {
        0 => format!("M{:.1} {y:.1}a{r} {r} 0 1 0 {:.1} 0a{r} {r} 0 1 0 {:.1} 0Z", x - r, 2.0 * r, -2.0 * r),
        1 => polygon(4, 45.0, 1.25 * r),
        2 => polygon(3, 0.0, 1.3 * r),
        3 => polygon(4, 0.0, 1.3 * r),
        4 => polygon(3, 180.0, 1.3 * r),
        5 => polygon(5, 0.0, 1.15 * r),
        6 => polygon(6, 0.0, 1.1 * r),
        7 => format!("M{:.1} {:.1}h{:.1}v{r:.1}h{:.1}Z", x - r, y - 0.5 * r, 2.0 * r, -2.0 * r),
        8 => format!("M{:.1} {:.1}v{:.1}h{r:.1}v{:.1}Z", x - 0.5 * r, y - r, 2.0 * r, -2.0 * r),
        _ => {
            let (arm, long) = (0.6 * r, 0.7 * r);
            format!(
                "M{:.1} {:.1}h{arm:.1}v{long:.1}h{long:.1}v{arm:.1}h-{long:.1}v{long:.1}h-{arm:.1}v-{long:.1}h-{long:.1}v-{arm:.1}h{long:.1}Z",
                x - 0.3 * r,
                y - r
            )
        }
    }
}
