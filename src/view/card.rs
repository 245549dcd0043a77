//! A question with its answer: in the overview that a page begins with, and on a terminal.

use super::markup::escaped;
use crate::text::for_terminal;

/// What it is about, the answer in a line, and what is to be known of it.
#[derive(Debug, Clone, PartialEq, Eq)]
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

    /// For a page: what to know about the answer is folded below it.
    pub fn html(&self) -> String {
        let open = if self.tone == "bad" { " open" } else { "" };
        format!(
            "<details class=\"card {}\"{open}><summary><h3>{}</h3><strong>{}</strong></summary><p>{}</p></details>\n",
            self.tone,
            self.title,
            escaped(&self.answer),
            escaped(&self.about)
        )
    }

    /// For a terminal: a line.
    pub fn plain(&self) -> String {
        let Self { title, answer, .. } = self;
        let colon = if title.ends_with('?') { "" } else { ":" };
        let text = format!("{title}{colon} {answer}. {}", self.about);
        for_terminal(&text).trim_end().to_owned() + "\n"
    }
}

/// The beginning of a page: its title, what it is about, and its cards.
pub fn heading(title: &str, lead: &str, cards: impl IntoIterator<Item = Card>) -> String {
    let cards: String = cards.into_iter().map(|card| card.html()).collect();
    format!(
        "<header><h1>{}</h1>\n<p class=\"lead\">{}</p></header>\n<div class=\"cards\">\n{cards}</div>\n",
        escaped(title),
        escaped(lead)
    )
}
