//! Bounds that no plan of a class can beat.

use std::collections::BTreeMap;

use thiserror::Error;

use super::approximate::{ApproximateDesign, Certificate, approximate_design};
use super::error::SearchError;
use super::finite::FiniteBound;
use super::problem::Problem;
use super::provable::ProvableTask;
use super::proved::ProvedBound;
use crate::experiment::{Experiment, NotMandatory, Plan, is_one_direction};
use crate::plan::proof::{NoProof, ProofLimits};
use crate::plan::{Criterion, Feasibility, widened};
use crate::robot::Approach;
use crate::task::Task;

/// Angles of a plan that are so near to a candidate's (rad) are that: they were written and read.
const SAME_RAD: f64 = 1e-9;
/// The same for loads, as a share.
const SAME_SHARE: f64 = 1e-9;

/// A proof, or why there is none, where one was asked for.
type MaybeProof = Option<Result<ProvedBound, NoProof>>;

/// What no plan of a class is better than by a criterion, by the number m of measurements.
///
/// The class is that of plans
/// - under loads of the task, or such as are printed alike ([`crate::experiment::Loads`]);
/// - with all mandatory experiments of the task, each at least as often as there (angles within
///   [`PRINTED_RAD`](crate::experiment::PRINTED_RAD), loads printed alike);
/// - that hang one load in each configuration, where deflections of one share errors: two loads there may tell more than they
///   would apart;
/// - whose other experiments keep the smooth bounds of the region (joint ranges, the tool's height,
///   radius and elevation, torques), widened as [`widened`] says, and leave the robot a static equilibrium.
///
/// Collisions, sight and forbidden configurations exclude no plan. Outside of the class there is no
/// bound, and the reason is told.
#[derive(Debug, Clone)]
pub struct Bound {
    criterion: Criterion,
    task: Task,
    /// The same with the region of the class, which is wider.
    class: Task,
    basis: Basis,
    proof: MaybeProof,
    /// Where something is known before or is mandatory, what holds for numbers of measurements that were asked for: the
    /// best design beside them depends on how many are free.
    sizes: BTreeMap<u32, (Certificate, MaybeProof)>,
}

/// What a bound for so many measurements rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BoundKind {
    /// A proof.
    Proved,
    /// The largest directional derivative that many local searches found: strong evidence, no proof.
    Evidence,
}

impl BoundKind {
    /// The name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Proved => "proved",
            Self::Evidence => "evidence",
        }
    }
}

/// The bound for so many measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanBound {
    /// No plan of the class is better: has a smaller `rho_0` (m), or by another criterion a better value, as
    /// [`CriterionFunction::value`](crate::plan::CriterionFunction::value) has it.
    pub best: f64,
    /// What that rests on.
    pub kind: BoundKind,
    /// What is proved, nearer or less near.
    pub proof: Option<PlanProof>,
}

impl PlanBound {
    /// That of which so many candidates were all looked at.
    pub(in crate::plan) const fn of_all(
        best: f64,
        candidates: usize,
        left_out: Vec<String>,
    ) -> Self {
        Self {
            best,
            kind: BoundKind::Proved,
            proof: Some(PlanProof {
                best,
                gap: 0.0,
                boxes: candidates as u64,
                left_out,
            }),
        }
    }
}

/// What is proved for so many measurements.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PlanProof {
    /// No plan of the class is better, in the same terms.
    #[serde(skip)]
    pub best: f64,
    /// How far the bound of the largest derivative is above the largest derivative found, as a share.
    pub gap: f64,
    /// The number of boxes that it took.
    pub boxes: u64,
    /// The names of the uncertainties that the proof takes for certain, which can only make what is proved less near.
    pub left_out: Vec<String>,
}

/// What a bound rests on.
#[derive(Debug, Clone, PartialEq)]
pub enum Basis {
    /// The largest directional derivative that many local searches found: strong evidence, no proof.
    Searches(Certificate),
    /// All candidates of a list, of which alone plans may be.
    Candidates(Enumerated),
    /// There is no bound: no design was found, plans are not optimised by the criterion, or the plan is not of the class.
    Nothing(NoBound),
}

