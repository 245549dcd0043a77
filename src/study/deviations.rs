//! The deviations of a run's simulated truth from the planner's model, and their effect in the linear model.

use nalgebra::{Cholesky, DMatrix, Vector6};

use crate::compensation::{uncompensated_rows, weighted_rows};
use crate::numeric::random::normal::LANES;
use crate::observation::{CovarianceTogether, PlannedReadings};
use crate::parameter::{
    ElasticArm, ParameterKind, ParameterSet, ReadingSource, Source, Unloaded, log_ratio,
};
use crate::plan::{Experiment, ExperimentModel};
use crate::robot::{Kinematics, Load, TrueRobot};
use crate::task::{Belief, Task, TestPose};
use crate::testbed::{Circumstances, Truth};

/// A parameter that may differ in a run.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Deviation {
    /// The compliance of a joint: in rad/(N m), or in its logarithm.
    Compliance(usize, bool),
    /// Something else, in its unit.
    Other(ParameterKind),
    /// The laws of joints that are no springs: there, in every run.
    TorqueLaws,
}

/// All that may differ.
#[derive(Debug, Clone)]
pub struct Deviations<'a> {
    belief: &'a Belief,
    /// What the belief's vector does not have.
    foreign: Vec<Deviation>,
    /// Unknowns of which something is known before, which the truth may not agree with, as indices in the belief's
    /// vector.
    tied: Vec<(usize, Deviation)>,
    /// The parameters of sources in common with an earlier campaign,
    kept: Vec<ParameterKind>,
    laboratory: Option<Circumstances>,
    /// The true robot, where some of its joints are no springs.
    unlike_springs: Option<TrueRobot>,
    arm: ElasticArm,
    /// The foreign parameters.
    set: ParameterSet,
    /// What is new in each reading, as it is believed and as it is.
    believed: Vec<ReadingSource>,
    sources: Vec<ReadingSource>,
}

impl<'a> Deviations<'a> {
    /// What a truth may differ in from a belief.
    pub fn new(belief: &'a Belief, truth: &Truth) -> Self {
        let arm = belief.arm();
        let drawn = drawn_kinds(truth);
        // Compliances that the belief takes to be nominal and that may be others, and what else it does not know of.
        let of_joint = |joint| ParameterKind::JointCompliance { joint };
        let joints: Vec<usize> = (0..belief.joints())
            .filter(|&joint| place(belief, of_joint(joint)).is_none())
            .filter(|&joint| differs(belief, truth, &drawn, joint))
            .collect();
        let is_compliance = |kind| matches!(kind, ParameterKind::JointCompliance { .. });
        let foreign_kinds: Vec<ParameterKind> = (drawn.iter().copied())
            .filter(|&kind| !is_compliance(kind) && place(belief, kind).is_none())
            .collect();
        let extended = &belief.uncertain;
        let has_laws = !truth.robot.torque_laws.is_empty();
        let unknowns = (joints.iter().map(|&joint| (of_joint(joint), None)))
            .chain(foreign_kinds.iter().map(|&kind| (kind, Some(1.0))));
        let set = ParameterSet::new(&arm, unknowns);
        let reading = |each: &crate::parameter::Uncertainty| match &each.source {
            Source::Reading(source) => Some(source.clone()),
            Source::Plan(_) => None,
        };
        Self {
            foreign: (joints
                .iter()
                .map(|&joint| Deviation::Compliance(joint, false)))
            .chain(foreign_kinds.into_iter().map(Deviation::Other))
            .chain(has_laws.then_some(Deviation::TorqueLaws))
            .collect(),
            unlike_springs: has_laws.then(|| truth.robot.clone()),
            tied: tied(belief, truth, &drawn),
            kept: truth.kept().to_vec(),
            laboratory: (!truth.uncertainties.is_empty())
                .then(|| Circumstances::new(arm.clone(), &truth.uncertainties, truth.kept()).ok())
                .flatten()
                .map(|laboratory| laboratory.resting_on(belief.instrument.unloaded)),
            believed: (extended.sources().map(|(_, source)| source.clone())).collect(),
            sources: truth.uncertainties.iter().filter_map(reading).collect(),
            belief,
            arm,
            set: set.unwrap_or_else(|_| ParameterSet::empty()),
        }
    }

    /// How many parameters differ.
    pub fn count(&self) -> usize {
        self.foreign.len() + self.tied.len()
    }

    /// How many of them the belief's vector does not have; they come first.
    pub fn foreign(&self) -> usize {
        self.foreign.len()
    }

