//! `[[obstacle]]`: what stands in the laboratory is judged for collisions and line of sight, avoided by
//! plans, and drawn.

use std::path::{Path, PathBuf};

use elastocal::mujoco::Shape;
use elastocal::plan::search::Problem;
use elastocal::plan::{Assessment, Criterion, Experiment, Feasibility, Violation};
use elastocal::scenario::Scenario;
use nalgebra::Vector3;

use crate::gauges::{beside, of_both};
use crate::planning::designed;
use crate::support::{
    Workplace, assert_has, assert_near, scenario, scenario_text, state_at, table4,
};

/// The laboratory's scenario with more tables.
fn with_obstacle(workplace: &Workplace, table: &str) -> PathBuf {
    let text = scenario_text("kr270");
    workplace.write(
        "my.toml",
        text.replace("[design]", &format!("{table}\n[design]")),
    );
    workplace.path("my.toml")
}

fn load(path: &Path) -> Scenario {
    Scenario::load(path).expect("the scenario is valid")
}

/// Where the reflector is (mm).
fn reflector_mm(scenario: &Scenario, experiment: &Experiment) -> Vector3<f64> {
    state_at(scenario, &experiment.configuration_rad).tool_position * 1e3
}

fn violations(scenario: &Scenario) -> Vec<Violation> {
    Assessment::new(&scenario.task, &table4(3), None).violations
}

#[test]
fn an_obstacle_at_the_tool_is_reported_and_avoided() {
    let free = scenario("kr270");
    let mut problem = Problem::new(&free.task, Criterion::TestPose);
    problem.effort.searches = 8;
    let plan = designed(&problem, 3, 3, 1).expect("there is a plan").1.plan;
    assert_eq!(Assessment::new(&free.task, &plan, None).violations, []);

    let workplace = Workplace::new();
    let [x, y, z] = reflector_mm(&free, &plan.experiments[1]).into();
    let path = with_obstacle(
        &workplace,
        &format!(
            "[[obstacle]]\nname = \"crane hook\"\nkind = \"cylinder\"\nradius_mm = 60\nlength_mm = 200\n\
             position_mm = [{x}, {y}, {z}]\nrpy_deg = [0, 90, 0]\n"
        ),
    );
    let scenario = load(&path);
    assert_ne!(scenario.sha256, free.sha256);
    workplace.write_plan("plan.csv", 6, &plan);
    let outcome = workplace.doubted("check my.toml --plan plan.csv --json --quiet");
    let problems = outcome.json()["problems"].to_string();
    assert_has(&problems, "experiment 2: distance of ");
    assert!(problems.contains("crane hook"), "{problems}");
    assert!(problems.contains("the bound is 20.000 mm"), "{problems}");

    let mut problem = Problem::new(&scenario.task, Criterion::TestPose);
    problem.effort.searches = 8;
    let plan = designed(&problem, 3, 3, 1).expect("there is a plan").1.plan;
    assert_eq!(Assessment::new(&scenario.task, &plan, None).violations, []);
}

#[test]
fn an_obstacle_hides_the_reflector_from_the_tracker() {
    let workplace = Workplace::new();
    let free = scenario("kr270");
    assert!(
        !violations(&free)
            .iter()
            .any(|each| each.what.contains("line of sight"))
    );
    let tracker = free
        .task
        .belief
        .instrument
        .tracker_site
        .expect("there is a tracker");
    let mut state = elastocal::mujoco::State::new(&free.task.belief.nominal.model);
    state.move_to(&[0.0; 6]);
    let (tracker, _) = state.site(tracker);
    let reflector = reflector_mm(&free, &table4(3).experiments[0]);
    let [x, y, z] = ((tracker * 1e3 + reflector) / 2.0).into();
    let place = format!("position_mm = [{x}, {y}, {z}]");
    for shape in [
        "kind = \"sphere\"\nradius_mm = 40",
        "kind = \"box\"\nsize_mm = [80, 80, 80]\nrpy_deg = [10, 20, 30]",
        "kind = \"capsule\"\nradius_mm = 40\nlength_mm = 100",
    ] {
        let table = format!("[[obstacle]]\nname = \"screen\"\n{shape}\n{place}\n");
        let scenario = load(&with_obstacle(&workplace, &table));
        let found = violations(&scenario);
        let hidden = |each: &&Violation| {
            each.experiment == Some(1)
                && each.what.contains("line of sight")
                && each.what.contains("screen")
        };
        let hidden = found
            .iter()
            .find(hidden)
            .unwrap_or_else(|| panic!("{shape}: {found:?}"));
        // Half of the way is free, up to the obstacle's size.
        assert_near(hidden.found / hidden.bound, 0.5, 0.1);
    }
}

