//! What the robot of a run does in each row of a plan and at the test poses, for those who show it.

use std::ops::Range;

use nalgebra::{DVector, Vector3};

use super::absolute::{ReadingRuns, ReadingsRun};
use super::tally::{FailedRun, Failure};
use super::virtual_readings::{VirtualReadingError, VisitedRow};
use crate::calibration::{Calibration, CalibrationError, CompensatedPose};
use crate::identification::{AbsoluteCase, IdentificationError};
use crate::robot::{EquilibriumError, Load};
use crate::task::{Station, Task, TestPose};
use crate::testbed::{MeasurementError, TrueRobots, Truth, VirtualRobot};

/// The virtual robot at rest.
#[derive(Debug, Clone)]
pub struct AtRest {
    /// The angles of the joints (rad).
    pub q_rad: Vec<f64>,
    /// MuJoCo's coordinates of all joints (rad, m).
    pub coordinates: Vec<f64>,
    /// Where what is read, or the machining tool, is (m, world frame).
    pub place_m: Vector3<f64>,
}

/// A row of a plan, or a test pose, as it was carried out.
#[derive(Debug, Clone)]
pub struct CarriedOutRow {
    /// Its readings in the plan's order, none at a test pose: repeats differ by what is new in each, and the first one is shown.
    pub readings: Range<usize>,
    /// The direction that a gauge reads along (unit vector, world frame).
    pub direction: Option<Vector3<f64>>,
    /// From where the loaded target is read (m, world frame), where somebody says.
    pub station_m: Option<Vector3<f64>>,
    /// The commanded angles (rad).
    pub commanded_rad: DVector<f64>,
    /// The load, in the world frame at the tool.
    pub load: Load,
    /// Without and with the load; at a test pose from where the tool is wanted, or predicted, to where it is.
    pub rests: [AtRest; 2],
}

/// A plan as the robot of a run carried it out.
#[derive(Debug, Clone)]
pub struct CarriedOut {
    /// The rows.
    pub rows: Vec<CarriedOutRow>,
    /// At each test pose, under the task's load: not compensated, or by the nominal robot; compensated, or by the identified robot.
    pub test_poses: Vec<[CarriedOutRow; 2]>,
}

impl AtRest {
    /// A robot as it came to rest last, with what is looked at there (m).
    pub fn of(robot: &VirtualRobot, place_m: Vector3<f64>) -> Self {
        Self {
            q_rad: robot.joint_angles(),
            coordinates: robot.simulation().coordinates().0.to_vec(),
            place_m,
        }
    }
}

impl CarriedOutRow {
    /// Loaded minus unloaded position (m), true to scale and without the instrument's errors.
    pub fn displacement_m(&self) -> Vector3<f64> {
        self.rests[1].place_m - self.rests[0].place_m
    }

    /// At a test pose.
    fn at(pose: &TestPose, commanded_rad: &DVector<f64>, rests: [AtRest; 2]) -> Self {
        Self {
            readings: 0..0,
            direction: None,
            station_m: None,
            commanded_rad: commanded_rad.clone(),
            load: pose.load,
            rests,
        }
    }
}

impl CarriedOut {
    /// A plan of deflections as the robot of a calibration's run under a seed carried it out.
    ///
    /// # Errors
    /// See [`CalibrationError`]; none that the calibration did not have already.
    pub fn of_deflections(
        task: &Task,
        truth: &Truth,
        seed: u64,
        calibration: &Calibration,
    ) -> Result<Self, CalibrationError> {
        let mut robots = TrueRobots::new(&task.belief, truth)?;
        let readings = calibration.plan.measurements() as usize;
        let normals = robots.become_run_of(truth, readings, seed, calibration.truth.run)?;
        let (visits, robot) = robots.visits(&calibration.plan, &normals);
        let mut first = 0;
        let mut rows = Vec::new();
        for (number, experiment) in (1..).zip(&calibration.plan.experiments) {
            let readings = first..first + experiment.repeats as usize;
            let visit = &visits[first];
            first = readings.end;
            let mut rest = |commanded: &DVector<f64>, load: &Load, loaded| {
                let rest = robot.rest(commanded, load);
                let (place_m, ..) = rest.map_err(|source| MeasurementError {
                    experiment: number,
                    loaded,
                    source,
                })?;
                Ok::<_, MeasurementError>(AtRest::of(robot, place_m))
            };
            let [before, under] = &visit.commanded_rad;
            let mut rests = [
                rest(before, &Load::NONE, false)?,
                rest(under, &visit.load, true)?,
            ];
            rests[1].place_m += visit.discrepancy_m();
            rows.push(CarriedOutRow {
                readings,
                direction: experiment.direction,
                station_m: None,
                commanded_rad: experiment.configuration_rad.clone(),
                load: experiment.load,
                rests,
            });
        }
        let poses = task.test_poses.iter().zip(&calibration.poses);
        let mut at_work = |pose: &TestPose, compensated: &CompensatedPose| {
            let wanted = robots.machining_tool(&pose.configuration_rad, &Load::NONE);
            let wanted = wanted.map(|(place_m, _)| AtRest::of(robots.machining(), place_m))?;
            let mut with = |commanded_rad: &DVector<f64>| {
                let place_m = robots.machining_tool_at_work(commanded_rad, pose)?;
                let rests = [wanted.clone(), AtRest::of(robots.machining(), place_m)];
                Ok(CarriedOutRow::at(pose, commanded_rad, rests))
            };
            let nominal = with(&pose.configuration_rad)?;
            Ok([nominal, with(&compensated.commanded_rad)?])
        };
        let test_poses: Result<Vec<_>, _> = poses
            .map(|(pose, compensated)| {
                let done: Result<_, EquilibriumError> = at_work(pose, compensated);
                done.map_err(|source| CalibrationError::TestPose {
                    pose: pose.name.clone(),
                    source,
                })
            })
            .collect();
        Ok(Self {
            rows,
            test_poses: test_poses?,
        })
    }

