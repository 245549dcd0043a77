//! The way back to the robot: a program that leads to given configurations, one after the other.

use nalgebra::DVector;

use super::side::{Side, wanted_side};
use super::ways::Ways;
use super::{CampaignError, Laboratory, Program, ProgramStep, program};
use crate::robot::Load;
use crate::task::Task;

/// A configuration to go to.
#[derive(Debug, Clone, PartialEq)]
pub struct ProgramTarget {
    /// What it is, in words: `test pose "milling"`.
    pub name: String,
    /// The configuration to command (rad, m).
    pub configuration: DVector<f64>,
}

/// A program that leads the unloaded robot to targets in their order, from the laboratory's first safe pose and back
/// to it where there is one: straight moves where these keep clear, else over safe poses; each target from one side, as
/// in the calibration; a halt at each, and the measured joint angles.
///
/// # Errors
/// No way is found to a target, or a joint would be commanded beyond its range.
pub fn program_to(
    task: &Task,
    laboratory: &Laboratory,
    targets: &[ProgramTarget],
    title: &str,
) -> Result<Program, CampaignError> {
    let configurations: Vec<DVector<f64>> = (targets.iter())
        .map(|each| each.configuration.clone())
        .collect();
    let mut ways = Ways::new(task, &laboratory.safe_poses, &configurations);
    let home = laboratory.safe_poses.first();
    let mut steps: Vec<ProgramStep> = home.cloned().map(ProgramStep::Move).into_iter().collect();
    let mut last = home.map(|home| ("from the first safe pose".to_owned(), home.clone()));
    for ProgramTarget {
        name,
        configuration: q,
    } in targets
    {
        let joints = q.iter().zip(&task.belief.nominal.chain.joints);
        for (value, joint) in joints {
            let [low, high] = joint.range_rad;
            if !(low..=high).contains(value) {
                return Err(CampaignError::BeyondRange {
                    joint: joint.name.clone(),
                    to: name.clone(),
                });
            }
        }
        let judge = ways.judge();
        let (wanted, by) = (wanted_side(task, None), laboratory.approach);
        let (side, approach) = Side::free(task, by, judge, q, &[Load::NONE], wanted.as_deref());
        let remark = format!("{name}, approached {}", side.words());
        steps.push(ProgramStep::Remark(remark));
        if let Some(last) = &last {
            let via = via(&mut ways, last, name, approach.as_ref().unwrap_or(q))?;
            steps.extend(via.into_iter().map(ProgramStep::Move));
        }
        steps.extend(approach.map(ProgramStep::Move));
        steps.push(ProgramStep::Move(q.clone()));
        steps.push(ProgramStep::Halt(format!("At {name}")));
        steps.push(ProgramStep::Log);
        last = Some((format!("from {name}"), q.clone()));
    }
    if let (Some(home), Some((_, last))) = (home, last) {
        let last = ("from the last target".to_owned(), last);
        let via = via(&mut ways, &last, "the first safe pose", home)?;
        steps.extend(program::back(via, home));
    }
    Ok(Program {
        title: title.to_owned(),
        steps,
    })
}

/// The safe poses between two places.
fn via(
    ways: &mut Ways<'_>,
    (from, start): &(String, DVector<f64>),
    to: &str,
    end: &DVector<f64>,
) -> Result<Vec<DVector<f64>>, CampaignError> {
    let way = ways.find(start, end, &[Load::NONE], 0);
    way.map(|way| way.via).ok_or_else(|| CampaignError::NoWay {
        from: from.clone(),
        to: to.to_owned(),
        load: None,
    })
}
