//! Counts and sums of integers as numbers to calculate with.

#[expect(clippy::cast_precision_loss, reason = "a mean needs 53 bits")]
pub(super) fn integer_to_f64(value: i128) -> f64 {
    value as f64
}

#[expect(clippy::cast_precision_loss, reason = "far below 2^52 runs")]
pub(super) fn count_to_f64(count: u64) -> f64 {
    count as f64
}
