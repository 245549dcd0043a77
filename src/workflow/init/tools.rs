//! Where the tools are: at sites of the model, or mounted on its last link.

use nalgebra::{Isometry3, Vector3};

use super::arm::FoundArm;
use super::pose::last_axis;
use crate::files::FileError;
use crate::robot::{SerialChain, Tool};

/// What names of working tools contain.
const WORKING: [&str; 5] = ["machin", "spindle", "mill", "grind", "drill"];
/// The names of tools that are mounted.
const CALIBRATION: &str = "calibration_tool";
const MACHINING: &str = "machining_tool";
/// A tool that is nearer to the last joint's axis (m) does not show how the joint gives way.
const OFF_AXIS_M: f64 = 0.03;
/// How far aside the calibration tool is mounted (m), where the model's would not do.
const ASIDE_M: f64 = 0.15;
/// How far out tools are mounted (m), where the model has none.
const OUT_M: f64 = 0.1;

/// A tool that the scenario mounts.
pub(super) struct Mounted {
    pub name: &'static str,
    /// The body or site that carries it.
    pub on: String,
    /// Its place there (m).
    pub position_m: Vector3<f64>,
}

/// The tools of a first scenario.
pub(super) struct Tools {
    /// The site of the calibration tool, as a frame of the arm.
    pub calibration: Tool,
    /// The names of both sites.
    pub sites: [String; 2],
    /// Tools that are mounted.
    pub mounted: Vec<Mounted>,
    /// All sites that the whole arm moves.
    pub known: Vec<String>,
}

impl Tools {
    /// The site that is named as the arm's tip, else the likeliest, for both, and a tool beside it where that lies on the last axis.
    pub fn of(arm: &FoundArm) -> Result<Self, FileError> {
        let carried: Vec<usize> = arm.carried().collect();
        let known: Vec<String> = (arm.model.named_sites().into_iter())
            .filter(|(_, body)| carried.contains(body))
            .map(|(name, _)| name)
            .collect();
        // One that is called an arm's end, or the last.
        let called = || called_end(known.iter().enumerate()).map(|index| &known[index]);
        let site = arm.tip.as_ref().or_else(called).or(known.last());
        let tools = if let Some(site) = site {
            let tool = SerialChain::tool(&arm.model, site)?;
            Self::beside(arm, &tool, site, Vector3::zeros())
        } else {
            let named: Vec<(usize, String)> = (carried.iter())
                .filter_map(|&body| Some((body, arm.model.named_body(body)?)))
                .collect();
            let called = called_end(named.iter().map(|(body, name)| (*body, name)));
            let body = called.unwrap_or(arm.last_body);
            let tool = SerialChain::on_body(&arm.model, body)?;
            let (axis, _) = last_axis(arm, &tool);
            let on = arm.model.body_name(body);
            Self::beside(arm, &tool, &on, axis * OUT_M)
        };
        let mut tools = Self { known, ..tools };
        if let Some(site) = (tools.known.iter()).find(|name| {
            WORKING
                .iter()
                .any(|word| name.to_lowercase().contains(word))
        }) {
            tools.sites[1].clone_from(site);
            tools.mounted.retain(|tool| tool.name != MACHINING);
        }
        Ok(tools)
    }

    /// Tools at a place in a frame, the calibration tool aside of the last axis.
    fn beside(arm: &FoundArm, frame: &Tool, on: &str, out_m: Vector3<f64>) -> Self {
        let (axis, distance_m) = last_axis(arm, frame);
        let aside = if distance_m < OFF_AXIS_M {
            // The frame's axis that is most across the joint's.
            let across = [Vector3::x(), Vector3::y(), Vector3::z()]
                .into_iter()
                .reduce(|best, one| {
                    if one.dot(&axis).abs() < best.dot(&axis).abs() - 1e-9 {
                        one
                    } else {
                        best
                    }
                })
                .unwrap_or_else(Vector3::x);
            across * ASIDE_M
        } else {
            Vector3::zeros()
        };
        let mut mounted = Vec::new();
        let mut mount = |name: &'static str, position_m: Vector3<f64>| {
            if position_m.norm() < 1e-9 {
                return on.to_owned();
            }
            mounted.push(Mounted {
                name,
                on: on.to_owned(),
                position_m,
            });
            name.to_owned()
        };
        // Nothing else moves what lies on the axis of an only joint.
        let machining_m = match &*arm.chain.joints {
            [_] => out_m + aside,
            _ => out_m,
        };
        let sites = [
            mount(CALIBRATION, out_m + aside),
            mount(MACHINING, machining_m),
        ];
        let from_frame = Isometry3::from(out_m + aside);
        Self {
            calibration: Tool {
                link_from_tool: frame.link_from_tool * from_frame,
                ..frame.clone()
            },
            sites,
            mounted,
            known: Vec::new(),
        }
    }
}

/// Names that ends of arms have, the likeliest first.
const ENDS: [&str; 9] = [
    "tcp",
    "tool",
    "pinch",
    "attachment",
    "grip",
    "end_effector",
    "ee",
    "flange",
    "hand",
];

/// The first of the names that is called as ends of arms are.
fn called_end<'a>(names: impl Iterator<Item = (usize, &'a String)>) -> Option<usize> {
    let names: Vec<(usize, &String)> = names.collect();
    let has = |name: &str, word: &str| {
        let name = name.to_lowercase();
        let mut parts = name.split(|letter: char| !letter.is_alphanumeric());
        parts.any(|part| part.starts_with(word)) || (word.len() > 3 && name.contains(word))
    };
    ENDS.iter().find_map(|word| {
        let called = names.iter().find(|(_, name)| has(name, word));
        called.map(|(index, _)| *index)
    })
}
