//! Transmission errors of the tables `[[uncertainty]]`: independent between configurations, harmonics, and functions of the joints'
//! own angles or ways.

use std::num::NonZeroU32;

use super::error_source::UncertaintyEntry;
use crate::files::FileError;
use crate::numeric::markov::Kernel;
use crate::parameter::{GearWave, ParameterKind, ReadingSource, Source, TransmissionError};

/// More waves are no list of what a gear has ...
const MOST_WAVES: usize = 20;
/// ... and more of one in a turn than any gear has teeth.
const MOST_PER_TURN: u32 = 1000;

impl UncertaintyEntry<'_> {
    pub fn transmission_error(&self) -> Result<Source, FileError> {
        let table = self.table;
        if let Some(harmonics) = &table.harmonics {
            let joints = self.joints_with_functions(false)?;
            for key in ["correlation_deg", "correlation_mm", "correlation"] {
                if self.gives(key) {
                    let problem =
                        format!("only a transmission_error without harmonics has a {key}");
                    return Err(self.wrong(key, problem));
                }
            }
            return self.waves(harmonics, &joints);
        }
        let slides = self.gives("correlation_mm");
        let (length, unit, size) = if slides {
            (table.correlation_mm, 1e-3, "std_mm")
        } else {
            (table.correlation_deg, 1_f64.to_radians(), "std_mrad")
        };
        let error = if let Some(length) = length {
            let mut deviations = vec![0.0; self.belief.nominal.chain.len()];
            for joint in self.joints_with_functions(slides)? {
                deviations[joint] = self.size(size)?;
            }
            let kernel = Some(Kernel {
                correlation: table.correlation.unwrap_or_default(),
                length: length * unit,
                period: None,
            });
            TransmissionError { deviations, kernel }
        } else if table.correlation.is_some() {
            let problem = "only a transmission_error with correlation_deg or correlation_mm has a correlation";
            return Err(self.wrong("correlation", problem));
        } else {
            let (deviations, kernel) = (self.all_sizes()?, None);
            TransmissionError { deviations, kernel }
        };
        Ok(Source::Reading(ReadingSource::TransmissionError(error)))
    }

    /// The joints whose errors are functions of their own angles, or of their ways where they slide: those that are named, or all such.
    fn joints_with_functions(&self, slides: bool) -> Result<Vec<usize>, FileError> {
        let (others, problem): (&[&str], _) = if slides {
            let problem = "is of joints that turn, and correlation_mm of joints that slide";
            (&["std_mrad", "correlation_deg"], problem)
        } else {
            let problem = "a joint that slides has no turn: its error is no function of an angle";
            (&["std_mm"], problem)
        };
        let Some(other) = others.iter().find(|key| self.gives(key)) else {
            return self.moving_joints(slides);
        };
        let hint = "give joints that turn, and those that slide, a transmission_error each: std_mrad with correlation_deg, std_mm with \
                    correlation_mm";
        Err(self.wrong(other, problem).hint(hint))
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
