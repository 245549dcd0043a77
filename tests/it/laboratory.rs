//! A plan goes to the laboratory: order, ways, robot programs, run sheet, and the table to fill in.

use elastocal::laboratory::{Campaign, Dialect, Program, ProgramStep};
use elastocal::mujoco::State;
use elastocal::plan::{Plan, read_plan};
use elastocal::robot::{Commands, EquilibriumSolver, Load};
use elastocal::scenario::Scenario;
use nalgebra::DVector;
use serde_json::Value;

use crate::support::{
    Workplace, absolute_scenario_text, assert_has, assert_near, number, numbers, project,
    scenario_text, shipped,
};

const COLUMNS: &str =
    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n";

/// A KR-270 with a pillar where its arm is to pass.
fn behind_a_pillar() -> Workplace {
    let workplace = Workplace::new();
    let text = scenario_text("kr270")
        .replace("line_of_sight = true", "")
        .replace("tool_elevation_max_deg = 30", "");
    let pillar = "[[obstacle]]\nname = \"pillar\"\nkind = \"box\"\nsize_mm = [400, 400, 3000]\n\
                  position_mm = [1900, 0, 1500]\n";
    workplace.write("s.toml", text + pillar);
    workplace.write(
        "plan.csv",
        format!(
            "{COLUMNS}-50,-90,90,0,30,0,0,0,-2500,0,0,0,2\n\
             -60,-80,100,20,40,10,0,0,-2500,0,0,0,1\n\
             60,-95,95,0,30,90,0,0,-2500,0,0,0,1\n\
             45.25,-100,110,-30,-40,0.125,0,0,-2500,0,0,0,3\n"
        ),
    );
    workplace
}

/// What a program tells a robot to do.
#[derive(Debug, PartialEq)]
enum Told {
    Move(Vec<f64>),
    Halt,
    Log(usize),
}

/// Reads a KRL program with its data list.
fn read_krl(source: &str, data: &str) -> Vec<Told> {
    let mut lines = source.lines();
    assert_eq!(lines.next(), Some("&ACCESS RVP"));
    assert_eq!(lines.next(), Some("&REL 1"));
    let mut body = lines.skip_while(|line| line.starts_with('&'));
    let name = body
        .next()
        .and_then(|line| line.strip_prefix("DEF ")?.strip_suffix(" ( )"))
        .expect("a definition");
    assert!(
        name.len() <= 24
            && name
                .chars()
                .all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
    );
    let mut told = Vec::new();
    let (mut folds, mut is_ended, mut settings) = (0, false, Vec::new());
    for line in body {
        assert!(!is_ended, "{line}");
        assert!(line.is_ascii() && line.len() < 200);
        if let Some(comment) = line.strip_prefix(';') {
            folds +=
                i32::from(comment.starts_with("FOLD")) - i32::from(comment.starts_with("ENDFOLD"));
        } else if let Some(target) = line.strip_prefix("PTP {") {
            let target = target.strip_suffix('}').expect("no approximation");
            let axes = target.split(',').enumerate().map(|(index, axis)| {
                let (axis, value) = axis.split_once(' ').expect("a value");
                assert_eq!(axis, format!("A{}", index + 1));
                value.parse().expect("a number")
            });
            told.push(Told::Move(axes.collect()));
        } else if line == "HALT" {
            told.push(Told::Halt);
        } else if let Some(index) = line.strip_prefix("LOGGED[") {
            let index = index
                .strip_suffix("] = $AXIS_ACT_MEAS")
                .expect("the measured angles");
            told.push(Told::Log(index.parse().expect("a number")));
        } else if line == "END" {
            is_ended = true;
        } else {
            settings.push(line);
        }
    }
    assert!(is_ended && folds == 0);
    for wanted in [
        "BAS (#INITMOV,0)",
        "BAS (#PTP_DAT)",
        "BAS (#FRAMES)",
        "$ADVANCE = 0",
    ] {
        assert!(settings.contains(&wanted), "{settings:?}");
    }
    let logs = told
        .iter()
        .filter(|each| matches!(each, Told::Log(_)))
        .count();
    assert!(data.contains(&format!("DEFDAT {name}\n")) && data.ends_with("ENDDAT\n"));
    assert!(data.contains(&format!("DECL E6AXIS LOGGED[{}]", logs.max(1))));
    told
}

/// Reads a program for Universal Robots; angles come in degrees.
fn read_urscript(source: &str) -> Vec<Told> {
    let mut told = Vec::new();
    for line in source.lines().map(str::trim) {
        if let Some(rest) = line.strip_prefix("movej([") {
            let (target, rest) = rest.split_once("], ").expect("a target");
            assert!(rest.ends_with("r=0)"));
            let radians = target
                .split(", ")
                .map(|angle| angle.parse::<f64>().expect("a number"));
            told.push(Told::Move(radians.map(f64::to_degrees).collect()));
        } else if line.starts_with("popup(") {
            told.push(Told::Halt);
        } else if let Some(rest) = line.strip_prefix("textmsg(\"measured joint angles ") {
            let (index, _) = rest.split_once(':').expect("a number");
            told.push(Told::Log(index.parse().expect("a number")));
        }
    }
    told
}

/// Reads the program of this path, without its ending.
fn read_program(workplace: &Workplace, path: &str, dialect: &str) -> Vec<Told> {
    let read = |ending: &str| workplace.read(&format!("{path}.{ending}"));
    match dialect {
        "krl" => read_krl(&read("src"), &read("dat")),
        _ => read_urscript(&read("script")),
    }
}

