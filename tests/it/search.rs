//! The search for plans and its certificate, on the KR-270: the paper's problem (klimchik2012) and the
//! laboratory's (kr270, with collisions and line of sight).

use std::f64::consts::TAU;
use std::sync::LazyLock;

use elastocal::experiment::Loads;
use elastocal::numeric::random::generator;
use elastocal::plan::search::{
    ApproximateDesign, Bound, Effort, MatrixEvaluator, Problem, SearchError, approximate_design,
    random_plan,
};
use elastocal::plan::{Assessment, Criterion, Experiment, Plan};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::task::Forbidden;
use nalgebra::DMatrix;

use crate::planning::{
    OPTIMISED, assert_close, best_rho0, designed, exact, largest_derivative, random_load,
};
use crate::support::{leave_open, scenario, table4};

/// What our evaluation says of the plans of Table 4 (um).
const TABLE_4_UM: [(u32, f64); 5] = [
    (2, 8.1716),
    (3, 6.5882),
    (4, 5.4528),
    (6, 4.5287),
    (12, 3.2002),
];

/// Fewer starts, for tests that ask for other things than the last 0.1 %.
const QUICK: Effort = Effort {
    pool: 300,
    probes: 16,
    certificate_probes: 100,
    searches: 36,
};

/// The plans of the paper's problem for each m of Table 4, for the seeds 1 and 2.
static PLANS: LazyLock<[Vec<Assessed>; 2]> =
    LazyLock::new(|| [1, 2].map(|seed| plans_of_table_4(&scenario("klimchik2012"), seed)));

/// A plan that was found, with its assessment.
struct Assessed {
    experiments: u32,
    plan: Plan,
    assessment: Assessment,
}

impl Assessed {
    /// The best plan of so many experiments in so many configurations.
    fn new(
        scenario: &Scenario,
        approximate: &ApproximateDesign,
        [experiments, configurations]: [u32; 2],
        seed: u64,
    ) -> Self {
        let problem = Problem::new(&scenario.task, Criterion::TestPose);
        let plan = exact(&problem, approximate, experiments, configurations, seed)
            .expect("there is a plan")
            .plan;
        Self {
            assessment: Assessment::new(
                &scenario.task,
                &plan,
                Some(&Bound::new(&scenario.task, approximate)),
            ),
            plan,
            experiments,
        }
    }

    fn rho0_um(&self) -> f64 {
        self.assessment.rho0_m.expect("the plan is regular") * 1e6
    }
}

fn approximate(scenario: &Scenario, seed: u64) -> ApproximateDesign {
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    approximate_design(&problem, seed).expect("there is a design")
}

fn plans_of_table_4(scenario: &Scenario, seed: u64) -> Vec<Assessed> {
    let approximate = approximate(scenario, seed);
    TABLE_4_UM
        .iter()
        .map(|&(m, _)| Assessed::new(scenario, &approximate, [m, m], seed))
        .collect()
}

fn quick(scenario: &Scenario, criterion: Criterion, experiments: u32) -> Result<Plan, SearchError> {
    let mut problem = Problem::new(&scenario.task, criterion);
    problem.effort = QUICK;
    designed(&problem, experiments, experiments, 1).map(|(_, exact)| exact.plan)
}

fn quick_rho0_um(scenario: &Scenario, plan: &Plan) -> f64 {
    let assessment = Assessment::new(&scenario.task, plan, None);
    assert_eq!(assessment.violations, []);
    assessment.rho0_m.expect("the plan is regular") * 1e6
}

