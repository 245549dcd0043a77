//! `compensate --targets`: the joint angles to command for absolute targets.

use crate::compensation::{
    AbsoluteTarget, InverseKinematics, TargetRow, Unreachable, read_targets,
};
use crate::identification::{JointError, MountedFrameMessage};
use crate::mujoco::frame;
use crate::parameter::ElasticArm;
use crate::quantities::units::shown_unit;
use crate::workflow::calibrated::CalibratedRobot;
use clap::ValueEnum;
use nalgebra::{DVector, Isometry3, Vector3};

use super::Compensate;
use crate::cli::command_prelude::*;
use crate::cli::identified::taken_as_believed;
use crate::cli::table::numbers;

/// In which frame targets are, or in which a workpiece stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TargetFrame {
    /// The robot's base: the model's world.
    Base,
    /// That in which the instrument gave its readings.
    Instrument,
}

/// Where a workpiece stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Workpiece {
    name: String,
    /// As it was given (mm, deg).
    numbers: [f64; 6],
}

impl Workpiece {
    /// NAME=X,Y,Z,ROLL,PITCH,YAW (mm, deg).
    pub fn of_word(word: &str) -> Result<Self, String> {
        let wrong = || {
            "NAME=X,Y,Z,ROLL,PITCH,YAW is allowed, in mm and deg, as in table=500,0,200,0,0,90"
                .to_owned()
        };
        let (name, numbers) = word.split_once('=').ok_or_else(wrong)?;
        let numbers: Vec<f64> = (numbers.split(','))
            .map(|word| word.trim().parse().map_err(|_| wrong()))
            .collect::<Result<_, _>>()?;
        let numbers = <[f64; 6]>::try_from(numbers).map_err(|_| wrong())?;
        let is_right = !name.is_empty() && numbers.iter().all(|number| number.is_finite());
        let name = name.to_owned();
        is_right.then_some(Self { name, numbers }).ok_or_else(wrong)
    }

    fn place(&self) -> Isometry3<f64> {
        let [x, y, z, roll, pitch, yaw] = self.numbers;
        let turned = [roll, pitch, yaw].map(f64::to_radians);
        frame(Vector3::new(x, y, z) * 1e-3, turned)
    }
}

