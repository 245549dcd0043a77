//! `explain`: what a code of a condition or an error means.

use clap::Args;
use elastocal::codes::{AREAS, Meaning, meanings, meanings_of};
use elastocal::record::messages::SchemaMessage;
use serde_json::json;

use super::Report;

/// Columns of a terminal.
const TERMINAL: usize = 100;
/// Columns of a page.
const PAGE: usize = 140;

const CONDITIONS: &str = "# Conditions

A condition is what must be looked at before a result is relied on. It is printed as `condition C0102: ...`, one a line, is listed under
`conditions` in JSON (`code`, `text`), and the command ends with code 3. `--allow C0102,C0105` accepts these codes: they are still
printed and listed (`allowed`), and do not make the exit code 3. A code keeps its meaning. `elastocal explain C0102` prints an
entry of this page, `elastocal explain C02` an area; `elastocal explain C --markdown` makes the page. Errors have [their own](errors.md).
";

const ERRORS: &str = "# Errors

An error is why there is no result: it is printed as `error E0101: ...`, and the command ends with code 1 (wrong usage: 2). A code keeps
its meaning. It is that of the cause that is known best: where a table is broken, the table's, and not that of the plan that is read from
it. `elastocal explain E0101` prints an entry of this page; `elastocal explain E --markdown` makes the page. What speaks against a
result that is there is a [condition](conditions.md).
";

/// Arguments of `explain`.
#[derive(Debug, Args)]
pub struct Explain {
    /// Codes such as C0102, or beginnings such as C02; a list of all if none is given.
    #[arg(value_name = "CODE", value_parser = known)]
    codes: Vec<String>,
    /// Print a page in Markdown.
    #[arg(long, conflicts_with = "json", requires = "codes")]
    markdown: bool,
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
        let named: Vec<Meaning> = named.flatten().collect();
        let text = if self.markdown {
            page(&named)
        } else if named.is_empty() {
            let line = |each: Meaning| format!("{}  {}\n", each.id, each.title);
            meanings().map(line).collect()
        } else {
            let one = |each: &Meaning| {
                let Meaning { id, title, .. } = each;
                format!("{id}: {title}\n{}", wrapped(each.explanation, TERMINAL))
            };
            named.iter().map(one).collect::<Vec<_>>().join("\n")
        };
        let codes = if named.is_empty() {
            meanings().collect()
        } else {
            named
        };
        Report::new(
            json!({ "schema": SchemaMessage::new("explain"), "codes": codes }),
            text,
            Vec::new(),
        )
    }
}

/// A page of documentation.
fn page(meanings: &[Meaning]) -> String {
    let mut text = String::new();
    for (kind, beginning) in [("C", CONDITIONS), ("E", ERRORS)] {
        if meanings.iter().any(|each| each.id.starts_with(kind)) {
            text += beginning;
        }
        for (area, name) in AREAS.iter().filter(|(area, _)| area.starts_with(kind)) {
            let own = meanings.iter().filter(|each| each.id.starts_with(area));
            let mut own = own.peekable();
            if own.peek().is_some() {
                text += &format!("\n## {name}\n");
            }
            for Meaning {
                id,
                title,
                explanation,
            } in own
            {
                text += &format!(
                    "\n{}",
                    wrapped(&format!("**{id} {title}.** {explanation}"), PAGE)
                );
            }
        }
    }
    text
}

/// A text in lines of at most so many columns.
fn wrapped(text: &str, columns: usize) -> String {
    let (mut lines, mut length) = (String::new(), 0);
    for word in text.split(' ') {
        let own = word.chars().count();
        if length > 0 && length + 1 + own > columns {
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