/// The cost of a plan whose first experiment is at these angles under this force, and its derivatives
/// by the angles and by the force.
pub fn cost_and_gradient(
    problem: &Problem<'_>,
    criterion: Criterion,
    evaluator: &mut MatrixEvaluator<'_>,
    rest: &DMatrix<f64>,
    q: &[f64],
    load: &Load,
) -> (f64, Vec<f64>) {
    let mut matrix = evaluator.matrix();
    let size = problem.parameters();
    evaluator.readings.move_to(q);
    evaluator.observe(load, &mut matrix);
    let mut information = rest.clone();
    for block in 0..evaluator.blocks() {
        let rows = matrix.columns(block * size, size);
        information += rows.tr_mul(&rows);
    }
    let mut directions = rest.clone();
    let cost = problem
        .cost_of(criterion)
        .cost(&information, &mut directions);
    // d cost = -trace(G dM) = -2 trace(G A^T dA).
    let mut factor = evaluator.matrix();
    for block in 0..evaluator.blocks() {
        let rows = matrix.columns(block * size, size);
        let mut factor = factor.columns_mut(block * size, size);
        factor.gemm(-2.0, &rows, &directions, 0.0);
    }
    let mut gradient = vec![0.0; q.len()];
    evaluator.pull_back(load, &factor, &mut gradient);
    gradient.extend(evaluator.force_gradient(load, &factor).iter());
    (cost, gradient)
}

#[test]
fn gradients_are_those_of_central_differences() {
    for (name, torque_nm, rotation_sigma_rad) in [
        ("klimchik2012", [0.0; 3], None),
        ("klimchik2012", [300.0, -200.0, 100.0], Some(2e-5)),
        ("kr270_all_joints", [0.0; 3], None),
        ("kr270_all_joints", [300.0, -200.0, 100.0], None),
        ("kr270_all_joints", [300.0, -200.0, 100.0], Some(2e-5)),
    ] {
        let mut scenario = scenario(name);
        scenario.task.belief.instrument.rotation_sigma_rad = rotation_sigma_rad;
        let problem = Problem::new(&scenario.task, Criterion::TestPose);
        let mut evaluator = problem.evaluator();
        for run in 0..5 {
            let mut plan =
                random_plan(&scenario.task, 4, scenario.seed, run).expect("there is one");
            let first = plan.experiments.remove(0);
            let rest = problem.information(&plan);
            let q = first.configuration_rad.as_slice();
            let load = Load {
                torque_nm: torque_nm.into(),
                ..random_load(
                    &Loads::Any {
                        force_max_n: 2500.0,
                    },
                    &mut generator(3, run),
                )
            };
            for &criterion in <Criterion as clap::ValueEnum>::value_variants() {
                let mut at = |q: &[f64], load: &Load| {
                    cost_and_gradient(&problem, criterion, &mut evaluator, &rest, q, load)
                };
                let (cost, gradient) = at(q, &load);
                let size = gradient
                    .iter()
                    .fold(0.0_f64, |size, each| size.max(each.abs()));
                for (index, slope) in gradient.iter().enumerate() {
                    let mut moved = |step: f64| {
                        let (mut q, mut load) = (q.to_vec(), load);
                        if index < q.len() {
                            q[index] += step;
                        } else {
                            load.force_n[index - q.len()] += step;
                        }
                        at(&q, &load).0
                    };
                    // The forces are some thousand times the angles.
                    let (step, size) = if index < q.len() {
                        (1e-5, size.max(cost))
                    } else {
                        (1e-2, size.max(cost) / 1e3)
                    };
                    let difference = (moved(step) - moved(-step)) / (2.0 * step);
                    assert!(
                        (difference - slope).abs() < 1e-6 * size,
                        "{name}, run {run}, {criterion:?}, {index}: {slope} against {difference}"
                    );
                }
            }
        }
    }
}

/// The general equivalence theorem on a million configurations that the search has not seen.
#[test]
fn no_configuration_of_a_fresh_million_beats_the_certificate() {
    for name in ["klimchik2012", "kr270"] {
        let scenario = scenario(name);
        let problem = Problem::new(&scenario.task, Criterion::TestPose);
        let design = approximate(&scenario, 1);
        let largest = design.certificate.largest_derivative;
        assert!(design.certificate.largest_inside <= design.certificate.cost * 1.0002);
        let sampled = largest_derivative(&problem, &design.directions, 1_000_000);
        println!(
            "{name}: the sample's largest derivative is {} of the certificate's",
            sampled / largest
        );
        assert!(sampled <= largest, "{name}: {sampled} above {largest}");
        assert!(
            sampled > 0.8 * largest,
            "{name}: the sample is blind: {sampled}"
        );
    }
}

