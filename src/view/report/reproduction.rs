//! The page of the paper's reproduction.

use super::distances::{Line, Role, distances_figure, distances_table};
use super::provenance;
use crate::paper::{Accuracy, MeanDistance, Reproduction};
use crate::record::messages::{ExperimentMessage, ProvenanceMessage};
use crate::text::wording::{number, percent};
use crate::view::charts::PlotError;
use crate::view::markup::{card, heading, page, paragraph, section, table};

/// The paper.
const CITATION: &str = "A. Klimchik, A. Pashkevich, Y. Wu, S. Caro, B. Furet, Design of calibration experiments for \
                        identification of manipulator elastostatic parameters, Journal of Mechanics Engineering and \
                        Automation 2 (2012) 531-542.";

/// The paper's numbers beside this program's, as HTML.
pub fn reproduction_page(
    message: &Reproduction,
    from: &ProvenanceMessage,
    command: &str,
) -> Result<String, PlotError> {
    let title = "The paper\u{2019}s numbers, and ours";
    let mut body = heading(title, CITATION, &cards(message));
    body += &section(
        "fig7",
        "Fig. 7: twelve measurements by each plan",
        &figure_7(message)?,
    );
    body += &section(
        "table6",
        "Table 6: accuracy of the plans",
        &table_6(message),
    );
    body += &format!(
        "<div class=\"pair\">\n{}{}</div>\n",
        section("eq23", "Eq. 23: the test pose", &equation_23(message)),
        section("table5", "Table 5: standard errors", &table_5(message))
    );
    body += &section("table4", "Table 4: the plans", &table_4(message));
    body += &provenance(from, command);
    Ok(page("Klimchik et al. 2012, reproduced", &body))
}

/// What agrees, what does not, and how much better than random.
fn cards(message: &Reproduction) -> String {
    let cells = || message.eq23.iter().flatten();
    let (equal, all) = (cells().filter(|cell| cell.agrees).count(), cells().count());
    let rows = message.table5.iter();
    let largest = rows.map(|row| row.largest_difference).fold(0.0, f64::max);
    let kept = (message.table6.iter())
        .filter(|row| row.keeps_the_rule == Some(true))
        .count();
    let ruled = (message.table6.iter())
        .filter(|row| row.keeps_the_rule.is_some())
        .count();
    let agrees = card(
        if message.agrees { "good" } else { "bad" },
        "What agrees",
        if message.agrees {
            "eq. 23, Table 5, the rule of repeats"
        } else {
            "not all that should"
        },
        &format!(
            "{equal} of {all} numbers of eq. 23 within their printing; all of Table 5 within {}; {kept} of {ruled} repeated \
             plans of Table 6 follow \u{3c1}\u{2080}\u{b7}\u{221a}(m/M). {}",
            percent(Some(largest), 2),
            message.failures.join("; ")
        ),
    );
    let ratios: Vec<f64> = message.table6.iter().filter_map(|row| row.ratio).collect();
    let low = ratios.iter().copied().fold(f64::MAX, f64::min);
    let high = ratios.iter().copied().fold(0.0, f64::max);
    let differs = card(
        "bad",
        "What does not",
        &format!("Table 6: {low:.2} to {high:.2} times"),
        "By eq. 20 with eq. 23 and sigma = 0.03 mm, which reproduce Table 5, the plans of Table 4 have residual errors larger by that than Table 6 prints. The ratio is not constant, so no common factor explains it.",
    );
    let gains: Vec<f64> = (message.table6.iter())
        .filter(|row| row.experiments == row.configurations)
        .filter_map(|row| Some(1.0 - row.own_rho0_mm? / row.found_rho0_mm?))
        .collect();
    let own = card(
        "good",
        "Our own optimum",
        &format!(
            "{} to {} better",
            percent(Some(gains.iter().copied().fold(f64::MAX, f64::min)), 0),
            percent(Some(gains.iter().copied().fold(0.0, f64::max)), 0)
        ),
        "The plans that elastocal designs for as many measurements, against those of Table 4, both by eq. 20.",
    );
    agrees + &differs + &own + &headline_card(message)
}

/// How much better than random.
fn headline_card(message: &Reproduction) -> String {
    let has_ratio = |each: &&MeanDistance| each.random_over_mean.is_some();
    let papers = || {
        let fig7 = message.fig7.iter().filter(has_ratio);
        fig7.filter(|each| each.printed_mean_mm.is_some())
    };
    let ours = papers().filter_map(|each| each.random_over_mean);
    let printed: Vec<f64> = papers()
        .filter_map(|each| each.printed_random_over_mean)
        .collect();
    let own = (message.fig7.iter()).rfind(|each| each.printed_mean_mm.is_none());
    let Some((own, [low, high])) = own.and_then(|own| Some((own, own.random_over_mean_ci95?)))
    else {
        return String::new();
    };
    let span = |values: &[f64]| {
        let low = values.iter().copied().fold(f64::MAX, f64::min);
        let high = values.iter().copied().fold(0.0, f64::max);
        format!("{low:.2} to {high:.2}")
    };
    card(
        "",
        "Random against optimal",
        &format!("{} times the distance", number(own.random_over_mean, 2)),
        &format!(
            "is the residual error of random plans, compared with our optimum (95 % interval {low:.2} to {high:.2}); {} times, compared \
             with Table 4\u{2019}s plans. The paper says about 60 % more: its means give {} times.",
            span(&ours.collect::<Vec<_>>()),
            span(&printed)
        ),
    )
}

