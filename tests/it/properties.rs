//! What must hold of the model whatever the numbers are.

use elastocal::measurement::{
    Measurement, RotationMeasurement, deflection_table, read_measurements,
};
use elastocal::numeric::random::generator;
use elastocal::plan::search::Problem;
use elastocal::plan::{Assessment, Criterion, Plan, read_plan, write_plan};
use elastocal::quantities::units::{degrees, thousandths};
use elastocal::robot::{
    Drive, Elements, EquilibriumError, EquilibriumSolver, Joint, KinematicState, Load,
    ObservationMatrix, SerialChain, Tool, rotation_vector,
};
use elastocal::scenario::Scenario;
use elastocal::testbed::VirtualRobot;
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Rotation3, Vector3};
use rand::{Rng, RngExt};

use crate::support::{Workplace, assert_alike, force, plan, scenario, six_rows, state_at, table4};

/// A load with all its six components, as large as those of a calibration.
const LOAD: Load = Load {
    force_n: Vector3::new(700.0, -1200.0, -2500.0),
    torque_nm: Vector3::new(150.0, -80.0, 220.0),
};

/// Configurations all over the joints' ranges.
fn configurations(scenario: &Scenario, count: usize) -> Vec<DVector<f64>> {
    let mut random = generator(5, 0);
    let mut angle = |joint: usize| {
        let [low, high] = scenario.task.belief.nominal.chain.joints[joint].range_rad;
        random.random_range(low..=high)
    };
    (0..count)
        .map(|_| DVector::from_fn(6, |joint, _| angle(joint)))
        .collect()
}

/// Axis 1 is vertical, as gravity is: turning it with the load turns the deflection. (It turns
/// negatively about z.)
#[test]
fn turning_base_and_load_turns_the_deflection() {
    let scenario = scenario("kr270_all_joints");
    let mut robot = VirtualRobot::new(
        &scenario.truth.robot,
        &scenario.task.belief.calibration_tool.name,
    )
    .expect("the site exists");
    let mut deflection = |q: &DVector<f64>, load: &Load| {
        let (unloaded, _, _) = robot.rest(q, &Load::NONE).expect("stable");
        robot.rest(q, load).expect("stable").0 - unloaded
    };
    for q in configurations(&scenario, 50) {
        let angle = 0.7;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -angle);
        let mut turned_q = q.clone();
        turned_q[0] += angle;
        let turned_load = Load {
            force_n: turn * LOAD.force_n,
            torque_nm: turn * LOAD.torque_nm,
        };
        let expected = turn * deflection(&q, &LOAD);
        assert!((deflection(&turned_q, &turned_load) - expected).amax() < 1e-11);
    }
}

/// Eq. 3 is linear in the load and in the compliances.
#[test]
fn linear_deflections_superpose() {
    let scenario = scenario("kr270");
    let joints: Vec<_> = (0..6).collect();
    let compliance =
        DVector::from_column_slice(&scenario.task.belief.nominal.compliance_rad_per_nm);
    let other = Load::from_wrench([10.0, 900.0, -300.0, -40.0, 500.0, 60.0]);
    for q in configurations(&scenario, 50) {
        let state = state_at(&scenario, &q);
        let matrix = |load: &Load| six_rows(&ObservationMatrix::new(&state, load, &joints));
        let both = Load::from_wrench((2.0 * LOAD.wrench() + other.wrench()).into());
        let expected = 2.0 * matrix(&LOAD) + matrix(&other);
        assert!((matrix(&both) - &expected).amax() < 1e-9 * expected.amax());
        // A k = J k J^T W: eqs. 2 and 3 are the same.
        let jacobian = state.jacobian();
        let moved =
            &jacobian * DMatrix::from_diagonal(&compliance) * jacobian.transpose() * LOAD.wrench();
        assert!((matrix(&LOAD) * &compliance - moved).amax() < 1e-12);
    }
}

#[test]
fn information_of_repeats_is_a_sum() {
    let scenario = scenario("kr270_all_joints");
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let mut repeated = plan("kr270_all_joints");
    let mut sum = DMatrix::zeros(6, 6);
    for (experiment, repeats) in repeated.experiments.iter_mut().zip([3, 1, 5, 2]) {
        experiment.repeats = repeats;
        let mut once = experiment.clone();
        once.repeats = 1;
        for _ in 0..repeats {
            sum += problem.information(&Plan {
                experiments: vec![once.clone()],
            });
        }
    }
    let information = problem.information(&repeated);
    assert!((&information - &sum).amax() < 1e-12 * sum.amax());
    let written_out = Plan {
        experiments: (crate::support::repeated(&repeated).cloned())
            .map(|mut each| {
                each.repeats = 1;
                each
            })
            .collect(),
    };
    assert_eq!(written_out.experiments.len(), 11);
    assert!((problem.information(&written_out) - &sum).amax() < 1e-12 * sum.amax());
}