#[test]
fn a_plan_does_not_depend_on_the_number_of_threads() {
    let bits = |threads: usize, name: &str| -> Vec<u64> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let scenario = scenario(name);
        let plan = pool
            .expect("there are threads")
            .install(|| quick(&scenario, Criterion::TestPose, 3))
            .expect("there is a plan");
        plan.experiments
            .iter()
            .flat_map(|each| each.configuration_rad.iter().chain(&each.load.force_n))
            .map(|value| value.to_bits())
            .collect()
    };
    for name in ["klimchik2012", "kr270", "spatial_3r"] {
        assert_eq!(bits(1, name), bits(2, name), "{name}");
    }
}

fn allowed_spread(experiments: u32) -> f64 {
    if experiments > 4 { 3e-3 } else { 1e-3 }
}

#[test]
fn ten_seeds_end_in_equally_good_plans() {
    for name in ["klimchik2012", "kr270"] {
        let mut scenario = scenario(name);
        scenario.noise_only();
        let mut found = vec![Vec::new(); TABLE_4_UM.len()];
        for seed in 1..=10 {
            for (found, plan) in found.iter_mut().zip(plans_of_table_4(&scenario, seed)) {
                assert_eq!(plan.assessment.violations, []);
                found.push(plan.rho0_um());
            }
        }
        for ((experiments, _), found) in TABLE_4_UM.iter().zip(found) {
            let low = found.iter().copied().fold(f64::INFINITY, f64::min);
            let high = found.iter().copied().fold(0.0, f64::max);
            let spread = high / low - 1.0;
            println!(
                "{name}, m = {experiments}: {low:.5} to {high:.5} um, {:.4} %",
                spread * 100.0
            );
            assert!(spread <= allowed_spread(*experiments));
        }
    }
}

/// The same for all that the default scenario does not know exactly, where optima are flatter.
#[test]
fn seeds_end_in_equally_good_plans_for_the_whole() {
    let scenario = scenario("kr270");
    for experiments in [2, 3] {
        let found = (1..=4).map(|seed| {
            let approximate = approximate(&scenario, seed);
            Assessed::new(&scenario, &approximate, [experiments, experiments], seed).rho0_um()
        });
        let (low, high) = found.fold((f64::INFINITY, 0.0_f64), |(low, high), each| {
            (low.min(each), high.max(each))
        });
        assert!(
            high / low - 1.0 <= 3e-3,
            "{experiments}: {low} to {high} um"
        );
    }
}

#[test]
fn plans_beat_those_of_table_4_and_come_near_the_bound() {
    let scenario = scenario("klimchik2012");
    for found in PLANS.iter().flatten() {
        let m = found.experiments;
        let paper = Assessment::new(&scenario.task, &table4(m), None);
        let paper_um = paper.rho0_m.expect("the plan is regular") * 1e6;
        let printed = TABLE_4_UM.iter().find(|(each, _)| *each == m);
        let (_, expected) = printed.expect("it is in the table");
        assert_close(&format!("Table 4, m = {m}"), paper_um, *expected, 1e-4);
        let gain = 1.0 - found.rho0_um() / paper_um;
        let efficiency = found.assessment.efficiency().expect("there is a bound");
        println!(
            "m = {m}: {:.4} um against {paper_um:.4}, {:.2} % less, efficiency {efficiency:.4}",
            found.rho0_um(),
            gain * 100.0
        );
        assert!(gain >= 0.04, "m = {m}: {gain}");
        let wanted = match m {
            12 => 0.99,
            6 => 0.985,
            4 => 0.97,
            _ => 0.0,
        };
        assert!(
            efficiency >= wanted && efficiency <= 1.0,
            "m = {m}: {efficiency}"
        );
        assert_eq!(found.assessment.violations, []);
        assert_eq!(found.plan.measurements(), m);
    }
}

