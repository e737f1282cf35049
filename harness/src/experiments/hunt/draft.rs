//! A spec that can be changed: typed, with the files that it names, written as a real spec and read back by the ordinary reader.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use luminaire::photometry::lm63::{self, Lm63Details};
use luminaire::photometry::{self, Details, Goniometer, Photometry};

use crate::spec::model::LuminaireSpec;
use crate::spec::{Case, Spec, SpecError, specs, yaml};
use crate::system::files::{MAX_BYTES, read_bounded};

#[derive(Clone, Debug)]
pub(super) struct Draft {
    pub(super) spec: Spec,
    /// By name, beside the spec.
    pub(super) files: BTreeMap<PathBuf, File>,
}

/// A file that a spec names.
#[derive(Clone, Debug)]
pub(super) struct File {
    pub(super) bytes: Vec<u8>,
    /// What it says of a luminaire, where it does.
    pub(super) photometry: Option<Photometry>,
}

impl File {
    /// A photometric file as LM-63-2002, as it is read back.
    pub(super) fn lm63(photometry: &Photometry) -> Self {
        Self::of_lm63(lm63::write_2002(photometry).text.into_bytes())
    }

    pub(super) fn of_lm63(bytes: Vec<u8>) -> Self {
        Self { photometry: lm63::parse(&bytes).ok(), bytes }
    }

    /// Columns and rows of its table: C planes and gamma angles, or of type A or B the horizontal and vertical angles.
    fn table(&self) -> Option<[usize; 2]> {
        let photometry = self.photometry.as_ref()?;
        let own = [photometry.distribution.c_deg().len(), photometry.distribution.gamma_deg().len()];
        let Details::Lm63(Lm63Details { goniometer: Goniometer::A | Goniometer::B, .. }) = photometry.details else {
            return Some(own);
        };
        // After what may be said of the tilt: lamps, lumens, multiplier, and how many angles there are.
        let text = String::from_utf8_lossy(&self.bytes);
        let mut words = text.lines().skip_while(|l| !l.starts_with("TILT=")).skip(1).flat_map(str::split_whitespace);
        let vertical = words.nth(3)?.parse().ok()?;
        Some([words.next()?.parse().ok()?, vertical])
    }
}

impl Draft {
    /// The cases of a spec file, each with its name and its files beside it under short names.
    pub(super) fn read(path: &Path) -> Result<Vec<(String, Self)>, SpecError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let draft = |(name, spec)| Ok((name, Self::of(spec, folder)?));
        specs(path)?.into_iter().map(draft).collect()
    }

    fn of(mut spec: Spec, folder: &Path) -> Result<Self, SpecError> {
        let mut files: BTreeMap<PathBuf, File> = BTreeMap::new();
        let mut names: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
        let mut take_in = |named: &mut PathBuf| -> Result<(), SpecError> {
            let path = folder.join(&*named);
            if let Some(name) = names.get(&path) {
                named.clone_from(name);
                return Ok(());
            }
            let base = PathBuf::from(path.file_name().unwrap_or(path.as_os_str()));
            let other = || PathBuf::from(format!("{}-{}", names.len(), base.display()));
            let name = if files.contains_key(&base) { other() } else { base.clone() };
            let unreadable = |e: io::Error| SpecError::of(&path, format!("cannot be read: {e}"), "check the path");
            let bytes = read_bounded(&path, MAX_BYTES).map_err(unreadable)?;
            let photometry = photometry::read_by(&path, &|path| read_bounded(path, MAX_BYTES)).ok();
            files.insert(name.clone(), File { bytes, photometry });
            named.clone_from(&name);
            names.insert(path, name);
            Ok(())
        };
        spec.luminaires = spec.luminaires.iter().flat_map(LuminaireSpec::apart).collect();
        for luminaire in &mut spec.luminaires {
            take_in(&mut luminaire.photometry)?;
        }
        for mesh in spec.obstacles.iter_mut().filter_map(|o| o.mesh.as_mut()) {
            take_in(&mut mesh.file)?;
        }
        if let Some(published) = &mut spec.published {
            take_in(published)?;
        }
        Ok(Self { spec, files })
    }

    /// What the file of a luminaire says.
    pub(super) fn photometry(&self, luminaire: &LuminaireSpec) -> Option<&Photometry> {
        self.files.get(&luminaire.photometry)?.photometry.as_ref()
    }

    /// The tables of all luminaires.
    pub(super) fn tables(&self) -> impl Iterator<Item = &Photometry> {
        self.spec.luminaires.iter().filter_map(|l| self.photometry(l))
    }

    /// Leaves out the files that nothing names.
    pub(super) fn tidied(mut self) -> Self {
        let spec = &self.spec;
        let photometry = spec.luminaires.iter().map(|l| &l.photometry);
        let meshes = spec.obstacles.iter().filter_map(|o| o.mesh.as_ref().map(|m| &m.file));
        let named: Vec<PathBuf> = photometry.chain(meshes).chain(&spec.published).cloned().collect();
        self.files.retain(|name, _| named.contains(name));
        self
    }

    /// Writes the spec under a name, and its files beside it.
    pub(super) fn write(&self, folder: &Path, name: &str) -> io::Result<PathBuf> {
        std::fs::create_dir_all(folder)?;
        for (name, file) in &self.files {
            std::fs::write(folder.join(name), &file.bytes)?;
        }
        let path = folder.join(name).with_extension("yaml");
        std::fs::write(&path, yaml(&self.spec))?;
        Ok(path)
    }

    /// What the ordinary reader makes of it.
    pub(super) fn case(&self) -> Option<Case> {
        let folder = tempfile::tempdir().ok()?;
        Case::load(&self.write(folder.path(), "spec").ok()?).ok()
    }

    /// Lines of the spec.
    pub(super) fn lines(&self) -> usize {
        yaml(&self.spec).lines().count()
    }

    /// Columns and rows of the largest table.
    pub(super) fn table(&self) -> [usize; 2] {
        let files = self.spec.luminaires.iter().filter_map(|l| self.files.get(&l.photometry));
        files.filter_map(File::table).max_by_key(|[c, gamma]| c * gamma).unwrap_or_default()
    }
}
