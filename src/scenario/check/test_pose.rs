//! The tables `[[test_pose]]`.

use super::Checker;
use crate::files::FileError;
use crate::limits::MOST_NAMED;
use crate::plausible::{ANGLE, WEIGHT};
use crate::robot::{Commands, Load, SerialChain};
use crate::scenario::file::TestPoseTable;
use crate::task::TestPose;

impl Checker<'_> {
    pub(super) fn test_poses(
        &self,
        tables: &[TestPoseTable],
        chain: &SerialChain,
    ) -> Result<Vec<TestPose>, FileError> {
        if tables.is_empty() {
            return Err(self.wrong("test_pose", "is empty; at least one test pose is needed"));
        }
        self.at_most("test_pose", tables.len(), MOST_NAMED)?;
        let mut poses = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            let key = format!("test_pose[{index}]");
            let q_key = format!("{key}.q_deg");
            let commands = Commands::from(chain);
            let q_deg = self.one_per_joint(&q_key, &table.q_deg, commands.len(), &ANGLE)?;
            let end = |end: usize| -> Vec<f64> {
                let ends = chain.joints.iter().map(|joint| joint.range_rad[end]);
                commands.shown(&ends.collect::<Vec<f64>>())
            };
            let ranges = end(0).into_iter().zip(end(1));
            for ((value, joint), (low, high)) in q_deg.iter().zip(chain.commanded()).zip(ranges) {
                let joint = &chain.joints[joint];
                if *value < low - 1e-9 || *value > high + 1e-9 {
                    let problem = format!(
                        "found {value} for {}; its limits are {low:.4} to {high:.4}",
                        joint.name
                    );
                    return Err(self.wrong(&q_key, problem));
                }
            }
            let weight = table.weight.unwrap_or(1.0);
            poses.push(TestPose {
                name: table
                    .name
                    .clone()
                    .unwrap_or_else(|| format!("test pose {}", index + 1)),
                configuration_rad: commands.configuration(q_deg),
                load: self.test_load(&key, table)?,
                weight: self.number(&format!("{key}.weight"), weight, &WEIGHT)?,
            });
        }
        let total: f64 = poses.iter().map(|pose| pose.weight).sum();
        for pose in &mut poses {
            pose.weight /= total;
        }
        Ok(poses)
    }

    /// Without a load there is nothing to compensate.
    fn test_load(&self, key: &str, table: &TestPoseTable) -> Result<Load, FileError> {
        self.load(key, &table.force_n, table.torque_nm.as_deref())
            .map_err(|error| match error.place.as_deref() {
                Some(place) if place == key => {
                    error.hint("give the forces of the process that the robot must withstand there")
                }
                _ => error,
            })
    }
}
