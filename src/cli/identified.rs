//! An identified file for a command, with its conditions.

use crate::identification::{StoredIdentification, impossible_compliance};
use crate::measurement::{Origin, SimulatedRun};
use crate::numeric::{estimable::Estimable, posterior::Posterior};
use crate::task::Fingerprint;
use crate::text::wording::shell_path;
use crate::workflow::{calibrated::CalibratedRobot, stored_robot::StoredRobot};

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

/// The scenario that an identification belongs to; the robot, where it is of absolute readings; and under which scenario it was made.
pub fn read_stored(
    common: &Common,
    command: &str,
    path: &Path,
) -> anyhow::Result<(Scenario, Option<StoredRobot>, Option<Origin>)> {
    let robot = StoredRobot::read(path)?;
    let origin = match &robot {
        Some(robot) => robot.origin.clone(),
        None => StoredIdentification::origin(path)?,
    };
    let scenario = common.load_for([command, "--identified"], path, origin.as_ref())?;
    Ok((scenario, robot, origin))
}

/// Reads what `identify --identified-out` wrote of whatever readings, for a command that takes it.
pub fn read_robot(common: &Common, command: &str, path: &Path) -> anyhow::Result<ScenarioRobot> {
    let (scenario, robot, origin) = read_stored(common, command, path)?;
    if let Some(stored) = robot {
        let trust = trust(path, &scenario, Some(&stored.identified_with))?;
        let mut conditions: Vec<Condition> = trust.into_iter().collect();
        conditions.extend(doubts(path, &stored.message.conditions));
        let (stored, held) = stored.with_possible_compliances(&scenario.task.belief.arm());
        conditions.extend(held);
        let robot = CalibratedRobot::of_absolute(&scenario.task.belief, path, &stored)?;
        return Ok(ScenarioRobot {
            scenario,
            robot,
            simulated: None,
            conditions,
        });
    }
    let identified = read_identified(path, &scenario)?;
    let simulated = origin
        .filter(|origin| origin.scenario_sha256 == scenario.sha256)
        .and_then(|origin| origin.simulated);
    Ok(ScenarioRobot {
        simulated,
        robot: CalibratedRobot::of_deflections(&scenario.task.belief, identified.posterior),
        scenario,
        conditions: identified.conditions,
    })
}

/// Refuses a file of the same readings as were fitted, where others are needed.
pub fn refuse_same(path: &Path, is_same: bool, as_what: &str, hint: &str) -> Result<(), FileError> {
    if !is_same {
        return Ok(());
    }
    let problem = format!("holds the same readings as {as_what}");
    let wrong = FileError::new(path, problem).code(ErrorCode::Measurements);
    Err(wrong.hint(hint))
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

/// Reads what `identify --identified-out` wrote of deflections, for the same robot.
pub fn read_identified(
    path: &Path,
    scenario: &Scenario,
) -> Result<IdentifiedCompliances, FileError> {
    let belief = &scenario.task.belief;
    let stored = StoredIdentification::read(path, &belief.nominal)?;
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
    let trust = trust(path, scenario, stored.identified_with.as_ref())?;
    let mut conditions: Vec<Condition> = trust.into_iter().collect();
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
        let found = stored
            .all
            .as_ref()
            .map_or(&[][..], |all| &all.names[expected.len()..]);
        if found != belief.uncertain.other_names() {
            let problem = "does not say what is known of the uncertainties that the scenario lists";
            let renew = "identify again under this scenario, or leave them out with --noise-only";
            let wrong = FileError::new(path, problem).at("uncertain").hint(renew);
            return Err(wrong.code(ErrorCode::OtherRobot));
        }
        if let Some(all) = stored.all {
            let hidden = all.estimable.hidden().clone();
            posterior = Posterior {
                estimable: Estimable::with_hidden(&belief.sizes(), hidden),
                ..all
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
pub fn trust(
    path: &Path,
    scenario: &Scenario,
    found: Option<&Fingerprint>,
) -> Result<Option<Condition>, FileError> {
    let renew = format!(
        "renew it with `elastocal identify {} --measurements FILE --identified-out {}`",
        shell_path(&scenario.path),
        shell_path(path)
    );
    let Some(found) = found else {
        return Ok(Some(ConditionCode::NoFingerprint.with(format!(
            "{} does not say with which robot and scenario it was identified",
            path.display()
        ))));
    };
    let expected = scenario.task.belief.fingerprint();
    if found.robot_sha256 != expected.robot_sha256 {
        let problem = "was identified with another robot: its joints' names, axes or places are not those \
                       of the scenario's model";
        return Err(FileError::new(path, problem)
            .at("identified_with.robot_sha256")
            .code(ErrorCode::OtherRobot)
            .hint(format!(
                "give the scenario that it was identified under, or {renew}"
            )));
    }
    if found.belief_sha256 != expected.belief_sha256 {
        return Ok(Some(ConditionCode::OtherScenario.with(format!(
            "{} was identified under another scenario: masses, gravity, nominal compliances, error sources \
             (--noise-only), the calibration tool or the instrument differ",
            path.display()
        ))));
    }
    Ok(None)
}
