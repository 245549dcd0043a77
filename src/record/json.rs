//! The results of a command in JSON.

use serde_json::{Value, json};

use super::messages::{ProvenanceMessage, SchemaMessage};

/// What results are and where they come from, and the command's keys.
pub fn results(command: &str, provenance: &ProvenanceMessage, keys: Value) -> Value {
    let mut json = json!({ "schema": SchemaMessage::new(command), "provenance": provenance });
    merge(&mut json, keys);
    json
}

/// Adds the keys of one JSON object to another.
pub fn merge(into: &mut Value, from: Value) {
    if let (Value::Object(into), Value::Object(from)) = (into, from) {
        into.extend(from);
    }
}
