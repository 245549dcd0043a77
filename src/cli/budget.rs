//! `budget`: how many experiments, and in how many configurations?

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use clap::Args;
use elastocal::codes::ConditionCode;
use elastocal::laboratory::{Campaign, time::quickest};
use elastocal::plan::search::{BudgetPoint, budget, cheapest, repeated_configurations};
use elastocal::quantities::plausible::ACCURACY;
use elastocal::record::messages::{CommonSourcesMessage, ProvenanceMessage};
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use elastocal::view::plots::budget_plot;
use serde_json::{Value, json};

use super::interruption::ask_search;
use super::progress::{bar, show};
use super::proof::{ProofArgs, proof_json};
use super::table::{number, table_of};
use super::uncertainty_budget::common_sources;
use super::written::Written;
use super::{Common, Report, check_outputs, inputs, results, without_effect};

/// Arguments of `budget`.
#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["out"])))]
pub struct Budget {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    proof: ProofArgs,
    /// The largest number of measurements.
    #[arg(long, value_name = "M", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=100))]
    up_to: u32,
    /// The accuracy that is wanted at the test pose (rms, um).
    #[arg(long, value_name = "UM", default_value_t = 5.0, value_parser = |text: &str| ACCURACY.parse(text))]
    accuracy_um: f64,
    /// Find what takes the least time, by the table [laboratory] of the scenario, in place of fewest measurements.
    #[arg(long)]
    by_minutes: bool,
    /// Where to write the plot (SVG).
    #[arg(long, value_name = "FILE")]
    plot_out: Option<PathBuf>,
}

impl Budget {
    /// The cheapest way to the accuracy that is wanted, with the minutes that it takes; these are none where no way
    /// between its experiments is found.
    fn needed(
        &self,
        scenario: &Scenario,
        points: &[BudgetPoint],
    ) -> Option<(BudgetPoint, Option<f64>)> {
        let (task, laboratory) = (&scenario.task, &scenario.laboratory);
        let accuracy_m = self.accuracy_um * 1e-6;
        let enough = points.iter().filter(|point| point.rho0_m <= accuracy_m);
        let quickest = || quickest(task, laboratory, enough.map(|point| (&point.plan, point)));
        if self.by_minutes
            && let Some((minutes, point)) = quickest()
        {
            return Some((point.clone(), Some(minutes)));
        }
        let point = cheapest(points, accuracy_m)?;
        let campaign = Campaign::new(task, laboratory, &point.plan, false);
        Some((point, campaign.ok().map(|campaign| campaign.minutes)))
    }

    /// The cheapest way for a person.
    fn tell(&self, point: &BudgetPoint, minutes: Option<f64>) -> String {
        let time = minutes.filter(|_| self.by_minutes);
        let time = time.map_or_else(String::new, |minutes| format!(": {minutes:.0} minutes"));
        format!(
            "\nFor {} um at the test pose you need {} in {}{time}.\n",
            self.accuracy_um,
            counted(point.experiments.into(), "measurement"),
            counted(point.configurations.into(), "configuration"),
        )
    }

    pub fn execute(&self) -> anyhow::Result<Report> {
        let (common, largest) = (&self.common, self.up_to);
        let scenario = common.load_relative()?;
        let outputs = [
            ("--plot-out", self.plot_out.as_deref()),
            ("--proof-out", self.proof.out()),
        ];
        check_outputs(&mut inputs(&scenario), &outputs)?;
        let stop = ask_search();
        let up_to = counted(largest.into(), "measurement");
        common.say(&format!("searching the best plans of up to {up_to}"));
        let bar = bar(common.quiet, "searching plans");
        let progress = |done: usize, all: usize| show(&bar, done, all);
        let (points, bound) = self.proof.with_effort(common, stop, |proof| {
            budget(
                &scenario.task,
                largest,
                scenario.seed,
                proof,
                stop,
                &progress,
            )
        })?;
        let is_cut_short = stop.load(Ordering::Relaxed);
        bar.finish_and_clear();
        super::interruption::searched();
        let Some(last) = points.last() else {
            let compliances = scenario.task.belief.parameters.len() as u64;
            anyhow::bail!(
                "no plan of up to {up_to} determines {}; give a larger --up-to",
                counted(compliances, "compliance")
            );
        };
        let mut conditions = Vec::new();
        if is_cut_short {
            let words = "the search was stopped: better plans may exist, and plans of more measurements were not searched";
            conditions.push(ConditionCode::SearchStopped.with(words));
        }
        let needed = self.needed(&scenario, &points);
        let mut text = describe(&points) + &common_to(&points) + &stops_helping(&points);
        let mut written = Written::default();
        let provenance = ProvenanceMessage::new(&scenario);
        text += &self.proof.tell(&bound, &provenance, &mut written)?;
        if let Some((point, minutes)) = &needed {
            text += &self.tell(point, *minutes);
            if minutes.is_none() {
                let words = "no way is found between its experiments";
                conditions.push(ConditionCode::NoWay.with(words));
            }
        } else {
            let searched = if is_cut_short {
                last.experiments
            } else {
                largest
            };
            conditions.push(ConditionCode::OutOfReach.with(format!(
                "no plan of up to {} reaches {} um",
                counted(searched.into(), "measurement"),
                self.accuracy_um
            )));
        }
        if let Some(path) = &self.plot_out {
            let title = format!("{}: accuracy against measurements", scenario.name);
            text += &written.save(path, &budget_plot(&title, &points)?);
        }
        conditions.extend(written.conditions());
        let json = json!({
            "accuracy_um": self.accuracy_um,
            "needed": needed.as_ref().map(|(point, _)| record(point)),
            "needed_minutes": needed.as_ref().and_then(|(_, minutes)| *minutes),
            "proof": proof_json(&bound),
            "budget": points.iter().map(record).collect::<Vec<_>>(),
        });
        let json = results("budget", &provenance, json);
        Ok(Report::new(json, text, conditions))
    }
}

