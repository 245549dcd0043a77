//! What a scenario adds to its models: tools and payloads of the robot, locked joints, and the tables `[[obstacle]]`, of what stands in
//! the laboratory.

use std::collections::BTreeMap;

use super::Checker;
use super::number::{frame_of, in_si, position_m, vector};
use crate::files::FileError;
use crate::mujoco::{Additions, MountedPayload, MountedTool, Obstacle, Shape};
use crate::quantities::limits::{MOST_NAMED, MOST_OBSTACLES};
use crate::scenario::file::{File, ObstacleTable, PayloadTable, RobotTable, ShapeTable, ToolTable};

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
    /// What it adds to its models.
    pub(super) fn additions(&self, file: &File) -> Result<Additions, FileError> {
        Ok(Additions {
            obstacles: self.obstacles(file)?,
            tools: self.tools(&file.robot.tool)?,
            payloads: self.payloads(&file.robot.payload)?,
        })
    }

    fn obstacles(&self, file: &File) -> Result<Vec<Obstacle>, FileError> {
        let names = file.obstacle.iter().map(|each| &each.name);
        self.named("obstacle", MOST_OBSTACLES, names)?;
        let region = &file.region;
        let are_checked = region.collision_clearance_mm.is_some() || region.line_of_sight;
        if !file.obstacle.is_empty() && !are_checked {
            let problem = "obstacles are not checked: neither region.collision_clearance_mm nor \
                           region.line_of_sight is given";
            return Err(self.wrong("obstacle", problem));
        }
        let obstacle = |table: &ObstacleTable| Obstacle {
            name: table.name.clone(),
            shape: shape(&table.shape),
            world_from_obstacle: frame_of(&table.position_mm, table.rpy_deg.as_deref()),
        };
        Ok(file.obstacle.iter().map(obstacle).collect())
    }

    fn tools(&self, tables: &[ToolTable]) -> Result<Vec<MountedTool>, FileError> {
        self.at_most("robot.tool", tables.len(), MOST_NAMED)?;
        let tool = |tool: &ToolTable| MountedTool {
            name: tool.name.clone(),
            on: tool.on.clone(),
            from_tool: frame_of(&tool.position_mm, tool.rpy_deg.as_deref()),
        };
        Ok(tables.iter().map(tool).collect())
    }

    fn payloads(&self, tables: &[PayloadTable]) -> Result<Vec<MountedPayload>, FileError> {
        self.each("robot.payload", MOST_NAMED, tables, |key, payload| {
            if payload.mass_kg == 0.0 {
                let key = format!("{key}.mass_kg");
                return Err(self.wrong(&key, "found 0; a payload has a mass"));
            }
            Ok(MountedPayload {
                on: payload.on.clone(),
                centre_m: position_m(&payload.centre_mm),
                mass_kg: payload.mass_kg,
            })
        })
    }
}

/// MuJoCo's sizes are half sizes; the file's are whole ones.
fn shape(table: &ShapeTable) -> Shape {
    let (whole, half) = (|mm: f64| mm * 1e-3, |mm: f64| mm * 1e-3 / 2.0);
    match table {
        ShapeTable::Box { size_mm } => Shape::Box(vector(size_mm) * 1e-3 / 2.0),
        ShapeTable::Sphere { radius_mm } => Shape::Sphere(whole(*radius_mm)),
        ShapeTable::Cylinder {
            radius_mm,
            length_mm,
        } => Shape::Cylinder(whole(*radius_mm), half(*length_mm)),
        ShapeTable::Capsule {
            radius_mm,
            length_mm,
        } => Shape::Capsule(whole(*radius_mm), half(*length_mm)),
    }
}

/// The joints that a table locks.
pub(super) fn locked(table: &RobotTable) -> Vec<Locked> {
    let of_unit = |unit: &'static str, joints: &BTreeMap<String, f64>| {
        let locked = joints.iter().map(|(joint, &value)| Locked {
            joint: joint.clone(),
            key: format!("robot.locked_{unit}.{joint}"),
            unit,
            at: in_si(unit, value),
        });
        locked.collect::<Vec<_>>()
    };
    [
        of_unit("deg", &table.locked_deg),
        of_unit("mm", &table.locked_mm),
    ]
    .concat()
}
