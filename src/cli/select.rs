//! `select`: does optimal design help on a real robot?

use std::path::PathBuf;

use clap::Args;
use elastocal::codes::{ConditionCode, ErrorCode};
use elastocal::files::FileError;
use elastocal::identification::{DistanceStatistics, ParameterGroup};
use elastocal::measurement::{MeasuredFile, Origin, read_measured};
use elastocal::plan::search::Watch;
use elastocal::quantities::limits::MOST_EXPERIMENTS;
use elastocal::record::selection::{PlannedChoiceMessage, SelectionMessage, SelectionSizeMessage};
use elastocal::record::{json::merge, messages::ProvenanceMessage};
use elastocal::study::selection::{CHOICES, SelectionWanted, WITH_FUNCTIONS, select};
use elastocal::text::wording::counted;
use elastocal::view::selection_plot::selection_plot;
use serde_json::json;

use super::identify::absolute::explained;
use super::interruption::ask_search;
use super::progress::{bar, show};
use super::table::{number, table};
use super::written::Written;
use super::{Common, Report, check_outputs, inputs, named_by_file, results, without_effect};

/// Arguments of `select`.
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
    /// How many readings to choose.
    #[arg(long, value_name = "M", value_delimiter = ',', default_values_t = [20, 40], value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EXPERIMENTS)))]
    sizes: Vec<u32>,
    /// How many random choices of each size.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    draws: u32,
    /// How often to read a robot without discrepancy, in comparison.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(0..=1000))]
    campaigns: u32,
    /// Where to draw what came of it (SVG).
    #[arg(long, value_name = "FILE")]
    plot_out: Option<PathBuf>,
}

impl Select {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let origin = Origin::read(&self.measurements)?;
        let input = ["select", "--measurements"];
        let scenario = (self.common).load_for(input, &self.measurements, origin.as_ref())?;
        let mut roles = inputs(&scenario);
        roles.reads("the measurements", &self.measurements);
        check_outputs(&mut roles, &[("--plot-out", self.plot_out.as_deref())])?;
        let wrong = |problem: String| {
            FileError::new(&self.measurements, problem).code(ErrorCode::Measurements)
        };
        let MeasuredFile::Absolute(readings) =
            read_measured(&self.measurements, &scenario.task.belief)?
        else {
            let problem = "holds deflections, and readings are chosen of absolute ones".to_owned();
            return Err(wrong(problem).code(ErrorCode::OtherAccuracy).into());
        };
        if let Some(size) = (self.sizes.iter()).find(|size| **size as usize >= readings.len()) {
            let problem = format!(
                "holds {}, of which {size} leave none to validate on",
                counted(readings.len() as u64, "reading")
            );
            return Err(wrong(problem).hint("give smaller --sizes").into());
        }
        let ways = self.sizes.len() * (CHOICES.len() + self.draws as usize);
        let readings_words = counted(readings.len() as u64, "reading");
        let stop = ask_search();
        (self.common).say(&format!("choosing among {readings_words} in {ways} ways"));
        let bar = bar(self.common.quiet, "choosing, calibrating, judging");
        let watch = Watch {
            stop,
            progress: &|done, all, _| show(&bar, done, all),
        };
        let wanted = SelectionWanted {
            sizes: self.sizes.clone(),
            draws: self.draws,
            campaigns: self.campaigns,
            seed: scenario.seed,
        };
        let belief = &scenario.task.belief;
        let selection = select(belief, &readings, &self.parameters, &wanted, watch)
            .map_err(|error| explained(&self.measurements, &error))?;
        bar.finish_and_clear();
        super::interruption::searched();
        let message = SelectionMessage::new(&selection);
        let mut text = describe(&message);
        let mut written = Written::default();
        if let Some(path) = &self.plot_out {
            let title = "Calibrated with a few readings, validated on all others";
            text += &written.save(path, &selection_plot(title, &message)?);
        }
        let provenance =
            ProvenanceMessage::new(&scenario).with_input("measurements", &self.measurements)?;
        let mut json = results("select", &provenance, json!({ "groups": self.parameters }));
        merge(&mut json, serde_json::to_value(&message)?);
        let mut conditions = Vec::new();
        if selection.is_cut_short {
            let words = "the study was stopped: not all choices were made";
            conditions.push(ConditionCode::SearchStopped.with(words));
        }
        conditions.extend(written.conditions());
        Ok(Report::new(json, text, conditions))
    }
}

