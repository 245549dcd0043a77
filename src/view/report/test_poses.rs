//! What is predicted at each test pose, and what was observed there.

use plotters::prelude::*;

use super::figures::path_figure;
use crate::record::messages::TestPoseMessage;
use crate::text::wording::{counted, micrometres};
use crate::view::charts::{COLOURS, ChartAxis, INK, PlotError, Rows, WHOLE};
use crate::view::markup::{figure, table};

/// More test poses are a path or a region, and drawn as one.
const FEW_POSES: usize = 12;
/// Half of a bar's height, where rows have height one.
const HALF_BAR: f64 = 0.3;

/// What is predicted (mm) at each test pose, by its name, and over all; of a run beside what was observed and, under a name, without what
/// was identified.
pub(super) fn test_poses(
    predicted: &[(&str, Option<f64>)],
    all_mm: Option<f64>,
    run: Option<(&[TestPoseMessage], &str)>,
) -> Result<String, PlotError> {
    let observed = run.map_or(&[][..], |(observed, _)| observed);
    let values: Vec<f64> = (predicted.iter())
        .map(|(_, rho0_mm)| rho0_mm.unwrap_or(0.0) * 1e3)
        .collect();
    let mut caption = match values.len() {
        1 => "\u{3c1}\u{2080} at the test pose.".to_owned(),
        count => format!(
            "\u{3c1}\u{2080} at each of {}, in their order; over all it is {}.",
            counted(count as u64, "test pose"),
            micrometres(all_mm)
        ),
    };
    let rows = (predicted.iter().enumerate()).map(|(index, (name, rho0_mm))| {
        let seen = observed.get(index).into_iter();
        let seen = seen.flat_map(|seen| [seen.residual_mm, seen.uncompensated_mm]);
        let mut row = vec![(*name).to_owned(), micrometres(*rho0_mm)];
        row.extend(seen.map(|distance_mm| micrometres(Some(distance_mm))));
        row
    });
    let header = run.map_or_else(
        || "test pose | \u{3c1}\u{2080}".to_owned(),
        |(_, without)| {
            format!("test pose | predicted rms \u{3c1}\u{2080} | observed in this run | {without}")
        },
    );
    let numbers = table(&header, rows);
    if values.len() > FEW_POSES {
        let svg = path_figure(&values, all_mm.map(|all| all * 1e3))?;
        return Ok(figure(&svg, &caption)
            + &format!("<details><summary>The numbers</summary>\n{numbers}</details>\n"));
    }
    let (names, notes): (Vec<String>, Vec<String>) = (predicted.iter())
        .map(|(name, rho0_mm)| ((*name).to_owned(), micrometres(*rho0_mm)))
        .unzip();
    let seen_um: Vec<f64> = observed.iter().map(|seen| seen.residual_mm * 1e3).collect();
    let longest = values.iter().chain(&seen_um).copied().fold(0.0, f64::max) * 1.04;
    let rows = Rows {
        names: &names,
        notes: &notes,
        width: WHOLE,
        axis: ChartAxis::linear(0.0..longest.max(f64::MIN_POSITIVE), 8),
        title: "\u{3c1}\u{2080}, predicted rms distance [\u{b5}m]".to_owned(),
    };
    let svg = rows.drawn("Accuracy at each test pose", |chart| {
        for (row, value) in values.iter().enumerate() {
            let middle = rows.middle(row);
            let corners = [(0.0, middle - HALF_BAR), (*value, middle + HALF_BAR)];
            chart.draw_series([Rectangle::new(corners, COLOURS[0].mix(0.75).filled())])?;
        }
        for (row, seen) in seen_um.iter().enumerate() {
            let middle = rows.middle(row);
            let across = [(*seen, middle - 0.46), (*seen, middle + 0.46)];
            chart.draw_series([PathElement::new(across, INK.stroke_width(4))])?;
        }
        Ok(())
    })?;
    if run.is_none() {
        return Ok(figure(&svg, &caption));
    }
    caption += " Vertical lines: observed in this run.";
    Ok(figure(&svg, &caption) + &numbers)
}
