//! `identify` on absolute readings.

use crate::files::output::write_whole;
use crate::identification::{
    AbsoluteMessage, DistanceStatistics, FitChoices, IdentificationError, Inconsistencies,
    JointError, ModelSelection, MountedFrameMessage, NestedModel, ReadingWeights,
    UnexplainedMessage,
};
use crate::measurement::{AbsoluteReading, digests_of, read_measured};
use crate::quantities::units::shown_unit;
use crate::record::model_selection::model_selection_json;
use crate::record::uncertainties::uncertainty_tables;
use crate::robot::{Drive, Load, SerialChain};
use crate::task::Belief;
use crate::view::plots::model_selection_plot;
use crate::workflow::identify::{IdentifiedRobot, identify_absolute, model_selection, uncounted};

use super::{Identify, JointErrorsUse};
use crate::cli::command_prelude::*;
use crate::cli::identified::refuse_fitted;
use crate::cli::residuals;
use crate::cli::table::{DISTANCES, distances, numbers, residual_name};

impl Identify {
    /// A robot.
    pub(super) fn of_absolute(
        &self,
        scenario: &Scenario,
        readings: &[AbsoluteReading],
    ) -> anyhow::Result<Report> {
        self.common.say(&format!(
            "fitting the robot to {}",
            counted(readings.len() as u64, "absolute reading")
        ));
        let weights = match (self.sigma_from_residuals, self.common.noise_only) {
            (true, _) => ReadingWeights::WithDiscrepancy,
            (false, true) => ReadingWeights::Own,
            (false, false) => ReadingWeights::AsNeeded,
        };
        let (belief, file) = (&scenario.task.belief, &self.measurements);
        let mut choices = FitChoices {
            weights,
            keeps_all: self.keep_all,
            uses_joint_errors: self.joint_errors != JointErrorsUse::Off,
        };
        let wrong = |error: IdentificationError| error.in_file(file);
        let model_selection = (self.model_selection)
            .then(|| model_selection(belief, readings, choices).map_err(wrong))
            .transpose()?;
        let model_selection = model_selection.as_ref();
        let groups = model_selection.map_or(&*self.parameters, ModelSelection::groups);
        if self.joint_errors == JointErrorsUse::Auto {
            choices.uses_joint_errors =
                model_selection.is_none_or(ModelSelection::recommends_joint_errors);
        }
        let mut identified = identify_absolute(belief, readings, groups, choices).map_err(wrong)?;
        let mut again = String::new();
        if let Some(other) = &self.against {
            let why = ", and absolute readings are held against it";
            let others = read_measured(other, &scenario.task)?.absolute(other, why)?;
            let (same, hint) = (
                file.display(),
                "--against takes another series of the robot",
            );
            let digests = [&*others, readings].map(digests_of);
            let digests = digests.each_ref().map(|each| &**each);
            let may_repeat = || identified.case.may_repeat();
            again = refuse_fitted(other, digests, may_repeat, &same.to_string(), hint)?;
            let between = [file, other].map(|path| format!("in {}", path.display()));
            (identified.compare(belief, &others, groups, between))
                .map_err(|error| error.in_file(other))?;
        }
        let mut report = Report {
            json: identified.json(
                scenario,
                readings,
                &self.common.provenance(scenario)?,
                groups,
            )?,
            conditions: identified.conditions(),
            text: again,
            ..Report::default()
        };
        if let Some(found) = model_selection {
            report.text += &format!("{}\n", describe_selection(found));
            if let Some(path) = &self.plot_out {
                let title = format!("{}: nested models compared", scenario.name);
                report.save(path, &model_selection_plot(&title, found)?);
            }
            report.json["model_selection"] = model_selection_json(found);
        } else {
            self.draw_patterns(scenario, &identified.patterns, &mut report)?;
        }
        let message = AbsoluteMessage::new(&identified.case, &identified.fit);
        report.text += &describe(&message, belief);
        if let Some(path) = &self.uncertainties_out {
            report.noted(path, write_uncertainties(path, file, &identified));
        }
        let text = &mut report.text;
        *text += &naming(
            uncounted(&identified),
            "  Not counted but as part of what the residuals show: {}\n",
        );
        *text += &residuals::patterns(&identified.patterns);
        *text += &residuals::drifts(identified.drifts.as_ref());
        *text += &residuals::repeats(identified.repeats.as_ref(), "positions");
        *text += &residuals::components(identified.repeat_components.as_ref());
        for each in &identified.inconsistencies {
            *text += &compared(each);
        }
        let loads = readings.iter().map(|each| &each.load);
        let loads = loads.filter(|load| **load != Load::NONE);
        let outside = scenario.task.loads.outside_all("loaded reading", loads);
        *text += &noted(&identified.notes());
        report.conditions.extend(outside);
        Ok(report)
    }
}

