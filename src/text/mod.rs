//! Text that comes from elsewhere, names, paths, and what files say, and text for people.
//!
//! - [`wording`]: numbers, counts and words as a person reads them.
//! - [`table`]: tables with aligned columns.
//! - [`diagnostics`]: what is said on stderr while something is done.

pub mod diagnostics;
pub mod table;
pub mod wording;

use std::borrow::Cow;

/// Names are at most this long (bytes).
const LONGEST_NAME: usize = 200;

/// Whether a character moves the cursor, rings, starts a terminal's command or turns the direction of
/// writing, rather than being seen.
pub fn is_unseen(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

/// Text for a terminal: lines stay, and everything else that is not seen is escaped.
pub fn plain(text: &str) -> Cow<'_, str> {
    let is_foreign = |each: char| is_unseen(each) && each != '\n';
    if text.contains(is_foreign) {
        let escaped = text.chars().map(|each| match each {
            each if is_foreign(each) => each.escape_default().to_string(),
            each => each.to_string(),
        });
        Cow::Owned(escaped.collect())
    } else {
        Cow::Borrowed(text)
    }
}

/// What a page says in the letters of a terminal.
pub fn for_terminal(text: &str) -> String {
    let letters = [
        ("\u{3c1}\u{2080}", "rho0"),
        ("\u{b5}", "u"),
        ("\u{a0}", " "),
        ("\u{2212}", "-"),
        ("\u{2013}", "-"),
        ("\u{201c}", "\""),
        ("\u{201d}", "\""),
    ];
    let plain = |text: String, (own, plain): (&str, &str)| text.replace(own, plain);
    letters.into_iter().fold(text.to_owned(), plain)
}

/// Text in Markdown that may come from files: nothing in it ends a cell, is a tag, or is marked up.
pub fn markdown_text(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for each in text.chars() {
        match each {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '\n' | '\r' => safe.push(' '),
            '|' | '\\' | '`' | '*' | '#' => safe.extend(['\\', each]),
            other => safe.push(other),
        }
    }
    safe
}

/// Of the words that there are, the one that was likely meant.
pub fn nearest<'a>(found: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let found = found.to_lowercase();
    let likeness = |word: &str| strsim::jaro_winkler(&found, &word.to_lowercase());
    let best = known.max_by(|one, other| likeness(one).total_cmp(&likeness(other)))?;
    (likeness(best) > 0.8).then_some(best)
}

/// What is wrong with a name, which people read and other files and programs take over.
pub fn wrong_name(name: &str) -> Option<String> {
    if name.trim().is_empty() || name.contains(is_unseen) {
        Some(format!("found {name:?}; a name of one line is allowed"))
    } else if name.len() > LONGEST_NAME {
        Some(format!(
            "found a name of {} bytes; {LONGEST_NAME} are allowed",
            name.len()
        ))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_seen_is_escaped() {
        assert_eq!(plain("r\u{e9}sum\u{e9}\n2"), "r\u{e9}sum\u{e9}\n2");
        assert_eq!(plain("a\u{1b}[2J\r\0\u{9b}"), "a\\u{1b}[2J\\r\\u{0}\\u{9b}");
    }

    #[test]
    fn what_marks_up_is_escaped() {
        assert_eq!(
            markdown_text("x | y # *z*\n<b>&`a`"),
            "x \\| y \\# \\*z\\* &lt;b>&amp;\\`a\\`"
        );
    }

    #[test]
    fn names_have_one_line() {
        assert_eq!(wrong_name("Achse 1 (\u{f6}stlich)"), None);
        for name in [
            "",
            " ",
            "a\nb",
            "a\0",
            "\u{1b}[31m",
            "a\u{202e}b",
            &"x".repeat(201),
        ] {
            assert!(wrong_name(name).is_some(), "{name:?}");
        }
    }
}
