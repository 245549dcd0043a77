//! What one exchange can gain: a plan whose measurements but one stay, and any experiment of the class in place of that one.
//!
//! The rest of the plan is as good as mandatory: with M0 the information of all but one measurement, and of what is known
//! before, for any B
//!
//! ```text
//! rho_0^2 >= trace(C B^T)^2 / (trace(B M0 B^T) + max d(x))
//! ```
//!
//! for every experiment x in place of the one that is left out, and alike by the other criteria that have a bound. The best B
//! is that of the approximate design of one measurement beside M0. As that may mix several experiments, the best exchange can
//! be worse than the bound.
//!
//! Where some uncertainties cannot be in a proof, they are taken for certain in it. No plan that differs in one experiment leaves
//! less with all of them than without some: the bound holds for it, too, and the gain is told against the plan's own value with all.

use serde::Serialize;

use super::approximate::{ApproximateDesign, approximate_design};
use super::bound::{NoBound, PlanProof, one_load_each};
use super::point::add_information;
use super::problem::{Problem, SearchError};
use super::provable::ProvableTask;
use super::proved::{Fixed, ProofExperiment, ProofFile, ProvedBound};
use crate::experiment::{Experiment, Plan};
use crate::plan::Criterion;
use crate::plan::proof::{NoProof, ProofLimits};
use crate::task::Task;

/// A proof of what exchanging one measurement of a plan can gain, with all that it takes to check it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExchangesFile {
    /// The criterion's name.
    pub criterion: &'static str,
    /// The plan.
    pub plan: Vec<ProofExperiment>,
    /// How often each of its experiments is mandatory.
    pub mandatory: Vec<u32>,
    /// The plan's own value: a `rho_0` (m), or that of the criterion.
    pub value: f64,
    /// No exchange has a better value.
    pub best: f64,
    /// For each experiment that may be exchanged its place in the plan, and the bound beside all other measurements.
    pub proofs: Vec<(usize, ProofFile)>,
}

/// What one of a plan's measurements can be exchanged for.
#[derive(Debug, Clone, PartialEq)]
pub struct OneExchange {
    /// The place in the plan of the experiment that is measured once less.
    pub experiment: usize,
    /// The criterion's value of the best exchange that was come across: no proof, but how near it is.
    pub found: f64,
    /// No exchange has a better value, or why that is not proved.
    pub proof: Result<PlanProof, NoProof>,
    /// The proof for those who want to check it, where it was recorded.
    pub file: Option<ProofFile>,
}

/// What exchanging any one measurement of a plan can gain, by a criterion.
#[derive(Debug, Clone, PartialEq)]
pub struct Exchanges {
    /// The criterion.
    pub criterion: Criterion,
    /// The plan's own value, as [`CriterionFunction::value`](crate::plan::CriterionFunction::value) has it.
    pub value: f64,
    /// For each experiment that is not mandatory as often as it is measured.
    pub each: Vec<OneExchange>,
    /// The plan, and how often each of its experiments is mandatory.
    plan: (Vec<ProofExperiment>, Vec<u32>),
}