/// Writes the variance components of a fit's residuals, and of its repeats.
fn write_uncertainties(
    path: &Path,
    file: &Path,
    identified: &IdentifiedRobot<'_>,
) -> Result<(), FileError> {
    let components = identified.case.variance_components(&identified.fit);
    let repeats = identified.repeat_components.as_ref();
    let joints = &identified.case.arm.chain.joints;
    let tables = uncertainty_tables(components.as_ref(), repeats, joints)
        .map_err(|error| FileError::new(path, error.to_string()))?;
    let sources = identified.case.belief.uncertain.sources();
    let found_anew = sources.filter(|(_, source)| source.is_found_from_residuals());
    let replaced = naming(
        found_anew.map(|(name, _)| name),
        "# In place of what the scenario lists, not beside it: {}.\n",
    );
    let of = file.display();
    let text = format!("# Variance components of {of}.\n{replaced}\n{tables}");
    write_whole(path, text.as_bytes())
}

/// How many parameters of two series agree; the others are conditions.
fn compared(beside: &Inconsistencies) -> String {
    let [one, other] = &beside.between;
    let parameters = counted(beside.compared as u64, "parameter");
    let found = match (beside.compared, beside.found.len()) {
        (0, _) => "no parameter is determined by both".to_owned(),
        (_, 0) => format!("of {parameters} none are inconsistent with each other"),
        (_, 1) => format!("of {parameters} one is inconsistent with each other"),
        (_, count) => format!("of {parameters} {count} are inconsistent with each other"),
    };
    format!("  Fitted apart {one} and {other}: {found}.\n")
        + &naming(
            &beside.not_comparable,
            "    not comparable, from the same prior in both: {}\n",
        )
}

/// What was identified, for a person.
pub fn describe(message: &AbsoluteMessage, belief: &Belief) -> String {
    let mut text = format!(
        "{} unknowns from {} ({} numbers)\n\n",
        message.unknowns.len(),
        counted(message.readings as u64, "reading"),
        message.numbers
    );
    text += &frames_table(&message.stations, &message.targets);
    let rows: Vec<Vec<String>> = (message.unknowns.iter())
        .filter(|each| !message.is_of_frame(&each.name))
        .map(|each| {
            let (factor, unit) = shown_unit(&each.unit);
            let number = |value: f64| format!("{:.4}", value * factor);
            let value = match each.standard_error {
                Some(_) => number(each.value),
                None => "not determined".to_owned(),
            };
            let interval = or_dash(each.interval95, |ends| ends.map(number).join(" to "));
            let error = or_dash(each.standard_error, number);
            let (name, nominal) = (each.name.clone(), number(each.nominal));
            vec![name, nominal, value, error, interval, unit.to_owned()]
        })
        .collect();
    if !rows.is_empty() {
        let header = "unknown | nominal | value | standard error | 95 % interval | unit";
        text += &format!("\n{}", table(header, rows));
    }
    let redundant = message.left_out.iter().map(|each| &each.name);
    text += &naming(redundant, "\n  Redundant, not fitted: {}\n");
    let mut rows = vec![distances(
        &residual_name(&belief.instrument),
        &message.distance_mm,
    )];
    rows.extend((message.angle_mrad.as_ref()).map(|angles| distances("angle [mrad]", angles)));
    text += &format!("\n{}", table(DISTANCES, rows));
    if message.consistency.is_none() && message.numbers <= message.unknowns.len() {
        text +=
            "  As many equations as unknowns: there are no residuals that could show an error.\n";
    }
    if let Some(discrepancy_mm) = message.discrepancy_mm {
        let turned = message
            .discrepancy_mrad
            .map(|value| format!(", {value:.4} mrad"));
        text += &format!(
            "  Model discrepancy {discrepancy_mm:.4} mm{} in each coordinate, which the standard errors count.\n",
            turned.unwrap_or_default()
        );
    }
    if let Some(found) = &message.discrepancy_model {
        text += &discrepancy_model(found, &belief.nominal.chain);
    }
    text
}

