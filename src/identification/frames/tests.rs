//! Frames from readings without noise, whatever they are.

use nalgebra::DVector;

use super::*;
use crate::parameter::ElasticArm;
use crate::parameter::arms::{Numbers, random, ur10};

/// What stations somewhere see of targets somewhere on a link.
fn sights(
    numbers: &mut Numbers,
    arm: &ElasticArm,
    frames: &MountedFrames,
    count: usize,
    is_pose: bool,
) -> Vec<Sight> {
    let mut carrier = arm.tools[0].clone();
    carrier.link_from_tool = Isometry3::identity();
    (0..count)
        .map(|index| {
            let q: DVector<f64> = numbers.configuration(&arm.chain);
            let state = arm.chain.at(&carrier).state(q.as_slice());
            let rotation = Rotation3::from_matrix_unchecked(state.tool_rotation);
            let base_from_link = isometry(&rotation, state.tool_position);
            let (station, target) = (
                index % frames.instrument_from_base.len(),
                (index / 2) % frames.link_from_tool.len(),
            );
            let seen = frames.instrument_from_base[station]
                * base_from_link
                * frames.link_from_tool[target];
            Sight {
                station,
                target,
                base_from_link,
                position_m: seen.translation.vector,
                rotation: is_pose.then(|| seen.rotation.to_rotation_matrix().into_inner()),
            }
        })
        .collect()
}

fn anywhere(numbers: &mut Numbers, count: usize, size_m: f64) -> Vec<Isometry3<f64>> {
    (0..count)
        .map(|_| Isometry3::new(numbers.vector(size_m), numbers.vector(3.0)))
        .collect()
}

#[test]
fn frames_come_back_from_anywhere() {
    let mut numbers = Numbers(21);
    for case in 0..40 {
        let arm = if case % 2 == 0 {
            ur10()
        } else {
            random(&mut numbers, 3 + case % 5)
        };
        let (stations, targets, is_pose) = (1 + case % 3, 1 + case % 2, case % 4 < 2);
        let truth = MountedFrames {
            instrument_from_base: anywhere(&mut numbers, stations, 5.0),
            link_from_tool: anywhere(&mut numbers, targets, 0.3),
        };
        let seen = sights(&mut numbers, &arm, &truth, 12 * stations * targets, is_pose);
        let found = MountedFrames::guessed(&seen, stations, &vec![Isometry3::identity(); targets]);
        let left = (found.cost(&seen) / seen.len() as f64).sqrt();
        assert!(left < 1e-4, "case {case}: {left} m");
    }
}

/// Two stations that see two different targets are two problems.
#[test]
fn stations_with_targets_of_their_own_are_apart() {
    let mut numbers = Numbers(22);
    let arm = ur10();
    let truth = MountedFrames {
        instrument_from_base: anywhere(&mut numbers, 2, 5.0),
        link_from_tool: anywhere(&mut numbers, 2, 0.3),
    };
    let mut seen = sights(&mut numbers, &arm, &truth, 60, true);
    seen.retain(|sight| sight.station == sight.target);
    let found = MountedFrames::guessed(&seen, 2, &[Isometry3::identity(); 2]);
    assert!(found.cost(&seen) < 1e-12, "{}", found.cost(&seen));
}
