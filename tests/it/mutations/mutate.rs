//! Structure-aware mutations: a text is cut into tokens, and some are deleted, doubled, swapped or replaced.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

/// What numbers are replaced by: extremes, none, and other ways to write them.
const NUMBERS: &[&str] = &[
    "0",
    "-0",
    "1",
    "-1",
    "1e308",
    "-1e308",
    "1e999",
    "-1e999",
    "1e-320",
    "5e-324",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "Infinity",
    "null",
    "0x10",
    "1_000",
    "1,5",
    "1.5.5",
    "1e",
    "+",
    "--1",
    ".",
    "1e3",
    "0.1",
    "360",
    "4294967296",
    "18446744073709551616",
    "-9223372036854775809",
    "1000000000000",
    "٣",
    "½",
];

/// What any token is replaced by: other types, empty things, and characters that are none.
const THINGS: &[&str] = &[
    "true",
    "[]",
    "{}",
    "\"\"",
    "[[]]",
    "\"x\"",
    "12",
    "[1, 2, 3]",
    "{a = 1}",
    "",
    " ",
    "\n",
    "\t",
    "\0",
    "\r",
    "\u{feff}",
    "\u{202e}",
    "é",
    "\u{1f916}",
    "#",
    "=",
    ",",
    ";",
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "..",
    "../..",
    "/dev/null",
    "/",
    "\\",
    "\u{1b}[31m",
];

/// A text with one to four mutations, and now and then in another encoding.
pub fn mutated(text: &str, random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut tokens = tokens(text);
    let count = [1, 1, 1, 2, 2, 4][below(6, random)];
    for _ in 0..count {
        mutate(&mut tokens, random);
    }
    let text = tokens.concat();
    match below(100, random) {
        0 => [&[0xef, 0xbb, 0xbf], text.as_bytes()].concat(),
        1 => utf16(&text, u16::to_le_bytes, &[0xff, 0xfe]),
        2 => utf16(&text, u16::to_be_bytes, &[0xfe, 0xff]),
        3 => text.replace('\n', "\r\n").into_bytes(),
        4 => {
            let mut bytes = text.into_bytes();
            bytes.truncate(below(bytes.len() + 1, random));
            bytes
        }
        5 => {
            let mut bytes = text.into_bytes();
            if !bytes.is_empty() {
                let place = below(bytes.len(), random);
                bytes[place] = random.random();
            }
            bytes
        }
        _ => text.into_bytes(),
    }
}

fn utf16(text: &str, bytes: fn(u16) -> [u8; 2], mark: &[u8]) -> Vec<u8> {
    let units = text.encode_utf16().flat_map(bytes);
    mark.iter().copied().chain(units).collect()
}

/// Numbers, words, and every other character by itself.
fn tokens(text: &str) -> Vec<String> {
    let is_word = |character: char| character.is_alphanumeric() || "_.+-".contains(character);
    let mut tokens: Vec<String> = Vec::new();
    let mut in_word = false;
    for character in text.chars() {
        match tokens.last_mut() {
            Some(last) if in_word && is_word(character) => last.push(character),
            _ => tokens.push(character.to_string()),
        }
        in_word = is_word(character);
    }
    tokens
}

fn mutate(tokens: &mut Vec<String>, random: &mut ChaCha8Rng) {
    if tokens.is_empty() {
        return;
    }
    let is_number = |token: &String| token.parse::<f64>().is_ok();
    let any = below(tokens.len(), random);
    // Words and numbers say more than brackets and blanks.
    let telling: Vec<usize> = (0..tokens.len())
        .filter(|&index| tokens[index].len() > 1 || is_number(&tokens[index]))
        .collect();
    let place = match telling.get(below(telling.len().max(1), random)) {
        Some(&place) if below(10, random) > 0 => place,
        _ => any,
    };
    let numbers: Vec<usize> = (0..tokens.len())
        .filter(|&index| is_number(&tokens[index]))
        .collect();
    match below(14, random) {
        0 => {
            tokens.remove(place);
        }
        1 => tokens.insert(place, tokens[place].clone()),
        2 => tokens.swap(place, any),
        3..=6 => {
            if let Some(&number) = numbers.get(below(numbers.len().max(1), random)) {
                tokens[number] = pick(NUMBERS, random);
            }
        }
        7 | 8 => {
            if let Some(&number) = numbers.get(below(numbers.len().max(1), random)) {
                let value: f64 = tokens[number].parse().unwrap_or(1.0);
                let factor = [-1.0, 0.0, 1e-3, 1e3, 57.3, 1.001, 1e12][below(7, random)];
                tokens[number] = format!("{}", value * factor);
            }
        }
        9 => tokens[place] = pick(THINGS, random),
        10 => tokens.insert(place, pick(THINGS, random)),
        11 => tokens.truncate(place),
        _ => mutate_lines(tokens, random),
    }
}

