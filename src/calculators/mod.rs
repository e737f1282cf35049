//! The IESNA methods and the closed forms they rest on, each saying how far its own assumptions hold.
//!
//! | module | gives | exact twin |
//! |---|---|---|
//! | [`inverse_square`] | direct illuminance of points | [`inverse_square::lambertian_twin`] |
//! | [`zonal_cavity`] | coefficients of utilization and exitance | [`zonal_multiplier`], [`zonal_cavity::balance`] |
//! | [`exitance_difference`] | indirect and total illuminance of points (IP-ED) | [`uniform_surfaces`] |
//! | [`ugr`] | unified glare rating in standard rooms, and of observers in any | a room placed luminaire by luminaire, in its tests |
//! | [`closed_form`] | laws of rooms, spheres and planes | they are exact |
//!
//! Nothing here imports the simulator: each bears witness against the other.

pub mod closed_form;
mod deviation;
pub mod exitance_difference;
pub mod inverse_square;
mod layers;
mod room_flux;
pub mod ugr;
pub mod uniform_surfaces;
mod utilization_print;
mod validity;
pub mod zonal_cavity;
pub mod zonal_multiplier;

pub use deviation::{DeviationSplit, Uncertain};
pub use validity::{Calculated, NotApplicable, Validity};

#[cfg(test)]
mod independence {
    //! Scans the imports of this folder and of the simulator.

    use std::path::{Path, PathBuf};

    /// Lines of the sources under `folder` that name `module`, comments aside.
    fn mentions(folder: &Path, module: &str) -> (usize, Vec<String>) {
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        let mut scanned = 0;
        let mut found = vec![];
        while let Some(file) = files.pop() {
            if file.is_dir() {
                files.extend(std::fs::read_dir(file).unwrap().map(|entry| entry.unwrap().path()));
                continue;
            }
            scanned += 1;
            for line in std::fs::read_to_string(&file).unwrap().lines() {
                let code = line.split("//").next().unwrap_or_default();
                let imports = [format!("{module}::"), format!("crate::{module}")];
                if imports.iter().any(|import| code.contains(import.as_str())) {
                    found.push(format!("{}: {line}", file.display()));
                }
            }
        }
        (scanned, found)
    }

    #[test]
    fn the_witnesses_do_not_confer() {
        let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        for (folder, other) in [("calculators", "simulator"), ("simulator", "calculators")] {
            let (scanned, found) = mentions(&src.join(folder), other);
            assert!(scanned > 0, "no source under {folder}");
            assert!(found.is_empty(), "{found:#?}");
        }
    }

    #[test]
    fn the_scan_sees_an_import_where_there_is_one() {
        let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        assert!(!mentions(&src.join("calculators"), "scene").1.is_empty());
    }
}
