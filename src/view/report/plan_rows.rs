//! The rows of a plan as a table, whatever is measured.

use std::ops::Range;

use crate::observation::LengthKind;
use crate::record::messages::PlanRowMessage;
use crate::task::Task;
use crate::text::table::RecordTable;
use crate::text::wording::{dash, joined, listed, number};
use crate::view::markup::unbroken;

/// Angles and loads, and as far as there are such: torques, the direction of a gauge, what is read from where, and nominal lengths.
pub(super) fn plan_rows(task: &Task, rows: &[PlanRowMessage]) -> RecordTable {
    let has_torque = rows.iter().any(|row| {
        let wrench = row.wrench.as_ref();
        wrench.is_some_and(|wrench| wrench[3..] != [0.0; 3])
    });
    let length_mm = |row: &PlanRowMessage, kind: LengthKind| {
        let length = row.reads.as_ref()?.length.0;
        let length = length.filter(|length| length.kind == kind)?;
        Some(length.length_m * 1e3)
    };
    let mut kinds = LengthKind::ALL.to_vec();
    kinds.retain(|&kind| rows.iter().any(|row| length_mm(row, kind).is_some()));
    let vector = |values: &[f64]| unbroken(&listed(values.iter().copied(), 4));
    let half = |row: &PlanRowMessage, half: Range<usize>| {
        row.wrench.map_or_else(dash, |wrench| vector(&wrench[half]))
    };
    let own = &task.belief.calibration_tool.name;
    let cells = |(index, row): (usize, &PlanRowMessage)| {
        let mut cells = vec![(index + 1).to_string()];
        cells.extend(row.q_deg.iter().map(|&angle| number(Some(angle), 3)));
        cells.push(half(row, 0..3));
        cells.extend(has_torque.then(|| half(row, 3..6)));
        if let Some(reads) = &row.reads {
            cells.push(reads.target.as_ref().unwrap_or(own).clone());
            cells.push(reads.station.clone().unwrap_or_else(dash));
        } else if task.reads_along() {
            let all = || "all coordinates".to_owned();
            cells.push(row.direction.map_or_else(all, |each| vector(&each)));
        }
        cells.push(row.repeats.to_string());
        let lengths = kinds.iter().map(|&kind| number(length_mm(row, kind), 3));
        cells.extend(lengths);
        cells
    };
    let columns = task.belief.commands().columns();
    let angles = columns.iter().map(|column| column.replace('_', " [") + "]");
    let (first, read) = match rows.first().and_then(|row| row.reads.as_ref()) {
        Some(_) => ("row", " | reflector | station"),
        None if task.reads_along() => ("experiment", " | read along"),
        None => ("experiment", ""),
    };
    let torque = if has_torque { " | torque [N m]" } else { "" };
    let lengths = kinds.iter().map(|kind| format!(" | {} [mm]", kind.name()));
    let header = format!(
        "{first} | {} | force [N]{torque}{read} | times{}",
        joined(angles, " | "),
        joined(lengths, "")
    );
    RecordTable::new(&header, rows.iter().enumerate().map(cells))
}
