//! What to measure next, after some of a plan is measured.

use std::ops::RangeInclusive;

use nalgebra::{DMatrix, DVector};

use crate::experiment::{Experiment, PRINTED_RAD, Plan, is_one_direction, is_printed_as};
use crate::identification::{Case, Identification};
use crate::measurement::{Measurement, by_experiment};
use crate::plan::search::{Bound, PlanSearch, PlanSize, Problem, SearchError, Watch};
use crate::plan::{Criterion, Feasibility, posterior, rho0_m};
use crate::task::{Belief, Forbidden, Method, Task};

/// Another measurement again is worth an exchange where the prediction becomes less than this share of what it is.
const BETTER: f64 = 1.0 - 1e-6;

/// The plan that measurements have carried out: experiments in the order of their first measurement.
pub fn measured_plan(measurements: &[Measurement]) -> Plan {
    let experiments = by_experiment(measurements).into_iter().map(|members| {
        let first = &measurements[members[0]];
        Experiment {
            configuration_rad: first.configuration_rad.clone(),
            load: first.load,
            repeats: u32::try_from(members.len()).unwrap_or(u32::MAX),
            approach: first.approach.clone(),
            direction: first.direction,
        }
    });
    Plan {
        experiments: experiments.collect(),
    }
}

/// What of a plan is not measured yet: experiments with angles within [`PRINTED_RAD`] and the same load are the same.
pub fn not_measured(plan: &Plan, measured: &Plan) -> Plan {
    let mut measured = measured.clone();
    let mut rest = Plan::default();
    for each in &plan.experiments {
        let mut left = each.clone();
        for known in &mut measured.experiments {
            let apart = (&known.configuration_rad - &each.configuration_rad).amax();
            let is_same_side = known.approach.is_none()
                || each.approach.is_none()
                || known.approach == each.approach;
            let is_along = is_one_direction(known.direction.as_ref(), each.direction.as_ref());
            let is_alike = is_same_side && is_along && is_printed_as(&known.load, &each.load);
            if apart <= PRINTED_RAD && is_alike {
                let taken = left.repeats.min(known.repeats);
                left.repeats -= taken;
                known.repeats -= taken;
            }
        }
        if left.repeats > 0 {
            rest.experiments.push(left);
        }
    }
    rest
}

/// What is left of a campaign.
#[derive(Debug, Clone)]
pub struct Remaining {
    /// The task: the robot as it was identified, with what the measurements tell as known before.
    pub task: Task,
    /// The number of measurements that are made.
    pub measured: u32,
    /// What they carried out.
    pub carried_out: Plan,
    /// The robot without what the measurements tell, where deflections of one configuration share errors: more readings there are then
    /// worth less.
    pub untold: Option<Belief>,
    /// What is left of the plan that was followed, if it is known.
    pub planned: Option<Plan>,
}

impl Remaining {
    /// What is left after some measurements, of which each tells as much as its own standard deviations say. Mandatory
    /// experiments of the task that are not measured stay mandatory. What has turned out impossible is left out, as far
    /// around it as given (rad). Of as many configurations as the task allows those that are measured are taken; one more
    /// is always allowed.
    pub fn new(
        task: &Task,
        identification: &Identification,
        measurements: &[Measurement],
        impossible: &[DVector<f64>],
        within_rad: f64,
    ) -> Self {
        let (belief, compliance) = (&task.belief, &identification.compliance_rad_per_nm);
        let nothing = DMatrix::zeros(belief.unknowns(), belief.unknowns());
        let identified = belief.informed(compliance, &nothing);
        let case = Case {
            method: Method::Linear,
            ..Case::as_believed(&identified, measurements)
        };
        let mut left = task.clone();
        left.belief = belief.informed(compliance, &case.information());
        let carried_out = measured_plan(measurements);
        let visited = u32::try_from(carried_out.experiments.len()).unwrap_or(u32::MAX);
        left.design.mandatory = not_measured(&task.design.mandatory, &carried_out);
        let has_own_sigma = measurements.iter().any(|each| each.sigma_m.is_some());
        let is_shared = identified.uncertain.is_shared_by_repeats();
        let untold = (is_shared && !has_own_sigma).then(|| identified.clone());
        let impossible: Vec<Forbidden> = (impossible.iter())
            .map(|configuration_rad| Forbidden {
                configuration_rad: configuration_rad.clone(),
                within_rad,
            })
            .collect();
        let chain = &left.belief.nominal.chain;
        left.design.mandatory.experiments.retain(|each| {
            let q = each.configuration_rad.as_slice();
            !impossible
                .iter()
                .any(|other| other.too_near(chain, q).is_some())
        });
        let still = u32::try_from(left.design.mandatory.experiments.len()).unwrap_or(u32::MAX);
        left.design.configurations = (task.design.configurations)
            .map(|most| most.saturating_sub(visited).max(still.saturating_add(1)));
        left.region.forbidden.extend(impossible);
        Self {
            task: left,
            measured: u32::try_from(measurements.len()).unwrap_or(u32::MAX),
            carried_out,
            untold,
            planned: None,
        }
    }

