//! The search for the best plan of a finite list of candidates: rounded weights, the greedy plan and random ones, each bettered by
//! exchanges until none helps.
//!
//! Exchanges try the few candidates that prediction most by the cost's derivative. Where none of these helps any more, a thorough pass
//! tries all that may help: the costs are convex and of degree -1, phi(M') >= phi(M)^2 / trace(G M') with trace(G M) = phi(M), so
//! that an exchange can lower phi only if what comes has a larger derivative trace(G I) than what goes.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::DMatrix;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::exact::Watch;
use super::finite::{FiniteBound, FiniteProblem, FiniteWeights, highest, measure};
use super::finite_error::FiniteError;
use crate::numeric::random::{generator, streams};
use crate::plan::CriterionFunction;

/// What stands for nothing known, as a share of what a plan tells on average: as long as a search has no regular plan.
const FLOOR: f64 = 1e-9;
/// An exchange lowers the cost by more than this share.
const GAIN: f64 = 1e-9;
/// Looks at every measurement of a plan, at most.
const PASSES: usize = 60;
/// So many candidates are all looked at for every exchange; of more, those that were the best when the pass began.
const FEW: usize = 6000;
/// How many these are.
const SHORT_LIST: usize = 1000;
/// Of those that prediction most, so many are tried.
const TRIED: usize = 24;
/// The same for criteria that take eigenvalues.
const TRIED_OF_OTHERS: usize = 8;
/// A thorough pass tries so many for each exchange, at most; of large problems, as many as take this many multiplications.
const THOROUGHLY_TRIED: usize = 2000;
const THOROUGH_WORK: usize = 20_000_000;
/// The same for criteria that take eigenvalues.
const THOROUGHLY_TRIED_OF_OTHERS: usize = 48;
/// Thorough passes, at most; each but the last has found something.
const THOROUGH_PASSES: usize = 20;
/// Costs within this factor agree: 0.1 % in `rho_0`, the cost's root.
const SAME: f64 = 1.002;

/// The best plan of a list of candidates that searches found.
#[derive(Debug, Clone, PartialEq)]
pub struct FiniteDesign {
    /// Candidates by their places, and how often each is measured.
    pub plan: Vec<(usize, u32)>,
    /// Its cost.
    pub cost: f64,
    /// What no plan of as many measurements is below.
    pub bound: FiniteBound,
    /// How many searches there were.
    pub searches: usize,
    /// How many of them ended within 0.1 % of that cost's root.
    pub agreeing: usize,
}

/// Which candidates exchanges try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExchangesTry {
    /// Those that prediction most.
    Promising,
    /// In the end all that may help, too.
    AllThatMayHelp,
}

/// How a plan of a list of candidates is searched.
#[derive(Debug, Clone, Copy)]
pub struct FiniteEffort {
    /// The number of measurements, beside what is known.
    pub measurements: u32,
    /// How many of them may be of different candidates.
    pub configurations: u32,
    /// The number of searches.
    pub searches: usize,
    /// Of random numbers.
    pub seed: u64,
    /// What its exchanges try.
    pub exchanges: ExchangesTry,
}

