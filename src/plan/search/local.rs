//! The best experiment near a given one, by sequential quadratic programming (Kraft's SLSQP).

use std::cell::{RefCell, RefMut};

use nalgebra::{DMatrix, Matrix3xX, Vector3};
use slsqp::{Func, StopTols, minimize};

use super::observation::MatrixEvaluator;
use super::point::{Point, experiment, force, in_directions, information_in};
use super::problem::Problem;
use crate::experiment::{Experiment, Loads};
use crate::numeric::factorisation::finite_eigen;
use crate::plan::SmoothBound;
use crate::robot::Load;

/// Experiments stay this far inside the smooth bounds (m, sine), so that rounding does not put them
/// outside.
const INSET: f64 = 1e-7;
/// The optimiser may leave a bound by this much before its result is refused.
const SLACK: f64 = 0.99 * INSET;
/// Up to so many joints an experiment of a plan is improved until it cannot be; the optimiser's dense subproblems grow with
/// their cube, so that beyond an improvement has fewer evaluations,
const SMALL: usize = 6;
/// but not fewer than these: the next sweep goes on.
const FEWEST: usize = 12;

/// How far joints (rad, m), and loads as shares of the largest, are moved to see what follows them.
const SHIFT: f64 = 1e-5;

/// When a local search ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Precision {
    /// A step that improves by less than this share is the last.
    tolerance: f64,
    /// The largest number of evaluations.
    evaluations: usize,
    /// A sweep over a plan's experiments that improves by less than this share is the last.
    pub converged: f64,
}

impl Precision {
    /// On the way.
    pub const ROUGH: Self = Self {
        tolerance: 1e-5,
        evaluations: 60,
        converged: 3e-5,
    };
    /// At the end.
    pub const FINE: Self = Self {
        tolerance: 1e-9,
        evaluations: 120,
        converged: 1e-6,
    };
}

/// A cost of an observation matrix (3 x p a block); it writes its derivative by that, times a factor, where that is wanted.
pub(super) type MatrixCost<'c> =
    dyn Fn(&Matrix3xX<f64>, Option<(&mut Matrix3xX<f64>, f64)>) -> f64 + 'c;

/// A cost of what experiments tell (p x p); it writes minus its derivative by that where it is wanted.
pub(super) type InformationCost<'c> = dyn Fn(&DMatrix<f64>, Option<&mut DMatrix<f64>>) -> f64 + 'c;

/// Local searches over one experiment; one for each thread.
#[derive(Debug, Clone)]
pub(super) struct LocalSearch<'a> {
    /// With where it stands, since the objective and every constraint are asked at the same configuration in turn.
    evaluator: RefCell<(MatrixEvaluator<'a>, Vec<f64>)>,
    problem: &'a Problem<'a>,
    gravity: Vector3<f64>,
}

/// What of the load is varied along with the joint angles, by variables of size one.
#[derive(Debug, Clone, Copy)]
pub(super) enum FreeLoad<'d> {
    /// Nothing.
    None,
    /// Nothing: it is a force of this size (N) along what gives most information in the directions G at each configuration.
    Best(&'d DMatrix<f64>, f64),
    /// The size of a force of this direction, between two sizes (N).
    Size(Vector3<f64>, [f64; 2]),
    /// A force up to this size (N).
    Force(f64),
}