/// Candidates of which alone plans may be, and what none of these is better than.
#[derive(Debug, Clone, PartialEq)]
pub struct Enumerated {
    /// The candidates; their repeats are the most that there may be.
    pub candidates: Vec<Experiment>,
    /// What no plan of them is below.
    pub bound: FiniteBound,
    /// The names of the uncertainties that are assumed exact, which can only make the bound less near.
    pub left_out: Vec<String>,
}

impl Enumerated {
    /// Whether an experiment that is measured so often is a candidate.
    fn check(&self, index: usize, experiment: &Experiment, times: u32) -> Result<(), NoBound> {
        let number = index + 1;
        let is_it = |candidate: &&Experiment| {
            let apart = &candidate.configuration_rad - &experiment.configuration_rad;
            let wrench = candidate.load.wrench();
            let off = wrench - experiment.load.wrench();
            apart.amax() <= SAME_RAD
                && off.amax() <= SAME_SHARE * wrench.amax()
                && is_one_direction(candidate.direction.as_ref(), experiment.direction.as_ref())
        };
        let most = self.candidates.iter().filter(is_it);
        let most = most
            .map(|each| u64::from(each.repeats))
            .reduce(|one, other| one + other);
        let outside = match most {
            None => format!("experiment {number} is none of the candidates"),
            Some(most) if most < u64::from(times) => format!(
                "experiment {number} is measured {times} times, and may be {most} times at most"
            ),
            Some(_) => return Ok(()),
        };
        Err(NoBound::outside(&outside))
    }
}

/// Why there is no bound for a plan, or for so many measurements.
#[derive(Debug, Clone, Error, PartialEq)]
pub enum NoBound {
    /// No bound was found for any plan.
    #[error("no bound was found: {0}")]
    NotFound(SearchError),
    /// The mandatory experiments alone are more.
    #[error(
        "the bound speaks about plans with the mandatory experiments, which alone are {mandatory} measurements"
    )]
    TooFew {
        /// The number of mandatory measurements.
        mandatory: u32,
    },
    /// Two experiments hang different loads in one configuration, where they share errors.
    #[error(
        "the bound speaks about plans that hang one load in each configuration: experiments {one} and {other} hang two in theirs, and \
         what deflections of one configuration share may add information"
    )]
    SeveralLoads {
        /// The number of one, from 1.
        one: usize,
        /// That of the other.
        other: usize,
    },
    /// The plan lacks a mandatory experiment.
    #[error("the bound speaks about plans with the mandatory experiments; {0}")]
    NotMandatory(NotMandatory),
    /// The bound does not speak about such plans: by such a criterion, or with a load, a side of approach or a configuration that the
    /// class does not have.
    #[error("{0}")]
    Outside(String),
}

impl NoBound {
    /// The plan has something that the class does not have.
    fn outside(words: &str) -> Self {
        Self::Outside(format!(
            "the bound does not speak about such a plan: {words}"
        ))
    }
}

impl Bound {
    /// The bound that the approximate design for a task's test poses gives.
    pub fn new(task: &Task, approximate: &ApproximateDesign) -> Self {
        Self::by(task, Criterion::TestPose, approximate)
    }

    /// The bound that the approximate design for a criterion gives (for O1 that for D).
    pub fn by(task: &Task, criterion: Criterion, approximate: &ApproximateDesign) -> Self {
        Self::resting_on(task, criterion, Basis::Searches(approximate.certificate))
    }

    /// A bound by a criterion that rests on something: for plans of listed candidates, the mandatory experiments are as they are.
    pub(super) fn resting_on(task: &Task, criterion: Criterion, basis: Basis) -> Self {
        let mut class = task.clone();
        class.region = widened(&task.region);
        Self {
            criterion,
            task: task.clone(),
            class,
            basis,
            proof: None,
            sizes: BTreeMap::new(),
        }
    }

