//! What is predicted at each test pose, and what was observed there.

use super::figures::path_figure;
use super::sources::bar;
use crate::record::messages::TestPoseMessage;
use crate::text::wording::{counted, micrometres};
use crate::view::charts::PlotError;
use crate::view::markup::{cell, figure, paragraph, section, table_of_cells};

/// More test poses are a path or a region, and drawn as one.
const FEW_POSES: usize = 12;
const TITLE: &str = "At each test pose";

/// The section of what is predicted (mm) at each test pose, by its name, and over all; of a run beside what was observed and, under a name, without what
/// was identified.
pub(super) fn test_poses(
    predicted: &[(&str, Option<f64>)],
    all_mm: Option<f64>,
    run: Option<(&[TestPoseMessage], &str)>,
) -> Result<String, PlotError> {
    let observed = run.map_or(&[][..], |(observed, _)| observed);
    let values_mm = || predicted.iter().map(|(_, rho0_mm)| rho0_mm.unwrap_or(0.0));
    let caption = match predicted.len() {
        1 => "\u{3c1}\u{2080} at the test pose.".to_owned(),
        count => format!(
            "\u{3c1}\u{2080} at each of {}, in their order; over all it is {}.",
            counted(count as u64, "test pose"),
            micrometres(all_mm)
        ),
    };
    let seen_mm = observed.iter().map(|seen| seen.residual_mm);
    let longest = values_mm().chain(seen_mm).fold(f64::MIN_POSITIVE, f64::max);
    let barred = |value_mm: Option<f64>, is_seen| {
        let share = 100.0 * value_mm.unwrap_or(0.0) / longest;
        bar(share, is_seen, &micrometres(value_mm))
    };
    let rows = (predicted.iter().enumerate()).map(|(index, (name, rho0_mm))| {
        let seen = observed.get(index).map_or_else(String::new, |seen| {
            let without = cell(&micrometres(Some(seen.uncompensated_mm)));
            barred(Some(seen.residual_mm), true) + &without
        });
        cell(name) + &barred(*rho0_mm, false) + &seen
    });
    let mut header = vec!["test pose", "predicted rms \u{3c1}\u{2080}"];
    header.extend(
        run.iter()
            .flat_map(|(_, without)| ["observed in this run", without]),
    );
    let numbers = table_of_cells(&header, rows);
    if predicted.len() <= FEW_POSES {
        let body = paragraph(&caption) + &numbers;
        return Ok(section("poses", TITLE, &body));
    }
    let values_um: Vec<f64> = values_mm().map(|value_mm| value_mm * 1e3).collect();
    let svg = path_figure(&values_um, all_mm.map(|all| all * 1e3))?;
    let numbers = format!("<details><summary>The numbers</summary>\n{numbers}</details>\n");
    Ok(section(
        "poses",
        TITLE,
        &(figure(&svg, &caption) + &numbers),
    ))
}
