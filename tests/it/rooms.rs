//! The rooms of the library: each uses only those that stand before it in the list of `src/lib.rs`; within a
//! room, no files go round in a circle; a type's name means one thing in all of them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::support::project;

/// The modules in the order in which the documentation lists them.
fn listed() -> Vec<String> {
    let text = std::fs::read_to_string(project("src/lib.rs")).expect("it is there");
    let list = text
        .split("# How the data flows")
        .nth(1)
        .and_then(|rest| rest.split("//! # ").next())
        .expect("the list is there");
    let mut names: Vec<String> = Vec::new();
    for piece in list.split("[`").skip(1) {
        let name = piece.split('`').next().expect("it has an end");
        let is_module = name
            .chars()
            .all(|letter| letter.is_lowercase() || letter == '_');
        if is_module && !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    names
}

/// The modules that there are.
fn declared() -> Vec<String> {
    let text = std::fs::read_to_string(project("src/lib.rs")).expect("it is there");
    let names = text.lines().filter_map(|line| {
        let name = line
            .strip_prefix("pub mod ")
            .or(line.strip_prefix("mod "))?;
        Some(name.trim_end_matches(';').to_owned())
    });
    names.collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
}

/// The source files of a module, tests of its own apart.
fn sources(module: &str) -> Vec<PathBuf> {
    let file = project(&format!("src/{module}.rs"));
    if file.exists() {
        return vec![file];
    }
    let mut files = Vec::new();
    collect(&project(&format!("src/{module}")), &mut files);
    files.retain(|file| file.file_name().is_some_and(|name| name != "tests.rs"));
    files
}

/// The types that a text of code defines, those within functions and modules apart.
fn defined(text: &str) -> Vec<&str> {
    let of_line = |line| {
        let mut words = str::split_whitespace(line).skip_while(|word| word.starts_with("pub"));
        let kind = words.next()?;
        let name = words.next()?;
        let is_name = |letter: char| !letter.is_alphanumeric();
        let is_type = ["struct", "enum", "union", "trait", "type"].contains(&kind);
        is_type.then(|| name.split(is_name).next().unwrap_or_default())
    };
    let lines = text.lines().filter(|line| !line.starts_with(' '));
    lines.filter_map(of_line).collect()
}

/// What a text of code names after some path such as `crate::`, with the lines' numbers. Comments and the tests at
/// the end of a file are left out.
fn named_after(path: &str, text: &str) -> Vec<(usize, String)> {
    let code = text.split("#[cfg(test)]\nmod tests {").next();
    let code: Vec<&str> = code
        .unwrap_or_default()
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect();
    let code = code.join("\n");
    let mut uses = Vec::new();
    for (start, path) in code.match_indices(path) {
        if code[..start].ends_with("super::") {
            continue;
        }
        let line = code[..start].lines().count();
        let rest = &code[start + path.len()..];
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(group) => top_level(group),
            None => vec![rest],
        };
        for name in names {
            let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
            let name = name.trim_start().split(|letter| !is_part(letter)).next();
            let name = name.filter(|name| !name.is_empty());
            uses.extend(name.map(|name| (line, name.to_owned())));
        }
    }
    uses
}

/// The parts of a group of imports, whose closing brace may lie in the text.
fn top_level(group: &str) -> Vec<&str> {
    let (mut depth, mut start, mut parts) = (0, 0, Vec::new());
    for (index, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' if depth == 0 => {
                parts.push(&group[start..index]);
                break;
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&group[start..index]);
                start = index + 1;
            }
            _ => {}
        }
    }
    parts
}

/// What a module may not use, where it uses it.
fn upward(order: &[String], module: &str, text: &str) -> Vec<String> {
    let place = |name: &str| order.iter().position(|other| other == name);
    let own = place(module);
    let is_upward = |(_, name): &(usize, String)| place(name).is_some_and(|at| Some(at) > own);
    let found = named_after("crate::", text).into_iter().filter(is_upward);
    found
        .map(|(line, name)| format!("{module} uses {name}, line {line}"))
        .collect()
}

/// A folder of a room, by the parts of its path below `src`.
struct Folder {
    /// Its files and folders by name, each with all that is in it: how deep below the folder, and the code.
    members: BTreeMap<String, Vec<(usize, String)>>,
    /// What it hands on of its members under other names: the name, and whose it is.
    handed_on: BTreeMap<String, String>,
}

