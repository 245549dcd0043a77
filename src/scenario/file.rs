//! The scenario file as it is written: keys with units, nothing checked but their names and types.
//!
//! Arrays have any length here: read as `[f64; N]`, surplus numbers would be dropped without a word.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use super::instrument_file::{InstrumentReads, InstrumentTable};
use crate::gate::Gate;
use crate::laboratory::Costs;
use crate::numeric::markov::Correlation;
use crate::parameter::{DiscrepancyOf, ErrorDistribution};
use crate::plan::Criterion;
use crate::robot::{Commands, ReadsAlong, SerialChain};
use crate::study::Level;
use crate::task::{AccuracyKind, Loading, Method};

/// The whole file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    #[serde(default)]
    pub description: String,
    #[serde(default)]
    pub seed: u64,
    pub robot: RobotTable,
    pub true_robot: Option<TrueRobotTable>,
    pub instrument: InstrumentTable,
    #[serde(default)]
    pub identification: IdentificationTable,
    pub test_pose: Vec<TestPoseTable>,
    pub load: LoadKind,
    #[serde(default)]
    pub region: RegionTable,
    #[serde(default)]
    pub obstacle: Vec<ObstacleTable>,
    #[serde(default)]
    pub station: Vec<StationTable>,
    #[serde(default)]
    pub uncertainty: Vec<UncertaintyTable>,
    pub design: DesignTable,
    #[serde(default)]
    pub plan: Vec<PlanTable>,
    #[serde(default)]
    pub study: StudyTable,
    #[serde(default)]
    pub laboratory: LaboratoryTable,
    #[serde(default)]
    pub gate: Gate,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotTable {
    pub model: PathBuf,
    pub calibration_site: String,
    pub machining_site: String,
    pub parameters: Vec<String>,
    #[serde(default)]
    pub actuators: Actuators,
    pub compliance_rad_per_nm: Option<Vec<f64>>,
    pub prior: Option<PathBuf>,
    #[serde(default)]
    pub locked_deg: BTreeMap<String, f64>,
    #[serde(default)]
    pub locked_mm: BTreeMap<String, f64>,
    #[serde(default)]
    pub tool: Vec<ToolTable>,
    #[serde(default)]
    pub payload: Vec<PayloadTable>,
}

/// What becomes of the model's actuators.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Actuators {
    /// They hold the joints: a position actuator's gain is a joint's stiffness.
    #[default]
    Model,
    /// They are a simulation's and do not count; the scenario says how stiff the joints are.
    Ignored,
}

/// One of `[[robot.tool]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ToolTable {
    pub name: String,
    pub on: String,
    pub position_mm: Vec<f64>,
    pub rpy_deg: Option<Vec<f64>>,
}

/// One of `[[robot.payload]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PayloadTable {
    pub on: String,
    pub mass_kg: f64,
    pub centre_mm: Vec<f64>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TrueRobotTable {
    pub model: Option<PathBuf>,
    pub compliance_rad_per_nm: Option<Vec<f64>>,
    #[serde(default)]
    pub torque_law: Vec<TorqueLawTable>,
}

impl File {
    /// Which experiments a gauge reads along a direction.
    const fn reads_along(&self) -> ReadsAlong {
        match (self.instrument.reads, &self.instrument.gauge) {
            (InstrumentReads::Displacement, _) => ReadsAlong::Always,
            (_, Some(_)) => ReadsAlong::Sometimes,
            _ => ReadsAlong::Never,
        }
    }

    /// How an arm is commanded, and whether experiments say a direction.
    pub fn commands(&self, chain: &SerialChain) -> Commands {
        Commands::from(chain).reading_along(self.reads_along())
    }

    /// How long after the unloaded reading of a deflection the loaded one is taken (h): at once where the load is hung in place, and for
    /// what a gauge reads.
    pub fn between_readings_h(&self, costs: &Costs) -> f64 {
        let visited = match (self.laboratory.loading, self.reads_along()) {
            (Loading::InPlace, _) | (_, ReadsAlong::Always) => 0,
            (Loading::Returns, _) => self.design.experiments,
        };
        costs.between_readings_h(visited)
    }

    /// Whether it lists what is known of a joint's compliance that is to be found.
    pub fn knows_compliance_of(&self, chain: &SerialChain, joint: usize) -> bool {
        let name = &chain.joints[joint].name;
        let mut tables = self.uncertainty.iter();
        tables.any(|each| each.knows_compliance_of(name))
    }

    /// Whether it says what the true compliances are.
    pub fn tells_compliances(&self) -> bool {
        self.true_robot
            .as_ref()
            .is_some_and(|table| table.model.is_some() || table.compliance_rad_per_nm.is_some())
    }
}