/// The paper repeats its optimal plans evenly and loses 2.45 % with twelve measurements in 3 configurations
/// against twelve different ones, 2.32 % in 4, 7.14 % in 2, and less than 0.01 % in 6. Where the repeats may
/// be uneven, 3 configurations lose only 0.12 % (measured 7, 3 and 2 times), and 4 lose nothing to speak of.
#[test]
fn twelve_measurements_in_few_configurations_lose_little() {
    let scenario = scenario("klimchik2012");
    let [plans, _] = &*PLANS;
    let rho0_um = |experiments: u32| {
        let mut plans = plans.iter();
        let plan = plans.find(|each| each.experiments == experiments);
        plan.expect("it is in the table").rho0_um()
    };
    let approximate = approximate(&scenario, 1);
    let lost = |rho0_um_found: f64| rho0_um_found / rho0_um(12) - 1.0;
    for (configurations, uneven, even) in [
        (2, 0.0700, 0.144),
        (3, 0.0012, 0.0765),
        (4, 0.0, 0.0243),
        (6, 0.0, 0.0051),
    ] {
        let found = Assessed::new(&scenario, &approximate, [12, configurations], 1);
        let repeats: Vec<_> = (found.plan.experiments.iter())
            .map(|each| each.repeats)
            .collect();
        assert!(repeats.len() <= configurations as usize);
        assert_eq!(repeats.iter().sum::<u32>(), 12);
        let repeated_um = rho0_um(configurations) * (f64::from(configurations) / 12.0).sqrt();
        let losses = [found.rho0_um(), repeated_um].map(lost);
        println!(
            "12 in {configurations}: {:.4} um, {:.2} % lost, {repeats:?}; evenly {:.2} % lost",
            found.rho0_um(),
            losses[0] * 100.0,
            losses[1] * 100.0
        );
        for (loss, expected) in losses.iter().zip([uneven, even]) {
            assert!((loss - expected).abs() < 0.002, "{configurations}: {loss}");
        }
    }
}

#[test]
fn a_free_force_beats_the_vertical_one_in_its_best_direction() {
    let mut free = scenario("klimchik2012");
    free.task.loads = Loads::Any {
        force_max_n: 2500.0,
    };
    let plan = quick(&free, Criterion::TestPose, 3).expect("there is a plan");
    let [plans, _] = &*PLANS;
    let (vertical, freely) = (plans[1].rho0_um(), quick_rho0_um(&free, &plan));
    println!("free {freely:.4} um, vertical {vertical:.4} um");
    assert!(freely < 0.9 * vertical);
    for experiment in &plan.experiments {
        assert_close("force", experiment.load.force_n.norm(), 2500.0, 1e-12);
    }

    let problem = Problem::new(&free.task, Criterion::TestPose);
    let design = approximate(&free, 1);
    let mut evaluator = problem.evaluator();
    let mut random = generator(5, 0);
    for point in &design.support {
        evaluator.readings.move_to(&point.q);
        let form = evaluator.force_form(&design.directions);
        let information = |load: &Load| load.force_n.dot(&(form * load.force_n));
        // The quadratic form is trace(A G A^T) ...
        let here = information(&point.load);
        let by_matrix = (&point.matrix * &design.directions).dot(&point.matrix);
        assert_close("quadratic form", here, by_matrix, 1e-9);
        // ... its largest eigenvalue is its maximum over all directions of the force ...
        let most = form.symmetric_eigenvalues().max() * 2500.0_f64.powi(2);
        for _ in 0..2000 {
            let other = information(&random_load(&free.task.loads, &mut random));
            assert!(other <= most * (1.0 + 1e-9), "{other} above {most}");
        }
        // ... which the search's force attains, and the certificate covers.
        assert_close("the search's force", here, most, 1e-3);
        assert!(most <= design.certificate.largest_derivative * (1.0 + 1e-9));
    }
}

