//! `luxproof photometry report FILE`: all figures of a luminaire, and its diagrams.

mod cone;
mod isocandela;
mod print;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use luxproof_calculators::ugr::Spacing;
use miette::Report as Diagnostic;

use super::figures::Figures;
use super::{Deny, polar, read_all, save};
use luxproof_console as console;
use luxproof_model::Exit;
use luxproof_spec::Trust;

#[derive(Debug, Args)]
pub(super) struct ReportArgs {
    /// A photometric file
    file: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Draw polar.svg, isocandela.svg and cone.svg there
    #[arg(long, value_name = "DIR")]
    svg: Option<PathBuf>,
    /// Spacing of the luminaires in the UGR table over their height above the eye
    #[arg(long, value_enum, value_name = "S/H", default_value_t = UgrSpacing::Quarter)]
    ugr_spacing: UgrSpacing,
    /// Print warnings, and exit with 1 if there are any
    #[arg(long, value_enum, value_name = "WHAT")]
    deny: Option<Deny>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum UgrSpacing {
    /// As catalogues have it
    #[value(name = "0.25")]
    Quarter,
    /// As the examples of CIE 190
    #[value(name = "1")]
    Whole,
}

/// Runs the command.
pub(super) fn run(args: &ReportArgs, trust: Trust) -> Result<Exit, Diagnostic> {
    let Some(([photometry], exit)) = read_all([&args.file], args.deny, trust) else { return Ok(Exit::Usage) };
    let spacing = match args.ugr_spacing {
        UgrSpacing::Quarter => Spacing::Quarter,
        UgrSpacing::Whole => Spacing::Whole,
    };
    let figures = Figures::compute(&args.file, &photometry, spacing);
    console::print(&if args.json { console::json(&figures)? } else { figures.to_string() })?;
    if let Some(folder) = &args.svg {
        let name = args.file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        save(&folder.join("polar.svg"), &polar::diagram(&name, &photometry), trust)?;
        match isocandela::diagram(&name, &photometry) {
            Ok(svg) => save(&folder.join("isocandela.svg"), &svg, trust)?,
            Err(reason) => console::complain(&format!("isocandela.svg is not drawn: {reason}")),
        }
        match cone::diagram(&name, &photometry) {
            Ok(svg) => save(&folder.join("cone.svg"), &svg, trust)?,
            Err(reason) => console::complain(&format!("cone.svg is not drawn: {reason}")),
        }
    }
    Ok(exit)
}

#[cfg(test)]
mod tests;
