//! Branch and bound: boxes are halved until no derivative in any of them is above a threshold.

use rayon::prelude::*;

use super::chain::Chain;
use super::domain::{Domain, LoadCase};
use super::enclosure::{Cell, DEEPEST, ProofTask};
use super::judgement::{Judgement, judge};
use super::question::{ProofLoads, Question};
use super::taylor::{LANES, ModelWorkspace};
use super::tree::{ProofObject, Record};

/// How far above the largest derivative found the threshold is, one after another.
const GAPS: [f64; 6] = [0.3, 0.1, 0.03, 0.01, 0.003, 0.001];
/// The same before these, where the covariance of readings depends on the configuration, which takes many more boxes.
const WIDE_GAPS: [f64; 2] = [3.0, 1.0];
/// A proof that has no first result after this share of its boxes is given up: it would not come near.
const FIRST_SHARE: u64 = 2;
/// Boxes that a thread takes at a time, and how many it looks at before it gives back what is left. Results
/// depend on them, but on nothing that changes from run to run.
const TAKEN: usize = 16;
const LOOKS: usize = 128;
/// Threads' shares of a round.
const SHARES: usize = 32;
/// To choose a middle frame: parts of the region, how often each of their variables is halved, how many boxes
/// are looked at in each, and the threshold as a multiple of the largest derivative found.
const TRIALS: u64 = 16;
const TRIAL_DEPTH: u8 = 2;
const TRIAL_BOXES: usize = 400;
const TRIAL_GAP: f64 = 1.3;
/// How far a proof shall go.
#[derive(Clone, Copy)]
pub struct ProofLimits<'a> {
    /// The gap at which it ends, as a share of the largest derivative found.
    pub gap: f64,
    /// The number of boxes after which it ends.
    pub boxes: u64,
    /// Whether it is recorded, so that it can be checked.
    pub records: bool,
    /// Asked now and then whether to end.
    pub stop: &'a (dyn Fn() -> bool + Sync),
    /// Hears of the gap that is proved so far and the number of boxes.
    pub progress: &'a (dyn Fn(Option<f64>, u64) + Sync),
}

/// What was proved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proved {
    /// No derivative in the region is above this.
    pub largest: f64,
    /// The largest derivative that is known.
    pub found: f64,
    /// The number of boxes looked at.
    pub boxes: u64,
}

impl Proved {
    /// How far the proved bound is above the largest derivative found, as a share of it.
    pub fn gap(&self) -> f64 {
        self.largest / self.found - 1.0
    }
}

/// Why nothing can be proved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoProof {
    /// Too many variables, or too large angles.
    #[error("the proof takes at most 8 variables, of at most 60 rad")]
    TooLarge,
    /// The bound is by another criterion than the accuracy at the test poses.
    #[error("bounds of rho0 alone are proved: by any other criterion, the bound rests on searches")]
    Criterion,
    /// Plans have mandatory experiments.
    #[error("there is no proof beside mandatory experiments: the bound rests on searches")]
    Mandatory,
    /// More than hinges that are commanded, measured rotations, or limited torques.
    #[error(
        "there is no proof for arms with springs beside the joints' own, slides or passive joints, nor where rotations are measured or \
         joint_torque_max_nm is given: the bound rests on searches"
    )]
    Springs,
    /// The task's load turns with the tool.
    #[error(
        "there is no proof where a test pose has its load in the tool's frame (tool_force_n), which turns with the tool: the bound rests on \
         searches; with force_n there is one"
    )]
    TurningLoad,
    /// Displacements along a direction are read.
    #[error(
        "there is no proof where a gauge reads displacements along a direction: the bound rests on searches"
    )]
    Gauge,
    /// More is uncertain than the instrument's noise.
    #[error(
        "the proof knows the instrument's noise alone; with --noise-only there is a proof without the other uncertainties"
    )]
    Uncertain,
    /// What compensation leaves depends on where the arm rests.
    #[error(
        "backlash that loads cross makes the residual error depend on the equilibrium, which the proof does not model; with \
         --noise-only there is a proof without the other uncertainties"
    )]
    RestsElsewhere,
    /// There is no B.
    #[error("the information of the approximate design is singular")]
    Singular,
    /// The first nested model was not reached.
    #[error("the proof ended before its first result")]
    Unfinished,
}

/// A box with what is known of it.
#[derive(Debug, Clone, Copy)]
struct Open {
    task: usize,
    cell: Cell,
    largest: f64,
    halve: usize,
}

