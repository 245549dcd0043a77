//! Plans of lengths, as ballbars and wire encoders read them from stations.

use nalgebra::{DVector, Isometry3, Matrix6xX, Translation3, UnitQuaternion, Vector3};

use super::AbsolutePlanning;
use crate::observation::{ObservationModel, ReadLength};
use crate::parameter::{ParameterKind, ParameterSet};
use crate::robot::{EquilibriumSolver, Load, Tool};
use crate::task::{Station, Task};

/// Configurations are brought within this share of a station's range from its ends, in so many steps of no more than this for
/// each joint (rad, m).
const SPARE: f64 = 0.2;
const MOST_STEPS: usize = 40;
const LONGEST: f64 = 0.3;

impl AbsolutePlanning<'_> {
    /// The frames of the stations that lengths are read from, as far as these show them, in a run where they are off by what it sampled
    /// of them, or by a share of what others are that may be anywhere; those others themselves.
    pub fn frames_of_run(
        &self,
        anywhere: Vec<Isometry3<f64>>,
        share: f64,
        sampled: impl Fn(ParameterKind) -> Option<f64>,
    ) -> Vec<Isometry3<f64>> {
        let mut frames = anywhere;
        for (station, frame) in frames.iter_mut().enumerate() {
            let there = self.case.base_there(station);
            let Some((length, kinds)) = self.case.length_from(station).zip(there) else {
                continue;
            };
            let sampled = kinds.map(|kinds| kinds.map(&sampled));
            let shown = |which: usize, axis: usize| f64::from(length.shows(kinds[which][axis]));
            let off = [frame.translation.vector, frame.rotation.scaled_axis()];
            let [mut moved_m, turned_rad] = [0, 1].map(|which| {
                let by = |axis: usize| sampled[which][axis].unwrap_or(off[which][axis] * share);
                Vector3::from_fn(|axis, _| by(axis) * shown(which, axis))
            });
            let turned = UnitQuaternion::new(turned_rad);
            let believed_m = self.case.arm.instrument_from_base[station]
                .translation
                .vector;
            if sampled.as_flattened().iter().any(Option::is_some) {
                // It is turned about its own place.
                let lever_m = turned * believed_m - believed_m;
                moved_m += Vector3::from_fn(|axis, _| lever_m[axis] * shown(0, axis));
            }
            *frame = Isometry3::from_parts(Translation3::from(moved_m + believed_m), turned);
        }
        frames
    }

    /// What the nominal robot has a candidate's length be at rest, where one is read.
    pub fn length(&self, place: usize) -> Option<ReadLength> {
        let each = &self.case.observations[place];
        let kind = each.reading.kind();
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &self.case.arm, &[]);
        let mut ignored = Matrix6xX::zeros(0);
        let found = model.predict(&each.setup, kind, &mut ignored);
        Some(ReadLength {
            kind: kind.length()?,
            length_m: found.ok()?.position_m.x,
        })
    }
}

/// A configuration (rad), by the shortest way to first order, in which the unloaded robot has a target where a station reads its
/// length; itself where no lengths are read.
pub(super) fn in_range(
    task: &Task,
    target: &Tool,
    station: Option<&Station>,
    mut q: DVector<f64>,
) -> DVector<f64> {
    let belief = &task.belief;
    let Some((station, length)) = station.and_then(|station| Some((station, station.reads?)))
    else {
        return q;
    };
    let [least, most] = [
        station.range_m[0].unwrap_or(0.0),
        station.range_m[1].unwrap_or(f64::INFINITY),
    ];
    let spare = if most.is_finite() {
        SPARE * (most - least)
    } else {
        0.0
    };
    let mut solver = EquilibriumSolver::new(q.len());
    let mut arm = belief.nominal.chain.at(target);
    for _ in 0..MOST_STEPS {
        let compliance = &belief.nominal.compliance_rad_per_nm;
        if solver
            .solve(&mut arm, compliance, q.as_slice(), &Load::NONE)
            .is_err()
        {
            break;
        }
        let state = solver.state();
        let apart_m = state.tool_position - station.position_m;
        let (length_m, gradient) = length.row(&apart_m);
        let missing = length_m.clamp(least + spare, most - spare) - length_m;
        if missing == 0.0 {
            break;
        }
        let along: Vec<(usize, f64)> = (belief.nominal.chain.commanded())
            .map(|joint| (joint, state.position_column(joint).dot(&gradient)))
            .collect();
        let square: f64 = along.iter().map(|(_, slope)| slope * slope).sum();
        for (joint, slope) in along {
            let step = (missing * slope / square.max(f64::EPSILON)).clamp(-LONGEST, LONGEST);
            let [low, high] = task.region.joint_range_rad[joint];
            q[joint] = (q[joint] + step).clamp(low, high);
        }
    }
    q
}