/// A line is deleted, doubled or swapped, or a column is.
fn mutate_lines(tokens: &mut Vec<String>, random: &mut ChaCha8Rng) {
    let text = tokens.concat();
    let mut lines: Vec<String> = text.split_inclusive('\n').map(str::to_owned).collect();
    if lines.is_empty() {
        return;
    }
    let (one, other) = (below(lines.len(), random), below(lines.len(), random));
    match below(4, random) {
        0 => {
            lines.remove(one);
        }
        1 => lines.insert(one, lines[one].clone()),
        2 => lines.swap(one, other),
        _ => {
            let column = below(lines[0].split(',').count(), random);
            let is_doubled = below(2, random) == 0;
            for line in &mut lines {
                let mut cells: Vec<&str> = line.split(',').collect();
                if column + 1 < cells.len() {
                    let cell = cells.remove(column);
                    if is_doubled {
                        cells.insert(column, cell);
                        cells.insert(column, cell);
                    }
                }
                *line = cells.join(",");
            }
        }
    }
    *tokens = self::tokens(&lines.concat());
}

fn below(limit: usize, random: &mut ChaCha8Rng) -> usize {
    random.random_range(0..limit)
}

fn pick(from: &[&str], random: &mut ChaCha8Rng) -> String {
    from[below(from.len(), random)].to_owned()
}

/// An XML text in which one to three values of attributes are changed, or lines are.
pub fn mutated_xml(text: &str, random: &mut ChaCha8Rng) -> Vec<u8> {
    // What stands between quotes, and what does not, by turns.
    let mut parts: Vec<String> = text.split('"').map(str::to_owned).collect();
    for _ in 0..=below(3, random) {
        let place = 2 * below(parts.len() / 2, random) + 1;
        let mut value = tokens(&parts[place]);
        match below(6, random) {
            0 => parts[place] = pick(THINGS, random).replace('"', ""),
            1 => value.clear(),
            2 => {
                let mut lines = tokens(&parts.join("\""));
                mutate_lines(&mut lines, random);
                return lines.concat().into_bytes();
            }
            _ => mutate(&mut value, random),
        }
        if !value.is_empty() {
            parts[place] = value.concat().replace('"', "");
        }
    }
    parts.join("\"").into_bytes()
}

/// A JSON text in which one to three values are removed, doubled, replaced, or taken from another place.
pub fn mutated_json(text: &str, random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut root: Value = serde_json::from_str(text).expect("JSON");
    for _ in 0..=below(3, random) {
        let places = places(&root, String::new());
        let place = &places[below(places.len(), random)];
        let other = &places[below(places.len(), random)];
        let value = match below(8, random) {
            0 => Value::Null,
            1 => json!([]),
            2 => json!({}),
            3 => json!("x"),
            4 => root.pointer(other).cloned().unwrap_or(Value::Null),
            5 => json!([-1.0, 1e308, 1e-320, 0.0, 1e18, 0.5, 3e9][below(7, random)]),
            6 => json!([0, 1, 2, 7][below(4, random)]),
            _ => json!(u64::MAX - below(3, random) as u64),
        };
        let (parent, key) = place.rsplit_once('/').unwrap_or(("", ""));
        let operation = below(4, random);
        match root.pointer_mut(parent) {
            Some(Value::Object(map)) if operation == 0 => {
                map.remove(key);
            }
            Some(Value::Array(array)) if operation < 2 && !array.is_empty() => {
                let index = below(array.len(), random);
                if operation == 0 {
                    array.remove(index);
                } else {
                    array.insert(index, array[index].clone());
                }
            }
            _ => {
                if let Some(found) = root.pointer_mut(place) {
                    *found = match (found.as_f64(), below(2, random)) {
                        (Some(number), 0) => {
                            json!(number * [-1.0, 2.0, 1e-3, 1.1][below(4, random)])
                        }
                        _ => value,
                    };
                }
            }
        }
    }
    root.to_string().into_bytes()
}

/// The pointers to all values within one.
fn places(value: &Value, here: String) -> Vec<String> {
    let mut all = Vec::new();
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let key = key.replace('~', "~0").replace('/', "~1");
                all.extend(places(value, format!("{here}/{key}")));
            }
        }
        // Of long arrays the first elements stand for all.
        Value::Array(array) => {
            for (index, value) in array.iter().enumerate().take(6) {
                all.extend(places(value, format!("{here}/{index}")));
            }
        }
        _ => {}
    }
    all.push(here);
    all
}
