//! The scenario as a commented TOML file.

use minijinja::{Environment, Error, UndefinedBehavior};
use nalgebra::Vector3;
use serde_json::{Value, json};

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
/// As few measurements as a first plan has.
const LEAST_MEASUREMENTS: usize = 4;

/// Compliances that are guessed, in the order of the joints, and why.
struct Guessed {
    values_rad_per_nm: Vec<f64>,
    reason: String,
}

/// Writes the scenario, with what was found on the way, in sentences.
///
/// # Errors
/// None that the tests have seen: the template asks for what is not there.
pub(super) fn scenario(
    arm: &FoundArm,
    tools: &Tools,
    tried: &Tried,
    model: &str,
) -> Result<(String, Vec<String>), Error> {
    let load_n = load_n(arm);
    let guessed = guessed(arm, tried, load_n);
    let mut found = found(arm, tools, tried);
    if let Some(Guessed { reason, .. }) = &guessed {
        found.push(format!("The compliances are guesses: {reason}."));
    }
    let shown = shown(arm, tools, tried, (load_n, guessed.as_ref()), model);
    let mut templates = Environment::new();
    templates.set_undefined_behavior(UndefinedBehavior::Strict);
    templates.set_trim_blocks(true);
    templates.set_keep_trailing_newline(true);
    let text = templates.render_str(include_str!("scenario.toml"), shown)?;
    Ok((text, found))
}

/// What the template shows, texts and numbers as TOML has them.
fn shown(
    arm: &FoundArm,
    tools: &Tools,
    tried: &Tried,
    (load_n, guessed): (f64, Option<&Guessed>),
    model: &str,
) -> Value {
    let chain = &arm.chain;
    let commanded = || chain.commanded().map(|joint| &chain.joints[joint]);
    let names = |joints: &mut dyn Iterator<Item = &Joint>| {
        let names: Vec<String> = joints.map(|joint| quoted(&joint.name)).collect();
        names.join(", ")
    };
    let locked = [(false, "locked_deg"), (true, "locked_mm")].map(|(slides, key)| {
        let of_kind = arm.locked.iter().filter(|each| each.2 == slides);
        let written = of_kind.map(|(name, value, _)| {
            let shown = if slides {
                value * 1e3
            } else {
                value.to_degrees()
            };
            format!("{} = {}", quoted(name), short(shown))
        });
        (key, written.collect::<Vec<_>>().join(", "))
    });
    let mounted = tools.mounted.iter().map(|tool| {
        let position_mm = list((tool.position_m * 1e3).iter().copied());
        json!({ "name": quoted(tool.name), "on": quoted(&tool.on), "position_mm": position_mm })
    });
    let guessed = guessed.map(|guessed| {
        let values = guessed.values_rad_per_nm.iter();
        let values: Vec<String> = values.map(|value| format!("{value:e}")).collect();
        json!({ "values": values.join(", "), "reason": guessed.reason })
    });
    let free = tried.free.as_ref().map(|(share, touching)| {
        let touching = touching.each_ref().map(|name| one_line(name));
        json!({
            "touching": (*share < FREE).then_some(touching),
            "clearance_mm": short(CLEARANCE_M * 1e3),
        })
    });
    let task_n = round_down(load_n / 2.0);
    let loads = weight_and_sideways(&chain.gravity_m_s2, load_n);
    json!({
        "schema": SCHEMA_FILE,
        "description": quoted(&format!("A first scenario for {model}")),
        "model": quoted(model),
        "sites": one_line(&tools.known.join(", ")),
        "tools": tools.sites.each_ref().map(|site| quoted(site)),
        "joints": names(&mut commanded()),
        "turning": names(&mut commanded().filter(|joint| !joint.drive.slides)),
        "actuators_ignored": arm.actuators_ignored.as_deref().map(one_line),
        "guessed": guessed,
        "locked": locked,
        "mounted": mounted.collect::<Vec<_>>(),
        "q_deg": list(Commands::from(chain).numbers(&tried.best)),
        "force_n": list([0.0, task_n, -task_n]),
        "loads": loads.map(|force_n| list(force_n.iter().copied())),
        "free": free,
        "experiments": chain.len().max(LEAST_MEASUREMENTS),
    })
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

fn list(values: impl IntoIterator<Item = f64>) -> String {
    let values: Vec<String> = values.into_iter().map(short).collect();
    values.join(", ")
}

/// The joints' compliances where the model's are missing or a simulation's.
fn guessed(arm: &FoundArm, tried: &Tried, load_n: f64) -> Option<Guessed> {
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
        return None;
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
    Some(Guessed {
        values_rad_per_nm: guess.collect(),
        reason,
    })
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
