//! Whether a promise is kept: decided here, for deflections and for absolute readings alike.

use super::summary::Measured;

/// More standard errors than this are not chance ...
const STANDARD_ERRORS: f64 = 3.0;
/// ... nor are they what linear propagation leaves out, beyond this share.
const LINEAR: f64 = 0.02;

/// How a promise came off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// Within three standard errors and 2 %.
    Holds,
    /// More is left.
    Broken,
    /// Less is left.
    TooCareful,
}

impl Kept {
    /// What the rms distance that was seen (m) says of the one that was promised.
    #[must_use]
    pub fn of(promised_m: f64, seen_m: Measured) -> Self {
        let room = STANDARD_ERRORS * seen_m.standard_error + LINEAR * promised_m;
        if seen_m.value > promised_m + room {
            Self::Broken
        } else if seen_m.value < promised_m - room {
            Self::TooCareful
        } else {
            Self::Holds
        }
    }

    /// Its name in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Broken => "broken",
            Self::TooCareful => "too careful",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_promise_has_room_on_both_sides() {
        let of = |value, standard_error| {
            Kept::of(
                1.0,
                Measured {
                    value,
                    standard_error,
                },
            )
        };
        assert_eq!(of(1.019, 0.0), Kept::Holds);
        assert_eq!(of(0.981, 0.0), Kept::Holds);
        assert_eq!(of(1.021, 0.0), Kept::Broken);
        assert_eq!(of(0.979, 0.0), Kept::TooCareful);
        assert_eq!(of(1.049, 0.01), Kept::Holds);
        assert_eq!(of(1.051, 0.01), Kept::Broken);
    }
}
