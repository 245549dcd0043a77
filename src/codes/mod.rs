//! Stable codes of conditions and errors, with what they mean.
//!
//! The first two digits are the area. A code keeps its meaning: one that is no longer needed is not given again.
//!
//! - `condition`: a result that is there, and that somebody must look at before relying on it (exit code 3).
//! - `conditions`, `errors`: the tables.

/// An enum of codes from one table: name, id, title, explanation.
macro_rules! codes {
    ($(#[$about:meta])* $type:ident { $($name:ident = $id:literal, $title:literal, $explanation:literal;)* }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        pub enum $type {
            $(#[doc = $title] #[serde(rename = $id)] $name,)*
        }

        impl $type {
            /// All codes, by their ids.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            /// What the code means.
            pub const fn meaning(self) -> $crate::codes::Meaning {
                match self {
                    $(Self::$name => $crate::codes::Meaning { id: $id, title: $title, explanation: $explanation },)*
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                text.pad(self.meaning().id)
            }
        }
    };
}

mod condition;
mod conditions;
mod errors;

pub use condition::Condition;
pub use conditions::ConditionCode;
pub use errors::ErrorCode;

use serde::Serialize;

/// What the codes that begin so are about.
pub const AREAS: [(&str, &str); 15] = [
    ("C01", "Plans"),
    ("C02", "Identification"),
    ("C03", "Validation and compensation"),
    ("C04", "Simulation and comparison"),
    ("C05", "Robot and loads"),
    ("C06", "Files"),
    ("E01", "Scenarios"),
    ("E02", "Models"),
    ("E03", "Tables"),
    ("E04", "Plans and programs"),
    ("E05", "Identification"),
    ("E06", "Files"),
    ("E07", "Simulation and comparison"),
    ("E08", "Views"),
    ("E09", "Others"),
];
/// So many codes are named where one is not known.
const NAMED: usize = 3;

/// What a code means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Meaning {
    /// The code, such as "C0102".
    pub id: &'static str,
    /// What it is about, in a few words.
    pub title: &'static str,
    /// What was found, by which computation and with which threshold, and what to do.
    pub explanation: &'static str,
}

/// The meanings of all codes: conditions, then errors.
pub fn meanings() -> impl Iterator<Item = Meaning> {
    let conditions = ConditionCode::ALL.iter().map(|code| code.meaning());
    conditions.chain(ErrorCode::ALL.iter().map(|code| code.meaning()))
}

/// The meanings of the codes that begin so, in capitals or not: of one, of an area, of all conditions ("C") or errors ("E").
///
/// # Errors
/// There is no such code: which are nearest to it.
pub fn meanings_of(word: &str) -> Result<Vec<Meaning>, String> {
    let wanted = word.trim().to_uppercase();
    let found = meanings().filter(|each| !wanted.is_empty() && each.id.starts_with(&wanted));
    let found: Vec<Meaning> = found.collect();
    if found.is_empty() {
        return Err(unknown(&wanted, meanings().collect()));
    }
    Ok(found)
}

/// The code of a condition, in capitals or not.
///
/// # Errors
/// There is no such code: which are nearest to it.
pub fn condition_code(word: &str) -> Result<ConditionCode, String> {
    let wanted = word.trim().to_uppercase();
    let all = ConditionCode::ALL.iter();
    let found = all.clone().find(|code| code.meaning().id == wanted);
    (found.copied()).ok_or_else(|| unknown(&wanted, all.map(|code| code.meaning()).collect()))
}

fn unknown(wanted: &str, mut near: Vec<Meaning>) -> String {
    let alike = |id: &str| {
        let pairs = id.chars().zip(wanted.chars());
        pairs.take_while(|(one, other)| one == other).count()
    };
    near.sort_by_key(|each| {
        let changes = strsim::levenshtein(each.id, wanted);
        (changes, std::cmp::Reverse(alike(each.id)))
    });
    let near: Vec<String> = (near.iter().take(NAMED))
        .map(|each| format!("{} ({})", each.id, each.title))
        .collect();
    format!("there is no such code; the nearest are {}", near.join(", "))
}
