//! Simulation-based calibration: where the true values lie in what is known of them after a calibration.

use elastocal::compensation::test_pose_rows;
use elastocal::experiment::{Experiment, Plan};
use elastocal::identification::{Case, Identification, Sigma};
use elastocal::measurement::Measurement;
use elastocal::numeric::random::generator;
use elastocal::observation::{DeflectionPrecision, PlannedReadings};
use elastocal::scenario::Scenario;
use elastocal::task::Method;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Matrix6xX, Vector3};
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use crate::repeats::deflection;
use crate::support::table4;
use crate::uncertainties::{entry, loaded, with};

/// Something of each class; compliances that are to be found have proper priors, too.
fn list() -> String {
    let own = "joints = [\"joint_2\", \"joint_3\", \"joint_4\", \"joint_5\", \"joint_6\"]\nstd_relative = 0.1";
    [
        entry(("compliance", own), "name = \"own\""),
        entry(
            ("compliance", "joints = [\"joint_1\"]\nstd_relative = 0.1"),
            "",
        ),
        entry(("joint_zero", "std_mrad = 0.5"), ""),
        entry(("tool_position", "std_mm = 0.5"), ""),
        entry(("load_scale", "std_relative = 0.01"), ""),
        entry(("load_offset", "std_n = 20"), ""),
        entry(("load_direction", "std_mrad = 2"), ""),
        entry(("joint_repeatability", "std_mrad = 0.03"), ""),
        entry(("transmission_error", "std_mrad = 0.3"), ""),
        entry(("discrepancy", "std_mm = 0.02"), ""),
    ]
    .concat()
}

/// The linear world of a belief: values from its priors, and readings that follow from them to first order.
struct LinearWorld<'a> {
    scenario: &'a Scenario,
    plan: Plan,
    /// L with L L^T the prior's covariance.
    prior: DMatrix<f64>,
    random: Box<dyn FnMut() -> f64>,
}

impl<'a> LinearWorld<'a> {
    fn new(scenario: &'a Scenario, repeats: u32) -> Self {
        let mut random = generator(7, 0);
        let repeated = |each| Experiment { repeats, ..each };
        let precision = scenario.task.belief.precision();
        Self {
            scenario,
            plan: Plan {
                experiments: table4(4).experiments.into_iter().map(repeated).collect(),
            },
            prior: root(precision.try_inverse().expect("all have priors")),
            random: Box::new(move || StandardNormal.sample(&mut random)),
        }
    }

    fn normals<const N: usize>(&mut self) -> nalgebra::SVector<f64, N> {
        nalgebra::SVector::from_fn(|_, _| (self.random)())
    }

    /// The values' differences from what is nominal, and the readings.
    fn draw(&mut self) -> (DVector<f64>, Vec<Measurement>) {
        let belief = &self.scenario.task.belief;
        let size = belief.unknowns();
        let differs = &self.prior * DVector::from_fn(size, |_, _| (self.random)());
        let sigma_m = belief.instrument.sigma_m;
        let extended = &belief.uncertain;
        let sources: Vec<_> = extended.sources().map(|(_, each)| each.clone()).collect();
        let (arm, set, sizes) = (extended.arm(), extended.set(), vec![1.0; size]);
        let precision = DeflectionPrecision {
            sigma_m,
            ..belief.instrument.precision()
        };
        let mut model = PlannedReadings::new(arm, 0, set, &sizes, precision, &sources);
        let mut jacobian = Matrix6xX::zeros(size);
        let mut measurements = Vec::new();
        for experiment in self.plan.experiments.clone() {
            let load = experiment.load;
            model.move_to(experiment.configuration_rad.as_slice());
            model.derivatives(&load, &mut jacobian);
            let three = |all: Matrix6<f64>| all.fixed_view::<3, 3>(0, 0).into_owned();
            let shared = three(model.covariance_shared([(&load, None); 2]));
            let all = three(precision.covariance() + model.covariance_of_all(&load));
            let new = root(to_dynamic(&(all - shared)));
            let exact: Vector3<f64> = deflection(arm, &experiment.configuration_rad, &load)
                + jacobian.fixed_rows::<3>(0) * &differs
                + root(to_dynamic(&shared)) * self.normals::<3>();
            for _ in 0..experiment.repeats {
                let deflection_m = exact + &new * self.normals::<3>();
                measurements.push(Measurement {
                    configuration_rad: experiment.configuration_rad.clone(),
                    load,
                    deflection_m,
                    sigma_m: None,
                    rotation: None,
                    approach: None,
                    direction: None,
                });
            }
        }
        (differs, measurements)
    }
}