fn figure_7(message: &Reproduction) -> Result<String, PlotError> {
    let role = |index: usize, each: &MeanDistance| match each.printed_mean_mm {
        _ if index == 0 => Role::Random,
        Some(_) => Role::Other,
        None => Role::Own,
    };
    let lines: Vec<Line<'_>> = (message.fig7.iter().enumerate())
        .map(|(index, each)| Line {
            printed_mean_mm: each.printed_mean_mm,
            ..Line::new(&each.runs, role(index, each))
        })
        .collect();
    let caption = format!(
        "{} runs of each plan by the linear model, all with the same noise. Vertical line: the mean; diamond: the mean \
         that the paper prints. How the paper drew its random plans is not said; here they are uniform in the joint \
         ranges, within the bounds of Table 3.",
        message.trials
    );
    let legend: Vec<Vec<String>> = (message.fig7.iter())
        .map(|each| vec![each.runs.name.clone(), each.description.clone()])
        .collect();
    let legend: String = (legend.iter())
        .map(|each| format!("{}: {}", each[0], each[1]))
        .collect::<Vec<_>>()
        .join("; ");
    Ok(
        distances_figure(&lines, &caption)?
            + &paragraph(&(legend + "."))
            + &distances_table(&lines),
    )
}

fn table_6(message: &Reproduction) -> String {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let row = |row: &Accuracy| {
        let mut repeats: Vec<u32> = row.own_plan.iter().map(|each| each.repeats).collect();
        repeats.sort_unstable_by(|one, other| other.cmp(one));
        let repeats: Vec<String> = repeats.iter().map(u32::to_string).collect();
        let repeats = if row.configurations == row.experiments {
            "none".to_owned()
        } else {
            repeats.join(" + ")
        };
        vec![
            row.experiments.to_string(),
            row.configurations.to_string(),
            micro(Some(row.printed_rho0_mm)),
            micro(row.by_rule_rho0_mm),
            micro(row.found_rho0_mm),
            number(row.ratio, 3),
            micro(row.own_rho0_mm),
            repeats,
            micro(row.lower_bound_rho0_mm),
        ]
    };
    let rows = message.table6.iter().map(row);
    let header = "measurements | configurations | printed [\u{b5}m] | printed, by the rule of repeats [\u{b5}m] | Table 4\u{2019}s plan by eq. 20 [\u{b5}m] | ratio to printed | our plan [\u{b5}m] | its repeats | no plan is below [\u{b5}m]";
    paragraph(
        "\u{3c1}\u{2080} at the test pose. The rule of repeats: a plan of m measurements that is repeated to M has \u{221a}(m/M) times the residual error. Our plans may share out the repeats unevenly.",
    ) + &table(header, rows)
}

fn equation_23(message: &Reproduction) -> String {
    let mut rows = Vec::new();
    for (name, row) in ["x", "y", "z"].iter().zip(&message.eq23) {
        // No minus before a zero.
        let shown = |value: f64| number(Some((value * 10.0).round() / 10.0 + 0.0), 1);
        let mut printed = vec![format!("{name}, printed")];
        printed.extend(row.iter().map(|cell| shown(cell.printed_nm2)));
        let mut ours = vec![format!("{name}, ours")];
        ours.extend(row.iter().map(|cell| shown(cell.found_nm2)));
        rows.extend([printed, ours]);
    }
    let header = "row | k2 | k3 | k4 | k5 | k6";
    paragraph(
        "In N m\u{b2}. Angles and numbers are printed with one decimal, which leaves some tenths open.",
    ) + &table(header, rows)
}

fn table_5(message: &Reproduction) -> String {
    let mut rows = Vec::new();
    for row in &message.table5 {
        let nano = |value: Option<f64>| {
            let value = value.map(|value| value * 1e9);
            let decimals = if value.is_some_and(|value| value < 10.0) {
                2
            } else {
                1
            };
            number(value, decimals)
        };
        let mut printed = vec![format!("{}, printed", row.experiments)];
        printed.extend((row.printed_rad_per_nm.iter()).map(|&value| nano(Some(value))));
        printed.push(String::new());
        let mut ours = vec![format!("{}, ours", row.experiments)];
        ours.extend(row.found_rad_per_nm.iter().map(|&value| nano(value)));
        ours.push(percent(Some(row.largest_difference), 2));
        rows.extend([printed, ours]);
    }
    let header = "measurements | k2 | k3 | k4 | k5 | k6 | apart by";
    paragraph("In 1e-9 rad/(N m), of the plans of Table 4.") + &table(header, rows)
}

fn table_4(message: &Reproduction) -> String {
    let mut body = paragraph(
        "Configurations in degrees (q1 is free). Printed with one decimal, some break the bound on the elevation of the \
         tool by hundredths of a degree. Our plans are other points of the same region.",
    );
    for plan in &message.table4 {
        let own = (message.table6.iter()).find(|row| {
            (row.experiments, row.configurations) == (plan.experiments, plan.experiments)
        });
        let (printed, own) = (&plan.plan, own.map_or(&[][..], |row| &row.own_plan));
        let mut rows = angles("printed", printed);
        rows.extend(angles("ours", own));
        let header = "plan | q2 | q3 | q4 | q5 | q6";
        body += &format!(
            "<details><summary>{} measurements</summary>\n{}{}</details>\n",
            plan.experiments,
            table(header, rows),
            (plan.violations.iter())
                .map(|each| paragraph(each))
                .collect::<String>()
        );
    }
    body
}

fn angles(whose: &str, plan: &[ExperimentMessage]) -> Vec<Vec<String>> {
    (plan.iter().enumerate())
        .map(|(index, experiment)| {
            let mut row = vec![format!("{whose} {}", index + 1)];
            let angles = experiment.q_deg.iter().skip(1);
            row.extend(angles.map(|&angle| number(Some(angle), 1)));
            row
        })
        .collect()
}
