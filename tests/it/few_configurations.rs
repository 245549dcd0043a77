//! Plans of few configurations, in which several loads may hang and mandatory experiments may be repeated: none is better.

use elastocal::experiment::is_one_configuration;
use elastocal::plan::{Assessment, Experiment, Feasibility, Plan, read_plan, write_plan};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use serde_json::Value;

use crate::support::{Workplace, scenario_text, table4};

const FORCES: [[f64; 3]; 2] = [[0.0, 0.0, -2500.0], [0.0, 1200.0, -1500.0]];

/// The paper's robot under two loads.
fn two_loads(place: &Workplace, name: &str, more: &str) {
    let text = scenario_text("klimchik2012");
    let (head, _) = text.split_once("[[plan]]").expect("there are plans");
    let one = "kind = \"fixed\"\nforce_n = [0, 0, -2500]";
    let wrenches = FORCES.map(|[x, y, z]| format!("{{ force_n = [{x}, {y}, {z}] }}"));
    let several = format!("kind = \"list\"\nwrenches = [{}]", wrenches.join(", "));
    let text = (head.replace(one, &several)).replace("experiments = 3\n", &format!("{more}\n"));
    assert!(text.contains(&several) && text.contains(more));
    place.write(name, text);
}

/// Some configurations of the paper's plans, each under both loads.
fn candidates() -> Vec<Experiment> {
    let all = [4, 6].map(|size| table4(size).experiments).concat();
    let mut places: Vec<Experiment> = Vec::new();
    for each in all {
        let is_there = |other: &Experiment| is_one_configuration(other.pose(), each.pose());
        if !places.iter().any(is_there) {
            places.push(each);
        }
    }
    places.truncate(7);
    let under = |[x, y, z]: [f64; 3]| {
        places.iter().map(move |each| Experiment {
            load: Load::force(x, y, z),
            repeats: 1,
            ..each.clone()
        })
    };
    FORCES.into_iter().flat_map(under).collect()
}

fn rho0_mm(found: &Value) -> f64 {
    found["rho0_mm"].as_f64().expect("a number")
}

/// The lowest rho0 (mm) of all plans of so many of the experiments, each as often as one likes, beside others, in so many configurations.
fn lowest(
    scenario: &Scenario,
    all: &[Experiment],
    beside: &[Experiment],
    (measurements, configurations): (usize, usize),
) -> f64 {
    let mut best = f64::INFINITY;
    let mut chosen = vec![0_usize; measurements];
    loop {
        let mut plan = Plan {
            experiments: beside.to_vec(),
        };
        let free = chosen.iter().map(|&place| all[place].clone());
        plan.experiments.extend(free);
        if plan.by_configuration().len() <= configurations {
            plan.put_repeats_together();
            let found = Assessment::new(&scenario.task, &plan, None).rho0_m;
            best = found.map_or(best, |rho0_m| best.min(rho0_m * 1e3));
        }
        // The next choice in rising order.
        let Some(last) = chosen.iter().rposition(|&place| place + 1 < all.len()) else {
            return best;
        };
        let next = chosen[last] + 1;
        chosen[last..].fill(next);
    }
}

/// Of a list of candidates the best plan of few configurations is found, where one of them is mandatory, too, which may be measured again.
#[test]
fn no_plan_of_few_configurations_is_better() {
    let all = candidates();
    let place = Workplace::new();
    let of = |experiments: Vec<Experiment>| Plan { experiments };
    let write = |name: &str, plan: &Plan| write_plan(&place.path(name), 6, plan).expect("written");
    write("candidates.csv", &of(all.clone()));
    for (place_of_one, measurements, configurations) in [
        (None, 4, 2),
        (Some(0), 4, 2),
        (Some(9), 4, 3),
        (Some(3), 3, 2),
        (None, 5, 2),
    ] {
        let beside: Vec<Experiment> = place_of_one
            .map(|one: usize| all[one].clone())
            .into_iter()
            .collect();
        let mut design = format!("experiments = {measurements}");
        if !beside.is_empty() {
            write("mandatory.csv", &of(beside.clone()));
            design += "\nmandatory = \"mandatory.csv\"";
        }
        two_loads(&place, "s.toml", &design);
        let scenario = Scenario::load(&place.path("s.toml")).expect("valid");
        let free = measurements - beside.len();
        let best = lowest(&scenario, &all, &beside, (free, configurations));
        assert!(best.is_finite(), "{design}");
        // A list says how often each may be measured.
        let many = all.iter().map(|each| Experiment {
            repeats: 4,
            ..each.clone()
        });
        write("candidates.csv", &of(many.collect()));
        let found =
            rho0_mm(&place.json(&format!(
                "plan s.toml --candidates candidates.csv --configurations {configurations} --plan-out found.csv"
            )));
        assert!(
            (found / best - 1.0).abs() < 1e-6,
            "{design}: {found} for {best}"
        );
        let told = rho0_mm(&place.json("evaluate s.toml --plan found.csv --no-proof"));
        assert!(
            (found / told - 1.0).abs() < 1e-6,
            "{design}: {found} for {told}"
        );
    }
}

/// Without candidates, too, several loads hang in one configuration: under one load it does not determine five compliances. More
/// configurations are no worse, and no configuration is better a little turned with all that hangs there.
#[test]
fn several_loads_hang_in_one_configuration() {
    let place = Workplace::new();
    two_loads(&place, "two.toml", "experiments = 6");
    let two = place.read("two.toml");
    place.write(
        "list.toml",
        two.replace("wrenches = [", "wrenches = [{ force_n = [1500, 0, 0] }, "),
    );
    let (head, tail) = two.split_once("kind = \"list\"").expect("a list");
    let (_, tail) = tail.split_once('\n').expect("wrenches");
    let (_, tail) = tail.split_once('\n').expect("more");
    let any = format!("{head}kind = \"any\"\nforce_max_n = 2500\n{tail}");
    place.write("any.toml", any);
    for scenario in ["list.toml", "any.toml"] {
        let mut before = f64::INFINITY;
        let task = Scenario::load(&place.path(scenario)).expect("valid").task;
        for configurations in 1..=3 {
            let plan = format!("plan {scenario} --configurations {configurations}");
            let found = rho0_mm(&place.json(&format!("{plan} --no-proof --plan-out found.csv")));
            let evaluate = format!("evaluate {scenario} --plan found.csv --no-proof");
            let told = rho0_mm(&place.json(&evaluate));
            assert!((found / told - 1.0).abs() < 1e-6, "{found} for {told}");
            assert!(
                found < before * 1.001,
                "{scenario}, {configurations}: {found} after {before}"
            );
            before = found;
            let plan = read_plan(&place.path("found.csv"), 6).expect("a plan");
            for (group, joint) in (plan.by_configuration().into_iter())
                .flat_map(|group| (0..6).map(move |joint| (group.clone(), joint)))
            {
                for step in [-0.02, 0.02] {
                    let mut turned = plan.clone();
                    for &each in &group {
                        turned.experiments[each].configuration_rad[joint] += step;
                    }
                    let is_possible = Feasibility::new(&task).violations(&turned).is_empty();
                    let rho0_m = Assessment::new(&task, &turned, None).rho0_m;
                    let rho0_m = rho0_m.filter(|_| is_possible).unwrap_or(f64::INFINITY);
                    assert!(
                        rho0_m * 1e3 > found * (1.0 - 1e-6),
                        "{scenario}, {configurations}: {rho0_m}, joint {joint} turned by {step}"
                    );
                }
            }
        }
    }
}
