//! An identified file for a command, with its conditions.

use crate::identification::input_errors::measurements_may_repeat;
use crate::identification::{
    AbsoluteCase, Case, IdentifiedFile, IdentifiedRecord, impossible_compliance,
};
use crate::measurement::{MeasuredFile, SimulatedRun, count_among, digests_of};
use crate::numeric::{estimable::Estimable, posterior::Posterior};
use crate::text::wording::shell_path;
use crate::workflow::calibrated::CalibratedRobot;

use super::command_prelude::*;

/// What an identification gives to compensate with.
pub struct IdentifiedCompliances {
    /// What is known of the parameters.
    pub posterior: Posterior,
    /// What the model leaves unexplained, of positions (m) and rotations (rad).
    pub discrepancy: [f64; 2],
    /// What speaks against trusting it.
    pub conditions: Vec<Condition>,
}

/// A robot as it was identified, with the scenario that it belongs to.
pub struct ScenarioRobot {
    /// The scenario.
    pub scenario: Scenario,
    /// The robot.
    pub robot: CalibratedRobot,
    /// Which virtual robot of the scenario it is, where it is one.
    pub simulated: Option<SimulatedRun>,
    /// What speaks against trusting it.
    pub conditions: Vec<Condition>,
}

/// What `identify --identified-out` wrote, with the scenario that it belongs to.
pub fn read_stored(
    common: &Common,
    command: &str,
    path: &Path,
) -> anyhow::Result<(Scenario, IdentifiedFile)> {
    let file = IdentifiedFile::read(path)?;
    let scenario = common.load_for([command, "--identified"], path, file.origin().as_ref())?;
    Ok((scenario, file))
}

/// Reads what `identify --identified-out` wrote of whatever readings, for a command that takes it.
pub fn read_robot(common: &Common, command: &str, path: &Path) -> anyhow::Result<ScenarioRobot> {
    let (scenario, file) = read_stored(common, command, path)?;
    let belief = &scenario.task.belief;
    let IdentifiedRecord::Readings(stored) = &file.record else {
        let identified = compliances(&file, &scenario)?;
        let origin = (file.origin()).filter(|origin| origin.scenario_sha256 == scenario.sha256);
        return Ok(ScenarioRobot {
            simulated: origin.and_then(|origin| origin.simulated),
            robot: CalibratedRobot::of_deflections(belief, identified.posterior),
            scenario,
            conditions: identified.conditions,
        });
    };
    let mut conditions: Vec<Condition> = trust(&file, &scenario)?.into_iter().collect();
    conditions.extend(doubts(path, &stored.message.conditions));
    let (stored, held) = stored.with_possible_compliances(&belief.arm());
    conditions.extend(held);
    Ok(ScenarioRobot {
        robot: CalibratedRobot::of_absolute(belief, &stored)?,
        scenario,
        simulated: None,
        conditions,
    })
}

/// Refuses a file in which half of the readings or more were fitted already, by their digests, unless so coarse ones repeat by chance; tells
/// of fewer.
pub fn refuse_fitted(
    path: &Path,
    [digests, fitted]: [&[u64]; 2],
    may_repeat: impl FnOnce() -> bool,
    as_what: &str,
    hint: &str,
) -> Result<String, FileError> {
    let (same, all) = (count_among(digests, fitted), digests.len());
    if same == 0 {
        return Ok(String::new());
    }
    let problem = match all - same {
        0 => format!("holds the same readings as {as_what}"),
        _ => format!("{same} of {all} readings are the same as {as_what}"),
    };
    if 2 * same < all || may_repeat() {
        let name = path.display();
        return Ok(format!(
            "{name}: {problem}; coarse ones may be the same by chance.\n"
        ));
    }
    let wrong = FileError::new(path, problem).code(ErrorCode::Measurements);
    Err(wrong.hint(hint))
}

/// The same of measurements that a scenario's prior was identified from.
pub fn refuse_prior(
    scenario: &Scenario,
    path: &Path,
    measured: &MeasuredFile,
) -> Result<String, FileError> {
    let belief = &scenario.task.belief;
    let Some(before) = &belief.prior_campaign else {
        return Ok(String::new());
    };
    let as_what = "robot.prior was identified from";
    let hint = "give other measurements, or leave out robot.prior: readings count once";
    let refuse = |digests: Vec<u64>, may_repeat: &dyn Fn() -> bool| {
        let digests = [&*digests, &before.reading_digests];
        refuse_fitted(path, digests, may_repeat, as_what, hint)
    };
    match measured {
        MeasuredFile::Deflections(measurements) => refuse(digests_of(measurements), &|| {
            measurements_may_repeat(&Case::as_believed(belief, measurements))
        }),
        MeasuredFile::Absolute(readings) => refuse(digests_of(readings), &|| {
            AbsoluteCase::placed(belief, readings).is_ok_and(|case| case.may_repeat())
        }),
    }
}

