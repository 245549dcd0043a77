//! The best experiment near a given one, by sequential quadratic programming (Kraft's SLSQP).

use std::cell::RefCell;

use nalgebra::{DMatrix, Matrix3xX, Vector3};
use slsqp::{Func, StopTols, minimize};

use super::observation::Observer;
use super::point::{LoadChoice, Point, in_directions, information_in};
use super::problem::Problem;
use crate::plan::Bound;
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
    observer: RefCell<Seat<'a>>,
    bounds: Vec<Bound>,
    ranges: Vec<(f64, f64)>,
    loads: LoadChoice,
    gravity: Vector3<f64>,
    parameters: usize,
}

/// An observer that remembers where it stands, since the objective and every constraint are asked
/// at the same configuration in turn.
#[derive(Debug, Clone)]
struct Seat<'a> {
    observer: Observer<'a>,
    at: Vec<f64>,
}

impl Seat<'_> {
    fn move_to(&mut self, q: &[f64]) {
        if self.at != q {
            self.observer.move_to(q);
            self.at.clear();
            self.at.extend_from_slice(q);
        }
    }
}

impl<'a> LocalSearch<'a> {
    pub fn new(problem: &Problem<'a>) -> Self {
        let observer = problem.observer();
        Self {
            gravity: observer.gravity(),
            parameters: observer.parameters(),
            observer: RefCell::new(Seat {
                observer,
                at: Vec::new(),
            }),
            bounds: problem.bounds.clone(),
            ranges: problem.ranges.clone(),
            loads: problem.loads.clone(),
        }
    }

    /// The point at joint angles `q` under a load.
    pub fn point(&self, q: &[f64], load: &Load) -> Point {
        let mut matrix = Matrix3xX::zeros(self.parameters);
        let mut seat = self.observer.borrow_mut();
        seat.move_to(q);
        seat.observer.observe(load, &mut matrix);
        Point {
            q: q.to_vec(),
            load: *load,
            matrix,
        }
    }

    /// Joint angles as near as the joint ranges allow.
    pub fn in_ranges(&self, mut q: Vec<f64>) -> Vec<f64> {
        clamp(&mut q, &self.ranges);
        q
    }

    /// Whether a point lies within the smooth bounds.
    pub fn is_inside(&self, q: &[f64], load: &Load) -> bool {
        let mut seat = self.observer.borrow_mut();
        seat.move_to(q);
        let state = &seat.observer.state;
        self.bounds
            .iter()
            .all(|bound| bound.margin(state, load, &self.gravity) >= INSET - SLACK)
    }

    /// Climbs from a start to a point of locally largest information in the directions G,
    /// trace(A G A^T), and returns it with that information. A list of loads is tried one by one;
    /// a free force takes its best direction at every configuration on the way.
    pub fn most_informative(
        &self,
        q: &[f64],
        directions: &DMatrix<f64>,
        precision: Precision,
    ) -> Option<(Point, f64)> {
        match &self.loads {
            LoadChoice::OneOf(loads) => loads
                .iter()
                .filter_map(|load| self.climb(q, directions, precision, &|_| *load))
                .max_by(|one, other| one.1.total_cmp(&other.1)),
            LoadChoice::AnyDirection(size) => {
                let size = *size;
                self.climb(q, directions, precision, &|observer| {
                    best_force(observer, directions, size)
                })
            }
        }
    }