impl Folder {
    fn new(folder: &Path) -> Self {
        let read = |path: &Path| std::fs::read_to_string(path).expect("it is there");
        let mut files = Vec::new();
        collect(folder, &mut files);
        let mut members: BTreeMap<String, Vec<(usize, String)>> = BTreeMap::new();
        files.retain(|file| file.extension().is_some_and(|kind| kind == "rs"));
        files.retain(|file| !file.ends_with("tests.rs"));
        for file in files {
            let within = file.strip_prefix(folder).expect("it is in it");
            let parts: Vec<_> = within
                .with_extension("")
                .iter()
                .map(ToOwned::to_owned)
                .collect();
            let name = parts[0].to_str().expect("plain text").to_owned();
            let is_parent = parts.last().is_some_and(|last| last == "mod");
            if parts.len() > 1 || !is_parent {
                let depth = parts.len() - usize::from(is_parent);
                members.entry(name).or_default().push((depth, read(&file)));
            }
        }
        let own = read(&folder.join("mod.rs"));
        let mut handed_on = BTreeMap::new();
        for member in members.keys() {
            for path in [format!("use {member}::"), format!("use self::{member}::")] {
                let names = named_after(&path, &own).into_iter();
                handed_on.extend(names.map(|(_, name)| (name, member.clone())));
            }
        }
        Self { members, handed_on }
    }

    /// Which members each member uses, at a module's path such as `crate::plan::`.
    fn uses(&self, path: &str) -> BTreeMap<&str, BTreeSet<&str>> {
        let of_text = |(depth, text): &(usize, String)| {
            let above = "super::".repeat(*depth);
            let mut names = named_after(&above, text);
            names.extend(named_after(path, text));
            names
        };
        let whose = |name: &String| {
            let name = self.handed_on.get(name).unwrap_or(name);
            (self.members.get_key_value(name)).map(|(member, _)| member.as_str())
        };
        let uses = self.members.iter().map(|(member, texts)| {
            let names = texts.iter().flat_map(of_text);
            let mut used: BTreeSet<&str> = names.filter_map(|(_, name)| whose(&name)).collect();
            used.remove(member.as_str());
            (member.as_str(), used)
        });
        uses.collect()
    }

    /// Members that use each other in a circle, however long.
    fn circular(&self, path: &str) -> Vec<&str> {
        let mut uses = self.uses(path);
        // Whoever uses nothing any more, or is used by nobody, is in no circle.
        loop {
            let left: BTreeSet<&str> = uses.keys().copied().collect();
            let used: BTreeSet<&str> = uses.values().flatten().copied().collect();
            uses.retain(|name, others| {
                others.retain(|other| left.contains(other));
                !others.is_empty() && used.contains(name)
            });
            if uses.len() == left.len() {
                return left.into_iter().collect();
            }
        }
    }
}

#[test]
fn no_files_of_a_room_go_round_in_a_circle() {
    let mut files = Vec::new();
    collect(&project("src"), &mut files);
    files.retain(|file| file.ends_with("mod.rs"));
    assert!(files.len() > 30, "{}", files.len());
    for file in files {
        let folder = file.parent().expect("it is in one");
        let below = folder.strip_prefix(project("src")).expect("it is in it");
        let parts: Vec<_> = below.iter().filter_map(|part| part.to_str()).collect();
        let path = format!("crate::{}::", parts.join("::"));
        let circular = Folder::new(folder).circular(&path).join(", ");
        assert!(circular.is_empty(), "{path} has a circle in {circular}");
    }
}

#[test]
fn circles_of_files_are_found() {
    let folder = |texts: [&str; 3]| {
        let members = ["a", "b", "c"].map(str::to_owned).into_iter();
        let texts = texts.map(|text| vec![(1, text.to_owned())]);
        Folder {
            members: members.zip(texts).collect(),
            handed_on: BTreeMap::from([("Thing".to_owned(), "c".to_owned())]),
        }
    };
    let circle = [
        "use super::b::x;",
        "use crate::room::{Thing, other};",
        "fn f() { super::a::g() }",
    ];
    assert_eq!(folder(circle).circular("crate::room::"), ["a", "b", "c"]);
    let none = [
        "use super::b::x;",
        "use super::Thing;",
        "use super::super::a::g; // super::a",
    ];
    assert!(folder(none).circular("crate::room::").is_empty());
}

#[test]
fn every_module_is_listed_once() {
    let mut listed = listed();
    listed.sort_unstable();
    let mut declared = declared();
    declared.sort_unstable();
    assert_eq!(listed, declared);
}

