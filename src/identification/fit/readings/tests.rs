//! Simulated readings: ranks, recovery, coverage.

use nalgebra::{DVector, Matrix6xX, Vector3};

use rayon::prelude::*;

use super::*;
use crate::observation::{ObservationModel, PlannedReading, Reading, ReadingKind, Setup, Whitener};
use crate::parameter::arms::{Numbers, geometry, heavy, random, ur10};
use crate::parameter::{Axis, ParameterKind, Payload};
use crate::robot::Load;

const SIGMA_M: f64 = 2e-5;
const SIGMA_RAD: f64 = 2e-5;

fn setups(numbers: &mut Numbers, belief: &ElasticArm, count: usize, force_n: f64) -> Vec<Setup> {
    (0..count)
        .map(|index| Setup {
            commanded_rad: numbers.configuration(&belief.chain),
            load: Load::force(0.0, 0.0, -numbers.between(0.0, force_n)),
            hangs_on: None,
            target: index % belief.tools.len(),
            station: 0,
            approach: None,
        })
        .collect()
}

fn whitener() -> Whitener {
    Whitener::independent(Vector3::repeat(SIGMA_M), Vector3::repeat(SIGMA_RAD))
}

fn freedoms(belief: &ElasticArm, set: &ParameterSet, kind: ReadingKind, force_n: f64) -> Freedoms {
    let planned: Vec<PlannedReading> = setups(&mut Numbers(5), belief, 400, force_n)
        .into_iter()
        .map(|setup| PlannedReading {
            setup,
            kind,
            whitener: whitener(),
        })
        .collect();
    let information = planned_information(set, belief, &set.prior().mean, &planned);
    Freedoms::new(belief, set, &information)
}

fn unknown(belief: &ElasticArm, kinds: &[ParameterKind]) -> ParameterSet {
    ParameterSet::new(belief, kinds.iter().map(|&kind| (kind, None))).expect("a set")
}

/// Some of these parameters, without those that are redundant for poses.
fn minimal(belief: &ElasticArm, kinds: &[ParameterKind], force_n: f64) -> ParameterSet {
    let all = unknown(belief, kinds);
    let redundant = freedoms(belief, &all, ReadingKind::Pose, force_n).redundant();
    let kept: Vec<ParameterKind> = (0..kinds.len())
        .filter(|index| !redundant.contains(index))
        .map(|index| kinds[index])
        .collect();
    let set = unknown(belief, &kept);
    let left = freedoms(belief, &set, ReadingKind::Pose, force_n).named;
    assert!(left.is_empty(), "{left:#?}");
    set
}

/// Readings of an arm with these values of the parameters.
fn observe(
    numbers: &mut Numbers,
    nominal: &ElasticArm,
    set: &ParameterSet,
    truth: &DVector<f64>,
    setups: &[Setup],
    noise: f64,
) -> Vec<Observation> {
    let mut model = ObservationModel::new(set, nominal, truth.as_slice());
    let mut ignored = Matrix6xX::zeros(set.len());
    (setups.iter())
        .map(|setup| {
            let seen = model
                .predict(setup, ReadingKind::Pose, &mut ignored)
                .expect("stable");
            let mut error = |size: f64| Vector3::from_fn(|_, _| numbers.normal() * size * noise);
            Observation {
                setup: setup.clone(),
                reading: Reading::Pose {
                    position_m: seen.position_m + error(SIGMA_M),
                    rotation: nalgebra::Rotation3::from_scaled_axis(error(SIGMA_RAD)).into_inner()
                        * seen.rotation,
                },
                whitener: whitener(),
            }
        })
        .collect()
}

/// Nominal values, changed by so many typical sizes.
fn changed(numbers: &mut Numbers, set: &ParameterSet, sizes: f64) -> DVector<f64> {
    let values = set.parameters().iter().map(|each| {
        let share = if each.unit() == "rad/(N m)" {
            0.3 / sizes
        } else {
            1.0
        };
        each.nominal + each.scale * share * numbers.between(-sizes, sizes)
    });
    DVector::from_iterator(set.len(), values)
}