    /// At the test poses of absolute readings from where a model has the tool: by how much it is elsewhere (m) than the nominal and the
    /// identified robot have it.
    pub fn off_by(mut self, off_m: [&[Vector3<f64>]; 2]) -> Self {
        for (place, both) in self.test_poses.iter_mut().enumerate() {
            for (row, off_m) in both.iter_mut().zip(off_m) {
                row.rests[0].place_m -= off_m[place];
            }
        }
        self
    }
}

impl ReadingRuns<'_> {
    /// One run under a seed, to be shown: its readings are the means of what visits repeat alike; by how much the tool is elsewhere than
    /// the nominal robot has it at each test pose (m, of it what counts), in the frames that suit the readings best; and what the robot
    /// did, with the rows in the order of the run's readings.
    pub fn shown(
        &self,
        robots: &mut TrueRobots,
        seed: u64,
        run: u64,
    ) -> Result<(ReadingsRun, Vec<Vector3<f64>>, CarriedOut), FailedRun> {
        let read = self.run(robots, seed, run)?;
        let no_fit = |error: IdentificationError| Failure::Identification.because(&error);
        let case = AbsoluteCase::new(&self.task.belief, &read.readings).map_err(no_fit)?;
        let nominal = case.in_best_frames().map_err(no_fit)?;
        let frames = self.read.frames(robots, seed, run);
        let before_m = self.residuals(robots, &frames, &case, &nominal, &[])?;
        let mut did = self.did(robots)?;
        for (place, row) in did.rows.iter_mut().enumerate() {
            row.readings = place..place + 1;
        }
        let did = did.off_by([&before_m, &read.residuals_m]);
        Ok((read, before_m, did))
    }

    /// What the robot of the run that was sampled last does, with the rows in the plan's order.
    pub fn carried_out(&self, robots: &mut TrueRobots) -> Result<CarriedOut, FailedRun> {
        let mut did = self.did(robots)?;
        did.rows.sort_by_key(|row| row.readings.start);
        Ok(did)
    }

    /// The same with the rows by configuration.
    fn did(&self, robots: &mut TrueRobots) -> Result<CarriedOut, FailedRun> {
        let rows = self.read.rows(&self.task.belief);
        let rows: Result<Vec<_>, _> = rows.map(|row| row.carried_out(robots)).collect();
        let rows = rows.map_err(|error| Failure::Measurement.because(&error))?;
        let at_work = |pose: &TestPose| {
            let place_m = robots.machining_tool_at_work(&pose.configuration_rad, pose);
            let place_m = place_m.map_err(|error| Failure::TestPose.because(&error))?;
            let rest = AtRest::of(robots.machining(), place_m);
            let row = CarriedOutRow::at(pose, &pose.configuration_rad, [rest.clone(), rest]);
            Ok([row.clone(), row])
        };
        let test_poses: Result<Vec<_>, FailedRun> =
            self.task.test_poses.iter().map(at_work).collect();
        Ok(CarriedOut {
            rows,
            test_poses: test_poses?,
        })
    }
}

impl VisitedRow<'_> {
    fn carried_out(&self, robots: &mut TrueRobots) -> Result<CarriedOutRow, VirtualReadingError> {
        let mut rest = |load| {
            let (place_m, _) = self.rest(robots, self.numbers[0], load)?;
            let robot = robots.reading();
            Ok::<_, VirtualReadingError>(AtRest::of(robot, place_m))
        };
        let load = self.row.load.unwrap_or(Load::NONE);
        let first = self.numbers[0].reading;
        let rests = [rest(Load::NONE)?, rest(load)?];
        let from_m = |station: &Station| station.sees_from(&rests[1].place_m);
        Ok(CarriedOutRow {
            readings: first..first + self.numbers.len(),
            direction: None,
            station_m: self.station.map(from_m),
            commanded_rad: self.row.configuration_rad.clone(),
            load,
            rests,
        })
    }
}
