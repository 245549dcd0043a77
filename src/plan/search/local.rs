//! The best experiment near a given one, by sequential quadratic programming (Kraft's SLSQP).

use std::cell::RefCell;

use nalgebra::{DMatrix, Matrix3xX, Vector3};
use slsqp::{Func, StopTols, minimize};

use super::observation::MatrixEvaluator;
use super::point::{LoadChoice, Point, force, in_directions, information_in};
use super::problem::Problem;
use crate::numeric::factorisation::finite_eigen;
use crate::plan::SmoothBound;
use crate::robot::Load;

/// Experiments stay this far inside the smooth bounds (m, sine), so that rounding does not put them
/// outside.
const INSET: f64 = 1e-7;
/// The optimiser may leave a bound by this much before its result is refused.
const SLACK: f64 = 0.99 * INSET;

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

/// Local searches over one experiment; one for each thread.
#[derive(Debug, Clone)]
pub(super) struct LocalSearch<'a> {
    evaluator: RefCell<Seat<'a>>,
    bounds: Vec<SmoothBound>,
    ranges: Vec<(f64, f64)>,
    loads: LoadChoice,
    is_force_bounded: bool,
    is_force_varied: bool,
    gravity: Vector3<f64>,
}

/// What of the load is varied along with the joint angles, by variables of size one.
#[derive(Debug, Clone, Copy)]
enum FreeLoad {
    /// Nothing.
    None,
    /// The size of a force of this direction, between two sizes (N).
    Size(Vector3<f64>, [f64; 2]),
    /// A force up to this size (N).
    Force(f64),
}

impl FreeLoad {
    /// The variables of a load, and their ranges.
    fn variables(self, load: &Load) -> (Vec<f64>, Vec<(f64, f64)>) {
        match self {
            Self::None => (Vec::new(), Vec::new()),
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

    /// The load of its variables; the given one where nothing is varied.
    fn load(self, given: &Load, variables: &[f64]) -> Load {
        match self {
            Self::None => *given,
            Self::Size(direction, [_, high]) => force(&direction, variables[0] * high),
            Self::Force(size) => Load {
                force_n: Vector3::from_column_slice(variables) * size,
                torque_nm: Vector3::zeros(),
            },
        }
    }

    /// From a derivative with respect to the force (per N) to those with respect to the variables.
    fn pull_back(self, slope: &Vector3<f64>, gradient: &mut [f64]) {
        match self {
            Self::None => {}
            Self::Size(direction, [_, high]) => gradient[0] = slope.dot(&direction) * high,
            Self::Force(size) => gradient.copy_from_slice((slope * size).as_slice()),
        }
    }
}

/// An evaluator that remembers where it stands, since the objective and every constraint are asked
/// at the same configuration in turn.
#[derive(Debug, Clone)]
struct Seat<'a> {
    evaluator: MatrixEvaluator<'a>,
    at: Vec<f64>,
}

impl Seat<'_> {
    fn move_to(&mut self, q: &[f64]) {
        if self.at != q {
            self.evaluator.move_to(q);
            self.at.clear();
            self.at.extend_from_slice(q);
        }
    }
}

impl<'a> LocalSearch<'a> {
    pub fn new(problem: &Problem<'a>) -> Self {
        let evaluator = problem.evaluator();
        Self {
            gravity: evaluator.gravity(),
            evaluator: RefCell::new(Seat {
                evaluator,
                at: Vec::new(),
            }),
            is_force_bounded: problem.is_force_bounded(),
            is_force_varied: problem.is_force_varied(),
            bounds: problem.bounds.clone(),
            ranges: problem.ranges.clone(),
            loads: problem.loads.clone(),
        }
    }

    /// Searches over one load near joint angles, whatever the bounds of the region.
    pub fn near(mut self, q: &[f64], load: &Load, within_rad: f64) -> Self {
        let range = |angle: &f64| (angle - within_rad, angle + within_rad);
        self.ranges = q.iter().map(range).collect();
        self.loads = LoadChoice::OneOf(vec![*load]);
        self.bounds.clear();
        self
    }

