//! Joint repeatability from the pose repeatability of a data sheet (ISO 9283).

use nalgebra::DMatrix;

use super::Checker;
use super::uncertainty::ReadingPlaces;
use crate::files::FileError;
use crate::numeric::tolerance::pose_repeatability;
use crate::observation::ReadingErrors;
use crate::parameter::ReadingSource;
use crate::quantities::plausible::{ANGLE, DEVIATION};
use crate::robot::{Commands, Load, SerialChain};
use crate::scenario::file::{UncertaintyKind, UncertaintyTable};
use crate::task::Belief;

/// A joint whose axis goes through the tool moves it by less for a radian: rounding.
const NOTHING_M: f64 = 1e-9;

impl Checker<'_> {
    /// The standard deviation (rad) of each joint that turns, the same for all, with which a place of the arm has this pose
    /// repeatability in visits of one configuration; between the unloaded and the loaded reading of a deflection, as
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
        let commands = Commands::from(chain);
        let q_key = format!("{key}.q_deg");
        let q_rad = match &table.q_deg {
            Some(q_deg) => {
                let q_deg = self.one_per_joint(&q_key, q_deg, commands.len(), &ANGLE)?;
                commands.configuration(q_deg)
            }
            None => places.test_pose_rad.clone(),
        };
        let tool = match &table.site {
            Some(site) => SerialChain::tool(&belief.nominal.model, site)
                .map_err(|error| self.wrong(&format!("{key}.site"), error.to_string()))?,
            None => belief.machining_tool.clone(),
        };
        let mut deviations = vec![0.0; chain.len()];
        for joint in joints {
            deviations[joint] = 1.0;
        }
        let each_one_rad = ReadingSource::JointRepeatability(deviations.clone());
        let at = (&tool, &Load::NONE);
        let arm = belief.arm_with(&tool);
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

    /// Keys that say where a pose repeatability holds, where there is none.
    pub(super) fn check_repeatability(
        &self,
        key: &str,
        table: &UncertaintyTable,
    ) -> Result<(), FileError> {
        let needs = [
            ("q_deg", table.q_deg.is_some()),
            ("site", table.site.is_some()),
        ];
        match needs.iter().find(|(_, is_given)| *is_given) {
            Some((name, _)) if table.rp_mm.is_none() => {
                let problem = "says where a pose repeatability holds, and none is given";
                let hint = match table.kind {
                    UncertaintyKind::JointRepeatability => "give rp_mm",
                    _ => "leave it out: rp_mm is of a joint_repeatability",
                };
                Err(self.wrong(&format!("{key}.{name}"), problem).hint(hint))
            }
            _ => Ok(()),
        }
    }
}
