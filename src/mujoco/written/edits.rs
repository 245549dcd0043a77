//! Changes of an XML file's text: what is not changed keeps every byte, comments and indentation too.

use std::collections::BTreeMap;
use std::ops::Range;

use roxmltree::{Document, Node};

use crate::mujoco::urdf::{escaped, parsed};

/// Reads a text as XML.
pub(super) fn parse(text: &str) -> Result<Document<'_>, String> {
    // What an entity stands for has no place of its own in the text.
    if text.contains("<!ENTITY") {
        return Err("it declares XML entities: write out what they stand for".to_owned());
    }
    parsed(text).map_err(|error| format!("XML: {error}"))
}

/// Changes of a text, collected and then made all at once.
pub(super) struct Edits<'t> {
    text: &'t str,
    /// Where in the text, and what stands there then.
    changes: Vec<(Range<usize>, String)>,
    /// New children of elements, by where these begin.
    children: BTreeMap<usize, (Range<usize>, String, Vec<String>)>,
}

impl<'t> Edits<'t> {
    pub fn new(text: &'t str) -> Self {
        Self {
            text,
            changes: Vec::new(),
            children: BTreeMap::new(),
        }
    }

    /// Gives an element's attribute this value.
    pub fn set(&mut self, node: Node<'_, '_>, name: &str, value: &str) {
        let value = escaped(value);
        if let Some(attribute) = node.attribute_node(name) {
            self.changes.push((attribute.range_value(), value));
            return;
        }
        let last = node.attributes().next_back().map(|last| last.range().end);
        let place = last.unwrap_or_else(|| self.behind_tag(node));
        (self.changes).push((place..place, format!(" {name}=\"{value}\"")));
    }

    /// The same with numbers, each written so that it is read as the same again.
    pub fn set_numbers(&mut self, node: Node<'_, '_>, name: &str, values: &[f64]) {
        self.set(node, name, &numbers(values));
    }

    /// Adds a child behind those that an element has.
    pub fn append(&mut self, node: Node<'_, '_>, child: String) {
        let range = node.range();
        let tag = node.tag_name().name().to_owned();
        let entry = self.children.entry(range.start);
        entry.or_insert((range, tag, Vec::new())).2.push(child);
    }

    /// The changed text.
    pub fn apply(mut self) -> String {
        for (range, tag, children) in std::mem::take(&mut self.children).into_values() {
            let indent = self.indentation(range.start);
            let mut lines = String::new();
            for child in children {
                lines += &format!("{indent}  {child}\n");
            }
            let own = &self.text[range.clone()];
            if own.ends_with("/>") {
                let end = range.end - 2;
                (self.changes).push((end..range.end, format!(">\n{lines}{indent}</{tag}>")));
                continue;
            }
            let close = range.start + own.rfind("</").unwrap_or(own.len());
            let blank = self.text[..close].trim_end_matches([' ', '\t']).len();
            let is_own_line = self.text[..blank].ends_with('\n');
            let (place, text) = if is_own_line {
                (blank, lines)
            } else {
                (close, format!("\n{lines}{indent}"))
            };
            self.changes.push((place..place, text));
        }
        self.changes.sort_by_key(|(range, _)| range.start);
        let mut text = String::with_capacity(self.text.len());
        let mut from = 0;
        for (range, new) in &self.changes {
            // What stands in an element that was replaced is gone with it.
            if range.start < from {
                continue;
            }
            text += &self.text[from..range.start];
            text += new;
            from = range.end;
        }
        text + &self.text[from..]
    }

    /// Right behind an element's tag.
    fn behind_tag(&self, node: Node<'_, '_>) -> usize {
        let start = node.range().start + 1;
        let ends = |letter: char| letter.is_whitespace() || letter == '/' || letter == '>';
        start + self.text[start..].find(ends).unwrap_or(0)
    }

    /// What stands before an element on its line, where that is nothing but space.
    fn indentation(&self, start: usize) -> String {
        let line = self.text[..start].rfind('\n').map_or(0, |end| end + 1);
        let before = &self.text[line..start];
        let space = before.trim_start_matches([' ', '\t']);
        before[..before.len() - space.len()].to_owned()
    }
}

/// Numbers as attributes have them, in as many digits as it takes to read the same again.
pub(super) fn numbers(values: &[f64]) -> String {
    let written = |&value: &f64| {
        if value != 0.0 && !(1e-4..1e15).contains(&value.abs()) {
            format!("{value:e}")
        } else {
            value.to_string()
        }
    };
    values.iter().map(written).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::{Edits, parse};

    #[test]
    fn what_is_not_changed_stays() {
        let text = "<a>\n  <!-- kept -->\n  <b x = '1' y=\"2\"/>\n  <c/><d>t</d>\n</a>\n";
        let document = parse(text).expect("XML");
        let find = |tag| {
            document
                .descendants()
                .find(|each| each.has_tag_name(tag))
                .expect(tag)
        };
        let mut edits = Edits::new(text);
        edits.set_numbers(find("b"), "x", &[0.1, -2.5e-9]);
        edits.set(find("b"), "z", "a<\"b\"");
        edits.append(find("c"), "<n/>".to_owned());
        edits.append(find("c"), "<o/>".to_owned());
        edits.append(find("a"), "<e/>".to_owned());
        let expected = "<a>\n  <!-- kept -->\n  <b x = '0.1 -2.5e-9' y=\"2\" z=\"a&lt;&quot;b&quot;\"/>\n  <c>\n    <n/>\n    <o/>\n  </c><d>t</d>\n  <e/>\n</a>\n";
        assert_eq!(edits.apply(), expected);
        parse(expected).expect("still XML");
    }
}
