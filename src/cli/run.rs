//! `run`: the whole loop, and a folder with all that came of it.

mod absolute;

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::calibration::Calibration;
use elastocal::files::make_folder;
use elastocal::measurement::write_measurements_under;
use elastocal::plan::{UncertaintyBudget, search::RepeatsNeeded, take_nearest_turns, write_plan};
use elastocal::record::messages::ProvenanceMessage;
use elastocal::scenario::Scenario;
use elastocal::task::{AccuracyKind, Belief};
use elastocal::text::wording::{counted, shell_path};
use elastocal::view::recording::{CarriedOutPlan, Recording};
use elastocal::view::report::{RunRecord, run_page};
use elastocal::view::stills::Stills;
use elastocal::workflow::design::Wanted;
use elastocal::workflow::run::{FailedPlan, RANDOM_PLANS, RunError, RunStage, TriedPlan, run};

use super::identify::deflections;
use super::interruption::{STOP, proceed};
use super::plan::design;
use super::planned::budget;
use super::proof::ProofArgs;
use super::readings_args::ReadingsArgs;
use super::table::{number, table};
use super::uncertainty_budget::BudgetArgs;
use super::views::{RUN_FILES, TARGETS, ViewerTarget, command_line, show, write_recording};
use super::written::{Written, record_text, warn};
use super::{Common, Report};

#[derive(Debug, Args)]
pub struct Run {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    proof: ProofArgs,
    #[command(flatten)]
    budget: BudgetArgs,
    #[command(flatten)]
    readings: ReadingsArgs,
    /// Show the recording in a rerun viewer too: start one, connect to one, or write a file.
    #[arg(long, value_name = TARGETS)]
    rerun: Option<ViewerTarget>,
}

/// The files of the results.
const FILES: [&str; 3] = ["plan.csv", "measurements.csv", "results.json"];

impl Run {
    /// The folder of the results, once nothing is in the way of any file.
    fn make_folder(&self, scenario: &Scenario) -> anyhow::Result<PathBuf> {
        let folder = self.common.folder(scenario);
        let names = [&FILES[..], RUN_FILES].concat();
        self.common.check_files(scenario, Some((&folder, &names)))?;
        make_folder(&folder)?;
        Ok(folder)
    }

    pub fn execute(&self) -> anyhow::Result<Report> {
        let scenario = self.common.open("run")?;
        let folder = self.make_folder(&scenario)?;
        match scenario.task.design.accuracy {
            AccuracyKind::Absolute => self.of_readings(&scenario, &folder),
            AccuracyKind::Relative => self.of_deflections(&scenario, &folder),
        }
    }

    /// The loop with a plan of deflections.
    fn of_deflections(&self, scenario: &Scenario, folder: &Path) -> anyhow::Result<Report> {
        let common = &self.common;
        let experiments = scenario.task.design.experiments;
        common.say(&format!(
            "designing a plan of {}",
            counted(experiments.into(), "measurement")
        ));
        let wanted = Wanted::by(&scenario.task);
        let (task, seed) = (&scenario.task, scenario.seed);
        let (mut designed, approximate) = design(common, task, seed, wanted, &self.proof, &STOP)?;
        let home = scenario.laboratory.home();
        take_nearest_turns(task, home, &mut designed.exact.plan);
        proceed()?;
        let outcome = run(scenario, (&designed, &approximate), &STOP, &|stage| {
            tell(common, folder, stage);
        });
        let outcome = outcome.map_err(|error| match error {
            // Its hint is told, too.
            RunError::File(error) => error.into(),
            other => anyhow::Error::from(other),
        })?;
        proceed()?;
        let mut json = outcome.json(scenario, designed.elapsed_s)?;
        let shown = outcome.tried.iter().map(|each| {
            let (name, calibration) = each.calibration.clone();
            CarriedOutPlan::Deflections(name, Box::new(calibration))
        });
        let shown: Vec<CarriedOutPlan> = shown.collect();
        let random_rho0_m = outcome.random_rho0_m;
        let main = &outcome.tried[0].calibration.1;
        let stills = Stills::of_plan(scenario, &main.plan);
        let record = RunRecord {
            scenario,
            outcome: &outcome,
            command: &command_line(),
            stills: &stills.figures(),
        };
        let recording = Recording::new(scenario, &shown)?;
        let page = run_page(&record)?;
        let mut written = Written::default();
        let text = record_text(&mut json, &outcome.conditions)?;
        write_all(scenario, folder, main, &text, &mut written);
        let [svg, html, rerun] =
            ["stills.svg", "report.html", "run.rrd"].map(|name| folder.join(name));
        written.save(&svg, &stills.sheet());
        written.save(&html, &page);
        write_recording(&recording, &rerun, &mut written);
        if let Some(target) = &self.rerun {
            show(target, &recording, &mut written)?;
        }
        let mut text = summary(
            folder,
            (&scenario.task.belief, &outcome.tried),
            random_rho0_m.zip(outcome.random_repeats),
        ) + &self.proof.tell(
            &designed.bound,
            &ProvenanceMessage::new(scenario),
            &mut written,
        )?;
        let budget = outcome.tried[0].assessment.uncertainty_budget.as_ref();
        text += &self.budget.write(budget, &mut written);
        say_laboratory(common, scenario, folder);
        let mut conditions = outcome.conditions;
        conditions.extend(written.conditions());
        Ok(Report::new(json, text, conditions))
    }
}

