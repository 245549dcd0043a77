//! The arithmetic of [Taylor models](super::taylor): the numbers of one model, and sums of products of such.

use multiversion::multiversion;

use super::rounding::UP;

/// Boxes that are looked at side by side.
pub(super) const LANES: usize = 8;
/// One number for each of them.
pub(super) type Lanes = [f64; LANES];

pub(super) const ZERO: Lanes = [0.0; LANES];

/// The largest number of variables.
pub(super) const VARIABLES: usize = 8;
/// The coefficients of so many variables.
pub(super) const COEFFICIENTS: usize = linear(VARIABLES);

/// Where the coefficient of `x_j` stands. Behind it stand those of `x_i x_j` (i < j) and T2(`x_j`).
pub(super) const fn linear(j: usize) -> usize {
    1 + j * (j + 3) / 2
}

/// Where the coefficient of `x_i x_j` stands, i <= j; for i = j that of T2(`x_j`).
pub(super) const fn second(i: usize, j: usize) -> usize {
    linear(j) + 1 + i
}

/// The number of products of three of so many variables: T3(`x_i`), T2(`x_i`) `x_j` and `x_i x_j x_k`.
pub(super) const fn thirds(variables: usize) -> usize {
    variables * (variables + 1) * (variables + 2) / 6
}

/// Where the coefficient of the third order of `x_i`, `x_j` and `x_k` stands: T2 of one that is there twice, T3 of one that is
/// there three times.
static THIRD: [[[u8; VARIABLES]; VARIABLES]; VARIABLES] = {
    let mut places = [[[0; VARIABLES]; VARIABLES]; VARIABLES];
    let (mut k, mut next) = (0, 0);
    while k < VARIABLES {
        let mut j = 0;
        while j <= k {
            let mut i = 0;
            while i <= j {
                let mut turn = 0;
                while turn < 3 {
                    places[i][j][k] = next;
                    places[k][j][i] = next;
                    (i, j, k) = (j, k, i);
                    turn += 1;
                }
                next += 1;
                i += 1;
            }
            j += 1;
        }
        k += 1;
    }
    places
};

/// Where the numbers of one model stand, for n variables.
#[derive(Debug, Clone, Copy)]
pub(super) struct ModelLayout {
    pub variables: usize,
}

impl ModelLayout {
    pub const fn remainder(self) -> usize {
        linear(self.variables)
    }
    /// Bounds of |constant|, of the linear part and of the part of second order.
    pub const fn sizes(self) -> usize {
        self.remainder() + 1
    }
    /// For each variable, a bound of the part of second order less half of the terms with that variable.
    pub const fn unfolded(self) -> usize {
        self.sizes() + 3
    }
    /// While a sum is made: a bound of all that was added.
    pub const fn magnitude(self) -> usize {
        self.unfolded() + self.variables
    }
    pub const fn length(self) -> usize {
        self.magnitude() + 1
    }
}

