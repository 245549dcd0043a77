//! The scenario as a commented TOML file.

use std::fmt::Write as _;

use nalgebra::Vector3;

use super::SCHEMA_FILE;
use super::arm::FoundArm;
use super::pose::{CLEARANCE_M, Tried};
use super::tools::Tools;
use crate::robot::{Commands, Joint};

/// A joint may turn by so much (rad) under its largest torque where its stiffness is guessed ...
const TURN_RAD: f64 = 2e-3;
/// ... or slide by so much (m).
const SLIDE_M: f64 = 1e-4;
/// The model's gains are a simulation's where the own weight turns a joint further than this (rad).
const SAG_RAD: f64 = 0.01;
/// Loads, as a share of what the robot weighs.
const LOAD_SHARE: f64 = 0.2;
/// The load of a robot without masses (N).
const LOAD_N: f64 = 50.0;
/// Where fewer configurations are free, what collides is a flaw of the model.
const FREE: f64 = 0.05;
/// Compliances that a model has may be wrong by this share ...
const MODEL_SHARE: f64 = 0.3;
/// ... and those that are guessed by this.
const GUESSED_SHARE: f64 = 1.0;
/// What mastering leaves of a joint's zero (mrad) ...
const ZERO_MRAD: f64 = 0.2;
/// ... and machining of a link (mm), of each coordinate.
const LINK_MM: f64 = 0.3;
/// Joint error functions of a real robot: their standard deviation (mrad) and correlation length (deg).
const FUNCTION_MRAD: f64 = 0.45;
const FUNCTION_DEG: f64 = 3.5;
/// As few measurements as a first plan has.
const LEAST_MEASUREMENTS: usize = 4;

/// Where a joint's stiffness comes from.
enum Stiffness {
    Model,
    Guessed(Vec<f64>, String),
}

/// Writes the scenario, with what was found on the way, in sentences.
pub(super) fn scenario(
    arm: &FoundArm,
    tools: &Tools,
    tried: &Tried,
    model: &str,
) -> (String, Vec<String>) {
    let load_n = load_n(arm);
    let stiffness = stiffness(arm, tried, load_n);
    let mut found = found(arm, tools, tried);
    if let Stiffness::Guessed(_, reason) = &stiffness {
        found.push(format!("The compliances are guesses: {reason}."));
    }
    let description = quoted(&format!("A first scenario for {model}"));
    let mut text = format!(
        "#:schema {SCHEMA_FILE}\n\
         # A first scenario, made by `elastocal init`. Lines that say GUESS need your numbers.\n\
         description = {description}\nseed = 1\n\n[robot]\nmodel = {}\n",
        quoted(model)
    );
    text += &robot(arm, tools, &stiffness);
    text += "\n[instrument]\n\
             # GUESS: the standard deviation of each coordinate of a laser tracker's reading.\n\
             sigma_mm = 0.03\nsigma_of = \"position\"\n";
    text += &priors(arm, &stiffness);
    let pose = Commands::from(&arm.chain).numbers(&tried.best);
    let task_n = round_down(load_n / 2.0);
    let _ = write!(
        text,
        "\n# GUESS: where the robot must be accurate, and the force that acts on it there.\n\
         [[test_pose]]\nname = \"task\"\nq_deg = [{}]\nforce_n = [0, {}, {}]\n",
        list(pose),
        short(task_n),
        short(-task_n)
    );
    text += "\n# GUESS: loads of the laboratory, at the calibration tool: a weight, and the same pulled sideways.\n\
             [load]\nkind = \"list\"\nwrenches = [\n";
    for force in weight_and_sideways(&arm.chain.gravity_m_s2, load_n) {
        let _ = writeln!(text, "  {{ force_n = [{}] }},", list(force.iter().copied()));
    }
    text += "]\n";
    let wanted = arm.chain.joints.len().max(LEAST_MEASUREMENTS);
    let _ = write!(
        text,
        "\n[region]\n# tool_height_min_mm = 200\n# joint_torque_max_nm = [...]\n{}\n\n\
         [design]\n# Measurements of the plan, repeats counted.\nexperiments = {wanted}\n",
        region(tried)
    );
    (text, found)
}

/// A force along that axis of the world that gravity is nearest to, down z without any, and along the two others.
fn weight_and_sideways(gravity_m_s2: &Vector3<f64>, force_n: f64) -> [Vector3<f64>; 3] {
    let down = match gravity_m_s2.iamax() {
        axis if gravity_m_s2[axis] != 0.0 => axis,
        _ => 2,
    };
    let sign = if gravity_m_s2[down] > 0.0 { 1.0 } else { -1.0 };
    let sideways = |by: usize| Vector3::ith((down + by) % 3, force_n);
    [Vector3::ith(down, sign * force_n), sideways(1), sideways(2)]
}

