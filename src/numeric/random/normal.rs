//! Normal random numbers by the hundred: a function of (seed, run) alone, many at a time.
//!
//! Philox4x32-10 (Salmon et al., SC 2011) is a counter-based generator: the numbers of run r are the
//! cipher of the counters (r, 0), (r, 1), ... under the seed. Each block of four 32-bit words becomes
//! two pairs of normals by Box and Muller's transform, in double precision with branch-free
//! polynomials, so that the compiler can do several runs in one instruction. It is made in three
//! passes, each over many blocks in place: short chains of operations keep a processor busier than
//! long ones. Only operations are used that IEEE 754 rounds alike on every machine.

use multiversion::multiversion;

use super::streams::Stream;

/// Runs that are drawn at a time.
pub const LANES: usize = 8;

/// The multipliers and key increments of Philox4x32.
const MULTIPLIERS: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u64; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;
const LOW: u64 = 0xFFFF_FFFF;

/// Four 32-bit words for each of [`LANES`] runs.
type Words = [[u64; LANES]; 4];
/// What becomes of them: words as bits, then two radii and two words, then four normals.
type Block = [[f64; LANES]; 4];
/// Blocks that go through the passes together: they stay in the first-level cache.
const BLOCKS: usize = 16;

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
    let keys = round_keys(seed);
    let (blocks, rest) = normals.as_chunks_mut::<4>();
    let mut index = first_block;
    for blocks in blocks.chunks_mut(BLOCKS) {
        fill_blocks(&keys, first_run, index, blocks);
        index += blocks.len() as u64;
    }
    if !rest.is_empty() {
        let mut last = [Block::default()];
        fill_blocks(&keys, first_run, index, &mut last);
        rest.copy_from_slice(&last[0][..rest.len()]);
    }
}

#[inline(always)]
fn fill_blocks(keys: &[[u64; 2]; ROUNDS], first_run: u64, first_block: u64, blocks: &mut [Block]) {
    for (index, block) in (first_block..).zip(&mut *blocks) {
        let words = philox(keys, first_run, index);
        for (row, word) in block.iter_mut().zip(&words) {
            for lane in 0..LANES {
                row[lane] = f64::from_bits(word[lane]);
            }
        }
    }
    words_to_radii(blocks);
    turn(blocks);
}

/// The key of each round. Only the lower halves count; what is above them keeps the compiler from
/// taking 64-bit products for possible.
fn round_keys(seed: u64) -> [[u64; 2]; ROUNDS] {
    let mut key = [seed, seed >> 32];
    std::array::from_fn(|_| {
        let now = key;
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
        now
    })
}

/// The words of block `index` of [`LANES`] consecutive runs.
#[expect(clippy::needless_range_loop, reason = "four arrays side by side")]
#[inline(always)]
fn philox(keys: &[[u64; 2]; ROUNDS], first_run: u64, index: u64) -> Words {
    let mut x = [[0; LANES]; 4];
    for lane in 0..LANES {
        let run = first_run.wrapping_add(lane as u64);
        x[0][lane] = run & LOW;
        x[1][lane] = run >> 32;
        x[2][lane] = index & LOW;
        x[3][lane] = index >> 32;
    }
    for key in keys {
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
    }
    for lane in 0..LANES {
        x[0][lane] &= LOW;
        x[2][lane] &= LOW;
    }
    x
}

/// The first two words of each block become radii: sqrt(-ln u), with u of [`minus_logarithm`].
#[inline(always)]
fn words_to_radii(blocks: &mut [Block]) {
    for [first, second, _, _] in blocks {
        for row in [first, second] {
            for x in row {
                *x = minus_logarithm(x.to_bits()).sqrt();
            }
        }
    }
}

/// Each radius and the word two places further become two normals.
#[inline(always)]
fn turn(blocks: &mut [Block]) {
    for block in blocks {
        let (radii, words) = block.split_at_mut(2);
        let words = words.as_flattened_mut();
        for (one, other) in radii.as_flattened_mut().iter_mut().zip(words) {
            let radius = *one;
            let (x, y) = direction(other.to_bits());
            *one = radius * x;
            *other = radius * y;
        }
    }
}

/// -ln((n + 1/2) / 2^32) for a 32-bit n, to 7e-10 of itself or 1e-15.
///
/// The number is split into 2^e m with m in [sqrt(1/2), sqrt(2)); then -ln m = 2 artanh(s) with
/// s = (1 - m)/(1 + m), for which a minimax polynomial in s^2 < 0.0295 is good to 7e-10.
#[inline(always)]
fn minus_logarithm(n: u64) -> f64 {
    const SQRT_HALF_BITS: u64 = 0x3FE6_A09E_667F_3BCD;
    const ONE_BITS: u64 = 0x3FF0_0000_0000_0000;
    const MANTISSA: u64 = 0x000F_FFFF_FFFF_FFFF;
    let x = small_to_f64(2 * n + 1);
    let shifted = x.to_bits().wrapping_add(ONE_BITS - SQRT_HALF_BITS);
    let minus_exponent =
        (TWO_52 + 1023.0 + 33.0) - f64::from_bits((shifted >> 52) | TWO_52.to_bits());
    let m = f64::from_bits((shifted & MANTISSA) + SQRT_HALF_BITS);
    let s = (1.0 - m) / (1.0 + m);
    let series = polynomial(
        s * s,
        [
            1.999_999_998_621_330_2,
            0.666_668_159_508_678_5,
            0.399_747_949_231_950_4,
            0.299_256_507_418_927_9,
        ],
    );
    minus_exponent.mul_add(std::f64::consts::LN_2, s * series)
}

