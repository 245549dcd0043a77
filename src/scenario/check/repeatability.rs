//! Joint repeatability from the pose repeatability of a data sheet (ISO 9283).

use nalgebra::DMatrix;

use super::Checker;
use super::uncertainty::ReadingPlaces;
use crate::files::FileError;
use crate::numeric::tolerance::pose_repeatability;
use crate::observation::ReadingErrors;
use crate::parameter::ReadingSource;
use crate::quantities::plausible::DEVIATION;
use crate::robot::Load;
use crate::scenario::file::UncertaintyTable;
use crate::task::Belief;

/// A joint whose axis goes through the tool moves it by less for a radian: rounding.
const NOTHING_M: f64 = 1e-9;

impl Checker<'_> {
    /// The standard deviation (rad) of each joint that turns, the same for all, with which the machining tool has this pose
    /// repeatability in visits of the first test pose; between the unloaded and the loaded reading of a deflection, as
    /// [`ReadingSource::JointRepeatability`] has it. Others have none.
    pub(super) fn joint_repeatability(
        &self,
        key: &str,
        (table, rp_mm): (&UncertaintyTable, f64),
        belief: &Belief,
        places: ReadingPlaces<'_>,
    ) -> Result<ReadingSource, FileError> {
        let own = format!("{key}.rp_mm");
        let rp_m = self.number(&own, rp_mm, &DEVIATION)? * 1e-3;
        if table.std_mrad.is_some() || table.std_mm.is_some() {
            let wrong = self.wrong(&own, "is given beside a standard deviation");
            return Err(wrong.hint(
                "leave out one of the two; joints that slide can have a joint_repeatability of their own, with another name",
            ));
        }
        let chain = &belief.nominal.chain;
        let joints = self.turning_joints(key, table, belief)?;
        let (q_rad, tool) = (places.test_pose_rad, &belief.machining_tool);
        let mut deviations = vec![0.0; chain.len()];
        for joint in joints {
            deviations[joint] = 1.0;
        }
        let each_one_rad = ReadingSource::JointRepeatability(deviations.clone());
        let at = (tool, &Load::NONE);
        let arm = belief.arm_with(tool);
        let errors = ReadingErrors::new(arm, q_rad.as_slice(), at, None, [&each_one_rad]);
        let covariance = errors.covariance();
        let of_position = DMatrix::from_fn(3, 3, |row, column| covariance[(row, column)]);
        let of_one_rad = pose_repeatability(&of_position);
        let Some(of_one_rad) = of_one_rad.filter(|of_one_rad| *of_one_rad > NOTHING_M) else {
            return Err(self.wrong(&own, "none of the joints moves the tool there"));
        };
        for deviation in &mut deviations {
            *deviation *= rp_m / of_one_rad;
        }
        Ok(ReadingSource::JointRepeatability(deviations))
    }

    /// The joints that are named, or all that turn at a command.
    fn turning_joints(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
    ) -> Result<Vec<usize>, FileError> {
        let chain = &belief.nominal.chain;
        let turns = |joint: usize| {
            let drive = &chain.joints[joint].drive;
            !drive.slides && drive.passive_at.is_none()
        };
        let joints = self.uncertain_joints(key, table, belief, &turns)?;
        match joints.iter().find(|&&joint| !turns(joint)) {
            None => Ok(joints),
            Some(&joint) => {
                let problem = format!("{} does not turn at a command", chain.joints[joint].name);
                Err(self.wrong(&format!("{key}.joints"), problem))
            }
        }
    }
}
