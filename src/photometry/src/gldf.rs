//! Reader of GLDF containers: a zip with `product.xml`, which lists the photometric files of a product.
//!
//! Source: Global Lighting Data Format 1.0 (gldf.io), `GeneralDefinitions`. `Files/File` has an id, a content type
//! (`ldc/eulumdat`, `ldc/ies`) and the name of a file in the folder `ldc`. `Photometries/Photometry` refers to it by
//! `PhotometryFileReference fileId=`.

use std::collections::HashMap;
use std::io::{Cursor, Read};

use roxmltree::Node;
use zip::ZipArchive;

use super::error::{Problem, ReadError};
use super::text::{Text, decode, without_utf16};
use super::xml::{child, is, parse_document};

/// The largest size of `product.xml` when unpacked.
const MAX_PRODUCT_BYTES: u64 = 4 << 20;
/// The largest size of a photometric file when unpacked.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// Whether bytes begin as a zip.
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
struct ListedFile {
    name: String,
    /// The names by which a path can refer to it: the file's name and id, and the ids of its photometries.
    aliases: Vec<String>,
}

/// The list of the files of a product.
pub(super) const PRODUCT: &str = "product.xml";

/// Extracts the only photometric file, or the one with this name, file id or photometry id.
pub(super) fn extract_part(bytes: &[u8], which: Option<&str>) -> Result<Part, ReadError> {
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|e| archive_error(format!("the archive cannot be opened: {e}")))?;
    let product = unpack(&mut archive, PRODUCT, MAX_PRODUCT_BYTES).map_err(archive_error)?;
    let product = without_utf16(&product);
    let decoded = decode(Text::new(&product).bytes);
    let files = list_files(&Text::new(decoded.as_bytes()), &decoded)?;
    let chosen = choose_file(&files, which)?;
    let bytes = unpack(&mut archive, &format!("ldc/{}", chosen.name), MAX_FILE_BYTES).map_err(archive_error)?;
    Ok(Part { name: chosen.name.clone(), bytes })
}

/// Chooses the only file, or the one with this alias.
fn choose_file<'f>(files: &'f [ListedFile], which: Option<&str>) -> Result<&'f ListedFile, ReadError> {
    let Some(which) = which else {
        return match files {
            [] => Err(archive_error("product.xml lists no photometric file of the container".into())),
            [only] => Ok(only),
            _ => Err(placeless_error(Problem::Several { names: file_names(files) })),
        };
    };
    let chosen = files.iter().find(|file| file.aliases.iter().any(|alias| alias == which));
    chosen.ok_or_else(|| placeless_error(Problem::NoSuchPart { name: which.into(), names: file_names(files) }))
}

/// The names of all files.
fn file_names(files: &[ListedFile]) -> Vec<String> {
    files.iter().map(|file| file.name.clone()).collect()
}

/// A refusal without a line: an archive has none.
fn placeless_error(problem: Problem) -> ReadError {
    ReadError { line: 0, column: 0, ..Text::new(&[]).error(0, problem) }
}

/// A refusal of a damaged or incomplete archive.
fn archive_error(message: String) -> ReadError {
    placeless_error(Problem::Archive { message })
}

/// The elements named `element` in the list named `list` of the definitions of a product.
fn list_elements<'d>(
    definitions: Option<Node<'d, 'd>>,
    list: &str,
    element: &'static str,
) -> impl Iterator<Item = Node<'d, 'd>> + use<'d> {
    let list = definitions.and_then(|definitions| child(definitions, list));
    list.into_iter().flat_map(move |list| list.children().filter(move |node| is(*node, element)))
}

/// Lists the local files that the photometries of a product refer to, each once.
fn list_files(text: &Text, decoded: &str) -> Result<Vec<ListedFile>, ReadError> {
    let document = parse_document(text, decoded)?;
    let definitions = child(document.root_element(), "GeneralDefinitions");
    // Of several files of one id the first counts.
    let mut by_id = HashMap::new();
    for file in list_elements(definitions, "Files", "File") {
        if let Some(id) = file.attribute("id") {
            by_id.entry(id).or_insert(file);
        }
    }
    let (mut files, mut places): (Vec<ListedFile>, HashMap<String, usize>) = (vec![], HashMap::new());
    for photometry in list_elements(definitions, "Photometries", "Photometry") {
        let reference = child(photometry, "PhotometryFileReference").and_then(|node| node.attribute("fileId"));
        let Some(id) = reference else { continue };
        let Some(file) = by_id.get(id) else {
            let message = format!("a photometry refers to the file `{id}`, which is not in <Files>");
            return Err(text.error(photometry.range().start, Problem::Xml { message }));
        };
        let name = file.text().unwrap_or_default().trim();
        // A file behind a URL is not in the container.
        if name.is_empty() || file.attribute("type").is_some_and(|kind| kind == "url") {
            continue;
        }
        let photometry_id = photometry.attribute("id").map(str::to_owned);
        if let Some(place) = places.get(name) {
            files[*place].aliases.extend(photometry_id);
        } else {
            places.insert(name.to_owned(), files.len());
            let aliases = [name, id].map(str::to_owned).into_iter().chain(photometry_id).collect();
            files.push(ListedFile { name: name.into(), aliases });
        }
    }
    Ok(files)
}

/// Unpacks a file of the archive, up to a size in bytes.
fn unpack(archive: &mut ZipArchive<Cursor<&[u8]>>, name: &str, most: u64) -> Result<Vec<u8>, String> {
    let file = archive.by_name(name).map_err(|e| format!("`{name}` in the archive cannot be opened: {e}"))?;
    let mut bytes = vec![];
    let read = file.take(most + 1).read_to_end(&mut bytes);
    read.map_err(|e| format!("`{name}` in the archive cannot be unpacked: {e}"))?;
    if bytes.len() as u64 > most {
        return Err(format!("`{name}` in the archive unpacks to more than {} MB", most >> 20));
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
    use crate::{LuminousIntensityDistribution, Photometry, Tolerance, eulumdat, lm63, read_tolerantly_by};

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

    /// Reads a container in the folder `there`, and checks that nothing else is opened.
    fn read(name: &str, bytes: &[u8]) -> Result<Photometry, ReadError> {
        let path = Path::new("there").join(name);
        read_tolerantly_by(
            &path,
            &|path| {
                assert_eq!(path, Path::new("there/lamp.gldf"));
                Ok(bytes.to_vec())
            },
            Tolerance::Strict,
        )
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
        assert!(error.message().contains("no photometry `c`; it holds `a.ldt`, `b.ies`"), "{error}");
    }

    #[test]
    fn a_container_that_is_damaged_or_lacks_a_file_is_refused_in_words() {
        let whole = container(FIRST);
        for (bytes, word) in [
            (whole[..whole.len() / 2].to_vec(), "cannot be opened"),
            (zipped(&[("other.xml", b"<a/>")]), "`product.xml` in the archive cannot be opened"),
            (zipped(&[("product.xml", b"<Root>")]), "never closed"),
            (zipped(&[("product.xml", b"<Root/>")]), "lists no photometric file"),
            (container(FAR), "lists no photometric file"),
            (zipped(&[("product.xml", product(FILES, FIRST).as_bytes())]), "`ldc/a.ldt` in the archive"),
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
    fn a_file_that_unpacks_to_more_than_the_limit_is_refused() {
        let bomb = vec![b' '; usize::try_from(MAX_FILE_BYTES).unwrap() + 1];
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
