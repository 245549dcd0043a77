//! Small pieces of HTML and SVG. Whatever is given as text is escaped here.

/// The style of all pages.
const STYLE: &str = include_str!("report/style.css");

/// Text as it stands in HTML and SVG, in attributes too.
pub fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for each in text.chars() {
        match each {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // Control characters are not allowed in XML.
            other if other.is_control() => safe.push(' '),
            other => safe.push(other),
        }
    }
    safe
}

/// Text that no line ends inside: a vector.
pub fn unbroken(text: &str) -> String {
    text.replace(' ', "\u{a0}")
}

/// Text whose lines do not end between parentheses, where it has vectors.
pub fn with_unbroken_vectors(text: &str) -> String {
    let parts = text.split_inclusive(['(', ')']);
    let whole = |part: &str| {
        if part.ends_with(')') {
            unbroken(part)
        } else {
            part.to_owned()
        }
    };
    parts.map(whole).collect()
}

/// A unit as pages print it, not as terminals do.
pub fn micro_sign(unit: &str) -> String {
    unit.replace("1e-6 ", "\u{b5}").replace("um", "\u{b5}m")
}

/// A whole page, which loads nothing. `body` is HTML.
pub fn page(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{}</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <main>\n{body}</main>\n</body>\n</html>\n",
        escaped(title)
    )
}

/// A section with a title; `body` is HTML.
pub fn section(id: &str, title: &str, body: &str) -> String {
    format!(
        "<section id=\"{}\">\n<h2>{}</h2>\n{body}</section>\n",
        escaped(id),
        escaped(title)
    )
}

/// A paragraph of text.
pub fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", escaped(text))
}

/// A paragraph for each text that says something.
pub fn paragraphs(texts: impl IntoIterator<Item = String>) -> String {
    let texts = texts.into_iter().filter(|text| !text.is_empty());
    texts.map(|text| paragraph(&text)).collect()
}

/// A figure of a drawing (SVG) with its caption.
pub fn figure(svg: &str, caption: &str) -> String {
    format!(
        "<figure>\n<div class=\"wide\">{svg}</div>\n<figcaption>{}</figcaption>\n</figure>\n",
        escaped(caption)
    )
}

/// A table; the first column is text, the others are numbers.
pub fn table_of(header: &[impl AsRef<str>], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let cells = |row: Vec<String>| row.iter().map(|text| cell(text)).collect();
    table_of_cells(header, rows.into_iter().map(cells))
}

/// A cell of text.
pub fn cell(text: &str) -> String {
    format!("<td>{}</td>", escaped(text))
}

/// The same with rows of cells (HTML).
pub fn table_of_cells(
    header: &[impl AsRef<str>],
    rows: impl IntoIterator<Item = String>,
) -> String {
    let mut head = String::new();
    for name in header {
        head += &format!("<th>{}</th>", escaped(name.as_ref()));
    }
    let mut body = String::new();
    for cells in rows {
        body += &format!("<tr>{cells}</tr>\n");
    }
    format!(
        "<div class=\"wide\"><table>\n<thead><tr>{head}</tr>\n</thead>\n<tbody>\n{body}</tbody>\n</table></div>\n"
    )
}
