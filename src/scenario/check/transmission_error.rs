//! Transmission errors of the tables `[[uncertainty]]`: independent between configurations, harmonics, and functions of the joints'
//! own angles.

use std::num::NonZeroU32;

use super::error_source::UncertaintyEntry;
use crate::files::FileError;
use crate::numeric::markov::Kernel;
use crate::parameter::{GearWave, ParameterKind, ReadingSource, Source, TransmissionError};
use crate::quantities::plausible::ANGLE_WIDTH;

/// More waves are no list of what a gear has ...
const MOST_WAVES: usize = 20;
/// ... and more of one in a turn than any gear has teeth.
const MOST_PER_TURN: u32 = 1000;

impl UncertaintyEntry<'_> {
    pub fn transmission_error(&self) -> Result<Source, FileError> {
        let (harmonics, correlation_deg) = (&self.table.harmonics, self.table.correlation_deg);
        let is_of_angle = harmonics.is_some() || correlation_deg.is_some();
        if is_of_angle && self.gives("std_mm") {
            let problem = "a joint that slides has no turn: its error is no function of an angle";
            let hint = "give std_mrad, and slides a transmission_error of their own";
            return Err(self.wrong("std_mm", problem).hint(hint));
        }
        // Joints that slide have no size then, and are none of those that are not named.
        let turning = is_of_angle.then(|| self.turning_joints()).transpose()?;
        if let (Some(harmonics), Some(joints)) = (harmonics, &turning) {
            for key in ["correlation_deg", "correlation"] {
                if self.gives(key) {
                    let problem =
                        format!("only a transmission_error without harmonics has a {key}");
                    return Err(self.wrong(key, problem));
                }
            }
            return self.waves(harmonics, joints);
        }
        let key = self.path("correlation_deg");
        let correlation_deg = self.checker.optional(&key, correlation_deg, &ANGLE_WIDTH)?;
        if correlation_deg.is_none() && self.table.correlation.is_some() {
            let problem = "only a transmission_error with correlation_deg has a correlation";
            return Err(self.wrong("correlation", problem));
        }
        let correlation = self.table.correlation.unwrap_or_default();
        let mut deviations = vec![0.0; self.belief.nominal.chain.len()];
        match turning {
            Some(joints) => {
                for joint in joints {
                    deviations[joint] = self.size("std_mrad")?;
                }
            }
            None => deviations = self.all_sizes()?,
        }
        let error = TransmissionError {
            deviations,
            kernel: correlation_deg.map(|length| Kernel {
                correlation,
                length: length.to_radians(),
            }),
        };
        Ok(Source::Reading(ReadingSource::TransmissionError(error)))
    }

    /// Gear error in waves of which so many come in a turn: two parameters for each of them and each joint.
    fn waves(&self, harmonics: &[i64], joints: &[usize]) -> Result<Source, FileError> {
        let own = self.path("harmonics");
        self.checker.at_most(&own, harmonics.len(), MOST_WAVES)?;
        let mut counts: Vec<NonZeroU32> = Vec::new();
        for (index, &count) in harmonics.iter().enumerate() {
            let wrong = |problem: String| self.wrong(&format!("harmonics[{index}]"), problem);
            let per_turn = u32::try_from(count).ok().and_then(NonZeroU32::new);
            let per_turn = per_turn.filter(|count| count.get() <= MOST_PER_TURN);
            let per_turn = per_turn.ok_or_else(|| {
                let hint = (count == 0).then_some("a constant transmission error is a joint_zero");
                wrong(format!(
                    "found {count}; a whole number of periods a turn from 1 to {MOST_PER_TURN} is needed"
                ))
                .hinted(hint)
            })?;
            if counts.contains(&per_turn) {
                return Err(wrong(format!("found {per_turn} twice")));
            }
            counts.push(per_turn);
        }
        if counts.is_empty() {
            let wrong = self.wrong("harmonics", "is empty");
            return Err(wrong.hint(
                "leave it out for a transmission error that is independent between configurations",
            ));
        }
        // All waves together are off by the size that is given, at every angle.
        let size = self.size("std_mrad")? * (counts.len() as f64).sqrt().recip();
        let of = |&joint: &usize| {
            let waves = counts.iter().flat_map(|&count| GearWave::both(count));
            waves.map(move |wave| (ParameterKind::JointWave { joint, wave }, size))
        };
        Ok(Source::Plan(joints.iter().flat_map(of).collect()))
    }
}