    /// The places of the others in the belief's vector.
    pub fn tied(&self) -> Vec<usize> {
        self.tied.iter().map(|(place, _)| *place).collect()
    }

    /// How many normal numbers a run's laboratory takes for what it shares.
    pub fn numbers(&self) -> usize {
        (self.laboratory.as_ref()).map_or(0, |laboratory| laboratory.numbers(0))
    }

    /// By how much each differs from what is expected before (per sigma) in the runs of all lanes, of which what
    /// [`TrueCompliances`](crate::testbed::TrueCompliances) samples is given.
    pub fn values(&self, sampled: &[[f64; LANES]], normals: &[[f64; LANES]]) -> Vec<[f64; LANES]> {
        let nominal = &self.belief.nominal.compliance_rad_per_nm;
        let sigma_m = self.belief.instrument.sigma_m;
        let (true_rad_per_nm, kept) = sampled.split_at(nominal.len());
        let drawn = |kind, lane: usize| {
            let place = self.kept.iter().position(|own| *own == kind);
            let laboratory = self.laboratory.as_ref();
            let here = laboratory.map_or(0.0, |laboratory| laboratory.drawn(kind, normals, lane));
            here + place.map_or(0.0, |place| kept[place][lane])
        };
        let value = |deviation: &Deviation| -> [f64; LANES] {
            std::array::from_fn(|lane| match *deviation {
                Deviation::Compliance(joint, is_logarithmic) => {
                    let log = drawn(ParameterKind::JointCompliance { joint }, lane);
                    let k = true_rad_per_nm[joint][lane] * log.exp();
                    difference(k, nominal[joint], is_logarithmic) / sigma_m
                }
                Deviation::Other(kind) => self.differs_by(kind, drawn(kind, lane)) / sigma_m,
                Deviation::TorqueLaws => 1.0 / sigma_m,
            })
        };
        // What is known before draws towards its mean, which an earlier campaign may have found to be another than nominal.
        let set = self.belief.uncertain.set();
        let tied = self.tied.iter().map(|(place, deviation)| {
            let mean = set.prior().mean[*place] - set.parameters()[*place].nominal;
            value(deviation).map(|differs| differs - mean / sigma_m)
        });
        (self.foreign.iter().map(value)).chain(tied).collect()
    }

    /// The whitened observation matrices of what is foreign, of experiments of one configuration, like
    /// [`ExperimentModel::observation_matrices_of`].
    pub fn observation_matrices(
        &self,
        model: &ExperimentModel<'_>,
        experiments: &[&Experiment],
    ) -> Vec<DMatrix<f64>> {
        let mut readings = self.readings_of(&self.set, 0, &self.believed);
        let rows = model.rows_together(&mut readings, experiments);
        let Some(robot) = &self.unlike_springs else {
            return rows;
        };
        let height = model.rows();
        let mut seen = DMatrix::zeros(height * experiments.len(), 1);
        for (place, experiment) in experiments.iter().enumerate() {
            let q = experiment.configuration_rad.as_slice();
            let mut own = beyond_springs(&self.arm, robot, 0, q, &experiment.load);
            if let Some(direction) = &experiment.direction {
                let share = ReadingSource::share_along(&self.believed);
                let along = model.belief.instrument.precision().along(direction) * share;
                own = Vector6::ith(0, along.dot(&own.fixed_rows::<3>(0)));
            }
            (seen.rows_mut(height * place, height)).copy_from(&own.rows(0, height));
        }
        (self.together(&self.believed, experiments)).whiten(experiments, &mut seen);
        seen *= self.belief.instrument.sigma_m;
        let laws = (0..).map(|place| seen.rows(height * place, height).into_owned());
        (rows.into_iter().zip(laws))
            .map(|(rows, laws)| beside(rows, &laws))
            .collect()
    }

    /// The rows of all test poses for what is foreign, each times the root of its weight, stacked.
    pub fn test_poses(&self, task: &Task) -> DMatrix<f64> {
        weighted_rows(&task.test_poses, self.foreign.len(), &|pose| {
            self.test_pose(pose)
        })
    }

    fn test_pose(&self, pose: &TestPose) -> DMatrix<f64> {
        let target = self.arm.tools.len() - 1;
        let sizes = vec![1.0; self.set.len()];
        let model = PlannedReadings::at_test_pose(&self.arm, target, &self.set, &sizes);
        let rows = uncompensated_rows(model, pose);
        let Some(robot) = &self.unlike_springs else {
            return rows;
        };
        let q = pose.configuration_rad.as_slice();
        let left = beyond_springs(&self.arm, robot, target, q, &pose.load);
        let left = DMatrix::from_column_slice(3, 1, &left.as_slice()[..3]);
        beside(rows, &pose.counted_rows(left))
    }

