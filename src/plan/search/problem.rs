//! What is searched: the planning problem in relative units.

use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::DMatrix;

use super::error::SearchError;
use super::joints::{indifferent_joints, is_loaded, random_information};
use super::observation::MatrixEvaluator;
use super::point::{add_information, in_directions};
use super::relevance::{relevant, relevant_in};
use crate::compensation::{test_pose_matrix, weighted_rows};
use crate::experiment::Loads;
use crate::numeric::estimable::Estimable;
use crate::observation::{ComplianceColumns, PlannedReadings};
use crate::plan::{
    Criterion, CriterionFunction, Experiment, Plan, SmoothBound, as_repeats, bounds_of,
    sharing_groups, task_rows, widened,
};
use crate::task::{Extended, Region, Task, TestPose};

/// How much work a search does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Random experiments that are looked through for promising ones.
    pub pool: usize,
    /// How many of these a search over one experiment starts from, for the approximate design.
    pub probes: usize,
    /// Random starts of the search on which the certificate rests, at most.
    pub certificate_probes: usize,
    /// Searches over whole plans, at most.
    pub searches: usize,
}

/// The work of searches, in units of their variables' cube: enough for all searches of arms with up to nine
/// variables and plans of some thirty experiments.
const WORK: usize = 6_000_000;

impl Default for Effort {
    fn default() -> Self {
        Self {
            pool: 1000,
            probes: 16,
            certificate_probes: 1024,
            searches: 240,
        }
    }
}

/// A planning problem: the region, the loads, the criterion and the model, in relative units.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    /// What is planned for.
    pub task: &'a Task,
    /// What makes a plan good.
    pub criterion: Criterion,
    /// How much work the search does.
    pub effort: Effort,
    /// When set, searches end with what they have.
    pub stop: Option<&'a AtomicBool>,
    /// What plans may be of, where that is listed.
    among: Option<&'a [Experiment]>,
    pub(super) bounds: Vec<SmoothBound>,
    pub(super) ranges: Vec<(f64, f64)>,
    /// Joints whose angle changes neither what any experiment tells nor the smooth bounds: axis 1
    /// under a vertical load.
    pub(super) indifferent: Vec<usize>,
    /// The unknowns of the belief that the search considers, by their places in ascending order: the identified compliances that show,
    /// and where more counts, of the others what matters.
    considered: Vec<usize>,
    /// Where only combinations of these show in any experiment: a basis of what does, in relative units;
    /// the plan is then about its coordinates.
    pub(super) basis: Option<DMatrix<f64>>,
    /// Why no plan can be what is asked for.
    impossible: Option<SearchError>,
    /// The typical size of each unknown, as of a compliance (rad/(N m)): the unit in which all is told.
    pub(super) sizes: Vec<f64>,
    /// All that is uncertain, where more than the compliances and the noise of each deflection counts.
    pub(super) extended: Option<&'a Extended>,
    /// What is known before, and what mandatory experiments tell, shared out among the free ones; it stands
    /// beside an approximate design.
    pub(super) beside: Option<DMatrix<f64>>,
    /// C^T in relative units, in coordinates of the basis where there is one.
    pub(super) test_poses: DMatrix<f64>,
    /// What is known before any measurement, p x p, in the same units and coordinates.
    pub(super) prior: DMatrix<f64>,
}

impl<'a> Problem<'a> {
    /// The planning problem of a task for a criterion. For the test pose, compliances or combinations
    /// that no experiment shows and that do not matter there are left out; every other criterion is about
    /// all compliances.
    pub fn new(task: &'a Task, criterion: Criterion) -> Self {
        Self::considering(None, task, criterion, None)
    }

    /// That for the test poses with all that is uncertain, be it little.
    pub fn of_all(task: &'a Task) -> Self {
        let all = (0..task.belief.unknowns()).collect();
        Self::considering(Some(all), task, Criterion::TestPose, None)
    }

    /// The same for plans of these experiments alone: what none of them shows, no plan does.
    pub fn among(task: &'a Task, criterion: Criterion, experiments: &'a [Experiment]) -> Self {
        Self::considering(None, task, criterion, Some(experiments))
    }

