//! The table `[region]`: where experiments are possible.

use super::Checker;
use super::robot::names_of;
use crate::files::FileError;
use crate::quantities::limits::MOST_LISTED;
use crate::quantities::plausible::{
    ANGLE, ANGLE_LIMIT, ANGLE_WIDTH, CLEARANCE, POSITION, TORQUE_LIMIT,
};
use crate::robot::{Commands, SerialChain};
use crate::scenario::file::{ForbiddenTable, RegionTable};
use crate::task::{Forbidden, Region};

impl Checker<'_> {
    pub(super) fn region(
        &self,
        table: &RegionTable,
        chain: &SerialChain,
    ) -> Result<Region, FileError> {
        let mut joint_range_rad: Vec<_> =
            chain.joints.iter().map(|joint| joint.range_rad).collect();
        let in_degrees = table.joint_range_deg.iter().map(|each| (each, "deg"));
        let in_millimetres = table.joint_range_mm.iter().map(|each| (each, "mm"));
        for ((name, range), unit) in in_degrees.chain(in_millimetres) {
            let key = format!("region.joint_range_{unit}.{name}");
            let index = chain
                .joints
                .iter()
                .position(|joint| joint.name == *name)
                .ok_or_else(|| {
                    let known = names_of(chain);
                    self.wrong(
                        &key,
                        format!("no such joint; the robot's joints are: {known}"),
                    )
                })?;
            let drive = chain.joints[index].drive;
            if drive.passive_at.is_some() {
                return Err(self.wrong(&key, "the joint is passive: nothing commands it"));
            }
            if drive.slides != (unit == "mm") {
                let (problem, other) = if drive.slides {
                    ("the joint slides", "joint_range_mm")
                } else {
                    ("the joint turns", "joint_range_deg")
                };
                let hint = format!("write region.{other}.{name}");
                return Err(self.wrong(&key, problem).hint(hint));
            }
            let written = |value: f64| {
                if drive.slides {
                    value * 1e3
                } else {
                    value.to_degrees()
                }
            };
            let [low, high] = chain.joints[index].range_rad.map(written);
            let range: [f64; 2] = self.numbers(&key, range, &ANGLE)?;
            let [from, to] = range;
            if from > to || from < low - 1e-9 || to > high + 1e-9 {
                let problem = format!(
                    "found {from} to {to}; a range within {low:.4} to {high:.4} is allowed"
                );
                return Err(self.wrong(&key, problem));
            }
            joint_range_rad[index] = range.map(|value| {
                if drive.slides {
                    value * 1e-3
                } else {
                    value.to_radians()
                }
            });
        }
        let joint_torque_max_nm = table
            .joint_torque_max_nm
            .as_deref()
            .map(|values| {
                let key = "region.joint_torque_max_nm";
                let commanded: Vec<usize> = chain.commanded().collect();
                let given = self.one_per_joint(key, values, commanded.len(), &TORQUE_LIMIT)?;
                let mut all = vec![f64::INFINITY; chain.len()];
                for (&joint, &value) in commanded.iter().zip(given) {
                    all[joint] = value;
                }
                Ok(all)
            })
            .transpose()?;
        Ok(Region {
            joint_range_rad,
            tool_height_m: self.lengths(
                "region.tool_height",
                [table.tool_height_min_mm, table.tool_height_max_mm],
            )?,
            tool_radius_m: self.lengths(
                "region.tool_radius",
                [table.tool_radius_min_mm, table.tool_radius_max_mm],
            )?,
            tool_elevation_max_rad: table
                .tool_elevation_max_deg
                .map(|value| self.number("region.tool_elevation_max_deg", value, &ANGLE_LIMIT))
                .transpose()?
                .map(f64::to_radians),
            joint_torque_max_nm,
            collision_clearance_m: table
                .collision_clearance_mm
                .map(|value| self.number("region.collision_clearance_mm", value, &CLEARANCE))
                .transpose()?
                .map(|value| value * 1e-3),
            line_of_sight: table.line_of_sight,
            forbidden: self.forbidden(&table.forbidden, &Commands::from(chain))?,
        })
    }

    /// The bounds `<key>_min_mm` and `<key>_max_mm`, from mm to m.
    fn lengths(
        &self,
        key: &str,
        [low, high]: [Option<f64>; 2],
    ) -> Result<[Option<f64>; 2], FileError> {
        let keys = ["min", "max"].map(|end| format!("{key}_{end}_mm"));
        for (key, value) in keys.iter().zip([low, high]) {
            value
                .map(|value| self.number(key, value, &POSITION))
                .transpose()?;
        }
        if let (Some(low), Some(high)) = (low, high)
            && low > high
        {
            let problem = format!("found {low}; at most {} = {high} is allowed", keys[1]);
            return Err(self.wrong(&keys[0], problem));
        }
        Ok([low, high].map(|value| value.map(|mm| mm * 1e-3)))
    }

    fn forbidden(
        &self,
        tables: &[ForbiddenTable],
        commands: &Commands,
    ) -> Result<Vec<Forbidden>, FileError> {
        self.at_most("region.forbidden", tables.len(), MOST_LISTED)?;
        let forbidden = |(index, table): (usize, &ForbiddenTable)| {
            let key = format!("region.forbidden[{index}]");
            let q_key = format!("{key}.q_deg");
            let q_deg = self.one_per_joint(&q_key, &table.q_deg, commands.len(), &ANGLE)?;
            let within_key = format!("{key}.within_deg");
            let within = self.number(&within_key, table.within_deg, &ANGLE_WIDTH)?;
            Ok(Forbidden {
                configuration_rad: commands.configuration(q_deg),
                within_rad: within.to_radians(),
            })
        };
        tables.iter().enumerate().map(forbidden).collect()
    }
}
