//! `reproduce`: the paper's numbers beside this program's.

use crate::paper::{Reproduction, reproduce};
use crate::plan::search::Watch;
use crate::record::messages::ProvenanceMessage;

use super::command_prelude::*;
use super::interruption::{STOP, proceed};
use super::progress::{bar, show};
use super::results;
use super::written::record_text;

#[derive(Debug, Args)]
#[command(mut_arg("scenario", |argument| argument.default_value("scenarios/klimchik2012.toml")))]
pub struct Reproduce {
    #[command(flatten)]
    pub common: Common,
    /// The number of runs of figure 7; the scenario's if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    trials: Option<u64>,
}

/// The file of the results.
const FILE: &str = "reproduction.json";

impl Reproduce {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let scenario = common.load()?;
        let folder = common.results_folder(&scenario, &[FILE])?;
        let trials = self.trials.unwrap_or(scenario.study.trials);
        common.say("designing a plan for each number of Table 6");
        let bar = bar(common.quiet, "designing plans");
        let watch = Watch::quiet(&STOP);
        let reproduction = reproduce(&scenario, trials, watch, &|done, all| show(&bar, done, all));
        bar.finish_and_clear();
        proceed()?;
        let message = reproduction?;
        let provenance = ProvenanceMessage::new(&scenario);
        let mut json = results("reproduce", &provenance, [serde_json::to_value(&message)?]);
        let failures = message.failures.iter();
        let conditions: Vec<Condition> = failures
            .map(|text| ConditionCode::NotReproduced.with(text))
            .collect();
        let record = record_text(&mut json, &conditions)?;
        let text = describe(&message) + &format!("\nResults are in {}\n", folder.display());
        let mut report = Report::new(json, text, conditions);
        report.written.save(&folder.join(FILE), &record);
        Ok(report)
    }
}

/// What agrees, what does not, and how much better than random, for a person.
fn describe(message: &Reproduction) -> String {
    let cells = || message.eq23.iter().flatten();
    let worst = (message.table5.iter())
        .map(|row| row.largest_difference)
        .fold(0.0, f64::max);
    let ruled = || (message.table6.iter()).filter(|row| row.keeps_the_rule.is_some());
    let kept = ruled().filter(|row| row.keeps_the_rule == Some(true));
    let mut text = format!(
        "eq. 23: {} of {} numbers agree as far as they are printed\n\
         Table 5: the standard errors of Table 4's plans agree within {:.2} %\n\
         Table 6: {} of {} repeated plans keep the rule rho0 sqrt(m/M); but its numbers do not follow from eq. 23:\n\n",
        cells().filter(|cell| cell.agrees).count(),
        cells().count(),
        worst * 100.0,
        kept.count(),
        ruled().count(),
    );
    text += &table_6(message);
    text += &format!(
        "\nFig. 7: mean distance after 12 measurements, {} runs of each plan:\n\n",
        message.trials
    );
    text += &figure_7(message);
    let own = (message.fig7.iter()).rfind(|each| each.printed_mean_mm.is_none());
    if let Some((own, [low, high])) = own.and_then(|own| Some((own, own.random_over_mean_ci95?))) {
        text += &format!(
            "\nResidual error of random plans: {} times that of our optimum ({low:.2} to {high:.2}); the paper has about 1.6 times that of its plans.\n",
            number(own.random_over_mean, 2)
        );
    }
    text
}

fn table_6(message: &Reproduction) -> String {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let rows = (message.table6.iter()).map(|row| {
        vec![
            format!("{} in {}", row.experiments, row.configurations),
            micro(Some(row.printed_rho0_mm)),
            micro(row.found_rho0_mm),
            number(row.ratio, 3),
            micro(row.own_rho0_mm),
            micro(row.lower_bound_rho0_mm),
        ]
    });
    let header =
        "measurements | printed [um] | Table 4 by eq. 20 [um] | ratio | our plan [um] | bound [um]";
    table(header, rows)
}

fn figure_7(message: &Reproduction) -> String {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 2);
    let interval = |ends: Option<[f64; 2]>| {
        ends.map_or_else(String::new, |[low, high]| format!("{low:.2} to {high:.2}"))
    };
    let rows = (message.fig7.iter()).map(|each| {
        vec![
            each.runs.name.clone(),
            micro(each.printed_mean_mm),
            micro(each.runs.mean_mm),
            interval((each.runs.mean_ci95_mm).map(|ends| ends.map(|end| end * 1e3))),
            number(each.random_over_mean, 2),
            interval(each.random_over_mean_ci95),
        ]
    });
    let header =
        "plan | printed [um] | mean [um] | 95 % interval [um] | random over it | 95 % interval";
    table(header, rows)
}