impl FreeLoad<'_> {
    /// The variables of a load, and their ranges.
    fn variables(self, load: &Load) -> (Vec<f64>, Vec<(f64, f64)>) {
        match self {
            Self::None | Self::Best(..) => (Vec::new(), Vec::new()),
            Self::Size(direction, [low, high]) => (
                vec![direction.dot(&load.force_n).clamp(low, high) / high],
                vec![(low / high, 1.0)],
            ),
            Self::Force(size) => (
                load.force_n.iter().map(|force| force / size).collect(),
                vec![(-1.0, 1.0); 3],
            ),
        }
    }

    /// The load of its variables where an evaluator stands; the given one where nothing is varied.
    fn load(self, evaluator: &MatrixEvaluator<'_>, given: &Load, variables: &[f64]) -> Load {
        match self {
            Self::None => *given,
            Self::Best(directions, size) => force(&best_direction(evaluator, directions), size),
            Self::Size(direction, [_, high]) => force(&direction, variables[0] * high),
            Self::Force(size) => force(&Vector3::from_column_slice(variables), size),
        }
    }

    /// The variables of several loads, one's behind the other's, and their ranges.
    fn variables_of(self, loads: &[Load]) -> (Vec<f64>, Vec<(f64, f64)>) {
        let (mut all, mut ranges) = (Vec::new(), Vec::new());
        for load in loads {
            let (own, within) = self.variables(load);
            all.extend(own);
            ranges.extend(within);
        }
        (all, ranges)
    }

    /// The loads of these.
    fn loads(
        self,
        evaluator: &MatrixEvaluator<'_>,
        given: &[Load],
        variables: &[f64],
    ) -> Vec<Load> {
        let each = variables.len() / given.len();
        let loads = given.iter().enumerate();
        let own = |place: usize| &variables[each * place..each * (place + 1)];
        loads
            .map(|(place, load)| self.load(evaluator, load, own(place)))
            .collect()
    }

    /// From a derivative with respect to the force (per N) to those with respect to the variables.
    fn pull_back(self, slope: &Vector3<f64>, gradient: &mut [f64]) {
        match self {
            Self::None | Self::Best(..) => {}
            Self::Size(direction, [_, high]) => gradient[0] = slope.dot(&direction) * high,
            Self::Force(size) => gradient.copy_from_slice((slope * size).as_slice()),
        }
    }
}

impl<'a> LocalSearch<'a> {
    pub fn new(problem: &'a Problem<'a>) -> Self {
        let evaluator = problem.evaluator();
        Self {
            gravity: evaluator.readings.gravity_m_s2(),
            evaluator: RefCell::new((evaluator, Vec::new())),
            problem,
        }
    }

    /// Experiments are from now on repeated so often.
    pub fn set_repeats(&self, repeats: u32) {
        self.evaluator.borrow_mut().0.readings.set_repeats(repeats);
    }

    /// The evaluator, at joint angles `q`.
    fn at(&self, q: &[f64]) -> RefMut<'_, MatrixEvaluator<'a>> {
        RefMut::map(self.evaluator.borrow_mut(), |(evaluator, at)| {
            if at != q {
                evaluator.readings.move_to(q);
                at.clear();
                at.extend_from_slice(q);
            }
            evaluator
        })
    }

    /// The point at joint angles `q` under a load, read along a direction.
    pub fn point(&self, q: &[f64], load: &Load, direction: Option<Vector3<f64>>) -> Point {
        let mut evaluator = self.at(q);
        evaluator.readings.read_along(direction.as_ref());
        let mut matrix = evaluator.matrix();
        evaluator.observe(load, &mut matrix);
        Point {
            q: q.to_vec(),
            load: *load,
            direction,
            matrix,
            blocks: evaluator.blocks(),
        }
    }

    /// Joint angles as near as the joint ranges allow.
    pub fn in_ranges(&self, mut q: Vec<f64>) -> Vec<f64> {
        clamp(&mut q, &self.problem.ranges);
        q
    }

    /// Whether a point lies within the smooth bounds.
    pub fn is_inside(&self, q: &[f64], load: &Load) -> bool {
        let evaluator = self.at(q);
        let state = evaluator.readings.state();
        let bounds = &mut self.problem.bounds.iter();
        bounds.all(|bound| bound.margin(state, load, &self.gravity) >= INSET - SLACK)
    }

    /// The largest size (N) that the torque bounds allow a force of a direction (unit vector) at joint
    /// angles `q`, between two sizes; none where they allow none.
    pub fn largest_size(
        &self,
        q: &[f64],
        direction: &Vector3<f64>,
        [low, high]: [f64; 2],
    ) -> Option<f64> {
        let evaluator = self.at(q);
        let state = evaluator.readings.state();
        let (mut least, mut most) = (low, high);
        for bound in &self.problem.bounds {
            let Some(slope) = bound.force_derivative(state) else {
                continue;
            };
            let slope = slope.dot(direction);
            let room = bound.margin(state, &Load::NONE, &self.gravity) - INSET;
            if slope < 0.0 {
                most = most.min(-room / slope);
            } else if slope > 0.0 {
                least = least.max(-room / slope);
            } else if room < 0.0 {
                return None;
            }
        }
        (least <= most).then_some(most)
    }

