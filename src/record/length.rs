//! A length in records, under the key of its kind.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::{Map, json};

use crate::observation::{LengthKind, ReadLength};

/// A length (mm) under the key of its kind; no key where there is none. It is flattened into what has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthField(pub Option<ReadLength>);

impl Serialize for LengthField {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_map(None)?;
        if let Some(ReadLength { kind, length_m }) = self.0 {
            fields.serialize_entry(kind.column(), &(length_m * 1e3))?;
        }
        fields.end()
    }
}

impl JsonSchema for LengthField {
    fn schema_name() -> Cow<'static, str> {
        "LengthField".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let field = |kind: LengthKind| {
            let what = format!("The {} that is read (mm), where one is.", kind.name());
            let field =
                json!({ "description": what, "type": ["number", "null"], "format": "double" });
            (kind.column().to_owned(), field)
        };
        let fields: Map<_, _> = LengthKind::ALL.into_iter().map(field).collect();
        json_schema!({ "type": "object", "properties": fields })
    }
}