#[test]
fn a_list_of_loads_shows_all_six_compliances() {
    let scenario = scenario("kr270_all_joints");
    let Loads::List(loads) = &scenario.task.loads else {
        panic!("the scenario has a list of loads");
    };
    let plan = quick(&scenario, Criterion::TestPose, 4).expect("there is a plan");
    assert!(
        plan.experiments
            .iter()
            .all(|each| loads.contains(&each.load))
    );
    let assessment = Assessment::new(&scenario.task, &plan, None);
    assert_eq!(assessment.violations, []);
    assert!(assessment.undetermined(&scenario.task.belief).is_empty());
    // One load of the list alone does not do: the weight leaves axis 1 without torque.
    let mut vertical = scenario.clone();
    vertical.task.loads = Loads::List(loads[..1].to_vec());
    let error = quick(&vertical, Criterion::TestPose, 4).expect_err("axis 1 does not show");
    assert!(error.to_string().contains("joint_1"), "{error}");
}

/// A region some 300 mm high and wide, of which random configurations miss whole branches: bounds of single searches from
/// within it differed by 16 %.
#[test]
fn bounds_of_a_narrow_region_do_not_depend_on_the_seed() {
    let mut scenario = scenario("kr270_all_joints");
    let region = &mut scenario.task.region;
    region.tool_height_m = [Some(1.2), Some(1.6)];
    region.tool_radius_m = [Some(1.2), Some(1.5)];
    region.tool_elevation_max_rad = Some(10_f64.to_radians());
    region.collision_clearance_m = None;
    region.line_of_sight = false;
    let cost = |seed| approximate(&scenario, seed).certificate.lower_bound(40);
    let costs: Vec<f64> = (1..=4).filter_map(cost).collect();
    assert_eq!(costs.len(), 4);
    for cost in &costs {
        assert_close("bound", cost.sqrt(), costs[0].sqrt(), 1e-3);
    }
}

#[test]
fn mandatory_experiments_are_in_the_plan_and_in_its_bound() {
    let mut scenario = scenario("klimchik2012");
    let mut mandatory = table4(3);
    mandatory.experiments.truncate(1);
    mandatory.experiments[0].repeats = 2;
    scenario.task.design.mandatory = mandatory.clone();
    let found = Assessed::new(&scenario, &approximate(&scenario, 1), [5, 5], 1);
    assert_eq!(found.plan.experiments[0], mandatory.experiments[0]);
    assert_eq!(found.plan.measurements(), 5);
    assert_eq!(found.plan.experiments.len(), 4);
    assert_eq!(found.assessment.violations, []);
    let efficiency = found.assessment.efficiency().expect("there is a bound");
    assert!(efficiency > 0.9 && efficiency <= 1.0, "{efficiency}");
    // Worse than a free choice of five, better than of three.
    scenario.task.design.mandatory = Plan::default();
    let rho0 = |experiments: u32| best_rho0(&scenario, experiments, 1) * 1e6;
    assert!(found.rho0_um() > rho0(5) && found.rho0_um() < rho0(3));
}

#[test]
fn forbidden_configurations_are_avoided() {
    let mut scenario = scenario("klimchik2012");
    let [plans, _] = &*PLANS;
    let free = &plans[1];
    // The arm stands alike after a whole turn.
    let forbid = |experiment: &Experiment| {
        let mut configuration_rad = experiment.configuration_rad.clone();
        configuration_rad[5] -= TAU;
        Forbidden {
            configuration_rad,
            within_rad: 0.4,
        }
    };
    scenario.task.region.forbidden = free.plan.experiments.iter().map(forbid).collect();
    let before = Assessment::new(&scenario.task, &free.plan, None);
    assert_eq!(before.violations.len(), 3);
    let plan = quick(&scenario, Criterion::TestPose, 3).expect("there is a plan");
    // This asserts that there is no violation.
    let rho0_um = quick_rho0_um(&scenario, &plan);
    println!("{rho0_um:.4} um instead of {:.4} um", free.rho0_um());
    assert!(rho0_um > free.rho0_um() * (1.0 - 1e-6) && rho0_um < 1.5 * free.rho0_um());
}

