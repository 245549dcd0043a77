//! `run`: the whole loop, and a folder with all that came of it.

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::calibration::{Calibration, calibrate, pose_conditions};
use elastocal::files::make_folder;
use elastocal::files::output::write_whole;
use elastocal::measurement::write_measurements_under;
use elastocal::plan::search::{Bound, SearchError, Watch, median_random_rho0, random_plan};
use elastocal::plan::{Assessment, Plan, read_plan, write_plan};
use elastocal::record::evidence::EvidenceMessage;
use elastocal::record::messages::{AssessmentMessage, CalibrationMessage, ProvenanceMessage};
use elastocal::scenario::Scenario;
use elastocal::study::evidence::gather;
use elastocal::wording::counted;
use serde_json::{Value, json};

use super::evaluate::loads_outside;
use super::interruption::NEVER;
use super::plan::{Wanted, design};
use super::proof::ProofArgs;
use super::table::{number, table};
use super::views::{PlanRecords, RUN_FILES, RunShown, RunViews, TARGETS, ViewerTarget};
use super::written::{Written, warn};
use super::{Common, Report, check_outputs, identify, inputs, merge, results};

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct Run {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    proof: ProofArgs,
    /// Show the recording in a rerun viewer too: start one, connect to one, or write a file.
    #[arg(long, value_name = TARGETS)]
    rerun: Option<ViewerTarget>,
}

/// So many random plans stand for what a laboratory without a plan would do.
const RANDOM_PLANS: u64 = 99;

/// The files of the results.
const FILES: [&str; 3] = ["plan.csv", "measurements.csv", "results.json"];

/// A plan that took part, with what it promised and what came of it.
struct Entry {
    assessment: Assessment,
    /// The plan's name and its calibration.
    calibration: (String, Calibration),
    is_random: bool,
}

/// A plan that was to be compared and could not be measured, identified or compensated.
struct Failed {
    name: String,
    /// What it promised, where there is a plan.
    assessment: Option<Assessment>,
    problem: String,
}

impl Entry {
    fn records(&self, scenario: &Scenario) -> PlanRecords {
        let (name, calibration) = &self.calibration;
        (
            CalibrationMessage::new(&scenario.task.belief.commands(), name, calibration),
            AssessmentMessage::new(scenario, &self.assessment),
        )
    }
}

impl Run {
    /// The folder of the results, once nothing is in the way of any file.
    fn make_folder(&self, scenario: &Scenario) -> anyhow::Result<PathBuf> {
        let folder = self.common.folder(scenario);
        let file = self.rerun.as_ref().and_then(ViewerTarget::file);
        let mut roles = inputs(scenario);
        roles.writes_to(&folder, &FILES);
        roles.writes_to(&folder, RUN_FILES);
        let outputs = [
            ("--rerun", file.map(PathBuf::as_path)),
            ("--proof-out", self.proof.out()),
        ];
        check_outputs(&mut roles, &outputs)?;
        make_folder(&folder)?;
        Ok(folder)
    }

    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let scenario = common.load()?;
        let folder = self.make_folder(&scenario)?;

        let experiments = scenario.task.design.experiments;
        common.say(&format!(
            "designing a plan of {}",
            counted(experiments.into(), "measurement")
        ));
        let wanted = Wanted::by(&scenario.task);
        let (task, seed) = (&scenario.task, scenario.seed);
        let designed = design(common, task, seed, wanted, &self.proof, &NEVER)?;
        let bound = &designed.bound;

        let (plans, random) = plans_to_compare(&scenario, designed.exact.plan)?;
        common.say("measuring, identifying and compensating in MuJoCo");
        let outside = |(name, plan): &(String, Plan)| loads_outside(&scenario, plan, Some(name));
        let loads_outside: Vec<String> = plans.iter().filter_map(outside).collect();
        let (entries, failed) = calibrate_all(&scenario, plans, random, bound)?;
        for each in &failed {
            warn(
                &format!(
                    "the plan {:?} cannot be compared: {}",
                    each.name, each.problem
                ),
                None,
            );
        }
        let records: Vec<PlanRecords> = (entries.iter())
            .map(|entry| entry.records(&scenario))
            .collect();