    /// The accuracy that more measurements predict together with those that are made (m).
    pub fn rho0_m(&self, more: &Plan) -> Option<f64> {
        let Some(belief) = &self.untold else {
            return rho0_m(&self.task, &posterior(&self.task.belief, more));
        };
        let mut all = self.carried_out.clone();
        all.experiments.extend_from_slice(&more.experiments);
        all.put_repeats_together();
        rho0_m(&self.task, &posterior(belief, &all))
    }
}

impl Remaining {
    /// Whether a rest keeps to the task, with the configurations that are measured.
    fn allows(&self, rest: &Plan) -> bool {
        let is_measured = |each: &&Experiment| {
            (self.carried_out.experiments.iter()).any(|known| {
                (&known.configuration_rad - &each.configuration_rad).amax() <= PRINTED_RAD
            })
        };
        let new: Vec<&Experiment> = rest
            .experiments
            .iter()
            .filter(|each| !is_measured(each))
            .collect();
        let configurations = (new.iter().enumerate()).filter(|(place, each)| {
            !new[..*place]
                .iter()
                .any(|known| known.configuration_rad == each.configuration_rad)
        });
        let most = self
            .task
            .design
            .configurations
            .map_or(usize::MAX, |most| most as usize);
        let has_mandatory = not_measured(&self.task.design.mandatory, rest)
            .experiments
            .is_empty();
        let violations = Feasibility::new(&self.task).violations(rest);
        let are_possible = violations.iter().all(|each| each.experiment.is_none());
        configurations.count() <= most && has_mandatory && are_possible
    }

    /// A rest with its prediction (m), with one measurement again of what is measured or in it: as far as that is allowed, the best.
    fn once_more(&self, rest: &Plan) -> Option<(f64, Plan)> {
        let all = self.carried_out.experiments.iter().chain(&rest.experiments);
        let others = all.map(|again| {
            let mut other = rest.clone();
            let again = again.clone();
            other.experiments.push(Experiment {
                repeats: 1,
                ..again
            });
            other.put_repeats_together();
            other
        });
        self.best_of(others, f64::INFINITY)
    }

    /// The best of some rests, with its prediction (m), among those that are allowed and better than given.
    fn best_of(&self, rests: impl Iterator<Item = Plan>, least_m: f64) -> Option<(f64, Plan)> {
        let predicted = rests.filter_map(|rest| Some((self.rho0_m(&rest)?, rest)));
        let mut better: Vec<_> = predicted.filter(|each| each.0 < least_m).collect();
        better.sort_by(|one, other| one.0.total_cmp(&other.0));
        better.into_iter().find(|(_, rest)| self.allows(rest))
    }

