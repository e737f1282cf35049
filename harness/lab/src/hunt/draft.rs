//! A spec that steps can change: typed, with the files that it names. It is written as a real spec,
//! and the ordinary reader reads it.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use luxproof_photometry::lm63::{self, Lm63Details};
use luxproof_photometry::{Details, Goniometer, Photometry};

use luxproof_process::files::{MAX_BYTES, read_bounded};
use luxproof_spec::model::LuminaireSpec;
use luxproof_spec::{Case, Spec, SpecError, specs, yaml};

/// A spec with its files.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    pub(super) spec: Spec,
    /// The files that the spec names, by name.
    pub(super) files: BTreeMap<PathBuf, File>,
}

/// A file that a spec names.
#[derive(Clone, Debug)]
pub(super) struct File {
    pub(super) bytes: Vec<u8>,
    /// The luminaire that the file describes, where it is a photometric file.
    pub(super) photometry: Option<Photometry>,
}

impl File {
    /// A photometric file in LM-63-2002, as a reader reads it back.
    pub(super) fn lm63(photometry: &Photometry) -> Self {
        Self::from_lm63(lm63::write_2002(photometry).text.into_bytes())
    }

    /// A file with LM-63 content, which may be invalid.
    pub(super) fn from_lm63(bytes: Vec<u8>) -> Self {
        Self { photometry: lm63::parse(&bytes).ok(), bytes }
    }

    /// The columns and rows of the table: C planes and gamma angles, for types A and B the
    /// horizontal and vertical angles.
    fn table_size(&self) -> Option<[usize; 2]> {
        let photometry = self.photometry.as_ref()?;
        let size = [photometry.distribution.c_deg().len(), photometry.distribution.gamma_deg().len()];
        let Details::Lm63(Lm63Details { goniometer: Goniometer::A | Goniometer::B, .. }) = photometry.details else {
            return Some(size);
        };
        // The reader turns types A and B into type C, so the file itself is parsed. After the line
        // of the tilt follow the number of lamps, the lumens, the multiplier, and the numbers of
        // angles.
        let text = String::from_utf8_lossy(&self.bytes);
        let mut words = text.lines().skip_while(|l| !l.starts_with("TILT=")).skip(1).flat_map(str::split_whitespace);
        let vertical = words.nth(3)?.parse().ok()?;
        Some([words.next()?.parse().ok()?, vertical])
    }
}

/// The files of a spec while they are read, with short names.
struct FileCollector<'a> {
    folder: &'a Path,
    files: BTreeMap<PathBuf, File>,
    /// The short name for each path.
    names: BTreeMap<PathBuf, PathBuf>,
}

impl FileCollector<'_> {
    /// Reads the file that a spec names and replaces its path by a short name.
    fn add(&mut self, named: &mut PathBuf) -> Result<(), SpecError> {
        let path = self.folder.join(&*named);
        if let Some(name) = self.names.get(&path) {
            named.clone_from(name);
            return Ok(());
        }
        let mut name = PathBuf::from(path.file_name().unwrap_or(path.as_os_str()));
        // Files of different folders may have one name.
        if self.files.contains_key(&name) {
            name = PathBuf::from(format!("{}-{}", self.names.len(), name.display()));
        }
        let bytes = read_bounded(&path, MAX_BYTES)
            .map_err(|e| SpecError::of(&path, format!("cannot be read: {e}"), "check the path"))?;
        let photometry = luxproof_photometry::read_by(&path, &|path| read_bounded(path, MAX_BYTES)).ok();
        self.files.insert(name.clone(), File { bytes, photometry });
        named.clone_from(&name);
        self.names.insert(path, name);
        Ok(())
    }
}

impl Draft {
    /// Loads the cases of a spec file, each with its name and its files under short names.
    pub(super) fn load(path: &Path) -> Result<Vec<(String, Self)>, SpecError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        specs(path)?.into_iter().map(|(name, spec)| Ok((name, Self::from_spec(spec, folder)?))).collect()
    }

    /// Loads the files that a spec names relative to a folder.
    fn from_spec(mut spec: Spec, folder: &Path) -> Result<Self, SpecError> {
        let mut collector = FileCollector { folder, files: BTreeMap::new(), names: BTreeMap::new() };
        spec.luminaires = spec.luminaires.iter().flat_map(LuminaireSpec::split).collect();
        for luminaire in &mut spec.luminaires {
            collector.add(&mut luminaire.photometry)?;
        }
        for mesh in spec.obstacles.iter_mut().filter_map(|o| o.mesh.as_mut()) {
            collector.add(&mut mesh.file)?;
        }
        if let Some(published) = &mut spec.published {
            collector.add(published)?;
        }
        Ok(Self { spec, files: collector.files })
    }

    /// The content of a luminaire's file.
    pub(super) fn photometry(&self, luminaire: &LuminaireSpec) -> Option<&Photometry> {
        self.files.get(&luminaire.photometry)?.photometry.as_ref()
    }

    /// The photometry of all luminaires.
    pub(super) fn tables(&self) -> impl Iterator<Item = &Photometry> {
        self.spec.luminaires.iter().filter_map(|l| self.photometry(l))
    }

    /// Removes the files that the spec does not name.
    pub(super) fn without_unused_files(mut self) -> Self {
        let spec = &self.spec;
        let photometry = spec.luminaires.iter().map(|l| &l.photometry);
        let meshes = spec.obstacles.iter().filter_map(|o| o.mesh.as_ref().map(|m| &m.file));
        let named: Vec<PathBuf> = photometry.chain(meshes).chain(&spec.published).cloned().collect();
        self.files.retain(|name, _| named.contains(name));
        self
    }

    /// Writes the spec under a name, and its files into the same folder.
    pub(super) fn write(&self, folder: &Path, name: &str) -> io::Result<PathBuf> {
        std::fs::create_dir_all(folder)?;
        for (name, file) in &self.files {
            std::fs::write(folder.join(name), &file.bytes)?;
        }
        let path = folder.join(name).with_extension("yaml");
        std::fs::write(&path, yaml(&self.spec))?;
        Ok(path)
    }

    /// The case that the ordinary reader makes of it; `None` where the reader refuses it.
    pub(super) fn case(&self) -> Option<Case> {
        let folder = tempfile::tempdir().ok()?;
        Case::load(&self.write(folder.path(), "spec").ok()?).ok()
    }

    /// The number of lines of the spec.
    pub(super) fn lines(&self) -> usize {
        yaml(&self.spec).lines().count()
    }

    /// The columns and rows of the largest table.
    pub(super) fn table(&self) -> [usize; 2] {
        let files = self.spec.luminaires.iter().filter_map(|l| self.files.get(&l.photometry));
        files.filter_map(File::table_size).max_by_key(|[c, gamma]| c * gamma).unwrap_or_default()
    }
}