/// What a thread's share of a round gave.
struct Share {
    left: Vec<(usize, Cell)>,
    kept: Vec<Open>,
    looks: u64,
    found: f64,
    /// What is known of each box, where asked for.
    known: Vec<(usize, Cell, Judgement)>,
}

/// Bounds the largest derivative over all experiments of a question, of which one is known, nested model by nested model; with the
/// proof as an object that can be checked, where asked for.
///
/// # Errors
/// The question is too large, or nothing was proved in time.
pub fn prove(
    question: &Question,
    found: f64,
    effort: ProofLimits<'_>,
) -> Result<(Proved, Option<ProofObject>), NoProof> {
    let mut record = effort.records.then(Record::default);
    let mut tasks = tasks(question).ok_or(NoProof::TooLarge)?;
    for task in &mut tasks {
        choose_middle(task, found);
    }
    let proved = climb(question, &tasks, found, effort, record.as_mut())?;
    let object = (record.as_ref())
        .map(|record| record.object(question, &tasks, proved.largest))
        .map(|object| object.ok_or(NoProof::Unfinished))
        .transpose()?;
    Ok((proved, object))
}

/// Climbs nested model by nested model, and records what is known of every box where asked for.
fn climb(
    question: &Question,
    tasks: &[ProofTask<'_>],
    found: f64,
    effort: ProofLimits<'_>,
    mut record: Option<&mut Record>,
) -> Result<Proved, NoProof> {
    let mut found = found;
    let mut boxes = 0;
    let mut proved = None;
    let mut kept: Vec<Open> = Vec::new();
    let mut stack: Vec<(usize, Cell)> = Vec::new();
    for (index, task) in tasks.iter().enumerate() {
        stack.push((index, task.whole()));
    }
    let wide = (question.spread.iter()).flat_map(|_| WIDE_GAPS);
    let gaps = wide
        .chain(GAPS)
        .filter(|gap| *gap > effort.gap)
        .chain([effort.gap]);
    for gap in gaps {
        let (open, closed) = kept.into_iter().partition(|each| {
            each.largest > found * (1.0 + gap) && each.cell.depth[each.halve] < DEEPEST
        });
        kept = closed;
        let open: Vec<Open> = open;
        for each in &open {
            push_halves(tasks, each, &mut stack);
        }
        while !stack.is_empty() {
            let most = effort.boxes / if proved.is_none() { FIRST_SHARE } else { 1 };
            if boxes >= most || (effort.stop)() {
                return proved.ok_or(NoProof::Unfinished);
            }
            let thresholds = [found * (1.0 + effort.gap), found * (1.0 + gap)];
            let taken = stack.split_off(stack.len().saturating_sub(TAKEN * SHARES));
            let records = record.is_some();
            let shares: Vec<Share> = taken
                .par_chunks(taken.len().div_ceil(SHARES))
                .map_init(
                    || {
                        tasks
                            .iter()
                            .map(|task| ModelWorkspace::new(task.variables()))
                            .collect()
                    },
                    |rooms: &mut Vec<ModelWorkspace>, taken| {
                        share(tasks, rooms, taken, thresholds, records)
                    },
                )
                .collect();
            for share in shares {
                stack.extend(share.left);
                kept.extend(share.kept);
                boxes += share.looks;
                found = found.max(share.found);
                if let Some(record) = record.as_deref_mut() {
                    for (task, cell, judgement) in share.known {
                        record.insert(task, &cell, judgement);
                    }
                }
            }
            (effort.progress)(proved.map(|proved: Proved| proved.gap()), boxes);
        }
        let largest = kept.iter().map(|each| each.largest).fold(0.0, f64::max);
        if largest.is_infinite() {
            // Some boxes cannot be halved any further, and nothing is known of them.
            break;
        }
        proved = Some(Proved {
            largest: largest.max(found * (1.0 + effort.gap)),
            found,
            boxes,
        });
    }
    proved.ok_or(NoProof::Unfinished)
}

/// What is asked, load by load; a load and its opposite tell the same.
pub(super) fn tasks(question: &Question) -> Option<Vec<ProofTask<'_>>> {
    let loads: Vec<LoadCase> = match &question.loads {
        ProofLoads::OneOf(wrenches) => {
            let mut loads: Vec<LoadCase> = Vec::new();
            for wrench in wrenches {
                let opposite = LoadCase::Wrench(wrench.map(|part| -part));
                let load = LoadCase::Wrench(*wrench);
                if !loads.contains(&opposite) && !loads.contains(&load) {
                    loads.push(load);
                }
            }
            loads
        }
        ProofLoads::AnyForce(size) => vec![LoadCase::Any(*size)],
    };
    let chain = Chain::new(&question.arm);
    loads
        .into_iter()
        .map(|load| {
            let mut chain = chain.clone();
            let mut domain = Domain::new(question, &chain, load)?;
            // Under a force of any direction, turning all of the arm about its first joint that moves changes nothing but
            // the margins (and what joints before it show): its angle must not be in the variables of the joints behind.
            let first = (domain.variable.iter().position(Option::is_some))
                .filter(|first| question.parameters.iter().all(|joint| joint >= first));
            let next = first.and_then(|first| chain.links.get_mut(first + 1));
            if let (LoadCase::Any(_), Some(next)) = (load, next)
                && !next.starts_run
            {
                next.starts_run = true;
                domain = Domain::new(question, &chain, load)?;
            }
            Some(ProofTask::new(question, chain, domain))
        })
        .collect()
}

