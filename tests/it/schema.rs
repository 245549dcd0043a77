//! The scenario's JSON schema: the shipped scenarios are valid by it, and what nobody reads is not.

use serde_json::{Map, Value, json};

use crate::support::{Workplace, project};

/// What a schema says is wrong with a value, by the words of JSON Schema that the program's uses.
fn problems(root: &Value, schema: &Value, value: &Value, at: &str) -> Vec<String> {
    let Some(schema) = schema.as_object() else {
        return if schema == &json!(false) {
            vec![format!("{at}: is not allowed")]
        } else {
            Vec::new()
        };
    };
    let mut found = Vec::new();
    for (word, says) in schema {
        match word.as_str() {
            "$ref" => {
                let path = says.as_str().expect("a reference").trim_start_matches('#');
                let target = root.pointer(path).expect("a definition");
                found.extend(problems(root, target, value, at));
            }
            "type" => {
                let is = |name: &Value| match name.as_str().expect("a type") {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "boolean" => value.is_boolean(),
                    "null" => value.is_null(),
                    "integer" => value.is_i64() || value.is_u64(),
                    "number" => value.is_number(),
                    other => panic!("{other}"),
                };
                let holds = says
                    .as_array()
                    .map_or_else(|| is(says), |all| all.iter().any(is));
                if !holds {
                    found.push(format!("{at}: is no {says}"));
                }
            }
            "enum" if !says.as_array().expect("a list").contains(value) => {
                found.push(format!("{at}: is none of {says}"));
            }
            "const" if says != value => found.push(format!("{at}: is not {says}")),
            "oneOf" | "anyOf" => {
                let ways: Vec<Vec<String>> = (says.as_array().expect("a list").iter())
                    .map(|each| problems(root, each, value, at))
                    .collect();
                if !ways.iter().any(Vec::is_empty) {
                    found.push(format!("{at}: {ways:?}"));
                }
            }
            "allOf" => {
                for each in says.as_array().expect("a list") {
                    found.extend(problems(root, each, value, at));
                }
            }
            "items" => {
                for each in value.as_array().into_iter().flatten() {
                    found.extend(problems(root, says, each, &format!("{at}[]")));
                }
            }
            "required" => {
                for key in says.as_array().expect("a list") {
                    let key = key.as_str().expect("a key");
                    if value
                        .as_object()
                        .is_some_and(|object| !object.contains_key(key))
                    {
                        found.push(format!("{at}.{key}: is missing"));
                    }
                }
            }
            "properties" | "additionalProperties"
                if word == "properties" || !schema.contains_key("properties") =>
            {
                for (key, each) in value.as_object().into_iter().flatten() {
                    let expected = if word == "properties" {
                        says.get(key)
                    } else {
                        Some(says)
                    };
                    let expected = expected.or_else(|| schema.get("additionalProperties"));
                    if let Some(expected) = expected {
                        found.extend(problems(root, expected, each, &format!("{at}.{key}")));
                    }
                }
            }
            _ => {}
        }
    }
    found
}

/// Makes a scenario wrong.
type Change = fn(&mut Map<String, Value>);

fn schema() -> Value {
    let outcome = Workplace::new().done("schema");
    assert_eq!(outcome.stderr, "");
    outcome.json()
}

#[test]
fn shipped_scenarios_are_valid() {
    let schema = schema();
    let mut count = 0;
    for entry in std::fs::read_dir(project("scenarios")).expect("the folder can be read") {
        let path = entry.expect("the entry can be read").path();
        if path.extension() != Some("toml".as_ref()) {
            continue;
        }
        let text = std::fs::read_to_string(&path).expect("the scenario can be read");
        let value: Value = toml::from_str(&text).expect("it is TOML");
        assert_eq!(
            problems(&schema, &schema, &value, ""),
            Vec::<String>::new(),
            "{}",
            path.display()
        );
        count += 1;
    }
    assert!(count > 8, "{count}");
}

#[test]
fn what_nobody_reads_is_not_valid() {
    let schema = schema();
    let text = std::fs::read_to_string(project("scenarios/kr270.toml")).expect("it can be read");
    let right: Value = toml::from_str(&text).expect("it is TOML");
    let wrong: [(&str, Change); 6] = [
        (".robots: is not allowed", |file| {
            file.insert("robots".to_owned(), json!({}));
        }),
        (".instrument.sigma_m: is not allowed", |file| {
            file["instrument"]["sigma_m"] = json!(3e-5);
        }),
        (".robot.model: is missing", |file| {
            file["robot"]
                .as_object_mut()
                .expect("a table")
                .remove("model");
        }),
        (".test_pose[].q_deg: is no", |file| {
            file["test_pose"][0]["q_deg"] = json!("0");
        }),
        (".load", |file| file["load"]["kind"] = json!("weight")),
        (".load", |file| file["load"]["force_max_n"] = json!(1)),
    ];
    for (expected, change) in wrong {
        let mut file = right.clone();
        change(file.as_object_mut().expect("a table"));
        let found = problems(&schema, &schema, &file, "");
        assert!(
            found.iter().any(|problem| problem.starts_with(expected)),
            "{expected}: {found:?}"
        );
    }
}
