//! The tables `[[true_robot.torque_law]]`: nonlinear joint stiffness of the virtual robot.

use super::Checker;
use super::number::names_of;
use crate::files::FileError;
use crate::mujoco::TorqueLaw;
use crate::quantities::plausible::{DEVIATION, ROTATION_DEVIATION};
use crate::robot::{SerialChain, TrueRobot};
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

    /// Within dead bands the balance of all of MuJoCo's forces says where joints stand: of actuators among them.
    pub(super) fn dead_bands_are_held(
        &self,
        robot: &TrueRobot,
        chain: &SerialChain,
    ) -> Result<(), FileError> {
        if robot
            .torque_laws
            .iter()
            .all(|(_, law)| law.dead_band == 0.0)
        {
            return Ok(());
        }
        for index in chain.commanded() {
            let held =
                robot.joints[index].map_or(Ok(()), |joint| robot.model.check_commanded(joint));
            if let Err(error) = held {
                let wrong = self.wrong("true_robot.torque_law", error.to_string());
                let hint = "a dead band needs a model with position actuators; stiffens_at and softens_at do not";
                return Err(wrong.hint(hint));
            }
        }
        Ok(())
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
        let mut given = [None; 3];
        for (place, of, unit, value) in [
            (0, "dead_band", "mrad", table.dead_band_mrad),
            (0, "dead_band", "mm", table.dead_band_mm),
            (1, "stiffens_at", "mrad", table.stiffens_at_mrad),
            (1, "stiffens_at", "mm", table.stiffens_at_mm),
            (2, "softens_at", "mrad", table.softens_at_mrad),
            (2, "softens_at", "mm", table.softens_at_mm),
        ] {
            if let Some(value) = value {
                let key = format!("{key}.{of}_{unit}");
                self.check_unit(&key, (name, slides), [unit, "mrad"])?;
                given[place] = Some(self.number(&key, value, kind)? * 1e-3);
            }
        }
        let [dead_band, stiffens_at, softens_at] = given;
        if stiffens_at.is_some() && softens_at.is_some() {
            let problem = "a joint either stiffens or softens";
            return Err(self.wrong(&format!("{key}.softens_at_{own}"), problem));
        }
        if given.iter().all(Option::is_none) {
            let problem = format!(
                "says nothing: give dead_band_{own}, stiffens_at_{own} or softens_at_{own}"
            );
            return Err(self.wrong(key, problem));
        }
        Ok(TorqueLaw {
            dead_band: dead_band.unwrap_or(0.0),
            stiffens_at,
            softens_at,
        })
    }
}
