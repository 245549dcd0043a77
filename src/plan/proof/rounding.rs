//! What double precision can lose, bounded: one place for every rounding term.

/// The relative error of one operation: half the distance from 1 to the next double.
pub(super) const UNIT: f64 = f64::EPSILON / 2.0;
/// A sum of products of numbers that are not negative, in at most 120 roundings one after another,
/// times this is not below its true value.
pub(super) const UP: f64 = 1.0 + 128.0 * UNIT;
/// More than underflow can take from a sum of fewer than 1e6 products.
pub(super) const UNDERFLOW: f64 = 1e-290;
/// [`sin_cos`] is that near to sine and cosine.
pub(super) const SIN_COS_ERROR: f64 = 8.0 * UNIT;
/// The largest angle (rad) that [`sin_cos`] takes.
pub(super) const LARGEST_ANGLE: f64 = 60.0;

/// pi/2 in two parts; the first has 33 bits.
const HALF_PI: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];

/// Sine and cosine of an angle of at most [`LARGEST_ANGLE`], to within [`SIN_COS_ERROR`].
///
/// The quarters (at most 39, six bits) times the first part of pi/2 are exact, and so is their
/// difference to the angle, which is of their size (Sterbenz). The second part, its product and the last
/// difference are off by less than one `UNIT` together, as |r| < 0.8. The series end after r^17 and
/// r^16, the next terms are below 1e-17, and rounding adds less than four `UNIT`.
pub(super) fn sin_cos(angle: f64) -> (f64, f64) {
    let quarters = (angle / std::f64::consts::FRAC_PI_2).round();
    let r = (angle - quarters * HALF_PI[0]) - quarters * HALF_PI[1];
    let y = r * r;
    let (mut odd, mut even) = (0.0, 0.0);
    for k in (1..=8).rev() {
        let twice = f64::from(2 * k);
        odd = (1.0 + odd) * (-y / (twice * (twice + 1.0)));
        even = (1.0 + even) * (-y / (twice * (twice - 1.0)));
    }
    let (sine, cosine) = (r + r * odd, 1.0 + even);
    match quarters.rem_euclid(4.0) {
        1.0 => (cosine, -sine),
        2.0 => (-sine, -cosine),
        3.0 => (-cosine, sine),
        _ => (sine, cosine),
    }
}

/// cos(hx) and sin(hx) over -1 <= x <= 1 as polynomials of degree 2, by the Jacobi-Anger series
///
/// ```text
/// cos(hx) = J0(h) - 2 J2(h) T2(x) + 2 J4(h) T4(x) - ...
/// sin(hx) = 2 J1(h) T1(x) - 2 J3(h) T3(x) + ...
/// ```
///
/// whose terms beyond T2 are bounded by |`J_n(h)`| <= (h/2)^n / n!.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Waves {
    /// The coefficients of 1 and T2 of the cosine.
    pub cosine: [f64; 2],
    /// The coefficient of T1 of the sine.
    pub sine: f64,
    /// What the polynomials may be off by.
    pub cosine_error: f64,
    pub sine_error: f64,
}

impl Waves {
    /// For half-widths h >= 0 (rad); beyond 2 rad nothing is known but that both are within 1.
    pub fn new(h: f64) -> Self {
        if h.is_nan() || h > 2.0 {
            return Self {
                cosine: [0.0; 2],
                sine: 0.0,
                cosine_error: 1.0,
                sine_error: 1.0,
            };
        }
        let z = h / 2.0;
        let [j0, j1, j2] = [0, 1, 2].map(|order| bessel(order, z));
        // The terms that are left out fall at least as fast as a geometric series.
        let y = z * z;
        let cosine = y * y / 12.0 / (1.0 - y / 30.0) * UP;
        let sine = z * y / 3.0 / (1.0 - y / 20.0) * UP;
        Self {
            cosine: [j0.0, -2.0 * j2.0],
            sine: 2.0 * j1.0,
            cosine_error: (cosine + j0.1 + 2.0 * j2.1) * UP,
            sine_error: (sine + 2.0 * j1.1) * UP,
        }
    }
}

/// `J_n(2z)`, the sum of (-1)^k z^(2k + n) / (k! (k + n)!), for 0 <= z <= 1, with its error: the term
/// left out first is below 1e-19 of the first, the others have at most 50 roundings each.
fn bessel(order: u8, z: f64) -> (f64, f64) {
    let n = f64::from(order);
    let mut term = 1.0;
    for k in 1..=order {
        term *= z / f64::from(k);
    }
    let (mut sum, mut size) = (term, term);
    for k in 1..=12_u8 {
        let k = f64::from(k);
        term *= -(z * z) / (k * (k + n));
        sum += term;
        size += term.abs();
    }
    (sum, 128.0 * UNIT * size + UNDERFLOW)
}