/// Stills, rerun and MCAP files show a model's scenery.
#[test]
fn obstacles_are_drawn_where_they_stand_in_both_robots_laboratories() {
    let workplace = Workplace::new();
    let path = with_obstacle(
        &workplace,
        "[[obstacle]]\nname = \"wall\"\nkind = \"box\"\nsize_mm = [100, 4000, 3000]\n\
         position_mm = [-3000, 0, 1500]\n[[obstacle]]\nname = \"drum\"\nkind = \"cylinder\"\n\
         radius_mm = 300\nlength_mm = 900\nposition_mm = [-2000, 2000, 450]\n\
         [true_robot]\ncompliance_rad_per_nm = [0.3e-6, 0.3e-6, 0.4e-6, 3e-6, 3.3e-6, 2.3e-6]\n",
    );
    let scenario = load(&path);
    for model in [
        &scenario.task.belief.nominal.model,
        &scenario.truth.robot.model,
    ] {
        let mut state = elastocal::mujoco::State::new(model);
        state.move_to(&[0.0; 6]);
        for (name, shape, place) in [
            (
                "wall",
                Shape::Box(Vector3::new(0.05, 2.0, 1.5)),
                [-3.0, 0.0, 1.5],
            ),
            ("drum", Shape::Cylinder(0.3, 0.45), [-2.0, 2.0, 0.45]),
        ] {
            let scenery = model.scenery();
            let found = scenery
                .iter()
                .find(|each| each.name == name)
                .expect("it is there");
            assert_eq!(found.shape, shape);
            assert!(found.group < 3 && found.collides);
            let stands = state.geometry_pose(found.id).translation.vector;
            assert!(
                (stands - Vector3::from(place)).norm() < 1e-12,
                "{name}: {stands}"
            );
        }
    }
}

/// What stands before the tracker hides what it reads, and nothing from a gauge beside it.
#[test]
fn a_gauge_looks_at_nothing() {
    let text = beside(&scenario_text("kr270_gauge"));
    let text = text.replace(
        "clearance_mm = 20",
        "clearance_mm = 20\nline_of_sight = true",
    );
    let hidden = |scenario: &Scenario| -> Vec<usize> {
        let violations = Feasibility::new(&scenario.task).violations(&of_both(scenario));
        let hidden = violations
            .iter()
            .filter(|each| each.what.contains("line of sight"));
        hidden.filter_map(|each| each.experiment).collect()
    };
    let place = Workplace::with("s.toml", &text);
    assert_eq!(hidden(&load(&place.path("s.toml"))), [0; 0]);
    let screen = "[[obstacle]]\nname = \"screen\"\nkind = \"sphere\"\nradius_mm = 300\nposition_mm = [3800, -1400, 1300]\n[design]";
    place.write("s.toml", text.replace("[design]", screen));
    let scenario = load(&place.path("s.toml"));
    let read = of_both(&scenario).experiments;
    let by_tracker = (1..)
        .zip(&read)
        .filter(|(_, each)| each.direction.is_none());
    let by_tracker: Vec<usize> = by_tracker.map(|(number, _)| number).collect();
    assert_eq!(hidden(&scenario), by_tracker);
}
