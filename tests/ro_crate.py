"""Reads a bundle by rocrate, the reader of the RO-Crate community, and holds what it describes against what is there."""

import hashlib
import sys
from pathlib import Path

from rocrate.rocrate import ROCrate

folder = Path(sys.argv[1])
crate = ROCrate(folder)
assert crate.metadata["conformsTo"] == "https://w3id.org/ro/crate/1.1", crate.metadata.properties()
root = crate.root_dataset
for key in ["name", "description", "datePublished", "license", "hasPart", "mentions"]:
    assert root[key], key
assert root["license"]["description"], "a licence, or that there is none"
described = {}
for entity in crate.data_entities:
    assert entity.type == "File", entity.properties()
    file = Path(entity.source)
    assert file.is_file(), entity.id
    described[file.relative_to(folder).as_posix()] = entity
there = {file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file()}
assert there - set(described) == {"ro-crate-metadata.json"}, there ^ set(described)
for name, entity in described.items():
    if name != "SHA256SUMS":
        bytes_ = (folder / name).read_bytes()
        assert entity["sha256"] == hashlib.sha256(bytes_).hexdigest(), name
        assert int(entity["contentSize"]) == len(bytes_), name
action = root["mentions"]
assert action.type == "CreateAction" and action["description"].startswith("luxproof run "), action.properties()
assert action["object"] and action["result"].id == "run/report.json", action.properties()
assert {"#luxproof"} <= {tool.id for tool in action["instrument"]}, action.properties()
# What has no meaning in the context would be dropped by a reader of linked data.
for entity in crate.contextual_entities + crate.data_entities:
    assert entity.type and all(value is not None for value in entity.properties().values()), entity.properties()
# It writes again what it has read.
crate.write(folder.with_name(folder.name + "-written"))
print(f"{len(described)} files")
