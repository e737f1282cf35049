//! Reader of GLDF containers: a zip with `product.xml`, which lists the photometric files of a product.
//!
//! Source: Global Lighting Data Format 1.0 (gldf.io), `GeneralDefinitions`: `Files/File` has an id, a content type (`ldc/eulumdat`,
//! `ldc/ies`) and a name, whose file lies in the folder `ldc`; `Photometries/Photometry` refers to it by
//! `PhotometryFileReference fileId=`.

use std::io::{Cursor, Read};

use zip::ZipArchive;

use super::error::{Problem, ReadError};
use super::text::{Text, decode, without_utf16};
use super::xml::{child, document, is};

/// No more is unpacked, whatever an archive says, of `product.xml`, and of a photometric file.
const MOST_OF_PRODUCT: u64 = 4 << 20;
const MOST_OF_FILE: u64 = 16 << 20;

/// How a zip begins.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// A photometric file in the container.
pub(super) struct Part {
    /// Its name, without folder.
    pub(super) name: String,
    pub(super) bytes: Vec<u8>,
}

/// A file that photometries refer to.
struct Listed {
    name: String,
    /// What it may be named by: its name, its id, those of its photometries.
    aliases: Vec<String>,
}

/// What lists the files of a product.
pub(super) const PRODUCT: &str = "product.xml";

/// The photometric file that a product has, or that is meant by its name or the id of file or photometry.
pub(super) fn part(bytes: &[u8], which: Option<&str>) -> Result<Part, ReadError> {
    // What is wrong with an archive has no line.
    let error = |problem| ReadError { line: 0, column: 0, ..Text::new(&[]).error(0, problem) };
    let refused = |message: String| error(Problem::Archive { message });
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|e| refused(format!("the archive cannot be opened: {e}")))?;
    let product = unpacked(&mut archive, PRODUCT, MOST_OF_PRODUCT).map_err(refused)?;
    let product = without_utf16(&product);
    let decoded = decode(Text::new(&product).bytes);
    let listed = listed(&Text::new(decoded.as_bytes()), &decoded)?;
    let names = || listed.iter().map(|file| file.name.clone()).collect::<Vec<_>>();
    let chosen = match which {
        None => match &listed[..] {
            [] => return Err(refused("product.xml lists no photometric file of the container".into())),
            [one] => one,
            _ => return Err(error(Problem::Several { names: names() })),
        },
        Some(which) => match listed.iter().find(|file| file.aliases.iter().any(|alias| alias == which)) {
            Some(one) => one,
            None => return Err(error(Problem::NoSuchPart { name: which.into(), names: names() })),
        },
    };
    let bytes = unpacked(&mut archive, &format!("ldc/{}", chosen.name), MOST_OF_FILE).map_err(refused)?;
    Ok(Part { name: chosen.name.clone(), bytes })
}

/// The local files that the photometries of a product refer to, each once.
fn listed(text: &Text, decoded: &str) -> Result<Vec<Listed>, ReadError> {
    let document = document(text, decoded)?;
    let definitions = child(document.root_element(), "GeneralDefinitions");
    let list = |of: &str, each: &'static str| {
        let list = definitions.and_then(|definitions| child(definitions, of));
        list.into_iter().flat_map(move |list| list.children().filter(move |node| is(*node, each)))
    };
    let mut files: Vec<Listed> = vec![];
    for photometry in list("Photometries", "Photometry") {
        let reference = child(photometry, "PhotometryFileReference").and_then(|node| node.attribute("fileId"));
        let Some(id) = reference else { continue };
        let is_meant = |file: &roxmltree::Node| file.attribute("id") == Some(id);
        let Some(file) = list("Files", "File").find(is_meant) else {
            let message = format!("a photometry refers to the file `{id}`, which is not in <Files>");
            return Err(text.error(photometry.range().start, Problem::Xml { message }));
        };
        let name = file.text().unwrap_or_default().trim();
        // What lies behind a URL is not in the container.
        if name.is_empty() || file.attribute("type").is_some_and(|kind| kind == "url") {
            continue;
        }
        let own = photometry.attribute("id").map(str::to_owned);
        if let Some(known) = files.iter_mut().find(|known| known.name == name) {
            known.aliases.extend(own);
        } else {
            let aliases = [name, id].map(str::to_owned).into_iter().chain(own).collect();
            files.push(Listed { name: name.into(), aliases });
        }
    }
    Ok(files)
}