#[test]
fn modules_use_only_those_before_them() {
    let order = listed();
    let mut wrong = Vec::new();
    for module in &order {
        for file in sources(module) {
            let text = std::fs::read_to_string(&file).expect("it is there");
            let found = upward(&order, module, &text).into_iter();
            wrong.extend(found.map(|what| format!("{}: {what}", file.display())));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn names_of_types_are_unique() {
    let mut files = Vec::new();
    collect(&project("src"), &mut files);
    // What stands in for the views where they are left out has their names.
    files.retain(|file| !file.ends_with("src/cli/views/without.rs"));
    let mut places: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for file in files {
        let text = std::fs::read_to_string(&file).expect("it is there");
        for name in defined(&text) {
            places
                .entry(name.to_owned())
                .or_default()
                .push(file.clone());
        }
    }
    assert!(places.len() > 300, "{}", places.len());
    places.retain(|_, files| files.len() > 1);
    assert!(places.is_empty(), "defined twice: {places:#?}");
}

#[test]
fn definitions_are_found() {
    let text = "pub struct One;\npub(super) enum Two<'a> {\n    Four,\n}\ntype Three = u8;\nfn f() {}\n    struct No;\n// struct No\nimpl Trait for One {}\n";
    assert_eq!(defined(text), ["One", "Two", "Three"]);
}

#[test]
fn what_looks_upward_is_found() {
    let order = ["low", "high"].map(str::to_owned);
    for upward_use in [
        "use crate::high::Thing;",
        "fn f() { crate::high::thing() }",
        "use crate::{\n    low::{a, b},\n    high,\n};",
        "#[cfg(test)]\nmod tests;\nuse crate::high;",
    ] {
        assert_eq!(upward(&order, "low", upward_use).len(), 1, "{upward_use}");
        assert!(upward(&order, "high", upward_use).is_empty());
    }
    for other in [
        "/// As [`crate::high::Thing`].",
        "use crate::low::Thing; // not crate::high",
        "use super::high::Thing;",
        "#[cfg(test)]\nmod tests {\n    use crate::high::Thing;",
    ] {
        assert!(upward(&order, "low", other).is_empty(), "{other}");
    }
}

/// The numbers of the equations that a text names: "eq. 20", "eqs. 10, 11", "eqs. 3 to 8", "(eqs. 4 and 8)".
fn equations(text: &str) -> BTreeSet<usize> {
    let lines = text
        .lines()
        .map(|line| line.trim().trim_start_matches(['/', '!']));
    let words: Vec<String> = lines
        .flat_map(|line| line.split_whitespace().map(str::to_owned))
        .collect();
    let number = |word: &str| -> Option<usize> {
        word.trim_matches(|letter: char| !letter.is_ascii_digit())
            .parse()
            .ok()
    };
    let mut found = BTreeSet::new();
    for (place, word) in words.iter().enumerate() {
        if !["eq.", "eqs."].contains(&word.trim_start_matches(['(', '"'])) {
            continue;
        }
        let mut last = None;
        let mut is_range = false;
        for word in &words[place + 1..] {
            match (word.as_str(), number(word)) {
                ("to", _) => is_range = true,
                ("and", _) => {}
                (_, Some(next)) => {
                    found.extend(last.filter(|_| is_range).unwrap_or(next)..=next);
                    (last, is_range) = (Some(next), false);
                }
                _ => break,
            }
            // Whatever follows a closing bracket or the end of a sentence is not of the list.
            if word.ends_with([')', '.', ';', ':']) {
                break;
            }
        }
    }
    found
}

#[test]
fn named_equations_are_found() {
    let text = "/// See eqs. 3, 4 and\n/// 7 (eqs. 10 to 12). In eq. 20; 21 things.";
    assert_eq!(equations(text), BTreeSet::from([3, 4, 7, 10, 11, 12, 20]));
}

/// Whoever looks for an equation of the paper finds the code that is about it.
#[test]
fn every_equation_of_the_paper_has_its_place() {
    let modules = declared();
    let texts = modules.iter().flat_map(|module| sources(module));
    let found: BTreeSet<usize> = texts
        .flat_map(|file| equations(&std::fs::read_to_string(file).expect("it is there")))
        .collect();
    let missing: Vec<usize> = (1..=23).filter(|number| !found.contains(number)).collect();
    assert_eq!(missing, [] as [usize; 0]);
}
