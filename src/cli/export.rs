//! `export`: the calibrated robot as a model's file.

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
        let exported = export(&scenario, &robot, &provenance, &self.model_out)?;
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
        let mut report = Report::new(Value::Null, describe(&exported), conditions);
        report.write(&self.model_out, &exported.text)?;
        Ok((self.common).report("export", &scenario, [keys], report)?)
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
