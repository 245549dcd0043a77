//! The table `[region]`: where experiments are possible.

use super::ArmChecker;
use super::number::in_si;
use crate::files::FileError;
use crate::quantities::limits::MOST_LISTED;
use crate::robot::Joint;
use crate::scenario::file::ForbiddenTable;
use crate::task::{Forbidden, Region};

impl ArmChecker<'_> {
    pub(super) fn region(&self) -> Result<Region, FileError> {
        let (table, chain) = (&self.file.region, self.chain);
        let mut joint_range_rad: Vec<_> =
            chain.joints.iter().map(|joint| joint.range_rad).collect();
        for (unit, ranges) in [
            ("deg", &table.joint_range_deg),
            ("mm", &table.joint_range_mm),
        ] {
            for (name, range) in ranges {
                let key = format!("region.joint_range_{unit}.{name}");
                let joint = self.joint(&key, chain, name)?;
                joint_range_rad[joint] =
                    self.joint_range(&key, &chain.joints[joint], (unit, range))?;
            }
        }
        let joint_torque_max_nm = (table.joint_torque_max_nm.as_deref()).map(|values| {
            let all = vec![f64::INFINITY; chain.len()];
            self.one_per_command("region.joint_torque_max_nm", values, chain, all)
        });
        let height_mm = [table.tool_height_min_mm, table.tool_height_max_mm];
        let radius_mm = [table.tool_radius_min_mm, table.tool_radius_max_mm];
        Ok(Region {
            joint_range_rad,
            tool_height_m: self.lengths("region.tool_height", height_mm)?,
            tool_radius_m: self.lengths("region.tool_radius", radius_mm)?,
            tool_elevation_max_rad: table.tool_elevation_max_deg.map(f64::to_radians),
            joint_torque_max_nm: joint_torque_max_nm.transpose()?,
            collision_clearance_m: table.collision_clearance_mm.map(|mm| mm * 1e-3),
            line_of_sight: table.line_of_sight,
            forbidden: self.forbidden(&table.forbidden)?,
        })
    }

    /// A part of a joint's own range, which is given in degrees or mm.
    fn joint_range(
        &self,
        key: &str,
        joint: &Joint,
        (unit, range): (&str, &[f64]),
    ) -> Result<[f64; 2], FileError> {
        let slides = joint.drive.slides;
        if joint.drive.passive_at.is_some() {
            return Err(self.wrong(key, "the joint is passive: nothing commands it"));
        }
        self.check_unit(key, &joint.name, slides, unit, "deg")?;
        let [low, high] = joint.range_rad.map(|end| joint.drive.shown(end).0);
        let [from, to] = <[f64; 2]>::try_from(range).unwrap_or_default();
        if from > to || from < low - 1e-9 || to > high + 1e-9 {
            let problem =
                format!("found {from} to {to}; a range within {low:.4} to {high:.4} is allowed");
            return Err(self.wrong(key, problem));
        }
        Ok([from, to].map(|end| in_si(unit, end)))
    }

    fn forbidden(&self, tables: &[ForbiddenTable]) -> Result<Vec<Forbidden>, FileError> {
        self.each("region.forbidden", MOST_LISTED, tables, |key, table| {
            let q_key = format!("{key}.q_deg");
            let q_deg = self.one_per_joint(&q_key, &table.q_deg, self.commands.len())?;
            Ok(Forbidden {
                configuration_rad: self.commands.configuration(q_deg),
                within_rad: table.within_deg.to_radians(),
            })
        })
    }
}
