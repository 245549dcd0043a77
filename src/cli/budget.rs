//! `budget`: how many experiments, and in how many configurations?

use std::sync::atomic::Ordering;

use crate::laboratory::Campaign;
use crate::laboratory::time::{least_minutes, quickest};
use crate::plan::search::{
    BudgetPoint, CandidateError, PlanSize, budget, cheapest, repeated_configurations,
};
use crate::quantities::plausible::ACCURACY;
use crate::record::messages::{ProvenanceMessage, merge};
use crate::view::plots::BudgetPlot;

use super::command_prelude::*;
use super::interruption::STOP;
use super::plan_args::{ReadingsArgs, offered};
use super::progress::search;
use super::proof::{ProofArgs, proof_json};

/// What a plan shares is as good as constant where it falls by less than this factor.
const FLAT: f64 = 1.1;

#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["out"])))]
pub struct Budget {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    proof: ProofArgs,
    #[command(flatten)]
    readings: ReadingsArgs,
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

/// What was searched.
struct Searched {
    points: Vec<BudgetPoint>,
    /// The cheapest way to the accuracy that is wanted, with the minutes that it takes; these are none where no way between its
    /// experiments is found.
    needed: Option<(BudgetPoint, Option<f64>)>,
    /// The minutes that each of the points takes, where they are drawn by these.
    minutes: Option<Vec<Option<f64>>>,
    /// What is said of the bound and of candidates.
    report: Report,
}

impl Budget {
    /// What was searched, with the cheapest way to the accuracy that is wanted, of these or `others`, by the minutes that plans take at least
    /// and, where a way is found, in all.
    fn searched(
        &self,
        (points, others): (Vec<BudgetPoint>, Vec<BudgetPoint>),
        report: Report,
        at_least: impl Fn(&BudgetPoint) -> f64,
        minutes: impl Fn(&BudgetPoint) -> Option<f64>,
    ) -> Searched {
        let accuracy_m = self.accuracy_um * 1e-6;
        let all = points.iter().chain(&others);
        let enough = all.filter(|point| point.rho0_m <= accuracy_m);
        let enough = enough.map(|point| (at_least(point), point));
        let quickest = (self.by_minutes)
            .then(|| quickest(enough, |point| minutes(point)))
            .flatten()
            .map(|(minutes, point)| (point.clone(), Some(minutes)));
        let needed = quickest.or_else(|| {
            let point = cheapest(&points, accuracy_m)?;
            let minutes = minutes(&point);
            Some((point, minutes))
        });
        let is_drawn = self.by_minutes && self.plot_out.is_some();
        Searched {
            needed,
            minutes: is_drawn.then(|| points.iter().map(minutes).collect()),
            report,
            points,
        }
    }

    /// The cheapest way for a person.
    fn tell(&self, point: &BudgetPoint, minutes: Option<f64>, accuracy: AccuracyKind) -> String {
        let time = minutes.filter(|_| self.by_minutes);
        let time = time.map_or_else(String::new, |minutes| format!(": {minutes:.0} minutes"));
        let needed = match accuracy {
            AccuracyKind::Absolute => counted(point.experiments.into(), accuracy.noun()),
            AccuracyKind::Relative => format!(
                "{} in {}",
                counted(point.experiments.into(), "measurement"),
                counted(point.configurations.into(), "configuration")
            ),
        };
        let accuracy_um = self.accuracy_um;
        format!("\nFor rho0 = {accuracy_um} um you need {needed}{time}.\n")
    }

