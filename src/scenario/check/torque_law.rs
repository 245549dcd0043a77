//! The tables `[[true_robot.torque_law]]`: nonlinear joint stiffness of the virtual robot.

use super::Checker;
use super::number::names_of;
use crate::files::FileError;
use crate::mujoco::TorqueLaw;
use crate::robot::SerialChain;
use crate::scenario::file::TorqueLawTable;

impl Checker<'_> {
    /// The joints with laws of their own, in a belief's chain whose joints have these compliances in truth.
    pub(super) fn torque_laws(
        &self,
        tables: &[TorqueLawTable],
        chain: &SerialChain,
        compliance_rad_per_nm: &[f64],
    ) -> Result<Vec<(usize, TorqueLaw)>, FileError> {
        let mut laws: Vec<(usize, TorqueLaw)> = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            let key = format!("true_robot.torque_law[{index}]");
            let joints = format!("{key}.joints");
            if table.joints.is_empty() {
                let problem = format!("is empty; the robot's joints are: {}", names_of(chain));
                return Err(self.wrong(&joints, problem));
            }
            for name in &table.joints {
                let joint = self.joint(&joints, chain, name)?;
                if laws.iter().any(|(other, _)| *other == joint) {
                    let wrong = self.wrong(&joints, format!("found {name:?} twice"));
                    return Err(wrong.hint("a joint has one law: put all of it into one table"));
                }
                let drive = &chain.joints[joint].drive;
                if drive.passive_at.is_some() {
                    let problem = format!("{name} is passive: its spring is the model's");
                    return Err(self.wrong(&joints, problem));
                }
                if compliance_rad_per_nm[joint] <= 0.0 {
                    let problem = format!("{name} is rigid: it does not give");
                    return Err(self.wrong(&joints, problem));
                }
                let own = if drive.slides { "mm" } else { "mrad" };
                let given = [
                    ("stiffens_at", "mrad", table.stiffens_at_mrad),
                    ("stiffens_at", "mm", table.stiffens_at_mm),
                    ("softens_at", "mrad", table.softens_at_mrad),
                    ("softens_at", "mm", table.softens_at_mm),
                ];
                let mut law = None;
                for (of, unit, value) in given {
                    let Some(value) = value else { continue };
                    let key = format!("{key}.{of}_{unit}");
                    self.check_unit(&key, name, drive.slides, unit, "mrad")?;
                    if law.is_some() {
                        return Err(self.wrong(&key, "a joint either stiffens or softens"));
                    }
                    let share = if of == "stiffens_at" { 1.0 } else { -1.0 };
                    let at = Some(value * 1e-3);
                    law = Some((joint, TorqueLaw { share, at }));
                }
                laws.push(law.ok_or_else(|| {
                    let problem =
                        format!("says nothing: give stiffens_at_{own} or softens_at_{own}");
                    self.wrong(&key, problem)
                })?);
            }
        }
        laws.sort_by_key(|(joint, _)| *joint);
        Ok(laws)
    }
}