/// Bounds the parts of a model: |constant|, the linear part, the part of second order, and, for each variable, the
/// latter less half of its terms.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2", "aarch64+neon"))]
pub(super) fn measure(layout: ModelLayout, model: &mut [Lanes], [first, last]: [usize; 2]) {
    let (coefficients, rest) = model.split_at_mut(layout.remainder());
    let (mut slope, mut bend) = (ZERO, ZERO);
    let mut rows = [ZERO; VARIABLES];
    for j in first..last {
        let block = &coefficients[linear(j)..linear(j + 1)];
        for lane in 0..LANES {
            slope[lane] += block[0][lane].abs();
        }
        for i in first..=j {
            let value = &block[1 + i];
            for lane in 0..LANES {
                let value = value[lane].abs();
                bend[lane] += value;
                rows[i][lane] += value;
                if i < j {
                    rows[j][lane] += value;
                }
            }
        }
    }
    for lane in 0..LANES {
        slope[lane] *= UP;
        bend[lane] *= UP;
    }
    let sizes = layout.sizes() - layout.remainder();
    rest[sizes] = coefficients[0].map(f64::abs);
    rest[sizes + 1] = slope;
    rest[sizes + 2] = bend;
    for (row, unfolded) in rows
        .iter()
        .zip(&mut rest[sizes + 3..])
        .skip(first)
        .take(last - first)
    {
        for lane in 0..LANES {
            unfolded[lane] = bend[lane] - 0.5 * row[lane];
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2", "aarch64+neon"))]
pub(super) fn add_scaled(
    layout: ModelLayout,
    sum: &mut [Lanes],
    (factor, error): (&Lanes, f64),
    model: &[Lanes],
    [first, last]: [usize; 2],
) {
    for lane in 0..LANES {
        sum[0][lane] += factor[lane] * model[0][lane];
    }
    for j in first..last {
        for k in std::iter::once(linear(j)).chain(second(first, j)..=second(j, j)) {
            let (sum, model) = (&mut sum[k], &model[k]);
            for lane in 0..LANES {
                sum[lane] += factor[lane] * model[lane];
            }
        }
    }
    let (remainder, sizes) = (layout.remainder(), layout.sizes());
    for lane in 0..LANES {
        let size = model[sizes][lane] + model[sizes + 1][lane] + model[sizes + 2][lane];
        let inside = model[remainder][lane];
        sum[remainder][lane] += factor[lane].abs() * inside + error * (size + inside);
        sum[layout.magnitude()][lane] += factor[lane].abs() * size;
    }
}

/// Adds a product: of one model with itself, or of one with another that may have no part of second order.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2", "aarch64+neon"))]
pub(super) fn add_product(
    layout: ModelLayout,
    (sum, third): (&mut [Lanes], &mut [Lanes]),
    sign: f64,
    (one, one_range): (&[Lanes], [usize; 2]),
    (other, other_range): (&[Lanes], [usize; 2]),
    [is_square, is_linear]: [bool; 2],
) {
    let twice = if is_square { 2.0 * sign } else { sign };
    let mut constant = ZERO;
    for lane in 0..LANES {
        constant[lane] = one[0][lane] * other[0][lane];
    }
    add_constant_times(sum, twice, &one[0], other, other_range);
    if !is_square {
        add_constant_times(sum, sign, &other[0], one, one_range);
    }
    for i in one_range[0]..one_range[1] {
        let slope = one[linear(i)];
        let first = if is_square { i } else { other_range[0] };
        for j in first..other_range[1] {
            let factor = &other[linear(j)];
            let place = second(i.min(j), i.max(j));
            if i == j {
                // x^2 = (1 + T2(x)) / 2
                for lane in 0..LANES {
                    let product = 0.5 * (slope[lane] * factor[lane]);
                    constant[lane] += product;
                    sum[place][lane] += sign * product;
                }
            } else {
                for lane in 0..LANES {
                    sum[place][lane] += twice * (slope[lane] * factor[lane]);
                }
            }
        }
    }
    for lane in 0..LANES {
        sum[0][lane] += sign * constant[lane];
    }
    if !is_square && !is_linear {
        add_third(sum, third, sign, (one, one_range), (other, other_range));
    }
    add_third(sum, third, twice, (other, other_range), (one, one_range));
    let (remainder, sizes) = (layout.remainder(), layout.sizes());
    for lane in 0..LANES {
        let size =
            |model: &[Lanes]| model[sizes][lane] + model[sizes + 1][lane] + model[sizes + 2][lane];
        let (one_size, other_size) = (size(one), size(other));
        let (one_rest, other_rest) = (one[remainder][lane], other[remainder][lane]);
        sum[remainder][lane] += one[sizes + 2][lane] * other[sizes + 2][lane]
            + one_rest * (other_size + other_rest)
            + one_size * other_rest;
        sum[layout.magnitude()][lane] += one_size * other_size;
    }
}

/// Adds sign times a constant times all of a model but its constant.
#[inline(always)]
fn add_constant_times(
    sum: &mut [Lanes],
    sign: f64,
    constant: &Lanes,
    model: &[Lanes],
    [first, last]: [usize; 2],
) {
    for j in first..last {
        for k in std::iter::once(linear(j)).chain(second(first, j)..=second(j, j)) {
            let (sum, model) = (&mut sum[k], &model[k]);
            for lane in 0..LANES {
                sum[lane] += sign * constant[lane] * model[lane];
            }
        }
    }
}

/// Adds so many times the linear part of one with the part of second order of the other: x T2(x) = (x + T3(x))/2, `x_i (x_i x_j)` =
/// (`x_j` + `x_j T2(x_i)`)/2.
#[inline(always)]
fn add_third(
    sum: &mut [Lanes],
    third: &mut [Lanes],
    factor: f64,
    (one, [one_first, one_last]): (&[Lanes], [usize; 2]),
    (other, [other_first, other_last]): (&[Lanes], [usize; 2]),
) {
    for i in one_first..one_last {
        let slope = one[linear(i)].map(|slope| factor * slope);
        for j in other_first..other_last {
            for k in other_first..=j {
                let bend = &other[second(k, j)];
                let place = &mut third[usize::from(THIRD[i][j][k])];
                if i != j && i != k {
                    for lane in 0..LANES {
                        place[lane] += slope[lane] * bend[lane];
                    }
                } else {
                    // What stays linear is that of the other of the two.
                    let sum = &mut sum[linear(j + k - i)];
                    for lane in 0..LANES {
                        let half = 0.5 * (slope[lane] * bend[lane]);
                        place[lane] += half;
                        sum[lane] += half;
                    }
                }
            }
        }
    }
}
