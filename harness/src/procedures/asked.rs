//! What a spec asks for: procedures by name, each in its form.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Error, MapAccess, Visitor};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};

use super::{Asked, table};
use crate::record::ProcedureId;

/// What is measured, by procedure; at least one.
#[derive(Clone, Debug, Default)]
pub struct Procedures(pub BTreeMap<ProcedureId, Asked>);

impl JsonSchema for Procedures {
    fn schema_name() -> Cow<'static, str> {
        "Procedures".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let property = |procedure: &table::Procedure| {
            let mut schema = procedure.form?.schema(generator);
            schema.insert("description".to_owned(), procedure.meaning.into());
            Some((procedure.id.name().to_owned(), schema.to_value()))
        };
        let properties: serde_json::Map<_, _> = table::ALL.iter().filter_map(property).collect();
        json_schema!({
            "type": "object", "description": "What is measured; at least one.",
            "properties": properties, "additionalProperties": false,
        })
    }
}

/// As a spec writes them, each in its form.
impl Serialize for Procedures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(id, asked)| (id, asked.written(id.row().form))))
    }
}

impl<'de> Deserialize<'de> for Procedures {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ByName;
        impl<'de> Visitor<'de> for ByName {
            type Value = Procedures;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("procedures by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Procedures, A::Error> {
                let mut all = BTreeMap::new();
                while let Some(name) = map.next_key::<String>()? {
                    let unknown = || A::Error::unknown_field(&name, ProcedureId::NAMES);
                    let id: ProcedureId = name.parse().map_err(|_| unknown())?;
                    let form = id.row().form.ok_or_else(unknown)?;
                    // A case of a suite takes a procedure out by `null`.
                    let Some(asked) = form.read(&mut map)? else { continue };
                    if all.insert(id, asked).is_some() {
                        return Err(A::Error::duplicate_field(id.name()));
                    }
                }
                Ok(Procedures(all))
            }
        }
        deserializer.deserialize_map(ByName)
    }
}
