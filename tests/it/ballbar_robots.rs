//! Virtual robots that are identified from distances of which visits share errors: standard errors, predictions, models, choices.

use std::path::Path;

use elastocal::experiment::{Candidate, read_candidates};
use elastocal::identification::{
    AbsoluteCase, FitChoices, IdentifiedFile, IdentifiedRecord, ParameterGroup, ReadingWeights,
};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::observation::{LengthKind, ReadLength};
use elastocal::parameter::{Axis, ParameterKind};
use elastocal::plan::absolute::ReadingsWanted;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::scenario::Scenario;
use elastocal::study::selection::{Chosen, SelectionWanted, select};
use elastocal::workflow::identify::{identify_absolute, model_selection};
use elastocal::workflow::validate_absolute::{AbsoluteValidation, validate_absolute};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::ballbars::with_sources;
use crate::one_fit::normal;
use crate::support::{Workplace, blank_reading, project, unwatched};

const ZEROS: [ParameterGroup; 1] = [ParameterGroup::Zeros];
const CHOICES: FitChoices = FitChoices::weighed(ReadingWeights::AsNeeded);
/// A visit reads the spindle's ball twice and the reflector's once.
const TARGETS: [&str; 3] = ["spindle", "reflector", "spindle"];

/// Joints that return a hundred times worse than the bar reads.
const RETURNS: &str = r#"
[[uncertainty]]
kind = "joint_repeatability"
std_mrad = 0.2

"#;

/// The same, and zeros that are known to a milliradian.
fn scenario() -> Scenario {
    let zeros = r#"
[[uncertainty]]
kind = "joint_zero"
joints = ["shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]
std_mrad = 1
"#;
    with_sources(&format!("{zeros}{RETURNS}"))
}

fn distance(length_m: f64) -> ReadLength {
    ReadLength {
        kind: LengthKind::Distance,
        length_m,
    }
}

/// The rows of the stored plan.
fn stored(scenario: &Scenario) -> Vec<Candidate> {
    let plan = project("scenarios/plans/ur10_ballbar.csv");
    read_candidates(&plan, scenario.task.belief.commands()).expect("a plan")
}

/// A virtual robot with zeros and places that are off by a millimetre or milliradian, whose joints return anew at each visit.
struct VisitedRobot {
    readings: Vec<AbsoluteReading>,
    truth: Vec<(ParameterKind, f64)>,
}

impl VisitedRobot {
    /// Read at rows, each a visit; the cup of the second station stands further along its x axis.
    fn new(
        scenario: &Scenario,
        (rows, targets): (&[Candidate], &[&str]),
        groups: &[ParameterGroup],
        run: u64,
        moved_m: f64,
    ) -> Self {
        let belief = &scenario.task.belief;
        let of_row = |(visit, row): (usize, &Candidate)| {
            let (visit, row) = (visit.to_string(), row.clone());
            let reading = move |target: &&str| AbsoluteReading {
                configuration_rad: row.configuration_rad.clone(),
                target: Some((*target).to_owned()),
                station: row.station.clone(),
                visit: Some(visit.clone()),
                position_m: Vector3::zeros(),
                length: Some(distance(0.0)),
                ..blank_reading()
            };
            targets.iter().map(reading).collect::<Vec<_>>()
        };
        let mut readings: Vec<AbsoluteReading> = rows.iter().enumerate().flat_map(of_row).collect();
        let mut case = AbsoluteCase::placed(belief, &readings).expect("readings");
        let set = case.unknowns_beside(groups, &[]).expect("unknowns");
        let mut random = generator(7, run);
        let sampled = set.parameters().iter().map(|each| match each.kind {
            ParameterKind::JointCompliance { .. } => each.nominal,
            _ => 1e-3 * normal(&mut random),
        });
        let mut values: Vec<f64> = sampled.collect();
        let (station, axis) = (1, Axis::X);
        let cup = set.index_of(ParameterKind::BasePosition { station, axis });
        values[cup.expect("a cup")] += moved_m;
        let truth = set.apply(&case.arm, &values);
        // What is given for deflections is that of two readings.
        let [joint_rad, sigma_m] =
            [2e-4, belief.instrument.sigma_m].map(|sigma| sigma / 2.0_f64.sqrt());
        for visit in case.observations.chunks_mut(targets.len()) {
            let off_rad: Vec<f64> = (0..6).map(|_| joint_rad * normal(&mut random)).collect();
            for each in visit {
                let angles = each.setup.commanded_rad.iter_mut();
                angles.zip(&off_rad).for_each(|(angle, off)| *angle += off);
            }
        }
        let left = case.left(&truth).expect("an equilibrium");
        for (reading, left) in readings.iter_mut().zip(left) {
            reading.length = Some(distance(sigma_m * normal(&mut random) - left.position_m.x));
        }
        let kinds = set.parameters().iter().map(|each| each.kind);
        Self {
            readings,
            truth: kinds.zip(values).collect(),
        }
    }

    /// The errors of the zeros that are identified over their standard errors, the probability of the residuals, and whether halves of
    /// joint space, or patterns, are said to be no chance.
    fn identified(&self, scenario: &Scenario) -> (Vec<f64>, f64, [bool; 2]) {
        let found = identify_absolute(&scenario.task.belief, &self.readings, &[], CHOICES);
        let found = found.expect("a fit");
        let is_zero = |kind: &ParameterKind| matches!(kind, ParameterKind::JointZero { .. });
        let zeros = self.truth.iter().filter(|(kind, _)| is_zero(kind));
        let fit = &found.fit;
        let errors = zeros.map(|(kind, value)| {
            let index = fit.set.index_of(*kind).expect("fitted");
            (fit.quantity(index) - value) / fit.standard_error(index).expect("determined")
        });
        let halves = found.inconsistencies.iter();
        let alarms = [
            halves.flat_map(|each| &each.found).count() > 0,
            !found.patterns.found.is_empty(),
        ];
        (
            errors.collect(),
            fit.consistency.expect("residuals"),
            alarms,
        )
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), each| (sum + each, count + 1.0));
    sum / count
}

