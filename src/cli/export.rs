//! `export`: the calibrated robot as a model's file.

use crate::codes::ErrorCode;
use crate::record::joint_error_table::joint_error_table;
use crate::workflow::calibrated::{CalibratedRobot, RobotWithJointErrors};
use crate::workflow::export::{ExportedModel, export};

use super::command_prelude::*;
use super::identified::{ScenarioRobot, read_robot};

#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["seed", "threads", "out"])))]
pub struct Export {
    #[command(flatten)]
    pub common: Common,
    /// What `identify --identified-out` wrote.
    #[arg(long, value_name = "FILE")]
    identified: PathBuf,
    /// Where to write the model (MJCF).
    #[arg(long, value_name = "FILE")]
    model_out: PathBuf,
    /// Where to write what joints are off by over their own angles (CSV: a row a degree, or 10 mm); the model then has the parameters that
    /// go with that.
    #[arg(long, value_name = "FILE")]
    joint_errors_out: Option<PathBuf>,
}

impl Export {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let ScenarioRobot {
            scenario,
            robot,
            conditions,
            ..
        } = read_robot(&self.common, "export", &self.identified)?;
        self.common.check_files(&scenario, None)?;
        self.common.say("writing the robot as MJCF");
        let provenance = self.common.provenance(&scenario)?;
        let with_joint_errors = (self.joint_errors_out.as_ref())
            .map(|path| self.with_joint_errors(&robot).map(|found| (path, found)))
            .transpose()?;
        let robot = with_joint_errors.map_or(&robot, |(_, found)| &found.robot);
        let exported = export(&scenario, robot, &provenance, &self.model_out)?;
        let keys = json!({
            "model_file": self.model_out,
            "parameters": robot.unknowns.iter().map(|each| &each.name).collect::<Vec<_>>(),
            "configurations": exported.configurations,
            "place_difference_mm": exported.place_difference_m * 1e3,
            "rotation_difference_mrad": exported.rotation_difference_rad * 1e3,
            "deflection_difference_mm": exported.deflection_difference_m * 1e3,
            "not_expressed": exported.not_expressed,
            "to_leave_out": exported.to_leave_out,
        });
        let mut report = Report::new(keys, describe(&exported), conditions);
        report.write(&self.model_out, &exported.text)?;
        if let Some((path, found)) = with_joint_errors {
            let table = joint_error_table(&found.model, &robot.arm.chain.joints);
            let mut origin = format!(
                "# Joint error functions of {}, beside the parameters of {}: stands further than commanded by error.\n",
                self.identified.display(),
                self.model_out.display()
            );
            let joints = found.model.joints.iter();
            let joints = joints.filter(|each| each.turn_about.is_some());
            let names = joints.map(|each| &robot.arm.chain.joints[each.joint].name);
            origin += &naming(names, "# Angles count modulo a turn: {}\n");
            report.write(path, &(origin + &table))?;
        }
        Ok((self.common).report("export", &scenario, report)?)
    }
}

impl Export {
    fn with_joint_errors<'a>(
        &self,
        robot: &'a CalibratedRobot,
    ) -> Result<&'a RobotWithJointErrors, FileError> {
        robot.with_joint_errors.as_deref().ok_or_else(|| {
            let problem = "has no joint error functions, which --joint-errors-out would write";
            FileError::new(&self.identified, problem)
                .hint("identify from absolute readings of 20 visits or more, not with --joint-errors off")
                .code(ErrorCode::IdentifiedFile)
        })
    }
}

fn describe(exported: &ExportedModel) -> String {
    let mut text = format!(
        "In {} configurations the robot that MuJoCo reads from the file is within {:.1e} mm of the identified one, and bent by \
         gravity and load within {:.1e} mm.\n",
        exported.configurations,
        exported.place_difference_m * 1e3,
        exported.deflection_difference_m * 1e3
    );
    for each in &exported.not_expressed {
        text += &format!("not in the file: {each}\n");
    }
    text + &naming(
        &exported.to_leave_out,
        "a scenario that takes it for robot.model leaves out: {}\n",
    )
}
