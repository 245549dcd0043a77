//! What several tests need.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use elastocal::codes::ErrorCode;
use elastocal::plan::{Experiment, Plan, read_plan};
use elastocal::robot::ObservationMatrix;
use elastocal::scenario::Scenario;
use nalgebra::Matrix6xX;
use serde_json::Value;
use tempfile::TempDir;

/// A path inside the project.
pub fn project(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A scenario that the project ships.
pub fn scenario(name: &str) -> Scenario {
    Scenario::load(&project(&format!("scenarios/{name}.toml"))).expect("the scenario is valid")
}

/// A plan that the project ships.
pub fn plan(name: &str) -> Plan {
    read_plan(&project(&format!("scenarios/plans/{name}.csv")), 6).expect("the plan is valid")
}

/// A plan of the paper's Table 4.
pub fn table4(experiments: u32) -> Plan {
    plan(&format!("klimchik2012_m{experiments}"))
}

/// The text of a scenario that the project ships, with paths that hold in any folder.
pub fn scenario_text(name: &str) -> String {
    std::fs::read_to_string(project(&format!("scenarios/{name}.toml")))
        .expect("the scenario can be read")
        .replace("../models", &project("models").to_string_lossy())
        .replace("plans/", &project("scenarios/plans/").to_string_lossy())
}

/// An empty folder to run the program in.
pub struct Workplace {
    folder: TempDir,
}

impl Workplace {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        Self { folder }
    }

    /// With an arm and its scenario, `arm.xml` and `arm.toml`.
    pub fn of_arm(model: impl AsRef<[u8]>, scenario: impl AsRef<[u8]>) -> Self {
        let place = Self::new();
        place.write("arm.xml", model);
        place.write("arm.toml", scenario);
        place
    }

    /// A path inside the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).expect("the file can be written");
    }

    /// Takes from an identified file which readings it is of, so that these stand for others.
    pub fn forget_readings(&self, name: &str) {
        let mut json: Value = serde_json::from_str(&self.read(name)).expect("JSON");
        json["reading_digests"] = Value::Null;
        self.write(name, json.to_string());
    }

    /// Reads a text file.
    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).expect("the file can be read")
    }

    /// The names of all files and folders, folders within folders included, in order.
    pub fn listing(&self) -> Vec<String> {
        let mut found = Vec::new();
        list(self.folder.path(), self.folder.path(), &mut found);
        found.sort();
        found
    }

    /// The program in the folder; the arguments are separated by spaces.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_elastocal"));
        command
            .args(arguments.split_whitespace())
            .current_dir(self.folder.path());
        command
    }

    /// Runs the program in the folder; the arguments are separated by spaces.
    pub fn run(&self, arguments: &str) -> Outcome {
        let output = self.command(arguments).output();
        Outcome::new(arguments, output.expect("the program starts"))
    }

    /// What a command that ends well prints as JSON.
    pub fn json(&self, arguments: &str) -> Value {
        let outcome = self.run(&format!("{arguments} --json --quiet"));
        outcome.ends_with(0).json()
    }

    /// The same of a command that is done, with a condition that does not hold.
    pub fn json_with_conditions(&self, arguments: &str) -> Value {
        let outcome = self.run(&format!("{arguments} --json --quiet"));
        outcome.ends_with(3).json()
    }

    /// Runs a script of the shell in the folder, to which `elastocal` is the program, as is
    /// `"$ELASTOCAL"`.
    pub fn shell(&self, script: &str) -> Outcome {
        let program = env!("CARGO_BIN_EXE_elastocal");
        let output = Command::new("sh")
            .args([
                "-c",
                &format!("elastocal() {{ '{program}' \"$@\"; }}\n{script}"),
            ])
            .env("ELASTOCAL", program)
            .current_dir(self.folder.path())
            .output();
        Outcome::new(script, output.expect("the shell starts"))
    }
}

fn list(root: &Path, folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("the entry can be read").path();
        let name = path.strip_prefix(root).expect("it lies in the root");
        found.push(name.to_string_lossy().into_owned());
        if path.is_dir() {
            list(root, &path, found);
        }
    }
}

/// How a run of the program ended.
#[derive(Debug)]
pub struct Outcome {
    pub arguments: String,
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Outcome {
    fn new(arguments: &str, output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("the program writes UTF-8");
        Self {
            arguments: arguments.to_owned(),
            code: output.status.code(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    /// Asserts the exit code.
    pub fn ends_with(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}: {self:#?}", self.arguments);
        self
    }

    /// Asserts that the diagnostics have these words.
    pub fn says(self, words: &str) -> Self {
        let is_said = self.stderr.contains(words);
        assert!(is_said, "{words:?} is not said: {self:#?}");
        self
    }

    /// The results that were printed with `--json`.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:#?}"))
    }
}

/// What a line of stderr says after "error" and a code that is explained; none where it is no such line.
pub fn error_message(line: &str) -> Option<&str> {
    let (code, message) = line.strip_prefix("error ")?.split_once(": ")?;
    let is_it = |known: &&ErrorCode| known.id() == code;
    ErrorCode::ALL.iter().find(is_it).map(|_| message)
}

/// The joints of the UR10, from its base on.
pub const UR10_JOINTS: [&str; 6] = [
    "shoulder_pan",
    "shoulder_lift",
    "elbow",
    "wrist_1",
    "wrist_2",
    "wrist_3",
];

/// A scenario of the repository whose plan is for an absolute accuracy.
pub fn absolute_scenario_text(name: &str) -> String {
    scenario_text(name).replace("[design]", "[design]\naccuracy = \"absolute\"")
}

/// The scenario `ur10` with loads of any direction up to 200 N.
pub fn ur10_under_any_load() -> String {
    let (fixed, any) = (
        "kind = \"fixed\"\nforce_n = [0, 0, -98]",
        "kind = \"any\"\nforce_max_n = 200",
    );
    let text = scenario_text("ur10");
    assert!(text.contains(fixed));
    text.replace(fixed, any)
}

/// A number of JSON.
pub fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// The numbers of a JSON array.
pub fn numbers(value: &Value) -> Vec<f64> {
    let array = value.as_array().expect("an array");
    array.iter().map(number).collect()
}

/// All six rows of an observation matrix, position above rotation (eq. 8).
pub fn six_rows(matrix: &ObservationMatrix) -> Matrix6xX<f64> {
    let mut rows = Matrix6xX::zeros(matrix.position.ncols());
    rows.fixed_rows_mut::<3>(0).copy_from(&matrix.position);
    rows.fixed_rows_mut::<3>(3).copy_from(&matrix.rotation);
    rows
}

/// Leaves the compliances of these joints alone open in a scenario.
pub fn leave_open(scenario: &mut Scenario, parameters: &[usize]) {
    let belief = &mut scenario.task.belief;
    let open = belief.of_compliances(parameters.to_vec(), None);
    *belief = open.expect("the joints exist");
}

/// Every experiment of a plan as often as it is measured.
pub fn repeated(plan: &Plan) -> impl Iterator<Item = &Experiment> {
    let each = plan.experiments.iter();
    each.flat_map(|each| std::iter::repeat_n(each, each.repeats as usize))
}
