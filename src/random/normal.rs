//! Normal random numbers by the hundred: a function of (seed, run) alone, many at a time.
//!
//! Philox4x32-10 (Salmon et al., SC 2011) is a counter-based generator: the numbers of run r are the
//! cipher of the counters (r, 0), (r, 1), ... under the seed. Pairs of 32-bit numbers become pairs of
//! normals by Box and Muller's transform, in double precision with branch-free polynomials, so that
//! the compiler can do several runs in one instruction. Only operations are used that IEEE 754 rounds
//! alike on every machine.

use multiversion::multiversion;

/// Runs that are drawn at a time.
pub const LANES: usize = 8;

/// The multipliers and key increments of Philox4x32.
const MULTIPLIERS: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;

/// What random numbers are for; each use has numbers of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// The noise of the measurements.
    Noise = 0,
    /// The virtual robot's compliances.
    Compliances = 1,
}

/// Fills `normals` with standard normal numbers of [`LANES`] consecutive runs from `first_run`:
/// number i of run `first_run` + j is `normals[i][j]`.
pub fn fill_normals(stream: Stream, seed: u64, first_run: u64, normals: &mut [[f64; LANES]]) {
    fill((stream as u64) << 32, seed, first_run, normals);
}

#[multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl+fma",
    "x86_64+avx2+fma",
    "aarch64+neon"
))]
fn fill(first_block: u64, seed: u64, first_run: u64, normals: &mut [[f64; LANES]]) {
    for (block, four) in (first_block..).zip(normals.chunks_mut(4)) {
        let [a, b, c, d] = philox(seed, first_run, block);
        let one = box_muller(&a, &b);
        let two = box_muller(&c, &d);
        for (target, source) in four.iter_mut().zip([one.0, one.1, two.0, two.1]) {
            *target = source;
        }
    }
}

/// Four 32-bit numbers for each of [`LANES`] consecutive runs.
#[expect(clippy::needless_range_loop, reason = "four arrays side by side")]
#[inline(always)]
fn philox(seed: u64, first_run: u64, block: u64) -> [[u64; LANES]; 4] {
    const LOW: u64 = 0xFFFF_FFFF;
    let mut key = [seed & LOW, seed >> 32];
    let mut x = [[0; LANES]; 4];
    for lane in 0..LANES {
        let run = first_run.wrapping_add(lane as u64);
        x[0][lane] = run & LOW;
        x[1][lane] = run >> 32;
        x[2][lane] = block & LOW;
        x[3][lane] = block >> 32;
    }
    for _ in 0..ROUNDS {
        let mut y = [[0; LANES]; 4];
        for lane in 0..LANES {
            let first = MULTIPLIERS[0] * (x[0][lane] & LOW);
            let second = MULTIPLIERS[1] * (x[2][lane] & LOW);
            y[0][lane] = (second >> 32) ^ x[1][lane] ^ key[0];
            y[1][lane] = second & LOW;
            y[2][lane] = (first >> 32) ^ x[3][lane] ^ key[1];
            y[3][lane] = first & LOW;
        }
        x = y;
        key[0] = (key[0] + u64::from(WEYL[0])) & LOW;
        key[1] = (key[1] + u64::from(WEYL[1])) & LOW;
    }
    x
}

/// Two normals from two 32-bit numbers, for each lane.
#[inline(always)]
fn box_muller(first: &[u64; LANES], second: &[u64; LANES]) -> ([f64; LANES], [f64; LANES]) {
    let mut one = [0.0; LANES];
    let mut two = [0.0; LANES];
    for lane in 0..LANES {
        let radius = (-2.0 * logarithm(first[lane])).sqrt();
        let (sine, cosine) = sine_cosine(second[lane]);
        one[lane] = radius * cosine;
        two[lane] = radius * sine;
    }
    (one, two)
}

/// ln((n + 1/2) / 2^32) for a 32-bit n, to 1e-11.
///
/// The number is split into 2^e m with m in [sqrt(1/2), sqrt(2)); then ln m = 2 artanh(s) with
/// s = (m - 1)/(m + 1), for which a minimax polynomial in s^2 < 0.0295 is good to 4e-12.
#[inline(always)]
fn logarithm(n: u64) -> f64 {
    const SQRT_HALF_BITS: u64 = 0x3FE6_A09E_667F_3BCD;
    const ONE_BITS: u64 = 0x3FF0_0000_0000_0000;
    const MANTISSA: u64 = 0x000F_FFFF_FFFF_FFFF;
    let x = small_to_f64(2 * n + 1);
    let shifted = x.to_bits().wrapping_add(ONE_BITS - SQRT_HALF_BITS);
    let exponent = small_to_f64(shifted >> 52) - 1023.0;
    let m = f64::from_bits((shifted & MANTISSA) + SQRT_HALF_BITS);
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = horner(
        z,
        [
            1.000_000_000_004_232_6,
            0.333_333_326_179_437_84,
            0.200_001_933_230_055_2,
            0.142_674_718_248_397_25,
            0.118_090_922_842_224_08,
        ],
    );
    (exponent - 33.0).mul_add(std::f64::consts::LN_2, 2.0 * s * series)
}

