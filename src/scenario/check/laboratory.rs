//! The table `[laboratory]`.

use nalgebra::DVector;

use super::Checker;
use crate::files::FileError;
use crate::laboratory::{Costs, Laboratory};
use crate::quantities::limits::MOST_NAMED;
use crate::quantities::plausible::{ANGLE, APPROACH, AXIS_SPEED, Kind, MINUTES};
use crate::robot::{Commands, SerialChain};
use crate::scenario::file::LaboratoryTable;

/// The largest number of a tool or a base.
const LARGEST_NUMBER: u32 = 1000;

impl Checker<'_> {
    pub(super) fn laboratory(
        &self,
        table: &LaboratoryTable,
        chain: &SerialChain,
        commands: &Commands,
    ) -> Result<Laboratory, FileError> {
        let usual = Laboratory::default();
        let given = |name: &str, value: Option<f64>, usual: f64, kind: &Kind| match value {
            Some(value) => self.number(&format!("laboratory.{name}"), value, kind),
            None => Ok(usual),
        };
        let angle = |name: &str, value: Option<f64>, usual_rad: f64, kind: &Kind| match value {
            Some(value) => given(name, Some(value), 0.0, kind).map(f64::to_radians),
            None => Ok(usual_rad),
        };
        let speed_percent = table.speed_percent.unwrap_or(usual.speed_percent);
        if !(1..=100).contains(&speed_percent) {
            let problem = format!("found {speed_percent}; 1 to 100 are allowed");
            return Err(self.wrong("laboratory.speed_percent", problem));
        }
        let number = |name: &str, value: Option<u32>, usual: u32| match value {
            Some(value) if value > LARGEST_NUMBER => {
                let problem = format!("found {value}; 0 to {LARGEST_NUMBER} are allowed");
                Err(self.wrong(&format!("laboratory.{name}"), problem))
            }
            value => Ok(value.unwrap_or(usual)),
        };
        let costs = usual.costs;
        Ok(Laboratory {
            costs: Costs {
                station_min: given(
                    "station_min",
                    table.station_min,
                    costs.station_min,
                    &MINUTES,
                )?,
                move_min: given("move_min", table.move_min, costs.move_min, &MINUTES)?,
                load_change_min: given(
                    "load_change_min",
                    table.load_change_min,
                    costs.load_change_min,
                    &MINUTES,
                )?,
                reading_min: given(
                    "reading_min",
                    table.reading_min,
                    costs.reading_min,
                    &MINUTES,
                )?,
            },
            axis_speed_per_s: angle(
                "axis_speed_deg_s",
                table.axis_speed_deg_s,
                usual.axis_speed_per_s,
                &AXIS_SPEED,
            )?,
            approach: angle(
                "approach_deg",
                table.approach_deg,
                usual.approach,
                &APPROACH,
            )?,
            safe_poses: self.safe_poses(&table.safe_deg, chain, commands)?,
            dialect: table.dialect.clone().unwrap_or(usual.dialect),
            speed_percent,
            tool_number: number("tool_number", table.tool_number, usual.tool_number)?,
            base_number: number("base_number", table.base_number, usual.base_number)?,
        })
    }

    fn safe_poses(
        &self,
        poses: &[Vec<f64>],
        chain: &SerialChain,
        commands: &Commands,
    ) -> Result<Vec<DVector<f64>>, FileError> {
        self.at_most("laboratory.safe_deg", poses.len(), MOST_NAMED)?;
        let pose = |(index, q_deg): (usize, &Vec<f64>)| {
            let key = format!("laboratory.safe_deg[{index}]");
            let q =
                commands.configuration(self.one_per_joint(&key, q_deg, commands.len(), &ANGLE)?);
            let outside = (q.iter().zip(&chain.joints)).position(|(angle, joint)| {
                let [low, high] = joint.range_rad;
                *angle < low - 1e-9 || *angle > high + 1e-9
            });
            match outside {
                Some(joint) => {
                    let [low, high] = chain.joints[joint].range_rad.map(f64::to_degrees);
                    let found = q[joint].to_degrees();
                    let problem = format!(
                        "found {found:.4} for joint {}; {low:.4} to {high:.4} are allowed",
                        joint + 1
                    );
                    Err(self.wrong(&key, problem))
                }
                None => Ok(q),
            }
        };
        poses.iter().enumerate().map(pose).collect()
    }
}