impl FiniteProblem<'_> {
    /// Searches the best plan of so many measurements; a function of the problem, the effort and the seed alone, unless it is
    /// stopped.
    pub fn search(
        &self,
        effort: FiniteEffort,
        watch: Watch<'_>,
    ) -> Result<FiniteDesign, FiniteError> {
        let measurements = effort.measurements;
        let configurations = effort.configurations.min(measurements);
        self.check(measurements, configurations)?;
        let (weights, mut bound) = self.weigh(measurements)?;
        let done = AtomicUsize::new(0);
        let lowest = Mutex::new(f64::INFINITY);
        let floor = (self.told.mean() * f64::from(measurements.max(1)) + &self.beside) * FLOOR;
        let found: Vec<FoundAmong> = (0..effort.searches.max(1))
            .into_par_iter()
            .filter_map(|index| {
                if index > 0 && watch.stop.load(Ordering::Relaxed) {
                    return None;
                }
                let mut search =
                    CandidateExchanges::new(self, floor.clone(), configurations as usize);
                let start = search.start(index, effort, &weights);
                let found = search.improved(start, effort.exchanges);
                if let Ok(mut lowest) = lowest.lock() {
                    *lowest = lowest.min(found.cost);
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    (watch.progress)(done, effort.searches, *lowest);
                }
                Some(found)
            })
            .collect();
        let singular = FiniteError::Singular {
            measurements,
            unknowns: self.told.size(),
        };
        let best = (found.iter()).min_by(|one, other| one.cost.total_cmp(&other.cost));
        let mut plan = best.ok_or(singular)?.plan.clone();
        plan.sort_unstable();
        let information = self.information(&plan);
        let cost = self.cost().cost(&information, &mut information.clone());
        if !cost.is_finite() || !self.is_determined_by(&information, cost) {
            return Err(singular);
        }
        self.bound_near(&mut bound, &plan);
        let agreeing = found
            .iter()
            .filter(|found| found.cost < cost * SAME)
            .count();
        Ok(FiniteDesign {
            plan,
            cost,
            bound,
            searches: found.len(),
            agreeing,
        })
    }

    /// The best of some plans of as many measurements, as they are and bettered by exchanges, with its cost; none where it is not
    /// below another cost.
    pub fn bettered(
        &self,
        plans: &[Vec<(usize, u32)>],
        effort: FiniteEffort,
        another: f64,
    ) -> Option<(Vec<(usize, u32)>, f64)> {
        let measurements = f64::from(effort.measurements.max(1));
        let floor = (self.told.mean() * measurements + &self.beside) * FLOOR;
        let configurations = effort.configurations.min(effort.measurements) as usize;
        let all: Vec<_> = plans
            .par_iter()
            .flat_map(|plan| {
                let mut search = CandidateExchanges::new(self, floor.clone(), configurations);
                let mut found = search.improved(plan.clone(), effort.exchanges).plan;
                found.sort_unstable();
                [plan.clone(), found]
            })
            .map(|plan| {
                let information = self.information(&plan);
                let cost = self.cost().cost(&information, &mut information.clone());
                let is_better =
                    cost < another * (1.0 - GAIN) && self.is_determined_by(&information, cost);
                is_better.then_some((plan, cost))
            })
            .collect();
        (all.into_iter().flatten()).min_by(|one, other| one.1.total_cmp(&other.1))
    }
}

/// A plan of candidates with its cost.
struct FoundAmong {
    plan: Vec<(usize, u32)>,
    cost: f64,
}

/// One search.
struct CandidateExchanges<'p, 'a> {
    problem: &'p FiniteProblem<'a>,
    cost: CriterionFunction,
    /// Stands for nothing known.
    floor: DMatrix<f64>,
    configurations: usize,
    directions: DMatrix<f64>,
}

impl<'p, 'a> CandidateExchanges<'p, 'a> {
    fn new(problem: &'p FiniteProblem<'a>, floor: DMatrix<f64>, configurations: usize) -> Self {
        Self {
            problem,
            cost: problem.cost(),
            directions: floor.clone(),
            floor,
            configurations,
        }
    }

    fn information(&self, plan: &[(usize, u32)]) -> DMatrix<f64> {
        self.problem.information(plan) + &self.floor
    }

    /// Where a search begins: the first at rounded weights, the second at the greedy plan, all others at random.
    fn start(
        &mut self,
        index: usize,
        effort: FiniteEffort,
        weights: &FiniteWeights,
    ) -> Vec<(usize, u32)> {
        let mut plan = match index {
            0 => self.rounded(weights, effort.measurements),
            1 => Vec::new(),
            _ => {
                let mut random = generator(effort.seed, streams::candidate_search(index as u64));
                self.drawn(weights, effort.measurements, &mut random)
            }
        };
        let planned: u32 = plan.iter().map(|(_, times)| times).sum();
        for _ in planned..effort.measurements {
            self.add_best(&mut plan);
        }
        plan
    }

