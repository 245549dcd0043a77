//! Names that the ends of arms have.

/// Names that ends of arms have, the likeliest first.
const ENDS: [&str; 9] = [
    "tcp",
    "tool",
    "pinch",
    "attachment",
    "grip",
    "end_effector",
    "ee",
    "flange",
    "hand",
];

/// The first of the names that is called as ends of arms are.
pub(super) fn called_end<'a>(names: impl Iterator<Item = (usize, &'a String)>) -> Option<usize> {
    let names: Vec<(usize, &String)> = names.collect();
    let has = |name: &str, word: &str| {
        let name = name.to_lowercase();
        let mut parts = name.split(|letter: char| !letter.is_alphanumeric());
        parts.any(|part| part.starts_with(word)) || (word.len() > 3 && name.contains(word))
    };
    ENDS.iter().find_map(|word| {
        let called = names.iter().find(|(_, name)| has(name, word));
        called.map(|(index, _)| *index)
    })
}