#[test]
fn an_empty_region_names_its_constraints_with_shares() {
    let mut scenario = scenario("klimchik2012");
    scenario.task.region.tool_height_m = [Some(5.0), None];
    let error = quick(&scenario, Criterion::TestPose, 3).expect_err("nothing is so high");
    let text = error.to_string();
    println!("{text}");
    assert!(text.contains("tool height rejects 100.0 %"), "{text}");
    assert!(text.contains("tool elevation rejects"), "{text}");
    assert!(matches!(error, SearchError::EmptyRegion { .. }));
    assert!(random_plan(&scenario.task, 3, scenario.seed, 1).is_err());
}

#[test]
fn a_compliance_that_no_load_excites_is_named() {
    let mut scenario = scenario("klimchik2012");
    let joints = [&[0], &*scenario.task.belief.parameters].concat();
    leave_open(&mut scenario, &joints);
    let error = quick(&scenario, Criterion::TestPose, 3).expect_err("axis 1 does not show");
    let joints = vec!["joint_1".to_owned()];
    assert_eq!(error, SearchError::NotExcited(joints));
}

/// Under a task load in the plane of axis 1, its compliance does not matter.
#[test]
fn a_compliance_that_neither_shows_nor_matters_is_left_out() {
    let mut without = scenario("klimchik2012");
    without.task.test_poses[0].load.force_n.y = 0.0;
    let mut with = without.clone();
    let joints = [&[0], &*with.task.belief.parameters].concat();
    leave_open(&mut with, &joints);
    let [one, other] = [&without, &with].map(|scenario| {
        let plan = quick(scenario, Criterion::TestPose, 3).expect("there is a plan");
        (Assessment::new(&scenario.task, &plan, None), plan)
    });
    assert_eq!(one.1, other.1);
    let undetermined = other.0.undetermined(&with.task.belief);
    assert_eq!(undetermined, ["the compliance of joint_1"]);
    assert!(one.0.undetermined(&without.task.belief).is_empty());
    let rho0 = |assessment: &Assessment| assessment.rho0_m.expect("the test pose does not need it");
    assert_close("rho0", rho0(&other.0), rho0(&one.0), 1e-9);
    for ((criterion, with), (_, without)) in other.0.criteria.iter().zip(&one.0.criteria) {
        let is_about_all = *criterion != Criterion::TestPose;
        assert_eq!(with.is_none(), is_about_all, "{criterion:?}");
        assert!(without.is_some());
    }
    // Other criteria are about all compliances.
    let error = quick(&with, Criterion::D, 3).expect_err("axis 1 does not show");
    let joints = vec!["joint_1".to_owned()];
    assert_eq!(error, SearchError::NotExcited(joints));
}

#[test]
fn too_few_measurements_are_an_error() {
    let scenario = scenario("klimchik2012");
    for criterion in OPTIMISED {
        let error = quick(&scenario, criterion, 1).expect_err("three numbers, five unknowns");
        let expected = SearchError::Singular {
            experiments: 1,
            parameters: 5,
        };
        assert_eq!(error, expected, "{criterion:?}");
    }
}

/// Each criterion's own plan is the best by that criterion, and everything is a number.
#[test]
fn every_criterion_that_plans_are_optimised_by_has_its_plan() {
    let scenario = scenario("klimchik2012");
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let informations: Vec<_> = OPTIMISED
        .iter()
        .map(|&criterion| {
            let plan = quick(&scenario, criterion, 4).expect("there is a plan");
            let numbers = plan
                .experiments
                .iter()
                .flat_map(|each| each.configuration_rad.iter().chain(&each.load.force_n));
            assert!(numbers.clone().all(|number| number.is_finite()));
            quick_rho0_um(&scenario, &plan);
            problem.information(&plan)
        })
        .collect();
    let mut directions = informations[0].clone();
    for (own, &criterion) in OPTIMISED.iter().enumerate() {
        let mut cost = problem.cost_of(criterion);
        let costs: Vec<_> = informations
            .iter()
            .map(|information| cost.cost(information, &mut directions))
            .collect();
        assert!(costs.iter().all(|cost| cost.is_finite()));
        let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
        println!("{criterion:?}: {:.4} of the best", costs[own] / best);
        assert!(costs[own] <= best * 1.02, "{criterion:?}: {costs:?}");
    }
}