/// A UR10 with a payload and a second reflector: geometry, five compliances, payload.
fn forty_five() -> (ElasticArm, ParameterSet) {
    let mut belief = ur10();
    let mut second = belief.tools[0].clone();
    second.link_from_tool.translation.vector = Vector3::new(-0.06, 0.02, 0.15);
    belief.tools.push(second);
    belief.payload = Some(Payload {
        link: 5,
        mass_kg: 4.0,
        centre_of_mass_m: Vector3::new(0.0, 0.05, 0.1),
    });
    let mut kinds = geometry(&belief);
    kinds.extend((1..6).map(|joint| ParameterKind::JointCompliance { joint }));
    kinds.push(ParameterKind::PayloadMass);
    kinds.extend(Axis::ALL.map(|axis| ParameterKind::PayloadCentre { axis }));
    let set = minimal(&belief, &kinds, 0.0);
    (belief, set)
}

fn readings<'a>(
    nominal: &'a ElasticArm,
    set: &'a ParameterSet,
    observations: &'a [Observation],
) -> FittedReadings<'a> {
    FittedReadings {
        nominal,
        set,
        observations,
        shared: None,
        linear: None,
    }
}

fn fit_near(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
    start: &DVector<f64>,
) -> FitResult<ParameterFit> {
    readings(nominal, set, observations).fit_from(start, Haste::Near)
}

fn fit_if_plausible(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
) -> FitResult<ParameterFit> {
    readings(nominal, set, observations).fit_from_frames(Haste::Plausibility)
}

/// 4 for each joint and 6 more can be told apart with poses, whether axes are parallel or not; with
/// positions of one reflector not how it is turned.
#[test]
fn ranks_of_geometry_are_those_of_theory() {
    let mut numbers = Numbers(8);
    let mut arms = vec![
        ur10(),
        heavy(),
        random(&mut numbers, 6),
        random(&mut numbers, 7),
    ];
    for belief in &mut arms {
        belief.tools.truncate(1);
        let set = unknown(belief, &geometry(belief));
        let joints = belief.chain.len();
        assert_eq!(set.len(), 6 * joints + 12);
        for (kind, expected) in [
            (ReadingKind::Pose, 4 * joints + 6),
            (ReadingKind::Position, 4 * joints + 3),
        ] {
            let freedoms = freedoms(belief, &set, kind, 0.0);
            assert_eq!(set.len() - freedoms.directions.ncols(), expected);
            assert_eq!(freedoms.directions.ncols(), freedoms.named.len());
            let structural = freedoms.named.iter().filter(|each| each.is_structural);
            assert_eq!(structural.count(), 2 * joints + 6);
            // What is left when the redundant ones are left out is determined.
            let redundant = freedoms.redundant();
            let kept = (0..set.len()).filter(|index| !redundant.contains(index));
            let kinds: Vec<ParameterKind> = kept.map(|i| set.parameters()[i].kind).collect();
            let left = self::freedoms(belief, &unknown(belief, &kinds), kind, 0.0);
            assert!(left.named.is_empty(), "{:#?}", left.named);
        }
    }
}

