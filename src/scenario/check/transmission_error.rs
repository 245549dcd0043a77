//! Transmission errors of the tables `[[uncertainty]]` that the robot keeps: harmonics, and functions of the joints' own angles.

use std::num::NonZeroU32;

use super::Checker;
use crate::files::FileError;
use crate::parameter::{GearWave, ParameterKind};
use crate::quantities::plausible::ANGLE_WIDTH;
use crate::scenario::file::{UncertaintyKind, UncertaintyTable};
use crate::task::Belief;

/// More waves are no list of what a gear has ...
const MOST_WAVES: usize = 20;
/// ... and more of one in a turn than any gear has teeth.
const MOST_PER_TURN: u32 = 1000;

impl Checker<'_> {
    /// The angle (rad) over which joints' errors forget, where these are functions of the joints' own angles.
    pub(super) fn correlation(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
        sizes: &[f64],
    ) -> Result<Option<f64>, FileError> {
        let Some(value) = table.correlation_deg else {
            return Ok(None);
        };
        let own = format!("{key}.correlation_deg");
        let joints = belief.nominal.chain.joints.iter();
        if let Some((joint, _)) =
            (joints.zip(sizes)).find(|(joint, size)| joint.drive.slides && **size > 0.0)
        {
            let problem = format!(
                "{} slides: its error is no function of an angle",
                joint.name
            );
            let wrong = self.wrong(&own, problem);
            return Err(wrong.hint("give slides a transmission_error of their own without it"));
        }
        Ok(Some(self.number(&own, value, &ANGLE_WIDTH)?.to_radians()))
    }

    /// Gear error in waves of which so many come in a turn: two parameters for each of them and each joint.
    pub(super) fn waves(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
        harmonics: &[i64],
    ) -> Result<Vec<(ParameterKind, f64)>, FileError> {
        let own = format!("{key}.harmonics");
        if table.kind != UncertaintyKind::TransmissionError {
            let problem = format!("a {} has no waves", table.kind.name());
            return Err(self.wrong(&own, problem));
        }
        if table.std_mm.is_some() {
            let problem = "a joint that slides has no turn, and so no harmonics";
            let wrong = self.wrong(&format!("{key}.std_mm"), problem);
            return Err(wrong.hint(
                "give std_mrad, and slides a transmission_error of their own without harmonics",
            ));
        }
        self.at_most(&own, harmonics.len(), MOST_WAVES)?;
        let mut counts: Vec<NonZeroU32> = Vec::new();
        for (index, &count) in harmonics.iter().enumerate() {
            let own = format!("{own}[{index}]");
            let per_turn = u32::try_from(count).ok().and_then(NonZeroU32::new);
            let Some(per_turn) = per_turn.filter(|count| count.get() <= MOST_PER_TURN) else {
                let problem = format!(
                    "found {count}; a whole number of periods a turn from 1 to {MOST_PER_TURN} is needed"
                );
                let wrong = self.wrong(&own, problem);
                return Err(match count {
                    0 => wrong.hint("a constant transmission error is a joint_zero"),
                    _ => wrong,
                });
            };
            if counts.contains(&per_turn) {
                return Err(self.wrong(&own, format!("found {per_turn} twice")));
            }
            counts.push(per_turn);
        }
        if counts.is_empty() {
            let wrong = self.wrong(&own, "is empty");
            return Err(wrong.hint(
                "leave it out for a transmission error that is independent between configurations",
            ));
        }
        let slides = |joint: usize| belief.nominal.chain.joints[joint].drive.slides;
        if table.joints.is_some()
            && let Some(joint) = (self
                .uncertain_joints(key, table, belief, &|_| true)?
                .into_iter())
            .find(|&joint| slides(joint))
        {
            let name = &belief.nominal.chain.joints[joint].name;
            let problem = format!("{name} slides: it has no turn, and so no harmonics");
            return Err(self.wrong(&format!("{key}.joints"), problem));
        }
        // All waves together are off by the size that is given, at every angle.
        let share = (counts.len() as f64).sqrt().recip();
        let joints = self.joint_sizes(key, table, belief, "std_mrad")?;
        let of = |(joint, size): (usize, f64)| {
            let waves = counts.iter().flat_map(|&count| GearWave::both(count));
            waves.map(move |wave| (ParameterKind::JointWave { joint, wave }, size * share))
        };
        Ok(joints.into_iter().flat_map(of).collect())
    }
}
