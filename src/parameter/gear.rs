//! Transmission error as harmonics of the joint's own angle.
//!
//! Teeth, bearings and wave generators come round so many times in a turn of the joint, and so does what they are off by. A
//! joint that is commanded q stands at q + e(q),
//!
//! ```text
//! e(q) = sum over h of a_h sin(h q) + b_h cos(h q)
//! ```
//!
//! with whole numbers h of waves in a turn. With `a_h` and `b_h` of the variance s^2 / H each, for H numbers h, e has the standard
//! deviation s at every angle.

use std::num::NonZeroU32;

/// Of which of the two waves that come as often.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum WavePhase {
    /// sin(h q).
    Sine,
    /// cos(h q).
    Cosine,
}

/// A wave of a gear's error, of size one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct GearWave {
    /// How often it comes in a turn of the joint. None in a turn would be the joint's zero.
    pub per_turn: NonZeroU32,
    /// Which of the two.
    pub phase: WavePhase,
}

impl GearWave {
    /// Both waves that come so often in a turn.
    pub fn both(per_turn: NonZeroU32) -> [Self; 2] {
        [WavePhase::Sine, WavePhase::Cosine].map(|phase| Self { per_turn, phase })
    }

    /// Its value at an angle (rad).
    pub fn at(self, angle_rad: f64) -> f64 {
        let (sine, cosine) = (f64::from(self.per_turn.get()) * angle_rad).sin_cos();
        match self.phase {
            WavePhase::Sine => sine,
            WavePhase::Cosine => cosine,
        }
    }

    /// Its word in a parameter's name, such as `gear_40_sine`.
    pub fn name(self) -> String {
        format!("gear_{}_{}", self.per_turn, self.phase.word())
    }

    /// The wave of such a word.
    pub fn named(word: &str) -> Option<Self> {
        let (per_turn, phase) = word.strip_prefix("gear_")?.split_once('_')?;
        let wave = Self {
            per_turn: per_turn.parse().ok()?,
            phase: [WavePhase::Sine, WavePhase::Cosine]
                .into_iter()
                .find(|each| each.word() == phase)?,
        };
        // One name for each: neither +40 nor 040.
        (wave.name() == word).then_some(wave)
    }
}

impl WavePhase {
    /// `sine` or `cosine`.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Sine => "sine",
            Self::Cosine => "cosine",
        }
    }
}

/// A wave in a joint's gear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaveError {
    /// The joint, which turns.
    pub joint: usize,
    /// The wave.
    pub wave: GearWave,
    /// How large it is (rad).
    pub amplitude_rad: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names are read as they are written, and in no other way.
    #[test]
    fn names() {
        for per_turn in [1, 40, 202].map(|count| NonZeroU32::new(count).expect("not zero")) {
            for wave in GearWave::both(per_turn) {
                assert_eq!(GearWave::named(&wave.name()), Some(wave));
            }
        }
        for word in [
            "gear_0_sine",
            "gear_040_sine",
            "gear_+1_sine",
            "gear_1_tangent",
            "gear_1",
            "zero",
        ] {
            assert_eq!(GearWave::named(word), None, "{word}");
        }
    }

    /// With variances of s^2 / H each, the error has the standard deviation s at every angle, and at two angles the covariance
    /// that follows their distance alone: near ones err alike.
    #[test]
    fn near_angles_err_alike() {
        let counts = [1, 2, 40].map(|count| NonZeroU32::new(count).expect("not zero"));
        let covariance = |one: f64, other: f64| -> f64 {
            let waves = counts.iter().flat_map(|&count| GearWave::both(count));
            let both = waves.map(|wave| wave.at(one) * wave.at(other));
            both.sum::<f64>() / counts.len() as f64
        };
        for angle in [-3.0, 0.0, 0.4, 2.0] {
            assert!((covariance(angle, angle) - 1.0).abs() < 1e-12);
            for apart in [0.001, 0.02, 1.0] {
                let expected = counts.map(|count| (f64::from(count.get()) * apart).cos());
                let expected = expected.iter().sum::<f64>() / 3.0;
                assert!((covariance(angle, angle + apart) - expected).abs() < 1e-12);
            }
        }
    }
}