/// Where the robot stands whenever its angles are kept.
fn logged(told: &[Told]) -> Vec<Vec<f64>> {
    let mut at = Vec::new();
    let mut stops = Vec::new();
    for each in told {
        match each {
            Told::Move(q) => at.clone_from(q),
            Told::Log(index) => {
                assert_eq!(*index, stops.len() + 1);
                stops.push(at.clone());
            }
            Told::Halt => {}
        }
    }
    stops
}

/// Moves the virtual robot through a program in MuJoCo: the least distance on the way (m), up to the given
/// one, which it is looked for within.
fn least_distance(scenario: &Scenario, told: &[Told], loads: &[Load], within_m: f64) -> f64 {
    let belief = &scenario.task.belief;
    let mut state = State::new(&belief.nominal.model.with_clearance(within_m));
    let mut solver = EquilibriumSolver::new(6);
    let mut least = within_m;
    let moves = told.iter().filter_map(|each| match each {
        Told::Move(q) => Some(q),
        _ => None,
    });
    let moves: Vec<&Vec<f64>> = moves.collect();
    for pair in moves.windows(2) {
        let farthest = (pair[0].iter().zip(pair[1]))
            .map(|(from, to)| (to - from).abs())
            .fold(0.0, f64::max);
        let steps = (farthest / 0.25).ceil().max(1.0);
        let mut step = 0.0;
        while step <= steps {
            let q: Vec<f64> = (pair[0].iter().zip(pair[1]))
                .map(|(from, to)| (from + step / steps * (to - from)).to_radians())
                .collect();
            for load in loads {
                let mut arm = belief.nominal.chain.at(&belief.calibration_tool);
                solver
                    .solve(&mut arm, &belief.nominal.compliance_rad_per_nm, &q, load)
                    .expect("it rests");
                state.move_to(solver.q());
                let contact = state.nearest_contact(within_m);
                least = contact.map_or(least, |contact| contact.distance_m.min(least));
            }
            step += 1.0;
        }
    }
    least
}

fn plan_of(workplace: &Workplace) -> Plan {
    read_plan(&workplace.path("plan.csv"), 6).expect("a plan")
}

/// Both programs lead to every configuration of the plan within 1e-9 rad, without and with its load, around
/// what stands in the way.
#[test]
fn programs_lead_to_the_plan_around_what_stands_in_the_way() {
    let workplace = behind_a_pillar();
    let scenario = workplace.scenario("s.toml");
    let plan = plan_of(&workplace);
    for dialect in ["krl", "urscript"] {
        let outcome = workplace.done(&format!(
            "lab s.toml --quiet --plan plan.csv --dialect {dialect} --json"
        ));
        let json = outcome.json();
        let told = read_program(&workplace, "out/s/lab/s", dialect);
        let stops = json["stops"].as_array().expect("stops");
        // What hangs at the end is taken off before anything else.
        let last = told.iter().rposition(|each| matches!(each, Told::Log(_)));
        let after = last.map(|last| &told[last + 1..]).expect("a stop");
        assert!(matches!(after, [Told::Halt, ..]));
        let logged = logged(&told);
        assert_eq!(logged.len(), stops.len());
        let mut seen = vec![[0, 0]; plan.experiments.len()];
        for (stop, at) in stops.iter().zip(&logged) {
            let is_loaded = !stop["wrench"].is_null();
            for experiment in numbers(&stop["experiments"]) {
                let index = (1..=plan.experiments.len())
                    .position(|number| (number as f64 - experiment).abs() < 0.5)
                    .expect("an experiment");
                let wanted = &plan.experiments[index];
                for (angle, wanted_rad) in at.iter().zip(&wanted.configuration_rad) {
                    let apart = (angle.to_radians() - wanted_rad).abs();
                    assert!(apart < 1e-9, "{dialect}: {apart} rad");
                }
                seen[index][usize::from(is_loaded)] += 1;
                // Joints come back otherwise at each visit, which each repeat is.
                assert_eq!(stop["readings"], 1);
            }
        }
        for (seen, wanted) in seen.iter().zip(&plan.experiments) {
            assert_eq!(*seen, [wanted.repeats; 2]);
        }
        // There is something in the way, and the programs lead around it.
        let straight: Vec<Told> = logged.into_iter().map(Told::Move).collect();
        let loads = [Load::NONE, Load::force(0.0, 0.0, -2500.0)];
        assert!(least_distance(&scenario, &straight, &loads, 0.02) < 0.0);
        let least = least_distance(&scenario, &told, &loads, 0.02);
        assert!(least >= 0.01, "{dialect}: {least} m");
        // One load is hung once, and every configuration has the same side both times.
        assert_eq!(json["load_changes"], 1);
        let side_of = |experiment: f64| {
            let stops = stops
                .iter()
                .filter(|stop| numbers(&stop["experiments"]).contains(&experiment));
            let sides: Vec<&Value> = stops.map(|stop| &stop["approach_deg"]).collect();
            assert!(sides.len() >= 2 && sides.iter().all(|side| *side == sides[0]));
            assert!(!sides[0].is_null());
        };
        (1..=4).for_each(|number| side_of(f64::from(number)));
    }
}