/// The point of a circle of radius sqrt(2) that a 32-bit number chooses, to 6e-9.
///
/// The lower 30 bits are an angle t within pi/4: (cos t + sin t, cos t - sin t) is a point of the
/// first quadrant, by minimax polynomials in the share x of the quadrant, t = x pi/2. The upper two
/// bits are the coordinates' signs.
#[inline(always)]
fn direction(n: u64) -> (f64, f64) {
    const SIGN: u64 = 1 << 63;
    // Bits 30 and 31 fall on bits that are set.
    let x = f64::from_bits((n << 22) | 1.0_f64.to_bits()) - (1.5 - 1.0 / 2_147_483_648.0);
    let z = x * x;
    let sine = x * polynomial(
        z,
        [
            1.570_796_321_708_342_3,
            -0.645_963_460_233_250_9,
            0.079_680_032_769_168_41,
            -0.004_601_657_888_985_372,
        ],
    );
    let cosine = polynomial(
        z,
        [
            0.999_999_999_943_937_4,
            -1.233_700_539_564_757_8,
            0.253_669_182_596_086_5,
            -0.020_859_936_028_382_615,
            0.000_903_362_977_270_575_1,
        ],
    );
    let with_sign = |x: f64, sign: u64| f64::from_bits(x.to_bits() ^ (sign & SIGN));
    (
        with_sign(cosine + sine, n << 32),
        with_sign(cosine - sine, n << 33),
    )
}

/// A polynomial, with fused multiply-adds: exactly rounded, so alike on every machine.
#[inline(always)]
fn polynomial<const N: usize>(x: f64, coefficients: [f64; N]) -> f64 {
    let mut sum = coefficients[N - 1];
    for coefficient in coefficients[..N - 1].iter().rev() {
        sum = sum.mul_add(x, *coefficient);
    }
    sum
}

const TWO_52: f64 = 4_503_599_627_370_496.0;

/// An integer below 2^52 as a float, by its bits: baseline vector units have no such conversion.
#[inline(always)]
fn small_to_f64(n: u64) -> f64 {
    f64::from_bits(n | TWO_52.to_bits()) - TWO_52
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of Random123 (`kat_vectors`, philox4x32 10).
    #[test]
    fn philox_is_philox4x32_10() {
        let words = |seed, run, index| philox(&round_keys(seed), run, index).map(|word| word[0]);
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
        let steps = (0..100_000_u64).map(|step| step * 42_949 + step % 7);
        // The ends of the range, too.
        for n in steps.chain([0, 1, u64::from(u32::MAX) - 1, u64::from(u32::MAX)]) {
            let expected = -((n as f64 + 0.5) / 4_294_967_296.0).ln();
            let apart = (minus_logarithm(n) - expected).abs();
            assert!(apart < 7e-10 * expected + 1e-15, "{n}: {apart}");
            assert!(minus_logarithm(n) > 0.0, "{n}");

            let quadrant = 1 << 30;
            let share = ((n % quadrant) as f64 + 0.5) / quadrant as f64;
            let t = (share - 0.5) * std::f64::consts::FRAC_PI_2;
            let sign = |bit: u32| if n >> bit & 1 == 1 { -1.0 } else { 1.0 };
            let (x, y) = direction(n);
            assert!((x - sign(31) * (t.cos() + t.sin())).abs() < 6e-9, "{n}");
            assert!((y - sign(30) * (t.cos() - t.sin())).abs() < 6e-9, "{n}");
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
        let mut more = [[0.0; LANES]; 70];
        fill_normals(Stream::Noise, 5, 1000, &mut more);
        assert_eq!(here, more[..here.len()]);
        fill_normals(Stream::Compliances, 5, 1000, &mut there);
        for (one, other) in here.iter().zip(&there) {
            assert!((one[0] - other[0]).abs() > 0.0);
        }
    }

    /// Mean, variance, skewness and kurtosis of a million numbers, each within five standard
    /// errors; and numbers two places apart, which share a radius or an angle, are uncorrelated.
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
            .as_chunks::<4>()
            .0
            .iter()
            .flat_map(|[a, b, c, d]| [(a, c), (b, d)])
            .flat_map(|(one, other)| one.iter().zip(other).map(|(a, b)| a * b))
            .sum();
        assert!((product / (count / 2.0)).abs() < 5.0 / (count / 2.0).sqrt());
    }
}
