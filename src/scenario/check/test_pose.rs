//! The tables `[[test_pose]]`.

use nalgebra::{Matrix3, Vector3};

use super::{ArmChecker, Checker};
use crate::compensation::test_pose_rows;
use crate::files::FileError;
use crate::quantities::limits::MOST_NAMED;
use crate::robot::{Load, Tool};
use crate::scenario::file::TestPoseTable;
use crate::task::{Belief, TestPose};

/// Of what bends the tool, less than this share along a direction is rounding.
const NOTHING: f64 = 1e-9;

impl ArmChecker<'_> {
    pub(super) fn test_poses(&self, machining_tool: &Tool) -> Result<Vec<TestPose>, FileError> {
        let tables = &self.file.test_pose;
        if tables.is_empty() {
            return Err(self.wrong("test_pose", "is empty; at least one test pose is needed"));
        }
        self.at_most("test_pose", tables.len(), MOST_NAMED)?;
        let mut poses = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            let key = format!("test_pose[{index}]");
            let q_key = format!("{key}.q_deg");
            let configuration_rad = self.configuration(&q_key, &table.q_deg)?;
            let state = self
                .chain
                .at(machining_tool)
                .state(configuration_rad.as_slice());
            let axes = &state.tool_rotation;
            let unnamed = || format!("test pose {}", index + 1);
            let name = table.name.clone().unwrap_or_else(unnamed);
            if poses.iter().any(|pose: &TestPose| pose.name == name) {
                return Err(self.wrong(&format!("{key}.name"), format!("found {name:?} twice")));
            }
            poses.push(TestPose {
                name,
                load: self.test_load(&key, table, axes)?,
                load_axes: (table.tool_force_n.is_some() || table.tool_torque_nm.is_some())
                    .then_some(*axes),
                direction: self.direction(&key, table, axes)?,
                configuration_rad,
                weight: table.weight.unwrap_or(1.0),
            });
        }
        let total: f64 = poses.iter().map(|pose| pose.weight).sum();
        for pose in &mut poses {
            pose.weight /= total;
        }
        Ok(poses)
    }
}

impl Checker<'_> {
    /// Without a load there is nothing to compensate. One in the tool's frame turns with it; `axes` are the tool's.
    fn test_load(
        &self,
        key: &str,
        table: &TestPoseTable,
        axes: &Matrix3<f64>,
    ) -> Result<Load, FileError> {
        let in_world = [table.force_n.as_deref(), table.torque_nm.as_deref()];
        let in_tool = [
            table.tool_force_n.as_deref(),
            table.tool_torque_nm.as_deref(),
        ];
        let is_given = |load: [Option<&[f64]>; 2]| load.iter().any(Option::is_some);
        if !is_given(in_tool) {
            let load = self.load(key, "force_n", in_world);
            return load.map_err(|error| match error.place.as_deref() {
                Some(place) if place == key => {
                    error.hint("give the forces of the process that the robot must withstand there")
                }
                _ => error,
            });
        }
        if is_given(in_world) {
            let wrong = self.wrong(key, "the task load is given in two frames");
            return Err(wrong.hint(
                "give force_n and torque_nm in the world frame, or tool_force_n and tool_torque_nm in the machining \
                 tool's",
            ));
        }
        let load = self.load(key, "tool_force_n", in_tool)?;
        Ok(load.turned(axes))
    }

    /// The direction along which alone the error counts, in the world frame.
    fn direction(
        &self,
        key: &str,
        table: &TestPoseTable,
        axes: &Matrix3<f64>,
    ) -> Result<Option<Vector3<f64>>, FileError> {
        let unit = |name: &str, direction: &[f64]| self.unit(&format!("{key}.{name}"), direction);
        match (&table.direction, &table.tool_direction) {
            (None, None) => Ok(None),
            (Some(direction), None) => Ok(Some(unit("direction", direction)?)),
            (None, Some(direction)) => Ok(Some(axes * unit("tool_direction", direction)?)),
            (Some(_), Some(_)) => {
                let wrong = self.wrong(key, "the direction that counts is given in two frames");
                Err(wrong.hint(
                    "give direction in the world frame, or tool_direction in the machining tool's",
                ))
            }
        }
    }

    /// What is unknown must bend the tool along a direction that counts: else there is nothing to find out for it.
    pub(super) fn check_directions(
        &self,
        poses: &[TestPose],
        belief: &Belief,
    ) -> Result<(), FileError> {
        for (index, pose) in poses.iter().enumerate() {
            let mut all = pose.clone();
            all.direction = None;
            let size = |pose: &TestPose| {
                let mut rows = test_pose_rows(belief, pose);
                for (mut column, size) in rows.column_iter_mut().zip(belief.sizes()) {
                    column *= size;
                }
                rows.norm()
            };
            let whole = size(&all);
            if pose.direction.is_some() && whole > 0.0 && size(pose) <= NOTHING * whole {
                let problem =
                    "nothing that is unknown bends the tool along the direction that counts";
                return Err(self.wrong(&format!("test_pose[{index}]"), problem));
            }
        }
        Ok(())
    }
}
