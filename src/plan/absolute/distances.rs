//! Plans of distances, as ballbars and wire encoders read them from a station's point to a target.

use nalgebra::{DVector, Isometry3, Matrix6xX, Vector3};

use super::AbsolutePlanning;
use crate::observation::{ObservationModel, ReadingKind};
use crate::parameter::ParameterSet;
use crate::robot::{EquilibriumSolver, Load, Tool};
use crate::task::{Station, Task};

/// Configurations are brought within this share of a station's range from its ends, in so many steps of no more than this for
/// each joint (rad, m).
const SPARE: f64 = 0.2;
const MOST_STEPS: usize = 40;
const LONGEST: f64 = 0.3;

impl AbsolutePlanning<'_> {
    /// Where the stations are believed to be from which distances alone are read (m, in the robot's base frame); none for others.
    pub fn points(&self) -> impl Iterator<Item = Option<Vector3<f64>>> {
        let frames = self.case.arm.instrument_from_base.iter().enumerate();
        let place = |frame: &Isometry3<f64>| -frame.translation.vector;
        frames.map(move |(station, frame)| self.case.is_point(station).then(|| place(frame)))
    }

    /// How far the nominal robot has a candidate's target from the point of its station at rest (m), where that is read.
    pub fn distance_m(&self, place: usize) -> Option<f64> {
        let each = &self.case.observations[place];
        let kind = each.reading.kind();
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &self.case.arm, &[]);
        let mut ignored = Matrix6xX::zeros(0);
        let found = model.predict(&each.setup, kind, &mut ignored);
        (found.ok().filter(|_| kind == ReadingKind::Distance)).map(|found| found.position_m.x)
    }

    /// Whether a candidate is a distance.
    pub fn is_distance(&self, place: usize) -> bool {
        self.setup(place).1 == ReadingKind::Distance
    }
}

/// A configuration (rad), by the shortest way to first order, in which the unloaded robot has a target where a station reads its
/// distance; itself where no distances are read.
pub(super) fn in_range(
    task: &Task,
    target: &Tool,
    station: Option<&Station>,
    mut q: DVector<f64>,
) -> DVector<f64> {
    let belief = &task.belief;
    let Some(station) = station.filter(|station| station.reads_distances) else {
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
        let missing = apart_m.norm().clamp(least + spare, most - spare) - apart_m.norm();
        if missing == 0.0 {
            break;
        }
        let along: Vec<(usize, f64)> = (belief.nominal.chain.commanded())
            .map(|joint| {
                (
                    joint,
                    state.position_column(joint).dot(&apart_m.normalize()),
                )
            })
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
