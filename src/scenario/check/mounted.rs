//! The tables `[[robot.tool]]` and `[[robot.payload]]`, and the locked joints.

use nalgebra::Vector3;

use super::Checker;
use crate::files::FileError;
use crate::mujoco::{MountedPayload, MountedTool, frame};
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::{ANGLE, MASS, POSITION};
use crate::scenario::file::RobotTable;

impl Checker<'_> {
    pub(super) fn tools(&self, table: &RobotTable) -> Result<Vec<MountedTool>, FileError> {
        self.at_most("robot.tool", table.tool.len(), MOST_NAMED)?;
        let tool = |(index, tool): (usize, &crate::scenario::file::ToolTable)| {
            let key = format!("robot.tool[{index}]");
            let position_mm: [f64; 3] =
                self.numbers(&format!("{key}.position_mm"), &tool.position_mm, &POSITION)?;
            let rpy_deg = tool.rpy_deg.as_deref().unwrap_or(&[0.0; 3]);
            let rpy_deg: [f64; 3] = self.numbers(&format!("{key}.rpy_deg"), rpy_deg, &ANGLE)?;
            let position_m = Vector3::from(position_mm) * 1e-3;
            Ok(MountedTool {
                name: tool.name.clone(),
                on: tool.on.clone(),
                from_tool: frame(position_m, rpy_deg.map(f64::to_radians)),
            })
        };
        table.tool.iter().enumerate().map(tool).collect()
    }

    pub(super) fn payloads(&self, table: &RobotTable) -> Result<Vec<MountedPayload>, FileError> {
        self.at_most("robot.payload", table.payload.len(), MOST_NAMED)?;
        let payload = |(index, payload): (usize, &crate::scenario::file::PayloadTable)| {
            let key = format!("robot.payload[{index}]");
            let centre_mm: [f64; 3] =
                self.numbers(&format!("{key}.centre_mm"), &payload.centre_mm, &POSITION)?;
            let mass_key = format!("{key}.mass_kg");
            let mass_kg = self.number(&mass_key, payload.mass_kg, &MASS)?;
            if mass_kg == 0.0 {
                return Err(self.wrong(&mass_key, "found 0; a payload has a mass"));
            }
            Ok(MountedPayload {
                on: payload.on.clone(),
                centre_m: Vector3::from(centre_mm) * 1e-3,
                mass_kg,
            })
        };
        table.payload.iter().enumerate().map(payload).collect()
    }

    /// The locked joints, each with its coordinate (rad, m) and its key.
    pub(super) fn locked(
        &self,
        table: &RobotTable,
    ) -> Result<Vec<(String, f64, String)>, FileError> {
        let mut locked = Vec::new();
        for (name, &value) in &table.locked_deg {
            let key = format!("robot.locked_deg.{name}");
            let angle = self.number(&key, value, &ANGLE)?.to_radians();
            locked.push((name.clone(), angle, key));
        }
        for (name, &value) in &table.locked_mm {
            let key = format!("robot.locked_mm.{name}");
            let length = self.number(&key, value, &POSITION)? * 1e-3;
            locked.push((name.clone(), length, key));
        }
        Ok(locked)
    }
}
