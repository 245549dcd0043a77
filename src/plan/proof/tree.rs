//! A proof that can be looked at: the tree of halvings, with the multipliers of every box that is done with.

use std::collections::HashMap;

use serde::Serialize;

use super::domain::{AngleDifference, LoadCase};
use super::enclosure::{Cell, ProofTask};
use super::judgement::Judgement;
use super::question::Question;
use super::taylor::VARIABLES;

/// What was proved, with all that it takes to check it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProofObject {
    /// What was asked.
    pub question: Question,
    /// No derivative in the region is above this.
    pub largest: f64,
    /// The proof for each load.
    pub parts: Vec<ProofPart>,
}

/// The proof for one load.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProofPart {
    /// Force (N) and torque (N m) in the world frame; none for a force of any direction.
    pub wrench: Option<[f64; 6]>,
    /// The joint before which the frame stands in which the prover told everything.
    pub middle: usize,
    /// Whether a run of joints with parallel axes begins with each joint.
    pub starts_run: Vec<bool>,
    /// The variable that stands for the angle of each joint, summed up over the joints of its run.
    pub variables: Vec<Option<usize>>,
    /// The range of each variable.
    pub ranges: Vec<[f64; 2]>,
    /// The variables of joints in the same run, later and earlier, and what their difference is limited to.
    pub differences: Vec<AngleDifference>,
    /// The boxes, depth first, the lower half first: a digit is the variable that is halved; "." is a box that is done
    /// with as it is; "x" with the two digits of a margin, one where that is negative; "m" with the digit of a count and as many
    /// multipliers, each the two digits of the margin and the first six of its bits' 16. All digits are hexadecimal.
    pub tree: String,
}

/// What is known of every box.
#[derive(Debug, Default)]
pub(super) struct Record(HashMap<CellKey, Judgement>);

type CellKey = (usize, [u64; VARIABLES], [u8; VARIABLES]);

fn key(task: usize, cell: &Cell) -> CellKey {
    (task, cell.centre.map(f64::to_bits), cell.depth)
}

impl Record {
    pub fn insert(&mut self, task: usize, cell: &Cell, judgement: Judgement) {
        self.0.insert(key(task, cell), judgement);
    }

    /// The proof that no derivative is above a number; `None` where a box is missing.
    pub fn object(
        &self,
        question: &Question,
        tasks: &[ProofTask<'_>],
        largest: f64,
    ) -> Option<ProofObject> {
        let part = |(index, task): (usize, &ProofTask<'_>)| {
            let domain = &task.domain;
            Some(ProofPart {
                wrench: match domain.load {
                    LoadCase::Wrench(wrench) => Some(wrench),
                    LoadCase::Any(_) => None,
                },
                middle: task.middle,
                starts_run: task.links().iter().map(|link| link.starts_run).collect(),
                variables: domain.variable.clone(),
                ranges: domain.ranges.clone(),
                differences: domain.differences.clone(),
                tree: self.tree(index, task, largest)?,
            })
        };
        Some(ProofObject {
            question: question.clone(),
            largest,
            parts: tasks.iter().enumerate().map(part).collect::<Option<_>>()?,
        })
    }

    fn tree(&self, index: usize, task: &ProofTask<'_>, largest: f64) -> Option<String> {
        let mut text = String::new();
        let mut stack = vec![task.whole()];
        while let Some(cell) = stack.pop() {
            let known = self.0.get(&key(index, &cell))?;
            if known.largest > largest {
                text += &format!("{:x}", known.halve);
                let [low, high] = task.halves(&cell, known.halve);
                stack.extend([high, low]);
                continue;
            }
            match known.multipliers.as_slice() {
                [] => text.push('.'),
                [(margin, multiplier)] if multiplier.is_infinite() => {
                    text += &format!("x{margin:02x}");
                }
                several => {
                    text += &format!("m{:x}", several.len());
                    for (margin, multiplier) in several {
                        text += &format!("{margin:02x}{:06x}", multiplier.to_bits() >> 40);
                    }
                }
            }
        }
        Some(text)
    }
}
