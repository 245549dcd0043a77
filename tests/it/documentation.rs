//! README and `docs/`: short enough, no link into nothing, no command or option that is not there.
//!
//! That the commands run as they stand, and print what the pages say, is `tools/try-docs`'s.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::support::{Workplace, project};

/// Every page that people read, by its path in the project.
fn pages() -> Vec<PathBuf> {
    let mut pages = vec!["README.md", "CONTRIBUTING.md", "CHANGELOG.md"]
        .into_iter()
        .map(PathBuf::from)
        .collect::<Vec<_>>();
    for entry in std::fs::read_dir(project("docs")).expect("the folder can be read") {
        let name = entry.expect("the entry can be read").file_name();
        if Path::new(&name).extension() == Some("md".as_ref()) {
            pages.push(Path::new("docs").join(name));
        }
    }
    pages.sort();
    pages
}

fn text(page: &Path) -> String {
    std::fs::read_to_string(project("").join(page)).expect("the page can be read")
}

/// The lines that are prose: not in fenced blocks.
fn prose(text: &str) -> String {
    let mut fenced = false;
    let kept = text.lines().filter(|line| {
        let is_fence = line.trim_start().starts_with("```");
        fenced ^= is_fence;
        !fenced && !is_fence
    });
    kept.collect::<Vec<_>>().join("\n")
}

/// The anchors that a page's headings have.
fn anchors(page: &Path) -> BTreeSet<String> {
    let text = prose(&text(page));
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let anchor = |heading: &str| -> String {
        (heading
            .trim_start_matches('#')
            .trim()
            .to_lowercase()
            .chars())
        .filter(|letter| letter.is_alphanumeric() || " -_".contains(*letter))
        .map(|letter| if letter == ' ' { '-' } else { letter })
        .collect()
    };
    headings.map(anchor).collect()
}

/// Where the links of a text lead.
fn links(text: &str) -> Vec<String> {
    let parts = text.split("](").skip(1);
    parts
        .filter_map(|part| Some(part.split_once(')')?.0.to_owned()))
        .collect()
}

#[test]
fn the_readme_has_at_most_200_lines() {
    assert!(text("README.md".as_ref()).lines().count() <= 200);
}

#[test]
fn every_link_leads_somewhere() {
    let mut found = 0;
    for page in pages() {
        let folder = page.parent().expect("a page lies in a folder");
        for link in links(&prose(&text(&page))) {
            if link.contains("://") {
                continue;
            }
            found += 1;
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if file.is_empty() {
                page.clone()
            } else {
                folder.join(file)
            };
            assert!(
                project("").join(&target).exists(),
                "{}: {link}",
                page.display()
            );
            if !anchor.is_empty() {
                assert!(
                    anchors(&target).contains(anchor),
                    "{}: {link}",
                    page.display()
                );
            }
        }
    }
    assert!(found > 40, "{found} links");
}

#[test]
fn every_page_is_reached_from_the_readme() {
    let (mut reached, mut open) = (BTreeSet::new(), vec![PathBuf::from("README.md")]);
    while let Some(page) = open.pop() {
        let folder = page.parent().expect("a page lies in a folder").to_owned();
        if !reached.insert(page.clone()) {
            continue;
        }
        for link in links(&prose(&text(&page))) {
            let file = link.split('#').next().unwrap_or_default();
            if Path::new(file).extension() == Some("md".as_ref()) {
                let parent = folder.as_os_str() == "docs" && file.starts_with("../");
                open.push(if parent {
                    file[3..].into()
                } else {
                    folder.join(file)
                });
            }
        }
    }
    for page in pages() {
        assert!(reached.contains(&page), "{}", page.display());
    }
}

/// The calls of the program that a page shows: lines of code and spans of code.
fn calls(text: &str) -> Vec<String> {
    let lines = (text.lines())
        .filter_map(|line| line.strip_prefix("    elastocal "))
        .map(|call| call.split(" # ").next().unwrap_or(call));
    let spans = (text.split('`').skip(1).step_by(2))
        .filter_map(|span| span.strip_prefix("elastocal "))
        .filter(|span| !span.contains('\n'));
    lines.chain(spans).map(str::to_owned).collect()
}

#[test]
fn every_help_has_examples_of_what_is_there() {
    let place = Workplace::new();
    let listed = place.run("--help").ends_with(0).stdout;
    let commands = listed.lines().skip_while(|line| *line != "Commands:");
    let commands: Vec<&str> = (commands.skip(1).take_while(|line| !line.is_empty()))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(commands.len() > 18, "{commands:?}");
    for command in commands {
        let help = place.run(&format!("{command} --help")).ends_with(0).stdout;
        let (help, examples) = help.split_once("\nExample").expect(command);
        let examples: Vec<&str> = examples.lines().skip(1).collect();
        assert!(!examples.is_empty(), "{command}");
        for example in examples {
            let mut words = example.split_whitespace();
            assert_eq!(words.next(), Some("elastocal"), "{example}");
            assert_eq!(words.next(), Some(command), "{example}");
            for option in words.filter(|word| word.starts_with("--")) {
                let mut known = help.split(|letter: char| letter.is_whitespace() || letter == ',');
                assert!(known.any(|word| word == option), "{example}");
            }
        }
    }
}

#[test]
fn shells_complete_commands_and_options() {
    let place = Workplace::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = place
            .run(&format!("completion {shell}"))
            .ends_with(0)
            .stdout;
        for word in ["identify", "sigma-from-residuals", "accuracy-um"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
}

#[test]
fn every_command_and_option_that_a_page_names_is_there() {
    let place = Workplace::new();
    let mut helps = std::collections::BTreeMap::<String, String>::new();
    let mut found = 0;
    for page in pages() {
        for call in calls(&prose(&text(&page))) {
            let mut words = call.split_whitespace();
            let command = words.next().unwrap_or_default();
            if ["help", "<command>"].contains(&command) {
                continue;
            }
            found += 1;
            let help = (helps.entry(command.to_owned())).or_insert_with(|| {
                let shown = place.run(&format!("{command} --help"));
                assert_eq!(shown.code, Some(0), "{}: {call}", page.display());
                shown.stdout
            });
            for option in words.filter(|word| word.starts_with("--")) {
                let name = option.split('=').next().unwrap_or(option);
                let is_there = (help.split(|letter: char| letter.is_whitespace() || letter == ','))
                    .any(|word| word == name);
                assert!(is_there, "{}: {call}: {name}", page.display());
            }
        }
    }
    assert!(found > 40, "{found} calls");
}
