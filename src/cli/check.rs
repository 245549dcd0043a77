//! `check`: is the scenario valid, how was it understood, and is the plan possible?

use std::ffi::OsStr;

use crate::plan::{Feasibility, violated};
use crate::record::messages::SchemaMessage;
use crate::record::understanding::{understanding_json, unknowns_json};
use crate::study::TakenPlan;
use crate::task::Task;
use crate::understanding::{
    Understanding, UnderstoodJoint, UnderstoodPose, Unknowns, impossible, unknowns,
};
use nalgebra::Vector3;

use super::command_prelude::*;
use super::printed_error::PrintedError;
use super::program;

#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["seed", "threads", "out"])))]
pub struct Check {
    #[command(flatten)]
    pub common: Common,
    /// A plan to check against the scenario.
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Tell which parameters of the robot could be identified from deflections, positions and poses, and
    /// which cannot be separated.
    #[arg(long)]
    parameters: bool,
}

/// What a plan violates; one of absolute readings that cannot be taken is an error.
fn violations(task: &Task, path: &Path) -> Result<Vec<String>, FileError> {
    let found = match TakenPlan::read(task, &[], path)? {
        TakenPlan::Deflections(plan) => Feasibility::new(task).violations(&plan),
        TakenPlan::Readings(_) => Vec::new(),
    };
    Ok(found.iter().map(ToString::to_string).collect())
}

impl Check {
    /// An invalid file is an error; a plan that violates the region is a condition.
    pub fn execute(&self) -> anyhow::Result<Report> {
        let checked = self.common.load().and_then(|scenario| {
            let plan = self.plan.as_deref();
            let violations = plan
                .map(|path| violations(&scenario.task, path))
                .transpose()?;
            super::dialect::dialect_if_suitable(None, &scenario)?;
            Ok((scenario, violations))
        });
        let (scenario, of_plan) = match checked {
            Ok(checked) => checked,
            Err(error) => {
                if self.common.json {
                    let json = self.broken(&error);
                    super::print(&(serde_json::to_string_pretty(&json)? + "\n"))?;
                }
                return Err(error);
            }
        };
        let understanding = Understanding::new(&scenario);
        let impossible = impossible(&scenario, &understanding);
        let said = impossible.as_ref().map(|each| &each.text);
        let is_told = |warning: &&String| said != Some(*warning);
        for warning in understanding.warnings.iter().filter(is_told) {
            self.common.say(&format!("warning: {warning}"));
        }
        let is_about_a_plan = of_plan.is_some();
        let violations = of_plan.unwrap_or_default();
        let name = self.common.scenario().display();
        let verdict = match (violations.is_empty(), &impossible) {
            (true, None) => format!("{name} is valid\n"),
            (true, Some(_)) => format!("{name} cannot be right\n"),
            (false, _) => format!("{}\n", violations.join("\n")),
        };
        let told_apart = (self.parameters).then(|| unknowns(&scenario.task, scenario.seed));
        let before = match &told_apart {
            Some(told_apart) => told_apart.iter().map(describe_unknowns).collect(),
            None if is_about_a_plan => String::new(),
            None => describe(&understanding),
        };
        let violated = (!violations.is_empty()).then(|| violated(violations.len() as u64));
        let found = impossible.iter().map(|each| each.text.clone());
        let problems: Vec<String> = violations.into_iter().chain(found).collect();
        let conditions = violated.into_iter().chain(impossible).collect();
        let mut keys = understanding_json(&understanding);
        keys["ok"] = json!(problems.is_empty());
        keys["problems"] = json!(problems);
        if let Some(told_apart) = &told_apart {
            keys["identifiable"] = told_apart.iter().map(unknowns_json).collect();
        }
        let report = Report::new(keys, before + &verdict, conditions);
        Ok((self.common).report("check", &scenario, report)?)
    }

    /// A broken scenario, or one with a broken plan, has neither seed nor hash here.
    fn broken(&self, error: &anyhow::Error) -> Value {
        let PrintedError { code, .. } = PrintedError::of(error);
        let scenario = (self.common.scenario().file_stem()).map(OsStr::to_string_lossy);
        let mut provenance = program();
        provenance["scenario"] = json!(scenario);
        json!({
            "schema": SchemaMessage::new("check"),
            "provenance": provenance,
            "ok": false,
            "problems": [error.to_string()],
            "code": code,
        })
    }
}