impl Compensate {
    /// Commands for absolute targets.
    pub(super) fn at_targets(
        &self,
        targets: &Path,
        scenario: &Scenario,
        robot: &CalibratedRobot,
        mut conditions: Vec<Condition>,
    ) -> anyhow::Result<Report> {
        let tool = self.tool_of(robot)?;
        let name = &robot.arm.tools[tool].name;
        let (base_from_frame, station, said) = self.base_from_frame(targets, robot)?;
        let rows = read_targets(targets)?;
        let found = commands(scenario, robot, tool, &base_from_frame, &rows);
        let commanded = found.iter().filter_map(|found| found.as_ref().ok());
        conditions.extend(robot.read_ranges.beyond(&robot.arm, "target", commanded));
        let names = scenario.task.belief.commands();
        let mut csv = format!(
            "# targets of the tool {name:?} in {said}\ntarget,line,{},predicted_mm\n",
            names.columns().join(",")
        );
        let (mut shown, mut list): (Vec<Vec<String>>, Vec<Value>) = (Vec::new(), Vec::new());
        for ((row, found), place) in rows.iter().zip(&found).zip(1..) {
            let mut record = json!({ "line": row.line, "unreachable": null, "q_commanded_deg": null, "predicted_mm": null,
                "predicted_one_return_mm": null });
            match found {
                Ok(commands) => {
                    let accuracy = robot.target_accuracy(tool, station, commands, &row.load);
                    let accuracy = accuracy.map_err(|error| {
                        FileError::new(targets, error.to_string()).at(format!("line {}", row.line))
                    })?;
                    let mean_mm = accuracy.map(|each| each.mean_m * 1e3);
                    let one_return_mm = accuracy.map(|each| each.one_return_m * 1e3);
                    let angles = names.numbers(commands.as_slice());
                    let (written, predicted) = (joined(&angles, ","), joined(mean_mm, ""));
                    csv += &format!("{place},{},{written},{predicted}\n", row.line);
                    shown.push(vec![
                        place.to_string(),
                        number(mean_mm, 4),
                        number(one_return_mm, 4),
                        numbers(angles.iter().copied(), 5),
                    ]);
                    record["q_commanded_deg"] = json!(angles);
                    record["predicted_mm"] = json!(mean_mm);
                    record["predicted_one_return_mm"] = json!(one_return_mm);
                }
                Err(failure) => {
                    let reason = reason(failure, &robot.arm);
                    conditions.push(ConditionCode::Unreachable.with(format!(
                        "target {place} (line {}) cannot be reached: {reason}",
                        row.line
                    )));
                    record["unreachable"] = json!(reason);
                }
            }
            list.push(record);
        }
        let mut text = format!("Targets of the tool {name:?} in {said}:\n");
        text += &table(
            &format!(
                "target | predicted rms [mm] | of one return [mm] | commanded angles [{}]",
                names.unit()
            ),
            shown,
        );
        if !robot.stations.is_empty() && !robot.found_tools[tool] {
            text += &format!(
                "The place of {name:?} on its link was not read: it is the nominal one. No accuracy is predicted where it depends on what \
                 was left out as redundant with the places that were read.\n"
            );
        }
        if !robot.stations.is_empty() {
            text += "Predicted: by what was identified, the mean of returns; of one return with what is new at a visit besides.\n";
        }
        text += &taken_as_believed(robot);
        if let Some(errors) = &robot.with_joint_errors {
            let largest = ["rad", "m"].into_iter().filter_map(|own| {
                let is_own =
                    |error: &&JointError| robot.arm.chain.joints[error.joint].drive.unit() == own;
                let values = (errors.model.joints)
                    .iter()
                    .filter(is_own)
                    .flat_map(JointError::at_knots);
                let (factor, unit) = shown_unit(own);
                let largest = values.map(f64::abs).reduce(f64::max)?;
                Some(format!("{:.3} {unit}", largest * factor))
            });
            text += &format!(
                "Commands correct what joints are off by over their own angles, {} at most.\n",
                joined(largest, " and ")
            );
        }
        if robot.arm.leans() || !robot.arm.gear_waves.is_empty() {
            text += "Commands correct the joints' transmission error, backlash and nonlinear stiffness, approached with all joints turning \
                     positively.\n";
        }
        let keys = json!({
            "tool": name,
            "tool_is_identified": robot.found_tools[tool],
            "frame": said,
            "corrects_joint_errors": robot.with_joint_errors.is_some(),
            "targets": list,
        });
        let mut report = Report::new(keys, text, conditions);
        if let Some(path) = &self.angles_out {
            report.write(path, &csv)?;
        }
        Ok((self.common).report("compensate", scenario, report)?)
    }

    fn tool_of(&self, robot: &CalibratedRobot) -> Result<usize, FileError> {
        let Some(name) = &self.tool else {
            return Ok(robot.machining_tool);
        };
        let tools = &robot.arm.tools;
        let place = tools.iter().position(|tool| tool.name == *name);
        place.ok_or_else(|| {
            let known = joined(tools.iter().map(|tool| &tool.name), ", ");
            let problem = format!("--tool: found {name:?}; allowed are: {known}");
            FileError::new(&self.identified, problem).code(ErrorCode::Targets)
        })
    }

    /// The frame of the targets in the robot's base, the place of the station whose frame it is, and how it is called.
    fn base_from_frame(
        &self,
        targets: &Path,
        robot: &CalibratedRobot,
    ) -> Result<(Isometry3<f64>, Option<usize>, String), FileError> {
        let is_absolute = !robot.stations.is_empty();
        let frame = self.frame.unwrap_or(if is_absolute {
            TargetFrame::Instrument
        } else {
            TargetFrame::Base
        });
        let (own, station, said) = match frame {
            TargetFrame::Base => {
                if self.station.is_some() {
                    let problem =
                        "--station is for targets in the instrument's frame, not in the base's";
                    return Err(FileError::new(targets, problem).code(ErrorCode::Targets));
                }
                let said = "the frame of the robot's base";
                (Isometry3::identity(), None, said.to_owned())
            }
            TargetFrame::Instrument => {
                let (place, station) = self.station_of(robot)?;
                let said = match &station.name {
                    None => "the instrument's frame".to_owned(),
                    Some(name) => format!("the instrument's frame at station {name:?}"),
                };
                let frame = station.frame(&Isometry3::identity());
                (frame.inverse(), Some(place), said)
            }
        };
        Ok(match &self.workpiece {
            None => (own, station, said),
            Some(workpiece) => {
                let [x, y, z, roll, pitch, yaw] = workpiece.numbers;
                let said = format!(
                    "the frame of the workpiece {:?}, which stands at ({x}, {y}, {z}) mm and ({roll}, {pitch}, {yaw}) deg in {said}",
                    workpiece.name
                );
                (own * workpiece.place(), station, said)
            }
        })
    }