    /// Climbs from a start to a point of locally largest information in the directions G,
    /// trace(A G A^T), and returns it with that information. Lists of loads and of directions are tried one by one. A
    /// free force takes its best direction at every configuration on the way; where the torque bounds
    /// depend on it, it is varied along with the configuration.
    pub fn most_informative(
        &self,
        start: &Point,
        directions: &DMatrix<f64>,
        precision: Precision,
    ) -> Option<(Point, f64)> {
        let each = self.problem.task.directions.iter().filter_map(|direction| {
            let start = Point {
                direction: *direction,
                ..start.clone()
            };
            self.most_informative_along(&start, directions, precision)
        });
        each.max_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// The same along the direction of the start.
    fn most_informative_along(
        &self,
        start: &Point,
        directions: &DMatrix<f64>,
        precision: Precision,
    ) -> Option<(Point, f64)> {
        let q = &start.q;
        let climb = |load: &Load, free| self.climb(start, load, free, directions, precision);
        let best = |one: &(Point, f64), other: &(Point, f64)| one.1.total_cmp(&other.1);
        let is_varied = self.problem.is_force_varied();
        match &self.problem.task.loads {
            Loads::Direction { direction, force_n } if !is_varied => {
                climb(&force(direction, force_n[1]), FreeLoad::None)
            }
            Loads::Any { force_max_n } if !is_varied => {
                climb(&start.load, FreeLoad::Best(directions, *force_max_n))
            }
            Loads::Direction { direction, force_n } => {
                let size = self.largest_size(q, direction, *force_n);
                climb(
                    &force(direction, size.unwrap_or(force_n[1])),
                    self.free_load(),
                )
            }
            Loads::Any { force_max_n } => {
                let best_force = best_direction(&self.at(q), directions);
                // Opposite forces tell the same, but gravity helps one of them.
                let starts = [best_force, -best_force].map(|direction| {
                    let largest = self.largest_size(q, &direction, [0.0, *force_max_n]);
                    force(&direction, largest.unwrap_or(*force_max_n))
                });
                (starts.iter().chain([&start.load]))
                    .filter_map(|load| climb(load, self.free_load()))
                    .max_by(best)
            }
            listed => (listed.listed().into_iter().flatten())
                .filter_map(|load| climb(load, FreeLoad::None))
                .max_by(best),
        }
    }

    /// What of the load is varied in a plan's experiment: a free force turns along with the configuration, and changes its size
    /// where that matters.
    fn free_load(&self) -> FreeLoad<'static> {
        match self.problem.task.loads {
            Loads::Any { force_max_n } => FreeLoad::Force(force_max_n),
            Loads::Direction { direction, force_n } if self.problem.is_force_bounded() => {
                FreeLoad::Size(direction, force_n)
            }
            _ => FreeLoad::None,
        }
    }

    /// Climbs from a start under a load.
    pub fn climb(
        &self,
        from: &Point,
        load: &Load,
        free: FreeLoad<'_>,
        directions: &DMatrix<f64>,
        precision: Precision,
    ) -> Option<(Point, f64)> {
        let cost = |matrix: &Matrix3xX<f64>, slope: Option<(&mut Matrix3xX<f64>, f64)>| {
            if let Some((slope, unit)) = slope {
                in_directions(slope, -2.0 * unit, matrix, directions);
            }
            -information_in(matrix, directions)
        };
        let load = match free {
            FreeLoad::Best(..) => free.load(&self.at(&from.q), load, &[]),
            _ => *load,
        };
        let start = self.point(&from.q, &load, from.direction);
        let value = information_in(&start.matrix, directions);
        let unit = if value > 0.0 { value.recip() } else { 1.0 };
        let point = self.descend(&start, free, &cost, unit, precision)?;
        let value = information_in(&point.matrix, directions);
        Some((point, value))
    }

    /// Improves one experiment of a plan: minimises a cost of its observation matrix from a start.
    pub fn improve(
        &self,
        start: &Point,
        cost: &MatrixCost<'_>,
        precision: Precision,
    ) -> Option<Point> {
        let unit = cost(&start.matrix, None).abs().recip();
        if !unit.is_finite() || unit == 0.0 {
            return None;
        }
        self.descend(start, self.free_load(), cost, unit, self.in_turn(precision))
    }

