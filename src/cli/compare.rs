//! `compare`: two results files against tolerances.

use crate::comparison::record::{COLUMNS, comparison_json, markdown, notes, row, verdict};
use crate::comparison::{Aspect, Comparison, compare, results::ResultsFile};
use crate::files::{output::write_whole, roles::Roles};
use crate::gate::Decision;

use super::command_prelude::*;
use super::{Accepted, Said, check_outputs};

#[derive(Debug, Args)]
pub struct Compare {
    /// The results to measure by, of run, plan, evaluate or study.
    base: PathBuf,
    /// The results to judge, by the gate of their scenario.
    new: PathBuf,
    /// Compare although these differ.
    #[arg(long, value_name = "SETTINGS", value_enum, value_delimiter = ',')]
    allow_different: Vec<Aspect>,
    /// Allow no change at all on the same platform.
    #[arg(long)]
    exact: bool,
    /// Allow so small a share of each number to change, on the same platform, as "1e-9" for rounding.
    #[arg(long, value_name = "SHARE", value_parser = share, conflicts_with = "exact")]
    within: Option<f64>,
    /// Where to write a summary in Markdown.
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    #[command(flatten)]
    pub said: Said,
    #[command(flatten)]
    pub accepted: Accepted,
}

impl Compare {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let read =
            |path| ResultsFile::read(path).map_err(|wrong| wrong.or_code(ErrorCode::NotComparable));
        let (base, new) = (read(&self.base)?, read(&self.new)?);
        let mut roles = Roles::default();
        roles.reads("the base", &self.base);
        roles.reads("the results to judge", &self.new);
        let written = self.markdown.as_deref().map(|path| ("--markdown", path));
        check_outputs(&mut roles, written.as_slice())?;
        let within = if self.exact { Some(0.0) } else { self.within };
        let comparison = compare(&base, &new, &self.allow_different, within)?;
        if let Some(path) = &self.markdown {
            write_whole(path, markdown(&base, &new, &comparison).as_bytes())?;
        }
        Ok(Report::new(
            comparison_json(&base, &new, &comparison)?,
            describe(&base, &new, &comparison),
            conditions(&comparison),
        ))
    }
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok();
    share
        .filter(|share| (0.0..1.0).contains(share))
        .ok_or_else(|| "a share from 0 to 1 is wanted, as in \"1e-9\"".to_owned())
}

/// Changes that are not accepted, the first of each kind by name.
fn conditions(comparison: &Comparison) -> Vec<Condition> {
    let said = |(decision, code, words): (Decision, ConditionCode, &str)| {
        let same = comparison
            .broken()
            .filter(|change| change.decision == decision);
        let names: Vec<String> = same.map(|change| change.key.text()).collect();
        let first = names.first()?;
        let others = match names.len() {
            1 => String::new(),
            count => format!(" and {} more", count - 1),
        };
        Some(code.with(format!("{words}: {first}{others}")))
    };
    let kinds = [
        (
            Decision::Reject,
            ConditionCode::BeyondTolerance,
            "changed beyond tolerance",
        ),
        (
            Decision::Inconclusive,
            ConditionCode::InconclusiveChange,
            "inconclusive, the tolerance is within the guard band",
        ),
    ];
    kinds.into_iter().filter_map(said).collect()
}

/// The comparison for a person.
fn describe(base: &ResultsFile, new: &ResultsFile, comparison: &Comparison) -> String {
    let origin = |name: &str, file: &ResultsFile| {
        let provenance = &file.provenance;
        format!(
            "{name} {}: elastocal {} ({}), {}\n",
            file.path.display(),
            provenance.version,
            provenance.commit,
            provenance.platform
        )
    };
    let mut text = origin("base", base) + &origin("new ", new) + "\n";
    text += &aligned(&COLUMNS, comparison.changes.iter().map(row));
    text += &format!("\n{}\n", verdict(comparison));
    for note in notes(base, new, comparison) {
        text += &format!("{note}\n");
    }
    text
}