/// One of `[[true_robot.torque_law]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TorqueLawTable {
    pub joints: Vec<String>,
    pub stiffens_at_mrad: Option<f64>,
    pub stiffens_at_mm: Option<f64>,
    pub softens_at_mrad: Option<f64>,
    pub softens_at_mm: Option<f64>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct IdentificationTable {
    #[serde(default)]
    pub method: Method,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TestPoseTable {
    pub name: Option<String>,
    pub q_deg: Vec<f64>,
    pub force_n: Option<Vec<f64>>,
    pub torque_nm: Option<Vec<f64>>,
    pub tool_force_n: Option<Vec<f64>>,
    pub tool_torque_nm: Option<Vec<f64>>,
    pub direction: Option<Vec<f64>>,
    pub tool_direction: Option<Vec<f64>>,
    pub weight: Option<f64>,
}

/// The table `[load]`: which loads a plan may use.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum LoadKind {
    /// One wrench for every experiment.
    Fixed {
        /// The force (N).
        force_n: Vec<f64>,
        /// The torque (N m).
        torque_nm: Option<Vec<f64>>,
    },
    /// A force of fixed direction.
    Direction {
        /// Its direction; need not be of length one.
        direction: Vec<f64>,
        /// The smallest force (N).
        #[serde(default)]
        force_min_n: f64,
        /// The largest force (N).
        force_max_n: f64,
    },
    /// A force of any direction.
    Any {
        /// The largest force (N).
        force_max_n: f64,
    },
    /// One of a list.
    List {
        /// The wrenches.
        wrenches: Vec<WrenchTable>,
    },
}

/// A force and a torque.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WrenchTable {
    /// The force (N).
    pub force_n: Vec<f64>,
    /// The torque (N m).
    pub torque_nm: Option<Vec<f64>>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RegionTable {
    #[serde(default)]
    pub joint_range_deg: BTreeMap<String, Vec<f64>>,
    #[serde(default)]
    pub joint_range_mm: BTreeMap<String, Vec<f64>>,
    pub tool_height_min_mm: Option<f64>,
    pub tool_height_max_mm: Option<f64>,
    pub tool_radius_min_mm: Option<f64>,
    pub tool_radius_max_mm: Option<f64>,
    pub tool_elevation_max_deg: Option<f64>,
    pub joint_torque_max_nm: Option<Vec<f64>>,
    pub collision_clearance_mm: Option<f64>,
    #[serde(default)]
    pub line_of_sight: bool,
    #[serde(default)]
    pub forbidden: Vec<ForbiddenTable>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ForbiddenTable {
    pub q_deg: Vec<f64>,
    pub within_deg: f64,
}

/// One of `[[obstacle]]`.
#[derive(Debug, Deserialize, JsonSchema)]
pub(super) struct ObstacleTable {
    pub name: String,
    pub position_mm: Vec<f64>,
    pub rpy_deg: Option<Vec<f64>>,
    #[serde(flatten)]
    pub shape: ShapeTable,
}

/// The shapes of obstacles.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum ShapeTable {
    Box { size_mm: Vec<f64> },
    Sphere { radius_mm: f64 },
    Cylinder { radius_mm: f64, length_mm: f64 },
    Capsule { radius_mm: f64, length_mm: f64 },
}

/// What is read from a station: positions or poses, as a tracker does, or lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, IntoStaticStr, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub(super) enum StationReads {
    Position,
    Distance,
    Height,
}

/// One of `[[station]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct StationTable {
    pub name: String,
    pub reads: Option<StationReads>,
    pub position_mm: Vec<f64>,
    pub range_min_mm: Option<f64>,
    pub range_max_mm: Option<f64>,
    pub incidence_max_deg: Option<f64>,
}

/// What is uncertain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub(super) enum UncertaintyKind {
    Compliance,
    JointZero,
    LinkPosition,
    LinkRotation,
    LinkMass,
    LinkCentre,
    SpringStiffness,
    SpringRest,
    /// Of the calibration tool alone: the machining tool stays.
    ToolPosition,
    /// Of the instrument's frame: the robot does not tilt under gravity.
    BaseRotation,
    LoadScale,
    /// Of a place that lengths are read from.
    StationPosition,
    StationRotation,
    /// A force along the load.
    LoadOffset,
    TaskForce,
    LoadDirection,
    LoadPoint,
    JointRepeatability,
    Backlash,
    Stiffening,
    TrackerRange,
    Drift,
    TransmissionError,
    Discrepancy,
    /// Of a gauge on its stand, set anew for each measurement.
    GaugeDirection,
}