    /// What an improvement in turn may take on the way to a plan.
    fn in_turn(&self, precision: Precision) -> Precision {
        let (small, cube) = (SMALL.pow(3), self.problem.ranges.len().pow(3));
        let fewer = precision.evaluations * small / cube.max(small);
        Precision {
            evaluations: fewer.max(FEWEST),
            ..precision
        }
    }

    /// Minimises a cost, times a unit, from a start within the bounds; `None` where the optimiser fails.
    fn descend(
        &self,
        start: &Point,
        free: FreeLoad<'_>,
        cost: &MatrixCost<'_>,
        unit: f64,
        precision: Precision,
    ) -> Option<Point> {
        let (joints, direction) = (start.q.len(), start.direction);
        self.at(&start.q).readings.read_along(direction.as_ref());
        let matrices = RefCell::new((start.matrix.clone(), start.matrix.clone()));
        let objective = |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let mut evaluator = self.at(&x[..joints]);
            let load = free.load(&evaluator, &start.load, &x[joints..]);
            let (matrix, factor) = &mut *matrices.borrow_mut();
            evaluator.observe(&load, matrix);
            let Some(gradient) = gradient else {
                return unit * cost(matrix, None);
            };
            let value = cost(matrix, Some((factor, unit)));
            gradient.fill(0.0);
            evaluator.pull_back(&load, factor, &mut gradient[..joints]);
            if gradient.len() > joints {
                let slope = evaluator.force_gradient(&load, factor);
                free.pull_back(&slope, &mut gradient[joints..]);
            }
            unit * value
        };
        let (q, loads) = self.minimise(&objective, &start.q, &[start.load], free, precision)?;
        Some(self.point(&q, &loads[0], direction))
    }

    /// Improves the experiments of one configuration, turned together: minimises a cost of what they tell together, which writes minus its
    /// derivatives where these are wanted.
    pub fn improve_together(
        &self,
        experiments: &[Experiment],
        cost: &InformationCost<'_>,
        precision: Precision,
    ) -> Option<Vec<Experiment>> {
        let (joints, free) = (self.problem.ranges.len(), self.free_load());
        let q = experiments[0].configuration_rad.as_slice();
        let loads: Vec<Load> = experiments.iter().map(|each| each.load).collect();
        let at = |x: &[f64]| {
            let evaluator = self.at(&x[..joints]);
            let loads = free.loads(&evaluator, &loads, &x[joints..]);
            let moved = experiments.iter().zip(loads);
            let moved = moved
                .map(|(each, load)| experiment(&x[..joints], load, each.direction, each.repeats));
            moved.collect::<Vec<_>>()
        };
        let told = |x: &[f64]| {
            let moved = at(x);
            let mut evaluator = self.at(&x[..joints]);
            evaluator.told_together(&moved.iter().collect::<Vec<_>>())
        };
        let unit = cost(&told(&[q, &free.variables_of(&loads).0].concat()), None).recip();
        let objective = |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let here = told(x);
            let Some(gradient) = gradient else {
                return unit * cost(&here, None);
            };
            let mut directions = here.clone();
            let value = cost(&here, Some(&mut directions));
            let mut moved = x.to_vec();
            for (place, slope) in gradient.iter_mut().enumerate() {
                let mut beside = |shift: f64| {
                    moved[place] = x[place] + shift;
                    told(&moved).dot(&directions)
                };
                *slope = -unit * (beside(SHIFT) - beside(-SHIFT)) / (2.0 * SHIFT);
                moved[place] = x[place];
            }
            unit * value
        };
        let found = self.minimise(&objective, q, &loads, free, precision);
        self.set_repeats(1);
        let (q, loads) = found?;
        let turned = experiments.iter().zip(loads);
        let turned = turned.map(|(each, load)| experiment(&q, load, each.direction, each.repeats));
        Some(turned.collect())
    }

    /// Minimises a function of joint angles and of what is free of the loads that hang there, from within the bounds; `None` where the
    /// optimiser fails.
    fn minimise(
        &self,
        objective: &dyn Func<()>,
        q: &[f64],
        loads: &[Load],
        free: FreeLoad<'_>,
        precision: Precision,
    ) -> Option<(Vec<f64>, Vec<Load>)> {
        let joints = q.len();
        let (variables, of_loads) = free.variables_of(loads);
        let each = variables.len() / loads.len();
        let x = [q, &variables].concat();
        let ranges = [&*self.problem.ranges, &of_loads].concat();
        // Not positive inside.
        let constraint = |(place, bound): (usize, SmoothBound)| {
            let own = joints + each * place..joints + each * (place + 1);
            move |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
                let evaluator = self.at(&x[..joints]);
                let state = evaluator.readings.state();
                let load = free.load(&evaluator, &loads[place], &x[own.clone()]);
                if let Some(gradient) = gradient {
                    gradient[joints..].fill(0.0);
                    if each > 0
                        && let Some(slope) = bound.force_derivative(state)
                    {
                        free.pull_back(&-slope, &mut gradient[own.clone()]);
                    }
                    for (joint, slope) in gradient[..joints].iter_mut().enumerate() {
                        *slope = -bound.derivative(state, &load, &self.gravity, joint);
                    }
                }
                INSET - bound.margin(state, &load, &self.gravity)
            }
        };
        let force_size = |place: usize| {
            let own = joints + each * place..joints + each * (place + 1);
            move |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
                let force = &x[own.clone()];
                if let Some(gradient) = gradient {
                    gradient.fill(0.0);
                    for (slope, value) in gradient[own.clone()].iter_mut().zip(force) {
                        *slope = 2.0 * value;
                    }
                }
                force.iter().map(|value| value * value).sum::<f64>() - 1.0
            }
        };
        let bounds = self.problem.bounds.iter();
        let constraints: Vec<_> = (0..loads.len())
            .flat_map(|place| bounds.clone().map(move |&bound| (place, bound)))
            .filter(|(place, bound)| *place == 0 || bound.is_of_load())
            .map(constraint)
            .collect();
        let is_force = matches!(free, FreeLoad::Force(_));
        let sizes: Vec<_> = (0..loads.len())
            .filter(|_| is_force)
            .map(force_size)
            .collect();
        let constraints: Vec<&dyn Func<()>> = (constraints.iter().map(|each| each as _))
            .chain(sizes.iter().map(|each| each as _))
            .collect();
        let mut x = run(objective, &x, &ranges, &constraints, precision)?;
        if is_force {
            // The optimiser may end with too large a force; where the largest is best but the cost has
            // kinks, with too small a one.
            for force in x[joints..].chunks_exact_mut(each) {
                let square = force.iter().map(|value| value * value).sum::<f64>();
                if square > 1.0 || (square > 0.0 && !self.problem.is_force_bounded()) {
                    for value in force {
                        *value /= square.sqrt();
                    }
                }
            }
        }
        let (q, variables) = x.split_at(joints);
        let loads = free.loads(&self.at(q), loads, variables);
        let is_inside = loads.iter().all(|load| self.is_inside(q, load));
        is_inside.then(|| (q.to_vec(), loads))
    }
}