    /// No bound, since nothing was found.
    pub(super) fn not_found(task: &Task, criterion: Criterion, error: SearchError) -> Self {
        Self::resting_on(task, criterion, Basis::Nothing(NoBound::NotFound(error)))
    }

    /// Searches the bound of `rho_0` for a task's plans under a seed; what was not found is told where it is asked for.
    pub fn search(task: &Task, seed: u64) -> Self {
        Self::search_and_prove(task, Criterion::TestPose, seed, &[], None)
    }

    /// The same by any criterion for plans of so many measurements, proved as far as an effort goes, where one is given,
    /// and recorded if wanted.
    pub fn search_and_prove(
        task: &Task,
        criterion: Criterion,
        seed: u64,
        sizes: &[u32],
        proof: Option<ProofLimits<'_>>,
    ) -> Self {
        let problem = Problem::new(task, criterion);
        match approximate_design(&problem, seed) {
            Ok(approximate) => {
                let bound = Self::by(task, criterion, &approximate);
                bound.prove(&approximate, seed, sizes, proof)
            }
            Err(error) => Self::not_found(task, criterion, error),
        }
    }

    /// The same for a plan: nothing is searched where the class does not have it, unless a proof is to be recorded.
    pub fn search_for(
        plan: &Plan,
        task: &Task,
        criterion: Criterion,
        seed: u64,
        proof: Option<ProofLimits<'_>>,
    ) -> Self {
        let nothing = |reason| Self::resting_on(task, criterion, Basis::Nothing(reason));
        let class = nothing(NoBound::outside("nothing is searched"));
        match class.check(plan) {
            Err(reason) if proof.is_none_or(|effort| !effort.records) => nothing(reason),
            _ => Self::search_and_prove(task, criterion, seed, &[plan.measurements()], proof),
        }
    }