    /// Of deflections.
    fn deflections(&self, scenario: &Scenario) -> anyhow::Result<Searched> {
        let (common, task, laboratory) = (&self.common, &scenario.task, &scenario.laboratory);
        let up_to = counted(self.up_to.into(), "measurement");
        let says = format!("searching the best plans of up to {up_to}");
        let (points, bound) = search(common, &says, |watch| {
            let progress = |done, all| (watch.progress)(done, all, 0.0);
            self.proof.with_effort(common, watch.stop, |proof| {
                budget(
                    task,
                    self.up_to,
                    scenario.seed,
                    proof,
                    watch.stop,
                    &progress,
                )
            })
        })?;
        if points.is_empty() {
            let compliances = task.belief.parameters.len() as u64;
            anyhow::bail!(
                "no plan of up to {up_to} determines {}; give a larger --up-to",
                counted(compliances, "compliance")
            );
        }
        let minutes = |point: &BudgetPoint| {
            let campaign = Campaign::new(task, laboratory, &point.plan, false);
            campaign.ok().map(|campaign| campaign.minutes)
        };
        let at_least =
            |point: &BudgetPoint| least_minutes(task, laboratory, PlanSize::of(&point.plan));
        let by_tracker = task.by_tracker_alone().filter(|_| self.by_minutes);
        let by_tracker = by_tracker.and_then(|task| {
            let says = format!("searching those of the tracker alone of up to {up_to}");
            let found = search(common, &says, |watch| {
                let progress = |done, all| (watch.progress)(done, all, 0.0);
                let (up_to, seed) = (self.up_to, scenario.seed);
                budget(&task, up_to, seed, None, watch.stop, &progress)
            });
            // It may not determine by itself what is asked for.
            found.ok()
        });
        let by_tracker = by_tracker.map_or_else(Vec::new, |(points, _)| points);
        let mut report = Report::default();
        (self.proof).tell(&bound, &ProvenanceMessage::new(scenario), &mut report)?;
        report.json = json!({ "proof": proof_json(&bound) });
        Ok(self.searched((points, by_tracker), report, at_least, minutes))
    }

    /// Of absolute readings.
    fn readings(&self, scenario: &Scenario) -> anyhow::Result<Searched> {
        let (common, task, laboratory) = (&self.common, &scenario.task, &scenario.laboratory);
        let (candidates, seed) = (self.readings.candidates(scenario)?, scenario.seed);
        let wanted = self.readings.wanted(scenario, candidates.as_deref());
        let wrong = |error: CandidateError| error.in_file(wanted.path);
        let plannings = wanted.plannings(task, seed).map_err(wrong)?;
        let says = format!(
            "searching the best plans of up to {} among {}",
            counted(self.up_to.into(), "absolute reading"),
            counted(plannings[0].candidates.len() as u64, "candidate")
        );
        let found = search(common, &says, |watch| {
            wanted.of_sizes(plannings, (1..=self.up_to, None), None, seed, watch)
        });
        let (planning, found) = found.map_err(wrong)?;
        let found = planning.budget(found);
        let minutes = |point: &BudgetPoint| {
            let is_it = |(each, _): &&(BudgetPoint, _)| each.experiments == point.experiments;
            let (_, plan) = found.iter().find(is_it)?;
            let campaign = Campaign::of_readings(task, laboratory, (&planning, plan), false);
            campaign.ok().map(|campaign| campaign.minutes)
        };
        // From one station, in one stop.
        let at_least = |point: &BudgetPoint| {
            laboratory
                .costs
                .work_min([1.0, 1.0, 0.0], f64::from(point.experiments))
        };
        let points: Vec<BudgetPoint> = found.iter().map(|(point, _)| point.clone()).collect();
        let (offer, drawn) = (&planning.offer, wanted.drawn(seed));
        let report = Report::new(
            json!({ "proof": null, "candidates": offer, "drawn": drawn }),
            offered(drawn, self.readings.candidates.as_deref(), offer),
            Vec::new(),
        );
        Ok(self.searched((points, Vec::new()), report, at_least, minutes))
    }

