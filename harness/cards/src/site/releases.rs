//! The older releases of all renderers as data of the first page: its script unfolds a column from them.

use std::collections::HashMap;

use serde::Serialize;

use super::{STATES, published, shortened};
use crate::cards::anchor;
use crate::{Capability, Cards, CardsError, CellCard, RendererCard, Standing};

/// Letters of a release in the head of a column.
const RELEASE_LETTERS: usize = 16;
/// Letters of a fault.
const FAULT_LETTERS: usize = 40;

/// What the script of the first page reads.
#[derive(Serialize)]
struct ReleaseData<'a> {
    /// Key and sign of each state.
    states: Vec<(&'a str, &'a str)>,
    capabilities: Vec<&'a str>,
    /// Each text once; the number of the state stands before it.
    texts: Vec<String>,
    renderers: Vec<RendererData<'a>>,
}

#[derive(Serialize)]
struct RendererData<'a> {
    name: &'a str,
    slug: &'a str,
    /// Label and anchor, the newest first.
    releases: Vec<(String, String)>,
    /// By older release and capability: twice the number of the text, plus 1 if the cell differs from the release before.
    cells: Vec<Vec<usize>>,
}

/// The texts of cells, each with a number.
#[derive(Default)]
struct Texts {
    numbers: HashMap<String, usize>,
    all: Vec<String>,
}

impl Texts {
    fn number(&mut self, text: String) -> usize {
        let next = self.all.len();
        let number = *self.numbers.entry(text.clone()).or_insert(next);
        if number == next {
            self.all.push(text);
        }
        number
    }
}

/// The data as JSON that may stand in a page: no character of it ends the element.
pub(super) fn release_data(cards: &Cards) -> Result<String, CardsError> {
    let capabilities = published(cards);
    let mut texts = Texts::default();
    let renderers = cards.renderers.iter().map(|renderer| renderer_data(renderer, &capabilities, &mut texts)).collect();
    let data = ReleaseData {
        states: STATES.iter().map(|(key, sign, _, _)| (*key, *sign)).collect(),
        capabilities: capabilities.iter().map(|capability| capability.id.as_str()).collect(),
        texts: texts.all,
        renderers,
    };
    Ok(serde_json::to_string(&data)?.replace('<', "\\u003c"))
}

fn renderer_data<'a>(renderer: &'a RendererCard, capabilities: &[&Capability], texts: &mut Texts) -> RendererData<'a> {
    let releases = renderer.releases.iter();
    let releases = releases.map(|r| (shortened(r.release.as_str(), RELEASE_LETTERS), anchor(&r.release))).collect();
    let older = renderer.releases.iter().skip(1).map(|release| {
        let cells = capabilities.iter().map(|capability| {
            let is_changed = release.changes.iter().any(|change| change.capability == capability.id);
            2 * texts.number(release.cell(&capability.id).map(cell_text).unwrap_or_default()) + usize::from(is_changed)
        });
        cells.collect()
    });
    RendererData { name: &renderer.name, slug: &renderer.slug, cells: older.collect(), releases }
}

/// The number of the state, the cell in a few words, and its fault in a second line.
fn cell_text(cell: &CellCard) -> String {
    let standing = &cell.cell.standing;
    let state = STATES.iter().position(|(key, _, _, _)| *key == standing.key()).unwrap_or_default();
    let fault = match standing {
        Standing::Wrong { fault: text, .. } | Standing::Failed { reason: text, .. } => {
            format!("\n{}", shortened(super::index::first_clause(text), FAULT_LETTERS))
        }
        Standing::Accurate { .. }
        | Standing::Limited { .. }
        | Standing::NotSupported { .. }
        | Standing::NotTested { .. } => String::new(),
    };
    format!("{state}{}{fault}", cell.headline.replace(" %", "\u{a0}%"))
}
