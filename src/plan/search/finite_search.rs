//! The search for the best plan of a finite list of candidates: rounded weights, the greedy plan and random ones, each bettered by
//! exchanges until none helps.
//!
//! Exchanges try the few candidates that promise most by the cost's derivative. Where none of these helps any more, a thorough pass
//! tries all that may help: the costs are convex and of degree -1, phi(M') >= phi(M)^2 / trace(G M') with trace(G M) = phi(M), so
//! that an exchange can lower phi only if what comes has a larger derivative trace(G I) than what goes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::Ordering;

use nalgebra::DMatrix;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::candidate_error::CandidateError;
use super::finite::{CandidatePlan, FiniteBound, FiniteProblem, highest, measure, measurements_in};
use super::watch::Watch;
use super::weighing::apportioned;
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
/// Of those that promise most, so many are tried.
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
/// Plans in other configurations begin with so many candidates, no more than so many of one configuration.
const PROMISING: usize = 48;
const OF_ONE: usize = 6;
/// A plan in other configurations is bettered where its cost is no more than this factor above.
const HOPEFUL: f64 = 1.5;
/// Costs within this factor agree: 0.1 % in `rho_0`, the cost's root.
const SAME: f64 = 1.002;

/// The best plan of a list of candidates that searches found.
#[derive(Debug, Clone, PartialEq)]
pub struct FiniteDesign {
    /// The plan.
    pub plan: CandidatePlan,
    /// Its cost.
    pub cost: f64,
    /// What no plan of as many measurements is below.
    pub bound: FiniteBound,
    /// How many searches there were, and how many of them ended within 0.1 % of that cost's root.
    pub searches: [usize; 2],
}

/// How a plan of a list of candidates is searched.
#[derive(Debug, Clone, Copy)]
pub struct FiniteEffort {
    /// The number of measurements, beside what is known.
    pub measurements: u32,
    /// How many different configurations they may be of.
    pub configurations: u32,
    /// The number of searches.
    pub searches: usize,
    /// Of random numbers.
    pub seed: u64,
    /// Whether exchanges try in the end all candidates that may help, too, and not alone those that promise most.
    pub is_thorough: bool,
}

impl FiniteProblem<'_> {
    /// Searches the best plan of so many measurements; a function of the problem, the effort and the seed alone, unless it is
    /// stopped.
    pub fn search(
        &self,
        effort: FiniteEffort,
        watch: Watch<'_>,
    ) -> Result<FiniteDesign, CandidateError> {
        let measurements = effort.measurements;
        self.check(measurements, effort.configurations.min(measurements))?;
        let (weights, mut bound) = self.weigh(measurements)?;
        let tell = watch.counted(effort.searches);
        let floor = self.floor(effort);
        let search = |index: usize| {
            if index > 0 && watch.stop.load(Ordering::Relaxed) {
                return None;
            }
            let mut search = CandidateExchanges::new(self, &floor, effort);
            let start = search.start(index, &weights);
            let found = search.improved(start);
            tell(found.cost);
            Some(found)
        };
        let searches = (0..effort.searches.max(1)).into_par_iter();
        let found: Vec<FoundAmong> = searches.filter_map(search).collect();
        let unknowns = self.told.size();
        let singular =
            format!("{measurements} of the candidates cannot determine {unknowns} unknowns");
        let singular = CandidateError::new(singular, None);
        let best = (found.iter()).min_by(|one, other| one.cost.total_cmp(&other.cost));
        let Some(mut plan) = best.map(|best| best.plan.clone()) else {
            return Err(singular);
        };
        plan.sort_unstable();
        let cost = self.cost_of_plan(&plan).ok_or(singular)?;
        self.bound_near(&mut bound, &plan);
        let is_as_good = |found: &&FoundAmong| found.cost < cost * SAME;
        Ok(FiniteDesign {
            plan,
            cost,
            bound,
            searches: [found.len(), found.iter().filter(is_as_good).count()],
        })
    }

    /// The best that is allowed of some plans of as many measurements, as they are and bettered by exchanges, with its cost; none where it is
    /// not below another cost.
    pub fn bettered(
        &self,
        plans: &[CandidatePlan],
        effort: FiniteEffort,
        another: f64,
        is_allowed: impl Fn(&CandidatePlan) -> bool + Sync,
    ) -> Option<(CandidatePlan, f64)> {
        let floor = self.floor(effort);
        let better = (plans.par_iter())
            .flat_map(|plan| {
                let mut search = CandidateExchanges::new(self, &floor, effort);
                let mut found = search.improved(plan.clone()).plan;
                found.sort_unstable();
                [plan.clone(), found]
            })
            .filter_map(|plan| {
                let cost = self.cost_of_plan(&plan).filter(|_| is_allowed(&plan))?;
                (cost < another * (1.0 - GAIN)).then_some((plan, cost))
            });
        let better: Vec<_> = better.collect();
        (better.into_iter()).min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// What stands for nothing known.
    fn floor(&self, effort: FiniteEffort) -> DMatrix<f64> {
        let measurements = f64::from(effort.measurements.max(1));
        (self.told.mean() * measurements + &self.beside) * FLOOR
    }
}

