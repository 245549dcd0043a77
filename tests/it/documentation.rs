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

/// Pages that people read as documentation; what changed is another matter.
fn documentation() -> impl Iterator<Item = PathBuf> {
    let pages = pages()
        .into_iter()
        .chain([PathBuf::from("python/README.md")]);
    pages.filter(|page| page != Path::new("CHANGELOG.md"))
}

#[test]
fn pages_have_at_most_200_lines_of_140_characters() {
    for page in documentation() {
        let text = text(&page);
        assert!(text.lines().count() <= 200, "{}", page.display());
        // What the program prints, and what sets up a page's files, is as long as it is.
        for line in prose(&text)
            .lines()
            .filter(|line| !line.starts_with("<!--"))
        {
            assert!(line.chars().count() <= 140, "{}: {line}", page.display());
        }
    }
}

/// The words of a page's prose without code and targets of links, in lower case, with a space before each.
fn words(page: &Path) -> String {
    let text = prose(&text(page));
    let lines = text
        .lines()
        .filter(|line| !line.starts_with("    ") && !line.starts_with("<!--"));
    let lines: Vec<&str> = lines.collect();
    // Every other part between backquotes is code.
    let plain: String = lines.join("\n").split('`').step_by(2).collect();
    let (before, after) = plain.split_once("](").unwrap_or((&plain, ""));
    let parts = after
        .split("](")
        .map(|part| part.split_once(')').map_or(part, |(_, rest)| rest));
    let kept = parts.fold(before.to_owned(), |kept, part| kept + " " + part);
    let words = kept.split(|letter: char| !letter.is_alphanumeric() && letter != '-');
    (words.filter(|word| !word.is_empty()))
        .fold(String::new(), |all, word| all + " " + &word.to_lowercase())
}

/// Who searches for a term of the field finds the page that is about it.
#[test]
fn the_terms_of_the_field_are_there() {
    for (page, terms) in [
        (
            "README.md",
            "uncertainty budget, predicted accuracy, outlier, model discrepancy, transmission error, cross-validation",
        ),
        (
            "docs/uncertainties.md",
            "uncertainty budget, gum, error source, level, repeatability, iso 9283, maximum permissible error",
        ),
        (
            "docs/predicted_accuracy.md",
            "predicted accuracy, standard uncertainty, 95th percentile, lower bound, identifiable",
        ),
        (
            "docs/joint_errors.md",
            "backlash, transmission error, harmonic, nonlinear joint stiffness",
        ),
        (
            "docs/measurements.md",
            "outlier, model discrepancy, validation",
        ),
        (
            "docs/absolute_readings.md",
            "joint error function, outlier, effective sample size, cross-validation, coverage",
        ),
        (
            "docs/discrepancy.md",
            "model discrepancy, model selection, cross-validation, coverage, inconsistency",
        ),
        (
            "docs/glossary.md",
            "no conformity, gum, jcgm 101, jcgm 106, iso 9283, iso 10360-10, uncertainty budget, outlier, minimax",
        ),
    ] {
        let found = words(page.as_ref());
        for term in terms.split(", ") {
            assert!(found.contains(term), "{page}: {term}");
        }
    }
}

/// Words of this project alone, for which the field has terms (docs/glossary.md), are in no page's prose.
#[test]
fn pages_use_the_terms_of_the_field() {
    let private = [
        "promise",
        "nobody knows",
        "misfit",
        "joint return",
        "gear error",
        "told",
        "tells",
        "ladder",
        "rung",
        "belief",
        "contradict",
        "wrong reading",
        "compensation leaves",
    ];
    let allowed = [("docs/glossary.md", ""), ("docs/paper.md", "contradict")];
    for page in documentation() {
        let found = words(&page);
        for word in private {
            let is_allowed = (allowed.iter())
                .any(|(other, own)| page == Path::new(other) && word.starts_with(own));
            let is_there = found.contains(&format!(" {word}"));
            assert!(is_allowed || !is_there, "{}: {word:?}", page.display());
        }
    }
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
                // Each folder has one level.
                open.push(match file.strip_prefix("../") {
                    Some(of_the_project) => of_the_project.into(),
                    None => folder.join(file),
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

fn commands(place: &Workplace) -> Vec<String> {
    let listed = place.done("--help").stdout;
    let commands = listed.lines().skip_while(|line| *line != "Commands:");
    let commands: Vec<String> = (commands.skip(1).take_while(|line| !line.is_empty()))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .map(str::to_owned)
        .collect();
    assert!(commands.len() > 18, "{commands:?}");
    commands
}

/// Options are in groups, each on a line.
#[test]
fn help_fits_on_a_screen() {
    let place = Workplace::new();
    for command in commands(&place) {
        let help = place.done(&format!("{command} --help")).stdout;
        assert_eq!(place.done(&format!("{command} -h")).stdout, help);
        let longest = help.lines().map(|line| line.chars().count()).max();
        assert!(help.lines().count() <= 50, "{help}");
        assert!(longest <= Some(100), "{longest:?}: {help}");
        let options = |help: &str| -> BTreeSet<String> {
            let names = help.split(|letter: char| letter.is_whitespace() || letter == ',');
            names
                .filter(|word| word.starts_with("--"))
                .map(str::to_owned)
                .collect()
        };
        let whole = place.done(&format!("{command} --help all")).stdout;
        let whole = whole.split("\nExample").next().expect("options");
        let missing: Vec<String> = (options(whole).into_iter())
            .filter(|option| {
                !help.contains(&format!("  {option}")) && !help.contains(&format!(", {option}"))
            })
            .filter(|option| whole.contains(&format!("      {option}")))
            .collect();
        assert!(missing.is_empty(), "{command}: {missing:?}");
    }
    let plan = place.done("plan --help").stdout;
    let groups: Vec<&str> = (plan.lines())
        .filter(|line| line.ends_with(':') && !line.starts_with(' '))
        .collect();
    assert_eq!(
        groups,
        [
            "Arguments:",
            "Design:",
            "Bound:",
            "Output:",
            "Common:",
            "Examples:"
        ]
    );
}

#[test]
fn every_help_has_examples_of_what_is_there() {
    let place = Workplace::new();
    for command in commands(&place) {
        let help = (place.done(&format!("{command} --help all"))).stdout;
        let (help, examples) = help.split_once("\nExample").expect("examples");
        let examples: Vec<&str> = examples.lines().skip(1).collect();
        assert!(!examples.is_empty(), "{command}");
        for example in examples {
            let mut words = example.split_whitespace();
            assert_eq!(words.next(), Some("elastocal"), "{example}");
            assert_eq!(words.next(), Some(&*command), "{example}");
            for option in words.filter(|word| word.starts_with("--")) {
                let mut known = help.split(|letter: char| letter.is_whitespace() || letter == ',');
                assert!(known.any(|word| word == option), "{example}");
            }
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