/// The demo's plan in the laboratory: the program leads to every configuration, and keeps clear on the way.
#[test]
fn the_demo_goes_to_the_laboratory() {
    let workplace = Workplace::with("kr270.toml", scenario_text("kr270"));
    workplace.done("plan kr270.toml --quiet --no-proof --plan-out plan.csv");
    let outcome = workplace.done("lab kr270.toml --quiet --plan plan.csv");
    outcome.prints("Every move keeps the clearance.");
    let told = read_program(&workplace, "out/kr270/lab/kr270", "krl");
    let scenario = workplace.scenario("kr270.toml");
    let plan = plan_of(&workplace);
    let logged = logged(&told);
    assert_eq!(logged.len(), 2 * plan.measurements() as usize);
    for experiment in &plan.experiments {
        let is_here = |at: &&Vec<f64>| {
            (at.iter().zip(&experiment.configuration_rad))
                .all(|(angle, wanted)| (angle.to_radians() - wanted).abs() < 1e-9)
        };
        let visits = logged.iter().filter(is_here).count();
        assert_eq!(visits, 2 * experiment.repeats as usize);
    }
    let loads = [Load::NONE, Load::force(0.0, 0.0, -2500.0)];
    let least = least_distance(&scenario, &told, &loads, 0.02);
    assert!(least >= 0.01, "{least} m");
    let sheet = workplace.read("out/kr270/lab/run_sheet.html");
    assert_eq!(sheet.matches("class=\"tick\"").count(), logged.len());
}

/// Back on the robot: the compensated angles as a table, and as a program that leads to them around what stands in the
/// way.
#[test]
fn compensated_angles_go_back_to_the_robot() {
    let workplace = behind_a_pillar();
    let pose = |name: &str, q1: f64| {
        format!(
            "[[test_pose]]\nname = \"{name}\"\nq_deg = [{q1}, -56.9, 89.3, 45.1, 76, 57.2]\nforce_n = [0, 280, -180]\n"
        )
    };
    let more = pose("left, \\\"fine\\\"", 60.0) + &pose("right", -60.0);
    let text = workplace
        .read("s.toml")
        .replace("q_deg = [0, -56.9", "q_deg = [-50, -56.9");
    workplace.write("s.toml", text + &more);
    workplace.done("measure s.toml --quiet --plan plan.csv --measurements-out m.csv");
    workplace.done("identify --quiet --measurements m.csv --identified-out i.json");
    let scenario = workplace.scenario("s.toml");
    for dialect in ["krl", "urscript"] {
        let json = workplace
            .json(&format!(
                "compensate --identified i.json --angles-out a.csv --program-out back --dialect {dialect}"
            ));
        let told = read_program(&workplace, "back/compensated_s", dialect);
        let poses = json["test_poses"].as_array().expect("test poses");
        let logged = logged(&told);
        assert_eq!((poses.len(), logged.len()), (3, 3));
        let halts = told.iter().filter(|each| matches!(each, Told::Halt));
        assert_eq!(halts.count(), 3);
        let table = workplace.read("a.csv");
        let mut rows = table.lines();
        assert_eq!(
            rows.next(),
            Some(
                "test_pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,rho0_mm"
            )
        );
        for ((pose, at), row) in poses.iter().zip(&logged).zip(rows) {
            let commanded = numbers(&pose["q_commanded_deg"]);
            let name = pose["name"].as_str().expect("a name").replace('"', "\"\"");
            let quoted = format!("\"{name}\",");
            let fields = row
                .strip_prefix(&quoted)
                .or_else(|| row.strip_prefix(&format!("{name},")))
                .expect(row);
            let written: Vec<f64> = (fields.split(','))
                .map(|field| field.parse().expect("a number"))
                .collect();
            assert_eq!(written[..6], commanded);
            assert_eq!(written[6..12], [0.0, 280.0, -180.0, 0.0, 0.0, 0.0]);
            for (angle, wanted) in at.iter().zip(&commanded) {
                let apart = (angle - wanted).to_radians().abs();
                assert!(apart < 1e-9, "{dialect}: {apart} rad");
            }
        }
        let straight: Vec<Told> = logged.into_iter().map(Told::Move).collect();
        assert!(least_distance(&scenario, &straight, &[Load::NONE], 0.02) < 0.0);
        let least = least_distance(&scenario, &told, &[Load::NONE], 0.02);
        assert!(least >= 0.01, "{dialect}: {least} m");
    }
    // Nothing is written where there is no way.
    let text = workplace
        .read("s.toml")
        .replace("size_mm = [400, 400, 3000]", "size_mm = [2500, 400, 3000]");
    workplace.write("s.toml", text);
    let outcome = workplace.refused(
        "compensate s.toml --quiet --identified i.json --angles-out b.csv --program-out none",
    );
    outcome.says("no way is found from test pose");
    assert!(!workplace.path("b.csv").exists() && !workplace.path("none").exists());
    let outcome = workplace.misused("compensate --quiet --identified i.json --dialect krl");
    outcome.says("--program-out");
}

/// The minutes are the sum of what the laboratory's table says.
#[test]
fn minutes_are_what_the_work_costs() {
    let workplace = behind_a_pillar();
    let table = "[laboratory]\nstation_min = 7\nmove_min = 2\nload_change_min = 11\nreading_min = 0.25\n\
                 axis_speed_deg_s = 5\nsafe_deg = [[0, -120, 120, 0, 0, 0]]\n";
    workplace.write("t.toml", workplace.read("s.toml") + table);
    let json = workplace.json("lab t.toml --plan plan.csv");
    let travel_min = json["travel_deg"].as_f64().expect("a number") / 5.0 / 60.0;
    // Joints come back otherwise at each visit: seven without a load, and seven with it.
    let expected = 7.0 + 14.0 * 2.0 + 11.0 + 14.0 * 0.25 + travel_min;
    let minutes = json["minutes"].as_f64().expect("a number");
    assert!((minutes - expected).abs() < 1e-9, "{minutes} {expected}");
    // It begins and ends at the safe pose.
    let told = read_program(&workplace, "out/t/lab/t", "krl");
    let moves: Vec<&Told> = told
        .iter()
        .filter(|each| matches!(each, Told::Move(_)))
        .collect();
    let home = Told::Move(vec![0.0, -120.0, 120.0, 0.0, 0.0, 0.0]);
    assert_eq!([moves[0], moves[moves.len() - 1]], [&home, &home]);
    assert_has(&workplace.read("out/t/lab/t.src"), "BAS (#VEL_PTP,10)");
}

