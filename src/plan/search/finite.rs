//! Plans of a finite list of candidates, and what no plan of them is better than.
//!
//! A plan that measures candidate i so often as `n_i` has M = M0 + sum `n_i` `I_i`, where repeats tell `I_i` each at most. The
//! costs phi of [`Criterion::bounded_as`] are convex in M and of degree -1, so that with any M* and G = -d phi/dM there
//!
//! ```text
//! phi(M) >= phi(M*)^2 / trace(G M),    trace(G M) <= trace(G M0) + sum of the m largest trace(G I_i),
//! ```
//!
//! where each may stand in the sum as often as it may be measured. All candidates are looked through, so that nothing rests on
//! a search: that is the theorem of the approximate design with a finite set for its region. M* is that of the best
//! approximate design of the candidates and, where each may be measured a few times only, that of weights which know of it.
//!
//! Candidates of one configuration that share errors may tell more together than the sum of each: [`TogetherBounds`].

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;

use super::candidate_error::CandidateError;
use super::candidate_information::CandidateInformation;
use super::problem::determines;
use super::weighing::{Weighing, drop_light, normalise};
use crate::plan::{Criterion, CriterionFunction};
use crate::quantities::limits::MOST_EXPERIMENTS;

/// Rounds of adding candidates and weighing them.
const ROUNDS: usize = 100;
/// The rounds end when no candidate adds more than this share.
const TOLERANCE: f64 = 1e-4;
/// Candidates that are added in one round.
const ADDED: usize = 8;
/// Weights below this are dropped.
const SMALLEST_WEIGHT: f64 = 1e-7;
/// Rounding in all that a bound is computed from, as a share of it.
const ALLOWANCE: f64 = 1e-7;
/// Steps towards the best weights where each candidate has a largest one.
const LIMITED_STEPS: usize = 120;
/// They end when the bound is so near.
const NEAR: f64 = 1e-3;

/// What a plan of a list of candidates is for.
pub struct FiniteProblem<'a> {
    /// What makes a plan good.
    pub criterion: Criterion,
    /// C^T (p x r): [`CriterionFunction::new`].
    pub test_poses: DMatrix<f64>,
    /// M0 (p x p): what is known whatever is chosen.
    pub beside: DMatrix<f64>,
    /// What one measurement of each candidate tells.
    pub told: CandidateInformation,
    /// How often each may be measured.
    pub most: Vec<u32>,
    /// The number of each one's configuration.
    pub configurations: Vec<usize>,
    /// Those of them that are measured whatever is chosen.
    pub mandatory: BTreeSet<usize>,
    /// Where candidates of one configuration share errors, what they tell together, beside what is measured there whatever is chosen.
    pub told_together: Option<Box<ToldTogether<'a>>>,
    /// What those of one configuration tell at most together, where several may be chosen that tell more than by themselves; none
    /// where plans are bounded that have one in each.
    pub bounds: Option<&'a TogetherBounds>,
}

/// What candidates tell together that are measured so often (p x p).
pub type ToldTogether<'a> = dyn Fn(&[(usize, u32)]) -> DMatrix<f64> + Send + Sync + 'a;

/// What candidates of one configuration tell at most: something once, and something for each measurement.
#[derive(Debug, Clone)]
pub struct TogetherBounds {
    /// The candidates of each configuration that has several.
    pub groups: Vec<Vec<usize>>,
    /// What is added once for each group.
    pub once: CandidateInformation,
    /// What is added for each measurement: of all candidates in groups, one after the other.
    pub each: CandidateInformation,
}

impl TogetherBounds {
    /// Raises the derivatives of candidates to what a measurement adds at most: alone, or as one of two or more of several
    /// candidates of its configuration.
    fn raise(&self, directions: &DMatrix<f64>, derivatives: &mut [f64]) {
        let once = self.once.derivatives(directions);
        let each = self.each.derivatives(directions);
        let mut rest = each.as_slice();
        for (group, once) in self.groups.iter().zip(once) {
            let (own, others) = rest.split_at(group.len());
            rest = others;
            let together = 0.5 * once + own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            for &candidate in group {
                derivatives[candidate] = derivatives[candidate].max(together);
            }
        }
    }
}

/// A tangent plane of 1/phi, which bounds phi from below.
#[derive(Debug, Clone, PartialEq)]
struct TangentPlane {
    /// phi(M*).
    cost: f64,
    /// trace(G M0).
    beside: f64,
    /// The largest trace(G I), in falling order, and how often each may stand in a plan.
    largest: Vec<(f64, u32)>,
}

