//! Tables of absolute readings that are wrong: the input error is found and named, gross errors and copies do not take the fit with them.

use elastocal::codes::ConditionCode;
use elastocal::identification::{AbsoluteCase, AbsoluteFit, ParameterGroup, ReadingWeights};
use elastocal::measurement::AbsoluteReading;
use elastocal::numeric::random::generator;
use elastocal::scenario::Scenario;
use elastocal::task::Belief;
use nalgebra::{UnitQuaternion, Vector3};

use crate::model_selection::read_of;
use crate::one_fit::{between, normal, seen_arm};
use crate::support::scenario;

type Change<'a> = &'a dyn Fn(usize, &mut AbsoluteReading);

/// Right readings of a robot of this scenario.
fn right(scenario: &Scenario, seed: u64, count: usize) -> Vec<AbsoluteReading> {
    let mut random = generator(81, seed);
    let arm = seen_arm(&mut random, scenario, 1, 1);
    read_of(&mut random, &arm, count, 0.0, &|_, _| 0.0)
}

fn named(belief: &Belief, readings: &[AbsoluteReading]) -> Option<String> {
    let case = AbsoluteCase::placed(belief, readings).expect("readings");
    case.likely_input_error().map(|found| found.text)
}

fn fitted(belief: &Belief, readings: &[AbsoluteReading]) -> AbsoluteFit {
    let mut case = AbsoluteCase::new(belief, readings).expect("readings");
    case.fit(&[ParameterGroup::Geometry], ReadingWeights::AsNeeded)
        .expect("a fit")
}

