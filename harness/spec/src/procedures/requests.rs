//! What a spec asks for: procedures by name, each in its form.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, Error, MapAccess, Visitor};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};

use super::{ProcedureRequest, table};
use luxproof_model::ProcedureId;

/// What is measured, by procedure; at least one.
#[derive(Clone, Debug, Default)]
pub struct Procedures(pub BTreeMap<ProcedureId, ProcedureRequest>);

impl JsonSchema for Procedures {
    fn schema_name() -> Cow<'static, str> {
        "Procedures".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut properties = serde_json::Map::new();
        for procedure in &table::ALL {
            // A procedure without a form cannot be asked for.
            let Some(form) = procedure.form else { continue };
            let mut schema = form.schema(generator);
            schema.insert("description".to_owned(), procedure.id.meaning().into());
            properties.insert(procedure.id.name().to_owned(), schema.to_value());
        }
        json_schema!({
            "type": "object", "description": "What is measured; at least one.",
            "properties": properties, "additionalProperties": false,
        })
    }
}

/// As a spec writes them, each in its form.
impl Serialize for Procedures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(id, asked)| (id, asked.written(super::row(*id).form))))
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
                    let id = name.parse::<ProcedureId>().ok();
                    let Some((id, form)) = id.and_then(|id| Some((id, super::row(id).form?))) else {
                        return Err(A::Error::unknown_field(&name, ProcedureId::NAMES));
                    };
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