        common.say(&format!(
            "comparing with {RANDOM_PLANS} random plans, other criteria and other numbers of measurements, writing {}",
            folder.display()
        ));
        let random_rho0_m = promised_by_random(&scenario, experiments);
        let watch = Watch {
            stop: &NEVER,
            progress: &|_, _, _| {},
        };
        // The study draws random plans of its own.
        let fixed: Vec<(String, Plan)> = (entries.iter())
            .filter(|entry| !entry.is_random)
            .map(
                |Entry {
                     calibration: (name, made),
                     ..
                 }| (name.clone(), made.plan.clone()),
            )
            .collect();
        let evidence = gather(
            &scenario.task,
            &scenario.truth,
            (&designed.approximate, &designed.bound),
            &fixed,
            scenario.seed,
            watch,
        )?;
        let evidence = EvidenceMessage::new(&scenario, bound, &evidence);

        let mut json = everything(&scenario, &records, &failed, designed.elapsed_s)?;
        merge(
            &mut json,
            json!({ "random_plans": RANDOM_PLANS, "random_median_rho0_mm": random_rho0_m.map(|value| value * 1e3) }),
        );
        merge(&mut json, serde_json::to_value(&evidence)?);
        let main = &entries[0].calibration.1;
        let mut conditions = main.identification.conditions();
        conditions.extend(pose_conditions(&scenario.task.belief, &main.poses));
        conditions.extend(loads_outside);
        let calibrations: Vec<_> = (entries.iter())
            .map(|entry| entry.calibration.clone())
            .collect();
        let views = RunViews::new(&RunShown {
            scenario: &scenario,
            calibrations: &calibrations,
            records: &records,
            evidence: &evidence,
            random: (RANDOM_PLANS, random_rho0_m.map(|value| value * 1e3)),
            conditions: &conditions,
        })?;
        let mut written = Written::default();
        let text = serde_json::to_string_pretty(&json)? + "\n";
        write_all(&scenario, &folder, main, &text, &mut written);
        views.write(&folder, self.rerun.as_ref(), &mut written)?;
        conditions.extend(written.conditions());
        Ok(Report {
            text: summary(&folder, &entries, random_rho0_m) + &self.proof.tell(bound)?,
            conditions,
            json,
        })
    }
}

/// The median of what random plans of so many measurements promise (m), if there is one.
fn promised_by_random(scenario: &Scenario, experiments: u32) -> Option<f64> {
    median_random_rho0(&scenario.task, experiments, RANDOM_PLANS, scenario.seed)
        .inspect_err(|problem| {
            warn(&format!("no random plans to compare with: {problem}"), None);
        })
        .ok()
        .filter(|median| median.is_finite())
}

/// The designed plan and those of the scenario with as many measurements; and a random one.
type Compared = (Vec<(String, Plan)>, Result<Plan, SearchError>);

fn plans_to_compare(scenario: &Scenario, optimal: Plan) -> anyhow::Result<Compared> {
    let experiments = optimal.measurements();
    let mut plans = vec![("optimal".to_owned(), optimal)];
    for file in &scenario.plans {
        let plan = read_plan(&file.path, scenario.task.belief.commands())?;
        if plan.measurements() == experiments {
            plans.push((file.name.clone(), plan));
        }
    }
    Ok((
        plans,
        random_plan(&scenario.task, experiments, scenario.seed, 0),
    ))
}

/// Calibrates with every plan. The first must succeed; another that fails is compared no further.
fn calibrate_all(
    scenario: &Scenario,
    plans: Vec<(String, Plan)>,
    random: Result<Plan, SearchError>,
    bound: &Bound,
) -> anyhow::Result<(Vec<Entry>, Vec<Failed>)> {
    let (mut entries, mut failed) = (Vec::new(), Vec::new());
    let random = (
        "random".to_owned(),
        random.map_err(|error| error.to_string()),
    );
    let known = plans.len();
    let plans = plans.into_iter().map(|(name, plan)| (name, Ok(plan)));
    for (index, (name, plan)) in plans.chain([random]).enumerate() {
        let assessment = |plan: &Plan| Assessment::new(&scenario.task, plan, Some(bound));
        // Every plan is measured with the same noise.
        match plan
            .as_ref()
            .map(|plan| calibrate(&scenario.task, &scenario.truth, plan, scenario.seed, 0))
        {
            Ok(Ok(calibration)) => entries.push(Entry {
                assessment: assessment(&calibration.plan),
                calibration: (name, calibration),
                is_random: index == known,
            }),
            Ok(Err(error)) if entries.is_empty() => return Err(error.into()),
            Ok(Err(error)) => failed.push(Failed {
                name,
                assessment: plan.as_ref().ok().map(assessment),
                problem: error.to_string(),
            }),
            Err(problem) => failed.push(Failed {
                name,
                assessment: None,
                problem: problem.clone(),
            }),
        }
    }
    Ok((entries, failed))
}