/// Each input error is named by what to do about it; a right table has none.
#[test]
fn input_errors_are_named() {
    let quarter = std::f64::consts::FRAC_PI_2;
    for robot in ["ur10", "kr270"] {
        let scenario = scenario(robot);
        let belief = &scenario.task.belief;
        let table = right(&scenario, 1, 80);
        assert_eq!(named(belief, &table), None, "{robot}");
        let errors: [(&str, Change<'_>); 11] = [
            ("sign of q5_deg", &|_, each| {
                each.configuration_rad[4] *= -1.0;
            }),
            ("Add -90 deg to q3_deg", &|_, each| {
                each.configuration_rad[2] += quarter;
            }),
            ("Swap q2_deg and q3_deg", &|_, each| {
                each.configuration_rad.swap_rows(1, 2);
            }),
            ("inverted", &|_, each| {
                each.rotation = each.rotation.map(|turn| turn.inverse());
            }),
            ("quaternions in another order", &|_, each| {
                each.rotation = each.rotation.map(|turn| {
                    let wrong = nalgebra::Quaternion::new(turn.i, turn.j, turn.k, turn.w);
                    UnitQuaternion::from_quaternion(wrong)
                });
            }),
            // Angles about axes that turn along, read as if about fixed ones; and the other way round.
            ("Change rotation.convention", &|_, each| {
                each.rotation = each.rotation.map(|turn| {
                    let (x, y, z) = turn.inverse().euler_angles();
                    UnitQuaternion::from_euler_angles(-x, -y, -z)
                });
            }),
            ("Change rotation.convention", &|_, each| {
                each.rotation = each.rotation.map(|turn| {
                    let (x, y, z) = turn.euler_angles();
                    UnitQuaternion::from_euler_angles(-x, -y, -z).inverse()
                });
            }),
            ("left-handed", &|_, each| {
                each.position_m.y *= -1.0;
                each.rotation = each.rotation.map(|turn| {
                    let mirrored = nalgebra::Quaternion::new(turn.w, -turn.i, turn.j, -turn.k);
                    UnitQuaternion::from_quaternion(mirrored)
                });
            }),
            ("Write x_mm = y_mm, y_mm = x_mm, z_mm = z_mm", &|_, each| {
                each.position_m.swap_rows(0, 1);
            }),
            (
                "Write x_mm = x_mm, y_mm = y_mm, z_mm = -z_mm",
                &|_, each| each.position_m.z *= -1.0,
            ),
            ("moved before reading 44", &|index, each| {
                if index >= 43 {
                    each.position_m += Vector3::new(0.4, -0.3, 0.2);
                }
            }),
        ];
        for (words, change) in errors {
            let mut wrong = table.clone();
            for (index, each) in wrong.iter_mut().enumerate() {
                change(index, each);
            }
            let found = named(belief, &wrong).unwrap_or_default();
            assert!(found.contains(words), "{robot}, {words}: {found:?}");
        }
    }
}

/// An instrument that was moved near either end of a table leaves outliers there: these are told to be all before or after some reading.
#[test]
fn outliers_at_one_end_are_told() {
    let scenario = scenario("ur10");
    let belief = &scenario.task.belief;
    let table = right(&scenario, 4, 120);
    for (moved, says) in [
        (0..20, "before reading 21"),
        (105..120, "from reading 106 on"),
    ] {
        let mut wrong = table.clone();
        for each in &mut wrong[moved] {
            each.position_m += Vector3::new(0.4, -0.3, 0.2);
        }
        let conditions = fitted(belief, &wrong).conditions();
        let outliers = |each: &&elastocal::codes::Condition| each.code == ConditionCode::Outliers;
        let said = conditions.iter().find(outliers).map(|each| &*each.text);
        let said = said.unwrap_or_default();
        assert!(
            said.contains(&format!("all {says}: was an instrument")),
            "{says}: {said}"
        );
    }
}

/// Up to a tenth of gross errors, scattered, alike or clustered, leave the fit as it is without them.
#[test]
fn gross_errors_do_not_take_the_fit_with_them() {
    let scenario = scenario("ur10");
    let belief = &scenario.task.belief;
    let table = right(&scenario, 2, 120);
    for kind in 0..3 {
        let mut random = generator(82, kind);
        let mut wrong = table.clone();
        let places: Vec<usize> = match kind {
            0 => (0..12).map(|each| 10 * each + 3).collect(),
            _ => (40..52).collect(),
        };
        for &place in &places {
            let each = &mut wrong[place];
            match kind {
                0 => each.position_m += Vector3::from_fn(|_, _| between(&mut random, -0.5, 0.5)),
                1 => each.position_m = Vector3::zeros(),
                _ => each.position_m += Vector3::new(0.03, 0.02, -0.04),
            }
        }
        let found = fitted(belief, &wrong);
        let rejected: Vec<usize> = found.rejected.iter().map(|each| each.reading).collect();
        assert_eq!(rejected, places, "{kind}");
        let without: Vec<AbsoluteReading> = (0..table.len())
            .filter(|place| !places.contains(place))
            .map(|place| table[place].clone())
            .collect();
        let clean = fitted(belief, &without);
        for (index, (one, other)) in (clean.posterior.mean.iter())
            .zip(&found.posterior.mean)
            .enumerate()
        {
            if let Some(error) = clean.posterior.standard_error(index)
                && !clean.set.parameters()[index].kind.is_mounted()
            {
                assert!(
                    (one - other).abs() < 0.3 * error,
                    "{kind} {}",
                    clean.posterior.names[index]
                );
            }
        }
    }
}

/// A tenth of the positions that are all off by the same, next to each other in joint space, beside a discrepancy.
#[test]
fn clustered_gross_errors_beside_a_discrepancy_are_found() {
    let scenario = scenario("ur10");
    let belief = &scenario.task.belief;
    let mut table = right(&scenario, 3, 400);
    let mut random = generator(83, 0);
    for each in &mut table {
        each.rotation = None;
        each.covariance = None;
        each.position_m += Vector3::from_fn(|_, _| 2e-4 * normal(&mut random));
    }
    let mut order: Vec<usize> = (0..table.len()).collect();
    let first = |place: &usize| table[*place].configuration_rad[0];
    order.sort_by(|one, other| first(one).total_cmp(&first(other)));
    let clean = fitted(belief, &table);
    for size_m in [0.005, 0.01, 0.03] {
        let mut wrong = table.clone();
        let mut places = order[..40].to_vec();
        for &place in &places {
            wrong[place].position_m += Vector3::new(0.6, -0.5, 0.62) * size_m;
        }
        places.sort_unstable();
        let found = fitted(belief, &wrong);
        let rejected: Vec<usize> = found.rejected.iter().map(|each| each.reading).collect();
        assert_eq!(rejected, places, "{size_m}");
        let mean = |fit: &AbsoluteFit| {
            let kept = (0..table.len()).filter(|place| !places.contains(place));
            kept.map(|place| fit.left[place].position_m.norm())
                .sum::<f64>()
        };
        assert!((mean(&found) / mean(&clean) - 1.0).abs() < 0.1, "{size_m}");
    }
}

/// Copies of readings tell nothing: standard errors are those of one, and the copies are named.
#[test]
fn copies_count_once() {
    let scenario = scenario("ur10");
    let belief = &scenario.task.belief;
    let once = right(&scenario, 3, 40);
    let copied: Vec<AbsoluteReading> = (0..4).flat_map(|_| once.clone()).collect();
    let [one, four] = [&once, &copied].map(|readings| fitted(belief, readings));
    assert!(one.copies.rows.is_empty() && one.copies.readings.is_empty());
    assert_eq!(four.copies.rows.len(), 120);
    for index in 0..one.set.len() {
        let [one, four] = [&one, &four].map(|fit| fit.posterior.standard_error(index));
        let (Some(one), Some(four)) = (one, four) else {
            continue;
        };
        assert!((one / four - 1.0).abs() < 1e-2, "{one} {four}");
    }
    let mut elsewhere = once.clone();
    elsewhere[7].position_m = elsewhere[3].position_m;
    elsewhere[7].rotation = elsewhere[3].rotation;
    let found = fitted(belief, &elsewhere);
    assert_eq!(found.copies.readings, [[3, 7]]);
    assert!(
        found
            .conditions()
            .iter()
            .any(|each| each.code == ConditionCode::CopiedReadings && each.text.contains("8 (4)")),
        "{:?}",
        found.conditions()
    );
}

/// A joint that is counted from 4 deg elsewhere is corrected, and named: no maker builds that.
#[test]
fn corrections_beyond_manufacturing_tolerances_are_named() {
    let scenario = scenario("ur10");
    let mut table = right(&scenario, 9, 60);
    let codes = |table: &[AbsoluteReading]| -> Vec<ConditionCode> {
        let found = fitted(&scenario.task.belief, table).conditions();
        found.iter().map(|each| each.code).collect()
    };
    let code = ConditionCode::GeometryBeyondTolerance;
    assert!(!codes(&table).contains(&code));
    for each in &mut table {
        each.configuration_rad[2] += 0.07;
    }
    assert!(codes(&table).contains(&code));
}

/// Unloaded readings tell some compliances hardly: these stay nominal and are named, and none is negative.
#[test]
fn compliances_that_are_hardly_told_stay_nominal() {
    let scenario = scenario("ur10");
    let belief = &scenario.task.belief;
    for seed in 4..7 {
        let table = right(&scenario, seed, 60);
        let mut case = AbsoluteCase::new(belief, &table).expect("readings");
        let groups = [ParameterGroup::Geometry, ParameterGroup::Compliances];
        let fit = case
            .fit(&groups, ReadingWeights::WithDiscrepancy)
            .expect("a fit");
        let names: Vec<&str> = fit
            .of_the_robot()
            .map(|(_, each)| each.name.as_str())
            .collect();
        for (joint, (found, nominal)) in (fit.arm.compliance_rad_per_nm.iter())
            .zip(&fit.reference.compliance_rad_per_nm)
            .enumerate()
        {
            assert!(*found >= 0.0, "{joint}: {found}");
            let kind = elastocal::parameter::ParameterKind::JointCompliance { joint };
            let place = fit.set.index_of(kind).expect("asked for");
            if let Some(error) = fit.standard_error(place) {
                assert!(error <= 10.0 * nominal, "{}: {error}", names[0]);
            }
        }
        assert!(!fit.undetermined.is_empty());
    }
}

/// What is left of orientations is a condition where it is more than robots leave, whatever is left of positions.
#[test]
fn unexplained_orientations_are_a_condition() {
    let scenario = scenario("ur10");
    for (size_rad, is_condition) in [(2e-4, false), (0.02, true)] {
        let mut random = generator(86, 0);
        let mut table = right(&scenario, 10, 60);
        for each in &mut table {
            let turn = Vector3::from_fn(|_, _| size_rad * normal(&mut random));
            let turn = UnitQuaternion::from_scaled_axis(turn);
            each.rotation = each.rotation.map(|rotation| turn * rotation);
        }
        let conditions = fitted(&scenario.task.belief, &table).conditions();
        let too_large = |code| code == ConditionCode::ResidualsTooLarge;
        let is_named = conditions.iter().any(|each| too_large(each.code));
        assert_eq!(is_named, is_condition, "{size_rad}: {conditions:?}");
    }
}
