//! Which turn of a joint is commanded where its range allows several.

use super::Plan;
use crate::task::Task;

/// Makes a designed plan what is commanded: repeats together, and each joint on the turn that is nearest to a home (rad)
/// within the region's ranges, where the arm stands alike and hoses are wound least.
pub fn take_nearest_turns(task: &Task, home_rad: Option<&[f64]>, plan: &mut Plan) {
    plan.put_repeats_together();
    let joints = &task.belief.nominal.chain.joints;
    for experiment in &mut plan.experiments {
        let q = &mut experiment.configuration_rad;
        for (joint, own) in joints.iter().enumerate() {
            let range = task.region.joint_range_rad[joint];
            let home = home_rad.map_or(0.0, |home| home[joint]);
            let (angle, turned) = (q[joint], own.turned_into(range, q[joint], home));
            let is_allowed = (range[0]..=range[1]).contains(&turned);
            // Rounding is no reason to turn.
            if is_allowed && (turned - home).abs() < (angle - home).abs() - 1e-9 {
                q[joint] = turned;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::DVector;

    use super::*;
    use crate::experiment::Experiment;
    use crate::robot::Load;
    use crate::scenario::Scenario;

    /// Whatever the home, angles stay the same but for whole turns, within their ranges, and no turn is nearer.
    #[test]
    fn no_other_turn_is_nearer_to_home() {
        let scenario = Scenario::load("scenarios/kr270.toml".as_ref()).expect("it is there");
        let task = &scenario.task;
        let ranges = &task.region.joint_range_rad;
        for (index, share) in [0.01, 0.2, 0.5, 0.8, 0.99].into_iter().enumerate() {
            let at = |share: f64| {
                ranges
                    .iter()
                    .map(move |[low, high]| low + share * (high - low))
            };
            let configuration = DVector::from_iterator(ranges.len(), at(share));
            let mut plan = Plan {
                experiments: vec![Experiment {
                    configuration_rad: configuration.clone(),
                    load: Load::NONE,
                    repeats: 1,
                    approach: None,
                    direction: None,
                }],
            };
            let home: Vec<f64> = at(0.15 * index as f64).collect();
            take_nearest_turns(task, Some(&home), &mut plan);
            let turned = &plan.experiments[0].configuration_rad;
            for (joint, &[low, high]) in ranges.iter().enumerate() {
                let turns = (turned[joint] - configuration[joint]) / TAU;
                assert!((turns - turns.round()).abs() < 1e-9);
                assert!((low..=high).contains(&turned[joint]));
                for other in [turned[joint] - TAU, turned[joint] + TAU] {
                    let is_nearer =
                        (other - home[joint]).abs() < (turned[joint] - home[joint]).abs() - 1e-6;
                    assert!(!is_nearer || !(low..=high).contains(&other));
                }
            }
        }
    }
}
