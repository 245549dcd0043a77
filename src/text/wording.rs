//! Numbers, counts and words as a person reads them.

use std::borrow::Cow;
use std::fmt::Display;
use std::path::Path;

/// A distance in micrometres with its unit, or a dash.
pub fn micrometres(value_mm: Option<f64>) -> String {
    value_mm.map_or_else(dash, |value| {
        let micro = value * 1e3;
        // Four digits say enough, but a tenth of a nanometre says nothing.
        let decimals = match micro.abs() {
            large if large >= 1000.0 => 0,
            large if large >= 100.0 => 1,
            _ => 2,
        };
        format!("{micro:.decimals$}\u{a0}\u{b5}m")
    })
}

/// A length (m) in micrometres with the given decimals; with digits where it is so small that none would show.
pub fn in_um(value_m: f64, decimals: usize) -> String {
    let value = value_m * 1e6;
    if value != 0.0 && value.abs() < 5e-4 {
        format!("{value:.2e}")
    } else {
        format!("{value:.decimals$}")
    }
}

/// A number with the given decimals, or a dash.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(dash, |value| {
        let text = format!("{value:.decimals$}");
        // What rounds to zero has no sign.
        let is_zero = !text.contains(|letter: char| ('1'..='9').contains(&letter));
        let text = if is_zero {
            text.trim_start_matches('-')
        } else {
            &text
        };
        text.replace('-', "\u{2212}")
    })
}

/// Numbers without needless zeros, of at most so many decimals.
pub fn listed(values: impl IntoIterator<Item = f64>, decimals: usize) -> String {
    let short = |value: f64| {
        let text = format!("{value:.decimals$}");
        let text = match text.split_once('.') {
            Some(_) => text.trim_end_matches('0').trim_end_matches('.'),
            None => &text,
        };
        if text == "-0" { "0" } else { text }.replace('-', "\u{2212}")
    };
    joined(values.into_iter().map(short), ", ")
}

/// A number of so many significant digits without needless zeros.
pub fn significant(value: f64, digits: usize) -> String {
    let text = format!("{value:.*e}", digits.saturating_sub(1));
    text.parse()
        .map_or(text, |rounded: f64| rounded.to_string())
}

/// A p-value, which may be smaller than any number.
pub fn p_value(probability: f64) -> String {
    if probability > 0.0 {
        format!("p = {probability:.1e}")
    } else {
        "p < 1e-300".to_owned()
    }
}

/// A share as a percentage, or a dash.
pub fn percent(share: Option<f64>, decimals: usize) -> String {
    share.map_or_else(dash, |share| {
        format!("{}\u{a0}%", number(Some(share * 100.0), decimals))
    })
}

/// The interval of a ratio's inverse, from that of the ratio.
pub fn inverse_interval([low, high]: [f64; 2]) -> String {
    if low > 0.0 {
        format!("{:.2} to {:.2}", high.recip(), low.recip())
    } else {
        // So few runs do not bound it.
        format!("over {:.2}", high.recip())
    }
}

/// Words, or numbers, one after the other.
pub fn joined(words: impl IntoIterator<Item = impl Display>, between: &str) -> String {
    let words = words.into_iter().map(|word| word.to_string());
    words.collect::<Vec<_>>().join(between)
}

/// A sentence with some names in the place of its "{}"; nothing where there are none.
pub fn naming(names: impl IntoIterator<Item = impl Display>, sentence: &str) -> String {
    match joined(names, ", ") {
        none if none.is_empty() => none,
        names => sentence.replacen("{}", &names, 1),
    }
}

/// `count` of something, with a plural s where it belongs.
pub fn counted(count: u64, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

/// A word of a command as a shell takes it.
pub fn shell_word(word: &str) -> String {
    let is_plain = |each: char| each.is_ascii_alphanumeric() || "/._-+=,".contains(each);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// A path as a word of a command that no program takes for an option.
pub fn shell_path(path: &Path) -> String {
    shell_word(&no_option(path).to_string_lossy())
}

/// The same file by a path that does not begin as an option.
pub fn no_option(path: &Path) -> Cow<'_, Path> {
    if path.as_os_str().as_encoded_bytes().starts_with(b"-") {
        Cow::Owned(Path::new(".").join(path))
    } else {
        Cow::Borrowed(path)
    }
}

/// What stands for a number that does not exist.
pub fn dash() -> String {
    "\u{2013}".to_owned()
}

/// A name of at most so many characters: what is too long loses its middle, since names differ most at
/// their ends.
pub fn shortened(name: &str, most: usize) -> String {
    let count = name.chars().count();
    if count <= most {
        return name.to_owned();
    }
    let last = most / 2;
    let first = most.saturating_sub(last + 1);
    let start = name.chars().take(first);
    let end = name.chars().skip(count - last);
    start.chain(['\u{2026}']).chain(end).collect()
}

/// Minutes as hours and minutes.
pub fn duration(minutes: f64) -> String {
    let minutes = minutes.round();
    let (hours, rest) = ((minutes / 60.0).floor(), minutes % 60.0);
    if hours > 0.0 {
        format!("{hours:.0} h {rest:.0} min")
    } else {
        format!("{rest:.0} min")
    }
}

#[cfg(test)]
mod tests {
    use super::shortened;

    #[test]
    fn long_names_keep_both_ends() {
        assert_eq!(shortened("joint_1", 7), "joint_1");
        assert_eq!(shortened("the_first_joint_1", 8), "the\u{2026}nt_1");
        assert_eq!(
            shortened("\u{fc}\u{fc}\u{fc}\u{fc}", 3),
            "\u{fc}\u{2026}\u{fc}"
        );
    }
}
