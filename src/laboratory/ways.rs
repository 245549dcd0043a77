//! Ways between configurations: straight where that is clear, else over safe poses.

use std::collections::BTreeMap;

use nalgebra::DVector;
use rand::RngExt;

use super::PathJudge;
use crate::numeric::random::generator;
use crate::numeric::random::streams::{FIXED_SEED, SAFE_POSES};
use crate::numeric::tolerance::ends;
use crate::robot::Load;
use crate::task::Task;

/// Random safe poses that a way may lead over, beside those of the laboratory.
const RANDOM: usize = 60;
/// How many random configurations are tried for them.
const TRIED: usize = 600;
/// A stop at a safe pose of the laboratory counts as so much more way (rad),
const STOP: f64 = 0.2;
/// and one at a random one as so much.
const RANDOM_STOP: f64 = 0.6;
/// So many straight moves are looked at for one way.
const LOOKS: usize = 250;
/// Random safe poses lie at most so far (rad, m) beyond the configurations of the plan.
const MARGIN: f64 = 0.5;

/// A way to a configuration.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Way {
    /// The safe poses on the way (rad, m).
    pub via: Vec<DVector<f64>>,
    /// How far the joint that moves most moves, all in all (rad, m).
    pub length: f64,
}

/// Finds ways; keeps what it has found out about safe poses.
#[derive(Debug)]
pub struct Ways<'a> {
    judge: PathJudge<'a>,
    /// Safe poses, those of the laboratory first.
    nodes: Vec<DVector<f64>>,
    given: usize,
    /// Whether the straight move between two of them is clear, by what hangs on the robot.
    between: BTreeMap<usize, BTreeMap<(usize, usize), bool>>,
}

/// How far apart configurations are for a robot whose joints start and end together (rad, m).
pub fn apart(one: &DVector<f64>, other: &DVector<f64>) -> f64 {
    (one - other).amax()
}

impl<'a> Ways<'a> {
    /// Ways of a task's robot among configurations; `safe_poses` are those of its laboratory.
    pub fn new(task: &'a Task, safe_poses: &[DVector<f64>], among: &[DVector<f64>]) -> Self {
        let mut judge = PathJudge::new(task);
        let mut nodes = safe_poses.to_vec();
        let given = nodes.len();
        if judge.looks() {
            nodes.extend(random_poses(task, &mut judge, among));
        }
        Self {
            judge,
            nodes,
            given,
            between: BTreeMap::new(),
        }
    }

    /// The judge of straight moves.
    pub fn judge(&mut self) -> &mut PathJudge<'a> {
        &mut self.judge
    }

    /// The way from one configuration to another under each of the loads, of which `hanging` is the number
    /// by which they are known; none if none is found.
    pub fn find(
        &mut self,
        from: &DVector<f64>,
        to: &DVector<f64>,
        loads: &[Load],
        hanging: usize,
    ) -> Option<Way> {
        let nodes = self.nodes.len();
        let mut places = self.nodes.clone();
        places.extend([from.clone(), to.clone()]);
        let mut known = self.between.remove(&hanging).unwrap_or_default();
        let mut found = None;
        for _ in 0..LOOKS {
            let Some(path) = shortest(&places, self.given, &known) else {
                break;
            };
            let is_clear = path.windows(2).all(|edge| {
                let (one, other) = (edge[0].min(edge[1]), edge[0].max(edge[1]));
                *known.entry((one, other)).or_insert_with(|| {
                    let [one, other] = [one, other].map(|place| places[place].as_slice());
                    self.judge.is_straight_clear(one, other, loads)
                })
            });
            if is_clear {
                let all: Vec<&DVector<f64>> = path.iter().map(|&place| &places[place]).collect();
                let length = all.windows(2).map(|pair| apart(pair[0], pair[1])).sum();
                let via = all[1..all.len() - 1].iter().map(|&place| place.clone());
                found = Some(Way {
                    via: via.collect(),
                    length,
                });
                break;
            }
        }
        // What is known of the two ends is of no use for others.
        known.retain(|(_, other), _| *other < nodes);
        self.between.insert(hanging, known);
        found
    }
}

/// The shortest way to the last place from the one before it, over moves that are not known to be blocked (Dijkstra), as places:
/// the first so many are the laboratory's.
fn shortest(
    places: &[DVector<f64>],
    given: usize,
    known: &BTreeMap<(usize, usize), bool>,
) -> Option<Vec<usize>> {
    let (start, end) = (places.len() - 2, places.len() - 1);
    let stop = |place: usize| match place {
        place if place >= start => 0.0,
        place if place < given => STOP,
        _ => RANDOM_STOP,
    };
    let mut distance = vec![f64::INFINITY; end + 1];
    let mut before = vec![None; end + 1];
    let mut open = vec![true; end + 1];
    distance[start] = 0.0;
    loop {
        let nearest = (0..=end)
            .filter(|&place| open[place] && distance[place].is_finite())
            .min_by(|&one, &other| distance[one].total_cmp(&distance[other]))?;
        if nearest == end {
            break;
        }
        open[nearest] = false;
        for next in (0..=end).filter(|&next| next != nearest) {
            let far = distance[nearest] + apart(&places[nearest], &places[next]) + stop(next);
            let edge = (nearest.min(next), nearest.max(next));
            if open[next] && far < distance[next] && known.get(&edge) != Some(&false) {
                distance[next] = far;
                before[next] = Some(nearest);
            }
        }
    }
    let mut path = vec![end];
    while let Some(place) = before[path[path.len() - 1]] {
        path.push(place);
    }
    path.reverse();
    Some(path)
}

/// To a tenth of a degree, which people read more easily.
fn rounded(angle_rad: f64) -> f64 {
    ((angle_rad.to_degrees() * 10.0).round() / 10.0).to_radians()
}

/// Random configurations in the joints' ranges and not far from those of the plan, clear of all.
fn random_poses(
    task: &Task,
    judge: &mut PathJudge<'_>,
    among: &[DVector<f64>],
) -> Vec<DVector<f64>> {
    let joints = &task.belief.nominal.chain.joints;
    let ranges: Vec<(f64, f64)> = (joints.iter().enumerate())
        .map(|(joint, limits)| {
            let [low, high] = limits.range_rad;
            let [least, most] = ends(among.iter().map(|q| q[joint]));
            let [least, most] = [least - MARGIN, most + MARGIN];
            (least.max(low).min(high), most.min(high).max(low))
        })
        .collect();
    let passive = |joint: usize| joints[joint].drive.passive_at;
    let mut random = generator(FIXED_SEED, SAFE_POSES);
    let mut found = Vec::new();
    for _ in 0..TRIED {
        let angles = ranges.iter().enumerate().map(|(joint, &(low, high))| {
            let share: f64 = random.random();
            passive(joint).unwrap_or_else(|| rounded(low + share * (high - low)))
        });
        let q = DVector::from_iterator(ranges.len(), angles);
        if judge.is_clear(q.as_slice(), &Load::NONE) {
            found.push(q);
        }
        if found.len() == RANDOM {
            break;
        }
    }
    found
}