/// A plan of candidates with its cost.
struct FoundAmong {
    plan: CandidatePlan,
    cost: f64,
}

/// One search.
struct CandidateExchanges<'p, 'a> {
    problem: &'p FiniteProblem<'a>,
    cost: CriterionFunction,
    /// Stands for nothing known.
    floor: &'p DMatrix<f64>,
    effort: FiniteEffort,
    configurations: usize,
    directions: DMatrix<f64>,
}

impl<'p, 'a> CandidateExchanges<'p, 'a> {
    fn new(problem: &'p FiniteProblem<'a>, floor: &'p DMatrix<f64>, effort: FiniteEffort) -> Self {
        Self {
            problem,
            cost: problem.cost(),
            directions: floor.clone(),
            floor,
            effort,
            configurations: effort.configurations.min(effort.measurements) as usize,
        }
    }

    fn information(&self, plan: &[(usize, u32)]) -> DMatrix<f64> {
        self.problem.information(plan) + self.floor
    }

    /// Where a search begins: the first at rounded weights, the second at the greedy plan, all others at random.
    fn start(&mut self, index: usize, weights: &[(usize, f64)]) -> CandidatePlan {
        let mut plan = match index {
            0 => self.rounded(weights),
            1 => Vec::new(),
            _ => {
                let stream = streams::candidate_search(index as u64);
                self.drawn(weights, &mut generator(self.effort.seed, stream))
            }
        };
        let planned = measurements_in(&plan);
        for _ in planned..self.effort.measurements {
            self.add_best(&mut plan, None);
        }
        plan
    }

    /// So often as their weights ask for, the heaviest where there are too many.
    fn rounded(&self, weights: &[(usize, f64)]) -> CandidatePlan {
        let mut heaviest = weights.to_vec();
        heaviest.sort_by(|one, other| other.1.total_cmp(&one.1).then(one.0.cmp(&other.0)));
        let mut taken = CandidatePlan::new();
        heaviest.retain(|&(candidate, _)| {
            let may_be =
                !self.is_full(&taken) || self.problem.reads_in_configuration(&taken, candidate);
            taken.extend(may_be.then_some((candidate, 1)));
            may_be
        });
        heaviest.truncate(self.effort.measurements as usize);
        let shares: Vec<f64> = heaviest.iter().map(|(_, weight)| *weight).collect();
        let most = |place: usize| self.problem.most[heaviest[place].0];
        let times = apportioned(&shares, self.effort.measurements, 1.0, most);
        let all = heaviest.iter().map(|(candidate, _)| *candidate).zip(times);
        all.filter(|(_, times)| *times > 0).collect()
    }

