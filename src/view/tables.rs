//! Tables of records, for pages, terminals and the texts of recordings alike.

use crate::calibration::rms_m;
use crate::identification::{AbsoluteMessage, IdentificationMessage};
use crate::quantities::units::shown_unit;
use crate::record::messages::TestPoseMessage;
use crate::record::study::StudyPlanMessage;
use crate::study::account::Contribution;
use crate::testbed::RunTruth;
use crate::text::table::RecordTable;
use crate::text::wording::{dash, inverse_interval, joined, number, percent};
use crate::view::markup::micro_sign;
use crate::workflow::run::TriedPlan;

/// The identified compliances beside the simulated truth; `unit` is a millionth of SI's.
pub fn compliances(found: &IdentificationMessage, truth: &RunTruth, unit: &str) -> RecordTable {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e6), 4);
    let rows = (found.parameters.iter().enumerate()).map(|(index, name)| {
        let interval = found.compliance_ci95_rad_per_nm[index];
        let interval = interval.map(|ends| ends.map(|end| micro(Some(end))));
        vec![
            name.clone(),
            micro(found.compliance_rad_per_nm[index]),
            interval.map_or_else(dash, |[low, high]| format!("{low} to {high}")),
            micro(truth.compliance_rad_per_nm.get(index).copied()),
        ]
    });
    let unit = micro_sign(unit);
    let header = format!("joint | compliance [{unit}] | 95 % interval | simulated truth");
    RecordTable::new(&header, rows)
}

/// What is achieved at each test pose: predicted, observed, and under a name without what was identified.
pub fn test_poses(poses: &[TestPoseMessage], without: &str) -> RecordTable {
    let micro = |value_mm: Option<f64>| number(value_mm.map(|value_mm| value_mm * 1e3), 2);
    let rows = poses.iter().map(|pose| {
        vec![
            pose.name.clone(),
            micro(pose.rho0_mm),
            micro(Some(pose.residual_mm)),
            micro(Some(pose.uncompensated_mm)),
        ]
    });
    let header = format!(
        "test pose | predicted rms [\u{b5}m] | observed in this run [\u{b5}m] | {without} [\u{b5}m]"
    );
    RecordTable::new(&header, rows)
}

/// Every plan's prediction and what came of it.
pub fn tried(plans: &[TriedPlan]) -> RecordTable {
    let rows = plans.iter().map(|plan| {
        let assessment = &plan.assessment;
        let [_, residual_m] = rms_m(&plan.calibration.poses);
        vec![
            plan.record.name.clone(),
            assessment.experiments.to_string(),
            number(assessment.rho0_m.map(|value| value * 1e6), 2),
            percent(assessment.efficiency(), 1),
            number(Some(residual_m * 1e6), 2),
            assessment.violations.len().to_string(),
        ]
    });
    let header = "plan | measurements | predicted rms \u{3c1}\u{2080} [\u{b5}m] | efficiency | observed in this run [\u{b5}m] | violations";
    RecordTable::new(header, rows)
}

/// The contributions to the errors of a simulated truth, the largest above.
pub fn contributions(parts: &[Contribution]) -> RecordTable {
    let mut sorted: Vec<&Contribution> = parts.iter().collect();
    let size = |part: &Contribution| part.contribution_um.unwrap_or(0.0);
    sorted.sort_by(|one, other| size(other).total_cmp(&size(one)));
    let rows = sorted.into_iter().map(|part| {
        let hidden = if part.hidden { " (hidden)" } else { "" };
        vec![
            format!("{}{hidden}", part.source),
            number(part.contribution_um, 3),
            percent(part.share_of(parts), 1),
        ]
    });
    RecordTable::new("source | contribution [\u{b5}m] | share of variance", rows)
}

/// What was identified from absolute readings, frames left out, beside the simulated truth of the run.
pub fn unknowns(found: &AbsoluteMessage, truth: &RunTruth) -> RecordTable {
    let truths = truth.unknowns.iter().flatten().map(|each| each.value);
    let unknowns = found.unknowns.iter().zip(truths);
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
            shown(truth),
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

/// A condition that a sweep can vary: what it is called, and its value as text.
pub type Swept = (&'static str, fn(&StudyPlanMessage) -> String);

const SWEPT: [Swept; 3] = [
    ("measurements", |runs| runs.experiments.to_string()),
    ("load scale", |runs| runs.load_scale.to_string()),
    ("sigma [mm]", |runs| format!("{:.4}", runs.sigma_mm)),
];

/// The conditions that vary between the plans of a study.
pub fn swept(plans: &[StudyPlanMessage]) -> Vec<Swept> {
    let varies = |(_, value): &Swept| plans.iter().any(|runs| value(runs) != value(&plans[0]));
    SWEPT.into_iter().filter(varies).collect()
}

/// What the runs of each plan of a study say, with a column for each condition that varies; and, `with_random`, how many
/// times as accurate as random plans they are: for pages, where what never failed has no column.
pub fn study(plans: &[StudyPlanMessage], with_random: bool) -> RecordTable {
    let swept = swept(plans);
    let shows_failed = !with_random || plans.iter().any(|runs| runs.failed > 0);
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let interval =
        |[low, high]: [f64; 2]| format!("{:.3}\u{a0}to\u{a0}{:.3}", low * 1e3, high * 1e3);
    let rows = plans.iter().map(|runs| {
        let mut row = vec![runs.name.clone()];
        row.extend(swept.iter().map(|(_, value)| value(runs)));
        row.extend([
            micro(runs.mean_mm),
            runs.mean_ci95_mm.map_or_else(dash, interval),
            micro(runs.rms_mm),
            micro(runs.predicted_rms_mm),
            number(runs.z, 1),
            micro(runs.quantiles_mm.map(|quantiles| quantiles[2])),
            number(runs.nees, 3),
        ]);
        row.extend(shows_failed.then(|| runs.failed.to_string()));
        if with_random {
            let ratio = runs
                .mean_ratio_to_random
                .zip(runs.mean_ratio_to_random_ci95);
            row.push(ratio.map_or_else(dash, |(ratio, ends)| {
                let ends = inverse_interval(ends).replace(' ', "\u{a0}");
                format!("{} ({ends})", number(Some(ratio.recip()), 2))
            }));
        }
        row
    });
    let failed = if shows_failed { " | failed" } else { "" };
    let random = if with_random {
        " | times as accurate as random"
    } else {
        ""
    };
    let header = format!(
        "plan{} | mean [\u{b5}m] | 95 % interval [\u{b5}m] | rms [\u{b5}m] | expected rms [\u{b5}m] | z | 95 % below [\u{b5}m] | NEES{failed}{random}",
        joined(swept.iter().map(|(name, _)| format!(" | {name}")), "")
    );
    RecordTable::new(&header, rows)
}
