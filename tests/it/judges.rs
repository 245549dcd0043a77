//! The analytic chain and MuJoCo judge each other.

use elastocal::mujoco::State;
use elastocal::numeric::random::generator;
use elastocal::robot::{EquilibriumSolver, Load};
use elastocal::scenario::Scenario;
use elastocal::testbed::VirtualRobot;
use nalgebra::{DVector, Matrix3xX};
use rand::RngExt;

use crate::support::scenario;

fn random_configurations(scenario: &Scenario, count: usize) -> Vec<DVector<f64>> {
    let mut random = generator(7, 0);
    (0..count)
        .map(|_| {
            DVector::from_iterator(
                scenario.task.belief.joints(),
                scenario
                    .task
                    .region
                    .joint_range_rad
                    .iter()
                    .map(|[low, high]| random.random_range(*low..=*high)),
            )
        })
        .collect()
}

#[test]
fn the_chain_is_mujocos() {
    let scenario = scenario("kr270");
    let mut state = State::new(&scenario.task.belief.nominal.model);
    for tool in [
        &scenario.task.belief.calibration_tool,
        &scenario.task.belief.machining_tool,
    ] {
        let site = scenario
            .task
            .belief
            .nominal
            .model
            .site(&tool.name)
            .expect("there is");
        for q in random_configurations(&scenario, 1000) {
            state.move_to(q.as_slice());
            let (position, axes) = state.site(site);
            let (rows_position, rows_rotation) = state.site_jacobian(site);
            let ours = scenario
                .task
                .belief
                .nominal
                .chain
                .at(tool)
                .state(q.as_slice());
            assert!((ours.tool_position - position).amax() < 1e-10);
            assert!((ours.tool_rotation - axes).amax() < 1e-10);
            let jacobian = ours.jacobian();
            let theirs = |rows: &[f64]| Matrix3xX::from_row_slice(rows);
            assert!((jacobian.fixed_rows::<3>(0) - theirs(&rows_position)).amax() < 1e-10);
            assert!((jacobian.fixed_rows::<3>(3) - theirs(&rows_rotation)).amax() < 1e-10);
        }
    }
}

#[test]
fn both_find_the_same_equilibrium() {
    let scenario = scenario("kr270");
    let robot = &scenario.task.belief.nominal;
    let mut virtual_robot = VirtualRobot::new(
        &robot.as_believed(),
        &scenario.task.belief.calibration_tool.name,
    )
    .expect("the site exists");
    let mut arm = robot.chain.at(&scenario.task.belief.calibration_tool);
    let mut solver = EquilibriumSolver::new(scenario.task.belief.joints());
    let load = Load::from_wrench([300.0, -800.0, -2500.0, 100.0, -50.0, 200.0]);
    for q in random_configurations(&scenario, 100) {
        solver
            .solve(&mut arm, &robot.compliance_rad_per_nm, q.as_slice(), &load)
            .expect("stable");
        let (position, _, found) = virtual_robot.rest(&q, &load).expect("stable");
        assert!((solver.state().tool_position - position).amax() < 1e-11);
        assert!(found.iterations <= 6, "{found:?}");
    }
}
