//! What the machine can do at best.

use std::hint::black_box;

use multiversion::multiversion;

/// Multiply-adds in one call of the loop: 64 sums in flight hide the latency.
const WIDTH: usize = 64;
/// Rounds in a unit of work.
const ROUNDS: u32 = 1000;
/// Floating-point operations in a unit of work of [`multiply_add`].
pub const FLOPS: f64 = 2.0 * 64.0 * 1000.0;

/// Independent multiply-adds in registers: the most floating-point operations that a core can do.
pub fn multiply_add(times: u64) {
    let mut sums = [1.0_f64; WIDTH];
    for _ in 0..times {
        rounds(&mut sums, black_box(0.999), black_box(1e-3));
    }
    black_box(&sums);
}

#[multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl+fma",
    "x86_64+avx2+fma",
    "aarch64+neon"
))]
fn rounds(sums: &mut [f64; WIDTH], factor: f64, summand: f64) {
    // Eight AVX registers, or fewer wider ones, at a time stay in registers.
    for part in sums.as_chunks_mut::<32>().0 {
        let mut own = *part;
        for _ in 0..ROUNDS {
            for sum in &mut own {
                *sum = sum.mul_add(factor, summand);
            }
        }
        *part = own;
    }
}

/// A count as a float.
pub fn float(count: u64) -> f64 {
    count as f64
}

/// A positive float cut to a count.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small and positive"
)]
pub fn whole(value: f64) -> u64 {
    value as u64
}
