//! The search for a plan (eqs. 21, 22) and the certificate of how good it can be.
//!
//! - `problem`, `observation`, `point`, `joints`, `relevance`: what is searched, and an experiment of it with its derivatives.
//! - `local`, `sampling`, `pool`: the best configuration near a given one, random experiments, and many that are cheap to look through.
//! - `approximate`, `weighing`: the design with continuous weights, whose largest directional derivative bounds every plan from below.
//! - `bound`, `proved`, `provable`: that bound, the class of plans that it speaks about, its proof, and what that leaves out.
//! - `exact`, `exchange`, `refinement`: the best plan of whole experiments, by exchange over a pool and refinement by gradients, or
//!   from a rounded approximate design.
//! - `plan_search`: searches that are repeated with what they leave out where it counts.
//! - `budget`, `criteria`: the best accuracy against the number of measurements, and the best plans for the criteria of Table 1.
//! - `error`: why there is no plan.
//! - `candidates`, `finite`, `finite_search`: plans of a finite list, whose bound is proved by looking at all.
//! - `correlated_choice`: choices from a long list of readings that follow functions of joints' angles.

mod approximate;
mod bound;
mod budget;
mod candidate_error;
mod candidate_information;
mod candidates;
mod correlated_choice;
mod criteria;
mod error;
mod exact;
mod exact_plan;
mod exchange;
mod finite;
mod finite_search;
mod joints;
mod local;
mod observation;
mod plan_search;
mod point;
mod pool;
mod problem;
mod provable;
mod proved;
mod refinement;
mod relevance;
mod sampling;
mod several_loads;
mod size;
mod watch;
mod weighing;

pub use approximate::{ApproximateDesign, Certificate, approximate_design};
pub use bound::{Basis, Bound, BoundKind, Enumerated, NoBound, PlanBound, PlanProof};
pub use budget::{
    BudgetPoint, RepeatsNeeded, budget, cheapest, repeated_configurations, repeats_needed,
};
pub use candidate_error::{CandidateError, LeftOutCandidates, OfferedCandidates};
pub use candidate_information::CandidateInformation;
pub use candidates::Candidates;
pub(in crate::plan) use candidates::possible_of;
pub use correlated_choice::{CorrelatedChoice, best_choice};
pub use criteria::{CriterionPlan, compare_criteria};
pub use error::SearchError;
pub use exact::exact_design;
pub use exact_plan::ExactDesign;
pub use finite::{
    CandidatePlan, FiniteBound, FiniteProblem, TogetherBounds, ToldTogether, measurements_in,
};
pub(in crate::plan) use finite::{by_configuration, measure};
pub use finite_search::{FiniteDesign, FiniteEffort};
pub use observation::MatrixEvaluator;
pub use plan_search::PlanSearch;
pub use problem::{Effort, Problem};
pub use proved::{ProofFile, ProvedBound, TIGHT};
pub use sampling::{RandomPlans, median_random_plan, random_plan};
pub use size::PlanSize;
pub use watch::Watch;
