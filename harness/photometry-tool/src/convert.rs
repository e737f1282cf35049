//! `luxproof photometry FILE --convert OUT`: the file in another format, with a list of losses.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use luxproof_photometry::lm63::Edition;
use luxproof_photometry::{FileFormat, ForwardPolicy, Lint, Photometry};
use luxproof_spec::Trust;
use miette::{Report as Diagnostic, miette};

/// Arguments of the conversion.
#[derive(Debug, Args)]
pub(super) struct ConversionArgs {
    /// Write one file as .ldt, .ies or .xml (TM-33-23)
    #[arg(long, value_name = "OUT")]
    convert: Option<PathBuf>,
    /// Edition of LM-63 to write
    #[arg(long, value_enum, value_name = "YEAR", default_value_t = Year::Y2019, requires = "convert", hide_short_help = true)]
    edition: Year,
    /// What to preserve if the formats differ in their forward direction
    ///
    /// Forward is C 0 in LM-63 and TM-33, and C 90 in EULUMDAT. `keep-angles` preserves every C angle: rooms that place luminaires by
    /// C angles, as specs do, are lit as before. `keep-forward` preserves the forward direction and BUG zones: the table turns by 90 degrees.
    #[arg(long, value_enum, value_name = "POLICY", default_value_t = Forward::KeepAngles, requires = "convert", hide_short_help = true)]
    forward: Forward,
}

/// The property that a conversion keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Forward {
    KeepAngles,
    KeepForward,
}

impl Forward {
    /// The policy, and a hint to the other one.
    fn policy(self) -> (ForwardPolicy, &'static str) {
        match self {
            Self::KeepAngles => (ForwardPolicy::KeepAngles, "--forward keep-forward turns the table instead"),
            Self::KeepForward => (ForwardPolicy::KeepForward, "--forward keep-angles leaves it as it is"),
        }
    }
}

/// The editions of LM-63 that can be written.
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
    /// Whether the command line requests a conversion.
    pub(super) fn is_requested(&self) -> bool {
        self.convert.is_some()
    }

    /// Writes the requested file, if any, and prints turns, losses, computed and unknown fields to stderr.
    ///
    /// Returns the lint about turns.
    pub(super) fn run(&self, photometry: &Photometry, trust: Trust) -> Result<Option<Lint>, Diagnostic> {
        let Some(out) = &self.convert else { return Ok(None) };
        let format = format_by_extension(out, self.edition.edition())?;
        let (policy, alternative) = self.forward.policy();
        let aimed = photometry.aimed_for(format, policy);
        let written = format.write(&aimed.photometry);
        super::save(out, &written.text, trust)?;
        if let Some(lint) = &aimed.lint {
            let message = super::format_lint(&out.display().to_string(), lint);
            luxproof_console::complain(&format!("{message}; {alternative}"));
        }
        for remark in written.losses.iter().chain(&written.notes) {
            luxproof_console::complain(&format!("{}: {remark}", out.display()));
        }
        Ok(aimed.lint)
    }
}

/// The format of a file extension; LM-63 in this edition.
pub(super) fn format_by_extension(out: &Path, edition: Edition) -> Result<FileFormat, Diagnostic> {
    let extension = out.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("ldt") => Ok(FileFormat::Eulumdat),
        Some("xml") => Ok(FileFormat::Tm33),
        Some("ies") => Ok(FileFormat::Lm63(edition)),
        _ => Err(miette!(help = "name a .ldt, .ies or .xml file", "{} names no format to write", out.display())),
    }
}
