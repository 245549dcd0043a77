//! An identified robot, from deflections or absolute readings: what is exported, and what is compensated with.

use nalgebra::{DMatrix, DVector, Isometry3};
use serde::Serialize;

use super::target_accuracy::{KnownPlaces, TargetAccuracy, known};
use crate::calibration::{
    CalibrationError, CompensatedPose, compensate_poses, compensate_poses_by,
};
use crate::compensation::{KnownArm, compensate_arm, predicted_error, uncompensated_rows};
use crate::files::FileError;
use crate::identification::{
    DiscrepancyModel, IdentificationError, JointError, MountedFrameMessage, ReadRanges, StoredRobot,
};
use crate::numeric::posterior::Posterior;
use crate::observation::PlannedReadings;
use crate::parameter::{ElasticArm, Parameter, ParameterError, ParameterKind, ParameterSet};
use crate::robot::{Load, SerialChain};
use crate::task::{Belief, Method, Task};
use crate::testbed::TrueRobots;

/// An unknown with what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibratedUnknown {
    /// Its name.
    pub name: String,
    /// The unit of its value.
    pub unit: String,
    /// Its value.
    pub value: f64,
    /// Its standard error; none where it is not determined.
    pub standard_error: Option<f64>,
}

/// A robot whose joints stand off their commands.
#[derive(Debug, Clone)]
pub struct RobotWithJointErrors {
    /// The robot, its parameters and stations off together with the joints.
    pub robot: CalibratedRobot,
    /// What joints are off by.
    pub model: DiscrepancyModel,
}

/// A robot as an identification left it.
#[derive(Debug, Clone)]
pub struct CalibratedRobot {
    /// The arm as it was believed to be, with the tools of [`Self::arm`].
    pub nominal: ElasticArm,
    /// The arm as it was identified: the calibration tool first, the machining tool, other targets of the readings.
    pub arm: ElasticArm,
    /// Which of its tools machines.
    pub machining_tool: usize,
    /// Which of its tools were found where they are; the others are where the model and the scenario have them.
    pub found_tools: Vec<bool>,
    /// What was identified.
    pub unknowns: Vec<CalibratedUnknown>,
    /// The covariance of these, in their units.
    pub covariance: DMatrix<f64>,
    /// What of it is no matter of the robot's own, in words.
    pub apart: Vec<String>,
    /// The joints whose compliances absolute readings were not asked for: the nominal ones hold, for certain.
    pub taken_as_believed: Vec<String>,
    /// What joints are off by over their own angles, with the arm and the stations that belong to that; where it was told apart.
    pub with_joint_errors: Option<Box<RobotWithJointErrors>>,
    /// The angles that were read, where errors elsewhere are not known.
    pub read_ranges: ReadRanges,
    /// Where the instrument stood; nowhere if deflections were measured, which do not tell.
    pub stations: Vec<MountedFrameMessage>,
    /// What test poses depend on, where that is no belief's unknowns, whose values are what was identified,
    set: Option<ParameterSet>,
    /// and what is known of it.
    posterior: Posterior,
    known_places: Option<KnownPlaces>,
}

impl CalibratedRobot {
    /// What deflections tell of a belief's unknowns.
    pub fn of_deflections(belief: &Belief, posterior: Posterior) -> Self {
        let nominal = belief.arm();
        let arm = belief.arm_at(&posterior.mean);
        let parameters = belief.uncertain.set().parameters();
        let names = posterior.names.iter().enumerate();
        let unknowns = names
            .map(|(index, name)| CalibratedUnknown {
                name: name.clone(),
                unit: parameters[index].unit().to_owned(),
                value: posterior.mean[index],
                standard_error: posterior.standard_error(index),
            })
            .collect();
        let apart = (parameters.iter())
            .zip(&posterior.mean)
            .filter_map(|(parameter, &value)| {
                said_apart(
                    parameter.kind,
                    &parameter.name,
                    value,
                    shown_unit(parameter),
                )
            })
            .collect();
        Self {
            machining_tool: machining_tool(&nominal),
            found_tools: vec![false; nominal.tools.len()],
            unknowns,
            covariance: posterior.covariance.clone(),
            apart,
            taken_as_believed: Vec::new(),
            with_joint_errors: None,
            read_ranges: ReadRanges::default(),
            stations: Vec::new(),
            set: None,
            posterior,
            known_places: None,
            nominal,
            arm,
        }
    }