fn record(point: &BudgetPoint) -> Value {
    json!({
        "experiments": point.experiments,
        "configurations": point.configurations,
        "rho0_mm": point.rho0_m * 1e3,
        "shared_rho0_mm": point.shared_m.map(|shared_m| shared_m * 1e3),
        "common_sources": (point.common_sources.clone()).map(CommonSourcesMessage::from),
        "lower_bound_rho0_mm": point.lower_bound_m().map(|bound_m| bound_m * 1e3),
        "bound_kind": point.bound.as_ref().map(|bound| bound.kind.name()),
        "proved_lower_bound_rho0_mm": point.bound.as_ref().and_then(|bound| Some(bound.proof.as_ref()?.best * 1e3)),
    })
}

/// The error sources in common with the campaign of the prior, with the accuracy of most measurements.
fn common_to(points: &[BudgetPoint]) -> String {
    let last = points.iter().rev().find_map(|point| {
        let common = point.common_sources.as_ref()?;
        let rho0 = format!(
            "{:.3} um for {}",
            common.rho0_m * 1e6,
            counted(point.experiments.into(), "measurement")
        );
        Some((&*common.names, rho0))
    });
    common_sources(last)
}

/// From where on most of what is left is what the whole plan shares.
fn stops_helping(points: &[BudgetPoint]) -> String {
    let mostly_shared = |point: &&BudgetPoint| {
        point.configurations == point.experiments
            && point
                .shared_m
                .is_some_and(|shared_m| shared_m.powi(2) > 0.5 * point.rho0_m.powi(2))
    };
    let shared = points.iter().rev().find_map(|point| point.shared_m);
    match (points.iter().find(mostly_shared), shared) {
        (Some(point), Some(shared_m)) => format!(
            "\nMore measurements hardly help: from {} on, most of the variance is of sources that the whole plan shares, which \
             contribute about {:.1} um however many there are.\n",
            point.experiments,
            shared_m * 1e6
        ),
        _ => String::new(),
    }
}

/// A row for each number of measurements: the accuracy by the number of configurations, with the
/// loss against all different ones.
fn describe(points: &[BudgetPoint]) -> String {
    let counts = repeated_configurations(points);
    let micro = |value_m: Option<f64>| number(value_m.map(|value_m| value_m * 1e6), 3);
    let is_shared = points.iter().any(|point| point.shared_m.is_some());
    let mut header = vec!["measurements".to_owned()];
    header.extend(counts.iter().map(|count| format!("in {count} [um]")));
    header.push("all different [um]".to_owned());
    header.extend(is_shared.then(|| "shared by the plan [um]".to_owned()));
    header.push("bound [um]".to_owned());
    let row = |all_different: &BudgetPoint| {
        let m = all_different.experiments;
        let repeated = |&count: &u32| {
            let is_it =
                |point: &&BudgetPoint| (point.experiments, point.configurations) == (m, count);
            points.iter().find(is_it).map_or_else(String::new, |point| {
                let loss = point.rho0_m / all_different.rho0_m - 1.0;
                format!("{:.3} ({:+.2} %)", point.rho0_m * 1e6, loss * 100.0)
            })
        };
        let mut row = vec![m.to_string()];
        row.extend(counts.iter().map(repeated));
        row.push(micro(Some(all_different.rho0_m)));
        row.extend(is_shared.then(|| micro(all_different.shared_m)));
        row.push(micro(all_different.lower_bound_m()));
        row
    };
    let all = points
        .iter()
        .filter(|point| point.configurations == point.experiments);
    table_of(&header, all.map(row))
}