/// Table 6's rule: a plan of m, measured M times in all, has `rho_0` * sqrt(m / M).
#[test]
fn rho0_scales_with_sigma_and_repeats() {
    let mut scenario = scenario("klimchik2012");
    let rho0 = |scenario: &Scenario, plan: &Plan| {
        let assessment = Assessment::new(&scenario.task, plan, None);
        let errors = assessment
            .standard_errors
            .iter()
            .map(|error| error.expect("determined"));
        (
            assessment.rho0_m.expect("determined"),
            errors.collect::<Vec<_>>(),
        )
    };
    let once = rho0(&scenario, &table4(3));
    let mut plan = table4(3);
    for experiment in &mut plan.experiments {
        experiment.repeats = 4;
    }
    let close = |(rho0, errors): (f64, Vec<f64>), factor: f64| {
        assert_alike(rho0 / once.0, factor, 1e-9);
        for (error, once) in errors.iter().zip(&once.1) {
            assert!((error / once / factor - 1.0).abs() < 1e-9);
        }
    };
    close(rho0(&scenario, &plan), (3.0_f64 / 12.0).sqrt());
    scenario.task.belief.instrument.sigma_m *= 7.0;
    close(rho0(&scenario, &table4(3)), 7.0);
}

/// A central difference with the step h of a function whose third derivative is about as large as
/// itself, S: off by h^2 S / 6 and by rounding, 1e-16 S / h.
const STEP: f64 = 1e-5;

fn moved(q: &DVector<f64>, joint: usize, by: f64) -> DVector<f64> {
    let mut moved = q.clone();
    moved[joint] += by;
    moved
}

#[test]
fn derivatives_are_those_of_differences() {
    let scenario = scenario("kr270");
    let gravity = scenario.task.belief.nominal.chain.gravity_m_s2;
    let torque = |state: &KinematicState| {
        DVector::from_fn(6, |joint, _| {
            state.load_torque(joint, &LOAD) + state.gravity_torque(joint, &gravity)
        })
    };
    for q in configurations(&scenario, 50) {
        let here = state_at(&scenario, &q);
        let jacobian = here.jacobian();
        let mut gradient = DMatrix::zeros(6, 6);
        here.torque_gradient(&LOAD, &gravity, &mut gradient);
        for joint in 0..6 {
            let [before, after] =
                [-STEP, STEP].map(|by| state_at(&scenario, &moved(&q, joint, by)));
            let velocity = (after.tool_position - before.tool_position) / (2.0 * STEP);
            let turn = after.tool_rotation * before.tool_rotation.transpose();
            let rate = rotation_vector(&turn) / (2.0 * STEP);
            assert!((jacobian.fixed_view::<3, 1>(0, joint) - velocity).amax() < 1e-9);
            assert!((jacobian.fixed_view::<3, 1>(3, joint) - rate).amax() < 1e-9);
            let slope = (torque(&after) - torque(&before)) / (2.0 * STEP);
            assert!((gradient.column(joint) - slope).amax() < 1e-9 * 2e4);
        }
    }
}

#[test]
fn equilibria_move_with_compliances_as_the_sensitivity_says() {
    let scenario = scenario("kr270");
    let nominal = &scenario.task.belief.nominal.compliance_rad_per_nm;
    let belief = &scenario.task.belief;
    let mut arm = belief.nominal.chain.at(&belief.calibration_tool);
    let mut solver = EquilibriumSolver::new(6);
    for q in configurations(&scenario, 20) {
        let mut rest = |compliance: &[f64]| {
            solver
                .solve(&mut arm, compliance, q.as_slice(), &LOAD)
                .expect("stable");
            let state = solver.state();
            (
                state.tool_position,
                state.tool_rotation,
                solver.sensitivity(compliance),
            )
        };
        let (_, _, sensitivity) = rest(nominal);
        for joint in 0..6 {
            let step = 1e-2 * nominal[joint];
            let mut stepped = |by: f64| {
                let mut compliance = nominal.clone();
                compliance[joint] += by;
                rest(&compliance)
            };
            let (after, axes_after, _) = stepped(step);
            let (before, axes_before, _) = stepped(-step);
            let slope = (after - before) / (2.0 * step);
            let turn = rotation_vector(&(axes_after * axes_before.transpose()));
            let column = sensitivity.fixed_view::<6, 1>(0, joint).into_owned();
            // Equilibria are found to 1e-12 rad: 1e-11 m over a step of 1e-8 or less.
            let allowed = 2e-5 * column.fixed_rows::<3>(0).amax() + 1e-12 / step;
            assert!((column.fixed_rows::<3>(0) - slope).amax() < allowed);
            let slope = turn / (2.0 * step);
            assert!((column.fixed_rows::<3>(3) - slope).amax() < allowed);
        }
    }
}