/// sin and cos of 2 pi ((n + 1/2) / 2^32 - 1/8) for a 32-bit n, to 5e-11.
///
/// The two upper bits choose the quadrant; the rest, centred, is an angle within pi/4, for which
/// minimax polynomials serve. The shift by an eighth turn does not matter: all angles are alike.
#[inline(always)]
fn sine_cosine(n: u64) -> (f64, f64) {
    const QUARTER: u64 = 1 << 30;
    const SIGN: u64 = 1 << 63;
    let quadrant = n >> 30;
    let angle = (small_to_f64(n & (QUARTER - 1)) + 0.5 - small_to_f64(QUARTER / 2))
        * (std::f64::consts::TAU / 4_294_967_296.0);
    let z = angle * angle;
    let sine = angle
        * horner(
            z,
            [
                0.999_999_999_995_682,
                -0.166_666_666_316_359_87,
                0.008_333_328_786_079_897,
                -0.000_198_392_031_505_040_26,
                2.717_353_284_213_686e-6,
            ],
        );
    let cosine = horner(
        z,
        [
            0.999_999_999_952_601_9,
            -0.499_999_996_154_366_85,
            0.041_666_616_739_328_98,
            -0.001_388_661_921_141_482,
            2.437_992_933_703_376e-5,
        ],
    );
    // A quadrant further, (cos, sin) becomes (-sin, cos).
    let odd = (quadrant & 1).wrapping_neg();
    let (sine_bits, cosine_bits) = (sine.to_bits(), cosine.to_bits());
    let swap = (sine_bits ^ cosine_bits) & odd;
    let flip_sine = (quadrant << 62) & SIGN;
    let flip_cosine = ((quadrant + 1) << 62) & SIGN;
    (
        f64::from_bits((sine_bits ^ swap) ^ flip_sine),
        f64::from_bits((cosine_bits ^ swap) ^ flip_cosine),
    )
}

/// A polynomial, with fused multiply-adds: exactly rounded, so alike on every machine.
#[inline(always)]
fn horner(x: f64, coefficients: [f64; 5]) -> f64 {
    let [a, b, c, d, e] = coefficients;
    e.mul_add(x, d).mul_add(x, c).mul_add(x, b).mul_add(x, a)
}

/// An integer below 2^52 as a float, by its bits: baseline vector units have no such conversion.
#[inline(always)]
fn small_to_f64(n: u64) -> f64 {
    const TWO_52: f64 = 4_503_599_627_370_496.0;
    f64::from_bits(n | TWO_52.to_bits()) - TWO_52
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of Random123 (`kat_vectors`, philox4x32 10).
    #[test]
    fn philox_is_philox4x32_10() {
        let words = |seed, run, block| philox(seed, run, block).map(|word| word[0]);
        assert_eq!(
            words(0, 0, 0),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            words(u64::MAX, u64::MAX, u64::MAX),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            words(
                0x299f_31d0_a409_3822,
                0x85a3_08d3_243f_6a88,
                0x0370_7344_1319_8a2e
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn the_polynomials_are_the_functions() {
        for step in 0..100_000_u64 {
            let n = step * 42_949 + step % 7;
            let x = (n as f64 + 0.5) / 4_294_967_296.0;
            let logarithm_apart = (logarithm(n) - x.ln()).abs();
            assert!(logarithm_apart < 1e-11, "{n}: {logarithm_apart}");
            let (sine, cosine) = sine_cosine(n);
            let angle = std::f64::consts::TAU * (x - 0.125);
            assert!((sine - angle.sin()).abs() < 1e-10, "{n}");
            assert!((cosine - angle.cos()).abs() < 1e-10, "{n}");
        }
        // The ends of the range.
        for n in [0, u64::from(u32::MAX)] {
            let x = (n as f64 + 0.5) / 4_294_967_296.0;
            assert!((logarithm(n) - x.ln()).abs() < 1e-10);
        }
    }

    #[test]
    fn a_run_has_the_same_numbers_wherever_it_is_drawn() {
        let mut here = [[0.0; LANES]; 10];
        let mut there = [[0.0; LANES]; 10];
        fill_normals(Stream::Noise, 5, 1000, &mut here);
        fill_normals(Stream::Noise, 5, 1003, &mut there);
        for (one, other) in here.iter().zip(&there) {
            assert_eq!(one[3..], other[..LANES - 3]);
        }
        fill_normals(Stream::Compliances, 5, 1000, &mut there);
        for (one, other) in here.iter().zip(&there) {
            assert!((one[0] - other[0]).abs() > 0.0);
        }
    }

    /// Mean, variance, skewness and kurtosis of a million numbers, each within five standard
    /// errors; and neighbours, which share a radius, are uncorrelated.
    #[test]
    fn the_numbers_are_normal() {
        let mut normals = vec![[0.0; LANES]; 4 * 31_250];
        fill_normals(Stream::Noise, 1, 0, &mut normals);
        let count = (normals.len() * LANES) as f64;
        let moment = |power: i32| {
            let sum: f64 = normals.as_flattened().iter().map(|x| x.powi(power)).sum();
            sum / count
        };
        let error = |variance: f64| 5.0 * (variance / count).sqrt();
        assert!(moment(1).abs() < error(1.0));
        assert!((moment(2) - 1.0).abs() < error(2.0));
        assert!(moment(3).abs() < error(15.0));
        assert!((moment(4) - 3.0).abs() < error(96.0));
        let product: f64 = normals
            .chunks_exact(2)
            .flat_map(|pair| pair[0].iter().zip(&pair[1]).map(|(a, b)| a * b))
            .sum();
        assert!((product / (count / 2.0)).abs() < 5.0 / (count / 2.0).sqrt());
    }
}
