//! Readings that share errors, beside generalised least squares with the whole covariance.

use nalgebra::{DMatrix, Matrix6, Matrix6xX, Vector6};

use super::visits::{ConfigurationEquations, SharingReading, Visits, visits_of};
use super::{PlannedReading, ReadingErrors, ReadingKind, Setup, Whitener, planned_rows};
use crate::parameter::arms::{Numbers, ur10};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet};
use crate::robot::Load;

/// Readings of one configuration with errors of all levels, each of a class.
struct SharingCase {
    belief: ElasticArm,
    set: ParameterSet,
    setups: Vec<Setup>,
    own: Vec<Matrix6<f64>>,
    errors: Vec<ReadingErrors>,
    classes: Vec<usize>,
}

impl SharingCase {
    fn new(seed: u64, classes: &[usize]) -> Self {
        let mut numbers = Numbers(seed);
        let belief = ur10();
        let joints = 0..belief.chain.len();
        let kinds = joints.map(|joint| (ParameterKind::JointZero { joint }, None));
        let set = ParameterSet::new(&belief, kinds).expect("a set");
        let commanded_rad = numbers.configuration(&belief.chain);
        let mut columns = |count: usize, size: f64| {
            Matrix6xX::from_fn(count, |_, _| numbers.between(-size, size))
        };
        let errors: Vec<ReadingErrors> = (classes.iter())
            .map(|_| ReadingErrors {
                reading: Matrix6::zeros(),
                visit: columns(4, 1e-4),
                configuration: columns(3, 1e-4),
                ..ReadingErrors::none()
            })
            .collect();
        let own = (0..classes.len())
            .map(|_| {
                Matrix6::from_diagonal(&Vector6::from_fn(|_, _| {
                    numbers.between(1e-5, 1e-4).powi(2)
                }))
            })
            .collect();
        let setups = (0..classes.len())
            .map(|index| Setup {
                approach: None,
                commanded_rad: commanded_rad.clone(),
                load: Load::NONE,
                hangs_on: None,
                target: index % belief.tools.len(),
                station: 0,
            })
            .collect();
        Self {
            set,
            setups,
            own,
            errors,
            classes: classes.to_vec(),
            belief,
        }
    }

    fn readings(&self) -> Vec<SharingReading<'_>> {
        (self.setups.iter().zip(&self.own).zip(&self.errors))
            .map(|((setup, own), errors)| SharingReading {
                planned: PlannedReading {
                    setup: setup.clone(),
                    kind: ReadingKind::Position,
                    whitener: Whitener::of_covariance(own).expect("positive"),
                },
                errors,
            })
            .collect()
    }

    fn equations(&self) -> ConfigurationEquations<'_> {
        ConfigurationEquations::new(&self.set, &self.belief, &self.set.prior().mean)
    }

    fn visits(&self, times: &[u32]) -> Vec<Visits> {
        let all: Vec<(usize, u32)> = times.iter().copied().enumerate().collect();
        visits_of(&all, |reading| self.classes[reading])
    }

    /// J^T R^-1 J of every single reading, with every covariance between them written out.
    fn written_out(&self, times: &[u32]) -> DMatrix<f64> {
        let mean = &self.set.prior().mean;
        let wanted: Vec<_> = self
            .setups
            .iter()
            .map(|each| (each, ReadingKind::Position))
            .collect();
        let rows = planned_rows(&self.set, &self.belief, mean, &wanted);
        let each: Vec<(usize, u32)> = (times.iter().enumerate())
            .flat_map(|(reading, &times)| (0..times).map(move |visit| (reading, visit)))
            .collect();
        let size = 3 * each.len();
        let mut covariance = DMatrix::zeros(size, size);
        let mut derivatives = DMatrix::zeros(size, self.set.len());
        for (place, &(one, visit)) in each.iter().enumerate() {
            derivatives
                .rows_mut(3 * place, 3)
                .copy_from(&rows[one].rows(0, 3));
            for (column, &(other, others_visit)) in each.iter().enumerate() {
                let [own, others] = [&self.errors[one], &self.errors[other]];
                let mut block = &own.configuration * others.configuration.transpose();
                if self.classes[one] == self.classes[other] && visit == others_visit {
                    block += &own.visit * others.visit.transpose();
                }
                if place == column {
                    block += self.own[one];
                }
                let mut at = covariance.view_mut((3 * place, 3 * column), (3, 3));
                at.copy_from(&block.view((0, 0), (3, 3)));
            }
        }
        let solved = covariance.cholesky().expect("positive").solve(&derivatives);
        derivatives.tr_mul(&solved)
    }
}

/// Targets of one visit, visits under another load, unequal counts.
#[test]
fn information_is_that_of_the_whole_covariance() {
    let classes = [0, 0, 1, 0, 1];
    for (seed, times) in [
        [1, 1, 1, 1, 1],
        [3, 1, 0, 2, 2],
        [0, 0, 4, 0, 0],
        [2, 2, 1, 0, 3],
    ]
    .iter()
    .enumerate()
    {
        let case = SharingCase::new(seed as u64 + 1, &classes);
        let found = case
            .equations()
            .information(&case.readings(), &case.visits(times));
        let expected = case.written_out(times);
        let off = (&found - &expected).amax() / expected.amax();
        assert!(off < 1e-9, "{times:?}: {off:e}");
        // And not what as many returns of the robot would tell.
        let alone: DMatrix<f64> = (times.iter().enumerate())
            .map(|(place, &times)| {
                let one = [(place, 1)];
                let visits = visits_of(&one, |reading| case.classes[reading]);
                case.equations().information(&case.readings(), &visits) * f64::from(times)
            })
            .sum();
        assert!(
            (&alone - &expected).amax() / expected.amax() > 0.01,
            "{times:?}"
        );
    }
}

/// No counts of readings tell more in any direction than the bounds, and two hardly less.
#[test]
fn bounds_hold_for_all_counts() {
    let classes = [0, 0, 1, 1];
    let case = SharingCase::new(7, &classes);
    let readings = case.readings();
    let bounds = case.equations().bounds(&readings, &classes);
    let mut numbers = Numbers(3);
    let directions: Vec<DMatrix<f64>> = (0..20)
        .map(|_| {
            let root = DMatrix::from_fn(case.set.len(), case.set.len(), |_, _| {
                numbers.between(-1.0, 1.0)
            });
            &root * root.transpose()
        })
        .collect();
    for number in 1..256_u32 {
        let times = [0, 2, 4, 6].map(|shift| number >> shift & 3);
        let told = case
            .equations()
            .information(&readings, &case.visits(&times));
        let mut most = bounds.once.clone();
        for (each, &times) in bounds.each.iter().zip(&times) {
            most += each * f64::from(times);
        }
        for direction in &directions {
            let [told, most] = [&told, &most].map(|matrix| direction.dot(matrix));
            assert!(told <= most * (1.0 + 1e-9), "{times:?}: {told:e} {most:e}");
            if times == [1, 0, 1, 0] {
                assert!(told > 0.3 * most, "{told:e} {most:e}");
            }
        }
    }
}