/// Of a share of so many runs by chance no more than four standard errors.
fn allowed(share: f64, runs: u64) -> f64 {
    4.0 * (share * (1.0 - share) / runs as f64).sqrt()
}

/// Distances of one visit are no independent returns of the robot: identified zeros are as far off as they are said to be, intervals of
/// 95 % hold 95 %, residuals are as large as predicted, and no more is said to be no chance than is by chance. Each in a visit of its own
/// they would be taken for more than they are.
#[test]
fn distances_of_one_visit_share_its_errors() {
    const RUNS: u64 = 1000;
    let scenario = scenario();
    let rows = stored(&scenario);
    let of_run = |run: u64| {
        let mut robot = VisitedRobot::new(&scenario, (&rows, &TARGETS), &[], run, 0.0);
        let known = robot.identified(&scenario);
        for (index, each) in robot.readings.iter_mut().enumerate() {
            each.visit = Some(index.to_string());
        }
        (known, (run < 50).then(|| robot.identified(&scenario).0))
    };
    let all: Vec<_> = (0..RUNS).into_par_iter().map(of_run).collect();
    let errors = || all.iter().flat_map(|(known, _)| &known.0);
    // Zeros of one run are correlated: runs count. The mean of n squares of normal errors has the variance 2/n, of n probabilities 1/12 n.
    let square = mean(errors().map(|each| each * each));
    let held = mean(errors().map(|each| f64::from(each.abs() < 1.959_964)));
    let probability = mean(all.iter().map(|(known, _)| known.1));
    let alarms = [0, 1].map(|kind| mean(all.iter().map(|(known, _)| f64::from(known.2[kind]))));
    let unknown = all.iter().filter_map(|(_, unknown)| unknown.as_ref());
    let unknown = mean(unknown.flatten().map(|each| each * each));
    println!("{square} {held} {probability} {alarms:?}, each by itself {unknown}");
    assert!((square - 1.0).abs() < 4.0 * (2.0 / RUNS as f64).sqrt());
    assert!((held - 0.95).abs() < allowed(0.95, RUNS));
    assert!((probability - 0.5).abs() < 4.0 / (12.0 * RUNS as f64).sqrt());
    assert!(
        alarms
            .iter()
            .all(|share| *share < 0.01 + allowed(0.01, RUNS))
    );
    // Three readings of one return count as three: 3 with one target, less as the other sees more of the joints.
    assert!(unknown > 1.5);
}