    /// The problem with these unknowns considered, or those that matter for random plans; of plans of some experiments alone, or of any.
    fn considering(
        considered: Option<Vec<usize>>,
        task: &'a Task,
        criterion: Criterion,
        among: Option<&'a [Experiment]>,
    ) -> Self {
        let mut problem = Self::of_unknowns(considered, task, criterion);
        let names = task.belief.uncertain.further().map(str::to_owned);
        let names: Vec<String> = names.collect();
        if criterion != Criterion::TestPose && !names.is_empty() {
            problem.impossible = Some(SearchError::CompliancesAlone(names));
            return problem;
        }
        let size = problem.parameters();
        let information = &problem.prior
            + among.map_or_else(
                || random_information(problem.evaluator(), &problem.ranges, task).0,
                |experiments| {
                    let zero = DMatrix::zeros(size, size);
                    let each = experiments.iter().map(|each| problem.told(each, 1));
                    each.fold(zero, |sum, told| sum + told)
                },
            );
        let shown = Estimable::new(&information, &vec![1.0; size]);
        if !shown.is_complete() {
            problem = problem.within(&shown, &information);
        }
        if problem.is_informed() {
            // What nothing else shows is known from before in every design.
            let share = f64::from(task.design.experiments.max(1));
            problem.beside = Some(&problem.prior / share);
        }
        if among.is_none() && problem.impossible.is_none() {
            problem.indifferent =
                indifferent_joints(problem.evaluator(), &problem.ranges, task, &problem.bounds);
        }
        Self { among, ..problem }
    }

    /// The problem within what experiments show, if that is enough.
    fn within(mut self, shown: &Estimable, information: &DMatrix<f64>) -> Self {
        let basis = shown.basis();
        let size = self.parameters();
        let silent: Vec<bool> = (0..size)
            .map(|index| basis.row(index).iter().all(|value| *value == 0.0))
            .collect();
        let missing: Vec<usize> = if self.criterion == Criterion::TestPose {
            let rows = self.test_poses.transpose();
            let inverse = (basis.tr_mul(information) * basis).try_inverse();
            let within = &rows * basis;
            let variance = inverse.map(|inverse| (&within * inverse * within.transpose()).trace());
            shown.missing(&rows, variance.unwrap_or(0.0).max(0.0).sqrt())
        } else {
            let unit = |index| DMatrix::from_fn(1, size, |_, at| f64::from(u8::from(at == index)));
            let needs = |&index: &usize| !shown.missing(&unit(index), 0.0).is_empty();
            (0..size).filter(needs).collect()
        };
        let names = self.names();
        let named = |indices: &[usize]| indices.iter().map(|&index| names[index].clone()).collect();
        let (alone, together): (Vec<usize>, Vec<usize>) =
            missing.iter().partition(|&&index| silent[index]);
        let joints = self.joints();
        if missing.iter().any(|&index| index >= joints.len()) {
            self.impossible = Some(SearchError::Undetermined(named(&missing)));
        } else if !alone.is_empty() {
            let is_faint = |&&index: &&usize| {
                is_loaded(self.evaluator(), &self.ranges, self.task, joints[index])
            };
            let (faint, idle): (Vec<usize>, Vec<usize>) = alone.iter().partition(is_faint);
            self.impossible = Some(if idle.is_empty() {
                SearchError::Faint(named(&faint))
            } else {
                SearchError::NotExcited(named(&idle))
            });
        } else if !together.is_empty() {
            self.impossible = Some(SearchError::Inseparable(named(&together)));
        } else if basis.ncols() > 0 {
            let kept: Vec<usize> = (0..size).filter(|&index| !silent[index]).collect();
            if kept.len() == basis.ncols() && self.extended.is_none() {
                let kept = kept.iter().map(|&index| self.considered[index]).collect();
                return Self::of_unknowns(Some(kept), self.task, self.criterion);
            }
            self.test_poses = basis.tr_mul(&self.test_poses);
            self.prior = basis.tr_mul(&self.prior) * basis;
            self.basis = Some(basis.clone());
        }
        self
    }

