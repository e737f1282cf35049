//! The description of a bundle: an RO-Crate 1.1 (<https://w3id.org/ro/crate/1.1>), JSON-LD by schema.org's terms.

use serde_json::{Value, json};

use super::{INPUTS, LOCK, Lock, RUN, SUMS};
use luxproof_model::REPORT_FILE;
use luxproof_model::Report;
use luxproof_spec::BUNDLE_FILE;

/// What is said where its maker says nothing.
const LICENCE: &str = "No licence is given for this bundle as a whole. Photometric files, meshes and tables belong to their makers: ask them before you pass them on.";

/// A file of the bundle.
pub(super) struct Part<'a> {
    pub(super) name: &'a str,
    pub(super) sha256: &'a str,
    pub(super) bytes: u64,
}

/// What describes a bundle of these files; `SHA256SUMS` lists this one, too, and so has no hash here.
pub(super) fn metadata(report: &Report, lock: &Lock, licence: Option<&str>, parts: &[Part<'_>]) -> Value {
    let names = parts.iter().map(|part| part.name).chain([SUMS]);
    let has_part: Vec<Value> = names.map(|name| json!({"@id": identifier(name)})).collect();
    let is_address = licence.is_some_and(|text| text.starts_with("https://") || text.starts_with("http://"));
    let licence_id = licence.filter(|_| is_address).unwrap_or("#licence");
    let sentences: Vec<String> =
        report.sentences.iter().map(|sentence| format!("{}: {}", sentence.engine, sentence.text)).collect();
    let engines = lock.engines.iter().filter(|engine| engine.version.is_some());
    let mut instruments = vec![json!({"@id": "#luxproof"})];
    instruments.extend(engines.clone().map(|engine| json!({"@id": format!("#engine-{}", engine.id)})));
    let mut graph = vec![
        json!({
            "@id": BUNDLE_FILE, "@type": "CreativeWork", "about": {"@id": "./"},
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        }),
        json!({
            "@id": "./", "@type": "Dataset", "name": format!("luxproof: {}", report.spec.title),
            "description": if sentences.is_empty() { report.summary.to_string() } else { sentences.join("; ") },
            "datePublished": report.started, "license": {"@id": licence_id}, "hasPart": has_part,
            "mentions": {"@id": "#run"},
        }),
        json!({"@id": licence_id, "@type": "CreativeWork", "name": "Licence", "description": licence.unwrap_or(LICENCE)}),
        json!({
            "@id": "#run", "@type": "CreateAction", "name": "The run", "description": lock.command,
            "startTime": report.started, "instrument": instruments,
            "object": lock.specs.iter().map(|spec| json!({"@id": identifier(spec)})).collect::<Vec<_>>(),
            "result": {"@id": format!("{RUN}/{REPORT_FILE}")},
        }),
        json!({
            "@id": "#luxproof", "@type": "SoftwareApplication", "name": "luxproof", "url": env!("CARGO_PKG_REPOSITORY"),
            "version": lock.tool.to_string(), "identifier": lock.tool.commit,
        }),
        json!({"@id": SUMS, "@type": "File", "name": SUMS, "description": "SHA-256 of every other file", "encodingFormat": "text/plain"}),
    ];
    graph.extend(engines.map(|engine| {
        json!({
            "@id": format!("#engine-{}", engine.id), "@type": "SoftwareApplication", "name": engine.id,
            "version": engine.version, "identifier": engine.fingerprint,
        })
    }));
    graph.extend(parts.iter().map(|part| {
        json!({
            "@id": identifier(part.name), "@type": "File", "name": part.name, "description": what(part.name, lock),
            "encodingFormat": format(part.name), "contentSize": part.bytes.to_string(), "sha256": part.sha256,
        })
    }));
    for entity in graph.iter_mut().filter_map(Value::as_object_mut) {
        entity.retain(|_, value| !value.is_null());
    }
    let terms = json!({"sha256": "https://schema.org/sha256"});
    json!({"@context": ["https://w3id.org/ro/crate/1.1/context", terms], "@graph": graph})
}

fn what(name: &str, lock: &Lock) -> &'static str {
    match name {
        LOCK => "What made the run: program, command, engines with their fingerprints, locks of Python's packages",
        "README.md" => "How to verify and repeat it",
        name if lock.specs.iter().any(|spec| spec == name) => "Spec",
        name if name.starts_with(INPUTS) => "Input: what a spec names, or what it is judged by",
        name if name.ends_with(REPORT_FILE) => "Report",
        _ => "Readings of an engine",
    }
}

fn format(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, extension)| extension) {
        Some("json") => "application/json",
        Some("yaml" | "yml") => "application/yaml",
        Some("md") => "text/markdown",
        Some("xml") => "application/xml",
        _ => "text/plain",
    }
}

/// A path as a URI (RFC 3986): what is no letter, digit, `-._~` or `/` by its bytes.
fn identifier(name: &str) -> String {
    let characters = name.bytes().map(|b| {
        let is_plain = b.is_ascii_alphanumeric() || b"-._~/".contains(&b);
        if is_plain { char::from(b).to_string() } else { format!("%{b:02X}") }
    });
    characters.collect()
}
