//! The file that says what the columns of a foreign table are.

use serde::Deserialize;

/// A mapping as it is written; see `docs/files.md`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MappingFile {
    /// What separates the fields; what the header has if not given.
    pub delimiter: Option<String>,
    /// `.` or `,`.
    #[serde(default = "point")]
    pub decimal: String,
    /// The line of the columns' names, from 1; 0 where there is none, and columns are named by their numbers.
    pub header_line: Option<usize>,
    /// Lines that are none of the table's.
    #[serde(default)]
    pub skip_lines: Vec<usize>,
    /// Rows in which one of these columns is empty are left out.
    #[serde(default)]
    pub skip_empty: Vec<String>,
    /// The commanded joints in the order of the model.
    pub joint: Vec<JointMapping>,
    /// Where the target is, in the instrument's frame.
    pub position: Option<VectorMapping>,
    /// How it is turned there.
    pub rotation: Option<RotationMapping>,
    /// Loaded minus unloaded position, in the world frame, in place of position and rotation.
    pub deflection: Option<VectorMapping>,
    /// The force at the calibration tool, in the world frame.
    pub force: Option<VectorMapping>,
    /// The torque there.
    pub torque: Option<VectorMapping>,
    /// A weight at the calibration tool: its size.
    pub weight: Option<ScalarMapping>,
    /// Which reflector.
    pub target: Option<WordMapping>,
    /// Where the instrument stands.
    pub station: Option<WordMapping>,
    /// The stand of the robot.
    pub state: Option<WordMapping>,
    /// From which side the configuration was approached.
    pub approach: Option<WordMapping>,
    /// When.
    pub time: Option<ScalarMapping>,
    /// How warm.
    pub temperature: Option<ScalarMapping>,
}

fn point() -> String {
    ".".to_owned()
}

/// A joint: the model's angle is sign times the table's plus the offset.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointMapping {
    pub column: Option<String>,
    /// The same in every row.
    pub value: Option<f64>,
    pub unit: String,
    #[serde(default = "one")]
    pub sign: f64,
    /// In the same unit.
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

/// Three numbers.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VectorMapping {
    #[serde(default)]
    pub columns: Vec<String>,
    /// The same in every row.
    #[serde(default)]
    pub value: Vec<f64>,
    pub unit: String,
    /// Columns of standard deviations.
    #[serde(default)]
    pub std_columns: Vec<String>,
    /// The same in every row.
    #[serde(default)]
    pub std: Vec<f64>,
    /// That of the values if not given.
    pub std_unit: Option<String>,
}

/// A rotation: the target's axes in the instrument's frame.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotationMapping {
    pub kind: RotationKind,
    pub columns: Vec<String>,
    pub unit: Option<String>,
    /// The axes of Euler angles in the order in which they are turned about.
    pub axes: Option<String>,
    /// About the axes that turn with the target, or about those that stand still.
    pub about: Option<EulerAxes>,
    /// `wxyz` or `xyzw`.
    pub order: Option<String>,
    /// The table has the inverse: the instrument's axes in the target's frame.
    #[serde(default)]
    pub inverse: bool,
    /// Columns of standard deviations.
    #[serde(default)]
    pub std_columns: Vec<String>,
    /// The same in every row.
    #[serde(default)]
    pub std: Vec<f64>,
    /// That of the values if not given.
    pub std_unit: Option<String>,
}

/// How a rotation is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RotationKind {
    /// Three angles.
    Euler,
    /// Four numbers.
    Quaternion,
    /// The axis times the angle.
    RotationVector,
    /// Nine numbers, row by row.
    Matrix,
}

/// Which axes Euler angles turn about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EulerAxes {
    /// Those that turn with the target.
    Intrinsic,
    /// Those that stand still.
    Extrinsic,
}

/// One number.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScalarMapping {
    pub column: Option<String>,
    /// The same in every row.
    pub value: Option<f64>,
    pub unit: String,
}

/// One word.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WordMapping {
    pub column: Option<String>,
    /// The same in every row.
    pub value: Option<String>,
}