    /// Experiments are from now on repeated so often.
    pub fn set_repeats(&self, repeats: u32) {
        let mut seat = self.evaluator.borrow_mut();
        seat.evaluator.set_repeats(repeats);
    }

    /// The point at joint angles `q` under a load.
    pub fn point(&self, q: &[f64], load: &Load) -> Point {
        let mut seat = self.evaluator.borrow_mut();
        let mut matrix = seat.evaluator.matrix();
        seat.move_to(q);
        seat.evaluator.observe(load, &mut matrix);
        Point {
            q: q.to_vec(),
            load: *load,
            matrix,
            blocks: seat.evaluator.blocks(),
        }
    }

    /// Joint angles as near as the joint ranges allow.
    pub fn in_ranges(&self, mut q: Vec<f64>) -> Vec<f64> {
        clamp(&mut q, &self.ranges);
        q
    }

    /// Whether a point lies within the smooth bounds.
    pub fn is_inside(&self, q: &[f64], load: &Load) -> bool {
        let mut seat = self.evaluator.borrow_mut();
        seat.move_to(q);
        let state = seat.evaluator.state();
        self.bounds
            .iter()
            .all(|bound| bound.margin(state, load, &self.gravity) >= INSET - SLACK)
    }

    /// The largest size (N) that the torque bounds allow a force of a direction (unit vector) at joint
    /// angles `q`, between two sizes; none where they allow none.
    pub fn largest_size(
        &self,
        q: &[f64],
        direction: &Vector3<f64>,
        [low, high]: [f64; 2],
    ) -> Option<f64> {
        let mut seat = self.evaluator.borrow_mut();
        seat.move_to(q);
        let state = seat.evaluator.state();
        let (mut least, mut most) = (low, high);
        for bound in &self.bounds {
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
    /// trace(A G A^T), and returns it with that information. A list of loads is tried one by one. A
    /// free force takes its best direction at every configuration on the way; where the torque bounds
    /// depend on it, it is varied along with the configuration.
    pub fn most_informative(
        &self,
        start: &Point,
        directions: &DMatrix<f64>,
        precision: Precision,
    ) -> Option<(Point, f64)> {
        let q = &start.q;
        match &self.loads {
            LoadChoice::OneOf(loads) => loads
                .iter()
                .filter_map(|load| self.climb(q, directions, precision, &|_| *load))
                .max_by(|one, other| one.1.total_cmp(&other.1)),
            LoadChoice::Size(direction, [_, high]) if !self.is_force_varied => {
                let load = force(direction, *high);
                self.climb(q, directions, precision, &|_| load)
            }
            LoadChoice::Ball(size) if !self.is_force_varied => {
                let size = *size;
                self.climb(q, directions, precision, &|evaluator| {
                    force(&best_direction(evaluator, directions), size)
                })
            }
            LoadChoice::Size(direction, sizes) => {
                let size = self.largest_size(q, direction, *sizes).unwrap_or(sizes[1]);
                self.climb_with_force(q, &force(direction, size), directions, precision)
            }
            LoadChoice::Ball(size) => {
                let best = {
                    let mut seat = self.evaluator.borrow_mut();
                    seat.move_to(q);
                    best_direction(&seat.evaluator, directions)
                };
                // Opposite forces tell the same, but gravity helps one of them.
                let starts = [best, -best].map(|direction| {
                    let largest = self.largest_size(q, &direction, [0.0, *size]);
                    force(&direction, largest.unwrap_or(*size))
                });
                (starts.iter().chain([&start.load]))
                    .filter_map(|load| self.climb_with_force(q, load, directions, precision))
                    .max_by(|one, other| one.1.total_cmp(&other.1))
            }
        }
    }

    /// Climbs from a start with the force as a variable.
    fn climb_with_force(
        &self,
        q: &[f64],
        load: &Load,
        directions: &DMatrix<f64>,
        precision: Precision,
    ) -> Option<(Point, f64)> {
        let cost = |matrix: &Matrix3xX<f64>, factor: &mut Matrix3xX<f64>| {
            in_directions(factor, -2.0, matrix, directions);
            -information_in(matrix, directions)
        };
        let point = self.improve(&self.point(q, load), &cost, precision)?;
        let value = information_in(&point.matrix, directions);
        Some((point, value))
    }

    fn climb(
        &self,
        q: &[f64],
        directions: &DMatrix<f64>,
        precision: Precision,
        load_at: &dyn Fn(&MatrixEvaluator<'_>) -> Load,
    ) -> Option<(Point, f64)> {
        let empty = self.evaluator.borrow().evaluator.matrix();
        let matrix = RefCell::new((empty.clone(), empty));
        let start_value = {
            let mut seat = self.evaluator.borrow_mut();
            seat.move_to(q);
            let load = load_at(&seat.evaluator);
            let (matrix, _) = &mut *matrix.borrow_mut();
            seat.evaluator.observe(&load, matrix);
            information_in(matrix, directions)
        };
        let unit = if start_value > 0.0 {
            start_value.recip()
        } else {
            1.0
        };
        let objective = |q: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let mut seat = self.evaluator.borrow_mut();
            seat.move_to(q);
            let load = load_at(&seat.evaluator);
            let (matrix, factor) = &mut *matrix.borrow_mut();
            seat.evaluator.observe(&load, matrix);
            if let Some(gradient) = gradient {
                in_directions(factor, -2.0 * unit, matrix, directions);
                gradient.fill(0.0);
                seat.evaluator.pull_back(&load, factor, gradient);
            }
            -unit * information_in(matrix, directions)
        };
        let load_here = |seat: &Seat<'_>| load_at(&seat.evaluator);
        let q = self.minimise(q, &objective, &load_here, precision)?;
        let load = {
            let mut seat = self.evaluator.borrow_mut();
            seat.move_to(&q);
            load_at(&seat.evaluator)
        };
        if !self.is_inside(&q, &load) {
            return None;
        }
        let point = self.point(&q, &load);
        let value = information_in(&point.matrix, directions);
        Some((point, value))
    }

    /// Improves one experiment of a plan: minimises a cost of its observation matrix from a start.
    /// `cost` returns the value and writes its derivative with respect to the matrix (3 x p). The
    /// load stays as it is, but a free force turns along with the configuration, and changes its size
    /// where that matters.
    pub fn improve(
        &self,
        start: &Point,
        cost: &dyn Fn(&Matrix3xX<f64>, &mut Matrix3xX<f64>) -> f64,
        precision: Precision,
    ) -> Option<Point> {
        let joints = start.q.len();
        let free = match self.loads {
            LoadChoice::Ball(size) => FreeLoad::Force(size),
            LoadChoice::Size(direction, sizes) if self.is_force_bounded => {
                FreeLoad::Size(direction, sizes)
            }
            LoadChoice::Size(..) | LoadChoice::OneOf(_) => FreeLoad::None,
        };
        let load_of = |x: &[f64]| free.load(&start.load, &x[joints..]);
        let (variables, of_load) = free.variables(&start.load);
        let x = [&*start.q, &variables].concat();
        let ranges = [&*self.ranges, &of_load].concat();
        let matrices = RefCell::new((start.matrix.clone(), start.matrix.clone()));
        let unit = {
            let (matrix, factor) = &mut *matrices.borrow_mut();
            cost(matrix, factor).abs().recip()
        };
        if !unit.is_finite() || unit == 0.0 {
            return None;
        }
        let objective = |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let mut seat = self.evaluator.borrow_mut();
            seat.move_to(&x[..joints]);
            let load = load_of(x);
            let (matrix, factor) = &mut *matrices.borrow_mut();
            seat.evaluator.observe(&load, matrix);
            let value = cost(matrix, factor);
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                *factor *= unit;
                seat.evaluator
                    .pull_back(&load, factor, &mut gradient[..joints]);
                if gradient.len() > joints {
                    let slope = seat.evaluator.force_gradient(&load, factor);
                    free.pull_back(&slope, &mut gradient[joints..]);
                }
            }
            unit * value
        };
        let mut x = self.minimise_with_force(&x, &ranges, &objective, free, &load_of, precision)?;
        if let FreeLoad::Force(_) = free {
            // The optimiser may end with too large a force; where the largest is best but the cost has
            // kinks, with too small a one.
            let force = x[joints..].iter().map(|value| value * value).sum::<f64>();
            if force > 1.0 || (force > 0.0 && !self.is_force_bounded) {
                for value in &mut x[joints..] {
                    *value /= force.sqrt();
                }
            }
        }
        let load = load_of(&x);
        self.is_inside(&x[..joints], &load)
            .then(|| self.point(&x[..joints], &load))
    }

