//! One search for an exact design from random plans: exchange over a pool of random experiments, then
//! refinement.

use rand::{Rng, RngExt};

use super::local::Precision;
use super::point::Point;
use super::pool::Pool;
use super::refinement::{Found, Refinement};

/// Random experiments in the pool of one search.
const POOL: usize = 200;
/// Random plans that exchange starts from in one search, divided by the number of configurations,
const STARTS: usize = 36;
/// but at least so many.
const FEWEST_STARTS: usize = 4;
/// How many of the different plans that these end in are refined.
const REFINED: usize = 8;
/// The most sweeps over the experiments of one plan that exchange them.
const EXCHANGES: usize = 20;
/// An exchange must lower the cost by this share.
const WORTHWHILE: f64 = 1e-3;

impl Refinement<'_> {
    /// One search of the best plan of `measurements` in so many configurations, with random numbers of its own: exchanges
    /// experiments of random plans over a pool of random experiments and the given ones, and refines the best plans that this
    /// ends in. `None` if it meets no plan that determines the compliances, or none may go elsewhere than to mandatory ones.
    pub fn search(
        &mut self,
        given: &[Point],
        measurements: u32,
        configurations: u32,
        random: &mut impl Rng,
    ) -> Option<Found> {
        if configurations == 0 && measurements > 0 {
            return None;
        }
        let drawn: Vec<Point> = (0..POOL)
            .map_while(|_| self.sampler.draw_inside(random))
            .collect();
        let mut pool = Pool::new(self.problem, [given, &drawn].concat());
        let starts = (STARTS / configurations.max(1) as usize).max(FEWEST_STARTS);
        let end = |_: usize| {
            let repeats = split(measurements, configurations, random);
            let start = self.random_plan(&mut pool, repeats, random)?;
            let end = self.exchange(&mut pool, start);
            end.cost.is_finite().then_some(end)
        };
        let mut ends: Vec<Found> = (0..starts).filter_map(end).collect();
        ends.sort_by(|one, other| one.cost.total_cmp(&other.cost));
        ends.dedup_by(|one, other| one.cost < other.cost * (1.0 + 1e-6));
        ends.truncate(REFINED);
        let mut best: Option<Found> = None;
        for end in ends {
            let lowest = best.as_ref().map_or(f64::INFINITY, |best| best.cost);
            let found = self.refine(end, Precision::ROUGH, lowest);
            if found.cost < lowest {
                best = Some(found);
            }
        }
        best
    }

    /// A plan of random experiments of the pool.
    fn random_plan(
        &mut self,
        pool: &mut Pool,
        repeats: Vec<u32>,
        random: &mut impl Rng,
    ) -> Option<Found> {
        let mut points = Vec::new();
        while points.len() < repeats.len() {
            let count = pool.points.len();
            let index = (count > 0).then(|| random.random_range(0..count))?;
            points.extend(self.take_clear(pool, index));
        }
        Some(self.plan(points, repeats))
    }

    /// Exchanges the experiments of a plan in turn for the best ones of the pool, until nothing more
    /// is gained. Experiments that prove not to be clear of collisions leave the pool.
    fn exchange(&mut self, pool: &mut Pool, mut found: Found) -> Found {
        let mut information = self.mandatory.clone();
        for _ in 0..EXCHANGES {
            let mut improved = false;
            for index in 0..found.points.len() {
                self.total(&found, Some(index), &mut information);
                let weight = self.worth_of_repeats(&found.points[index], found.repeats[index]);
                while let Some((better, cost)) = {
                    let function = &mut self.work.borrow_mut().cost;
                    pool.best_addition(function, &information, weight)
                } && cost < found.cost * (1.0 - WORTHWHILE)
                {
                    if let Some(point) = self.take_clear(pool, better) {
                        let point = self.apart(point, &found.points);
                        let cost = self.cost_in_place(&found, index, &point, &information, cost);
                        if cost < found.cost {
                            found.points[index] = point;
                            found.cost = cost;
                            improved = true;
                        }
                        break;
                    }
                }
            }
            self.total(&found, None, &mut information);
            if !self.move_repeat(&mut found, &information) && !improved {
                break;
            }
        }
        found
    }

    /// An experiment of the pool, clear of collisions and in sight; if that is impossible, it leaves
    /// the pool.
    fn take_clear(&mut self, pool: &mut Pool, index: usize) -> Option<Point> {
        let clear = self.sampler.clear_variant(&pool.points[index]);
        match &clear {
            Some(point) => pool.points[index] = point.clone(),
            None => pool.remove(index),
        }
        clear
    }
}

/// Shares m measurements at random among c configurations.
fn split(measurements: u32, configurations: u32, random: &mut impl Rng) -> Vec<u32> {
    let mut repeats = vec![1; configurations as usize];
    let shares: Vec<f64> = repeats.iter().map(|_| random.random::<f64>()).collect();
    for _ in configurations..measurements {
        // To the one that has least of its share.
        let has = |index: usize| f64::from(repeats[index]) / shares[index];
        let least = (0..shares.len()).min_by(|&one, &other| has(one).total_cmp(&has(other)));
        if let Some(least) = least {
            repeats[least] += 1;
        }
    }
    repeats
}