#[test]
fn freedoms_are_named_in_words() {
    let belief = ur10();
    let sentences = |kinds: &[ParameterKind], kind, force_n| -> Vec<String> {
        let named = freedoms(&belief, &unknown(&belief, kinds), kind, force_n).named;
        named.into_iter().map(|each| each.sentence).collect()
    };
    let zero = ParameterKind::JointZero { joint: 0 };
    let about = ParameterKind::BaseRotation {
        station: 0,
        axis: Axis::Z,
    };
    assert_eq!(
        sentences(&[zero, about], ReadingKind::Position, 50.0),
        [
            "the zero of joint_1 and the base's rotation about z cannot be separated: their sum is determined"
        ]
    );
    let mut kinds: Vec<ParameterKind> = (0..6)
        .map(|joint| ParameterKind::JointCompliance { joint })
        .collect();
    kinds.push(ParameterKind::LoadScale);
    // A vertical load does not show the first joint's compliance.
    let found = sentences(&kinds, ReadingKind::Deflection, 100.0);
    assert_eq!(found.len(), 2, "{found:#?}");
    assert!(
        found[0].starts_with("the scale of the load and the compliance of joint_1"),
        "{found:#?}"
    );
    assert!(
        found[0].ends_with("cannot be separated: their products are determined"),
        "{found:#?}"
    );
    assert_eq!(
        found[1],
        "the compliance of joint_1 does not show in these readings"
    );
    // With one compliance known, the load's scale shows.
    assert_eq!(
        sentences(&kinds[2..], ReadingKind::Deflection, 100.0),
        [""; 0]
    );
    let tool = ParameterKind::ToolRotation {
        tool: 0,
        axis: Axis::X,
    };
    assert_eq!(
        sentences(&[about, tool], ReadingKind::Position, 0.0),
        ["the tool's rotation about x does not show in these readings"]
    );
}

/// A prior on one of two that cannot be separated settles it.
#[test]
fn a_prior_settles_what_cannot_be_told_apart() {
    let belief = ur10();
    let zero = ParameterKind::JointZero { joint: 0 };
    let about = ParameterKind::BaseRotation {
        station: 0,
        axis: Axis::Z,
    };
    let mut numbers = Numbers(3);
    let set = ParameterSet::new(&belief, [(zero, Some(1e-3)), (about, None)]).expect("a set");
    let truth = DVector::from_vec(vec![0.0005, 0.02]);
    let setups = setups(&mut numbers, &belief, 10, 0.0);
    let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 0.0);
    let fit = fit_parameters(&belief, &set, &observations).expect("a fit");
    assert!(fit.freedoms.named.is_empty());
    // The zero keeps its prior, and the base takes the rest.
    let error = fit.posterior.standard_error(0).expect("known");
    assert!((error / 1e-3 - 1.0).abs() < 1e-6);
    assert!(fit.posterior.mean[0].abs() < 1e-6);
    assert!((fit.posterior.mean.iter().sum::<f64>() - 0.0205).abs() < 1e-6);

    let set = unknown(&belief, &[zero, about]);
    let fit = fit_parameters(&belief, &set, &observations).expect("a fit");
    assert_eq!(fit.freedoms.named.len(), 1);
    assert!(fit.posterior.standard_error(0).is_none());
    assert!(fit.posterior.standard_error(1).is_none());
    assert!((fit.posterior.mean.iter().sum::<f64>() - 0.0205).abs() < 1e-7);
}

/// Readings and a prior that know as much: the mean of both, wherever the fit begins. A target's place is read in axes that turn, so that
/// each of its coordinates has the information of all readings.
#[test]
fn readings_and_a_prior_share_the_difference() {
    const READINGS: u32 = 16;
    let belief = ur10();
    let mut numbers = Numbers(13);
    let deviation_m = SIGMA_M / f64::from(READINGS).sqrt();
    let places = Axis::ALL.map(|axis| {
        (
            ParameterKind::ToolPosition { tool: 0, axis },
            Some(deviation_m),
        )
    });
    let set = ParameterSet::new(&belief, places).expect("a set");
    let truth = DVector::from_vec(vec![4e-5, -2e-5, 6e-5]);
    let mut setups = setups(&mut numbers, &belief, READINGS as usize, 0.0);
    for setup in &mut setups {
        setup.target = 0;
    }
    let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 0.0);
    for start in [0.0, 1e-3] {
        let start = DVector::repeat(3, start);
        let fit = fit_near(&belief, &set, &observations, &start).expect("a fit");
        for (index, truth) in truth.iter().enumerate() {
            assert!((fit.posterior.mean[index] - truth / 2.0).abs() < 1e-10);
            let error = fit.posterior.standard_error(index).expect("known");
            assert!((error / deviation_m * 2.0_f64.sqrt() - 1.0).abs() < 1e-6);
        }
    }
}