/// Where something is new at each visit, as predictions count it, repeats are visits: the robot leaves a configuration before it comes there
/// again, without the load and with it, and each measurement has visits of its own. Otherwise they are readings of one.
#[test]
fn repeats_are_visits_where_something_is_new_at_each() {
    let workplace = Workplace::new();
    let plan = "0,-90,90,0,30,0,0,0,-2500,0,0,0,3\n0,-80,100,20,40,10,0,0,-2500,0,0,0,2\n";
    workplace.write("plan.csv", format!("{COLUMNS}{plan}"));
    let paper = scenario_text("klimchik2012").replace("tool_elevation_max_deg = 30\n", "");
    let returns = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.02\n";
    let shared = [
        "sigma_of = \"deflection\"",
        "sigma_of = \"position\"\nunloaded = \"shared\"",
    ];
    for (source, is_shared, stops) in [("", false, 4), (returns, false, 10), (returns, true, 7)] {
        let mut text = paper.clone() + source;
        if is_shared {
            text = text.replacen(shared[0], shared[1], 1);
        }
        workplace.write("s.toml", text);
        let json = workplace.json("lab s.toml --plan plan.csv");
        let all = json["stops"].as_array().expect("a list");
        assert_eq!(all.len(), stops, "{json}");
        assert_eq!(json["load_changes"], 1);
        let table = workplace.read("out/s/lab/measurements.csv");
        let rows = table.lines().filter(|line| !line.starts_with('#'));
        let rows: Vec<Vec<&str>> = (rows.skip(1))
            .map(|row| row.split(',').take(4).collect())
            .collect();
        assert_eq!(rows.len(), 5);
        if source.is_empty() {
            continue;
        }
        // Of each other's visits but the last of three.
        let stays = all
            .windows(2)
            .filter(|pair| pair[0]["q_deg"] == pair[1]["q_deg"]);
        assert!(stays.count() <= 2, "{json}");
        let mut loaded: Vec<&str> = rows.iter().map(|row| row[2]).collect();
        let mut unloaded: Vec<&str> = rows.iter().map(|row| row[0]).collect();
        for (visits, count) in [
            (&mut loaded, 5),
            (&mut unloaded, if is_shared { 2 } else { 5 }),
        ] {
            visits.sort_unstable();
            visits.dedup();
            assert_eq!(visits.len(), count, "{table}");
        }
        for row in &rows {
            let at = |place: &str| &all[place.parse::<usize>().expect("a stop") - 1];
            assert_eq!(at(row[0])["q_deg"], at(row[2])["q_deg"]);
            assert_eq!([row[1], row[3]], ["1", "1"]);
            assert!(at(row[0])["wrench"].is_null() && at(row[2])["wrench"].is_array());
        }
    }
}

/// The minutes between the unloaded and the loaded reading of each row of a laboratory's table, by the stops of its record and the default
/// costs; joints take no time.
fn between_readings_min(workplace: &Workplace, folder: &str) -> Vec<f64> {
    let record = serde_json::from_str::<Value>(&workplace.read(&format!("{folder}/campaign.json")));
    let record = record.expect("JSON");
    let (mut now, mut read_at) = (0.0, Vec::new());
    for stop in record["stops"].as_array().expect("a list") {
        let reading = 0.5 * stop["readings"].as_f64().expect("a number");
        let hung = f64::from(u8::from(stop["changes_load"] == true));
        now += 1.0 + 10.0 * hung + reading;
        read_at.push(now - 0.5 * reading);
    }
    let table = workplace.read(&format!("{folder}/measurements.csv"));
    let rows = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|row| {
        let places: Vec<usize> = (row.split(',').step_by(2).take(2))
            .map(|place| place.parse().expect("a stop"))
            .collect();
        read_at[places[1] - 1] - read_at[places[0] - 1]
    })
    .collect()
}

/// Where the instrument drifts, the times between the readings of deflections are alike, as predictions count them: the configurations of
/// each load are visited in one order without it and with it. Other times are told.
#[test]
fn drifts_are_over_times_that_are_alike() {
    let workplace = Workplace::new();
    let rows: Vec<String> = (0..6)
        .map(|place| {
            let (q1, q2) = (place * 47 % 100, 20 * (place % 3) - 100);
            let force = if place % 2 == 0 {
                "0,0,-2500"
            } else {
                "1000,0,0"
            };
            format!("{q1},{q2},90,0,30,0,{force},0,0,0,{}\n", 1 + place % 2)
        })
        .collect();
    let of_one_load = rows.iter().step_by(2).cloned().collect::<String>();
    workplace.write("several.csv", format!("{COLUMNS}{}", rows.concat()));
    workplace.write("one.csv", format!("{COLUMNS}{of_one_load}"));
    let list =
        "kind = \"list\"\nwrenches = [{ force_n = [0, 0, -2500] }, { force_n = [1000, 0, 0] }]";
    let paper = scenario_text("klimchik2012")
        .replace("tool_elevation_max_deg = 30\n", "")
        .replace("kind = \"fixed\"\nforce_n = [0, 0, -2500]", list);
    let paper = paper + "[laboratory]\naxis_speed_deg_s = 1e4\n";
    let drift = "[[uncertainty]]\nkind = \"drift\"\nstd_um_per_h = 60\n";
    let returns = "[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.02\n";
    for (plan, sources, most_min) in [
        ("one.csv", "", 20.0),
        ("one.csv", drift, 0.01),
        ("several.csv", drift, 5.0),
        ("several.csv", &*format!("{drift}{returns}"), 5.0),
    ] {
        workplace.write("s.toml", format!("{paper}{sources}"));
        let outcome = workplace.run(&format!("lab s.toml --quiet --plan {plan}"));
        let times = between_readings_min(&workplace, "out/s/lab");
        let [low, high] =
            [f64::min, f64::max].map(|end| times.iter().copied().reduce(end).expect("some"));
        assert!(high - low < most_min, "{plan} {sources}: {times:?}");
        let counts = outcome.stderr.contains("C0115");
        // By three measurements of design.experiments, 14.5 min are counted.
        assert_eq!(
            counts,
            !sources.is_empty() && (high > 18.1 || high - low > 3.6),
            "{times:?} {}",
            outcome.stderr
        );
        assert!(sources.is_empty() || low > 0.0);
    }
}

