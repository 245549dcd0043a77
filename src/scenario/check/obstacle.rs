//! The tables `[[obstacle]]`: what stands in the laboratory besides the model.

use nalgebra::Vector3;

use super::Checker;
use crate::files::FileError;
use crate::mujoco::{Obstacle, Shape};
use crate::quantities::limits::MOST_OBSTACLES;
use crate::quantities::plausible::SIZE;
use crate::scenario::file::{File, ShapeTable};

impl Checker<'_> {
    pub(super) fn obstacles(&self, file: &File) -> Result<Vec<Obstacle>, FileError> {
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
}