/// Exact readings give back the truth, from frames that are half a metre and half a radian away.
#[test]
fn forty_five_parameters_are_recovered() {
    let (belief, set) = forty_five();
    assert_eq!(
        set.len(),
        45,
        "{:?}",
        set.parameters().iter().map(|p| &p.name).collect::<Vec<_>>()
    );
    let mut numbers = Numbers(6);
    for sizes in [1.0, 3.0] {
        let mut truth = changed(&mut numbers, &set, sizes);
        for (value, parameter) in truth.iter_mut().zip(set.parameters()) {
            if parameter.name.starts_with("base.") {
                *value += 0.5;
            }
        }
        let setups = setups(&mut numbers, &belief, 1000, 0.0);
        let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 0.0);
        let start = std::time::Instant::now();
        let fit = fit_parameters(&belief, &set, &observations).expect("a fit");
        println!("{} iterations, {:?}", fit.iterations, start.elapsed());
        for (index, parameter) in set.parameters().iter().enumerate() {
            let error = fit.posterior.mean[index] - truth[index];
            let standard = fit.posterior.standard_error(index).expect("determined");
            assert!(
                error.abs() < 1e-5 * standard,
                "{}: {error:e}, {standard:e}",
                parameter.name
            );
        }
    }
}

/// Readings that the model explains thirty times worse than their covariances say: the residuals bend the sum of squares, and
/// steps of the linear model alone become shorter hardly, if at all.
#[test]
fn badly_explained_readings_take_few_steps() {
    let (belief, set) = forty_five();
    let mut numbers = Numbers(11);
    let truth = changed(&mut numbers, &set, 1.0);
    let setups = setups(&mut numbers, &belief, 300, 0.0);
    let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 30.0);
    let fit = fit_near(&belief, &set, &observations, &set.prior().mean).expect("a fit");
    assert!(fit.iterations <= 12, "{}", fit.iterations);
    // It is the minimum: no step leads further.
    let values = DVector::from_vec(fit.posterior.mean.clone());
    let again = fit_near(&belief, &set, &observations, &values).expect("a fit");
    assert_eq!(again.iterations, 1);
    // And that no noise makes such residuals is clear long before.
    let given_up = fit_if_plausible(&belief, &set, &observations).expect("a start");
    assert!(given_up.iterations <= 4, "{}", given_up.iterations);
    assert!(given_up.square > 100.0 * given_up.rows as f64);
}

/// Parameters that a prior knows about as well as the readings do use up half a reading each: residuals of robots that are sampled from
/// it are as large as their degrees of freedom.
#[test]
fn priors_leave_their_part_to_the_residuals() {
    const RUNS: u32 = 300;
    let mut belief = ur10();
    belief.tools.truncate(1);
    let joints = 0..belief.chain.len();
    let deviation = 0.5 * SIGMA_RAD;
    let zeros = joints.map(|joint| (ParameterKind::JointZero { joint }, Some(deviation)));
    let set = ParameterSet::new(&belief, zeros).expect("a set");
    let mut numbers = Numbers(31);
    let setups = setups(&mut numbers, &belief, 3, 0.0);
    let (mut square, mut freedom) = (0.0, 0.0);
    for _ in 0..RUNS {
        let truth = DVector::from_fn(set.len(), |_, _| deviation * numbers.normal());
        let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 1.0);
        let fit = fit_parameters(&belief, &set, &observations).expect("a fit");
        square += fit.square;
        freedom += fit.degrees_of_freedom();
        let rank = fit.posterior.estimable.rank() as f64;
        assert!(
            fit.determined > 0.1 * rank && fit.determined < 0.95 * rank,
            "{fit:?}"
        );
    }
    // A sum of squares has at most twice its mean for a variance.
    let allowed = 4.0 * (2.0 / freedom).sqrt();
    assert!(
        (square / freedom - 1.0).abs() < allowed,
        "{square} {freedom} {allowed}"
    );
}