/// Minimises; `None` where the optimiser fails.
fn run(
    objective: &dyn Func<()>,
    start: &[f64],
    ranges: &[(f64, f64)],
    constraints: &[&dyn Func<()>],
    precision: Precision,
) -> Option<Vec<f64>> {
    let tolerances = StopTols {
        ftol_rel: precision.tolerance,
        ..StopTols::default()
    };
    let result = minimize(
        objective,
        start,
        ranges,
        constraints,
        (),
        precision.evaluations,
        Some(tolerances),
    );
    let mut x = match result {
        Ok((_, x, _)) | Err((_, x, _)) => x,
    };
    clamp(&mut x, ranges);
    x.iter().all(|value| value.is_finite()).then_some(x)
}

fn clamp(x: &mut [f64], ranges: &[(f64, f64)]) {
    for (value, &(low, high)) in x.iter_mut().zip(ranges) {
        *value = value.clamp(low, high);
    }
}

/// The direction of the force that gives most information: trace(A G A^T) = F^T Q F, so it points
/// along the largest eigenvector of Q.
fn best_direction(evaluator: &MatrixEvaluator<'_>, directions: &DMatrix<f64>) -> Vector3<f64> {
    let direction = match finite_eigen(&evaluator.force_form(directions)) {
        Some(eigen) => eigen
            .eigenvectors
            .column(eigen.eigenvalues.imax())
            .into_owned(),
        None => Vector3::z(),
    };
    // Of the two opposite directions, which tell the same, the one that points down.
    if direction.z > 0.0 {
        -direction
    } else {
        direction.into_owned()
    }
}