    /// The station in whose frame targets are, with its place.
    fn station_of<'a>(
        &self,
        robot: &'a CalibratedRobot,
    ) -> Result<(usize, &'a MountedFrameMessage), FileError> {
        let wrong =
            |problem: &str| FileError::new(&self.identified, problem).code(ErrorCode::Targets);
        let stations = &robot.beside_joint_errors().0.stations;
        let names = joined(stations.iter().filter_map(|each| each.name.as_ref()), ", ");
        let several = format!("name one of them with --station: {names}");
        match (self.station.as_deref(), stations.as_slice()) {
        (_, []) => Err(wrong(
            "was identified from deflections, which do not determine the robot's base in the instrument's frame",
        )
        .hint("give the targets in the frame of the base (--frame base), or identify from absolute readings")),
        (None, [only]) => Ok((0, only)),
        (None, _) => Err(wrong("the instrument had several stations").hint(several)),
        (Some(name), all) => (all.iter().enumerate().find(|(_, each)| each.name.as_deref() == Some(name)))
            .ok_or_else(|| wrong(&format!("--station: found {name:?}")).hint(several)),
    }
    }
}

type FoundCommands = Result<DVector<f64>, Unreachable>;

/// The commands for each row, begun where the one before ended.
fn commands(
    scenario: &Scenario,
    robot: &CalibratedRobot,
    tool: usize,
    base_from_frame: &Isometry3<f64>,
    rows: &[TargetRow],
) -> Vec<FoundCommands> {
    let (robot, joints) = robot.beside_joint_errors();
    let mut solver = InverseKinematics::new(&robot.arm, tool, joints);
    let own = (scenario.task.test_poses.iter()).map(|pose| pose.configuration_rad.clone());
    let mut starts: Vec<DVector<f64>> = own.collect();
    let count = starts.len();
    let mut all = Vec::new();
    for row in rows {
        let target =
            AbsoluteTarget::in_frame(base_from_frame, &row.position_m, row.rotation, row.load);
        let found = solver.commands(&target, &starts);
        if let Ok(commands) = &found {
            if starts.len() > count {
                starts.remove(0);
            }
            starts.insert(0, commands.clone());
        }
        all.push(found);
    }
    all
}

fn reason(failure: &Unreachable, arm: &ElasticArm) -> String {
    match failure {
        Unreachable::BeyondRange { joint, coordinate } => {
            let joint = &arm.chain.joints[*joint];
            let (value, unit) = joint.drive.shown(*coordinate);
            let [low, high] = joint.range_rad.map(|end| joint.drive.shown(end).0);
            format!(
                "{} would be at {value:.2} {unit}, its range is {low:.2} to {high:.2} {unit}",
                joint.name
            )
        }
        Unreachable::Unsettled { joint } => format!(
            "what {} stands off changes faster with its angle than it turns: no one command leads there",
            arm.chain.joints[*joint].name
        ),
        Unreachable::GivesWay { joint } => format!(
            "{} softens and cannot hold what it carries there",
            arm.chain.joints[*joint].name
        ),
        Unreachable::TooFar {
            distance_m,
            angle_rad,
        } if distance_m.is_finite() => format!(
            "the tool stays {:.3} mm and {:.3} deg away",
            distance_m * 1e3,
            angle_rad.to_degrees()
        ),
        Unreachable::TooFar { .. } => "the robot finds no rest there".to_owned(),
    }
}
