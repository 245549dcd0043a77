//! The planning problem of a scenario for one's own criterion or optimiser.

use std::path::PathBuf;

use elastocal::plan::search::Problem;
use elastocal::plan::{Experiment, Feasibility, Plan};
use elastocal::robot::{Load, ObservationMatrix};
use elastocal::scenario::Scenario;
use nalgebra::{Dim, Matrix, RawStorage};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Rows = Vec<Vec<f64>>;

/// Observation matrices, ranges and the objective of a scenario.
#[pyclass(frozen, module = "elastocal._elastocal")]
pub struct PlanningProblem {
    scenario: Scenario,
}

#[pymethods]
impl PlanningProblem {
    /// Of a scenario file.
    #[new]
    fn new(py: Python<'_>, path: PathBuf, noise_only: bool) -> PyResult<Self> {
        py.detach(|| {
            let mut scenario =
                Scenario::load(&path).map_err(|error| PyValueError::new_err(error.to_string()))?;
            if noise_only {
                scenario.noise_only();
            }
            Ok(Self { scenario })
        })
    }

    /// The scenario file and all files that it names, with those that its models are made of.
    fn files(&self) -> Vec<PathBuf> {
        let own = std::iter::once(self.scenario.path.clone());
        own.chain(self.scenario.files.iter().cloned()).collect()
    }

    /// The columns in which configurations are written (q1_deg, ...).
    fn columns(&self) -> Vec<String> {
        self.scenario.task.belief.commands().columns()
    }

    /// The names of the p parameters.
    fn parameters(&self) -> Vec<String> {
        self.scenario.task.belief.parameter_names()
    }

    /// The standard deviation of each coordinate of a deflection (m).
    fn sigma_m(&self) -> f64 {
        self.scenario.task.belief.instrument.sigma_m
    }

    /// The nominal compliance of each parameter (rad/(N m)).
    fn nominal_rad_per_nm(&self) -> Vec<f64> {
        let belief = &self.scenario.task.belief;
        let compliance = &belief.nominal.compliance_rad_per_nm;
        belief
            .parameters
            .iter()
            .map(|&joint| compliance[joint])
            .collect()
    }

    /// The range of each commanded joint (deg, mm): lower ends, then upper ends.
    fn ranges(&self) -> Rows {
        let commands = self.scenario.task.belief.commands();
        let ranges = &self.scenario.task.region.joint_range_rad;
        let ends = |end: usize| {
            let values: Vec<f64> = ranges.iter().map(|range| range[end]).collect();
            commands.shown(&values)
        };
        vec![ends(0), ends(1)]
    }

    /// The position rows of the observation matrix, eq. 7: 3 x p (m N m/rad).
    fn observation_matrix(&self, q: Vec<f64>, wrench: [f64; 6]) -> PyResult<Rows> {
        self.reads_positions()?;
        let belief = &self.scenario.task.belief;
        let configuration = self.configuration(&q)?;
        let state = belief.nominal.chain.at(&belief.calibration_tool);
        let state = state
            .state(&configuration)
            .braced(&belief.nominal.compliance_rad_per_nm);
        let load = Load::from_wrench(wrench);
        Ok(rows(
            &ObservationMatrix::new(&state, &load, &belief.parameters).position,
        ))
    }

    /// The observation matrix of each test pose, eq. 23, times the root of its weight: 3 x p (m N m/rad) each.
    fn test_pose_matrices(&self) -> Vec<Rows> {
        let task = &self.scenario.task;
        let matrix = |pose: &elastocal::task::TestPose| {
            let found = elastocal::compensation::test_pose_matrix(
                &task.belief,
                pose,
                &task.belief.parameters,
            );
            rows(&(found * pose.weight.sqrt()))
        };
        task.test_poses.iter().map(matrix).collect()
    }

    /// rho0^2 (m^2) of experiments, and its gradient by every joint of every experiment (m^2/rad, m). Experiments of one
    /// configuration that share errors turn together: each has the gradient of all of them.
    fn objective(
        &self,
        py: Python<'_>,
        q: Rows,
        wrenches: Vec<[f64; 6]>,
        repeats: Vec<u32>,
    ) -> PyResult<(f64, Rows)> {
        let plan = self.plan(&q, wrenches, repeats)?;
        Ok(py.detach(|| self.value_and_gradient(&plan)))
    }

    /// What is impossible about a plan, in words; nothing where it can be measured.
    fn violations(
        &self,
        py: Python<'_>,
        q: Rows,
        wrenches: Vec<[f64; 6]>,
        repeats: Vec<u32>,
    ) -> PyResult<Vec<String>> {
        let plan = self.plan(&q, wrenches, repeats)?;
        Ok(py.detach(|| {
            let found = Feasibility::new(&self.scenario.task).violations(&plan);
            found.iter().map(ToString::to_string).collect()
        }))
    }
}

impl PlanningProblem {
    fn plan(&self, q: &Rows, wrenches: Vec<[f64; 6]>, repeats: Vec<u32>) -> PyResult<Plan> {
        self.reads_positions()?;
        if q.len() != wrenches.len() || q.len() != repeats.len() || q.is_empty() {
            return Err(PyValueError::new_err(
                "as many configurations as wrenches and repeats are needed, and at least one",
            ));
        }
        let mut experiments = Vec::new();
        for ((q, wrench), repeats) in q.iter().zip(wrenches).zip(repeats) {
            experiments.push(Experiment {
                configuration_rad: self.configuration(q)?.into(),
                load: Load::from_wrench(wrench),
                repeats,
                approach: None,
                direction: None,
            });
        }
        Ok(Plan { experiments })
    }

    /// That plans here say all: no direction to read along.
    fn reads_positions(&self) -> PyResult<()> {
        if self.scenario.task.reads_along() {
            return Err(PyValueError::new_err(
                "instrument.reads is \"displacement\": plans here say no direction to read along",
            ));
        }
        Ok(())
    }

    fn configuration(&self, written: &[f64]) -> PyResult<Vec<f64>> {
        let commands = self.scenario.task.belief.commands();
        if written.len() != commands.len() {
            return Err(PyValueError::new_err(format!(
                "found {} coordinates; the robot has {} commanded joints",
                written.len(),
                commands.len()
            )));
        }
        Ok(commands.configuration(written).as_slice().to_vec())
    }

    fn value_and_gradient(&self, plan: &Plan) -> (f64, Rows) {
        let problem = Problem::of_all(&self.scenario.task);
        problem.cost_and_gradient(plan)
    }
}

fn rows<R: Dim, C: Dim, S: RawStorage<f64, R, C>>(matrix: &Matrix<f64, R, C, S>) -> Rows {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}