impl TangentPlane {
    fn least_cost(&self, measurements: u32) -> f64 {
        let mut left = measurements;
        let mut sum = self.beside;
        for &(derivative, most) in &self.largest {
            let many = most.min(left);
            sum += f64::from(many) * derivative.max(0.0);
            left -= many;
            if left == 0 {
                break;
            }
        }
        self.cost * self.cost / sum * (1.0 - ALLOWANCE)
    }
}

/// What no plan of a list of candidates is below, by the number of measurements.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FiniteBound {
    planes: Vec<TangentPlane>,
}

impl FiniteBound {
    /// No plan of so many measurements of the candidates has a smaller cost; none where there is no such bound.
    pub fn least_cost(&self, measurements: u32) -> Option<f64> {
        let planes = self.planes.iter();
        let costs = planes.map(|plane| plane.least_cost(measurements));
        costs.filter(|cost| cost.is_finite()).reduce(f64::max)
    }
}

/// Candidates by their places, and how often each is measured.
pub type CandidatePlan = Vec<(usize, u32)>;

/// Candidates with their weights, which sum to one.
pub type FiniteWeights = Vec<(usize, f64)>;

impl FiniteProblem<'_> {
    /// Whether a plan reads in a candidate's configuration, or does so whatever is chosen.
    pub(super) fn reads_in_configuration(&self, plan: &[(usize, u32)], candidate: usize) -> bool {
        let here = self.configurations[candidate];
        self.mandatory.contains(&here)
            || (plan.iter()).any(|&(each, _)| self.configurations[each] == here)
    }

    /// The criterion as a cost.
    pub fn cost(&self) -> CriterionFunction {
        self.cost_of(self.criterion)
    }

    fn cost_of(&self, criterion: Criterion) -> CriterionFunction {
        CriterionFunction::new(criterion, self.test_poses.clone())
    }

    /// Adds (or takes away) what candidates tell that are measured so often: of one configuration, where they share errors.
    fn add(&self, sum: &mut DMatrix<f64>, sign: f64, measured: &[(usize, u32)]) {
        let is_mandatory = |each: usize| self.mandatory.contains(&self.configurations[each]);
        let is_alone = matches!(*measured, [(each, 1)] if !is_mandatory(each));
        match &self.told_together {
            Some(told) if !is_alone => *sum += told(measured) * sign,
            _ => {
                for &(candidate, times) in measured {
                    self.told.add_to(sum, candidate, sign * f64::from(times));
                }
            }
        }
    }

    /// What a plan tells, with what is known whatever is chosen.
    pub fn information(&self, plan: &[(usize, u32)]) -> DMatrix<f64> {
        let mut sum = self.beside.clone();
        if self.told_together.is_none() {
            self.add(&mut sum, 1.0, plan);
            return sum;
        }
        for part in by_configuration(plan, &self.configurations) {
            self.add(&mut sum, 1.0, &part);
        }
        sum
    }

    /// The same of a plan with so many measurements of a candidate more, from what the plan tells.
    pub(super) fn with(
        &self,
        rest: &DMatrix<f64>,
        plan: &[(usize, u32)],
        more: (usize, u32),
    ) -> DMatrix<f64> {
        let mut sum = rest.clone();
        let own = self.configurations[more.0];
        let mut here = match self.told_together {
            Some(_) => plan.to_vec(),
            None => Vec::new(),
        };
        here.retain(|&(each, _)| self.configurations[each] == own);
        if !here.is_empty() {
            self.add(&mut sum, -1.0, &here);
        }
        measure(&mut here, more.0, more.1);
        self.add(&mut sum, 1.0, &here);
        sum
    }

    /// The cost of a plan, where it determines what the criterion asks for, beyond rounding.
    pub(super) fn cost_of_plan(&self, plan: &[(usize, u32)]) -> Option<f64> {
        let information = self.information(plan);
        let cost = self.cost().cost(&information, &mut information.clone());
        let is_determined = cost.is_finite()
            && determines(&information, self.criterion, &self.test_poses, cost.sqrt());
        is_determined.then_some(cost)
    }

    /// Whether there can be plans of so many measurements in so many different configurations.
    ///
    /// # Errors
    /// The candidates are too few.
    pub(super) fn check(
        &self,
        measurements: u32,
        configurations: u32,
    ) -> Result<(), CandidateError> {
        let mut most: BTreeMap<usize, u64> = BTreeMap::new();
        for (configuration, each) in self.configurations.iter().zip(&self.most) {
            *most.entry(*configuration).or_default() += u64::from(*each);
        }
        let (always, others): (Vec<_>, Vec<_>) =
            (most.into_iter()).partition(|(each, _)| self.mandatory.contains(each));
        let mut others: Vec<u64> = others.into_iter().map(|(_, most)| most).collect();
        others.sort_unstable_by(|one, other| other.cmp(one));
        let all = always.into_iter().map(|(_, most)| most);
        let all = all.chain(others.into_iter().take(configurations as usize));
        let allowed: u64 = all.map(|each| each.min(measurements.into())).sum();
        if allowed < u64::from(measurements) {
            let problem = format!(
                "the candidates allow {allowed} measurements, and {measurements} are wanted"
            );
            return Err(CandidateError::new(problem, None));
        }
        Ok(())
    }

    /// The best weights for plans of so many measurements, and what follows from them for all plans; no weights for
    /// criteria that have no such design.
    ///
    /// # Errors
    /// The candidates do not determine what is asked for.
    pub fn weigh(&self, measurements: u32) -> Result<(FiniteWeights, FiniteBound), CandidateError> {
        let measurements = f64::from(measurements.max(1));
        let mean = self.told.mean() + &self.beside / measurements;
        let mut directions = mean.clone();
        let bounded = self.criterion.bounded_as();
        let mut cost = self.cost_of(bounded.unwrap_or(self.criterion));
        if cost.cost(&mean, &mut directions).is_infinite() {
            return Err(CandidateError::undetermined());
        }
        let mut support = self.spread(&mean);
        if bounded.is_none() {
            let weight = (support.len() as f64).recip();
            let weights = support.into_iter().map(|candidate| (candidate, weight));
            return Ok((weights.collect(), FiniteBound::default()));
        }
        let is_informed = self.beside.amax() > 0.0;
        let beside = is_informed.then(|| &self.beside / measurements);
        let mut weighing = Weighing::new(cost, beside, self.told.size());
        for candidate in highest(&self.told.derivatives(&directions), ADDED, |_| true) {
            if !support.contains(&candidate) {
                support.push(candidate);
            }
        }
        let mut weights = vec![(support.len() as f64).recip(); support.len()];
        let mut bound = FiniteBound::default();
        for _ in 0..ROUNDS {
            let blocks: Vec<DMatrix<f64>> =
                support.iter().map(|&each| self.told.of(each)).collect();
            let cost = weighing.weigh(&blocks, &mut weights, 0.1 * TOLERANCE);
            if !cost.is_finite() {
                return Err(CandidateError::undetermined());
            }
            let derivatives = self.told.derivatives(&weighing.directions);
            bound.planes = vec![self.plane(cost, &weighing.directions, &derivatives)];
            drop_light(&mut support, &mut weights, SMALLEST_WEIGHT);
            let least = weighing.mean * (1.0 + TOLERANCE);
            let is_new =
                |candidate: usize| derivatives[candidate] > least && !support.contains(&candidate);
            let new = highest(&derivatives, ADDED, is_new);
            if new.is_empty() {
                break;
            }
            let weight = (support.len() + new.len()) as f64;
            weights.extend(new.iter().map(|_| weight.recip()));
            support.extend(new);
            normalise(&mut weights);
        }
        normalise(&mut weights);
        Ok((support.into_iter().zip(weights).collect(), bound))
    }

    /// What no plan of as many measurements as one has is below, by the best weights, and as that plan tells it besides.
    ///
    /// # Errors
    /// The candidates do not determine what is asked for.
    pub fn bound_of(&self, plan: &[(usize, u32)]) -> Result<FiniteBound, CandidateError> {
        let (_, mut bound) = self.weigh(measurements_in(plan))?;
        self.bound_near(&mut bound, plan);
        Ok(bound)
    }

    /// A bound with what follows from a plan, too, where the criterion has bounds; and where candidates may be measured a few times
    /// only, from weights that know of it.
    pub(super) fn bound_near(&self, bound: &mut FiniteBound, plan: &[(usize, u32)]) {
        let Some(criterion) = self.criterion.bounded_as() else {
            return;
        };
        let measurements = measurements_in(plan);
        if measurements == 0 {
            return;
        }
        let is_limited = self.most.iter().any(|most| *most < measurements);
        let mut function = self.cost_of(criterion);
        let mut information = self.information(plan);
        let mut directions = information.clone();
        let mut best: Option<TangentPlane> = None;
        let steps = if is_limited { LIMITED_STEPS } else { 1 };
        for _ in 0..steps {
            let cost = function.cost(&information, &mut directions);
            if !cost.is_finite() {
                break;
            }
            let derivatives = self.told.derivatives(&directions);
            let plane = self.plane(cost, &directions, &derivatives);
            let least = plane.least_cost(measurements);
            let is_higher = |best: &TangentPlane| least > best.least_cost(measurements);
            if best.as_ref().is_none_or(is_higher) {
                best = Some(plane);
            }
            if least > cost * (1.0 - NEAR) {
                break;
            }
            // Towards the plan that this tangent plane holds for best (Frank and Wolfe).
            let mut towards = self.beside.clone();
            let mut left = measurements;
            for candidate in highest(&derivatives, measurements as usize, |_| true) {
                let times = self.most[candidate].min(left);
                self.told.add_to(&mut towards, candidate, f64::from(times));
                left -= times;
            }
            towards -= &information;
            let length = line_search(&mut function, &information, &towards, cost);
            if length <= 0.0 {
                break;
            }
            information += towards * length;
        }
        bound.planes.extend(best);
    }

    fn plane(&self, cost: f64, directions: &DMatrix<f64>, derivatives: &[f64]) -> TangentPlane {
        let mut derivatives = derivatives.to_vec();
        if let Some(bounds) = self.bounds {
            bounds.raise(directions, &mut derivatives);
        }
        let most = self.most.iter().copied();
        let mut largest: Vec<(f64, u32)> = derivatives.into_iter().zip(most).collect();
        largest.sort_by(|one, other| other.0.total_cmp(&one.0));
        // Plans have no more measurements.
        let mut sum = 0;
        largest.retain(|&(_, most)| {
            let is_needed = sum < u64::from(MOST_EXPERIMENTS);
            sum += u64::from(most);
            is_needed
        });
        TangentPlane {
            cost,
            beside: directions.dot(&self.beside),
            largest,
        }
    }

    /// So many candidates as there are unknowns, each that which tells most where the ones before tell least.
    fn spread(&self, mean: &DMatrix<f64>) -> Vec<usize> {
        let size = self.told.size();
        let mut sum = mean * 1e-6;
        let mut chosen = Vec::new();
        for _ in 0..size {
            let Some(inverse) = sum.clone().cholesky().map(|factor| factor.inverse()) else {
                break;
            };
            let derivatives = self.told.derivatives(&inverse);
            let Some(&best) = highest(&derivatives, 1, |each| !chosen.contains(&each)).first()
            else {
                break;
            };
            self.told.add_to(&mut sum, best, 1.0);
            chosen.push(best);
        }
        chosen
    }
}