    /// About these unknowns, or those that matter for random plans.
    fn of_unknowns(considered: Option<Vec<usize>>, task: &'a Task, criterion: Criterion) -> Self {
        let belief = &task.belief;
        // The criteria of Table 1 are about the instrument's noise alone.
        let is_counted = criterion == Criterion::TestPose || belief.uncertain.is_plain();
        let extended =
            Some(&belief.uncertain).filter(|each| is_counted && !each.has_closed_forms());
        let (ranges, sizes, joints) = (ranges_of(&task.region), belief.sizes(), &belief.parameters);
        let rows = if extended.is_some() {
            task_rows(task)
        } else {
            let rows = |pose: &TestPose| test_pose_matrix(belief, pose, joints);
            weighted_rows(&task.test_poses, joints.len(), &rows)
        };
        let test_poses = scaled(&rows, &sizes);
        let considered = considered.unwrap_or_else(|| match extended {
            Some(extended) => relevant(task, extended, &sizes, &test_poses, &ranges),
            None => (0..joints.len()).collect(),
        });
        let prior = belief.prior_information();
        Self {
            among: None,
            indifferent: Vec::new(),
            bounds: bounds_of(&task.region),
            ranges,
            test_poses: test_poses.select_rows(&considered),
            prior: (prior.select_rows(&considered)).select_columns(&considered),
            sizes: considered.iter().map(|&place| sizes[place]).collect(),
            extended,
            considered,
            basis: None,
            impossible: None,
            beside: None,
            criterion,
            effort: Effort::default(),
            stop: None,
            task,
        }
    }

    /// Whether searches are to end.
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// The same problem by a criterion that asks for the same compliances.
    pub(super) fn by(&self, criterion: Criterion) -> Self {
        Self {
            criterion,
            ..self.clone()
        }
    }

    /// The same problem over the smooth bounds of a class of plans: those of the region, widened.
    pub(super) fn widened(&self) -> Self {
        let region = widened(&self.task.region);
        Self {
            bounds: bounds_of(&region),
            ranges: ranges_of(&region),
            ..self.clone()
        }
    }

    /// The same problem near an experiment's joint angles, whatever the bounds of the region.
    pub(super) fn near(&self, experiment: &Experiment, within_rad: f64) -> Self {
        let range = |angle: &f64| (angle - within_rad, angle + within_rad);
        Self {
            bounds: Vec::new(),
            ranges: experiment.configuration_rad.iter().map(range).collect(),
            ..self.clone()
        }
    }

    /// The same problem beside what is known before and the mandatory experiments, for plans of so many
    /// measurements; `None` where there is neither, or where the mandatory ones are more.
    pub(super) fn beside_known(&self, measurements: u32) -> Option<Self> {
        let mandatory = &self.task.design.mandatory;
        let count = mandatory.measurements();
        let is_informed = count > 0 || self.is_informed();
        let free = measurements.checked_sub(count).filter(|_| is_informed)?;
        // Without any that are free, those there are tell next to nothing.
        let free = f64::from(free).max(1e-3);
        Some(Self {
            beside: Some(self.information(mandatory) / free),
            ..self.clone()
        })
    }

    /// Whether something is known before any measurement.
    fn is_informed(&self) -> bool {
        self.prior.amax() > 0.0
    }

    /// How many searches over so many experiments at once there is time for. One takes work that grows as
    /// their number times the cube of the variables of each: joint angles, and what of the force is free.
    pub(super) fn affordable(&self, experiments: usize) -> usize {
        let of_load = match self.task.loads {
            Loads::Fixed(_) | Loads::List(_) => 0,
            Loads::Direction { .. } => 1,
            Loads::Any { .. } => 3,
        };
        let variables = self.ranges.len() + of_load;
        WORK / (experiments.max(1) * variables.pow(3)).max(1)
    }

    /// Whether the force varies along with the configuration: where bounds depend on it, or what else is uncertain or a gauge does.
    pub(super) fn is_force_varied(&self) -> bool {
        self.is_force_bounded() || self.extended.is_some() || self.task.reads_along()
    }

    /// The names of the unknowns.
    fn names(&self) -> Vec<String> {
        let all = self.task.belief.unknown_names();
        (self.considered.iter())
            .map(|&place| all[place].clone())
            .collect()
    }

    /// The joints whose compliances the plan is to determine.
    pub(super) fn joints(&self) -> Vec<usize> {
        let all = &self.task.belief.parameters;
        (self.considered.iter())
            .filter_map(|&place| all.get(place).copied())
            .collect()
    }

