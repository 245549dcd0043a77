//! What several tests need.

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use elastocal::codes::ErrorCode;
use elastocal::measurement::AbsoluteReading;
use elastocal::observation::Setup;
use elastocal::plan::search::Watch;
use elastocal::plan::{Experiment, Plan, read_plan, write_plan};
use elastocal::robot::{Commands, KinematicState, Load, ObservationMatrix};
use elastocal::scenario::Scenario;
use nalgebra::{DVector, Matrix6xX, Vector3};
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

    /// With one file.
    pub fn with(name: &str, content: impl AsRef<[u8]>) -> Self {
        let place = Self::new();
        place.write(name, content);
        place
    }

    /// With an arm and its scenario, `arm.xml` and `arm.toml`.
    pub fn of_arm(model: impl AsRef<[u8]>, scenario: impl AsRef<[u8]>) -> Self {
        let place = Self::with("arm.xml", model);
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

    /// Writes a plan of deflections for a robot of these joints.
    pub fn write_plan(&self, name: &str, commands: impl Into<Commands>, plan: &Plan) {
        write_plan(&self.path(name), commands, plan).expect("the plan can be written");
    }

    /// Takes from an identified file which readings it is of, so that these stand for others.
    pub fn forget_readings(&self, name: &str) {
        let mut json = self.parsed(name);
        json["reading_digests"] = Value::Null;
        self.write(name, json.to_string());
    }

    /// Reads a text file.
    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).expect("the file can be read")
    }

    /// Reads a file of JSON.
    pub fn parsed(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).expect("it is JSON")
    }

    /// Loads a scenario.
    pub fn scenario(&self, name: &str) -> Scenario {
        Scenario::load(&self.path(name)).expect("the scenario is valid")
    }

    /// The names of all files and folders, folders within folders included, in order.
    pub fn listing(&self) -> Vec<String> {
        let mut found = Vec::new();
        list_folder(self.folder.path(), self.folder.path(), &mut found);
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

    /// Runs what ends well.
    pub fn done(&self, arguments: &str) -> Outcome {
        self.run(arguments).ends_with(0)
    }

    /// Runs what ends with an error.
    pub fn refused(&self, arguments: &str) -> Outcome {
        self.run(arguments).ends_with(1)
    }

    /// Runs what is no command with its options.
    pub fn misused(&self, arguments: &str) -> Outcome {
        self.run(arguments).ends_with(2)
    }

    /// Runs what is done, with a condition that does not hold.
    pub fn doubted(&self, arguments: &str) -> Outcome {
        self.run(arguments).ends_with(3)
    }

    /// What a command prints as JSON, with a condition that does not hold or without.
    pub fn record(&self, arguments: &str) -> Value {
        self.run(&format!("{arguments} --json --quiet")).json()
    }

    /// What a command that ends well prints as JSON.
    pub fn json(&self, arguments: &str) -> Value {
        self.done(&format!("{arguments} --json --quiet")).json()
    }

    /// The same of a command that is done, with a condition that does not hold.
    pub fn json_with_conditions(&self, arguments: &str) -> Value {
        self.doubted(&format!("{arguments} --json --quiet")).json()
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

fn list_folder(root: &Path, folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("the entry can be read").path();
        let name = path.strip_prefix(root).expect("it lies in the root");
        found.push(name.to_string_lossy().into_owned());
        if path.is_dir() {
            list_folder(root, &path, found);
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
    #[track_caller]
    pub fn says(&self, words: &str) -> &Self {
        let is_said = self.stderr.contains(words);
        assert!(is_said, "{words:?} is not said: {self:#?}");
        self
    }

    /// Asserts that the results have these words.
    #[track_caller]
    pub fn prints(&self, words: &str) -> &Self {
        let is_printed = self.stdout.contains(words);
        assert!(is_printed, "{words:?} is not printed: {self:#?}");
        self
    }

    /// Asserts that the diagnostics do not have these words.
    #[track_caller]
    pub fn does_not_say(&self, words: &str) {
        let is_said = self.stderr.contains(words);
        assert!(!is_said, "{words:?} is said: {self:#?}");
    }

    /// Asserts that the results do not have these words.
    #[track_caller]
    pub fn does_not_print(&self, words: &str) {
        let is_printed = self.stdout.contains(words);
        assert!(!is_printed, "{words:?} is printed: {self:#?}");
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

/// The path of a file of the project as an argument.
pub fn shipped(path: &str) -> String {
    project(path).display().to_string()
}

/// Asserts that two numbers differ by less than this.
#[track_caller]
pub fn assert_near(one: f64, other: f64, apart: f64) {
    assert!((one - other).abs() < apart, "{one} {other}, by {apart}");
}

/// Asserts that two numbers differ by less than this share.
#[track_caller]
pub fn assert_alike(one: f64, other: f64, share: f64) {
    let apart = (one / other - 1.0).abs();
    assert!(apart < share, "{one} {other}, by a share of {share}");
}

/// The same in a case that is named where it fails.
#[track_caller]
pub fn assert_near_in(case: &dyn Debug, one: f64, other: f64, apart: f64) {
    let is_near = (one - other).abs() < apart;
    assert!(is_near, "{case:?}: {one} {other}, by {apart}");
}

/// The same in a case that is named where it fails.
#[track_caller]
pub fn assert_alike_in(case: &dyn Debug, one: f64, other: f64, share: f64) {
    let is_alike = (one / other - 1.0).abs() < share;
    assert!(is_alike, "{case:?}: {one} {other}, by a share of {share}");
}

/// The planner's chain at these joint angles (rad), with its calibration tool.
pub fn state_at(scenario: &Scenario, q: &DVector<f64>) -> KinematicState {
    let belief = &scenario.task.belief;
    let chain = belief.nominal.chain.at(&belief.calibration_tool);
    chain.state(q.as_slice())
}

/// A table in which the numbers of these columns are changed.
pub fn with_numbers(table: &str, columns: &[&str], change: impl Fn(f64) -> f64) -> String {
    let (mut lines, rows): (Vec<&str>, Vec<&str>) =
        (table.lines()).partition(|line| line.starts_with('#'));
    lines.push(rows[0]);
    let names: Vec<&str> = rows[0].split(',').collect();
    assert!(columns.iter().all(|column| names.contains(column)));
    let changed = |(name, field): (&&str, &str)| match field.parse() {
        Ok(number) if columns.contains(name) => change(number).to_string(),
        _ => field.to_owned(),
    };
    let row = |row: &&str| {
        let fields = names.iter().zip(row.split(','));
        fields.map(changed).collect::<Vec<_>>().join(",")
    };
    let rows: Vec<String> = rows[1..].iter().map(row).collect();
    format!("{}\n{}\n", lines.join("\n"), rows.join("\n"))
}

/// Asserts that a text has these words.
#[track_caller]
pub fn assert_has(text: &str, words: &str) {
    assert!(text.contains(words), "{words:?} is not in: {text}");
}

/// A search that nobody watches, and that goes on to its end.
pub fn unwatched() -> Watch<'static> {
    static STOP: AtomicBool = AtomicBool::new(false);
    Watch {
        stop: &STOP,
        progress: &|_, _, _| {},
    }
}

/// A load without a torque.
pub const fn force(force_n: Vector3<f64>) -> Load {
    Load {
        force_n,
        ..Load::NONE
    }
}

/// What is measured once, whatever the side from which joints come.
pub const fn experiment(configuration_rad: DVector<f64>, load: Load) -> Experiment {
    Experiment {
        configuration_rad,
        load,
        repeats: 1,
        approach: None,
        direction: None,
    }
}

/// Asserts that `check` refuses a shipped scenario in which one text stands in another's place, with these words.
pub fn assert_change_refused(scenario: &str, [from, to]: [&str; 2], says: [&str; 2]) {
    let text = scenario_text(scenario);
    assert!(text.contains(from), "{from}");
    let place = Workplace::with("s.toml", text.replacen(from, to, 1));
    let refused = place.refused("check s.toml");
    refused.says(says[0]).says(says[1]);
}

/// Asserts that two commands predict the same accuracy, but for this share.
#[track_caller]
pub fn assert_same_rho0(one: &Value, other: &Value, share: f64) {
    assert_alike(number(&one["rho0_mm"]), number(&other["rho0_mm"]), share);
}

/// What is read from the first station, whatever the side from which joints come.
pub fn setup(commanded_rad: DVector<f64>, load: Load, target: usize) -> Setup {
    Setup {
        commanded_rad,
        load,
        hangs_on: None,
        target,
        station: 0,
        approach: None,
    }
}

/// A reading of nothing, of which nothing is said.
pub fn blank_reading() -> AbsoluteReading {
    AbsoluteReading {
        configuration_rad: DVector::zeros(0),
        load: Load::NONE,
        target: None,
        station: None,
        visit: None,
        position_m: Vector3::zeros(),
        rotation: None,
        length: None,
        covariance: None,
        approach: None,
        time_s: None,
        temperature_c: None,
    }
}

/// An array of JSON.
pub fn list(value: &Value) -> &Vec<Value> {
    value.as_array().expect("an array")
}

/// A number of JSON.
pub fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// The numbers of a JSON array.
pub fn numbers(value: &Value) -> Vec<f64> {
    list(value).iter().map(number).collect()
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