    /// Every other one by its weight, the others any.
    fn drawn(&self, weights: &[(usize, f64)], random: &mut ChaCha8Rng) -> CandidatePlan {
        let mut plan = CandidatePlan::new();
        for measurement in 0..self.effort.measurements {
            let candidate = if self.is_full(&plan) && !plan.is_empty() {
                plan[random.random_range(0..plan.len())].0
            } else if measurement % 2 == 0 {
                let mut left: f64 = random.random();
                let heavy = weights.iter().find(|(_, weight)| {
                    left -= weight;
                    left <= 0.0
                });
                heavy.map_or(0, |(candidate, _)| *candidate)
            } else {
                random.random_range(0..self.problem.told.count())
            };
            // What may not be is left to those that are added where they tell most.
            let may_be =
                !self.is_full(&plan) || self.problem.reads_in_configuration(&plan, candidate);
            if may_be && times_in(&plan, candidate) < self.problem.most[candidate] {
                measure(&mut plan, candidate, 1);
            }
        }
        plan
    }

    /// The configurations of a plan.
    fn configurations_of(&self, plan: &[(usize, u32)]) -> BTreeSet<usize> {
        let all = plan.iter();
        (all.map(|&(candidate, _)| self.problem.configurations[candidate])).collect()
    }

    /// Whether a plan has as many configurations as it may have beside those that are mandatory.
    fn is_full(&self, plan: &[(usize, u32)]) -> bool {
        let mandatory = &self.problem.mandatory;
        plan.len() >= self.configurations
            && self.configurations_of(plan).difference(mandatory).count() >= self.configurations
    }

    /// Adds the measurement that helps most, of one configuration none.
    fn add_best(&mut self, plan: &mut CandidatePlan, but: Option<usize>) {
        let rest = self.information(plan);
        self.cost.cost(&rest, &mut self.directions);
        let mut derivatives = self.problem.told.derivatives(&self.directions);
        for (derivative, here) in derivatives.iter_mut().zip(&self.problem.configurations) {
            if but == Some(*here) {
                *derivative = f64::NEG_INFINITY;
            }
        }
        let tried = self.tried(false);
        if let Some((candidate, _)) = self.best_addition(plan, &rest, 1, &derivatives, tried) {
            measure(plan, candidate, 1);
        }
    }

    /// Exchanges measurements until none helps.
    fn improved(&mut self, plan: CandidatePlan) -> FoundAmong {
        let mut found = self.improved_by_promising(plan);
        if !self.effort.is_thorough {
            return found;
        }
        for _ in 0..THOROUGH_PASSES {
            let before = found.cost;
            self.pass(&mut found, Listed::AllThatMayHelp);
            self.exchange_configurations(&mut found, PROMISING);
            if found.cost >= before {
                break;
            }
            found = self.improved_by_promising(found.plan);
        }
        found
    }

