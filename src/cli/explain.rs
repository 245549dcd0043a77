//! `explain`: what a code of a condition or an error means.

use crate::codes::{Meaning, meanings, meanings_of};
use crate::record::messages::SchemaMessage;

use super::command_prelude::*;

/// Columns of a terminal.
const COLUMNS: usize = 100;

#[derive(Debug, Args)]
pub struct Explain {
    /// Codes such as C0102, or beginnings such as C02; a list of all if none is given.
    #[arg(value_name = "CODE", value_parser = known)]
    codes: Vec<String>,
    /// Print results as JSON.
    #[arg(long)]
    pub json: bool,
}

fn known(word: &str) -> Result<String, String> {
    meanings_of(word).map(|_| word.to_owned())
}

impl Explain {
    pub fn execute(&self) -> Report {
        let named = self.codes.iter().filter_map(|word| meanings_of(word).ok());
        let mut codes: Vec<Meaning> = named.flatten().collect();
        let text = if codes.is_empty() {
            codes = meanings().collect();
            let line = |each: &Meaning| format!("{}  {}\n", each.id, each.title);
            codes.iter().map(line).collect()
        } else {
            let one = |each: &Meaning| {
                let Meaning { id, title, .. } = each;
                format!("{id}: {title}\n{}", wrapped(&each.explanation))
            };
            joined(codes.iter().map(one), "\n")
        };
        Report::new(
            json!({ "schema": SchemaMessage::new("explain"), "codes": codes }),
            text,
            Vec::new(),
        )
    }
}

/// A text in lines for a terminal.
fn wrapped(text: &str) -> String {
    let (mut lines, mut length) = (String::new(), 0);
    for word in text.split(' ') {
        let own = word.chars().count();
        if length > 0 && length + 1 + own > COLUMNS {
            lines.push('\n');
            length = 0;
        } else if length > 0 {
            lines.push(' ');
            length += 1;
        }
        lines += word;
        length += own;
    }
    lines + "\n"
}