    fn climb(
        &self,
        q: &[f64],
        directions: &DMatrix<f64>,
        precision: Precision,
        load_at: &dyn Fn(&Observer<'_>) -> Load,
    ) -> Option<(Point, f64)> {
        let matrix = RefCell::new((
            Matrix3xX::zeros(self.parameters),
            Matrix3xX::zeros(self.parameters),
        ));
        let start_value = {
            let mut seat = self.observer.borrow_mut();
            seat.move_to(q);
            let load = load_at(&seat.observer);
            let (matrix, _) = &mut *matrix.borrow_mut();
            seat.observer.observe(&load, matrix);
            information_in(matrix, directions)
        };
        let unit = if start_value > 0.0 {
            start_value.recip()
        } else {
            1.0
        };
        let objective = |q: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let mut seat = self.observer.borrow_mut();
            seat.move_to(q);
            let load = load_at(&seat.observer);
            let (matrix, factor) = &mut *matrix.borrow_mut();
            seat.observer.observe(&load, matrix);
            if let Some(gradient) = gradient {
                in_directions(factor, -2.0 * unit, matrix, directions);
                gradient.fill(0.0);
                seat.observer.pull_back(&load, factor, gradient);
            }
            -unit * information_in(matrix, directions)
        };
        let load_here = |seat: &Seat<'_>| load_at(&seat.observer);
        let q = self.minimise(q, &objective, &load_here, precision)?;
        let load = {
            let mut seat = self.observer.borrow_mut();
            seat.move_to(&q);
            load_at(&seat.observer)
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
    /// load stays as it is, but a free force turns along with the configuration.
    pub fn improve(
        &self,
        start: &Point,
        cost: &dyn Fn(&Matrix3xX<f64>, &mut Matrix3xX<f64>) -> f64,
        precision: Precision,
    ) -> Option<Point> {
        let joints = start.q.len();
        let free = match self.loads {
            LoadChoice::AnyDirection(size) => Some(size),
            LoadChoice::OneOf(_) => None,
        };
        let load_of = |x: &[f64]| match free {
            Some(size) => Load {
                force_n: Vector3::from_column_slice(&x[joints..]) * size,
                torque_nm: Vector3::zeros(),
            },
            None => start.load,
        };
        let mut x = start.q.clone();
        let mut ranges = self.ranges.clone();
        if let Some(size) = free {
            x.extend(start.load.force_n.iter().map(|force| force / size));
            ranges.extend([(-1.0, 1.0); 3]);
        }
        let matrices = RefCell::new((start.matrix.clone(), start.matrix.clone()));
        let unit = {
            let (matrix, factor) = &mut *matrices.borrow_mut();
            cost(matrix, factor).abs().recip()
        };
        if !unit.is_finite() || unit == 0.0 {
            return None;
        }
        let objective = |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let mut seat = self.observer.borrow_mut();
            seat.move_to(&x[..joints]);
            let load = load_of(x);
            let (matrix, factor) = &mut *matrices.borrow_mut();
            seat.observer.observe(&load, matrix);
            let value = cost(matrix, factor);
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                *factor *= unit;
                seat.observer
                    .pull_back(&load, factor, &mut gradient[..joints]);
                if let Some(size) = free {
                    let slope = seat.observer.force_gradient(factor) * size;
                    gradient[joints..].copy_from_slice(slope.as_slice());
                }
            }
            unit * value
        };
        let mut x = self.minimise_with_force(&x, &ranges, &objective, &load_of, precision)?;
        // Where the cost has kinks, the optimiser may end with a force of another size.
        let force = x[joints..].iter().map(|value| value * value).sum::<f64>();
        if free.is_some() && force > 0.0 {
            for value in &mut x[joints..] {
                *value /= force.sqrt();
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
        let constraint = |bound: Bound| {
            move |q: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
                let mut seat = self.observer.borrow_mut();
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
        load_of: &dyn Fn(&[f64]) -> Load,
        precision: Precision,
    ) -> Option<Vec<f64>> {
        let joints = self.ranges.len();
        let constraint = |bound: Bound| {
            move |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
                let mut seat = self.observer.borrow_mut();
                seat.move_to(&x[..joints]);
                let load = load_of(x);
                let gradient = gradient.map(|gradient| {
                    gradient[joints..].fill(0.0);
                    &mut gradient[..joints]
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
        if x.len() > joints {
            constraints.push(&force_size);
        }
        run(objective, x, ranges, &constraints, precision)
    }

    /// A bound as the optimiser wants it: not positive inside.
    fn constraint(
        &self,
        seat: &Seat<'_>,
        bound: Bound,
        load: &Load,
        gradient: Option<&mut [f64]>,
    ) -> f64 {
        let state = &seat.observer.state;
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

/// The force of the given size that gives most information: trace(A G A^T) = F^T Q F, so it points
/// along the largest eigenvector of Q.
fn best_force(observer: &Observer<'_>, directions: &DMatrix<f64>, size: f64) -> Load {
    let eigen = observer.force_form(directions).symmetric_eigen();
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    // Of the two opposite directions, which tell the same, the one that points down.
    let downward = if direction.z > 0.0 { -size } else { size };
    let [x, y, z] = (direction * downward).into();
    Load::force(x, y, z)
}