/// One thread's share: depth first. `thresholds` are where boxes may be forgotten, and where they need not be
/// halved for now.
fn share(
    tasks: &[ProofTask<'_>],
    rooms: &mut [ModelWorkspace],
    taken: &[(usize, Cell)],
    [forget, keep]: [f64; 2],
    records: bool,
) -> Share {
    let mut share = Share {
        left: taken.to_vec(),
        kept: Vec::new(),
        looks: 0,
        found: 0.0,
        known: Vec::new(),
    };
    let mut looks = 0;
    while looks < LOOKS {
        let Some(&(index, last)) = share.left.last() else {
            break;
        };
        let mut cells = [last; LANES];
        let mut used = 0;
        while used < LANES && share.left.last().is_some_and(|(task, _)| *task == index) {
            if let Some((_, cell)) = share.left.pop() {
                cells[used] = cell;
                used += 1;
            }
        }
        let judgements = judge(&tasks[index], &mut rooms[index], &cells, used, forget);
        looks += used;
        for (cell, judgement) in cells.into_iter().zip(judgements) {
            let Judgement { largest, halve, .. } = judgement;
            share.found = share.found.max(judgement.at_centre);
            if records {
                share.known.push((index, cell, judgement));
            }
            let open = Open {
                task: index,
                cell,
                largest,
                halve,
            };
            if largest > keep && cell.depth[halve] < DEEPEST {
                push_halves(tasks, &open, &mut share.left);
            } else if largest > forget {
                share.kept.push(open);
            }
        }
    }
    share.looks = looks as u64;
    share
}

fn push_halves(tasks: &[ProofTask<'_>], open: &Open, stack: &mut Vec<(usize, Cell)>) {
    let halves = tasks[open.task].halves(&open.cell, open.halve);
    stack.extend(halves.map(|half| (open.task, half)));
}

/// Tries where the frame stands best: where some parts of the region take fewest boxes.
fn choose_middle(task: &mut ProofTask<'_>, found: f64) {
    let mut best = (usize::MAX, 0);
    for middle in task.middles() {
        task.middle = middle;
        let looks = trial(task, TRIAL_GAP * found, best.0);
        if looks < best.0 {
            best = (looks, middle);
        }
    }
    task.middle = best.1;
}

/// The number of boxes, up to a limit, that some parts of the region take.
fn trial(task: &ProofTask<'_>, threshold: f64, limit: usize) -> usize {
    let mut workspace = ModelWorkspace::new(task.variables());
    let mut looks = 0;
    for part in 0..TRIALS {
        // Halves are chosen by the digits of multiples of an odd number, which look random.
        let mut digits = (part + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut cell = task.whole();
        for _ in 0..TRIAL_DEPTH {
            for variable in 0..task.variables() {
                cell = task.halves(&cell, variable)[usize::from(digits >> 63 == 1)];
                digits = digits.rotate_left(1);
            }
        }
        let mut stack = vec![cell];
        let end = limit.min(looks + TRIAL_BOXES);
        while !stack.is_empty() && looks < end {
            let used = stack.len().min(LANES);
            let mut cells = [stack[0]; LANES];
            let from = stack.split_off(stack.len() - used);
            cells[..used].copy_from_slice(&from);
            let judgements = judge(task, &mut workspace, &cells, used, threshold);
            looks += used;
            for (cell, judgement) in cells.iter().zip(judgements) {
                if judgement.largest > threshold && cell.depth[judgement.halve] < DEEPEST {
                    stack.extend(task.halves(cell, judgement.halve));
                }
            }
        }
    }
    looks
}
