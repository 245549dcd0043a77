//! `select`: does optimal design help on a real robot?

use crate::identification::ParameterGroup;
use crate::measurement::read_measured;
use crate::quantities::limits::MOST_EXPERIMENTS;
use crate::record::selection::selection_json;
use crate::study::selection::{
    CHOICES, Chosen, Selection, SelectionOfSize, SelectionWanted, choice_name, select,
};
use crate::view::plots::selection_plot;

use super::command_prelude::*;
use super::progress::search;

#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file), mut_args(without_effect(&["out"])))]
pub struct Select {
    #[command(flatten)]
    pub common: Common,
    /// Absolute readings, of which some are chosen.
    #[arg(long, value_name = "FILE")]
    measurements: PathBuf,
    /// What to fit, frames of stations and targets always among it; what the scenario's robot.parameters name if not given.
    #[arg(long, value_enum, value_name = "GROUPS", value_delimiter = ',')]
    parameters: Vec<ParameterGroup>,
    /// How many readings to choose; visits where several readings are of one.
    #[arg(long, value_name = "M", value_delimiter = ',', default_value = "20,40", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EXPERIMENTS)))]
    sizes: Vec<u32>,
    /// How many random choices of each size.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    draws: u32,
    /// How many robots without discrepancy to compare with.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(0..=1000))]
    campaigns: u32,
    /// Where to draw what came of it (SVG).
    #[arg(long, value_name = "FILE")]
    plot_out: Option<PathBuf>,
}

impl Select {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let (scenario, _) = (self.common).load_measured("select", &self.measurements)?;
        self.common.check_files(&scenario, None)?;
        let why = ", and readings are chosen of absolute ones";
        let readings =
            read_measured(&self.measurements, &scenario.task)?.absolute(&self.measurements, why)?;
        let ways = self.sizes.len() * (CHOICES.len() + self.draws as usize);
        let readings_words = counted(readings.len() as u64, "reading");
        let says = format!("choosing among {readings_words} in {ways} ways");
        let wanted = SelectionWanted {
            sizes: self.sizes.clone(),
            draws: self.draws,
            campaigns: self.campaigns,
            seed: scenario.seed,
        };
        let belief = &scenario.task.belief;
        let selection = search(&self.common, &says, |watch| {
            select(belief, &readings, &self.parameters, &wanted, watch)
        })
        .map_err(|error| error.in_file(&self.measurements))?;
        let mut keys = selection_json(&selection);
        keys["groups"] = json!(self.parameters);
        let mut report = Report::new(keys, describe(&selection), Vec::new());
        if let Some(path) = &self.plot_out {
            let title = "Calibrated with a few readings, validated on all others";
            report.save(path, &selection_plot(title, &selection)?);
        }
        if selection.is_cut_short {
            let words = "the study was stopped: not all choices were made";
            report
                .conditions
                .push(ConditionCode::SearchStopped.with(words));
        }
        Ok((self.common).report("select", &scenario, report)?)
    }
}

fn describe(selection: &Selection<'_>) -> String {
    let mut text = format!(
        "{} unknowns{}; mean residual of a fit of all {}: {:.4} mm\n",
        selection.parts.all.set.len(),
        match selection.known_before() {
            0 => String::new(),
            known => format!(", of {known} of which something is known before"),
        },
        counted(selection.parts.all.left.len() as u64, "reading"),
        selection.all_mm().mean
    );
    for of_size in &selection.sizes {
        text += &format!("\n{}", of_one_size(of_size, selection.parts.unit()));
    }
    let counted = if selection.parts.known.functions.is_empty() {
        "are for errors that are independent between readings"
    } else {
        "count joint error functions, which every fit has"
    };
    text += &format!("\n  rho0 and predicted rms (with what is new at each reading) {counted}.\n");
    if !selection.parts.are_all_judged() {
        text += "  Positions alone are judged on, and no measured distances.\n";
    }
    text += "  Distances are those at all readings that were not chosen.\n  From all is the rms distance from the robot that all readings are fitted to; without discrepancy, the \
             same for a robot that is exactly as the\n  model says, whose readings have independent errors as large.\n";
    text
}

/// The [`NUMBERS`](crate::study::selection::NUMBERS) in the order of the table's columns.
const SHOWN: [usize; 8] = [0, 1, 5, 2, 3, 4, 6, 7];

fn of_one_size(of_size: &SelectionOfSize, unit: &str) -> String {
    let row = |name: &str, better: String, numbers: [Option<f64>; 8]| {
        let mut row = vec![name.to_owned()];
        row.extend(SHOWN.map(|place| number(numbers[place], 4)));
        row.insert(6, better);
        row
    };
    let mut problems = String::new();
    let mut rows = Vec::new();
    for (criterion, chosen) in &of_size.planned {
        let name = choice_name(criterion);
        if let Some(problem) = Chosen::problem(chosen) {
            problems += &format!("  {name}: {problem}\n");
        }
        let chosen = chosen.as_ref();
        let better = chosen
            .ok()
            .and_then(|chosen| of_size.better_than_random(chosen));
        let numbers = chosen.map_or([None; 8], Chosen::numbers_mm);
        let better = number(better.map(|share| share * 100.0), 0);
        rows.push(row(name, better, numbers));
    }
    let spreads = of_size.spreads_mm();
    for (place, name) in ["5 % are below", "median", "5 % are above"]
        .iter()
        .enumerate()
    {
        let numbers = spreads.map(|spread| spread.map(|spread| spread[place]));
        rows.push(row(&format!("random: {name}"), String::new(), numbers));
    }
    let header = "chosen by | mean [mm] | rms | predicted rms | 95 % below | largest | better than random [%] | rho0 | from all | without discrepancy";
    let draws = of_size.random.len();
    let failed = draws - of_size.random_means_mm().len();
    if failed > 0 {
        problems += &format!("  {failed} of {draws} random choices give no fit.\n");
    }
    format!(
        "{} of the {unit}s, {draws} random choices:\n{}{problems}",
        of_size.size,
        table(header, rows)
    )
}