/// An arm that stands upright on one elastic joint: mass (kg) at a height (m).
fn pendulum(mass_kg: f64, height_m: f64) -> (SerialChain, Tool) {
    let joint = Joint {
        name: "ankle".into(),
        previous_from_link: Isometry3::identity(),
        axis: Vector3::y_axis(),
        range_rad: [-1.0, 1.0],
        mass_kg,
        centre_of_mass_m: Vector3::z() * height_m,
        model_compliance_rad_per_nm: None,
        drive: Drive::default(),
    };
    let chain = SerialChain {
        joints: vec![joint],
        gravity_m_s2: Vector3::z() * -10.0,
        elements: Elements::default(),
    };
    let tool = Tool {
        name: "top".into(),
        joints: 1,
        link_from_tool: Isometry3::translation(0.0, 0.0, height_m),
    };
    (chain, tool)
}

/// Upright, it stands as long as the spring outweighs the mass: k m g h < 1.
#[test]
fn an_unstable_equilibrium_is_named() {
    let (chain, tool) = pendulum(50.0, 2.0);
    let rest = |compliance: f64| {
        EquilibriumSolver::new(1).solve(&mut chain.at(&tool), &[compliance], &[0.0], &Load::NONE)
    };
    assert!(rest(0.999e-3).is_ok());
    assert_eq!(rest(1.001e-3), Err(EquilibriumError::Unstable));
    // A weight hung on its top counts as its own.
    let loaded = |compliance: f64| {
        let load = Load::force(0.0, 0.0, -500.0);
        EquilibriumSolver::new(1).solve(&mut chain.at(&tool), &[compliance], &[0.0], &load)
    };
    assert!(loaded(0.499e-3).is_ok());
    assert_eq!(loaded(0.501e-3), Err(EquilibriumError::Unstable));
}

#[test]
fn an_arm_that_gives_way_is_named() {
    let scenario = scenario("kr270");
    let belief = &scenario.task.belief;
    let mut arm = belief.nominal.chain.at(&belief.calibration_tool);
    let limp: Vec<_> = scenario
        .task
        .belief
        .nominal
        .compliance_rad_per_nm
        .iter()
        .map(|k| k * 1000.0)
        .collect();
    let q = &table4(3).experiments[0].configuration_rad;
    let failed = EquilibriumSolver::new(6).solve(&mut arm, &limp, q.as_slice(), &LOAD);
    let Err(EquilibriumError::NotConverged {
        joint, iterations, ..
    }) = failed
    else {
        panic!("{failed:?}");
    };
    assert!((1..=6).contains(&joint) && (1..=30).contains(&iterations));
}

fn round_trip(plan: &Plan) -> (Plan, String) {
    let workplace = Workplace::new();
    let path = workplace.path("plan.csv");
    write_plan(&path, 6, plan).expect("can be written");
    (
        read_plan(&path, 6).expect("valid"),
        workplace.read("plan.csv"),
    )
}

/// Numbers that a file can hold come back to the bit, and the file looks as it did.
#[test]
fn plan_files_round_trip() {
    let original = table4(12);
    let (read, text) = round_trip(&original);
    assert_eq!(read, original);
    let path = crate::support::project("scenarios/plans/klimchik2012_m12.csv");
    let shipped = std::fs::read_to_string(path)
        .expect("can be read")
        .replace(".0,", ",");
    let shipped: Vec<_> = shipped
        .lines()
        .filter(|line| !line.starts_with('#'))
        .collect();
    assert_eq!(text.lines().collect::<Vec<_>>(), shipped);
    // Any other number is read as one that is: the second time, nothing changes.
    let mut random = generator(9, 0);
    let mut any = original;
    for experiment in &mut any.experiments {
        experiment
            .configuration_rad
            .apply(|angle| *angle = random.random_range(-3.0..3.0));
        experiment.load = LOAD;
        experiment.repeats = random.random_range(1..1000);
    }
    let (once, text) = round_trip(&any);
    for (one, other) in once.experiments.iter().zip(&any.experiments) {
        assert!((&one.configuration_rad - &other.configuration_rad).amax() < 1e-15);
        assert_eq!((one.load, one.repeats), (other.load, other.repeats));
    }
    assert_eq!(round_trip(&once), (once, text));
}

