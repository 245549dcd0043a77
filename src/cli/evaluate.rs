//! `evaluate`: the predicted accuracy of a plan.

use crate::experiment::Candidate;
use crate::plan::absolute::AbsolutePlanning;
use crate::plan::search::Bound;
use crate::plan::{Assessment, Criterion, read_plan};
use crate::robot::{Approach, Load};

use super::command_prelude::*;
use super::interruption::{STOP, proceed};
use super::plan_args::{PlanArgs, of_any_plan};
use super::planned::PlannedAccuracy;

#[derive(Debug, Args)]
#[command(mut_arg("candidates", of_any_plan), mut_args(without_effect(&["out", "draw"])))]
// The plan is there: nothing is sampled.
#[command(mut_arg("draw", |draw| draw.conflicts_with("plan")))]
pub struct Evaluate {
    #[command(flatten)]
    pub args: PlanArgs,
    /// The criterion of the bound that no plan can beat; of test-pose it is proved
    #[arg(long, value_enum, default_value_t)]
    criterion: Criterion,
    /// Sample so many virtual robots, measure each by the plan, identify it, and compare residual errors with the predicted
    /// accuracy
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..=1_000_000))]
    trials: Option<u64>,
    /// Also the static compliance of the tool at the test poses (mm/N), with 95 % intervals after the plan.
    #[arg(long)]
    static_compliance: bool,
    /// The plan to assess.
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
}

impl Evaluate {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let args = &self.args;
        let scenario = args.load()?;
        args.common.refuse_others("evaluate", &scenario)?;
        let (planned, besides) = match scenario.task.design.accuracy {
            AccuracyKind::Absolute => self.readings(&scenario)?,
            AccuracyKind::Relative => self.deflections(&scenario)?,
        };
        let mut report = args.report("evaluate", &scenario, &planned, besides)?;
        if self.static_compliance {
            planned.add_static_compliance(&mut report, &scenario.task)?;
        }
        let trials = (self.trials)
            .map(|robots| args.add_trials(&mut report, &scenario, &planned, robots))
            .transpose()?;
        if let Some(trials) = &trials {
            report.json["trials"] = trials.json();
        }
        let tried = (&planned, trials.as_ref());
        args.finish(&scenario, tried, Some(&self.plan), report)
    }

    /// A plan of deflections, and how near it is to the best that there can be.
    fn deflections(
        &self,
        scenario: &Scenario,
    ) -> anyhow::Result<(PlannedAccuracy<'static>, Report)> {
        let (args, task, seed) = (&self.args, &scenario.task, scenario.seed);
        let plan = read_plan(&self.plan, task.belief.commands())?;
        let candidates = args.read_candidates(task)?;
        args.common.say("searching the bound that no plan can beat");
        // Without a bound, the rest still holds.
        let bound = match &candidates {
            Some(candidates) => candidates.bound(task, self.criterion, &plan),
            None => args.proof.with_effort(&args.common, &STOP, |proof| {
                Bound::search_for(&plan, task, self.criterion, seed, proof)
            }),
        };
        proceed()?;
        let assessment = if self.criterion == Criterion::TestPose {
            Assessment::new(task, &plan, Some(&bound))
        } else {
            let rho0 = match &candidates {
                Some(candidates) => candidates.bound(task, Criterion::TestPose, &plan),
                None => Bound::search_for(&plan, task, Criterion::TestPose, seed, None),
            };
            Assessment::new(task, &plan, Some(&rho0)).beside(&bound, &plan)
        };
        let mut besides = Report::default();
        if let Some(candidates) = &candidates {
            besides.text = args.told(&candidates.offer);
            besides.json = json!({ "candidates": candidates.offer });
        } else {
            let provenance = args.common.provenance(scenario)?;
            args.proof.tell(&bound, &provenance, &mut besides)?;
        }
        let planned = PlannedAccuracy::of_deflections(scenario, plan, &assessment);
        Ok((planned, besides))
    }

    /// A plan of absolute readings, and how near it is to the best of the candidates, where there are some.
    fn readings<'a>(
        &'a self,
        scenario: &'a Scenario,
    ) -> anyhow::Result<(PlannedAccuracy<'a>, Report)> {
        let (args, task, file) = (&self.args, &scenario.task, &self.plan);
        let planning = AbsolutePlanning::of_file(task, &args.readings.parameters, file)?;
        let mut bound = None;
        if let (Some(path), Some(candidates)) = (
            &args.readings.candidates,
            args.readings.candidates(scenario)?,
        ) {
            let among = AbsolutePlanning::new(task, &args.readings.parameters, &candidates);
            let among = among.map_err(|error| error.in_file(path))?;
            let chosen = places_among(&among, &planning.candidates)
                .map_err(|problem| FileError::new(file, problem).code(ErrorCode::CandidateFile))?;
            bound = (among.bound(&chosen)).map_err(|error| error.in_file(path))?;
        }
        let plan = planning.whole();
        let beside = (bound.as_ref(), None);
        let planned =
            PlannedAccuracy::of_readings(task, &args.readings.parameters, planning, plan, beside);
        let besides = Report::new(json!({ "trials": null }), String::new(), Vec::new());
        Ok((planned, besides))
    }
}

/// The readings of a plan as candidates by their places, and how often each is read; or why it is no plan of them.
fn places_among(
    among: &AbsolutePlanning<'_>,
    rows: &[Candidate],
) -> Result<Vec<(usize, u32)>, String> {
    let mut plan: Vec<(usize, u32)> = Vec::new();
    for row in rows {
        let line = row.line;
        let Some(place) = among.candidates.iter().position(|each| is_same(each, row)) else {
            return Err(format!(
                "line {line}: this reading is none of the candidates"
            ));
        };
        let times = row.most.unwrap_or(1);
        match plan.iter_mut().find(|known| known.0 == place) {
            Some(known) => known.1 += times,
            None => plan.push((place, times)),
        }
    }
    for &(place, times) in &plan {
        let candidate = &among.candidates[place];
        if let Some(most) = candidate.most.filter(|most| *most < times) {
            let line = candidate.line;
            return Err(format!(
                "the candidate of line {line} is read {times} times, and may be {most} times"
            ));
        }
    }
    Ok(plan)
}

/// Whether a row of a plan is a candidate; a thousandth of an arc second is nothing.
fn is_same(candidate: &Candidate, row: &Candidate) -> bool {
    const SAME_RAD: f64 = 5e-9;
    let apart = &candidate.configuration_rad - &row.configuration_rad;
    let wrench = |row: &Candidate| row.load.unwrap_or(Load::NONE).wrench();
    apart.amax() <= SAME_RAD
        && wrench(candidate) == wrench(row)
        && (&candidate.target, &candidate.station) == (&row.target, &row.station)
        && Approach::is_same(candidate.approach.as_ref(), row.approach.as_ref())
}
