//! What a scenario adds to its models: tools and payloads of the robot, locked joints, and the tables `[[obstacle]]`, of what stands in
//! the laboratory.

use nalgebra::Vector3;

use super::Checker;
use super::number::in_si;
use crate::files::FileError;
use crate::mujoco::{Additions, MountedPayload, MountedTool, Obstacle, Shape};
use crate::quantities::limits::{MOST_NAMED, MOST_OBSTACLES};
use crate::quantities::plausible::{ANGLE, MASS, POSITION, SIZE};
use crate::scenario::file::{File, RobotTable, ShapeTable};

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
            tools: self.tools(&file.robot)?,
            payloads: self.payloads(&file.robot)?,
        })
    }

    fn obstacles(&self, file: &File) -> Result<Vec<Obstacle>, FileError> {
        let names = file.obstacle.iter().map(|each| &each.name);
        self.named("obstacle", MOST_OBSTACLES, names)?;
        let region = &file.region;
        let are_checked = region.collision_clearance_mm.is_some() || region.line_of_sight;
        let obstacles = self.each("obstacle", MOST_OBSTACLES, &file.obstacle, |key, table| {
            let rpy_deg = table.rpy_deg.as_deref();
            Ok(Obstacle {
                name: table.name.clone(),
                shape: self.shape(key, &table.shape)?,
                world_from_obstacle: self.frame(key, &table.position_mm, rpy_deg)?,
            })
        })?;
        if !obstacles.is_empty() && !are_checked {
            let problem = "obstacles are not checked: neither region.collision_clearance_mm nor \
                           region.line_of_sight is given";
            return Err(self.wrong("obstacle", problem));
        }
        Ok(obstacles)
    }

    /// MuJoCo's sizes are half sizes; the file's are whole ones.
    fn shape(&self, key: &str, table: &ShapeTable) -> Result<Shape, FileError> {
        let length =
            |name: &str, mm: f64| Ok(self.number(&format!("{key}.{name}"), mm, &SIZE)? * 1e-3);
        let radius = |mm: f64| length("radius_mm", mm);
        let half_length = |mm: f64| length("length_mm", mm).map(|whole| whole / 2.0);
        Ok(match table {
            ShapeTable::Box { size_mm } => {
                let size = self.numbers(&format!("{key}.size_mm"), size_mm, &SIZE)?;
                Shape::Box(Vector3::from(size) * 1e-3 / 2.0)
            }
            ShapeTable::Sphere { radius_mm } => Shape::Sphere(radius(*radius_mm)?),
            ShapeTable::Cylinder {
                radius_mm,
                length_mm,
            } => Shape::Cylinder(radius(*radius_mm)?, half_length(*length_mm)?),
            ShapeTable::Capsule {
                radius_mm,
                length_mm,
            } => Shape::Capsule(radius(*radius_mm)?, half_length(*length_mm)?),
        })
    }

    fn tools(&self, table: &RobotTable) -> Result<Vec<MountedTool>, FileError> {
        self.each("robot.tool", MOST_NAMED, &table.tool, |key, tool| {
            Ok(MountedTool {
                name: tool.name.clone(),
                on: tool.on.clone(),
                from_tool: self.frame(key, &tool.position_mm, tool.rpy_deg.as_deref())?,
            })
        })
    }

    fn payloads(&self, table: &RobotTable) -> Result<Vec<MountedPayload>, FileError> {
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