/// The JSON of the run: the main plan's keys by stage, then every plan.
fn everything(
    scenario: &Scenario,
    plans: &[PlanRecords],
    failed: &[Failed],
    elapsed_s: f64,
) -> anyhow::Result<Value> {
    let (main, assessment) = &plans[0];
    let json = json!({
        "gate": scenario.gate,
        "plan": main.plan,
        "elapsed_s": elapsed_s,
        "measurements": main.measurements,
    });
    let mut json = results("run", &ProvenanceMessage::new(scenario), json);
    // The order matters where keys coincide: rho0_mm is what the plan promises, and the standard
    // errors are those of the identification.
    merge(&mut json, serde_json::to_value(&main.test_poses[0])?);
    merge(&mut json, serde_json::to_value(assessment)?);
    merge(&mut json, serde_json::to_value(&main.identification)?);
    let mut all = Vec::new();
    for (calibration, assessment) in plans {
        let mut plan = serde_json::to_value(calibration)?;
        merge(&mut plan, json!({ "assessment": assessment }));
        all.push(plan);
    }
    for each in failed {
        let Some(assessment) = &each.assessment else {
            continue;
        };
        let assessment = AssessmentMessage::new(scenario, assessment);
        let (name, problem) = (&each.name, &each.problem);
        all.push(
            json!({ "name": name, "assessment": assessment, "test_poses": [], "problem": problem }),
        );
    }
    merge(&mut json, json!({ "plans": all }));
    Ok(json)
}

/// Writes the designed plan, its measurements, and the text of results.json.
fn write_all(
    scenario: &Scenario,
    folder: &Path,
    main: &Calibration,
    text: &str,
    written: &mut Written,
) {
    let commands = scenario.task.belief.commands();
    let [plan, measurements, results] = FILES.map(|name| folder.join(name));
    written.note(&plan, write_plan(&plan, commands.clone(), &main.plan));
    let origin = scenario.origin();
    let rows = write_measurements_under(&origin, &measurements, commands, &main.measurements);
    written.note(&measurements, rows);
    written.note(&results, write_whole(&results, text.as_bytes()));
}

/// What it means, for a person.
fn summary(folder: &Path, entries: &[Entry], random_rho0_m: Option<f64>) -> String {
    let main = &entries[0];
    let mut text = identify::describe(&main.calibration.1.identification);
    text.push('\n');
    let micro = |value: f64| number(Some(value * 1e6), 2);
    let rows: Vec<Vec<String>> = entries
        .iter()
        .map(|entry| {
            let pose = &entry.calibration.1.poses[0];
            vec![
                entry.calibration.0.clone(),
                number(entry.assessment.rho0_m.map(|value| value * 1e6), 2),
                number(entry.assessment.efficiency(), 4),
                micro(pose.seen.residual_m.norm()),
                entry.assessment.violations.len().to_string(),
            ]
        })
        .collect();
    text += &table(
        &[
            "plan",
            "predicted rms [um]",
            "efficiency",
            "seen in this run [um]",
            "violations",
        ],
        &rows,
    );
    for entry in entries {
        if let Some(reason) = entry.assessment.no_bound() {
            let name = &entry.calibration.0;
            text += &format!("plan {name:?} has no efficiency: {reason}\n");
        }
    }
    let pose = &main.calibration.1.poses[0];
    let uncompensated = pose.seen.uncompensated_m.norm() * 1e6;
    let predicted = number(main.assessment.rho0_m.map(|value| value * 1e6), 1);
    text += &format!(
        "\nAt the test pose {:?} the task load bends the robot by {uncompensated:.0} um. After calibration \
         with {}, compensation leaves {:.1} um in this run; the measurements' noise alone leaves {predicted} um \
         rms",
        pose.name,
        counted(main.assessment.experiments.into(), "measurement"),
        pose.seen.residual_m.norm() * 1e6,
    );
    if let Some(bound) = main.assessment.bound_m() {
        text += &format!(
            "; no plan of as many measurements can do better than {:.1} um",
            bound * 1e6
        );
    }
    text += ".\n";
    if let (Some(optimal), Some(random_rho0_m)) = (main.assessment.rho0_m, random_rho0_m) {
        let times = (random_rho0_m / optimal).powi(2);
        text += &format!(
            "A random plan of as many promises {:.1} um (the median of {RANDOM_PLANS}): it would need \
             {times:.1} times as many measurements for the same accuracy.\n",
            random_rho0_m * 1e6
        );
    }
    text += &format!("Results are in {}\n", folder.display());
    text
}