/// The rest of the table `[robot]`.
fn robot(arm: &FoundArm, tools: &Tools, stiffness: &Stiffness) -> String {
    let mut text = String::new();
    let mut line = |written: String| {
        let _ = writeln!(text, "{written}");
    };
    if !tools.known.is_empty() {
        let known = one_line(&tools.known.join(", "));
        line(format!("# Sites that the whole arm moves: {known}."));
    }
    line(format!("calibration_site = {}", quoted(&tools.sites[0])));
    line(format!("machining_site = {}", quoted(&tools.sites[1])));
    let chain = &arm.chain;
    let names = (chain.commanded()).map(|joint| quoted(&chain.joints[joint].name));
    let names: Vec<String> = names.collect();
    line("# The joints whose compliances are to be found.".to_owned());
    line(format!("parameters = [{}]", names.join(", ")));
    if let Some(reason) = &arm.actuators_ignored {
        let reason = one_line(reason);
        line(format!("# The model's actuators do not count: {reason}."));
        line("actuators = \"ignored\"".to_owned());
    }
    if let Stiffness::Guessed(values, reason) = stiffness {
        line(format!(
            "# GUESS: one over each joint's stiffness [rad/(N m); slides m/N]: {reason}."
        ));
        let values: Vec<String> = values.iter().map(|value| format!("{value:e}")).collect();
        line(format!("compliance_rad_per_nm = [{}]", values.join(", ")));
    }
    for (slides, key) in [(false, "locked_deg"), (true, "locked_mm")] {
        let of_kind = arm.locked.iter().filter(|each| each.2 == slides);
        let locked: Vec<String> = of_kind
            .map(|(name, value, _)| {
                let shown = if slides {
                    value * 1e3
                } else {
                    value.to_degrees()
                };
                format!("{} = {}", quoted(name), short(shown))
            })
            .collect();
        if !locked.is_empty() {
            line("# Joints beside the arm do not move.".to_owned());
            line(format!("{key} = {{ {} }}", locked.join(", ")));
        }
    }
    for tool in &tools.mounted {
        line(format!(
            "\n# GUESS: where the tool is, in the frame of what carries it.\n[[robot.tool]]\nname = {}\non = {}\nposition_mm = [{}]",
            quoted(tool.name),
            quoted(&tool.on),
            list((tool.position_m * 1e3).iter().copied())
        ));
    }
    text
}

/// What is known of compliances and geometry before any measurement, so that weak ones stay near what the model says.
fn priors(arm: &FoundArm, stiffness: &Stiffness) -> String {
    let joints = &arm.chain.joints;
    let named = |is_meant: &dyn Fn(usize) -> bool| {
        let names = arm.chain.commanded().filter(|&joint| is_meant(joint));
        let names: Vec<String> = names.map(|joint| quoted(&joints[joint].name)).collect();
        (!names.is_empty()).then(|| names.join(", "))
    };
    let (share, why) = match stiffness {
        Stiffness::Model => (MODEL_SHARE, "the model's stiffnesses"),
        Stiffness::Guessed(..) => (GUESSED_SHARE, "the compliances above"),
    };
    let turns = |joint: usize| !joints[joint].drive.slides;
    let priors = [
        (
            format!("how much {why} may be wrong by, as a share of each"),
            "compliance",
            named(&|_| true),
            format!("std_relative = {share}"),
        ),
        (
            "joint zeros after mastering".to_owned(),
            "joint_zero",
            named(&turns),
            format!("std_mrad = {ZERO_MRAD}"),
        ),
        (
            "links' lengths after machining".to_owned(),
            "link_position",
            named(&|_| true),
            format!("std_mm = {LINK_MM}"),
        ),
    ];
    let written = priors.into_iter().filter_map(|(what, kind, joints, size)| {
        let joints = joints?;
        Some(format!(
            "\n# GUESS: {what}.\n[[uncertainty]]\nkind = \"{kind}\"\njoints = [{joints}]\n{size}\n"
        ))
    });
    let functions = named(&turns).map(|joints| {
        format!(
            "\n# Joints' errors as functions of their angles show in absolute accuracy alone. As large as a UR10's, whose gears are harmonic\n# drives (docs/joint_functions.md):\n# [[uncertainty]]\n# kind = \"transmission_error\"\n# joints = [{joints}]\n# std_mrad = {FUNCTION_MRAD}\n# correlation_deg = {FUNCTION_DEG}\n# correlation = \"matern32\"\n"
        )
    });
    written.chain(functions).collect()
}

fn list(values: impl IntoIterator<Item = f64>) -> String {
    let values: Vec<String> = values.into_iter().map(short).collect();
    values.join(", ")
}

