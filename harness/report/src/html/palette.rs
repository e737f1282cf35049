//! A colour and a mark for each engine, the same in every plot and table, distinct in print and for every kind of colour vision.
//!
//! Colours after Okabe and Ito, "Color Universal Design" (2008). They are darkened on paper and lightened on black until text
//! has a contrast of 4.5 to 1.

use itertools::Itertools;
use maud::{Markup, html};

use luxproof_model::EngineName;
use luxproof_model::Report;

/// Colours on paper and on black, by the mark of an engine. Those of built-in engines come first, so that all reports agree.
const COLOURS: [(&str, &str); 12] = [
    ("#3d4148", "#d5d8dd"),
    ("#8c6100", "#e6b84d"),
    ("#0067a8", "#62b5ea"),
    ("#b84a00", "#f08a4b"),
    ("#007a5a", "#3fc79d"),
    ("#b4540a", "#f0995a"),
    ("#5b4bb5", "#a89cf0"),
    ("#0a7d74", "#4fd1c5"),
    ("#a3324f", "#f08ca5"),
    ("#a8457f", "#e294c3"),
    ("#5f6e00", "#b5c447"),
    ("#7a6a58", "#c9b8a4"),
];
/// The first mark of engines that are not built in. The last mark is for engines that only an attached file has.
const FIRST_SPARE: usize = 9;

pub(super) struct Palette {
    engines: Vec<(EngineName, usize)>,
}

impl Palette {
    /// Built-in engines have fixed marks; the others take the spare ones in turn.
    pub(super) fn of(report: &Report) -> Self {
        let mut spare = (FIRST_SPARE..COLOURS.len()).cycle();
        let mut engines = vec![];
        for engine in &report.engines {
            let fixed = engine.mark.filter(|mark| *mark < FIRST_SPARE);
            let mark = fixed.or_else(|| spare.next()).unwrap_or(COLOURS.len() - 1);
            engines.push((engine.id.clone(), mark));
        }
        Self { engines }
    }

    /// Custom properties `--e0` ... for the style sheet.
    pub(super) fn style() -> String {
        let (mut colours, mut uses) = (String::new(), String::new());
        for (k, (paper, black)) in COLOURS.into_iter().enumerate() {
            colours += &format!("--e{k}:light-dark({paper},{black});");
            uses += &format!(".e{k}{{fill:var(--e{k})}}.ring .e{k},.line.e{k}{{stroke:var(--e{k})}}");
        }
        format!(":root{{{colours}}}{uses}")
    }

    /// Index of an engine's colour and mark; engines that only an attached file has share the last one.
    pub(super) fn index(&self, engine: &str) -> usize {
        let found = self.engines.iter().find(|(id, _)| *id == *engine).map(|(_, k)| *k);
        found.unwrap_or(COLOURS.len() - 1)
    }

    /// Each engine once, in the report's order; engines that the report lacks come last, by name.
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

    /// The definitions of all marks, which [`Self::label`] refers to.
    pub(super) fn marks() -> Markup {
        html! {
            svg.marks aria-hidden="true" { @for k in 0..COLOURS.len() {
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
    match index {
        0 => format!("M{:.1} {y:.1}a{r} {r} 0 1 0 {:.1} 0a{r} {r} 0 1 0 {:.1} 0Z", x - r, 2.0 * r, -2.0 * r),
        1 => polygon([x, y], 4, 45.0, 1.25 * r),
        2 => polygon([x, y], 3, 0.0, 1.3 * r),
        3 => polygon([x, y], 4, 0.0, 1.3 * r),
        4 => polygon([x, y], 3, 180.0, 1.3 * r),
        5 => polygon([x, y], 5, 0.0, 1.15 * r),
        6 => polygon([x, y], 6, 0.0, 1.1 * r),
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

/// A regular polygon with a corner at `turn_deg` clockwise from the top.
fn polygon([x, y]: [f64; 2], corners: u32, turn_deg: f64, size: f64) -> String {
    let mut path: Vec<String> = vec![];
    for k in 0..corners {
        let (sin, cos) = (turn_deg + 360.0 * f64::from(k) / f64::from(corners)).to_radians().sin_cos();
        path.push(format!("{:.1} {:.1}", x + size * sin, y - size * cos));
    }
    format!("M{}Z", path.join("L"))
}