    fn minimise(
        &self,
        q: &[f64],
        objective: &dyn Func<()>,
        load_here: &dyn Fn(&Seat<'_>) -> Load,
        precision: Precision,
    ) -> Option<Vec<f64>> {
        let constraint = |bound: SmoothBound| {
            move |q: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
                let mut seat = self.evaluator.borrow_mut();
                seat.move_to(q);
                let load = load_here(&seat);
                self.constraint(&seat, bound, &load, gradient)
            }
        };
        let constraints: Vec<_> = self.bounds.iter().map(|&bound| constraint(bound)).collect();
        let constraints: Vec<&dyn Func<()>> = constraints.iter().map(|each| each as _).collect();
        run(objective, q, &self.ranges, &constraints, precision)
    }

    fn minimise_with_force(
        &self,
        x: &[f64],
        ranges: &[(f64, f64)],
        objective: &dyn Func<()>,
        free: FreeLoad,
        load_of: &dyn Fn(&[f64]) -> Load,
        precision: Precision,
    ) -> Option<Vec<f64>> {
        let joints = self.ranges.len();
        let constraint = |bound: SmoothBound| {
            move |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
                let mut seat = self.evaluator.borrow_mut();
                seat.move_to(&x[..joints]);
                let load = load_of(x);
                let gradient = gradient.map(|gradient| {
                    let (of_joints, of_load) = gradient.split_at_mut(joints);
                    of_load.fill(0.0);
                    if let Some(slope) = bound.force_derivative(seat.evaluator.state()) {
                        free.pull_back(&-slope, of_load);
                    }
                    of_joints
                });
                self.constraint(&seat, bound, &load, gradient)
            }
        };
        let force_size = |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let force = &x[joints..];
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                for (slope, value) in gradient[joints..].iter_mut().zip(force) {
                    *slope = 2.0 * value;
                }
            }
            force.iter().map(|value| value * value).sum::<f64>() - 1.0
        };
        let constraints: Vec<_> = self.bounds.iter().map(|&bound| constraint(bound)).collect();
        let mut constraints: Vec<&dyn Func<()>> =
            constraints.iter().map(|each| each as _).collect();
        if let FreeLoad::Force(_) = free {
            constraints.push(&force_size);
        }
        run(objective, x, ranges, &constraints, precision)
    }

    /// A bound as the optimiser wants it: not positive inside.
    fn constraint(
        &self,
        seat: &Seat<'_>,
        bound: SmoothBound,
        load: &Load,
        gradient: Option<&mut [f64]>,
    ) -> f64 {
        let state = seat.evaluator.state();
        if let Some(gradient) = gradient {
            for (joint, slope) in gradient.iter_mut().enumerate() {
                *slope = -bound.derivative(state, load, &self.gravity, joint);
            }
        }
        INSET - bound.margin(state, load, &self.gravity)
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