/// Says on stderr what is being done, and what goes wrong without an end.
fn tell(common: &Common, folder: &Path, stage: &RunStage<'_>) {
    match stage {
        RunStage::Calibrating => common.say("measuring, identifying and compensating in MuJoCo"),
        RunStage::Failed(FailedPlan { name, problem, .. }) => {
            warn(&format!("the plan {name:?} cannot be compared: {problem}"), None);
        }
        RunStage::Comparing => common.say(&format!(
            "comparing with {RANDOM_PLANS} random plans, other criteria and other numbers of measurements, writing {}",
            folder.display()
        )),
        RunStage::NoRandomPlans(problem) => {
            warn(&format!("no random plans to compare with: {problem}"), None);
        }
    }
}

/// Says which command writes what the laboratory needs.
fn say_laboratory(common: &Common, scenario: &Scenario, folder: &Path) {
    common.say(&format!(
        "run sheet, robot program and table to fill in are written by `elastocal lab {} --plan {}`",
        shell_path(&scenario.path),
        shell_path(&folder.join(FILES[0]))
    ));
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
    let origin = scenario
        .origin()
        .simulated(scenario.seed, Some(main.truth.run));
    let rows = write_measurements_under(&origin, &measurements, commands, &main.measurements);
    written.note(&measurements, rows);
    written.save(&results, text);
}

/// What it means, for a person.
fn summary(
    folder: &Path,
    (belief, entries): (&Belief, &[TriedPlan]),
    random: Option<(f64, RepeatsNeeded)>,
) -> String {
    let main = &entries[0];
    let mut text = deflections::describe(&main.calibration.1.identification, belief);
    text.push('\n');
    let micro = |value: f64| number(Some(value * 1e6), 2);
    let rows = entries.iter().map(|entry| {
        let [_, residual_m] = entry.calibration.1.rms_m();
        vec![
            entry.calibration.0.clone(),
            number(entry.assessment.rho0_m.map(|value| value * 1e6), 2),
            number(entry.assessment.efficiency(), 4),
            micro(residual_m),
            entry.assessment.violations.len().to_string(),
        ]
    });
    text += &table(
        "plan | predicted rms [um] | efficiency | observed in this run [um] | violations",
        rows,
    );
    for entry in entries {
        if let Some(reason) = entry.assessment.no_bound() {
            let name = &entry.calibration.0;
            text += &format!("plan {name:?} has no efficiency: {reason}\n");
        }
    }
    text += &budget(&main.assessment);
    let uncertain = main.assessment.uncertainty_budget.as_ref();
    let leaves = if uncertain.is_some_and(UncertaintyBudget::has_more_than_noise) {
        "predicted with the whole uncertainty budget:"
    } else {
        "predicted for the measurements' noise alone:"
    };
    let poses = &main.calibration.1.poses;
    let [uncompensated, residual] = main.calibration.1.rms_m().map(|each| each * 1e6);
    let (at, rms) = match poses.as_slice() {
        [only] => (format!("the test pose {:?}", only.name), ""),
        several => (
            counted(several.len() as u64, "test pose"),
            " (rms by their weights)",
        ),
    };
    let along = match poses.iter().filter(|pose| pose.direction.is_some()).count() {
        0 => "",
        1 if poses.len() == 1 => " along its direction",
        _ => " along the directions that test poses have",
    };
    let predicted = number(main.assessment.rho0_m.map(|value| value * 1e6), 1);
    let tolerance = (main.assessment.quantile95_m).map_or_else(String::new, |value| {
        format!(", 95 % below {:.1} um", value * 1e6)
    });
    text += &format!(
        "\nAt {at} the task load bends the robot by {uncompensated:.0} um{rms}{along}. After calibration with {}, the residual error after compensation is {residual:.1} um in this run; {leaves} {predicted} um rms{tolerance}",
        counted(main.assessment.experiments.into(), "measurement"),
    );
    if poses.len() > 1 {
        let rows = poses.iter().map(|pose| {
            let [without, with] = [pose.seen.uncompensated_m, pose.seen.residual_m];
            vec![
                pose.name.clone(),
                number(Some(pose.weight), 3),
                micro(without.norm()),
                micro(with.norm()),
            ]
        });
        let each = table(
            "test pose | weight | uncompensated [um] | residual error in this run [um]",
            rows,
        );
        text = each + &text;
    }
    if let Some(bound) = main.assessment.bound_m() {
        text += &format!(
            "; no plan of as many measurements can do better than {:.1} um",
            bound * 1e6
        );
    }
    text += ".\n";
    if let Some((rho0_m, repeats)) = random {
        text += &format!(
            "Predicted accuracy of a random plan of as many: {:.1} um (median of {RANDOM_PLANS}): ",
            rho0_m * 1e6
        );
        text += &match repeats {
            RepeatsNeeded::Times(times) => {
                format!("measured {times} times as a whole it has the same accuracy.\n")
            }
            RepeatsNeeded::Never(limit_m) => format!(
                "however often it is measured as a whole, {:.1} um remain.\n",
                limit_m * 1e6
            ),
        };
    }
    text += &format!("Results are in {}\n", folder.display());
    text
}