fn describe(message: &SelectionMessage) -> String {
    let mut text = format!(
        "{} unknowns{}; mean residual of a fit of all {}: {:.4} mm\n",
        message.unknowns.len(),
        match message.known_before {
            0 => String::new(),
            known => format!(", of {known} of which something is known before"),
        },
        counted(message.readings as u64, "reading"),
        message.all_mm.mean
    );
    for of_size in &message.sizes {
        text += &format!("\n{}", of_one_size(of_size));
    }
    let counted = if message.joint_errors.is_empty() {
        "are for errors that are independent between readings"
    } else {
        "count joint error functions, which every fit has"
    };
    text += &format!("\n  rho0 and predicted rms (with what is new at each reading) {counted}.\n");
    text += "  Distances are those at all readings that were not chosen.\n  From all is the rms distance from the robot that all readings are fitted to; without discrepancy, the \
             same for a robot that is exactly as the\n  model says, whose readings have independent errors as large.\n";
    text
}

/// What a criterion is called here.
fn named(choice: &PlannedChoiceMessage) -> &str {
    match choice.criterion.as_str() {
        "test_pose" => "absolute accuracy",
        "d" => "D, O1",
        "o2" => "O2",
        "o3" => "O3, E",
        "o4" => "O4",
        "o5" => "O5",
        WITH_FUNCTIONS => "absolute accuracy, joint errors",
        other => other,
    }
}

fn of_one_size(of_size: &SelectionSizeMessage) -> String {
    let row = |name: &str, better: String, cells: [Option<f64>; 8]| {
        let mut row = vec![name.to_owned()];
        row.extend(cells.map(|value| number(value, 4)));
        row.insert(6, better);
        row
    };
    let mut problems = String::new();
    let mut rows = Vec::new();
    for choice in &of_size.planned {
        if let Some(problem) = &choice.problem {
            problems += &format!("  {}: {problem}\n", named(choice));
        }
        let distance = choice.distance_mm.as_ref();
        let of = |get: fn(&DistanceStatistics) -> f64| distance.map(get);
        let better = choice.better_than_random.map(|share| share * 100.0);
        let cells = [
            of(|lengths| lengths.mean),
            of(|lengths| lengths.rms),
            choice.predicted_rms_mm,
            of(|lengths| lengths.quantile95),
            of(|lengths| lengths.largest),
            choice.rho0_mm,
            choice.from_all_mm,
            choice.without_discrepancy_from_true_mm,
        ];
        rows.push(row(named(choice), number(better, 0), cells));
    }
    let random = &of_size.random;
    for (place, name) in ["5 % are below", "median", "5 % are above"]
        .iter()
        .enumerate()
    {
        let cells = [
            "mean_mm",
            "rms_mm",
            "predicted_rms_mm",
            "quantile95_mm",
            "largest_mm",
            "rho0_mm",
            "from_all_mm",
            "without_discrepancy_from_true_mm",
        ];
        let cells = cells.map(|of| random.spreads[of].map(|spread| spread[place]));
        rows.push(row(&format!("random: {name}"), String::new(), cells));
    }
    let header = "chosen by | mean [mm] | rms | predicted rms | 95 % below | largest | better than random [%] | rho0 | from all | without discrepancy";
    if random.failed > 0 {
        problems += &format!(
            "  {} of {} random choices give no fit.\n",
            random.failed, random.draws
        );
    }
    format!(
        "{} of the readings, {} random choices:\n{}{problems}",
        of_size.size,
        random.draws,
        table(header, rows)
    )
}