    /// The uncertainties that the search leaves out, by name: they make next to nothing of any prediction.
    pub fn left_out(&self) -> Vec<&str> {
        let Some(extended) = self.extended else {
            return Vec::new();
        };
        let is_out = |places: &[usize]| places.iter().all(|place| !self.considered.contains(place));
        (extended.shared().iter())
            .filter(|(_, places)| is_out(places))
            .map(|(name, _)| name.as_str())
            .collect()
    }

    /// The problem with what is left out and counts in a plan considered, if there is such.
    pub(super) fn with_left_out(&self, plan: &Plan) -> Option<Self> {
        let considered = relevant_in(self.task, self.extended?, plan, &self.considered)?;
        Some(Self {
            effort: self.effort,
            stop: self.stop,
            ..Self::considering(Some(considered), self.task, self.criterion, self.among)
        })
    }

    /// What a plan costs; `None` where it does not determine what is asked for.
    pub(super) fn value(&self, plan: &Plan) -> Option<f64> {
        self.cost().value(&self.information(plan))
    }

    /// Whether deflections of one configuration share something that repeats do not average.
    pub(super) fn is_shared_by_configuration(&self) -> bool {
        self.extended
            .is_some_and(Extended::is_shared_by_configuration)
    }

    /// Whether repeats of an experiment share something that they do not average.
    pub(super) fn is_shared_by_repeats(&self) -> bool {
        self.extended.is_some_and(Extended::is_shared_by_repeats)
    }

    /// Whether bounds of the region depend on the load. Otherwise the largest force is best: information grows
    /// with the square of its size, and the criterion is the better for more of every information.
    pub(super) fn is_force_bounded(&self) -> bool {
        self.bounds.iter().any(SmoothBound::is_of_load)
    }

    /// The criterion whose approximate design is this problem's.
    ///
    /// # Errors
    /// Plans over a region are not optimised by the problem's criterion, or what is asked for does not show.
    pub(super) fn optimised_as(&self) -> Result<Criterion, SearchError> {
        self.check_excited()?;
        let not_optimised = SearchError::NotOptimised(self.criterion.name());
        self.criterion.bounded_as().ok_or(not_optimised)
    }

    /// What is asked for must show in some experiments.
    ///
    /// # Errors
    /// The compliances that do not are named.
    pub(super) fn check_excited(&self) -> Result<(), SearchError> {
        self.impossible.clone().map_or(Ok(()), Err)
    }

    /// The fewest measurements that give as many numbers as there are to find: unknowns, or their combinations, of which nothing is known
    /// before.
    pub fn fewest(&self) -> u32 {
        let size = self.parameters();
        let known = if self.is_informed() {
            Estimable::new(&self.prior, &vec![1.0; size]).rank()
        } else {
            0
        };
        (self.task.belief.instrument.reads_along()).fewest(size - known)
    }

    /// Whether a plan determines what the criterion asks for.
    pub(super) fn is_determined_by(&self, plan: &Plan) -> bool {
        let information = self.information(plan);
        let value = self.cost().value(&information).unwrap_or(0.0);
        determines(&information, self.criterion, &self.test_poses, value)
    }

    /// The number p of compliances, or of their combinations.
    pub fn parameters(&self) -> usize {
        (self.basis.as_ref()).map_or(self.sizes.len(), DMatrix::ncols)
    }