    /// All that differ: what the belief's vector does not have, and then the others.
    fn all(&self) -> impl Iterator<Item = &Deviation> {
        let tied = self.tied.iter().map(|(_, deviation)| deviation);
        self.foreign.iter().chain(tied)
    }

    /// The column of the torque laws among all that differ.
    pub fn torque_laws(&self) -> Option<usize> {
        self.all().position(|each| *each == Deviation::TorqueLaws)
    }

    /// The column of a parameter among all that differ.
    pub fn column(&self, kind: ParameterKind) -> Option<usize> {
        self.all().position(|deviation| match *deviation {
            Deviation::Compliance(joint, _) => kind == ParameterKind::JointCompliance { joint },
            Deviation::Other(own) => own == kind,
            Deviation::TorqueLaws => false,
        })
    }

    /// Whether a parameter is known, or foreign, in its logarithm.
    fn is_logarithmic(&self, kind: ParameterKind) -> bool {
        let parameters = self.belief.uncertain.set().parameters();
        place(self.belief, kind).is_some_and(|place| parameters[place].is_logarithmic)
    }

    /// A standard deviation of a parameter in the unit of its column: compliances that are identified are linear.
    pub fn in_units(&self, kind: ParameterKind, deviation: f64) -> f64 {
        let is_compliance = matches!(kind, ParameterKind::JointCompliance { .. });
        if self.is_logarithmic(kind) || (place(self.belief, kind).is_none() && !is_compliance) {
            deviation
        } else {
            deviation * kind.whole(&self.arm)
        }
    }

    /// A difference that was drawn, in the unit of the parameter's column: that of a stiffness is its logarithm's.
    fn differs_by(&self, kind: ParameterKind, drawn: f64) -> f64 {
        match kind {
            ParameterKind::SpringStiffness { .. }
                if place(self.belief, kind).is_some() && !self.is_logarithmic(kind) =>
            {
                kind.whole(&self.arm) * drawn.exp_m1()
            }
            _ => drawn,
        }
    }

    /// By how much compliances are told to be others than believed, by their columns among all that differ and in the units of these.
    /// What an earlier identification says of them is sampled about what it found.
    pub fn told(&self, truth: &Truth) -> Vec<(usize, f64)> {
        let nominal = &self.belief.nominal.compliance_rad_per_nm;
        let own = &truth.robot.compliance_rad_per_nm;
        let is_told = |column: usize| column < self.foreign() || self.belief.prior.is_none();
        let told = self
            .all()
            .enumerate()
            .filter(|(column, _)| is_told(*column));
        told.filter_map(|(column, deviation)| match *deviation {
            Deviation::Compliance(joint, is_logarithmic) => {
                let differs = difference(own[joint], nominal[joint], is_logarithmic);
                Some((column, differs))
            }
            _ => None,
        })
        .collect()
    }

    /// Whether deflections of one configuration share errors, in truth or by the belief.
    pub fn is_shared_by_configuration(&self) -> bool {
        let sources = self.sources.iter().chain(&self.believed);
        self.belief.instrument.unloaded == Unloaded::Shared
            || sources.into_iter().any(ReadingSource::is_of_configuration)
    }

    fn together(
        &self,
        sources: &[ReadingSource],
        experiments: &[&Experiment],
    ) -> CovarianceTogether {
        let nothing = ParameterSet::empty();
        let mut model = self.readings_of(&nothing, 0, sources);
        model.move_to(experiments[0].configuration_rad.as_slice());
        model.covariance_together(experiments)
    }

    /// The covariance of the readings of experiments of one configuration, in truth.
    pub fn covariance(&self, experiments: &[&Experiment]) -> CovarianceTogether {
        self.together(&self.sources, experiments)
    }

    /// H with H H^T the covariance of the whitened noise of the readings of experiments of one configuration, where that is not what
    /// the belief whitens it with. Between experiments it counts as the root of their repeats' ratio.
    pub fn coloured(&self, experiments: &[&Experiment]) -> Option<DMatrix<f64>> {
        if self.believed == self.sources {
            return None;
        }
        let [believed, truth] = [&self.believed, &self.sources]
            .map(|sources| Cholesky::new(self.together(sources, experiments).all()));
        let mut half = believed?.l().try_inverse()? * truth?.l();
        let rows = half.nrows() / experiments.len();
        for (row, one) in experiments.iter().enumerate() {
            for (column, other) in experiments.iter().enumerate() {
                let mut block = half.view_mut((rows * row, rows * column), (rows, rows));
                block *= (f64::from(one.repeats) / f64::from(other.repeats)).sqrt();
            }
        }
        Some(half)
    }

