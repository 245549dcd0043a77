//! What a file of measurements shows by itself: angles out of range, copied rows.

use nalgebra::Vector3;

use super::super::copies::{CopiedReadings, ReadBits};
use super::hypotheses::is_inside;
use super::{Case, Diagnosis, Mistake, words};
use crate::robot::Load;

pub fn facts(case: &Case<'_>) -> Vec<Diagnosis> {
    let mistakes = outside_range(case).into_iter().chain(copies(case));
    mistakes
        .map(|mistake| Diagnosis {
            text: words::fact(case, &mistake),
            mistake,
            log_evidence_ratio: None,
        })
        .collect()
}

fn outside_range(case: &Case<'_>) -> Option<Mistake> {
    let joints = &case.nominal.chain.joints;
    let outside: Vec<(usize, usize, f64)> = (case.measurements.iter().enumerate())
        .flat_map(|(measurement, each)| {
            let angles = each.configuration_rad.iter().enumerate();
            angles.map(move |(joint, &angle)| (measurement, joint, angle))
        })
        .filter(|&(_, joint, angle)| !is_inside(angle, joints[joint].range_rad))
        .collect();
    let beyond = |&(_, joint, angle): &(usize, usize, f64)| {
        let [from, to] = joints[joint].range_rad;
        (from - angle).max(angle - to)
    };
    let farthest = (outside.iter()).max_by(|one, other| beyond(one).total_cmp(&beyond(other)))?;
    let mut measurements: Vec<usize> = outside.iter().map(|each| each.0).collect();
    measurements.dedup();
    let &(measurement, joint, angle_rad) = farthest;
    Some(Mistake::AnglesOutsideRange {
        measurements: measurements.len(),
        measurement,
        joint,
        angle_rad,
    })
}

/// Loaded measurements with the same deflection in every digit.
pub fn copied(case: &Case<'_>) -> CopiedReadings {
    let loaded: Vec<usize> = (0..case.measurements.len())
        .filter(|&index| case.measurements[index].load != Load::NONE)
        .collect();
    let bits: Vec<ReadBits> = (loaded.iter())
        .map(|&index| {
            let each = &case.measurements[index];
            let wrench = each.load.wrench();
            let setup = each.configuration_rad.iter().chain(wrench.iter());
            let own = each
                .sigma_m
                .unwrap_or_else(|| Vector3::repeat(case.sigma.weight_m()));
            let setup = setup.map(|value| value.to_bits()).collect();
            ReadBits::new(setup, &[], each.deflection_m, own)
        })
        .collect();
    let found = CopiedReadings::of(&bits);
    let places = |pairs: Vec<[usize; 2]>| -> Vec<[usize; 2]> {
        (pairs.into_iter())
            .map(|pair| pair.map(|place| loaded[place]))
            .collect()
    };
    CopiedReadings {
        rows: places(found.rows),
        readings: places(found.readings),
    }
}

fn copies(case: &Case<'_>) -> Vec<Mistake> {
    let CopiedReadings { rows, readings } = copied(case);
    let rows = (!rows.is_empty()).then_some(Mistake::IdenticalRows(rows));
    let readings = (!readings.is_empty()).then_some(Mistake::IdenticalReadings(readings));
    rows.into_iter().chain(readings).collect()
}