    /// Proves the bound of the same approximate design as far as an effort goes, where one is given, and
    /// records the proof if wanted. Where something is known before or is mandatory, that is done for the approximate design
    /// beside them for each of these numbers of measurements.
    pub fn prove(
        mut self,
        approximate: &ApproximateDesign,
        seed: u64,
        sizes: &[u32],
        proof: Option<ProofLimits<'_>>,
    ) -> Self {
        let task = self.task.clone();
        let problem = Problem::new(&task, self.criterion);
        let refused = ProvableTask::refused(&problem).filter(|_| proof.is_some());
        let proof = proof.filter(|_| refused.is_none());
        let is_provable = ProvableTask::is_itself(&problem);
        let proved = |problem: &Problem<'_>, approximate: &ApproximateDesign| {
            let effort = proof.filter(|_| is_provable)?;
            Some(ProvedBound::new(problem, approximate, effort))
        };
        self.add_sizes(&problem, seed, sizes.iter().copied(), &proved);
        if self.sizes.is_empty() {
            self.proof = proved(&problem, approximate);
        }
        if let Some(reason) = refused {
            self.proof = Some(Err(reason));
        } else if let Some(proof) = proof {
            for simpler in ProvableTask::simpler(&problem) {
                self.prove_simpler(&simpler, seed, proof);
            }
            if self.proof().is_none() {
                self.proof = Some(Err(ProvableTask::refusal(&problem)));
            }
        }
        self
    }

    /// The same with what holds for further numbers of measurements, where something is known before or is mandatory: the
    /// bound of a number does not depend on which plan it is shown beside.
    pub fn with_sizes(mut self, seed: u64, sizes: impl IntoIterator<Item = u32>) -> Self {
        if !matches!(self.basis, Basis::Searches(_)) {
            return self;
        }
        let task = self.task.clone();
        let problem = Problem::new(&task, self.criterion);
        self.add_sizes(&problem, seed, sizes, &|_, _| None);
        self
    }

    /// Searches what holds for numbers of measurements of which nothing is known yet, and proves it.
    fn add_sizes(
        &mut self,
        problem: &Problem<'_>,
        seed: u64,
        sizes: impl IntoIterator<Item = u32>,
        proved: &dyn Fn(&Problem<'_>, &ApproximateDesign) -> MaybeProof,
    ) {
        for size in sizes {
            if self.sizes.contains_key(&size) {
                continue;
            }
            let Some(problem) = problem.beside_known(size) else {
                continue;
            };
            // Without a design of its own, the general one still holds.
            if let Ok(approximate) = approximate_design(&problem, seed) {
                let proof = proved(&problem, &approximate);
                self.sizes.insert(size, (approximate.certificate, proof));
            }
        }
    }

    /// Proves the bound of a simpler task, whose plans leave no more, and keeps it where it is the higher one.
    fn prove_simpler(&mut self, simpler: &ProvableTask, seed: u64, effort: ProofLimits<'_>) {
        let problem = Problem::new(&simpler.task, self.criterion);
        let nearer = |problem: &Problem<'_>, known: Option<&ProvedBound>, size: u32| {
            ProvedBound::of_simpler(problem, simpler, effort, seed, known, size)
        };
        let mut is_general = true;
        for (&size, (_, proof)) in &mut self.sizes {
            if let Some(problem) = problem.beside_known(size) {
                is_general = false;
                let known = proof.as_ref().and_then(|proof| proof.as_ref().ok());
                *proof = nearer(&problem, known, size).or(proof.take());
            }
        }
        if is_general {
            let largest = self.sizes.last_key_value().map_or(1, |(size, _)| *size);
            let known = self.proof().and_then(|proof| proof.as_ref().ok());
            if let Some(nearest) = nearer(&problem, known, largest) {
                for (_, proof) in self.sizes.values_mut() {
                    *proof = None;
                }
                self.proof = Some(nearest);
            }
        }
    }

    /// The proof, or why there is none, where one was asked for; if there are several, that for the largest number of
    /// measurements.
    pub fn proof(&self) -> Option<&Result<ProvedBound, NoProof>> {
        let largest = self.sizes.last_key_value();
        let own = largest.and_then(|(_, (_, proof))| proof.as_ref());
        own.or(self.proof.as_ref())
    }

    /// What makes a plan good.
    pub const fn criterion(&self) -> Criterion {
        self.criterion
    }

    /// What the bound rests on.
    pub const fn basis(&self) -> &Basis {
        &self.basis
    }

    /// No plan of the class with so many measurements is better than this.
    ///
    /// # Errors
    /// The class has no such plan, or there is no bound.
    pub fn of_size(&self, measurements: u32) -> Result<PlanBound, NoBound> {
        one_load_each(&self.class, self.criterion, &self.class.design.mandatory)?;
        let mut certificate = match &self.basis {
            Basis::Searches(certificate) => *certificate,
            Basis::Candidates(enumerated) => return self.of_candidates(enumerated, measurements),
            Basis::Nothing(reason) => return Err(reason.clone()),
        };
        let too_few = NoBound::TooFew {
            mandatory: certificate.mandatory.0,
        };
        let mut proof = self.proof.as_ref();
        if let Some((own, proof_of_size)) = self.sizes.get(&measurements) {
            (certificate, proof) = (*own, proof_of_size.as_ref().or(proof));
        }
        let proof = proof.and_then(|proof| proof.as_ref().ok());
        if let Some(proof) = proof.filter(|proof| proof.is_about_all()) {
            // The proof may come across more than the searches.
            certificate.largest_derivative =
                certificate.largest_derivative.max(proof.largest().found);
        }
        let cost = number(certificate.lower_bound(measurements).ok_or(too_few)?)?;
        let proved = proof.and_then(|proof| {
            Some(PlanProof {
                best: proof.of_size(measurements)?,
                gap: proof.largest().gap(),
                boxes: proof.largest().boxes,
                left_out: proof.left_out().to_vec(),
            })
        });
        let tight = (proved.as_ref()).filter(|_| proof.is_some_and(ProvedBound::is_tight));
        Ok(PlanBound {
            best: tight.map_or(self.criterion.value_of_cost(cost), |tight| tight.best),
            kind: tight.map_or(BoundKind::Evidence, |_| BoundKind::Proved),
            proof: proved,
        })
    }

    fn of_candidates(
        &self,
        enumerated: &Enumerated,
        measurements: u32,
    ) -> Result<PlanBound, NoBound> {
        let mandatory = self.class.design.mandatory.measurements();
        let free = measurements
            .checked_sub(mandatory)
            .ok_or(NoBound::TooFew { mandatory })?;
        let criterion = self.criterion.name();
        let none =
            format!("plans are bounded by test_pose, a, d and o1 alone, and not by {criterion}");
        let cost = (enumerated.bound.least_cost(free)).ok_or(NoBound::Outside(none))?;
        let best = self.criterion.value_of_cost(number(cost)?);
        let left_out = enumerated.left_out.clone();
        Ok(PlanBound::of_all(
            best,
            enumerated.candidates.len(),
            left_out,
        ))
    }

    /// The bound for a plan: no plan of the class with as many measurements is better than this.
    ///
    /// # Errors
    /// The plan is not of the class, or there is no bound.
    pub fn of_plan(&self, plan: &Plan) -> Result<PlanBound, NoBound> {
        let bound = self.of_size(plan.measurements())?;
        self.check(plan)?;
        Ok(bound)
    }

    /// Whether a plan is of the class.
    fn check(&self, plan: &Plan) -> Result<(), NoBound> {
        one_load_each(&self.class, self.criterion, plan)?;
        let mandatory = &self.class.design.mandatory;
        let free = plan
            .beside_mandatory(mandatory)
            .map_err(NoBound::NotMandatory)?;
        let mut feasibility = Feasibility::new(&self.class);
        for (index, experiment) in plan.experiments.iter().enumerate() {
            if free[index] == 0 {
                continue;
            }
            if let Basis::Candidates(enumerated) = &self.basis {
                enumerated.check(index, experiment, free[index])?;
                continue;
            }
            let knows_sides = self.class.belief.uncertain.has_backlash();
            if knows_sides && !Approach::is_usual(experiment.approach.as_ref()) {
                return Err(NoBound::Outside(format!(
                    "the bound speaks about configurations that are approached with all joints turning positively, and experiment {} is not",
                    index + 1
                )));
            }
            let loads = &self.class.loads;
            if let Some(words) = loads.outside(&experiment.load) {
                return Err(NoBound::outside(&format!(
                    "experiment {}: {words}",
                    index + 1
                )));
            }
            // Torques are those of the load that is meant.
            let meant = Experiment {
                load: loads.nearest(&experiment.load),
                ..experiment.clone()
            };
            let violations = feasibility.violations_of(index + 1, &meant);
            if let Some(violation) = violations.first() {
                return Err(NoBound::outside(&violation.to_string()));
            }
        }
        Ok(())
    }
}

/// The cost of a bound; there is none where derivatives are no numbers, as where the robot gives way.
fn number(cost: f64) -> Result<f64, NoBound> {
    const NONE: &str = "no bound was found: the largest directional derivative is no number";
    let is_number = !cost.is_nan();
    (is_number.then_some(cost)).ok_or_else(|| NoBound::Outside(NONE.to_owned()))
}

/// Whether a plan hangs one load in each configuration, where deflections of one configuration share errors by the belief.
///
/// # Errors
/// The first two experiments that do not.
pub(super) fn one_load_each(task: &Task, criterion: Criterion, plan: &Plan) -> Result<(), NoBound> {
    let is_shared = task.belief.is_shared_by_configuration();
    // The criteria of Table 1 are about each deflection's own noise.
    if criterion != Criterion::TestPose || !is_shared {
        return Ok(());
    }
    match plan.several_loads() {
        None => Ok(()),
        Some([one, other]) => Err(NoBound::SeveralLoads {
            one: one + 1,
            other: other + 1,
        }),
    }
}
