//! The tables `[[robot.tool]]` and `[[robot.payload]]`, and the locked joints.

use super::Checker;
use super::number::in_si;
use crate::files::FileError;
use crate::mujoco::{MountedPayload, MountedTool};
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::{ANGLE, MASS, POSITION};
use crate::scenario::file::RobotTable;

/// A joint that is locked.
#[derive(Debug, Clone)]
pub(super) struct Locked {
    pub joint: String,
    /// The key that says so.
    pub key: String,
    /// The unit of the key.
    pub unit: &'static str,
    /// Where (rad, m).
    pub at: f64,
}

impl Checker<'_> {
    pub(super) fn tools(&self, table: &RobotTable) -> Result<Vec<MountedTool>, FileError> {
        self.each("robot.tool", MOST_NAMED, &table.tool, |key, tool| {
            Ok(MountedTool {
                name: tool.name.clone(),
                on: tool.on.clone(),
                from_tool: self.frame(key, &tool.position_mm, tool.rpy_deg.as_deref())?,
            })
        })
    }

    pub(super) fn payloads(&self, table: &RobotTable) -> Result<Vec<MountedPayload>, FileError> {
        self.each(
            "robot.payload",
            MOST_NAMED,
            &table.payload,
            |key, payload| {
                let mass_key = format!("{key}.mass_kg");
                let mass_kg = self.number(&mass_key, payload.mass_kg, &MASS)?;
                if mass_kg == 0.0 {
                    return Err(self.wrong(&mass_key, "found 0; a payload has a mass"));
                }
                Ok(MountedPayload {
                    on: payload.on.clone(),
                    centre_m: self.position(&format!("{key}.centre_mm"), &payload.centre_mm)?,
                    mass_kg,
                })
            },
        )
    }

    pub(super) fn locked(&self, table: &RobotTable) -> Result<Vec<Locked>, FileError> {
        let mut locked = Vec::new();
        for (unit, joints, kind) in [
            ("deg", &table.locked_deg, &ANGLE),
            ("mm", &table.locked_mm, &POSITION),
        ] {
            for (joint, &value) in joints {
                let key = format!("robot.locked_{unit}.{joint}");
                let value = self.number(&key, value, kind)?;
                locked.push(Locked {
                    joint: joint.clone(),
                    at: in_si(unit, value),
                    key,
                    unit,
                });
            }
        }
        Ok(locked)
    }
}
