//! Pages and texts: templates, filled with records. Whatever is filled in as text is escaped here.

use std::sync::LazyLock;

use minijinja::{AutoEscape, Environment, Output, State, UndefinedBehavior, Value};
use serde::Serialize;
use serde_json::json;
use thiserror::Error;

use crate::text::markdown_text;
use crate::text::wording::{
    counted, dash, duration, inverse_interval, joined, listed, micrometres, number, percent,
    significant,
};

/// The templates, which may import one another.
const TEMPLATES: [(&str, &str); 20] = [
    ("chart.svg", include_str!("pages/chart.svg")),
    ("charts.svg", include_str!("pages/charts.svg")),
    ("still.svg", include_str!("pages/still.svg")),
    ("stills.svg", include_str!("pages/stills.svg")),
    ("stills.html", include_str!("pages/stills.html")),
    ("cards.html", include_str!("pages/cards.html")),
    ("cards.txt", include_str!("pages/cards.txt")),
    ("page.html", include_str!("pages/page.html")),
    ("parts.html", include_str!("pages/parts.html")),
    ("run.html", include_str!("pages/run.html")),
    ("readings.html", include_str!("pages/readings.html")),
    ("study.html", include_str!("pages/study.html")),
    ("run_sheet.html", include_str!("pages/run_sheet.html")),
    ("table.md", include_str!("pages/table.md")),
    ("step.md", include_str!("pages/step.md")),
    ("results.md", include_str!("pages/results.md")),
    ("overview.md", include_str!("pages/overview.md")),
    ("study.md", include_str!("pages/study.md")),
    ("study_table.md", include_str!("pages/study_table.md")),
    ("study_sources.md", include_str!("pages/study_sources.md")),
];
/// The style of all pages.
const STYLE: &str = concat!(
    include_str!("pages/style.css"),
    include_str!("pages/dark_series.css")
);

/// A page could not be made of its template.
#[derive(Debug, Error)]
#[error("the page could not be made: {0:#}")]
pub struct PageError(#[from] minijinja::Error);

/// All templates, with the words and roundings that they use.
static ENVIRONMENT: LazyLock<Result<Environment<'static>, minijinja::Error>> =
    LazyLock::new(environment);

fn environment() -> Result<Environment<'static>, minijinja::Error> {
    let mut pages = Environment::new();
    pages.set_undefined_behavior(UndefinedBehavior::Strict);
    pages.set_trim_blocks(true);
    pages.set_lstrip_blocks(true);
    pages.set_keep_trailing_newline(true);
    pages.set_auto_escape_callback(|name| match name.rsplit_once('.') {
        Some((_, "txt")) => AutoEscape::None,
        Some((_, "md")) => AutoEscape::Custom("Markdown"),
        _ => AutoEscape::Html,
    });
    pages.set_formatter(written);
    pages.add_filter("counted", |count: u64, what: String| counted(count, &what));
    pages.add_filter("duration", duration);
    pages.add_filter("um", micrometres);
    pages.add_filter("number", number);
    pages.add_filter("plain", |value: f64| value.to_string());
    pages.add_filter("tenths", |value: f64| format!("{value:.1}"));
    pages.add_filter("percent", percent);
    pages.add_filter("significant", |value: Option<f64>, digits: usize| {
        value.map_or_else(dash, |value| significant(value, digits))
    });
    pages.add_filter("inverse_interval", |low: f64, high: f64| {
        inverse_interval([low, high])
    });
    pages.add_filter("listed", |values: Vec<f64>, decimals: usize| {
        listed(values, decimals)
    });
    pages.add_filter("unbroken", |text: String| unbroken(&text));
    pages.add_filter("vectors", |text: String| with_whole_vectors(&text));
    pages.add_filter("unit", |text: String| micro_sign(&text));
    pages.add_filter("for_page", |text: String| for_page(&text));
    pages.add_filter("words", |text: String| {
        joined(text.split_ascii_whitespace(), " ")
    });
    for (name, text) in TEMPLATES {
        pages.add_template(name, text)?;
    }
    Ok(pages)
}

/// A template with what it shows.
///
/// # Errors
/// The template asks for what is not there: none of those that the tests fill.
pub fn filled(template: &str, shown: &impl Serialize) -> Result<String, PageError> {
    let templates = ENVIRONMENT.as_ref();
    let wrong = |error: &minijinja::Error| minijinja::Error::new(error.kind(), error.to_string());
    Ok(templates
        .map_err(wrong)?
        .get_template(template)?
        .render(shown)?)
}

/// A page, which loads nothing, of a template and what it shows; the title stands on the browser's tab.
///
/// # Errors
/// See [`filled`].
pub fn page(title: &str, template: &str, shown: &impl Serialize) -> Result<String, PageError> {
    let body = filled(template, shown)?;
    let page = json!({ "title": title, "style": STYLE, "body": body });
    filled("page.html", &page)
}

/// Writes a value: text is escaped as the template's kind wants it, and what is not there is nothing.
fn written(
    to: &mut Output<'_>,
    state: &State<'_, '_>,
    value: &Value,
) -> Result<(), minijinja::Error> {
    let text = match (state.auto_escape(), value) {
        (_, value) if value.is_none() => String::new(),
        (AutoEscape::None, value) => value.to_string(),
        (_, value) if value.is_safe() => value.to_string(),
        (AutoEscape::Custom(_), value) => markdown_text(&value.to_string()),
        (_, value) => escaped(&value.to_string()),
    };
    Ok(to.write_str(&text)?)
}

/// Text as it stands in HTML and SVG, in attributes too.
pub fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;");
    let pairs = [
        ('<', "&lt;"),
        ('>', "&gt;"),
        ('"', "&quot;"),
        ('\'', "&#39;"),
    ];
    let text = (pairs.into_iter()).fold(text, |text, (sign, safe)| text.replace(sign, safe));
    // Control characters are not allowed in XML.
    text.replace(char::is_control, " ")
}

/// Text that no line ends inside: a vector.
pub fn unbroken(text: &str) -> String {
    text.replace(' ', "\u{a0}")
}

/// Text whose lines do not end between parentheses, where it has vectors, and with the signs of pages.
fn with_whole_vectors(text: &str) -> String {
    let parts = text.split_inclusive(['(', ')']);
    let whole = |part: &str| {
        if part.ends_with(')') {
            unbroken(part).replace('-', "\u{2212}")
        } else {
            part.replace(" -", " \u{2212}")
        }
    };
    parts.map(whole).collect()
}

/// What a terminal says in the letters of a page.
pub fn for_page(text: &str) -> String {
    text.replace(" um", "\u{a0}\u{b5}m")
        .replace(" +- ", " \u{b1} ")
}

/// A unit as pages print it, not as terminals do.
pub fn micro_sign(unit: &str) -> String {
    unit.replace("1e-6 ", "\u{b5}").replace("um", "\u{b5}m")
}