    /// So often as their weights ask for, the heaviest where there are too many.
    fn rounded(&self, weights: &FiniteWeights, measurements: u32) -> Vec<(usize, u32)> {
        let mut heaviest = weights.support.clone();
        heaviest.sort_by(|one, other| other.1.total_cmp(&one.1).then(one.0.cmp(&other.0)));
        heaviest.truncate(self.configurations);
        let mut times = vec![0_u32; heaviest.len()];
        for _ in 0..measurements {
            let share = |place: usize| heaviest[place].1 / f64::from(times[place] + 1);
            let may_be = |&place: &usize| times[place] < self.problem.most[heaviest[place].0];
            let next = (0..heaviest.len())
                .filter(may_be)
                .max_by(|&one, &other| share(one).total_cmp(&share(other)).then(other.cmp(&one)));
            let Some(next) = next else { break };
            times[next] += 1;
        }
        let all = heaviest
            .into_iter()
            .map(|(candidate, _)| candidate)
            .zip(times);
        all.filter(|(_, times)| *times > 0).collect()
    }

    /// Every other one by its weight, the others any.
    fn drawn(
        &self,
        weights: &FiniteWeights,
        measurements: u32,
        random: &mut ChaCha8Rng,
    ) -> Vec<(usize, u32)> {
        let mut plan: Vec<(usize, u32)> = Vec::new();
        for measurement in 0..measurements {
            let candidate = if plan.len() >= self.configurations {
                plan[random.random_range(0..plan.len())].0
            } else if measurement % 2 == 0 {
                let mut left: f64 = random.random();
                let heavy = weights.support.iter().find(|(_, weight)| {
                    left -= weight;
                    left <= 0.0
                });
                heavy.map_or(0, |(candidate, _)| *candidate)
            } else {
                random.random_range(0..self.problem.told.len())
            };
            // What may not be is left to those that are added where they tell most.
            let times = times_in(&plan, candidate);
            if times < self.problem.most[candidate] {
                measure(&mut plan, candidate, 1);
            }
        }
        plan
    }

    /// Adds the measurement that helps most.
    fn add_best(&mut self, plan: &mut Vec<(usize, u32)>) {
        let rest = self.information(plan);
        self.cost.cost(&rest, &mut self.directions);
        let derivatives = self.problem.told.derivatives(&self.directions);
        let promising = Promising::new(&derivatives, None);
        if let Some((candidate, _)) = self.best_addition(plan, &rest, 1, promising) {
            measure(plan, candidate, 1);
        }
    }

    /// Exchanges measurements until none helps.
    fn improved(&mut self, plan: Vec<(usize, u32)>, tried: ExchangesTry) -> FoundAmong {
        let mut found = self.improved_by_promising(plan);
        if tried == ExchangesTry::Promising {
            return found;
        }
        for _ in 0..THOROUGH_PASSES {
            let before = found.cost;
            self.pass(&mut found, Listed::AllThatMayHelp);
            if found.cost >= before {
                break;
            }
            found = self.improved_by_promising(found.plan);
        }
        found
    }

    /// Exchanges measurements for those that prediction most, one at a time and all of a configuration at once, until none helps.
    fn improved_by_promising(&mut self, plan: Vec<(usize, u32)>) -> FoundAmong {
        let is_few = self.problem.told.len() <= FEW;
        let mut is_complete = is_few;
        let mut found = FoundAmong {
            plan,
            cost: f64::INFINITY,
        };
        for _ in 0..PASSES {
            let information = self.information(&found.plan);
            found.cost = self.cost.cost(&information, &mut self.directions);
            let listed = (!is_complete).then(|| {
                let derivatives = self.problem.told.derivatives(&self.directions);
                highest(&derivatives, SHORT_LIST, |_| true)
            });
            let listed = listed.as_deref().map_or(Listed::All, Listed::These);
            let before = found.cost;
            self.pass(&mut found, listed);
            if found.cost < before {
                is_complete = is_few;
            } else if is_complete {
                break;
            } else {
                is_complete = true;
            }
        }
        found
    }

