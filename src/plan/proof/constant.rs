//! Constants of the chain, known to within an error.
#![expect(clippy::float_cmp, reason = "what is exact is told apart")]

use super::rounding::{UNIT, UP};

/// A number and what it may be off by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Constant {
    pub value: f64,
    pub error: f64,
}

/// Columns of a rotation matrix.
pub(super) type Rotation = [[Constant; 3]; 3];

impl Constant {
    pub const fn exact(value: f64) -> Self {
        Self { value, error: 0.0 }
    }

    /// Whether it is exactly this.
    pub fn is(self, value: f64) -> bool {
        self.error == 0.0 && self.value == value
    }
}

pub(super) const IDENTITY: Rotation = {
    let [zero, one] = [Constant::exact(0.0), Constant::exact(1.0)];
    [[one, zero, zero], [zero, one, zero], [zero, zero, one]]
};

/// A vector of exact numbers.
pub(super) fn vector(values: [f64; 3]) -> [Constant; 3] {
    values.map(Constant::exact)
}

/// a . b, exact where every product has a factor 0, 1 or -1 and no two of them are left.
fn dot(a: &[Constant; 3], b: &[Constant; 3]) -> Constant {
    let trivial = |x: Constant| x.error == 0.0 && (x.value == 1.0 || x.value == -1.0);
    let mut terms = 0;
    let mut plain = true;
    let (mut value, mut error, mut size) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (a, b) in a.iter().zip(b) {
        if a.is(0.0) || b.is(0.0) {
            continue;
        }
        terms += 1;
        plain &= trivial(*a) || trivial(*b);
        value += a.value * b.value;
        size += (a.value * b.value).abs();
        error += a.value.abs() * b.error + a.error * (b.value.abs() + b.error);
    }
    if terms <= 1 && plain {
        // One product with a factor of 1 or -1: its error is that of the other factor.
        return Constant {
            value,
            error: error * if error > 0.0 { UP } else { 1.0 },
        };
    }
    Constant {
        value,
        error: (error + 4.0 * UNIT * size) * UP,
    }
}

pub(super) fn transposed(rotation: &Rotation) -> Rotation {
    std::array::from_fn(|column| std::array::from_fn(|row| rotation[row][column]))
}

/// The rotation times a vector.
pub(super) fn turned(rotation: &Rotation, vector: &[Constant; 3]) -> [Constant; 3] {
    let rows = transposed(rotation);
    std::array::from_fn(|row| dot(&rows[row], vector))
}

pub(super) fn product(one: &Rotation, other: &Rotation) -> Rotation {
    std::array::from_fn(|column| turned(one, &other[column]))
}

/// Whether it is exactly a permutation of the axes with signs.
pub(super) fn is_permutation(rotation: &Rotation) -> bool {
    rotation
        .iter()
        .flatten()
        .all(|each| each.is(0.0) || each.is(1.0) || each.is(-1.0))
}

/// The rotation of a quaternion (x, y, z, w) of any length but zero. Those of the 24 rotations that permute the axes
/// are exact: all of the quaternion's numbers that are not zero have the same size then.
pub(super) fn rotation_of([x, y, z, w]: [f64; 4]) -> Rotation {
    let all = [x, y, z, w];
    let largest = all.iter().fold(0.0_f64, |most, each| most.max(each.abs()));
    let same = |each: &&f64| each.abs() == largest;
    let others = all.iter().filter(|each| **each != 0.0).count();
    let exact = others != 3 && all.iter().filter(same).count() == others;
    let [x, y, z, w] = if exact {
        all.map(|each| each / largest)
    } else {
        all
    };
    // Exact for whole numbers.
    let squared = x * x + y * y + z * z + w * w;
    let entry = |value: f64| Constant {
        value: value / squared,
        // Ten roundings of terms that add up to at most twice the quaternion's square.
        error: if exact { 0.0 } else { 32.0 * UNIT },
    };
    [
        [
            entry(w * w + x * x - y * y - z * z),
            entry(2.0 * (x * y + w * z)),
            entry(2.0 * (x * z - w * y)),
        ],
        [
            entry(2.0 * (x * y - w * z)),
            entry(w * w - x * x + y * y - z * z),
            entry(2.0 * (y * z + w * x)),
        ],
        [
            entry(2.0 * (x * z + w * y)),
            entry(2.0 * (y * z - w * x)),
            entry(w * w - x * x - y * y + z * z),
        ],
    ]
}

/// Which coordinate axis a vector lies along exactly, and on which side.
pub(super) fn coordinate_axis(vector: &[Constant; 3]) -> Option<(usize, f64)> {
    let along: Vec<usize> = (0..3).filter(|&k| !vector[k].is(0.0)).collect();
    match *along.as_slice() {
        [k] if vector[k].error == 0.0 => Some((k, vector[k].value.signum())),
        _ => None,
    }
}

/// A rotation that turns the z axis to a direction: half a turn about the line between both. Rounding in that line turns it
/// by less than 10 `UNIT`, which the errors of [`rotation_of`] cover beside their own 8.
pub(super) fn towards([x, y, z]: [f64; 3]) -> Rotation {
    let length = (x * x + y * y + z * z).sqrt();
    let [x, y, z] = [x / length, y / length, z / length];
    if z > -0.5 {
        rotation_of([x, y, 1.0 + z, 0.0])
    } else {
        // Half a turn about x first, then from -z to the direction.
        let from_below = rotation_of([x, y, z - 1.0, 0.0]);
        product(&from_below, &rotation_of([1.0, 0.0, 0.0, 0.0]))
    }
}