impl UncertaintyKind {
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// The keys that its size may have, and those that it has besides what all have.
    pub const fn keys(self) -> [&'static str; 2] {
        match self {
            Self::Compliance | Self::LinkMass => ["std_relative", "joints"],
            Self::SpringStiffness | Self::LoadScale => ["std_relative", ""],
            Self::Stiffening => ["std_relative", "joints at_nm"],
            Self::LinkPosition | Self::LinkCentre => ["std_mm", "joints"],
            Self::SpringRest | Self::ToolPosition | Self::LoadPoint => ["std_mm", ""],
            Self::Discrepancy => ["std_mm", "of"],
            Self::LinkRotation => ["std_mrad", "joints"],
            Self::StationPosition => ["std_mm", "stations"],
            Self::StationRotation => ["std_mrad", "stations"],
            Self::BaseRotation | Self::LoadDirection | Self::GaugeDirection => ["std_mrad", ""],
            Self::JointZero => ["std_mrad std_mm", "joints"],
            Self::TransmissionError => [
                "std_mrad std_mm",
                "joints harmonics correlation_deg correlation_mm correlation",
            ],
            Self::JointRepeatability => ["std_mrad std_mm rp_mm", "joints"],
            Self::Backlash => ["std_arcsec std_mm", "joints turned_over_at_nm"],
            Self::LoadOffset => ["std_n", ""],
            Self::TaskForce => ["std_relative std_n", ""],
            Self::TrackerRange => ["std_um_per_m along_um_per_m", ""],
            Self::Drift => ["std_um_per_h", ""],
        }
    }
}

/// One of `[[uncertainty]]`.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct UncertaintyTable {
    pub kind: UncertaintyKind,
    pub name: Option<String>,
    pub joints: Option<Vec<String>>,
    pub stations: Option<Vec<String>>,
    pub std_relative: Option<f64>,
    pub std_mm: Option<f64>,
    pub std_mrad: Option<f64>,
    pub std_arcsec: Option<f64>,
    pub std_n: Option<f64>,
    pub std_um_per_m: Option<f64>,
    pub along_um_per_m: Option<f64>,
    pub std_um_per_h: Option<f64>,
    pub mpe_relative: Option<f64>,
    pub mpe_um: Option<f64>,
    pub mpe_mrad: Option<f64>,
    pub mpe_arcsec: Option<f64>,
    pub mpe_n: Option<f64>,
    pub mpe_um_per_m: Option<f64>,
    pub mpe_along_um_per_m: Option<f64>,
    pub mpe_um_per_h: Option<f64>,
    pub distribution: Option<ErrorDistribution>,
    pub coverage_factor: Option<f64>,
    pub rp_mm: Option<f64>,
    pub harmonics: Option<Vec<i64>>,
    pub correlation_deg: Option<f64>,
    pub correlation_mm: Option<f64>,
    pub correlation: Option<Correlation>,
    pub of: Option<DiscrepancyOf>,
    pub turned_over_at_nm: Option<f64>,
    pub at_nm: Option<f64>,
    #[serde(default)]
    pub hidden: bool,
    #[serde(default)]
    pub replaced: bool,
}

impl UncertaintyTable {
    /// Whether it says what is known of a joint's compliance that is to be found.
    pub fn knows_compliance_of(&self, joint: &str) -> bool {
        let is_named = (self.joints.iter().flatten()).any(|name| name == joint);
        self.kind == UncertaintyKind::Compliance && !self.hidden && is_named
    }
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DesignTable {
    #[serde(default)]
    pub accuracy: AccuracyKind,
    pub experiments: u32,
    pub configurations: Option<u32>,
    pub mandatory: Option<PathBuf>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanTable {
    pub name: String,
    pub file: PathBuf,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct StudyTable {
    pub trials: Option<u64>,
    pub experiments: Option<u32>,
    pub level: Option<Level>,
    #[serde(default)]
    pub compliance_spread: Spread,
    #[serde(default)]
    pub sweep: SweepTable,
    pub plan: Option<Vec<StudyPlanTable>>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LaboratoryTable {
    pub station_min: Option<f64>,
    pub move_min: Option<f64>,
    pub load_change_min: Option<f64>,
    #[serde(default)]
    pub loading: Loading,
    pub reading_min: Option<f64>,
    pub axis_speed_deg_s: Option<f64>,
    pub approach_deg: Option<f64>,
    #[serde(default)]
    pub safe_deg: Vec<Vec<f64>>,
    pub dialect: Option<String>,
    pub speed_percent: Option<u32>,
    pub tool_number: Option<u32>,
    pub base_number: Option<u32>,
}

/// One number for all joints, or one for each.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Spread {
    All(f64),
    Each(Vec<f64>),
}

impl Default for Spread {
    fn default() -> Self {
        Self::All(0.0)
    }
}

/// Conditions that a study is made under, all with all.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SweepTable {
    pub sigma_mm: Option<Vec<f64>>,
    pub experiments: Option<Vec<u32>>,
    pub load_scale: Option<Vec<f64>>,
}

/// One of `[[study.plan]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum StudyPlanTable {
    File {
        name: String,
        file: PathBuf,
    },
    Optimal {
        name: String,
        #[serde(default)]
        criterion: Criterion,
        configurations: Option<u32>,
        experiments: Option<u32>,
        #[serde(default)]
        noise_only: bool,
    },
    Random {
        name: String,
    },
    RandomEach {
        name: String,
    },
}

impl StudyPlanTable {
    pub const fn name(&self) -> &String {
        match self {
            Self::File { name, .. }
            | Self::Optimal { name, .. }
            | Self::Random { name }
            | Self::RandomEach { name } => name,
        }
    }
}