    /// Every measurement of a plan in its turn.
    fn pass(&mut self, found: &mut FoundAmong, listed: Listed<'_>) {
        let mut place = 0;
        while place < found.plan.len() {
            self.exchange(found, place, 1, listed);
            if let Some(&(_, times)) = found.plan.get(place).filter(|(_, times)| *times > 1) {
                self.exchange(found, place, times, listed);
            }
            place += 1;
        }
    }

    /// Puts so many measurements of a place of the plan elsewhere, where that lowers the cost.
    fn exchange(&mut self, found: &mut FoundAmong, place: usize, moved: u32, listed: Listed<'_>) {
        let mut others = found.plan.clone();
        let from = others[place].0;
        others[place].1 -= moved;
        others.retain(|(_, times)| *times > 0);
        self.cost
            .cost(&self.information(&found.plan), &mut self.directions);
        let told = &self.problem.told;
        let derivatives = match listed {
            Listed::These(listed) => told.derivatives_of(&self.directions, listed),
            _ => told.derivatives(&self.directions),
        };
        let mut promising = Promising::new(&derivatives, Some(from));
        if let Listed::AllThatMayHelp = listed {
            promising.above = derivatives[from];
        }
        let rest = self.information(&others);
        let best = self.best_addition(&others, &rest, moved, promising);
        if let Some((candidate, cost)) = best
            && cost < found.cost * (1.0 - GAIN)
        {
            found.cost = cost;
            measure(&mut others, candidate, moved);
            found.plan = others;
        }
    }

    /// The candidate that is best measured so often beside a plan, of those that prediction most, with the cost; none twice in
    /// vain.
    fn best_addition(
        &mut self,
        plan: &[(usize, u32)],
        rest: &DMatrix<f64>,
        times: u32,
        promising: Promising<'_>,
    ) -> Option<(usize, f64)> {
        let problem = self.problem;
        let is_full = plan.len() >= self.configurations;
        let may_be = |candidate: usize| {
            let known = times_in(plan, candidate);
            promising.without != Some(candidate)
                && promising.derivatives[candidate] > promising.above
                && (known > 0 || !is_full)
                && known + times <= problem.most[candidate]
        };
        let tried = match (problem.criterion.is_factored(), promising.is_thorough()) {
            (true, false) => TRIED,
            (false, false) => TRIED_OF_OTHERS,
            (true, true) => {
                let work = problem.told.size().pow(3).max(1);
                THOROUGHLY_TRIED.min(THOROUGH_WORK / work).max(TRIED)
            }
            (false, true) => THOROUGHLY_TRIED_OF_OTHERS,
        };
        let mut best: Option<(usize, f64)> = None;
        for candidate in highest(promising.derivatives, tried, may_be) {
            let sum = problem.with(rest, plan, (candidate, times));
            let cost = self.cost.cost(&sum, &mut self.directions);
            if best.is_none_or(|(_, lowest)| cost < lowest) {
                best = Some((candidate, cost));
            }
        }
        best
    }
}

/// Among which candidates an exchange looks.
#[derive(Clone, Copy)]
enum Listed<'l> {
    /// All, of which a few are tried.
    All,
    /// These, of which a few are tried.
    These(&'l [usize]),
    /// All that may help, which are tried.
    AllThatMayHelp,
}

/// What candidates prediction.
#[derive(Clone, Copy)]
struct Promising<'d> {
    /// The cost's derivatives; minus infinity of those that are not listed.
    derivatives: &'d [f64],
    /// The one that goes.
    without: Option<usize>,
    /// What is no larger does not help.
    above: f64,
}

impl<'d> Promising<'d> {
    const fn new(derivatives: &'d [f64], without: Option<usize>) -> Self {
        Self {
            derivatives,
            without,
            above: f64::NEG_INFINITY,
        }
    }

    fn is_thorough(&self) -> bool {
        self.above > f64::NEG_INFINITY
    }
}

fn times_in(plan: &[(usize, u32)], candidate: usize) -> u32 {
    let known = plan.iter().find(|(each, _)| *each == candidate);
    known.map_or(0, |(_, times)| *times)
}
