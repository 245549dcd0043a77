//! The tables `[[obstacle]]`: what stands in the laboratory besides the model.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::Checker;
use crate::files::FileError;
use crate::mujoco::{Obstacle, Shape};
use crate::quantities::limits::MOST_OBSTACLES;
use crate::quantities::plausible::{ANGLE, POSITION, SIZE};
use crate::scenario::file::{File, ObstacleKind, ObstacleTable};

impl Checker<'_> {
    pub(super) fn obstacles(&self, file: &File) -> Result<Vec<Obstacle>, FileError> {
        self.at_most("obstacle", file.obstacle.len(), MOST_OBSTACLES)?;
        let mut obstacles: Vec<Obstacle> = Vec::new();
        for (index, table) in file.obstacle.iter().enumerate() {
            let key = format!("obstacle[{index}]");
            let name = &table.name;
            if obstacles.iter().any(|known| known.name == *name) {
                let problem = format!("found {name:?} twice");
                return Err(self.wrong(&format!("{key}.name"), problem));
            }
            obstacles.push(Obstacle {
                name: name.clone(),
                shape: self.shape(&key, table)?,
                world_from_obstacle: self.place(&key, table)?,
            });
        }
        let region = &file.region;
        if !obstacles.is_empty() && region.collision_clearance_mm.is_none() && !region.line_of_sight
        {
            let problem = "obstacles are not checked: neither region.collision_clearance_mm nor \
                           region.line_of_sight is given";
            return Err(self.wrong("obstacle", problem));
        }
        Ok(obstacles)
    }

    /// MuJoCo's sizes are half sizes; the file's are whole ones.
    fn shape(&self, key: &str, table: &ObstacleTable) -> Result<Shape, FileError> {
        let kind = table.kind;
        let unwanted = |name: &str| {
            let problem = format!("a {} has no such size", kind.name());
            self.wrong(&format!("{key}.{name}"), problem)
        };
        let missing = |name: &str| {
            let problem = format!("is missing; a {} needs it", kind.name());
            self.wrong(&format!("{key}.{name}"), problem)
        };
        let number = |name: &str, value: Option<f64>| {
            let key = format!("{key}.{name}");
            let value = value.ok_or_else(|| missing(name))?;
            Ok(self.number(&key, value, &SIZE)? * 1e-3)
        };
        if kind == ObstacleKind::Box {
            if table.radius_mm.is_some() {
                return Err(unwanted("radius_mm"));
            }
        } else if table.size_mm.is_some() {
            return Err(unwanted("size_mm"));
        }
        let is_long = matches!(kind, ObstacleKind::Cylinder | ObstacleKind::Capsule);
        if table.length_mm.is_some() && !is_long {
            return Err(unwanted("length_mm"));
        }
        let radius = || number("radius_mm", table.radius_mm);
        let half_length = || Ok(number("length_mm", table.length_mm)? / 2.0);
        Ok(match kind {
            ObstacleKind::Box => {
                let size = (table.size_mm.as_deref()).ok_or_else(|| missing("size_mm"))?;
                let size = self.numbers(&format!("{key}.size_mm"), size, &SIZE)?;
                Shape::Box(Vector3::from(size) * 1e-3 / 2.0)
            }
            ObstacleKind::Sphere => Shape::Sphere(radius()?),
            ObstacleKind::Cylinder => Shape::Cylinder(radius()?, half_length()?),
            ObstacleKind::Capsule => Shape::Capsule(radius()?, half_length()?),
        })
    }

    fn place(&self, key: &str, table: &ObstacleTable) -> Result<Isometry3<f64>, FileError> {
        let position_mm: [f64; 3] =
            self.numbers(&format!("{key}.position_mm"), &table.position_mm, &POSITION)?;
        let rpy_deg = table.rpy_deg.as_deref().unwrap_or(&[0.0; 3]);
        let rpy_deg: [f64; 3] = self.numbers(&format!("{key}.rpy_deg"), rpy_deg, &ANGLE)?;
        let [roll, pitch, yaw] = rpy_deg.map(f64::to_radians);
        Ok(Isometry3::from_parts(
            Translation3::from(Vector3::from(position_mm) * 1e-3),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }
}