/// Where no approach leads the robot away from the only configuration, its visits are stops at which it does not move, and that is told.
#[test]
fn visits_without_a_move_are_told() {
    let workplace = Workplace::new();
    let plan = "0,-90,90,0,30,0,0,0,-2500,0,0,0,3\n";
    workplace.write("plan.csv", format!("{COLUMNS}{plan}"));
    let returns = "[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.02\n";
    for (approach_deg, is_told) in [(0, true), (2, false)] {
        let laboratory = format!("[laboratory]\napproach_deg = {approach_deg}\n");
        let text = scenario_text("klimchik2012") + &laboratory + returns;
        workplace.write("s.toml", text);
        let outcome = workplace.run("lab s.toml --quiet --plan plan.csv");
        let told = "C0114: the robot is already there at stop 2, 3, 5, 6";
        assert_eq!(outcome.stderr.contains(told), is_told, "{}", outcome.stderr);
    }
}

/// Where loads are hung in place, each measurement is one move, one load and two readings, and the instrument drifts no longer than a load
/// takes.
#[test]
fn loads_may_be_hung_where_the_robot_stands() {
    let workplace = behind_a_pillar();
    let table = "[laboratory]\nloading = \"LOADING\"\nstation_min = 7\nmove_min = 2\nload_change_min = 11\nreading_min = 0.25\n\
                 axis_speed_deg_s = 5\n[[uncertainty]]\nkind = \"drift\"\nstd_um_per_h = 60\n";
    let experiments = 7.0;
    let [returns, in_place] = [("returns", 3), ("in_place", 0)].map(|(loading, code)| {
        let table = table.replace("LOADING", loading);
        workplace.write("t.toml", workplace.read("s.toml") + &table);
        let outcome = workplace.run("lab t.toml --plan plan.csv --json --quiet");
        assert_eq!(outcome.stderr.contains("C0115"), code == 3);
        let json = outcome.ends_with(code).json();
        let planned = workplace.run("evaluate t.toml --plan plan.csv --no-proof --json --quiet");
        let of_drift = |source: &&Value| source["source"] == "drift";
        let planned = planned.json();
        let sources = planned["uncertainty_budget"]["sources"].as_array();
        let drift = sources
            .expect("a list")
            .iter()
            .find(of_drift)
            .expect("drift");
        (
            json,
            drift["standard_uncertainty"].as_f64().expect("a number"),
        )
    });
    let json = &in_place.0;
    let number = |key: &str| json[key].as_f64().expect("a number");
    let work = 7.0 + experiments * (2.0 + 11.0 + 2.0 * 0.25);
    let travel_min = number("travel_deg") / 5.0 / 60.0;
    assert!((number("minutes") - work - travel_min).abs() < 1e-9);
    assert_eq!(json["load_changes"], experiments);
    for pair in json["stops"].as_array().expect("a list").chunks(2) {
        assert_eq!(pair[0]["q_deg"], pair[1]["q_deg"]);
        assert!(pair[0]["wrench"].is_null() && pair[1]["wrench"].is_array());
    }
    // Each loaded reading has the unloaded one before it.
    let table = workplace.read("out/t/lab/measurements.csv");
    let rows = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    let stops = rows.map(|row| {
        row.split(',')
            .take(4)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    });
    for (place, row) in stops.enumerate() {
        let [unloaded, loaded] = [2 * place + 1, 2 * place + 2].map(|stop| stop.to_string());
        assert_eq!(row, [&*unloaded, "1", &*loaded, "1"]);
    }
    let hours = |of: f64| of / 60e-3;
    assert_near(hours(in_place.1), 11.0 / 60.0, 1e-9);
    assert!(returns.1 > in_place.1);
    let shared =
        workplace
            .read("t.toml")
            .replacen("[instrument]", "[instrument]\nunloaded = \"shared\"", 1);
    workplace.write("shared.toml", shared);
    let said = workplace.refused("check shared.toml");
    said.says("laboratory.loading: is \"in_place\", and instrument.unloaded");
}

