//! The best choice from a long list of readings that follow unknowns and functions of joints' angles: the greedy choice, random ones and
//! those that are known, bettered by exchanges until none helps.
//!
//! What is minimised is the mean square error of the positions that are not chosen, or of those that cannot be; all candidates are tried
//! for every exchange, which updates of low rank make cheap: see [`KnownOfReadings`].

use std::sync::atomic::{AtomicBool, Ordering};

use rand::seq::index;

use crate::numeric::correlated::{CorrelatedList, KnownOfReadings};
use crate::numeric::random::{generator, streams};

/// Looks at every reading of a choice, at most.
const PASSES: usize = 12;
/// An exchange lowers the cost by more than this share.
const GAIN: f64 = 1e-4;
/// So many positions, sampled from all, are predicted at most,
const MOST_WANTED: usize = 300;
/// of which so many covariances with rows of readings are kept at most.
const MOST_NUMBERS: usize = 8_000_000;
/// Searches end alike where their costs differ by no more than this share: 0.1 % of the error.
const AGREEING: f64 = 2e-3;

/// A choice from a list.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelatedChoice {
    /// The readings in rising order, each as often as it is taken.
    pub chosen: Vec<usize>,
    /// How many searches there were, and how many ended within 0.1 %.
    pub searches: [usize; 2],
}

/// The best choice of so many readings, by so many searches, the first by greed and the others from random choices, and by going on from
/// choices that are known, which may be smaller; a function of these and the seed alone, unless it is stopped. None where the list has
/// fewer, or where numbers have no factorisation.
pub fn best_choice(
    list: &CorrelatedList,
    size: usize,
    searches: usize,
    known: &[Vec<usize>],
    seed: u64,
    stop: &AtomicBool,
) -> Option<CorrelatedChoice> {
    let offered = (list.most.iter()).fold(0_u32, |sum, most| sum.saturating_add(*most));
    if size > offered as usize {
        return None;
    }
    let all = list.readings.len();
    let mut nothing = KnownOfReadings::before(list, &wanted_of(list, seed), size + list.known);
    for (place, read) in (all - list.known..all).enumerate() {
        nothing.add(size + place, read)?;
    }
    let sampled = |search: usize| {
        let mut random = generator(seed, streams::candidate_search(search as u64));
        index::sample(&mut random, list.most.len(), size.min(list.most.len())).into_vec()
    };
    let greedy = (searches > 0).then(Vec::new);
    let starts = (greedy.into_iter())
        .chain((1..searches).map(sampled))
        .chain(known.iter().cloned());
    let mut found: Vec<(f64, Vec<usize>)> = Vec::new();
    for start in starts {
        if !found.is_empty() && stop.load(Ordering::Relaxed) {
            break;
        }
        found.extend(improved(&nothing, size, start, stop));
    }
    let best = (found.iter()).min_by(|one, other| one.0.total_cmp(&other.0))?;
    let is_as_good = |each: &&(f64, Vec<usize>)| each.0 <= best.0 * (1.0 + AGREEING);
    let mut chosen = best.1.clone();
    chosen.sort_unstable();
    Some(CorrelatedChoice {
        chosen,
        searches: [found.len(), found.iter().filter(is_as_good).count()],
    })
}

/// The readings whose positions are predicted, in rising order: those that cannot be chosen, or else some of all.
fn wanted_of(list: &CorrelatedList, seed: u64) -> Vec<usize> {
    let others = list.most.len()..list.readings.len() - list.known;
    if !others.is_empty() {
        return others.collect();
    }
    let rows = list.readings.iter().map(|each| each.new.nrows());
    let most = MOST_NUMBERS / (3 * rows.sum::<usize>()).max(1);
    let count = list.readings.len().min(most.clamp(1, MOST_WANTED));
    let mut random = generator(seed, streams::candidate_search(0));
    let mut wanted = index::sample(&mut random, list.readings.len(), count).into_vec();
    wanted.sort_unstable();
    wanted
}

/// Fills a choice up with what helps most, then exchanges; with its cost.
fn improved(
    nothing: &KnownOfReadings<'_>,
    size: usize,
    start: Vec<usize>,
    stop: &AtomicBool,
) -> Option<(f64, Vec<usize>)> {
    let filled = start.len();
    let mut known = nothing.informed(start)?;
    for place in filled..size {
        let (best, _) = known.most_helpful()?;
        known.add(place, best)?;
    }
    for _ in 0..PASSES {
        let before = known.cost();
        for place in 0..size {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            let cost = known.cost();
            let own = known.remove(place)?;
            let (best, least) = known.most_helpful()?;
            let is_better = least < cost * (1.0 - GAIN);
            known.add(place, if is_better { best } else { own })?;
        }
        // Updates lose digits.
        known = nothing.informed(known.chosen().take(size))?;
        if known.cost() >= before * (1.0 - GAIN) {
            break;
        }
    }
    Some((known.cost(), known.chosen().take(size).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::correlated::tests::list;

    /// No exchange betters what is found.
    #[test]
    fn no_exchange_helps() {
        let list = list();
        let all: Vec<usize> = (0..list.readings.len()).collect();
        let nothing = KnownOfReadings::before(&list, &all, 4);
        let cost = |chosen: &[usize]| {
            let known = nothing.informed(chosen.iter().copied());
            known.expect("regular").cost()
        };
        let stop = AtomicBool::new(false);
        let choice = best_choice(&list, 4, 3, &[], 1, &stop).expect("a choice");
        let chosen = choice.chosen;
        let found = cost(&chosen);
        for place in 0..chosen.len() {
            for &other in all.iter().filter(|other| !chosen.contains(other)) {
                let mut exchanged = chosen.clone();
                exchanged[place] = other;
                assert!(
                    cost(&exchanged) >= found * (1.0 - 2.0 * GAIN),
                    "{exchanged:?}"
                );
            }
        }
    }
}