/// A length that was misread is named, and the fit is the one without it; of the right ones of 200 robots none is left out.
#[test]
fn a_misread_distance_is_left_out() {
    let scenario = scenario();
    let (belief, rows) = (&scenario.task.belief, stored(&scenario));
    let identified = |readings: &[AbsoluteReading]| {
        let found = identify_absolute(belief, readings, &[], CHOICES);
        found.expect("a fit").fit
    };
    (0..200_usize).into_par_iter().for_each(|run| {
        let robot = VisitedRobot::new(&scenario, (&rows, &TARGETS), &[], run as u64, 0.0);
        let mut readings = robot.readings;
        assert_eq!(identified(&readings).rejected, [], "{run}");
        let index = run % readings.len();
        let misread = readings[index]
            .length
            .map(|read| distance(read.length_m + 0.02));
        readings[index].length = misread;
        let found = identified(&readings);
        let named: Vec<usize> = found.rejected.iter().map(|each| each.reading).collect();
        assert_eq!(named, [index]);
        readings.remove(index);
        let without = identified(&readings);
        for (place, _) in found.of_the_robot() {
            let error = found.posterior.standard_error(place).expect("determined");
            let off = found.posterior.mean[place] - without.posterior.mean[place];
            assert!(off.abs() < 1e-2 * error, "{run} {place}: {}", off / error);
        }
    });
}

/// A robot that is identified from half of its visits, beside the other half.
fn validated(
    (scenario, rows): (&Scenario, &[Candidate]),
    run: u64,
    moved_m: f64,
) -> AbsoluteValidation {
    let half = |moved_m: f64, which: usize| -> Vec<AbsoluteReading> {
        let robot = VisitedRobot::new(scenario, (rows, &TARGETS), &[], run, moved_m);
        let visits = robot.readings.chunks(TARGETS.len());
        let own = visits.skip(which).step_by(2);
        own.flat_map(<[AbsoluteReading]>::to_vec).collect()
    };
    let belief = &scenario.task.belief;
    let fitted = half(0.0, 0);
    let found = identify_absolute(belief, &fitted, &[], CHOICES).expect("a fit");
    let json = found.json(scenario, &fitted, &ProvenanceMessage::new(scenario), &[]);
    let place = Workplace::with("robot.json", json.expect("a record").to_string());
    let path = place.path("robot.json");
    let file = IdentifiedFile::read(&path).expect("read");
    let IdentifiedRecord::Readings(robot) = &file.record else {
        panic!("no robot");
    };
    validate_absolute(belief, robot, &path, &half(moved_m, 1)).expect("a prediction")
}

/// Distances that were not fitted lie in their regions of 95 % as often, and their probabilities are uniform; a cup that was moved is seen
/// to be elsewhere.
#[test]
fn other_distances_are_as_predicted() {
    const RUNS: u64 = 200;
    let scenario = scenario();
    let rows = stored(&scenario);
    let all: Vec<AbsoluteValidation> = (0..RUNS)
        .into_par_iter()
        .map(|run| validated((&scenario, &rows), run, 0.0))
        .collect();
    let held = mean(all.iter().map(|each| each.coverage(0).expect("distances")));
    let probability = mean(all.iter().map(|each| each.probability.expect("counted")));
    println!("{held} {probability}");
    assert!((held - 0.95).abs() < allowed(0.95, RUNS));
    assert!((probability - 0.5).abs() < 4.0 / (12.0 * RUNS as f64).sqrt());
    assert!(all.iter().all(|each| each.names[0] == "distances"));
    let moved =
        |all: &AbsoluteValidation| all.moved.iter().filter(|each| each.1.is_moved()).count();
    assert_eq!(all.iter().map(moved).sum::<usize>(), 0);
    let elsewhere = validated((&scenario, &rows), 0, 5e-3);
    assert_eq!(moved(&elsewhere), 1);
    let said: Vec<String> = (elsewhere.conditions().iter())
        .map(|each| each.text.clone())
        .collect();
    assert!(
        said.iter()
            .any(|each| each.contains("differ from their prediction")),
        "{said:?}"
    );
    assert!(
        said.iter().any(|each| each.contains("moved by")),
        "{said:?}"
    );
}