    pub fn execute(&self) -> anyhow::Result<Report> {
        let scenario = self.common.open("budget")?;
        self.common.check_files(&scenario, None)?;
        let accuracy = scenario.task.design.accuracy;
        let mut found = match accuracy {
            AccuracyKind::Relative => self.deflections(&scenario)?,
            AccuracyKind::Absolute => self.readings(&scenario)?,
        };
        let is_cut_short = STOP.load(Ordering::Relaxed);
        let mut report = std::mem::take(&mut found.report);
        let points = &found.points;
        let helping = match accuracy {
            AccuracyKind::Relative => stops_helping(points),
            AccuracyKind::Absolute => "\n".to_owned(),
        };
        report.text.insert_str(0, &(describe(points) + &helping));
        report.conditions = self.conditions(&found, is_cut_short);
        if let Some((point, minutes)) = &found.needed {
            report.text += &self.tell(point, *minutes, accuracy);
        }
        if let Some(path) = &self.plot_out {
            let plot = BudgetPlot {
                points,
                minutes: found.minutes.as_deref(),
                wanted_m: self.accuracy_um * 1e-6,
                needed: found.needed.as_ref().map(|(point, _)| point),
            };
            let against = ["measurements", "time"][usize::from(self.by_minutes)];
            let plot = plot.drawn(&format!("{}: accuracy against {against}", scenario.name))?;
            report.save(path, &plot);
        }
        let needed = found.needed.as_ref();
        let keys = json!({
            "accuracy_um": self.accuracy_um,
            "needed": needed.map(|(point, _)| record(point)),
            "needed_minutes": needed.and_then(|(_, minutes)| *minutes),
            "budget": points.iter().map(record).collect::<Vec<_>>(),
        });
        merge(&mut report.json, keys);
        Ok((self.common).report("budget", &scenario, report)?)
    }

    fn conditions(&self, found: &Searched, is_cut_short: bool) -> Vec<Condition> {
        let mut conditions = Vec::new();
        if is_cut_short {
            let words = "the search was stopped: better plans may exist, and plans of more measurements were not searched";
            conditions.push(ConditionCode::SearchStopped.with(words));
        }
        match &found.needed {
            Some((_, Some(_))) => {}
            Some((_, None)) => {
                let words = "no way is found between its experiments";
                conditions.push(ConditionCode::NoWay.with(words));
            }
            None => {
                let last = found.points.last().map(|last| last.experiments);
                let most = last.filter(|_| is_cut_short).unwrap_or(self.up_to);
                conditions.push(ConditionCode::OutOfReach.with(format!(
                    "no plan of up to {} reaches {} um",
                    counted(most.into(), "measurement"),
                    self.accuracy_um
                )));
            }
        }
        conditions
    }
}

fn record(point: &BudgetPoint) -> Value {
    json!({
        "experiments": point.experiments,
        "configurations": point.configurations,
        "rho0_mm": point.rho0_m * 1e3,
        "shared_rho0_mm": point.shared_m.map(|shared_m| shared_m * 1e3),
        "lower_bound_rho0_mm": point.lower_bound_m().map(|bound_m| bound_m * 1e3),
        "bound_kind": point.bound.as_ref().map(|bound| bound.kind.name()),
        "proved_lower_bound_rho0_mm": point.bound.as_ref().and_then(|bound| Some(bound.proof.as_ref()?.best * 1e3)),
    })
}

/// From where on most of what is left is what the whole plan shares, where more measurements hardly make that smaller.
fn stops_helping(points: &[BudgetPoint]) -> String {
    let mostly_shared = |point: &&BudgetPoint| {
        (point.shared_m).is_some_and(|shared_m| shared_m.powi(2) > 0.5 * point.rho0_m.powi(2))
    };
    let all_different =
        || (points.iter().rev()).filter(|point| point.configurations == point.experiments);
    let shared = all_different().find_map(|point| point.shared_m);
    let hardly_falls = |point: &&BudgetPoint| {
        point
            .shared_m
            .zip(shared)
            .is_some_and(|(own, last)| own < FLAT * last)
    };
    // From the first on after which all are so.
    let from = (all_different().take_while(mostly_shared))
        .take_while(hardly_falls)
        .last()
        .filter(|point| {
            all_different()
                .next()
                .is_some_and(|last| last.experiments > point.experiments)
        });
    match (from, shared) {
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
    let micro = |value_m: Option<f64>| in_um(value_m, 3);
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
                format!("{} ({:+.2} %)", micro(Some(point.rho0_m)), loss * 100.0)
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
    aligned(&header, all.map(row))
}