    fn readings_of<'b>(
        &'b self,
        set: &ParameterSet,
        target: usize,
        sources: &'b [ReadingSource],
    ) -> PlannedReadings<'b> {
        let sizes = vec![1.0; set.len()];
        let precision = self.belief.instrument.precision();
        PlannedReadings::new(&self.arm, target, set, &sizes, precision, sources)
    }
}

/// By how much a compliance differs from another, or its logarithm.
fn difference(compliance: f64, nominal: f64, is_logarithmic: bool) -> f64 {
    if is_logarithmic {
        log_ratio(compliance, nominal)
    } else {
        compliance - nominal
    }
}

/// Columns with another after them.
fn beside(columns: DMatrix<f64>, last: &DMatrix<f64>) -> DMatrix<f64> {
    let place = columns.ncols();
    let mut columns = columns.insert_column(place, 0.0);
    columns.column_mut(place).copy_from(&last.column(0));
    columns
}

/// What runs draw of parameters that the whole plan shares.
fn drawn_kinds(truth: &Truth) -> Vec<ParameterKind> {
    let mut kinds = truth.kept().to_vec();
    for each in &truth.uncertainties {
        if let Source::Plan(parameters) = &each.source {
            for (kind, _) in parameters {
                if !kinds.contains(kind) {
                    kinds.push(*kind);
                }
            }
        }
    }
    kinds
}

/// Whether the virtual robot's compliance of a joint may not be the nominal one.
#[expect(clippy::float_cmp, reason = "the same number is meant")]
fn differs(belief: &Belief, truth: &Truth, drawn: &[ParameterKind], joint: usize) -> bool {
    belief.nominal.compliance_rad_per_nm[joint] != truth.robot.compliance_rad_per_nm[joint]
        || truth.compliance_spread[joint] > 0.0
        || (truth.earlier.as_ref()).is_some_and(|earlier| earlier.joints.contains(&joint))
        || drawn.contains(&ParameterKind::JointCompliance { joint })
}

/// Whether the belief's vector has a parameter, and where.
fn place(belief: &Belief, kind: ParameterKind) -> Option<usize> {
    belief.uncertain.set().index_of(kind)
}

/// The unknowns of which something is known before, where the virtual robot may be another.
fn tied(belief: &Belief, truth: &Truth, drawn: &[ParameterKind]) -> Vec<(usize, Deviation)> {
    let precision = belief.prior_information();
    let is_known = |index: &usize| precision[(*index, *index)] > 0.0;
    let deviation = |index: usize| {
        let of_joint = |joint, is_logarithmic| {
            differs(belief, truth, drawn, joint)
                .then_some(Deviation::Compliance(joint, is_logarithmic))
        };
        let parameter = &belief.uncertain.set().parameters()[index];
        match parameter.kind {
            ParameterKind::JointCompliance { joint } => of_joint(joint, parameter.is_logarithmic),
            kind => drawn.contains(&kind).then_some(Deviation::Other(kind)),
        }
    };
    (0..belief.unknowns())
        .filter(is_known)
        .filter_map(|index| Some((index, deviation(index)?)))
        .collect()
}

/// By how much (m, rad) the deflection of an arm at one of its tools differs from that of springs, where some joints of the true
/// robot have a law of their own. In the torques of the weight and of the load, at the commanded angles.
fn beyond_springs(
    arm: &ElasticArm,
    robot: &TrueRobot,
    target: usize,
    q: &[f64],
    load: &Load,
) -> Vector6<f64> {
    let chain = arm.loaded_chain();
    let at_tool = chain.at(&arm.tools[target]);
    let state = at_tool.state(q);
    let gravity = at_tool.gravity_m_s2();
    let mut seen = Vector6::zeros();
    for &(joint, law) in &robot.torque_laws {
        let compliance = robot.compliance_rad_per_nm[joint];
        let weight = compliance * state.gravity_torque(joint, &gravity);
        let loaded = compliance * state.load_torque(joint, load);
        let gives = law.deflection(weight + loaded) - law.deflection(weight) - loaded;
        let (moved, turned) = (state.position_column(joint), state.rotation_column(joint));
        seen += Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z) * gives;
    }
    seen
}
