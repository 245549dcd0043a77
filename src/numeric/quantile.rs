//! Quantiles by halving: the inverse of the incomplete beta function that the F and Student's t distributions of `statrs` have does not
//! end for some arguments.

use statrs::distribution::ContinuousCDF;

/// The half width of the interval that holds 95 % of normal numbers, in standard deviations.
pub const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

/// The value of a positive quantity that is exceeded with a probability; infinite where there is none.
pub fn exceeded_with(law: &impl ContinuousCDF<f64, f64>, probability: f64) -> f64 {
    let mut high = 1.0;
    while law.sf(high) > probability {
        high *= 2.0;
        if high == f64::INFINITY {
            return high;
        }
    }
    let mut low = 0.0;
    loop {
        let middle = f64::midpoint(low, high);
        if middle <= low || middle >= high {
            return high;
        }
        if law.sf(middle) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{FisherSnedecor, StudentsT};

    /// Values of tables, and an F that is the square of a t.
    #[test]
    fn quantiles_are_those_of_tables() {
        let fisher = |own, others| FisherSnedecor::new(own, others).expect("an F");
        assert!((exceeded_with(&fisher(3.0, 10.0), 0.05) - 3.708_265).abs() < 1e-6);
        for freedom in [3.5, 20.0, 500.0] {
            let student = StudentsT::new(0.0, 1.0, freedom).expect("a t");
            for probability in [0.05, 5.7e-7] {
                let square = exceeded_with(&student, probability / 2.0).powi(2);
                let of_fisher = exceeded_with(&fisher(1.0, freedom), probability);
                let ratio = square / of_fisher;
                assert!(
                    (ratio - 1.0).abs() < 1e-6,
                    "{freedom} {probability}: {ratio}"
                );
            }
        }
    }
}