/// The order has as few changes of load as there are loads, and short moves; it can be kept.
#[test]
fn the_order_is_short_and_can_be_kept() {
    let workplace = Workplace::new();
    let text = scenario_text("kr270")
        .replace("line_of_sight = true", "")
        .replace("tool_elevation_max_deg = 30", "")
        .replace(
            "kind = \"fixed\"\nforce_n = [0, 0, -2500]",
            "kind = \"any\"\nforce_max_n = 2500",
        );
    workplace.write("s.toml", text);
    let rows: String = [
        (0, -2500),
        (40, -1000),
        (5, -2500),
        (35, -1000),
        (10, -2500),
    ]
    .map(|(turn, force)| format!("{turn},-90,90,0,30,0,0,0,{force},0,0,0,1\n"))
    .concat();
    workplace.write("plan.csv", format!("{COLUMNS}{rows}"));
    let of = |options: &str| {
        let json = workplace.json(&format!("lab s.toml --plan plan.csv {options}"));
        let stops = json["stops"].as_array().expect("stops").clone();
        let order: Vec<f64> = stops
            .iter()
            .map(|stop| numbers(&stop["experiments"])[0])
            .collect();
        (json, order)
    };
    let (short, order) = of("");
    let (kept, given) = of("--keep-order");
    assert_eq!(short["load_changes"], 2);
    assert_eq!(kept["load_changes"], 5);
    assert_eq!(given, [1.0, 2.0, 3.0, 4.0, 5.0].repeat(2));
    let along = |part: &[f64], wanted: &[f64]| {
        let reversed: Vec<f64> = wanted.iter().rev().copied().collect();
        assert!(part == wanted || part == reversed, "{part:?}");
    };
    along(&order[..5], &[1.0, 3.0, 5.0, 4.0, 2.0]);
    along(&order[5..8], &[1.0, 3.0, 5.0]);
    let minutes = |json: &Value| json["minutes"].as_f64().expect("a number");
    assert!(minutes(&short) < minutes(&kept));
}

/// What was not looked at, and what does not hold, is said.
#[test]
fn doubts_about_a_plan_are_told() {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let lab = format!("lab s.toml --quiet --plan {plan}");
    let outcome = workplace.doubted(&lab);
    outcome.prints("Moves were not looked at");
    outcome.says("tool elevation is 30.033 deg");
}

/// The joints of a KUKA beyond six are its external axes, a track before all others.
#[test]
fn more_than_six_joints_are_external_axes() {
    let krl = Dialect::known("krl").expect("a dialect");
    let scenario = Scenario::load(&project("scenarios/kr270.toml")).expect("a scenario");
    let q = DVector::from_vec(vec![
        1.5,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0_f64.to_radians(),
    ]);
    let steps = vec![ProgramStep::Move(q)];
    let program = Program {
        steps,
        ..Program::default()
    };
    let slides = (0..8).map(|joint| joint == 0);
    let files = program.files(&krl, &scenario.laboratory, &slides.collect(), "p");
    let text = &files.expect("a program")[0].text;
    let says = "PTP {E1 1500,A1 0,A2 0,A3 0,A4 0,A5 0,A6 0,E2 1}";
    assert!(text.contains(says), "{text}");
}

/// Joints that slide are no axes that turn, of six joints neither.
#[test]
fn slides_are_never_axes_that_turn() {
    let slides = |count: usize| -> Commands {
        (0..6)
            .map(|joint| (2..2 + count).contains(&joint))
            .collect()
    };
    let [krl, urscript] = ["krl", "urscript"].map(|name| Dialect::known(name).expect("a dialect"));
    let axes = Ok(vec!["A1", "A2", "E1", "A3", "A4", "A5"]);
    assert_eq!(krl.axes_of(&slides(1)), axes);
    let says = "the dialect urscript is for 0 joints that slide; the robot has 1";
    let refused = urscript.axes_of(&slides(1)).expect_err("none slides");
    assert_eq!(refused.to_string(), says);
    assert!(urscript.axes_of(&slides(0)).is_ok());
    let own = Dialect {
        in_model_order: true,
        ..urscript
    };
    assert_eq!(own.axes_of(&slides(1)), own.axes_of(&slides(0)));
}

/// Dialects are data: a file of one's own serves another robot.
#[test]
fn a_dialect_may_be_a_file() {
    let workplace = Workplace::with("s.toml", scenario_text("planar_3r"));
    workplace.done("plan s.toml --quiet --no-proof --plan-out plan.csv");
    // Without one, sheet and table are there, and it is said.
    let outcome = workplace.doubted("lab s.toml --plan plan.csv");
    outcome.says("condition C0110: no robot program is written: the dialect krl is for 6 to 12 axes; the robot has 3");
    let written = |name: &str| workplace.path(&format!("out/s/lab/{name}")).exists();
    assert!(written("run_sheet.html") && written("measurements.csv") && !written("s.src"));
    let own = "name = \"own\"\naxes = [\"a\", \"b\", \"c\"]\nangles = \"degrees\"\ndecimals = 6\n\
               target = \"<axis>=<value>\"\nbetween = \" \"\nlongest_name = 20\nmove = \"GO <target>\"\n\
               comment = \"# <text>\"\nhalt = \"STOP <text>\"\nlog = \"KEEP <index>\"\n\
               [[file]]\nending = \"job\"\ntext = \"JOB <name>\\n<steps>\\n\"\n";
    workplace.write("own.toml", own);
    workplace.done("lab s.toml --quiet --plan plan.csv --dialect own.toml");
    let job = workplace.read("out/s/lab/s.job");
    assert!(job.starts_with("JOB s\n# Stop 1: experiment "), "{job}");
    let stops = job.lines().filter(|line| line.starts_with("KEEP ")).count();
    assert_eq!(stops, 6);
    for (wrong, says) in [
        ("move", "missing field `move`"),
        ("axes = [\"a\", \"b\", \"c\"]", "axes is empty"),
        ("<steps>", "one text needs <steps>"),
    ] {
        let text = match wrong {
            "move" => own.replace("move = ", "# "),
            "<steps>" => own.replace(wrong, ""),
            axes => own.replace(axes, "axes = []"),
        };
        workplace.write("wrong.toml", text);
        let outcome = workplace.refused("lab s.toml --quiet --plan plan.csv --dialect wrong.toml");
        assert!(
            outcome
                .stderr
                .starts_with("error E0404: wrong.toml: is no dialect: "),
            "{outcome:#?}"
        );
        outcome.says(says);
    }
    assert_eq!(Dialect::names(), ["krl", "urscript"]);
}