    /// Exchanges measurements for those that promise most, one at a time and all of a configuration at once, until none helps.
    fn improved_by_promising(&mut self, plan: CandidatePlan) -> FoundAmong {
        let is_few = self.problem.told.count() <= FEW;
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
            self.exchange_configurations(&mut found, 0);
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

    /// Where there may be fewer configurations than measurements: puts all measurements of one elsewhere, wherever that lowers the cost;
    /// beginning also with each of so many candidates that promise most.
    fn exchange_configurations(&mut self, found: &mut FoundAmong, tried: usize) {
        if self.configurations >= self.effort.measurements as usize {
            return;
        }
        for own in self.configurations_of(&found.plan) {
            let mut others = found.plan.clone();
            others.retain(|&(each, _)| self.problem.configurations[each] != own);
            let firsts = self.promising(&others, tried).into_iter().map(Some);
            for first in [None].into_iter().chain(firsts) {
                let mut plan = others.clone();
                if let Some(first) = first {
                    measure(&mut plan, first, 1);
                }
                let but = first.is_none().then_some(own);
                let kept = measurements_in(&plan);
                for _ in kept..self.effort.measurements {
                    self.add_best(&mut plan, but);
                }
                let is_whole = measurements_in(&plan) == self.effort.measurements;
                let cost = (self.cost).cost(&self.information(&plan), &mut self.directions);
                let mut other = FoundAmong { plan, cost };
                if is_whole && tried > 0 && cost < found.cost * HOPEFUL {
                    self.pass(&mut other, Listed::All);
                }
                if is_whole && other.cost < found.cost * (1.0 - GAIN) {
                    *found = other;
                }
            }
        }
    }

    /// So many candidates that promise most beside a plan in configurations that it has not, a few of each.
    fn promising(&mut self, plan: &[(usize, u32)], count: usize) -> Vec<usize> {
        if count == 0 {
            return Vec::new();
        }
        let (here, is_full) = (self.configurations_of(plan), self.is_full(plan));
        self.cost
            .cost(&self.information(plan), &mut self.directions);
        let derivatives = self.problem.told.derivatives(&self.directions);
        let mut all = highest(&derivatives, derivatives.len(), |_| true);
        let mut taken: BTreeMap<usize, usize> = BTreeMap::new();
        all.retain(|&candidate| {
            let own = self.problem.configurations[candidate];
            let times = taken.entry(own).or_default();
            *times += 1;
            let may_be = !is_full || self.problem.mandatory.contains(&own);
            may_be && !here.contains(&own) && *times <= OF_ONE
        });
        all.truncate(count);
        all
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
        let mut derivatives = match listed {
            Listed::These(listed) => told.derivatives_of(&self.directions, listed),
            Listed::All | Listed::AllThatMayHelp => told.derivatives(&self.directions),
        };
        let is_thorough = matches!(listed, Listed::AllThatMayHelp);
        if is_thorough {
            // What is no larger does not help.
            let own = derivatives[from];
            for each in derivatives.iter_mut().filter(|each| **each <= own) {
                *each = f64::NEG_INFINITY;
            }
        }
        derivatives[from] = f64::NEG_INFINITY;
        let rest = self.information(&others);
        let tried = self.tried(is_thorough);
        let best = self.best_addition(&others, &rest, moved, &derivatives, tried);
        if let Some((candidate, cost)) = best
            && cost < found.cost * (1.0 - GAIN)
        {
            found.cost = cost;
            measure(&mut others, candidate, moved);
            found.plan = others;
        }
    }

    /// How many candidates are tried for an exchange.
    fn tried(&self, is_thorough: bool) -> usize {
        match (self.problem.criterion.is_factored(), is_thorough) {
            (true, false) => TRIED,
            (false, false) => TRIED_OF_OTHERS,
            (true, true) => {
                let work = self.problem.told.size().pow(3).max(1);
                THOROUGHLY_TRIED.min(THOROUGH_WORK / work).max(TRIED)
            }
            (false, true) => THOROUGHLY_TRIED_OF_OTHERS,
        }
    }

    /// The candidate that is best measured so often beside a plan, of as many as are tried of those that promise most by their
    /// derivatives, which are finite where they may be; with the cost.
    fn best_addition(
        &mut self,
        plan: &[(usize, u32)],
        rest: &DMatrix<f64>,
        times: u32,
        derivatives: &[f64],
        tried: usize,
    ) -> Option<(usize, f64)> {
        let problem = self.problem;
        let is_full = self.is_full(plan);
        let may_be = |candidate: usize| {
            derivatives[candidate] > f64::NEG_INFINITY
                && (!is_full || problem.reads_in_configuration(plan, candidate))
                && times_in(plan, candidate) + times <= problem.most[candidate]
        };
        let mut best: Option<(usize, f64)> = None;
        for candidate in highest(derivatives, tried, may_be) {
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

fn times_in(plan: &[(usize, u32)], candidate: usize) -> u32 {
    let known = plan.iter().find(|(each, _)| *each == candidate);
    known.map_or(0, |(_, times)| *times)
}
