//! Residuals in whitened rows, with the derivatives by the fit's parameters and by other candidates.

use nalgebra::{DMatrix, DVector, Matrix6xX, SymmetricEigen, Vector3, Vector6};

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
    /// Which rows there are, 3 or 6.
    pub count: usize,
    /// Its block of joint space.
    pub block: usize,
}

/// All readings with the fit's own directions taken out of the residuals.
#[derive(Debug, Clone)]
pub struct LookedAt {
    /// The readings in their order.
    pub readings: Vec<ReadingRows>,
    /// The joints' names, and whether each turns by command.
    pub joints: Vec<(String, bool)>,
    /// Whether deflections were read.
    pub is_of_deflections: bool,
}

/// The fit's directions, orthonormal over all readings, and what they leave.
pub(super) struct Projected {
    /// 6 x r for each reading.
    pub basis: Vec<Matrix6xX<f64>>,
    /// What is left of each reading.
    pub left: Vec<Vector6<f64>>,
    /// The rows less all directions.
    pub spare: usize,
}

impl Projected {
    pub fn new(looked: &LookedAt) -> Self {
        let size = looked
            .readings
            .first()
            .map_or(0, |each| each.fitted.ncols());
        let mut information = DMatrix::<f64>::zeros(size, size);
        for each in &looked.readings {
            information += each.fitted.tr_mul(&each.fitted);
        }
        let scale = information.diagonal().map(|square| {
            if square > 0.0 {
                square.sqrt().recip()
            } else {
                0.0
            }
        });
        let scaled = DMatrix::from_fn(size, size, |row, column| {
            information[(row, column)] * scale[row] * scale[column]
        });
        let directions = if size == 0 || !scaled.iter().all(|value| value.is_finite()) {
            DMatrix::zeros(size, 0)
        } else {
            let eigen = SymmetricEigen::new(scaled);
            let largest = eigen.eigenvalues.max();
            let seen = (0..size).filter(|&place| eigen.eigenvalues[place] > UNSEEN * largest);
            let columns: Vec<DVector<f64>> = seen
                .map(|place| {
                    eigen.eigenvectors.column(place).component_mul(&scale)
                        / eigen.eigenvalues[place].sqrt()
                })
                .collect();
            if columns.is_empty() {
                DMatrix::zeros(size, 0)
            } else {
                DMatrix::from_columns(&columns)
            }
        };
        let basis: Vec<Matrix6xX<f64>> = (looked.readings.iter())
            .map(|each| &each.fitted * &directions)
            .collect();
        let rows: usize = looked.readings.iter().map(|each| each.count).sum();
        let mut projected = Self {
            basis,
            left: looked.readings.iter().map(|each| each.residual).collect(),
            spare: rows.saturating_sub(directions.ncols()),
        };
        projected.take_out(directions.ncols());
        projected
    }

    /// Takes the last directions of the basis out of what is left.
    fn take_out(&mut self, count: usize) {
        let first = self.basis.first().map_or(0, |basis| basis.ncols() - count);
        let mut shares = DVector::<f64>::zeros(count);
        for (basis, left) in self.basis.iter().zip(&self.left) {
            shares += basis.columns(first, count).tr_mul(left);
        }
        for (basis, left) in self.basis.iter().zip(&mut self.left) {
            *left -= basis.columns(first, count) * &shares;
        }
    }

    /// Adds orthonormal directions, and takes them out.
    pub fn add(&mut self, directions: &[Matrix6xX<f64>]) {
        let count = directions.first().map_or(0, Matrix6xX::ncols);
        for (basis, more) in self.basis.iter_mut().zip(directions) {
            let place = basis.ncols();
            let mut grown = Matrix6xX::zeros(place + count);
            grown.columns_mut(0, place).copy_from(basis);
            grown.columns_mut(place, count).copy_from(more);
            *basis = grown;
        }
        self.spare = self.spare.saturating_sub(count);
        self.take_out(count);
    }

    /// The sum of squares that is left.
    pub fn square(&self) -> f64 {
        self.left.iter().map(Vector6::norm_squared).sum()
    }
}

/// A unit vector in place of one that has no length.
pub fn unit(vector: &Vector3<f64>) -> Vector3<f64> {
    vector.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
}
