//! What the robot of a run does in each row of a plan of absolute readings and at the test poses, for those who show it.

use std::ops::Range;

use nalgebra::{DVector, Vector3};

use super::absolute::{ReadingRuns, ReadingsRun};
use super::tally::{FailedRun, Failure};
use super::virtual_readings::{VirtualReadingError, VisitedRow};
use crate::identification::{AbsoluteCase, IdentificationError};
use crate::robot::Load;
use crate::task::{Station, TestPose};
use crate::testbed::{TrueRobots, VirtualRobot};

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

/// A row of a plan as it was carried out.
#[derive(Debug, Clone)]
pub struct CarriedOutRow {
    /// Its readings in the plan's order: repeats differ by what is new in each, and the first one is shown.
    pub readings: Range<usize>,
    /// From where the loaded target is read (m, world frame), where somebody says.
    pub station_m: Option<Vector3<f64>>,
    /// The commanded angles (rad).
    pub commanded_rad: DVector<f64>,
    /// The load, in the world frame at the calibration tool.
    pub load: Load,
    /// Without and with the load.
    pub rests: [AtRest; 2],
}

/// A plan as the robot of a run carried it out.
#[derive(Debug, Clone)]
pub struct CarriedOut {
    /// The rows.
    pub rows: Vec<CarriedOutRow>,
    /// At each test pose, under the task's load.
    pub test_poses: Vec<AtRest>,
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

impl ReadingRuns<'_> {
    /// One run under a seed, to be shown: its readings are the means of what visits repeat alike; by how much the tool is elsewhere than
    /// the nominal robot has it at each test pose (m, of it what counts), in the frames that suit the readings best; and what the robot
    /// did, with the rows in the order of the run's readings.
    ///
    /// # Errors
    /// What it failed by.
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
        let mut rows = self.rows(robots)?;
        for (place, row) in rows.iter_mut().enumerate() {
            row.readings = place..place + 1;
        }
        let test_poses = self.at_work(robots)?;
        Ok((read, before_m, CarriedOut { rows, test_poses }))
    }

    /// What the robot of the run that was sampled last does.
    ///
    /// # Errors
    /// It does not rest.
    pub fn carried_out(&self, robots: &mut TrueRobots) -> Result<CarriedOut, FailedRun> {
        let mut rows = self.rows(robots)?;
        rows.sort_by_key(|row| row.readings.start);
        let test_poses = self.at_work(robots)?;
        Ok(CarriedOut { rows, test_poses })
    }

    fn rows(&self, robots: &mut TrueRobots) -> Result<Vec<CarriedOutRow>, FailedRun> {
        let rows = self.read.rows(&self.task.belief);
        let rows: Result<Vec<_>, _> = rows.map(|row| row.carried_out(robots)).collect();
        rows.map_err(|error| Failure::Measurement.because(&error))
    }

    fn at_work(&self, robots: &mut TrueRobots) -> Result<Vec<AtRest>, FailedRun> {
        let at_work = |pose: &TestPose| {
            let place_m = robots.machining_tool_at_work(&pose.configuration_rad, pose);
            let place_m = place_m.map_err(|error| Failure::TestPose.because(&error))?;
            Ok(AtRest::of(robots.machining(), place_m))
        };
        self.task.test_poses.iter().map(at_work).collect()
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
            station_m: self.station.map(from_m),
            commanded_rad: self.row.configuration_rad.clone(),
            load,
            rests,
        })
    }
}
