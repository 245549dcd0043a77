//! A question with its answer: in the overview that a page begins with, and on a terminal.

use serde::Serialize;

use crate::text::for_terminal;

/// What it is about, the answer in a line, and what is to be known of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Card {
    /// `good`, `bad` (which a page shows open) or nothing.
    tone: &'static str,
    title: &'static str,
    answer: String,
    about: String,
}

impl Card {
    /// A card in a tone.
    pub fn new(
        tone: &'static str,
        title: &'static str,
        answer: impl Into<String>,
        about: impl Into<String>,
    ) -> Self {
        Self {
            tone,
            title,
            answer: answer.into(),
            about: about.into(),
        }
    }

    /// For a terminal: a line.
    pub fn plain(&self) -> String {
        let Self { title, answer, .. } = self;
        let colon = if title.ends_with('?') { "" } else { ":" };
        let text = format!("{title}{colon} {answer}. {}", self.about);
        for_terminal(&text).trim_end().to_owned() + "\n"
    }
}
