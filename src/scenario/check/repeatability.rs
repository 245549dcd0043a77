//! Joint repeatability, by itself or from the pose repeatability of a data sheet (ISO 9283).

use nalgebra::DMatrix;

use super::error_source::UncertaintyEntry;
use crate::files::FileError;
use crate::numeric::tolerance::pose_repeatability;
use crate::observation::ReadingErrors;
use crate::parameter::ReadingSource;
use crate::robot::Load;

/// A joint whose axis goes through the tool moves it by less for a radian: rounding.
const NOTHING_M: f64 = 1e-9;

impl UncertaintyEntry<'_> {
    /// By a pose repeatability: the standard deviation (rad) of each joint that turns, the same for all, with which the machining
    /// tool has it in visits of the first test pose; between the unloaded and the loaded reading of a deflection, as
    /// [`ReadingSource::JointRepeatability`] has it. Others have none.
    pub fn joint_repeatability(&self) -> Result<ReadingSource, FileError> {
        if !self.gives("rp_mm") {
            return Ok(ReadingSource::JointRepeatability(self.all_sizes()?));
        }
        if self.gives("std_mrad") || self.gives("std_mm") {
            let wrong = self.wrong("rp_mm", "is given beside a standard deviation");
            return Err(wrong.hint(
                "leave out one of the two; joints that slide can have a joint_repeatability of their own, with another name",
            ));
        }
        let rp_m = self.size("rp_mm")?;
        let mut deviations = vec![0.0; self.belief.nominal.chain.len()];
        for joint in self.moving_joints(false)? {
            deviations[joint] = 1.0;
        }
        let each_one_rad = ReadingSource::JointRepeatability(deviations.clone());
        let (q_rad, tool) = (self.places.test_pose_rad, &self.belief.machining_tool);
        let (arm, at) = (self.belief.arm_with(tool), (tool, &Load::NONE));
        let errors = ReadingErrors::new(arm, q_rad.as_slice(), at, None, [&each_one_rad]);
        let covariance = errors.covariance();
        let of_position = DMatrix::from_fn(3, 3, |row, column| covariance[(row, column)]);
        let of_one_rad = pose_repeatability(&of_position).filter(|size| *size > NOTHING_M);
        let of_one_rad = of_one_rad
            .ok_or_else(|| self.wrong("rp_mm", "none of the joints moves the tool there"))?;
        let scaled = deviations.iter().map(|one| one * (rp_m / of_one_rad));
        Ok(ReadingSource::JointRepeatability(scaled.collect()))
    }
}