    /// An evaluator of this problem's experiments.
    pub fn evaluator(&self) -> MatrixEvaluator<'a> {
        let belief = &self.task.belief;
        let precision = belief.instrument.precision();
        let (joints, sizes) = (&self.joints(), &self.sizes);
        let readings = if let Some(extended) = self.extended {
            extended.readings(&self.considered, sizes, precision)
        } else {
            let arm = belief.arm_with(&belief.calibration_tool);
            PlannedReadings::of_compliances(arm, joints, sizes, precision)
        };
        let compliances = ComplianceColumns::new(joints, &sizes[..joints.len()], precision);
        MatrixEvaluator::new(readings, compliances, self.basis.as_ref())
    }

    /// The criterion as a cost.
    pub fn cost(&self) -> CriterionFunction {
        self.cost_of(self.criterion)
    }

    /// Any other criterion of the same problem.
    pub fn cost_of(&self, criterion: Criterion) -> CriterionFunction {
        CriterionFunction::new(criterion, self.test_poses.clone())
    }

    /// What an experiment tells that is measured so often, p x p.
    pub(super) fn told(&self, experiment: &Experiment, repeats: u32) -> DMatrix<f64> {
        let mut evaluator = self.evaluator();
        let mut matrix = evaluator.matrix();
        let mut information = DMatrix::zeros(self.parameters(), self.parameters());
        evaluator.observe_experiment(experiment, repeats, &mut matrix);
        add_information(&mut information, &matrix, f64::from(repeats));
        information
    }

    /// The scaled information matrix of a plan, with what is known before it.
    pub fn information(&self, plan: &Plan) -> DMatrix<f64> {
        let plan = &*match self.extended {
            Some(extended) => as_repeats(plan, extended),
            None => Cow::Borrowed(plan),
        };
        let mut evaluator = self.evaluator();
        let mut matrix = evaluator.matrix();
        let mut information = self.prior.clone();
        for group in sharing_groups(plan, self.is_shared_by_configuration()) {
            if let [alone] = group[..] {
                evaluator.observe_experiment(alone, alone.repeats, &mut matrix);
                add_information(&mut information, &matrix, f64::from(alone.repeats));
            } else {
                evaluator.readings.stand_at(group[0]);
                information += evaluator.told_together(&group);
            }
        }
        information
    }

    /// What experiments tell together, p x p; those of one configuration may share errors.
    pub(super) fn told_by(&self, experiments: Vec<Experiment>) -> DMatrix<f64> {
        self.information(&Plan { experiments }) - &self.prior
    }

    /// A plan's cost, and its derivatives with respect to the joint angles of each of its experiments. Those of one configuration
    /// that share errors turn together: each has the derivatives of all of them.
    pub fn cost_and_gradient(&self, plan: &Plan) -> (f64, Vec<Vec<f64>>) {
        let size = self.parameters();
        let mut directions = DMatrix::zeros(size, size);
        let cost = self.cost().cost(&self.information(plan), &mut directions);
        let mut evaluator = self.evaluator();
        let (mut matrix, mut factor) = (evaluator.matrix(), evaluator.matrix());
        let joints = self.task.belief.joints();
        let groups = sharing_groups(plan, self.is_shared_by_configuration());
        let gradient = plan.experiments.iter().map(|experiment| {
            let mut gradient = vec![0.0; joints];
            let is_own =
                |group: &&Vec<&Experiment>| group.len() > 1 && group[0].stands_as(experiment);
            if let Some(group) = groups.iter().find(is_own) {
                evaluator.readings.stand_at(experiment);
                let q = experiment.configuration_rad.as_slice();
                evaluator.gradient_together(q, group, &directions, &mut gradient);
                return gradient;
            }
            evaluator.observe_experiment(experiment, experiment.repeats, &mut matrix);
            let weight = -2.0 * f64::from(experiment.repeats);
            in_directions(&mut factor, weight, &matrix, &directions);
            evaluator.pull_back(&experiment.load, &factor, &mut gradient);
            gradient
        });
        (cost, gradient.collect())
    }
}

/// Whether an information matrix determines what a criterion asks for beyond rounding: test poses (C^T) with this `rho_0`, or all.
pub(super) fn determines(
    information: &DMatrix<f64>,
    criterion: Criterion,
    test_poses: &DMatrix<f64>,
    rho0_m: f64,
) -> bool {
    if Estimable::surely_all(information) {
        return true;
    }
    let estimable = Estimable::new(information, &vec![1.0; information.nrows()]);
    match criterion {
        Criterion::TestPose => estimable
            .missing(&test_poses.transpose(), rho0_m)
            .is_empty(),
        _ => estimable.is_complete(),
    }
}

fn ranges_of(region: &Region) -> Vec<(f64, f64)> {
    let ranges = region.joint_range_rad.iter();
    ranges.map(|&[low, high]| (low, high)).collect()
}

/// C^T (p x 3 poses) in relative units.
fn scaled(rows: &DMatrix<f64>, sizes: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.ncols(), rows.nrows(), |parameter, row| {
        rows[(row, parameter)] * sizes[parameter]
    })
}