/// The robot as it was understood, for a person.
pub(super) fn describe(understanding: &Understanding) -> String {
    let slides = understanding.joints.iter().any(|joint| joint.drive.slides);
    let header = if slides {
        "joint | range [deg] | stiffness [N m/rad; slides N/m] | compliance [rad/(N m); slides m/N] | moving mass [kg] | "
    } else {
        "joint | range [deg] | stiffness [N m/rad] | compliance [rad/(N m)] | moving mass [kg] | "
    };
    let rows = (understanding.joints.iter()).map(|joint| {
        let stiffness = joint.compliance_rad_per_nm.recip();
        vec![
            joint.name.clone(),
            range(joint),
            if stiffness.is_finite() {
                format!("{stiffness:.3e}")
            } else {
                "rigid".to_owned()
            },
            format!("{:.3e}", joint.compliance_rad_per_nm),
            format!("{:.1}", joint.moving_mass_kg),
            match (joint.drive.passive_at, joint.is_parameter) {
                (Some(_), true) => "passive, identified".to_owned(),
                (Some(_), false) => "passive".to_owned(),
                (None, true) => "identified".to_owned(),
                (None, false) => String::new(),
            },
        ]
    });
    let mut text = table(header, rows);
    let gravity = understanding.gravity_m_s2;
    let is_down = gravity.x == 0.0 && gravity.y == 0.0 && gravity.z <= 0.0;
    let along = match gravity.try_normalize(0.0) {
        Some(down) if !is_down => format!(
            " along ({:.2}, {:.2}, {:.2}), not down z, by which heights and elevations count",
            down.x, down.y, down.z
        ),
        _ => String::new(),
    };
    text += &format!(
        "\nThe arm reaches {:.0} mm from its first joint; gravity is {:.2} m/s^2{along}.\n",
        understanding.reach_m * 1e3,
        gravity.norm()
    );
    for (name, value, unit) in &understanding.locked {
        text += &format!("The joint {name} is locked at {value} {unit}.\n");
    }
    for spring in &understanding.springs {
        let [low, high] = spring.rest_m.map(|length| length * 1e3);
        let rest = if low < high {
            format!("{low:.2} to {high:.2}")
        } else {
            format!("{low:.2}")
        };
        text += &format!(
            "The spring {} has {:.4} N/mm and is relaxed at {rest} mm.\n",
            spring.name,
            spring.stiffness_n_per_m * 1e-3
        );
    }
    for pose in &understanding.poses {
        text += &describe_pose(understanding, pose);
    }
    if let Some(truth) = &understanding.truth {
        text += &format!(
            "The virtual robot is more than the planner's chain ({}); it rests where MuJoCo's acceleration vanishes.\n",
            truth.reason
        );
        for each in &truth.beyond_belief {
            text += &format!("It obeys what a planner's model would refuse: {each}.\n");
        }
        for each in &truth.gives_way {
            text += &format!("Its {} gives way by {}.\n", each.element, each.words());
        }
    }
    text + "\n"
}

/// The range of what a joint is commanded, or where a passive one is relaxed.
fn range(joint: &UnderstoodJoint) -> String {
    let shown = |value: f64| joint.drive.shown(value).0;
    let unit = if joint.drive.slides { " mm" } else { "" };
    if let Some(rest) = joint.drive.passive_at {
        return format!("{:.3}{unit}", shown(rest));
    }
    let [low, high] = joint.range_rad.map(shown);
    format!("{low:.1} to {high:.1}{unit}")
}

fn describe_pose(understanding: &Understanding, pose: &UnderstoodPose) -> String {
    let place = |position_m: Vector3<f64>| {
        let [x, y, z]: [f64; 3] = (position_m * 1e3).into();
        format!("({x:.1}, {y:.1}, {z:.1}) mm")
    };
    let bent = match &pose.bent {
        Ok(bent) => {
            let turned = |(joint, moved): (usize, f64)| {
                let joint = &understanding.joints[joint];
                let (moved, unit) = joint.drive.shown(moved);
                format!("{} by {moved:.4} {unit}", joint.name)
            };
            format!(
                "The robot's own weight bends it by {:.3} mm there ({}), the task load by {:.3} mm ({}).",
                bent.own_weight_m.norm() * 1e3,
                turned(bent.own_weight_joint),
                bent.task_load_m.norm() * 1e3,
                turned(bent.task_load_joint),
            )
        }
        Err(error) => format!("There it does not hold: {error}."),
    };
    let along = pose.direction.map_or_else(String::new, |direction| {
        let [x, y, z]: [f64; 3] = direction.into();
        format!(" Only the error along ({x:.4}, {y:.4}, {z:.4}) counts.")
    });
    format!(
        "At the test pose {:?} the calibration tool is at {}, the machining tool at {}. {bent}{along}\n",
        pose.name,
        place(pose.calibration_tool_m),
        place(pose.machining_tool_m),
    )
}

/// A minimal set of parameters, and what is redundant beside it.
fn describe_unknowns(unknowns: &Unknowns) -> String {
    let minimal = unknowns.minimal();
    let mut text = format!(
        "From a {} of the calibration tool, {} of {} parameters can be identified together:\n",
        unknowns.reading.name(),
        minimal.len(),
        unknowns.names.len()
    );
    for line in minimal.chunks(8) {
        text += &format!("  {}\n", line.join(", "));
    }
    text += "These can be left out:\n";
    for each in &unknowns.freedoms {
        let parameter = &unknowns.names[each.redundant];
        text += &format!("  {parameter}: {}\n", each.sentence);
    }
    text + "\n"
}
