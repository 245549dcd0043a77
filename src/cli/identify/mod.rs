//! `identify`: compliances, or a whole robot, from what was measured.

pub mod absolute;
pub mod deflections;

use clap::ValueEnum;

use crate::identification::{ParameterGroup, patterns::Patterns};
use crate::measurement::{MeasuredFile, controller_compensates, read_measured};
use crate::task::Method;
use crate::view::plots::patterns_plot;

use super::command_prelude::*;
use super::identified::refuse_prior;

/// Whether joint error functions are used.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum JointErrorsUse {
    /// Unless --model-selection finds that they predict no better.
    #[default]
    Auto,
    /// Where there are readings enough.
    On,
    /// Never.
    Off,
}

#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["seed", "threads", "out"])))]
pub struct Identify {
    #[command(flatten)]
    pub common: Common,
    /// The measurements.
    #[arg(long, value_name = "FILE")]
    measurements: PathBuf,
    /// The method; the scenario's if not given.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Estimate sigma from the residuals instead of taking the scenario's. Of absolute readings: weigh them by the model
    /// discrepancy, too, even where their own deviations explain the residuals.
    #[arg(long)]
    sigma_from_residuals: bool,
    /// What to fit to absolute readings, frames of stations and targets always among it; what the scenario's robot.parameters
    /// name if not given.
    #[arg(long, value_enum, value_name = "GROUPS", value_delimiter = ',')]
    parameters: Vec<ParameterGroup>,
    /// Compare models with more and more parameters (frames, zeros, links, compliances, springs, payload) by blocks of joint
    /// space that they were not fitted to, and fit the one that is recommended. Of absolute readings.
    #[arg(long, conflicts_with = "parameters")]
    model_selection: bool,
    /// Use joint error functions; without, what joints are off by is part of the model discrepancy. Of absolute readings.
    #[arg(
        long,
        value_enum,
        value_name = "USE",
        default_value_t,
        hide_default_value = true
    )]
    joint_errors: JointErrorsUse,
    /// Another series of absolute readings of the same robot, fitted apart in the same way: inconsistent parameters
    /// are named.
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// Where to write a picture (SVG): of the patterns in the residuals; with --model-selection, of each model's residuals.
    #[arg(long, value_name = "FILE")]
    plot_out: Option<PathBuf>,
    /// Fit readings that lie far out, too: more than 5 standard deviations from what the others say.
    #[arg(long)]
    keep_all: bool,
    /// Where to write the variance components of the residuals, as tables [[uncertainty]] for a scenario: joint error functions and
    /// discrepancy. Of absolute readings.
    #[arg(long, value_name = "FILE")]
    uncertainties_out: Option<PathBuf>,
    /// Where to write what was identified, for `compensate`.
    #[arg(long, value_name = "FILE")]
    identified_out: Option<PathBuf>,
}

impl Identify {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let (scenario, origin) = (self.common).load_measured("identify", &self.measurements)?;
        let measured = read_measured(&self.measurements, &scenario.task)?;
        self.common.check_files(&scenario, None)?;
        let held = match &measured {
            MeasuredFile::Deflections(_) => AccuracyKind::Relative,
            MeasuredFile::Absolute(_) => AccuracyKind::Absolute,
        };
        (self.common).refuse_for("identify", &self.measurements, held)?;
        let again = refuse_prior(&scenario, &self.measurements, &measured)?;
        let mut report = match measured {
            MeasuredFile::Deflections(measurements) => {
                self.of_deflections(&scenario, origin.as_ref(), &measurements)?
            }
            MeasuredFile::Absolute(readings) => self.of_absolute(&scenario, &readings)?,
        };
        report.text = again + &report.text;
        if controller_compensates(&self.measurements)? {
            let words = "the controller compensated deflections itself (KUKA: $ABS_ACCUR), as the file of measurements says";
            let condition = ConditionCode::ControllerCompensates.with(words);
            let conditions = report.json.get_mut("conditions");
            if let Some(conditions) = conditions.and_then(Value::as_array_mut) {
                conditions.push(json!(condition));
            }
            report.conditions.push(condition);
        }
        if let Some(path) = &self.identified_out {
            let text = serde_json::to_string_pretty(&report.json)? + "\n";
            report.write(path, &text)?;
        }
        Ok(report)
    }

    /// Draws the patterns, where that is wanted.
    fn draw_patterns(
        &self,
        scenario: &Scenario,
        patterns: &Patterns,
        report: &mut Report,
    ) -> anyhow::Result<()> {
        let Some(path) = &self.plot_out else {
            return Ok(());
        };
        if patterns.found.is_empty() {
            let file = path.display();
            report.text +=
                &format!("there are no patterns in the residuals to draw: {file} is not written\n");
            return Ok(());
        }
        let title = format!("{}: patterns in the residuals", scenario.name);
        report.save(path, &patterns_plot(&title, patterns)?);
        Ok(())
    }
}
