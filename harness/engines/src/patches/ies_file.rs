//! LM-63 files for renderers' own readers.

use std::fmt::Write;

use luxproof_photometry::LuminousIntensityDistribution;

/// A table as it is, in an LM-63 file.
pub(crate) fn of_table(distribution: &LuminousIntensityDistribution, about: &str) -> String {
    let planes = (0..distribution.c_deg().len()).map(|c| distribution.plane(c));
    text(&["[MANUFAC] luxproof", about], distribution.gamma_deg(), distribution.c_deg(), planes)
}

/// Planes at angles in degrees, under keywords.
pub(crate) fn text<'a>(
    keywords: &[&str],
    v_deg: &'a [f64],
    h_deg: &'a [f64],
    planes: impl Iterator<Item = &'a [f64]>,
) -> String {
    let mut text = "IESNA:LM-63-2002\n".to_owned();
    for line in keywords {
        writeln!(text, "{line}").ok();
    }
    writeln!(text, "TILT=NONE\n1 -1 1 {} {} 1 2 0 0 0\n1 1 0", v_deg.len(), h_deg.len()).ok();
    for values in [v_deg, h_deg].into_iter().chain(planes) {
        for line in values.chunks(10) {
            // Renderers keep no more of them.
            let words: Vec<String> = line.iter().map(|v| (*v as f32).to_string()).collect();
            writeln!(text, "{}", words.join(" ")).ok();
        }
    }
    text
}