#[test]
fn measurement_files_round_trip() {
    let vector = |value: f64| Vector3::new(value, -value / 3.0, 0.1 * value);
    let measurement = |index: usize, angle: f64| Measurement {
        configuration_rad: DVector::repeat(6, angle.to_radians()),
        load: LOAD,
        deflection_m: vector(angle) * 1e-3,
        sigma_m: (index % 2 == 1).then(|| Vector3::new(0.03, 0.04, 0.05) * 1e-3),
        rotation: (index / 2 == 1).then(|| RotationMeasurement {
            vector_rad: vector(0.7 * angle) * 1e-3,
            sigma_rad: Vector3::new(0.1, 0.2, 0.3) * 1e-3,
        }),
        approach: None,
        direction: None,
    };
    let workplace = Workplace::new();
    let path = workplace.path("m.csv");
    for kind in 0..4 {
        let measurements = [12.7, -3.1, 99.9].map(|angle| measurement(kind, angle));
        let table = deflection_table(&path, &6.into(), &measurements);
        std::fs::write(&path, table.expect("can be written")).expect("can be written");
        assert_eq!(
            read_measurements(&path, 6).expect("valid"),
            measurements,
            "{kind}"
        );
    }
    // What a file cannot hold must not be lost in silence.
    let mixed = [measurement(0, 1.0), measurement(3, 1.0)];
    assert!(deflection_table(&path, &6.into(), &mixed).is_err());
}

/// Each number with few decimals, as a person writes it, is written as it was read.
#[test]
fn units_give_back_what_was_read() {
    for tenths in -36_000..36_000 {
        let written = f64::from(tenths) / 100.0;
        assert_eq!(
            degrees(written.to_radians()).to_bits(),
            written.to_bits(),
            "{written}"
        );
        assert_eq!(
            thousandths(written * 1e-3).to_bits(),
            written.to_bits(),
            "{written}"
        );
    }
}

/// The numbers of a run depend on seed and run alone, so that whoever replays it gets the same. They
/// are pinned against this program itself: a library that changes them must not do so unnoticed.
#[test]
fn random_numbers_are_a_function_of_seed_and_run() {
    let first = |seed, run| generator(seed, run).next_u64();
    assert_eq!(
        [
            first(1, 0),
            first(1, 1),
            first(2, 0),
            first(u64::MAX, u64::MAX)
        ],
        [
            7_424_550_030_962_593_201,
            15_715_005_604_373_573_095,
            16_257_866_876_066_601_925,
            3_816_023_550_907_448_435
        ]
    );
    let mut one = generator(1, 7);
    let sequence: Vec<_> = (0..100).map(|_| one.next_u64()).collect();
    let mut same = generator(1, 7);
    assert!(sequence.iter().all(|&number| number == same.next_u64()));
    // Runs do not overlap: no number of one is found in another.
    let mut other = generator(1, 8);
    assert!((0..1000).all(|_| !sequence.contains(&other.next_u64())));
}

/// A rotation vector comes back whatever its size; none is NaN.
#[test]
fn rotation_vectors_come_back() {
    let axis = Vector3::new(0.36, -0.48, 0.8);
    for exponent in -16..=0 {
        let vector = axis * 10_f64.powi(exponent);
        let rotation = Rotation3::new(vector).into_inner();
        let found = rotation_vector(&rotation);
        assert!(
            (found - vector).amax() < 1e-15 + 1e-14 * vector.amax(),
            "{vector}, {found}"
        );
    }
    assert_eq!(rotation_vector(&Matrix3::identity()), Vector3::zeros());
    // Rounding can bring the trace above 3, where the arc cosine is NaN.
    let mut rounded = Matrix3::identity() * (1.0 + f64::EPSILON);
    (rounded[(1, 0)], rounded[(0, 1)]) = (1e-9, -1e-9);
    assert!((rotation_vector(&rounded) - Vector3::z() * 1e-9).amax() < 1e-20);
}

/// A force along or through an axis has no lever; a torque about it acts in full.
#[test]
fn loads_act_by_their_levers() {
    let scenario = scenario("kr270");
    for q in configurations(&scenario, 20) {
        let state = state_at(&scenario, &q);
        for joint in 0..6 {
            let along = force(state.axis[joint] * 1000.0);
            assert!(state.load_torque(joint, &along).abs() < 1e-9);
            let towards = force((state.anchor[joint] - state.tool_position) * 1000.0);
            assert!(state.load_torque(joint, &towards).abs() < 1e-9);
            let about = Load {
                force_n: Vector3::zeros(),
                torque_nm: state.axis[joint] * 10.0,
            };
            assert!((state.load_torque(joint, &about) - 10.0).abs() < 1e-9);
        }
        assert!(
            (state.tool_rotation.transpose() * state.tool_rotation - Matrix3::identity()).amax()
                < 1e-12
        );
    }
}