/// What the discrepancy consists of.
fn discrepancy_model(found: &UnexplainedMessage, chain: &SerialChain) -> String {
    let rows = found.joints.iter().map(|each| {
        let mut joints = chain.joints.iter();
        let joint = joints.find(|joint| joint.name == each.joint);
        let drive = joint.map_or_else(Drive::default, |joint| joint.drive);
        let JointError {
            process,
            deviation,
            values,
            ..
        } = &each.error;
        let largest = (values.iter()).fold(0.0, |most: f64, value| most.max(value.abs()));
        let (factor, unit) = shown_unit(drive.unit());
        let [deviation, largest] =
            [*deviation, largest].map(|value| format!("{:.4} {unit}", value * factor));
        let (alike, unit) = drive.shown(process.kernel.length);
        let alike = format!("{alike:.1} {unit}");
        vec![each.joint.clone(), deviation, alike, largest]
    });
    let header = "joint | off by | alike within | largest";
    let turned = found.angle_mrad.as_ref();
    format!(
        "  Of that, joint error functions of this size:\n\n{}  \
         With these, the mean residual is {:.4} mm{}; {}, effective sample size {:.0}.\n",
        table(header, rows),
        found.distance_mm.mean,
        turned.map_or_else(String::new, |angle| format!(", {:.4} mrad", angle.mean)),
        counted(found.visits as u64, "visit"),
        found.effective_sample_size
    )
}

fn frames_table(stations: &[MountedFrameMessage], targets: &[MountedFrameMessage]) -> String {
    let row = |what: &str, frame: &MountedFrameMessage| {
        let name = frame.name.iter().map(|name| format!(" {name}"));
        let std = |errors: Option<[f64; 3]>| or_dash(errors, |errors| numbers(errors, 4));
        vec![
            what.to_owned() + &name.collect::<String>(),
            numbers(frame.position_mm, 4),
            std(frame.position_std_mm),
            or_dash(frame.quaternion, |q| numbers(q, 7)),
            std(frame.rotation_std_mrad),
        ]
    };
    let rows = (stations.iter().map(|frame| row("base at station", frame)))
        .chain(targets.iter().map(|frame| row("target", frame)));
    let header =
        "frame | position [mm] | standard error | quaternion w x y z | standard error [mrad]";
    table(header, rows)
}

/// What the row of the recommended model with joint error functions is called.
const JOINT_ERRORS: &str = "that + joint error functions";

/// Nested models, and which one to use.
fn describe_selection(model_selection: &ModelSelection) -> String {
    let recommended = model_selection.recommendation.as_ref();
    let row = |name: String, nested_model: &NestedModel, is_recommended: bool| {
        let judged = nested_model.cross_validation.as_ref().ok();
        let predicted = judged.and_then(|judged| judged.distances.as_ref());
        let rms = |lengths: Option<&DistanceStatistics>| {
            number(lengths.map(|lengths| lengths.rms * 1e3), 4)
        };
        let mark = if is_recommended { "  <- use" } else { "" };
        vec![
            name + mark,
            nested_model.unknowns.to_string(),
            rms(nested_model.distances.as_ref()),
            rms(predicted),
            or_dash(judged, |judged| {
                format!("{:.4} +- {:.4}", judged.beyond_best, judged.standard_error)
            }),
        ]
    };
    let nested = model_selection.nested_models.iter().enumerate();
    let nested = nested.map(|(place, model)| {
        let is_recommended = recommended.is_some_and(|each| each.nested_model == place);
        row(model_selection.name(place), model, is_recommended)
    });
    let more = model_selection.with_joint_errors.iter().map(|model| {
        let is_recommended = model_selection.recommends_joint_errors();
        row(JOINT_ERRORS.to_owned(), model, is_recommended)
    });
    let rows = nested.chain(more);
    let header = "model | unknowns | fitted rms [mm] | predicted rms [mm] | loss over the best";
    let mut text = table(header, rows);
    text += &format!(
        "  predicted: each of {} blocks of joint space by a fit to the others ({} readings); loss: weighted squares of \
         that, with the standard error of the difference\n",
        model_selection.blocks, model_selection.judged
    );
    let rejected = model_selection.rejected.iter().map(|each| each.reading + 1);
    let readings = match rejected.len() {
        1 => "  outliers of the largest model, left out of all: reading {}\n",
        _ => "  outliers of the largest model, left out of all: readings {}\n",
    };
    text += &naming(rejected, readings);
    for nested_model in &model_selection.nested_models {
        if let Err(reason) = &nested_model.cross_validation {
            let added = nested_model.added.word();
            text += &format!("  {added} is not compared: {reason}\n");
        }
    }
    for (added, reason) in &model_selection.skipped {
        text += &format!("  no model with {}: {reason}\n", added.word());
    }
    text += "\n";
    for sentence in recommended.map_or(&[][..], |each| &each.sentences) {
        text += &format!("  {sentence}\n");
    }
    text
}