impl Exchanges {
    /// Proves for a plan what exchanging one measurement can gain: with an effort for each experiment, recorded if wanted.
    ///
    /// # Errors
    /// The criterion has no bound, the plan lacks a mandatory experiment, or does not determine what is asked for.
    pub fn prove(
        task: &Task,
        criterion: Criterion,
        seed: u64,
        plan: &Plan,
        (effort, records): (ProofLimits<'_>, bool),
    ) -> Result<Self, NoBound> {
        let free =
            (plan.beside_mandatory(&task.design.mandatory)).map_err(NoBound::NotMandatory)?;
        one_load_each(task, criterion, plan)?;
        let problem = Problem::new(task, criterion);
        problem.check_excited().map_err(NoBound::NotFound)?;
        let value = (problem.cost().value(&problem.information(plan)))
            .filter(|_| problem.is_determined_by(plan))
            .ok_or_else(|| {
                NoBound::NotFound(SearchError::Singular {
                    experiments: plan.measurements(),
                    parameters: problem.parameters(),
                })
            })?;
        let simpler = ProvableTask::simpler(&problem);
        let each = (free.iter().enumerate())
            .filter(|(_, repeats)| **repeats > 0)
            .map(|(experiment, _)| {
                one_exchange(
                    &problem,
                    &simpler,
                    seed,
                    (plan, experiment),
                    (effort, records),
                )
            })
            .collect::<Result<_, SearchError>>();
        Ok(Self {
            criterion,
            value,
            each: each.map_err(NoBound::NotFound)?,
            plan: (
                plan.experiments.iter().map(ProofExperiment::from).collect(),
                (plan.experiments.iter().zip(&free))
                    .map(|(experiment, free)| experiment.repeats - free)
                    .collect(),
            ),
        })
    }

    /// The proof for those who want to check it, where all of it was recorded.
    #[must_use]
    pub fn file(&self) -> Option<ExchangesFile> {
        let (plan, mandatory) = self.plan.clone();
        let proofs = self.each.iter();
        let proofs = proofs.map(|each| Some((each.experiment, each.file.clone()?)));
        Some(ExchangesFile {
            criterion: self.criterion.name(),
            plan,
            mandatory,
            value: self.value,
            best: self.best()?,
            proofs: proofs.collect::<Option<_>>()?,
        })
    }

    /// No exchange of one measurement has a better value; `None` where that is not proved for every experiment, or
    /// none may be exchanged.
    #[must_use]
    pub fn best(&self) -> Option<f64> {
        let proved: Option<Vec<f64>> = (self.each.iter())
            .map(|each| each.proof.as_ref().ok().map(|proof| proof.best))
            .collect();
        let values = proved?.into_iter();
        if self.criterion.is_maximised() {
            values.reduce(f64::max)
        } else {
            values.reduce(f64::min)
        }
    }

    /// By what share of its value an exchange can make the plan better, at most; as for [`Self::best`].
    #[must_use]
    pub fn largest_gain(&self) -> Option<f64> {
        let best = self.best()?;
        let gain = if self.criterion.is_maximised() {
            best / self.value - 1.0
        } else {
            1.0 - best / self.value
        };
        // The plan itself may be outside of the class.
        Some(gain.max(0.0))
    }

    /// The names of the uncertainties that any of the proofs takes for certain, which can only make what is proved less near.
    #[must_use]
    pub fn left_out(&self) -> Vec<String> {
        let proofs = self.each.iter().filter_map(|each| each.proof.as_ref().ok());
        let mut names: Vec<String> = Vec::new();
        for name in proofs.flat_map(|proof| &proof.left_out) {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }

    /// The number of boxes that the proofs took.
    #[must_use]
    pub fn boxes(&self) -> u64 {
        let proofs = self.each.iter().filter_map(|each| each.proof.as_ref().ok());
        proofs.map(|proof| proof.boxes).sum()
    }
}

fn one_exchange(
    problem: &Problem<'_>,
    simpler: &[ProvableTask],
    seed: u64,
    (plan, experiment): (&Plan, usize),
    (effort, records): (ProofLimits<'_>, bool),
) -> Result<OneExchange, SearchError> {
    let measurements = plan.measurements();
    let rest = without(plan, experiment);
    let beside = problem.beside_plan(&rest);
    let design = approximate_design(&beside, seed)?;
    let fixed = Fixed::AsTheyAre(&rest);
    let mut proof = if ProvableTask::is_itself(problem) {
        ProvedBound::beside(&beside, &design, fixed, effort, records)
    } else {
        Err(ProvableTask::refusal(problem))
    };
    for simpler in simpler {
        let problem = Problem::new(&simpler.task, problem.criterion).beside_plan(&rest);
        let known = (proof.as_ref().ok(), measurements);
        let limits = (effort, records);
        if let Some(nearer) = ProvedBound::of_simpler(&problem, simpler, fixed, limits, seed, known)
        {
            proof = nearer;
        }
    }
    let file = (proof.as_ref().ok()).and_then(|proof| proof.file_of([measurements]));
    Ok(OneExchange {
        file,
        experiment,
        found: best_found(&beside, &design, &plan.experiments[experiment]),
        proof: proof.and_then(|proof| {
            Ok(PlanProof {
                best: proof.of_size(measurements).ok_or(NoProof::Singular)?,
                gap: proof.gap(),
                boxes: proof.boxes(),
                left_out: proof.left_out().to_vec(),
            })
        }),
    })
}

/// The plan with one measurement less.
fn without(plan: &Plan, experiment: usize) -> Plan {
    let mut rest = plan.clone();
    if rest.experiments[experiment].repeats > 1 {
        rest.experiments[experiment].repeats -= 1;
    } else {
        rest.experiments.remove(experiment);
    }
    rest
}

/// The best value with one of the design's experiments, or with that which was there.
fn best_found(beside: &Problem<'_>, design: &ApproximateDesign, present: &Experiment) -> f64 {
    let mut cost = beside.cost();
    let rest = (beside.beside.clone()).unwrap_or_else(|| beside.prior().clone());
    let mut evaluator = beside.evaluator();
    let mut matrix = evaluator.matrix();
    evaluator.move_to(present.configuration_rad.as_slice());
    evaluator.observe(&present.load, &mut matrix);
    let matrices = design.candidates.iter().map(|point| &point.matrix);
    let values = matrices.chain([&matrix]).filter_map(|matrix| {
        let mut information = rest.clone();
        add_information(&mut information, matrix, 1.0);
        cost.value(&information)
    });
    let maximised = beside.criterion.is_maximised();
    let better = |one: f64, other: f64| {
        if maximised {
            one.max(other)
        } else {
            one.min(other)
        }
    };
    values.reduce(better).unwrap_or(f64::NAN)
}
