//! `luxproof photometry FILE --convert OUT`: the file in another format, and in words what is lost in it.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use luminaire::photometry::lm63::Edition;
use luminaire::photometry::{FileFormat, Photometry};
use miette::{Report as Diagnostic, miette};

/// Arguments of the conversion.
#[derive(Debug, Args)]
pub(super) struct ConversionArgs {
    /// Write the one FILE in another format, by extension: .ldt is EULUMDAT, .ies is LM-63
    #[arg(long, value_name = "OUT")]
    convert: Option<PathBuf>,
    /// Which edition of LM-63 to write
    #[arg(long, value_enum, value_name = "YEAR", default_value_t = Year::Y2019, requires = "convert")]
    edition: Year,
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

    /// Writes the file, if one is asked for, and tells on stderr what is lost, computed or unknown.
    pub(super) fn run(&self, photometry: &Photometry) -> Result<(), Diagnostic> {
        let Some(out) = &self.convert else { return Ok(()) };
        let written = self.format(out)?.write(photometry);
        super::save(out, &written.text)?;
        for told in written.losses.iter().chain(&written.notes) {
            crate::cli::complain(&format!("{}: {told}", out.display()));
        }
        Ok(())
    }

    fn format(&self, out: &Path) -> Result<FileFormat, Diagnostic> {
        let extension = out.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("ldt") => Ok(FileFormat::Eulumdat),
            Some("ies") => Ok(FileFormat::Lm63(self.edition.edition())),
            _ => Err(miette!(help = "name a .ldt or .ies file", "{} names no format to write", out.display())),
        }
    }
}