/// 60 configurations in which the bar reads one ball of a robot whose zeros nobody knows.
fn unknown_zeros(run: u64) -> (Scenario, Vec<AbsoluteReading>) {
    let scenario = with_sources(RETURNS);
    let wanted = ReadingsWanted {
        groups: &ZEROS,
        measured: &[],
        candidates: None,
        path: Path::new("scenarios"),
        configurations: 60,
    };
    let planning = wanted.planning(&scenario.task, 1).expect("candidates");
    let read = planning.candidates.iter();
    let read = read.filter(|row| row.target.as_deref() == Some("spindle"));
    let rows: Vec<Candidate> = read
        .clone()
        .step_by(read.count() / 60)
        .take(60)
        .cloned()
        .collect();
    let robot = VisitedRobot::new(&scenario, (&rows, &["spindle"]), &ZEROS, run, 0.0);
    let readings = robot.readings;
    drop(planning);
    (scenario, readings)
}

/// Zeros that are off are found to be, and what they leave is as large as all errors of the readings.
#[test]
fn models_of_distances_are_compared() {
    for run in 0..3 {
        let (scenario, readings) = unknown_zeros(run);
        let found = model_selection(&scenario.task.belief, &readings, CHOICES).expect("models");
        assert!(
            found.groups().contains(&ParameterGroup::Zeros),
            "{:?}",
            found.groups()
        );
        let zeros = found.nested_models.iter().find(|each| each.groups == ZEROS);
        let zeros = zeros.expect("a model");
        let judged = zeros.cross_validation.as_ref().expect("judged");
        // The mean of 60 squares of normal errors, a little larger as others predict them.
        println!("{} {:?}", judged.loss, found.groups());
        assert!((0.4..2.0).contains(&judged.loss), "{}", judged.loss);
        assert_eq!(zeros.discrepancy[1].to_bits(), 0.0_f64.to_bits());
        let bare = found.nested_models[0]
            .cross_validation
            .as_ref()
            .expect("judged");
        assert!(bare.loss > 3.0 * judged.loss);
    }
}

/// Choices of distances are predicted as they come to be, on the distances themselves and on robots as the model says.
#[test]
fn distances_are_chosen_as_positions_are() {
    let (scenario, readings) = unknown_zeros(5);
    let wanted = SelectionWanted {
        sizes: vec![24],
        draws: 4,
        campaigns: 100,
        seed: 1,
    };
    let watch = unwatched();
    let found = select(&scenario.task.belief, &readings, &ZEROS, &wanted, watch).expect("choices");
    let of_size = &found.sizes[0];
    assert_eq!(of_size.planned.len(), 6);
    let planned = of_size.planned.iter();
    let planned = planned.map(|(_, chosen)| chosen.as_ref().expect("a choice"));
    let all: Vec<&Chosen> = planned.chain(&of_size.random).collect();
    for chosen in &all {
        let [_, rms, _, _, rho0, predicted, _, observed] = chosen.numbers_mm();
        // The mean of 36 squares of normal errors has the standard deviation 0.24, of their root 0.12; that of 100 robots 0.14 at most, 0.07.
        let kept = rms.expect("judged") / predicted.expect("a prediction");
        assert!((kept - 1.0).abs() < 4.0 * 0.12, "{kept}");
        let kept = observed.expect("judged") / rho0.expect("a prediction");
        assert!((kept - 1.0).abs() < 4.0 * 0.07, "{kept}");
        assert!(rho0 >= all[0].numbers_mm()[4]);
    }
    // 0.14 mrad of six joints, and no more than a metre from them.
    let noise_mm = found.all_mm().rms;
    assert!((0.05..0.35).contains(&noise_mm), "{noise_mm}");
}