fn to_dynamic(matrix: &Matrix3<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(3, 3, matrix.as_slice())
}

fn root(covariance: DMatrix<f64>) -> DMatrix<f64> {
    covariance.cholesky().expect("a covariance").unpack()
}

/// The true values' places in what is known: those of each unknown, of each coordinate of the compensation's error, and of
/// the whole error in its covariance. All are uniform from 0 to 1.
fn places(scenario: &Scenario, found: &Identification, differs: &DVector<f64>) -> Vec<f64> {
    let (belief, posterior) = (&scenario.task.belief, &found.posterior);
    let values = DVector::from_vec(belief.values()) + differs;
    let error = values - DVector::from_column_slice(&posterior.mean);
    let place = |error: f64, variance: f64| Normal::standard().cdf(error / variance.sqrt());
    let covariance = &posterior.covariance;
    let mut places: Vec<f64> = (0..error.len())
        .map(|index| place(error[index], covariance[(index, index)]))
        .collect();
    let rows = test_pose_rows(belief, &scenario.task.test_poses[0]);
    let left = &rows * &error;
    let of_rows = &rows * covariance * rows.transpose();
    places.extend((0..3).map(|axis| place(left[axis], of_rows[(axis, axis)])));
    let square = posterior.normalised_square(&error).expect("a covariance");
    let freedom = ChiSquared::new(error.len() as f64).expect("a distribution");
    places.push(freedom.cdf(square));
    places
}

/// Pearson's chi-square of twenty even bins.
fn unevenness(places: &[f64]) -> f64 {
    let mut counts = [0.0; 20];
    for place in places {
        let bin = (1..20).filter(|edge| place * 20.0 >= f64::from(*edge));
        counts[bin.count()] += 1.0;
    }
    let expected = places.len() as f64 / 20.0;
    let squares = counts.iter().map(|count: &f64| (count - expected).powi(2));
    squares.sum::<f64>() / expected
}

/// In the linearised model calibration is exact: whatever is uncertain, repeats that share something among it, the true
/// values lie evenly in what is known of them. Twenty bins of a right posterior have a chi-square of 19 degrees of freedom;
/// all of P places stay below its quantile 1 - 1e-4 / P with a probability of 0.9999 at least, for a fixed seed once and
/// for all. Posteriors that are 10 % too narrow do not.
#[test]
fn true_values_lie_evenly_in_the_linearised_model() {
    const DRAWS: usize = 4000;
    let scenario = loaded(&with(&list(), "model", 64));
    let belief = &scenario.task.belief;
    let mut world = LinearWorld::new(&scenario, 2);
    let mut all: Vec<Vec<f64>> = Vec::new();
    let mut narrow = Vec::new();
    for _ in 0..DRAWS {
        let (differs, measurements) = world.draw();
        let sigma = Sigma::Known(belief.instrument.sigma_m);
        let case = Case::of_belief(belief, &measurements, sigma, Method::Linear);
        let mut found = case.identify().expect("an identification");
        let places_of = places(&scenario, &found, &differs);
        all.resize(places_of.len(), Vec::new());
        for (places, place) in all.iter_mut().zip(places_of) {
            places.push(place);
        }
        found.posterior.covariance *= 0.9_f64.powi(2);
        narrow.push(places(&scenario, &found, &differs)[0]);
    }
    let bins = ChiSquared::new(19.0).expect("a distribution");
    let most = bins.inverse_cdf(1.0 - 1e-4 / all.len() as f64);
    for (index, places) in all.iter().enumerate() {
        let found = unevenness(places);
        assert!(found < most, "place {index}: {found} of at most {most}");
    }
    let found = unevenness(&narrow);
    assert!(found > most, "too narrow: {found} of at most {most}");
}