/// The clearance, where the model's shapes leave any room.
fn region(tried: &Tried) -> String {
    let clearance = short(CLEARANCE_M * 1e3);
    match &tried.free {
        None => "# Nothing in the model collides.".to_owned(),
        Some((share, _)) if *share >= FREE => format!("collision_clearance_mm = {clearance}"),
        Some((_, [one, other])) => format!(
            "# Left out, since {} and {} touch nearly everywhere: exclude them in the model.\n# collision_clearance_mm = {clearance}",
            one_line(one),
            one_line(other)
        ),
    }
}

/// The joints' stiffnesses: the model's, unless they are missing or a simulation's.
fn stiffness(arm: &FoundArm, tried: &Tried, load_n: f64) -> Stiffness {
    let joints = &arm.chain.joints;
    let own = |joint: &Joint| joint.model_compliance_rad_per_nm.unwrap_or_default();
    let has_none = |joint: &Joint| joint.model_compliance_rad_per_nm.is_none();
    let turns = joints
        .iter()
        .zip(&tried.most)
        .map(|(joint, most)| (joint, own(joint) * most[0]));
    let sags = |(joint, by): &(&Joint, f64)| !joint.drive.slides && *by > SAG_RAD;
    let reason = if joints.iter().any(has_none) {
        "the model has no position actuators, whose gain would be the stiffness".to_owned()
    } else if let Some((joint, by)) = turns.clone().find(sags) {
        format!(
            "with the model's gains the own weight turns {} by up to {:.1} deg, a simulation's stiffness and no robot's",
            one_line(&joint.name),
            by.to_degrees()
        )
    } else {
        return Stiffness::Model;
    };
    let guess = joints.iter().zip(&tried.most).map(|(joint, most)| {
        let torque = (most[0] + most[1] * load_n).max(f64::MIN_POSITIVE);
        let turn = if joint.drive.slides {
            SLIDE_M
        } else {
            TURN_RAD
        };
        match joint.drive.passive_at {
            Some(_) => own(joint),
            None => two_digits((turn / torque).clamp(1e-9, 5e-4)),
        }
    });
    Stiffness::Guessed(guess.collect(), reason)
}

/// A load that suits the robot (N), rounded.
fn load_n(arm: &FoundArm) -> f64 {
    let mass: f64 = arm.chain.joints.iter().map(|joint| joint.mass_kg).sum();
    if mass < 1e-3 {
        return LOAD_N;
    }
    round_down(mass * 9.81 * LOAD_SHARE)
}

/// What is in the model, in sentences.
fn found(arm: &FoundArm, tools: &Tools, tried: &Tried) -> Vec<String> {
    let joints = arm.chain.joints.iter();
    let named = |is_meant: &dyn Fn(&&Joint) -> bool| {
        let names = joints
            .clone()
            .filter(is_meant)
            .map(|joint| joint.name.clone());
        names.collect::<Vec<_>>()
    };
    let weightless = named(&|joint| joint.mass_kg < 1e-3 && joint.drive.passive_at.is_none());
    let endless =
        named(&|joint| joint.drive.slides && joint.range_rad[1] - joint.range_rad[0] > 6.0);
    let locked = arm.locked.iter().map(|each| each.0.clone()).collect();
    let lists = [
        ("Joints beside the arm are locked", locked),
        (
            "The model's actuators do not count",
            arm.actuators_ignored.clone().into_iter().collect(),
        ),
        ("Sites on the last link", tools.known.clone()),
        (
            "Implausible: nothing weighs that these joints move by themselves",
            weightless,
        ),
        ("Implausible: slides without a range", endless),
    ];
    let lists = lists.into_iter().filter(|(_, names)| !names.is_empty());
    let mut found: Vec<String> = lists
        .map(|(what, names)| format!("{what}: {}.", names.join(", ")))
        .collect();
    if tools.known.is_empty() {
        found.push("No site is on the last link: tools are mounted there by guess.".to_owned());
    }
    if let Some((share, [one, other])) = &tried.free
        && *share < FREE
    {
        found.push(format!(
            "Implausible: {one} and {other} touch nearly everywhere; collisions are left out."
        ));
    }
    found
}

/// One significant digit, downwards.
fn round_down(value: f64) -> f64 {
    let size = 10.0_f64.powf(value.log10().floor());
    ((value / size + 1e-9).floor() * size).max(1e-3)
}

fn two_digits(value: f64) -> f64 {
    let size = 10.0_f64.powf(value.log10().floor() - 1.0);
    let digits = format!("{:.0}e{}", value / size, size.log10().round());
    digits.parse().unwrap_or(value)
}

/// A number as a person writes it.
fn short(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == 0.0 {
        "0".to_owned()
    } else {
        rounded.to_string()
    }
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// What a comment can hold.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
