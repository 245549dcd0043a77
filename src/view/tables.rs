//! Tables of records, for pages and for the texts of recordings alike.

use crate::quantities::units::shown_unit;
use crate::record::absolute_plan::ReadingsRunMessage;
use crate::record::messages::CalibrationMessage;
use crate::record::study::StudyPlanMessage;
use crate::text::markdown_text;
use crate::text::wording::{dash, inverse_interval, joined, number};
use crate::view::markup::{micro_sign, table_of};

/// A table; the first column is text, the others are numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordTable {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl RecordTable {
    /// With the names of its columns between bars.
    pub fn new(header: &str, rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        Self {
            header: header
                .split('|')
                .map(|name| name.trim().to_owned())
                .collect(),
            rows: rows.into_iter().collect(),
        }
    }

    /// Of a page.
    pub fn html(&self) -> String {
        table_of(&self.header, self.rows.iter().cloned())
    }

    /// Of a text, in Markdown: the first so many columns.
    pub fn markdown(&self, columns: usize) -> String {
        let line = |cells: &[String]| {
            let cells = cells.iter().take(columns).map(|cell| markdown_text(cell));
            format!("| {} |\n", joined(cells, " | "))
        };
        let columns = self.header.len().min(columns);
        let sides = "--:|".repeat(columns.saturating_sub(1));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        line(&self.header) + "|:--|" + &sides + "\n" + &rows
    }
}

/// The identified compliances beside the simulated truth; `unit` is a millionth of SI's.
pub fn compliances(calibration: &CalibrationMessage, unit: &str) -> RecordTable {
    let found = &calibration.identification;
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e6), 4);
    let rows = (found.parameters.iter().enumerate()).map(|(index, name)| {
        let interval = found.compliance_ci95_rad_per_nm[index];
        let interval = interval.map(|ends| ends.map(|end| micro(Some(end))));
        vec![
            name.clone(),
            micro(found.compliance_rad_per_nm[index]),
            interval.map_or_else(dash, |[low, high]| format!("{low} to {high}")),
            micro((calibration.truth.compliance_rad_per_nm.get(index)).copied()),
        ]
    });
    let unit = micro_sign(unit);
    let header = format!("joint | compliance [{unit}] | 95 % interval | simulated truth");
    RecordTable::new(&header, rows)
}

/// What was identified from absolute readings, frames left out, beside the simulated truth of the run.
pub fn unknowns(run: &ReadingsRunMessage) -> RecordTable {
    let found = &run.identification;
    let unknowns = found.unknowns.iter().zip(&run.true_values);
    let known = unknowns.filter(|(unknown, _)| !found.is_of_frame(&unknown.name));
    let rows = known.map(|(unknown, truth)| {
        let (factor, unit) = shown_unit(&unknown.unit);
        let shown = |value: Option<f64>| number(value.map(|value| value * factor), 4);
        let error = unknown.standard_error;
        let off = truth.zip(error);
        let off = off.map(|(truth, error)| (unknown.value - truth) / error);
        vec![
            unknown.name.clone(),
            shown(Some(unknown.nominal)),
            shown(*truth),
            shown(error.map(|_| unknown.value)),
            shown(error),
            number(off, 2),
            micro_sign(unit),
        ]
    });
    RecordTable::new(
        "unknown | nominal | simulated truth | estimate | standard error | estimate less truth [standard errors] | unit",
        rows,
    )
}

/// What the runs of each plan of a study say.
pub fn study<'a>(plans: impl IntoIterator<Item = &'a StudyPlanMessage>) -> RecordTable {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let interval = |[low, high]: [f64; 2]| format!("{:.3}\u{a0}to {:.3}", low * 1e3, high * 1e3);
    let rows = plans.into_iter().map(|runs| {
        vec![
            runs.name.clone(),
            micro(runs.mean_mm),
            runs.mean_ci95_mm.map_or_else(String::new, interval),
            micro(runs.rms_mm),
            micro(runs.predicted_rms_mm),
            micro(runs.quantiles_mm.map(|quantiles| quantiles[2])),
            number(runs.mean_ratio_to_random.map(f64::recip), 2),
            (runs.mean_ratio_to_random_ci95).map_or_else(String::new, inverse_interval),
            runs.failed.to_string(),
        ]
    });
    RecordTable::new(
        "plan | mean [\u{b5}m] | 95 % interval [\u{b5}m] | rms [\u{b5}m] | rms expected of these runs [\u{b5}m] | \
         95 % of runs below [\u{b5}m] | mean of random over it | 95 % interval | failed runs",
        rows,
    )
}