#[test]
fn wrong_laboratories_are_told() {
    let workplace = behind_a_pillar();
    let good = workplace.read("s.toml");
    for (table, says) in [
        (
            "move_min = -1",
            "laboratory.move_min: found -1; zero or a positive number is allowed",
        ),
        (
            "axis_speed_deg_s = 0",
            "laboratory.axis_speed_deg_s: found 0",
        ),
        (
            "speed_percent = 101",
            "laboratory.speed_percent: found 101; 1 to 100 are allowed",
        ),
        (
            "safe_deg = [[0, -90, 90]]",
            "laboratory.safe_deg[0]: found 3 numbers; the robot has 6 joints",
        ),
        (
            "safe_deg = [[0, 90, 90, 0, 0, 0]]",
            "laboratory.safe_deg[0]: found 90 for joint_2",
        ),
        (
            "dialect = \"rapid\"",
            "there is no dialect \"rapid\"; there are krl, urscript",
        ),
        ("sped = 1", "unknown field `sped`"),
    ] {
        workplace.write("w.toml", format!("{good}[laboratory]\n{table}\n"));
        let outcome = workplace.refused("lab w.toml --quiet --plan plan.csv");
        outcome.says(says);
        assert!(!workplace.path("out/w").exists());
    }
    // A robot that is walled in finds no way out.
    let wall = "[[obstacle]]\nname = \"wall\"\nkind = \"box\"\nsize_mm = [6000, 100, 6000]\nposition_mm = [3400, 0, 3000]\n";
    let behind = "[[obstacle]]\nname = \"other wall\"\nkind = \"box\"\nsize_mm = [6000, 100, 6000]\nposition_mm = [-3400, 0, 3000]\n";
    workplace.write("w.toml", good + wall + behind);
    let outcome = workplace.refused("lab w.toml --quiet --plan plan.csv");
    outcome.says("no way is found from experiment ");
    outcome.says("safe_deg");
}

/// Every stop has its approach in the library, too.
#[test]
fn campaigns_are_a_function_of_their_inputs() {
    let workplace = behind_a_pillar();
    let scenario = workplace.scenario("s.toml");
    let plan = plan_of(&workplace);
    let campaign =
        || Campaign::new(&scenario.task, &scenario.laboratory, &plan, false).expect("ways");
    let once = campaign();
    assert_eq!(once, campaign());
    assert!(once.stops.iter().any(|stop| !stop.way.via.is_empty()));
    assert!(once.stops.iter().all(|stop| stop.approach.is_some()));
}

/// The sheet as a browser shows it.
#[test]
fn the_run_sheet_looks_well() {
    let workplace = behind_a_pillar();
    workplace.done("lab s.toml --quiet --plan plan.csv");
    let sheet = workplace.read("out/s/lab/run_sheet.html");
    assert_eq!(sheet.matches("class=\"stop\"").count(), 14);
    let hang = "hang the load (0,\u{a0}0,\u{a0}\u{2212}2500) N";
    assert_eq!(sheet.matches(hang).count(), 1);
    assert_eq!(sheet.matches("class=\"tick\"").count(), 14);
    // Each configuration once, though it is visited twice or more often, and where the load hangs.
    assert_eq!(sheet.matches("class=\"place\"").count(), 4);
    for said in [
        ", 254.84 kg.",
        "instrument, serial number",
        "at the TCP of tool 1",
    ] {
        assert_eq!(sheet.matches(said).count(), 1, "{said}");
    }
    crate::browser::looks_well(&workplace.path("out/s/lab/run_sheet.html"), 5);
}

/// Loads and configurations that differ by less than what is printed are hung and shown once.
#[test]
fn what_is_printed_alike_is_one() {
    let workplace = behind_a_pillar();
    let again = "-50.00001,-90,90,0,30,0,0,0,-2500.00001,0,0,0,1\n";
    workplace.write("plan.csv", workplace.read("plan.csv") + again);
    let json = workplace.json("lab s.toml --plan plan.csv");
    assert_eq!(json["load_changes"], 1);
    assert_eq!(json["stops"].as_array().map(Vec::len), Some(16));
    let sheet = workplace.read("out/s/lab/run_sheet.html");
    assert_eq!(sheet.matches("class=\"place\"").count(), 4);
}

/// Where one load of a list serves all, there is more time than for a load a configuration: a plan by minutes is no worse than one of
/// three configurations that takes less.
#[test]
fn plans_by_minutes_count_the_loads_that_they_hang() {
    let workplace = Workplace::new();
    let load = "kind = \"any\"\nforce_max_n = 400\n";
    let list =
        "kind = \"list\"\nwrenches = [{ force_n = [0, 0, -100] }, { force_n = [0, 0, -1] }]\n";
    let joints = "[\"joint_1\", \"joint_2\", \"joint_3\"]";
    let text = scenario_text("spatial_3r")
        .replace(load, list)
        .replace(joints, "[\"joint_2\", \"joint_3\"]")
        + "\n[[uncertainty]]\nkind = \"discrepancy\"\nof = \"elastic\"\nstd_mm = 0.2\n";
    assert!(text.contains(list) && !text.contains(joints));
    workplace.write("s.toml", text);
    let rho0 = |options: &str| {
        let plan = format!("plan s.toml --no-proof {options} --json --quiet");
        workplace.run(&plan).json()["rho0_mm"]
            .as_f64()
            .expect("a number")
    };
    let three = rho0("--experiments 3 --configurations 3 --plan-out three.csv");
    let lab = (workplace.run("lab s.toml --plan three.csv --json --quiet")).json();
    assert!(lab["minutes"].as_f64().expect("a number") < 44.0);
    assert!(rho0("--minutes 44") < three * 1.001);
}

