//! `luxproof photometry FILE --convert OUT`: the file in another format, and in words what is lost in it.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use luminaire::photometry::lm63::Edition;
use luminaire::photometry::{FileFormat, ForwardPolicy, Lint, Photometry};
use miette::{Report as Diagnostic, miette};

/// Arguments of the conversion.
#[derive(Debug, Args)]
pub(super) struct ConversionArgs {
    /// Write the one FILE in another format, by extension: .ldt is EULUMDAT, .ies is LM-63, .xml is TM-33-23
    #[arg(long, value_name = "OUT")]
    convert: Option<PathBuf>,
    /// Which edition of LM-63 to write
    #[arg(long, value_enum, value_name = "YEAR", default_value_t = Year::Y2019, requires = "convert")]
    edition: Year,
    /// What to keep where forward is another plane, C0 in LM-63 and TM-33 and C90 in EULUMDAT: every C angle, so that a room
    /// that places luminaires by C angles, as specs do, is lit as before; or the forward direction, so that BUG zones stay and
    /// the table turns by a quarter. What turns is told either way
    #[arg(long, value_enum, value_name = "POLICY", default_value_t = Forward::KeepAngles, requires = "convert")]
    forward: Forward,
}

/// What a conversion keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Forward {
    KeepAngles,
    KeepForward,
}

impl Forward {
    /// The policy, and the words that offer the other one.
    fn policy(self) -> (ForwardPolicy, &'static str) {
        match self {
            Self::KeepAngles => (ForwardPolicy::KeepAngles, "--forward keep-forward turns the table instead"),
            Self::KeepForward => (ForwardPolicy::KeepForward, "--forward keep-angles leaves it as it is"),
        }
    }
}

/// The editions that are still asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Year {
    #[value(name = "1995")]
    Y1995,
    #[value(name = "2002")]
    Y2002,
    #[value(name = "2019")]
    Y2019,
}

impl Year {
    fn edition(self) -> Edition {
        match self {
            Self::Y1995 => Edition::Lm63_1995,
            Self::Y2002 => Edition::Lm63_2002,
            Self::Y2019 => Edition::Lm63_2019,
        }
    }
}

impl ConversionArgs {
    pub(super) fn is_asked(&self) -> bool {
        self.convert.is_some()
    }

    /// Writes the file, if one is asked for, and tells on stderr what turns, is lost, computed or unknown.
    ///
    /// Returns the lint of what turns.
    pub(super) fn run(&self, photometry: &Photometry) -> Result<Option<Lint>, Diagnostic> {
        let Some(out) = &self.convert else { return Ok(None) };
        let format = format_of(out, self.edition.edition())?;
        let (policy, otherwise) = self.forward.policy();
        let aimed = photometry.aimed_for(format, policy);
        let written = format.write(&aimed.photometry);
        super::save(out, &written.text)?;
        if let Some(lint) = &aimed.lint {
            crate::cli::complain(&format!("{}; {otherwise}", super::told(&out.display().to_string(), lint)));
        }
        for told in written.losses.iter().chain(&written.notes) {
            crate::cli::complain(&format!("{}: {told}", out.display()));
        }
        Ok(aimed.lint)
    }
}

/// The format that a file's extension names, LM-63 of an edition.
pub(super) fn format_of(out: &Path, edition: Edition) -> Result<FileFormat, Diagnostic> {
    let extension = out.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("ldt") => Ok(FileFormat::Eulumdat),
        Some("xml") => Ok(FileFormat::Tm33),
        Some("ies") => Ok(FileFormat::Lm63(edition)),
        _ => Err(miette!(help = "name a .ldt, .ies or .xml file", "{} names no format to write", out.display())),
    }
}
