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
    for target in targets {
        let q = &target.configuration;
        check_range(task, target)?;
        let judge = ways.judge();
        let (wanted, by) = (wanted_side(task, None), laboratory.approach);
        let (side, approach) = Side::free(task, by, judge, q, &[Load::NONE], wanted.as_deref());
        let end = approach.as_ref().unwrap_or(q);
        steps.push(ProgramStep::Remark(format!(
            "{}, approached with {side}",
            target.name
        )));
        steps.extend(way(&mut ways, last.as_ref(), target, end)?);
        steps.extend(approach.clone().map(ProgramStep::Move));
        steps.push(ProgramStep::Move(q.clone()));
        steps.push(ProgramStep::Halt(format!("At {}", target.name)));
        steps.push(ProgramStep::Log);
        last = Some((format!("from {}", target.name), q.clone()));
    }
    if let (Some(home), Some((_, last))) = (home, &last) {
        let back = ways.find(last, home, &[Load::NONE], 0);
        let back = back.ok_or_else(|| no_way("from the last target", "the first safe pose"))?;
        steps.extend(program::back(back.via, home));
    }
    Ok(Program {
        title: title.to_owned(),
        steps,
    })
}

/// The moves over safe poses from the last place, if there is one, to the end of the way.
fn way(
    ways: &mut Ways<'_>,
    last: Option<&(String, DVector<f64>)>,
    target: &ProgramTarget,
    end: &DVector<f64>,
) -> Result<Vec<ProgramStep>, CampaignError> {
    let Some((from, start)) = last else {
        return Ok(Vec::new());
    };
    let way = ways.find(start, end, &[Load::NONE], 0);
    let way = way.ok_or_else(|| no_way(from, &target.name))?;
    Ok(way.via.into_iter().map(ProgramStep::Move).collect())
}

fn no_way(from: &str, to: &str) -> CampaignError {
    CampaignError::NoWay {
        from: from.to_owned(),
        to: to.to_owned(),
        load: None,
    }
}

fn check_range(task: &Task, target: &ProgramTarget) -> Result<(), CampaignError> {
    let joints = &task.belief.nominal.chain.joints;
    let outside = (target.configuration.iter().zip(joints)).find(|(value, joint)| {
        let [low, high] = joint.range_rad;
        !(low..=high).contains(*value)
    });
    outside.map_or(Ok(()), |(_, joint)| {
        Err(CampaignError::BeyondRange {
            joint: joint.name.clone(),
            to: target.name.clone(),
        })
    })
}