/// Where the measurements of a configuration share one reading without a load, that is read once: a plan by minutes is no worse than those of
/// other sizes that take no longer.
#[test]
fn plans_by_minutes_count_shared_readings_once() {
    let workplace = Workplace::new();
    let costs =
        "\n[laboratory]\nstation_min = 20\nmove_min = 5\nload_change_min = 15\nreading_min = 2\n";
    let [own, shared] = ["\"deflection\"", "\"position\"\nunloaded = \"shared\""];
    let text = scenario_text("planar_3r").replacen(own, shared, 1) + costs;
    workplace.write("s.toml", text);
    let rho0_and_minutes = |options: &str| {
        let json = workplace.json(&format!(
            "plan s.toml --no-proof {options} --plan-out p.csv"
        ));
        let lab = (workplace.run("lab s.toml --plan p.csv --json --quiet")).json();
        [number(&json["rho0_mm"]), number(&lab["minutes"])]
    };
    let [timed_mm, taken] = rho0_and_minutes("--minutes 120");
    assert!(taken <= 120.0);
    for size in [[4, 4], [12, 4], [16, 4], [6, 5], [10, 5], [6, 6]] {
        let [measurements, configurations] = size;
        let [rho0_mm, minutes] = rho0_and_minutes(&format!(
            "--experiments {measurements} --configurations {configurations}"
        ));
        println!("{size:?}: {rho0_mm} mm in {minutes} min, {timed_mm} in {taken}");
        assert!(minutes > 120.0 || timed_mm < 1.002 * rho0_mm, "{size:?}");
    }
}

/// A plan by minutes repeats where that is cheap: it takes no longer, ways included, and predicts less error than as many
/// different configurations as there is time for.
#[test]
fn plans_by_minutes_repeat_where_that_is_cheap() {
    let workplace = Workplace::new();
    let table =
        "\n[laboratory]\nstation_min = 20\nmove_min = 5\nload_change_min = 15\nreading_min = 0.5\n";
    workplace.write("s.toml", scenario_text("planar_3r") + table);
    // Joints that turn slowly take much of the time.
    workplace.write(
        "slow.toml",
        scenario_text("planar_3r") + table + "axis_speed_deg_s = 0.5\n",
    );
    let of =
        |name: &str, options: &str| workplace.json(&format!("plan {name} --no-proof {options}"));
    let number = |json: &Value, key: &str| json[key].as_f64().expect("a number");
    let mut counts = Vec::new();
    for name in ["s.toml", "slow.toml"] {
        let timed = of(name, "--minutes 80 --plan-out timed.csv");
        let scenario = workplace.scenario(name);
        let plan = read_plan(&workplace.path("timed.csv"), 3).expect("a plan");
        let campaign = Campaign::new(&scenario.task, &scenario.laboratory, &plan, false);
        let taken = campaign.expect("ways").minutes;
        assert!(taken <= 80.0, "{name}: {taken} minutes");
        // Nor is there time for one more reading without a load and one with it.
        assert!(taken > 78.0, "{name}: {taken} minutes");
        let said = number(&timed, "minutes");
        assert!((said - taken).abs() < 1e-6, "{name}: {said} {taken}");
        counts.push(number(&timed, "experiments"));
        if name == "s.toml" {
            // Four different configurations: 20 + 8 * 5 + 15 + 8 * 0.5 = 79 minutes without turning.
            let counted = of(name, "--experiments 4");
            assert!(number(&timed, "rho0_mm") < 0.6 * number(&counted, "rho0_mm"));
        }
    }
    assert!(counts[1] < counts[0] - 2.0, "{counts:?}");
    let outcome = workplace.refused("plan s.toml --quiet --minutes 30");
    outcome.says("no plan takes at most 30 minutes");
    // As little time as possible for an accuracy.
    let needed = |options: &str| {
        let json = workplace.json(&format!(
            "budget s.toml --no-proof --up-to 5 --accuracy-um 9.7 {options}"
        ));
        number(&json, "needed_minutes")
    };
    assert!(needed("--by-minutes --plot-out time.svg") < needed("--plot-out size.svg"));
    // What is over time has a time on its axis.
    let axis = ["time.svg", "size.svg"].map(|plot| {
        let svg = workplace.read(plot);
        ["time in the laboratory [min]", "measurements, logarithmic"].map(|name| svg.contains(name))
    });
    assert_eq!(axis, [[true, false], [false, true]]);
}

/// A drift is of deflections: absolute readings are in the order that is short with it and without.
#[test]
fn the_order_of_absolute_readings_knows_no_drift() {
    let workplace = Workplace::new();
    let region = "tool_height_min_mm = 300\ntool_radius_min_mm = 400\n";
    let ur10 = absolute_scenario_text("ur10");
    assert!(ur10.contains(region));
    let head = ur10.replace(region, "");
    let row = |row: i32| {
        let [q1, q2] = [row * 47 % 100, -(row * 31 % 60) - 40];
        let load = ["0,0,0", "0,0,-98"][usize::from(row % 2 == 1)];
        format!("{q1},{q2},90,-100,90,0,{load},0,0,0,reflector,1\n")
    };
    let rows: Vec<String> = (0..8).map(row).collect();
    let columns = COLUMNS.replace(",repeats", ",target,repeats");
    workplace.write("plan.csv", columns + &rows.concat());
    let drift = "[[uncertainty]]\nkind = \"drift\"\nstd_um_per_h = 60\n";
    let [without, with] = ["", drift].map(|source| {
        workplace.write("s.toml", format!("{head}\n{source}"));
        workplace.record("lab s.toml --plan plan.csv")["stops"].clone()
    });
    assert_eq!(without, with);
}