    /// What absolute readings tell, from their file.
    ///
    /// # Errors
    /// The file names what the robot does not have, or what is no number or no frame.
    pub fn of_absolute(belief: &Belief, stored: &StoredRobot) -> Result<Self, FileError> {
        let message = &stored.message;
        let mut nominal = belief.arm();
        let machining_tool = machining_tool(&nominal);
        let mut places = Vec::new();
        for (index, target) in message.targets.iter().enumerate() {
            let name = target.name.as_ref();
            let name = name.unwrap_or(&belief.calibration_tool.name);
            let known = nominal.tools.iter().position(|tool| tool.name == *name);
            places.push(known.unwrap_or(nominal.tools.len()));
            if known.is_none() {
                let tool = SerialChain::tool(&belief.nominal.model, name).map_err(|error| {
                    stored.wrong(format!("targets[{index}].name"), error.to_string())
                })?;
                nominal.tools.push(tool);
            }
        }
        let mut reference = nominal.clone();
        let mut found_tools = vec![false; nominal.tools.len()];
        for (target, &place) in message.targets.iter().zip(&places) {
            let link_from_tool = &mut reference.tools[place].link_from_tool;
            *link_from_tool = target.frame(link_from_tool);
            found_tools[place] = true;
        }
        let tools: Vec<Option<usize>> = places.iter().copied().map(Some).collect();
        let kinds = stored.kinds(&reference, &[], &tools);
        let apart = (message.unknowns.iter().zip(&kinds))
            .filter_map(|(unknown, kind)| {
                said_apart((*kind)?, &unknown.name, unknown.value, &unknown.unit)
            })
            .chain(message.stations.iter().map(told_station))
            .chain(message.discrepancy_model.as_ref().map(|found| {
                let joints: Vec<&str> = found.joints.iter().map(|each| &*each.joint).collect();
                format!(
                    "what {} are off by as functions of their own angles: `compensate --targets` corrects it, no model has it",
                    joints.join(", ")
                )
            }))
            .collect();
        let is_asked = |joint| kinds.contains(&Some(ParameterKind::JointCompliance { joint }));
        let joints = nominal.chain.joints.iter().enumerate();
        let taken_as_believed = joints
            .filter(|&(joint, _)| nominal.compliance_rad_per_nm[joint] > 0.0 && !is_asked(joint))
            .map(|(_, each)| each.name.clone())
            .collect();
        let (set, posterior) = known(stored, (&reference, belief), &kinds)?;
        let known_places = KnownPlaces::new(stored, (&reference, belief), &tools)?;
        let arm = stored.apply(&reference)?;
        let with_joint_errors = match stored.beside_joint_errors() {
            None => None,
            Some(other) => {
                let model = stored.discrepancy_model(&arm)?;
                let robot = Self::of_absolute(belief, &other)?;
                (!model.joints.is_empty()).then(|| Box::new(RobotWithJointErrors { robot, model }))
            }
        };
        Ok(Self {
            arm,
            with_joint_errors,
            read_ranges: stored.read_ranges(),
            nominal,
            machining_tool,
            found_tools,
            unknowns: (message.unknowns.iter())
                .map(|each| CalibratedUnknown {
                    name: each.name.clone(),
                    unit: each.unit.clone(),
                    value: each.value,
                    standard_error: each.standard_error,
                })
                .collect(),
            covariance: stored.covariance.clone(),
            apart,
            taken_as_believed,
            stations: message.stations.clone(),
            set: Some(set),
            posterior,
            known_places: Some(known_places),
        })
    }

    /// The robot together with which its joints' errors were found, and these; itself and none where none were told apart.
    pub fn beside_joint_errors(&self) -> (&Self, &[JointError]) {
        match &self.with_joint_errors {
            Some(other) => (&other.robot, &other.model.joints),
            None => (self, &[]),
        }
    }

