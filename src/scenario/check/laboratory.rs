//! The table `[laboratory]`.

use nalgebra::DVector;

use super::ArmChecker;
use crate::files::FileError;
use crate::laboratory::{Costs, Laboratory};
use crate::parameter::Unloaded;
use crate::quantities::limits::MOST_NAMED;
use crate::task::Loading;

/// The largest number of a tool or a base.
const LARGEST_NUMBER: u32 = 1000;

impl ArmChecker<'_> {
    pub(super) fn laboratory(&self) -> Result<Laboratory, FileError> {
        let table = &self.file.laboratory;
        self.loading()?;
        let usual = Laboratory::default();
        let count = |name: &str, value: Option<u32>, usual: u32, allowed| {
            let value = value.unwrap_or(usual);
            self.count(&format!("laboratory.{name}"), value, allowed)
        };
        let (numbers, percent) = (0..=LARGEST_NUMBER, 1..=100);
        let (tool, base, speed) = (table.tool_number, table.base_number, table.speed_percent);
        let (costs, angle) = (usual.costs, f64::to_radians);
        let safe = |key: &str, q_deg: &Vec<f64>| self.configuration(key, q_deg);
        Ok(Laboratory {
            costs: Costs {
                station_min: table.station_min.unwrap_or(costs.station_min),
                move_min: table.move_min.unwrap_or(costs.move_min),
                load_change_min: table.load_change_min.unwrap_or(costs.load_change_min),
                reading_min: table.reading_min.unwrap_or(costs.reading_min),
            },
            axis_speed_per_s: (table.axis_speed_deg_s).map_or(usual.axis_speed_per_s, angle),
            approach: table.approach_deg.map_or(usual.approach, angle),
            safe_poses: self.each("laboratory.safe_deg", MOST_NAMED, &table.safe_deg, safe)?,
            dialect: table.dialect.clone().unwrap_or(usual.dialect),
            speed_percent: count("speed_percent", speed, usual.speed_percent, percent)?,
            tool_number: count("tool_number", tool, usual.tool_number, numbers.clone())?,
            base_number: count("base_number", base, usual.base_number, numbers)?,
        })
    }

    /// Whether loads can be hung in place.
    fn loading(&self) -> Result<(), FileError> {
        let both = (self.file.laboratory.loading, self.file.instrument.unloaded);
        if both != (Loading::InPlace, Unloaded::Shared) {
            return Ok(());
        }
        let problem = "is \"in_place\", and instrument.unloaded is \"shared\": each load is read beside the zero before it";
        Err(self.wrong("laboratory.loading", problem))
    }

    /// A configuration (rad, m) within the joints' limits, from degrees and mm.
    pub(super) fn configuration(
        &self,
        key: &str,
        q_deg: &[f64],
    ) -> Result<DVector<f64>, FileError> {
        let (chain, commands) = (self.chain, &self.commands);
        let q_deg = self.one_per_joint(key, q_deg, commands.len())?;
        let end = |end: usize| -> Vec<f64> {
            let ends = chain.joints.iter().map(|joint| joint.range_rad[end]);
            commands.shown(&ends.collect::<Vec<f64>>())
        };
        let ranges = end(0).into_iter().zip(end(1));
        for ((value, joint), (low, high)) in q_deg.iter().zip(chain.commanded()).zip(ranges) {
            if *value < low - 1e-9 || *value > high + 1e-9 {
                let name = &chain.joints[joint].name;
                let problem =
                    format!("found {value} for {name}; its limits are {low:.4} to {high:.4}");
                return Err(self.wrong(key, problem));
            }
        }
        Ok(commands.configuration(q_deg))
    }
}