/// Frames that are half a metre and half a radian away, and residuals that are noise: far is not hopeless.
#[test]
fn a_far_start_is_not_given_up() {
    let (belief, set) = forty_five();
    let mut numbers = Numbers(12);
    for sizes in [1.0, 3.0, 10.0] {
        let mut truth = changed(&mut numbers, &set, sizes);
        for (value, parameter) in truth.iter_mut().zip(set.parameters()) {
            if parameter.name.starts_with("base.") {
                *value += 0.5;
            }
        }
        let setups = setups(&mut numbers, &belief, 100, 0.0);
        let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 1.0);
        let fit = fit_if_plausible(&belief, &set, &observations).expect("a fit");
        let mean_square = fit.square / fit.degrees_of_freedom();
        assert!((0.8..1.25).contains(&mean_square), "{sizes}: {mean_square}");
    }
}

#[test]
fn threads_do_not_change_the_bits() {
    let (belief, set) = forty_five();
    let mut numbers = Numbers(7);
    let truth = changed(&mut numbers, &set, 1.0);
    let setups = setups(&mut numbers, &belief, 150, 0.0);
    let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 1.0);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads")
            .install(|| fit_parameters(&belief, &set, &observations).expect("a fit"))
    };
    let one = with(1);
    for threads in [2, 3, 7] {
        let other = with(threads);
        assert_eq!(one.posterior.mean, other.posterior.mean);
        assert_eq!(one.posterior.covariance, other.posterior.covariance);
    }
}

/// 500 laboratories measure 40 poses each: 95 % intervals hold each parameter in 91.5 to 98.5 % of them
/// (a binomial deviation is 0.97 %), on average in 94 to 96 %; the residuals are a chi-square.
#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    const RUNS: u32 = 500;
    let (belief, set) = forty_five();
    let mut numbers = Numbers(9);
    let truth = changed(&mut numbers, &set, 1.0);
    let setups = setups(&mut numbers, &belief, 40, 0.0);
    let runs: Vec<(Vec<bool>, f64, f64)> = (0..RUNS)
        .into_par_iter()
        .map(|run| {
            let mut numbers = Numbers(1000 + u64::from(run));
            let observations = observe(&mut numbers, &belief, &set, &truth, &setups, 1.0);
            let fit = fit_parameters(&belief, &set, &observations).expect("a fit");
            let held = (0..set.len()).map(|index| {
                let standard = fit.posterior.standard_error(index).expect("determined");
                (fit.posterior.mean[index] - truth[index]).abs() < 1.959_964 * standard
            });
            let error = DVector::from_vec(fit.posterior.mean.clone()) - &truth;
            let nees = fit.posterior.normalised_square(&error).expect("regular");
            (held.collect(), fit.square / fit.degrees_of_freedom(), nees)
        })
        .collect();
    let share = |index: usize| {
        let held = runs.iter().filter(|(held, _, _)| held[index]).count();
        held as f64 / f64::from(RUNS)
    };
    let shares: Vec<f64> = (0..set.len()).map(share).collect();
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    let (least, most) = (shares.iter().copied()).fold((1.0_f64, 0.0_f64), |(low, high), share| {
        (low.min(share), high.max(share))
    });
    println!(
        "{RUNS} fits of {} parameters: intervals of 95 % hold the truth in {:.1} to {:.1} %, on average {:.2} %",
        shares.len(),
        100.0 * least,
        100.0 * most,
        100.0 * mean
    );
    for (share, parameter) in shares.iter().zip(set.parameters()) {
        assert!(
            (0.915..=0.985).contains(share),
            "{}: {share}",
            parameter.name
        );
    }
    assert!((0.94..=0.96).contains(&mean), "{mean}");
    let square = runs.iter().map(|run| run.1).sum::<f64>() / f64::from(RUNS);
    // 195 degrees of freedom, 500 times: a deviation of 0.0045.
    assert!((square - 1.0).abs() < 0.015, "{square}");
    let nees = runs.iter().map(|run| run.2).sum::<f64>() / f64::from(RUNS);
    assert!(
        (nees - 45.0).abs() < 4.0 * (90.0 / f64::from(RUNS)).sqrt(),
        "{nees}"
    );
}