/// A file of the archive, as far as it is not larger than any that is meant.
fn unpacked(archive: &mut ZipArchive<Cursor<&[u8]>>, name: &str, most: u64) -> Result<Vec<u8>, String> {
    let file = archive.by_name(name).map_err(|e| format!("{name} in the archive cannot be opened: {e}"))?;
    let mut bytes = vec![];
    let read = file.take(most + 1).read_to_end(&mut bytes);
    read.map_err(|e| format!("{name} in the archive cannot be unpacked: {e}"))?;
    if bytes.len() as u64 > most {
        return Err(format!("{name} in the archive unpacks to more than {} MB", most >> 20));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::path::Path;

    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipWriter};

    use super::*;
    use crate::photometry::{LuminousIntensityDistribution, Photometry, Tolerance, eulumdat, lm63, read_tolerantly_by};

    fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(vec![]));
        for (name, bytes) in files {
            zip.start_file(*name, SimpleFileOptions::default().compression_method(CompressionMethod::Deflated))
                .unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    fn product(files: &str, photometries: &str) -> String {
        format!(
            "<Root><GeneralDefinitions><Files>{files}</Files><Photometries>{photometries}</Photometries></GeneralDefinitions></Root>"
        )
    }

    const FILES: &str = "<File id='f1' contentType='ldc/eulumdat' type='localFileName'>a.ldt</File>\
        <File id='f2' contentType='ldc/ies' type='localFileName'>b.ies</File><File id='f3' type='url'>http://x/c.ldt</File>";
    const FIRST: &str = "<Photometry id='p1'><PhotometryFileReference fileId='f1'/></Photometry>";
    const SECOND: &str = "<Photometry id='p2'><PhotometryFileReference fileId='f2'/></Photometry>";
    const FAR: &str = "<Photometry id='p3'><PhotometryFileReference fileId='f3'/></Photometry>";

    fn light(candela: f64) -> Photometry {
        Photometry::of(LuminousIntensityDistribution::axial(vec![0.0, 90.0], vec![candela, 0.0]).unwrap())
    }

    fn container(photometries: &str) -> Vec<u8> {
        let product = product(FILES, photometries);
        let (a, b) = (eulumdat::write(&light(100.0)).text, lm63::write_2019(&light(200.0)).text);
        zipped(&[("product.xml", product.as_bytes()), ("ldc/a.ldt", a.as_bytes()), ("ldc/b.ies", b.as_bytes())])
    }

    fn read(name: &str, bytes: &[u8]) -> Result<Photometry, ReadError> {
        let open = |path: &Path| {
            assert_eq!(path, Path::new("there/lamp.gldf"));
            Ok(bytes.to_vec())
        };
        read_tolerantly_by(&Path::new("there").join(name), &open, Tolerance::Strict)
    }

    #[test]
    fn the_one_photometry_of_a_product_is_read_and_is_its_source() {
        let read = read("lamp.gldf", &container(&format!("{FAR}{SECOND}{SECOND}"))).unwrap();
        assert!((read.distribution.plane(0)[0] - 200.0).abs() < 1e-9);
        assert_eq!((read.source.len(), read.source[0].name.as_str()), (1, "b.ies"));
        assert!(read.lm63_file().unwrap().bytes.starts_with(b"IES:LM-63-2019"));
    }

    #[test]
    fn of_several_photometries_one_is_named_by_any_of_its_names() {
        let bytes = container(&format!("{FIRST}{SECOND}"));
        let error = read("lamp.gldf", &bytes).unwrap_err();
        assert_eq!(error.problem, Problem::Several { names: vec!["a.ldt".into(), "b.ies".into()] });
        assert!(error.help().contains("lamp.gldf#NAME") && error.file == Path::new("there/lamp.gldf"));
        for (name, candela) in [("a.ldt", 100.0), ("f1", 100.0), ("p1", 100.0), ("b.ies", 200.0), ("p2", 200.0)] {
            let read = read(&format!("lamp.gldf#{name}"), &bytes).unwrap();
            assert!((read.distribution.plane(0)[0] - candela).abs() < 1e-9, "{name}");
        }
        let error = read("lamp.gldf#c", &bytes).unwrap_err();
        assert!(error.message().contains("no photometry `c`; it holds a.ldt, b.ies"), "{error}");
    }

    #[test]
    fn a_container_that_is_damaged_or_lacks_a_file_is_refused_in_words() {
        let whole = container(FIRST);
        for (bytes, word) in [
            (whole[..whole.len() / 2].to_vec(), "cannot be opened"),
            (zipped(&[("other.xml", b"<a/>")]), "product.xml in the archive cannot be opened"),
            (zipped(&[("product.xml", b"<Root>")]), "never closed"),
            (zipped(&[("product.xml", b"<Root/>")]), "lists no photometric file"),
            (container(FAR), "lists no photometric file"),
            (zipped(&[("product.xml", product(FILES, FIRST).as_bytes())]), "ldc/a.ldt in the archive"),
            (zipped(&[("product.xml", product("", FIRST).as_bytes())]), "the file `f1`, which is not in"),
        ] {
            let error = read("lamp.gldf", &bytes).unwrap_err();
            assert!(error.message().contains(word), "{word}: {error}");
            // Lines are those of the list of files; an archive has none.
            let is_listed = error.file == Path::new("there/lamp.gldf#product.xml");
            assert_eq!(is_listed, error.line > 0, "{error}");
        }
        let broken = product(FILES, SECOND);
        let error = read("lamp.gldf", &zipped(&[("product.xml", broken.as_bytes()), ("ldc/b.ies", b"TILT=NONE\n1 x")]));
        let error = error.unwrap_err();
        assert_eq!((error.file.as_path(), error.line, error.column), (Path::new("there/lamp.gldf#b.ies"), 2, 3));
    }

    #[test]
    fn what_unpacks_to_more_than_any_file_has_is_left_in_its_archive() {
        let bomb = vec![b' '; usize::try_from(MOST_OF_FILE).unwrap() + 1];
        let product = product(FILES, FIRST);
        for files in
            [[("product.xml", &bomb[..]), ("a", b"")], [("product.xml", product.as_bytes()), ("ldc/a.ldt", &bomb)]]
        {
            let bytes = zipped(&files);
            assert!(bytes.len() < 100_000);
            assert!(read("lamp.gldf", &bytes).unwrap_err().message().contains("unpacks to more than"));
        }
    }
}