    /// A rest with its prediction (m), in which single measurements are others of it, or of what is measured, as long as that is better: it
    /// takes no configuration more.
    fn exchanged(&self, (mut rho0_m, mut rest): (f64, Plan)) -> (f64, Plan) {
        for _ in 0..rest.measurements() {
            let without = (0..rest.experiments.len()).map(|place| {
                let mut without = rest.clone();
                match &mut without.experiments[place].repeats {
                    1 => drop(without.experiments.remove(place)),
                    more => *more -= 1,
                }
                without
            });
            let each = without.filter_map(|rest| self.once_more(&rest));
            let best = each.min_by(|one, other| one.0.total_cmp(&other.0));
            match best.filter(|best| best.0 < rho0_m * BETTER) {
                Some(best) => (rho0_m, rest) = best,
                None => break,
            }
        }
        (rho0_m, rest)
    }

    /// The best of few configurations, with its prediction (m): exchanged from a rest that is found, and from one that has each configuration
    /// once and grows by the best measurement again.
    fn of_few(&self, found: (f64, Plan), once: Option<Plan>, count: u32) -> (f64, Plan) {
        let mut grown = once;
        while let Some(rest) = grown.as_ref().filter(|rest| rest.measurements() < count) {
            grown = self.once_more(rest).map(|(_, rest)| rest);
        }
        let grown = grown.and_then(|rest| Some((self.rho0_m(&rest)?, rest)));
        let best = self.exchanged(found);
        match grown.map(|grown| self.exchanged(grown)) {
            Some(grown) if grown.0 < best.0 => grown,
            _ => best,
        }
    }
}

/// The rest of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// What is to be measured.
    pub plan: Plan,
    /// The accuracy that it predicts together with what is measured (m).
    pub rho0_m: f64,
    /// No rest of as many measurements predicts a smaller one (m), as far as is known.
    pub bound_m: Option<f64>,
}

/// Plans the rest of a campaign: of so many measurements, the first number that gives an accuracy (m), or else the last.
pub fn rest(
    left: &Remaining,
    counts: RangeInclusive<u32>,
    wanted_m: Option<f64>,
    seed: u64,
    watch: Watch<'_>,
) -> Result<Rest, SearchError> {
    let mut result = None;
    for count in counts {
        match planned(left, count, seed, watch) {
            Ok(rest) => {
                let is_reached = wanted_m.is_none_or(|wanted_m| rest.rho0_m <= wanted_m);
                result = Some(Ok(rest));
                if is_reached {
                    break;
                }
            }
            // More measurements may do.
            Err(error @ SearchError::Singular { .. }) => result = result.or(Some(Err(error))),
            Err(error) => return Err(error),
        }
        if watch.stop.load(std::sync::atomic::Ordering::Relaxed) {
            break;
        }
    }
    result.unwrap_or(Err(SearchError::Singular {
        experiments: left.measured,
        parameters: left.task.belief.parameters.len(),
    }))
}

fn planned(left: &Remaining, count: u32, seed: u64, watch: Watch<'_>) -> Result<Rest, SearchError> {
    let mut task = left.task.clone();
    task.design.experiments = count;
    let problem = Problem::new(&task, Criterion::TestPose);
    let mut search = PlanSearch::new(problem, seed)?;
    let bound = Bound::new(&task, &search.approximate);
    let design = search.best(PlanSize::wanted_by(&task), watch, &[])?;
    // The search leaves out what is uncertain and makes next to nothing; a prediction never does.
    let prediction = left.rho0_m(&design.plan);
    let mut best = (prediction.unwrap_or(design.cost.sqrt()), design.plan);
    let old = (left.planned.clone()).filter(|old| old.measurements() == count);
    let old = old.filter(|old| left.allows(old));
    if let Some((old, rho0_m)) = old.and_then(|old| Some((left.rho0_m(&old)?, old)))
        && old < best.0
    {
        best = (old, rho0_m);
    }
    if let Some(most) = task.design.configurations.filter(|most| *most < count) {
        task.design.experiments = most.max(task.design.mandatory.measurements());
        let once = PlanSearch::new(Problem::new(&task, Criterion::TestPose), seed)
            .and_then(|mut search| search.best(PlanSize::wanted_by(&task), watch, &[]));
        best = left.of_few(best, once.ok().map(|design| design.plan), count);
    }
    let (rho0_m, plan) = best;
    Ok(Rest {
        rho0_m,
        bound_m: bound.of_size(count).ok().map(|bound| bound.best),
        plan,
    })
}
