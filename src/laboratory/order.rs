//! The order of stops in which the robot moves least.

/// Up to so many stops the best order is found for certain.
const CERTAIN: usize = 9;

/// The order of n places, from a start if there is one, that has the least sum of costs; `cost(i, j)` is that
/// of going from place i to place j, and `from(j)` that of going to j first.
pub fn shortest(
    count: usize,
    from: &dyn Fn(usize) -> f64,
    cost: &dyn Fn(usize, usize) -> f64,
) -> Vec<usize> {
    if count <= CERTAIN {
        return certain(count, from, cost);
    }
    let starts = (0..count).map(|first| improved(nearest(count, first, cost), from, cost));
    starts
        .min_by(|one, other| total(one, from, cost).total_cmp(&total(other, from, cost)))
        .unwrap_or_default()
}

fn total(order: &[usize], from: &dyn Fn(usize) -> f64, cost: &dyn Fn(usize, usize) -> f64) -> f64 {
    let first = order.first().map_or(0.0, |&first| from(first));
    first
        + order
            .windows(2)
            .map(|pair| cost(pair[0], pair[1]))
            .sum::<f64>()
}

/// By dynamic programming over sets of places (Held and Karp).
fn certain(
    count: usize,
    from: &dyn Fn(usize) -> f64,
    cost: &dyn Fn(usize, usize) -> f64,
) -> Vec<usize> {
    if count == 0 {
        return Vec::new();
    }
    let mut best = vec![vec![(f64::INFINITY, 0_usize); count]; 1 << count];
    for last in 0..count {
        best[1 << last][last] = (from(last), last);
    }
    for set in 1..1_usize << count {
        for last in (0..count).filter(|last| set >> last & 1 == 1) {
            let (so_far, _) = best[set][last];
            for next in (0..count).filter(|next| set >> next & 1 == 0) {
                let with = so_far + cost(last, next);
                let place = &mut best[set | 1 << next][next];
                if with < place.0 {
                    *place = (with, last);
                }
            }
        }
    }
    let mut set = (1 << count) - 1;
    let last = (0..count).min_by(|&one, &other| best[set][one].0.total_cmp(&best[set][other].0));
    let mut order = vec![last.unwrap_or(0)];
    while order.len() < count {
        let last = order[order.len() - 1];
        let (_, before) = best[set][last];
        set &= !(1 << last);
        order.push(before);
    }
    order.reverse();
    order
}

/// Always on to the nearest place that is left.
fn nearest(count: usize, first: usize, cost: &dyn Fn(usize, usize) -> f64) -> Vec<usize> {
    let mut order = vec![first];
    let mut left: Vec<usize> = (0..count).filter(|&place| place != first).collect();
    while !left.is_empty() {
        let last = order[order.len() - 1];
        let next = (0..left.len())
            .min_by(|&one, &other| cost(last, left[one]).total_cmp(&cost(last, left[other])));
        order.push(left.remove(next.unwrap_or(0)));
    }
    order
}

/// Turns parts of the order round, and moves single places, as long as that makes it shorter.
fn improved(
    mut order: Vec<usize>,
    from: &dyn Fn(usize) -> f64,
    cost: &dyn Fn(usize, usize) -> f64,
) -> Vec<usize> {
    let count = order.len();
    let mut shortest = total(&order, from, cost);
    loop {
        let before = shortest;
        for first in 0..count {
            for last in 0..count {
                let mut turned = order.clone();
                if first < last {
                    turned[first..=last].reverse();
                } else {
                    let place = turned.remove(first);
                    turned.insert(last, place);
                }
                let length = total(&turned, from, cost);
                if length < shortest - 1e-12 {
                    (order, shortest) = (turned, length);
                }
            }
        }
        if shortest >= before {
            return order;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a line the best order is along it, from the nearer end.
    #[test]
    fn places_on_a_line_are_visited_along_it() {
        for count in [1, 5, 9, 14] {
            let at = |place: usize| ((place * 7 + 3) % count) as f64;
            let order = shortest(count, &|first| at(first) + 0.5, &|one, other| {
                (at(one) - at(other)).abs()
            });
            let along: Vec<f64> = order.iter().map(|&place| at(place)).collect();
            let mut sorted = along.clone();
            sorted.sort_by(f64::total_cmp);
            assert_eq!(along, sorted);
        }
        assert!(shortest(0, &|_| 0.0, &|_, _| 0.0).is_empty());
    }
}
