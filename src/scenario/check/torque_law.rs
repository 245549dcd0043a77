//! The tables `[[true_robot.torque_law]]`: nonlinear joint stiffness of the virtual robot.

use super::Checker;
use super::number::names_of;
use crate::files::FileError;
use crate::mujoco::TorqueLaw;
use crate::quantities::plausible::{DEVIATION, ROTATION_DEVIATION};
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
                let problem = if drive.passive_at.is_some() {
                    Some("is passive: its spring is the model's")
                } else if compliance_rad_per_nm[joint] <= 0.0 {
                    Some("is rigid: it does not give")
                } else {
                    None
                };
                if let Some(problem) = problem {
                    return Err(self.wrong(&joints, format!("{name} {problem}")));
                }
                laws.push((joint, self.torque_law(&key, table, (name, drive.slides))?));
            }
        }
        laws.sort_by_key(|(joint, _)| *joint);
        Ok(laws)
    }

    /// The law of one joint, with the unit of its coordinate.
    fn torque_law(
        &self,
        key: &str,
        table: &TorqueLawTable,
        (name, slides): (&str, bool),
    ) -> Result<TorqueLaw, FileError> {
        let (kind, own) = if slides {
            (&DEVIATION, "mm")
        } else {
            (&ROTATION_DEVIATION, "mrad")
        };
        let mut law = None;
        for (of, sign, unit, value) in [
            ("stiffens_at", 1.0, "mrad", table.stiffens_at_mrad),
            ("stiffens_at", 1.0, "mm", table.stiffens_at_mm),
            ("softens_at", -1.0, "mrad", table.softens_at_mrad),
            ("softens_at", -1.0, "mm", table.softens_at_mm),
        ] {
            let Some(value) = value else { continue };
            let key = format!("{key}.{of}_{unit}");
            self.check_unit(&key, (name, slides), [unit, "mrad"])?;
            if law.is_some() {
                return Err(self.wrong(&key, "a joint either stiffens or softens"));
            }
            let at = self.number(&key, value, kind)? * 1e-3;
            law = Some(TorqueLaw::of_share(sign, at));
        }
        law.ok_or_else(|| {
            let problem = format!("says nothing: give stiffens_at_{own} or softens_at_{own}");
            self.wrong(key, problem)
        })
    }
}
