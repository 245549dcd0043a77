//! Residuals in whitened rows, with the derivatives by the fit's parameters and by what else they may correlate with.

use nalgebra::{DMatrix, DVector, Matrix6xX, SymmetricEigen, Vector6, stack};

use crate::robot::{Drive, SerialChain};

/// Directions of parameters that readings see with less than this share of the best seen one are none.
const UNSEEN: f64 = 1e-10;

/// One reading.
#[derive(Debug, Clone)]
pub struct ReadingRows {
    /// Whitened, read less predicted.
    pub residual: Vector6<f64>,
    /// What the fitted parameters do (6 x p).
    pub fitted: Matrix6xX<f64>,
    /// What would be seen if each joint turned further by one (rad or m; 6 x n); of deflections, by its compliance further by one.
    pub moved: Matrix6xX<f64>,
    /// What each joint's compliance does (6 x n).
    pub bent: Matrix6xX<f64>,
    /// A shift of the station's frame along each of its axes by one (m), a growth about the robot's base by one (1), and an
    /// error along the line of sight by one (m): 6 x 5. None of deflections but for the shift.
    pub placed: Matrix6xX<f64>,
    /// The joint angles (rad).
    pub angles: DVector<f64>,
    /// The joints' torques (N m).
    pub torques: Vec<f64>,
    /// The signs of approach, where they are known.
    pub approach: Option<Vec<bool>>,
    /// The distance from the instrument (m), where there is one.
    pub range_m: Option<f64>,
    /// When it was read (s).
    pub time_s: Option<f64>,
    /// How warm it was (deg C).
    pub temperature_c: Option<f64>,
    /// Which rows there are: 3 or 6, or 1 along a direction.
    pub count: usize,
    /// Its block of joint space.
    pub block: usize,
}

/// What a column is a multiple of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Base {
    Moved(usize),
    Bent(usize),
    Placed(usize),
}

impl Base {
    pub fn of(self, reading: &ReadingRows) -> Vector6<f64> {
        let (rows, place): (&Matrix6xX<f64>, usize) = match self {
            Self::Moved(joint) => (&reading.moved, joint),
            Self::Bent(joint) => (&reading.bent, joint),
            Self::Placed(place) => (&reading.placed, place),
        };
        rows.column(place).into_owned()
    }
}

/// All readings.
#[derive(Debug, Clone)]
pub struct LookedAt {
    /// The readings in their order.
    pub readings: Vec<ReadingRows>,
    /// The joints' names, and how each moves.
    pub joints: Vec<(String, Drive)>,
    /// Whether deflections were read.
    pub is_of_deflections: bool,
}

impl LookedAt {
    /// Readings of an arm.
    pub fn new(chain: &SerialChain, readings: Vec<ReadingRows>, is_of_deflections: bool) -> Self {
        let joints = chain.joints.iter();
        Self {
            readings,
            joints: (joints.map(|joint| (joint.name.clone(), joint.drive))).collect(),
            is_of_deflections,
        }
    }
}

/// The directions that a fit goes through, orthonormal over the rows of all readings (six of each), and what is left beside them.
pub(super) struct Projected {
    /// r x 6 N.
    pub directions: DMatrix<f64>,
    pub left: DVector<f64>,
    /// The rows less all directions.
    pub spare: usize,
}

impl Projected {
    pub fn new(looked: &LookedAt) -> Self {
        let readings = &looked.readings;
        let size = readings.first().map_or(0, |each| each.fitted.ncols());
        let mut fitted = DMatrix::zeros(6 * readings.len(), size);
        for (index, each) in readings.iter().enumerate() {
            fitted.rows_mut(6 * index, 6).copy_from(&each.fitted);
        }
        let left = readings
            .iter()
            .flat_map(|each| <[f64; 6]>::from(each.residual));
        let products = fitted.tr_mul(&fitted);
        let combinations = orthonormal(&products, &products, |largest| UNSEEN * largest);
        let mut projected = Self {
            directions: DMatrix::zeros(0, 6 * readings.len()),
            left: DVector::from_iterator(6 * readings.len(), left),
            spare: readings.iter().map(|each| each.count).sum(),
        };
        if let Some(combinations) = combinations {
            projected.add(&(fitted * combinations));
        }
        projected
    }

    /// Takes orthonormal directions (6 N x d) out of what is left.
    pub fn add(&mut self, directions: &DMatrix<f64>) {
        self.directions = stack![self.directions; directions.transpose()];
        self.spare = self.spare.saturating_sub(directions.ncols());
        self.left -= directions * directions.tr_mul(&self.left);
    }
}

/// Combinations of columns that are orthonormal, from the products of the columns (p x p) that are as long as the diagonal of `whole`
/// says: those that are longer than `least` makes of the longest. None where there is none.
pub(super) fn orthonormal(
    products: &DMatrix<f64>,
    whole: &DMatrix<f64>,
    least: impl Fn(f64) -> f64,
) -> Option<DMatrix<f64>> {
    let scale = whole.diagonal().map(|square| {
        if square > 0.0 {
            square.sqrt().recip()
        } else {
            0.0
        }
    });
    let scaled = products.component_mul(&(&scale * scale.transpose()));
    if scaled.is_empty() || !scaled.iter().all(|value| value.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(scaled);
    let least = least(eigen.eigenvalues.max());
    let kept = (eigen.eigenvalues.iter()).zip(eigen.eigenvectors.column_iter());
    let columns: Vec<DVector<f64>> = kept
        .filter(|(value, _)| **value > least)
        .map(|(value, vector)| vector.component_mul(&scale) / value.sqrt())
        .collect();
    (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
}
