//! The best choice from a long list of readings that each inform few of many unknowns: the greedy choice and random ones, bettered by
//! exchanges until none helps.
//!
//! All candidates are tried for every exchange, which updates of low rank make cheap: see [`LowRankList`].

use std::sync::atomic::{AtomicBool, Ordering};

use rand::seq::index;
use rayon::prelude::*;

use crate::numeric::low_rank::{LowRankList, UpdatedCovariance};
use crate::numeric::random::{generator, streams};

/// Looks at every reading of a choice, at most.
const PASSES: usize = 12;
/// An exchange lowers the cost by more than this share.
const GAIN: f64 = 1e-6;

/// The best choice of so many different candidates, in rising order; a function of the list, the size and the seed alone,
/// unless it is stopped. None where the list is shorter, or where numbers have no factorisation.
pub fn best_choice(
    list: &LowRankList,
    size: usize,
    searches: usize,
    seed: u64,
    stop: &AtomicBool,
) -> Option<Vec<usize>> {
    if size > list.candidates.len() {
        return None;
    }
    let found = (0..searches.max(1)).into_par_iter().map(|search| {
        let mut start = Vec::new();
        if search > 0 {
            let mut random = generator(seed, streams::candidate_search(search as u64));
            start = index::sample(&mut random, list.candidates.len(), size).into_vec();
        }
        improved(list, size, start, stop)
    });
    let found: Vec<Option<(f64, Vec<usize>)>> = found.collect();
    let best = (found.into_iter().flatten()).min_by(|one, other| one.0.total_cmp(&other.0));
    best.map(|(_, chosen)| chosen)
}

/// Fills a choice up with what helps most, then exchanges; with trace(N P).
fn improved(
    list: &LowRankList,
    size: usize,
    mut chosen: Vec<usize>,
    stop: &AtomicBool,
) -> Option<(f64, Vec<usize>)> {
    let mut known = list.informed(&chosen)?;
    while chosen.len() < size {
        let (best, _) = most_gain(list, &known, &chosen)?;
        known.update(&list.candidates[best], true);
        chosen.push(best);
    }
    for _ in 0..PASSES {
        // Updates lose digits.
        known = list.informed(&chosen)?;
        let before = known.cost;
        for place in 0..size {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            let cost = known.cost;
            let own = &list.candidates[chosen[place]];
            known.update(own, false);
            let (best, gain) = most_gain(list, &known, &chosen)?;
            if known.cost - gain < cost * (1.0 - GAIN) {
                known.update(&list.candidates[best], true);
                chosen[place] = best;
            } else {
                known.update(own, true);
            }
        }
        if known.cost >= before * (1.0 - GAIN) {
            break;
        }
    }
    chosen.sort_unstable();
    Some((list.informed(&chosen)?.cost, chosen))
}

/// The candidate that helps most of those that are not chosen, and by how much the cost falls.
fn most_gain(
    list: &LowRankList,
    known: &UpdatedCovariance,
    chosen: &[usize],
) -> Option<(usize, f64)> {
    let gains: Vec<f64> = (list.candidates.par_iter())
        .map(|candidate| known.gain(candidate))
        .collect();
    let gains = gains.into_iter().enumerate();
    let others = gains.filter(|(candidate, _)| !chosen.contains(candidate));
    others.max_by(|one, other| one.1.total_cmp(&other.1).then(other.0.cmp(&one.0)))
}