/// How many measurements a plan has.
pub fn measurements_in(plan: &[(usize, u32)]) -> u32 {
    plan.iter().map(|(_, times)| times).sum()
}

/// The parts of a plan in each of the candidates' configurations, in the order of their first.
pub(in crate::plan) fn by_configuration(
    plan: &[(usize, u32)],
    configurations: &[usize],
) -> Vec<CandidatePlan> {
    let mut parts: Vec<CandidatePlan> = Vec::new();
    for &(candidate, times) in plan {
        let is_here =
            |part: &&mut CandidatePlan| configurations[part[0].0] == configurations[candidate];
        match parts.iter_mut().find(is_here) {
            Some(part) => part.push((candidate, times)),
            None => parts.push(vec![(candidate, times)]),
        }
    }
    parts
}

/// Measures a candidate so often more.
pub(in crate::plan) fn measure(plan: &mut Vec<(usize, u32)>, candidate: usize, times: u32) {
    match plan.iter_mut().find(|(each, _)| *each == candidate) {
        Some((_, known)) => *known += times,
        None => plan.push((candidate, times)),
    }
}

/// The places of the highest values of those that may be, in falling order; of equal ones the first.
pub(super) fn highest(values: &[f64], count: usize, may_be: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut places: Vec<usize> = (0..values.len()).filter(|&place| may_be(place)).collect();
    keep_highest(values, count, &mut places);
    places
}

/// The same of these places. Sorting is compiled once, and not for every condition.
fn keep_highest(values: &[f64], count: usize, places: &mut Vec<usize>) {
    let order =
        |one: &usize, other: &usize| values[*other].total_cmp(&values[*one]).then(one.cmp(other));
    if count > 0 && places.len() > count {
        places.select_nth_unstable_by(count - 1, order);
    }
    places.truncate(count);
    places.sort_unstable_by(order);
}

/// How far to go along a way (1 is its end) for the lowest cost, which is convex; none where nothing is lower.
fn line_search(
    function: &mut CriterionFunction,
    from: &DMatrix<f64>,
    way: &DMatrix<f64>,
    cost: f64,
) -> f64 {
    const HALVINGS: usize = 14;
    let mut directions = from.clone();
    let mut at = |length: f64| function.cost(&(from + way * length), &mut directions);
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..HALVINGS {
        let [one, other] = [1.0, 2.0].map(|third| low + (high - low) * third / 3.0);
        if at(one) <= at(other) {
            high = other;
        } else {
            low = one;
        }
    }
    let length = 0.5 * (low + high);
    if at(length) < cost { length } else { 0.0 }
}
