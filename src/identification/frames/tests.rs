//! Frames from readings without noise, whatever they are.

use nalgebra::{DVector, Translation3};

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
            let base_from_link = Isometry3::from_parts(state.tool_position.into(), rotation.into());
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
                weight: 1.0,
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

/// Along parallel axes nobody sees where a target is: it stays where it is believed to be, with and without noise, and however its
/// frame is turned.
#[test]
fn what_is_not_seen_is_as_believed() {
    let mut numbers = Numbers(23);
    for case in 0..20 {
        let noise_m = if case % 2 == 0 { 0.0 } else { 1e-4 };
        let base = anywhere(&mut numbers, 1, 5.0)[0];
        let along = |height_m: f64| Isometry3::translation(0.1, -0.05, height_m);
        let turn = anywhere(&mut numbers, 1, 0.0)[0];
        let (true_m, believed_m) = (0.4 + 0.02 * f64::from(case), 0.15);
        let seen: Vec<Sight> = (0..60)
            .map(|_| {
                let angles = numbers.vector(2.0);
                let shoulder = Isometry3::rotation(Vector3::z() * angles.x);
                let elbow = Isometry3::rotation(Vector3::z() * angles.y);
                let forearm = Isometry3::translation(0.45, 0.0, 0.05);
                let hand = Isometry3::translation(0.4, 0.0, angles.z);
                let wrist = Isometry3::rotation(Vector3::z() * (angles.x + 2.0 * angles.z));
                let base_from_link = shoulder * forearm * elbow * hand * wrist;
                let read = base * base_from_link * along(true_m);
                Sight {
                    station: 0,
                    target: 0,
                    base_from_link,
                    position_m: read.translation.vector + numbers.vector(noise_m),
                    rotation: None,
                    weight: 1.0,
                }
            })
            .collect();
        let believed =
            Isometry3::from_parts(Translation3::new(0.0, 0.0, believed_m), turn.rotation);
        let found = MountedFrames::guessed(&seen, 1, &[believed]);
        let place = found.link_from_tool[0].translation.vector;
        let off = place - Vector3::new(0.1, -0.05, believed_m);
        assert!(
            off.norm() < 1e-3 && off.z.abs() < 1e-6,
            "case {case}: {place}"
        );
        let left = (found.cost(&seen) / 60.0).sqrt();
        assert!(left < 2.0 * noise_m + 1e-6, "case {case}: {left} m");
    }
}