    /// Compensates every test pose, and sees on the virtual robot what distance is left.
    pub fn compensate(
        &self,
        task: &Task,
        robots: &mut TrueRobots,
        method: Method,
    ) -> Result<Vec<CompensatedPose>, CalibrationError> {
        let Some(set) = &self.set else {
            return compensate_poses(task, robots, &self.posterior, method);
        };
        compensate_poses_by(task, robots, &|pose| {
            let tool = self.machining_tool;
            let commanded_rad = compensate_arm(&self.arm, tool, pose, method)?;
            let sizes = vec![1.0; set.len()];
            let model = PlannedReadings::at_test_pose(&self.nominal, tool, set, &sizes);
            let rows = uncompensated_rows(model, pose);
            Ok((commanded_rad, predicted_error(&rows, &self.posterior)))
        })
    }

    /// How far a tool that is commanded so is from its target in the frame of a station, by its place, or of the robot's base; `None` where that
    /// depends on what was not determined, and after deflections, which do not tell where tools stand.
    pub fn target_accuracy(
        &self,
        tool: usize,
        station: Option<usize>,
        commanded_rad: &DVector<f64>,
        load: &Load,
    ) -> Result<Option<TargetAccuracy>, IdentificationError> {
        (self.known_places.as_ref()).map_or(Ok(None), |known| {
            known.accuracy((tool, station), commanded_rad, load)
        })
    }

    /// Does something with the arm as it was identified, the machining tool, and what is known of its parameters.
    ///
    /// # Errors
    /// The parameters are none of the arm's.
    pub fn with_known<T>(
        &self,
        belief: &Belief,
        work: impl FnOnce(&KnownArm<'_>) -> T,
    ) -> Result<T, ParameterError> {
        let tool = self.machining_tool;
        let Some(set) = &self.set else {
            return Ok(work(&KnownArm {
                arm: belief.uncertain.arm(),
                tool,
                set: belief.uncertain.set(),
                posterior: &self.posterior,
            }));
        };
        // Their values count from the arm that was identified.
        let kinds = set.parameters().iter().map(|each| (each.kind, None));
        let set = ParameterSet::new(&self.arm, kinds)?;
        let posterior = Posterior {
            mean: set.prior().mean.as_slice().to_vec(),
            ..self.posterior.clone()
        };
        Ok(work(&KnownArm {
            arm: &self.arm,
            tool,
            set: &set,
            posterior: &posterior,
        }))
    }
}

/// A belief's arm has the machining tool last.
const fn machining_tool(arm: &ElasticArm) -> usize {
    arm.tools.len() - 1
}

fn shown_unit(parameter: &Parameter) -> &'static str {
    if parameter.is_logarithmic {
        "in the logarithm"
    } else {
        parameter.unit()
    }
}

/// What was identified and is no matter of the robot's model.
fn said_apart(kind: ParameterKind, name: &str, value: f64, unit: &str) -> Option<String> {
    let reason = match kind {
        ParameterKind::BasePosition { .. } | ParameterKind::BaseRotation { .. } => {
            "the robot's place in the instrument's frame, which the model does not have"
        }
        ParameterKind::LoadScale | ParameterKind::LoadOffset => "of the loads in the laboratory",
        ParameterKind::TaskScale | ParameterKind::TaskForce { .. } => "of the task's loads",
        ParameterKind::Drift { .. } => "of the instrument in the laboratory",
        ParameterKind::JointBacklash { .. } => {
            "of the side from which a joint comes, which no model says"
        }
        ParameterKind::JointStiffening { .. } => "of a joint that is no spring, as the model's are",
        ParameterKind::JointWave { .. } => {
            "of a transmission error, which no model file has: `compensate` corrects it"
        }
        ParameterKind::PayloadMass | ParameterKind::PayloadCentre { .. } => {
            "of a payload that the scenario's robot carries beside its model"
        }
        _ => return None,
    };
    Some(format!("{name} = {value:.6e} {unit}: {reason}"))
}

fn told_station(station: &MountedFrameMessage) -> String {
    let frame = station.frame(&Isometry3::identity());
    let at = frame.translation.vector * 1e3;
    let [x, y, z, w] = frame.rotation.coords.into();
    let of =
        (station.name.as_ref()).map_or_else(String::new, |name| format!(" at station {name:?}"));
    format!(
        "the base{of} = ({:.4}, {:.4}, {:.4}) mm, quaternion {w:.7} {x:.7} {y:.7} {z:.7}: the robot's place in the \
         instrument's frame, which the model does not have",
        at.x, at.y, at.z
    )
}