/// What was not asked for when absolute readings were fitted, for a person.
pub fn taken_as_believed(robot: &CalibratedRobot) -> String {
    naming(
        &robot.taken_as_believed,
        "Assumed exact, as the scenario has them: the compliances of {}, which were not identified.\n",
    )
}

/// The conditions with which it was identified.
fn doubts(path: &Path, conditions: &[Condition]) -> impl Iterator<Item = Condition> {
    let file = format!("the identification in {}", path.display());
    (conditions.iter()).map(move |condition| condition.within(&file))
}

/// What a file of deflections says of the compliances of a scenario's robot.
pub fn compliances(
    file: &IdentifiedFile,
    scenario: &Scenario,
) -> Result<IdentifiedCompliances, FileError> {
    let (belief, path) = (&scenario.task.belief, &file.path);
    let stored = file.known(&belief.nominal)?;
    let (mut posterior, expected) = (stored.posterior, belief.parameter_names());
    if posterior.names != expected {
        let problem = format!(
            "found {}; the scenario's parameters are {}",
            posterior.names.join(", "),
            expected.join(", ")
        );
        let wrong = FileError::new(path, problem).at("parameters");
        return Err(wrong.code(ErrorCode::OtherRobot));
    }
    let mut conditions: Vec<Condition> = trust(file, scenario)?.into_iter().collect();
    conditions.extend(doubts(path, &stored.conditions));
    for (place, name) in expected.iter().enumerate() {
        let joint = &belief.nominal.chain.joints[belief.parameters[place]];
        let compliance = (posterior.mean[place], joint.drive.compliance_unit());
        let impossible = impossible_compliance(name, compliance);
        let is_said = |other: &Condition| {
            let is_it = |own: &Condition| own.code == other.code && other.text.contains(&own.text);
            impossible.as_ref().is_some_and(is_it)
        };
        if !conditions.iter().any(is_said) {
            conditions.extend(impossible);
        }
    }
    if !belief.uncertain.is_plain() {
        let others = belief.uncertain.other_names();
        if stored.all.names[expected.len()..] != *others {
            let problem = "does not say what is known of the uncertainties that the scenario lists";
            let renew = "identify again under this scenario, or leave them out with --noise-only";
            let wrong = FileError::new(path, problem).at("uncertain").hint(renew);
            return Err(wrong.code(ErrorCode::OtherRobot));
        }
        if !others.is_empty() {
            let hidden = stored.all.estimable.hidden().clone();
            posterior = Posterior {
                estimable: Estimable::with_hidden(&belief.sizes(), hidden),
                ..stored.all
            };
        }
    }
    Ok(IdentifiedCompliances {
        discrepancy: stored.discrepancy,
        posterior,
        conditions,
    })
}

/// Whether it was identified with the robot of the scenario: another one's is refused.
pub fn trust(file: &IdentifiedFile, scenario: &Scenario) -> Result<Option<Condition>, FileError> {
    let (path, expected) = (&file.path, scenario.task.belief.fingerprint());
    let Some(found) = &file.basis.identified_with else {
        return Ok(Some(ConditionCode::NoFingerprint.with(format!(
            "{} does not say with which robot and scenario it was identified",
            path.display()
        ))));
    };
    file.check_robot(&expected.robot_sha256).map_err(|wrong| {
        wrong.hint(format!(
            "give the scenario that it was identified under, or renew it with `elastocal identify {} --measurements FILE --identified-out {}`",
            shell_path(&scenario.path),
            shell_path(path)
        ))
    })?;
    if found.belief_sha256 != expected.belief_sha256 {
        return Ok(Some(ConditionCode::OtherScenario.with(format!(
            "{} was identified under another scenario: masses, gravity, nominal compliances, error sources \
             (--noise-only), the calibration tool or the instrument differ",
            path.display()
        ))));
    }
    Ok(None)
}
