//! The search for a plan (eqs. 21, 22) and the certificate of how good it can be.
//!
//! - [`observation`](MatrixEvaluator): the observation matrix and its derivatives.
//! - `problem`, `point`, `joints`: what is searched, an experiment of it, and the joints that matter.
//! - `local`: the best configuration near a given one, by sequential quadratic programming.
//! - `sampling`: random feasible experiments.
//! - `approximate`: the design with continuous weights, whose largest directional derivative bounds
//!   every plan from below.
//! - `weighing`: the best weights on given experiments.
//! - `bound`: that bound, the class of plans that it speaks about, and why there is none for others.
//! - `proved`, `rows`: its proof; `provable`: what that leaves out.
//! - `budget`: the best accuracy against the number of measurements.
//! - `criteria`: the best plans for the criteria of Table 1, judged at the test poses.
//! - `pool`: random experiments that are cheap to look through.
//! - `exchange`, `refinement`: one search of a plan of whole experiments, by exchange over a pool and
//!   refinement by gradients.
//! - `rounding`: plans of many measurements, from a rounded approximate design.
//! - `told`, `finite`, `finite_search`, `candidates`: plans of a finite list of candidates, whose bound is proved by looking at all.
//! - `low_rank_search`: choices from a long list of readings that inform few of many unknowns.
//! - `exact`: the best plan of whole experiments that many such searches find.

mod approximate;
mod bound;
mod budget;
mod candidate_error;
mod candidate_information;
mod candidates;
mod criteria;
mod exact;
mod exchange;
mod finite;
mod finite_search;
mod joints;
mod local;
mod low_rank_search;
mod observation;
mod point;
mod pool;
mod problem;
mod provable;
mod proved;
mod refinement;
mod relevance;
mod rounding;
mod rows;
mod sampling;
mod weighing;

pub use approximate::{ApproximateDesign, Certificate, approximate_design};
pub use bound::{Basis, Bound, BoundKind, Enumerated, NoBound, PlanBound, PlanProof};
pub use budget::{
    BudgetPoint, RepeatsNeeded, budget, cheapest, repeated_configurations, repeats_needed,
};
pub use candidate_error::{CandidateError, LeftOutCandidates};
pub use candidate_information::CandidateInformation;
pub use candidates::Candidates;
pub(in crate::plan) use candidates::possible_of;
pub use criteria::{CriterionPlan, compare_criteria};
pub use exact::{ExactDesign, Watch, exact_design};
pub use finite::{FiniteBound, FiniteProblem, SharingCandidates, TogetherBounds};
pub use finite_search::{CandidatePlan, FiniteDesign, FiniteEffort};
pub use low_rank_search::{ListChoice, best_choice};
pub use observation::MatrixEvaluator;
pub use problem::{Effort, Problem, SearchError};
pub use proved::{ProofEffort, ProofExperiment, ProofFile, ProvedBound, TIGHT};
pub use sampling::{RandomPlans, median_random_plan, random_plan};
