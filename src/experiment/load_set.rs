//! Load sets: which loads a plan may use (eq. 22). One set decides for the sampler and the search, for
//! plans and for measurements.

use nalgebra::Vector3;

use super::Plan;
use crate::codes::{Condition, ConditionCode};
use crate::robot::Load;

/// Plans are printed with one decimal. Each of the three components of a force (N) or of a torque (N m)
/// is then off by up to half a unit of that place, and all together by the root of three times as much.
const PRINTED: f64 = 0.05 * 1.732_050_807_568_877_2;
/// But a load is off by no more than this share of itself. A metre of lever stands between forces and
/// torques.
const LARGEST_SHARE: f64 = 1e-3;
/// So many loads are named one by one.
const NAMED: usize = 6;

/// The loads that a plan may use.
#[derive(Debug, Clone, PartialEq)]
pub enum Loads {
    /// One wrench for every experiment.
    Fixed(Load),
    /// A force of fixed direction (unit vector) whose size lies between two bounds (N).
    Direction {
        /// The direction.
        direction: Vector3<f64>,
        /// The smallest and the largest force (N).
        force_n: [f64; 2],
    },
    /// A force of any direction up to this size (N); eq. 22.
    Any {
        /// The largest force (N).
        force_max_n: f64,
    },
    /// One of these wrenches.
    List(Vec<Load>),
}

impl Loads {
    /// Those that are listed, one or several; none where forces are free.
    pub fn listed(&self) -> Option<&[Load]> {
        match self {
            Self::Fixed(load) => Some(std::slice::from_ref(load)),
            Self::List(loads) => Some(loads),
            Self::Direction { .. } | Self::Any { .. } => None,
        }
    }

    /// Loads that show what any does.
    pub fn samples(&self) -> Vec<Load> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        match self {
            Self::Fixed(load) => vec![*load],
            Self::List(loads) => loads.clone(),
            Self::Direction {
                direction,
                force_n: [low, high],
            } => [high, low].map(|size| of_force(direction * *size)).to_vec(),
            Self::Any { force_max_n } => axes.map(|axis| of_force(axis * *force_max_n)).to_vec(),
        }
    }

    /// All loads so many times as large.
    pub fn scaled(&self, factor: f64) -> Self {
        match self {
            Self::Fixed(load) => Self::Fixed(load.scaled(factor)),
            Self::Direction { direction, force_n } => Self::Direction {
                direction: *direction,
                force_n: force_n.map(|force| force * factor),
            },
            Self::Any { force_max_n } => Self::Any {
                force_max_n: force_max_n * factor,
            },
            Self::List(loads) => Self::List(loads.iter().map(|load| load.scaled(factor)).collect()),
        }
    }

    /// The load of the set that is nearest to a given one, a metre of lever between forces and torques.
    pub fn nearest(&self, load: &Load) -> Load {
        let force = &load.force_n;
        match self {
            Self::Fixed(only) => *only,
            Self::Direction { direction, force_n } => {
                let size = direction.dot(force).clamp(force_n[0], force_n[1]);
                of_force(direction * size)
            }
            Self::Any { force_max_n } => {
                let size = force.norm();
                of_force(force * (force_max_n / size.max(*force_max_n)))
            }
            Self::List(loads) => {
                let apart = |one: &Load| (one.wrench() - load.wrench()).norm_squared();
                let nearest =
                    (loads.iter()).min_by(|one, other| apart(one).total_cmp(&apart(other)));
                nearest.copied().unwrap_or(Load::NONE)
            }
        }
    }

    /// Whether a load is one of the set, as far as plans are printed: force and torque each differ from
    /// [`Self::nearest`] by no more than [`printed_tolerance`].
    pub fn contains(&self, load: &Load) -> bool {
        is_printed_as(load, &self.nearest(load))
    }

    /// In words, where a load is none of the set: what it is, and what is allowed.
    pub fn outside(&self, load: &Load) -> Option<String> {
        (!self.contains(load))
            .then(|| format!("load is {}; allowed {}", in_words(load), self.describe()))
    }

    /// Where some loads are none of the set: how many, and what is wrong with the first of
    /// them. `noun` is what has a load, "measurement" or "experiment".
    pub fn outside_all<'a>(
        &self,
        noun: &str,
        loads: impl Iterator<Item = &'a Load>,
    ) -> Option<Condition> {
        let mut count = 0;
        let mut outside = Vec::new();
        for (index, load) in loads.enumerate() {
            count += 1;
            outside.extend(self.outside(load).map(|words| (index + 1, words)));
        }
        let (number, words) = outside.first()?;
        let first = format!("{noun} {number}: {words}");
        Some(match outside.len() {
            1 => first,
            several => {
                format!("{several} of {count} {noun}s have loads outside the load set; {first}")
            }
        })
        .map(|text| ConditionCode::LoadOutside.with(text))
    }

    /// Where loads of a plan are none of the set; the plan has a name where there are several.
    pub fn outside_plan(&self, plan: &Plan, name: Option<&str>) -> Option<Condition> {
        let loads = plan.experiments.iter().map(|each| &each.load);
        let found = self.outside_all("experiment", loads)?;
        Some(match name {
            Some(name) => found.within(&format!("plan {name:?}")),
            None => found,
        })
    }

    /// What is allowed, in words that follow the word "allowed".
    pub fn describe(&self) -> String {
        match self {
            Self::Fixed(load) => format!("is {}", in_words(load)),
            Self::Direction { direction, force_n } => {
                let [low, high] = force_n.map(number);
                format!(
                    "is a force along {} of {low} to {high} N",
                    vector(direction)
                )
            }
            Self::Any { force_max_n } => format!(
                "is a force of any direction of at most {} N",
                number(*force_max_n)
            ),
            Self::List(loads) => {
                let named: Vec<String> = loads.iter().take(NAMED).map(in_words).collect();
                let more = match loads.len().saturating_sub(NAMED) {
                    0 => String::new(),
                    more => format!(" and {more} more"),
                };
                format!("are {}{more}", named.join(", "))
            }
        }
    }
}

/// How far the force (N) and the torque (N m) of a load may be off through printing: the root of three
/// times half a unit of the first decimal, or a thousandth of the load where that is less.
pub fn printed_tolerance(load: &Load) -> f64 {
    PRINTED.min(LARGEST_SHARE * (load.force_n.norm() + load.torque_nm.norm()))
}

/// Whether a load is another one as far as plans are printed.
pub fn is_printed_as(load: &Load, other: &Load) -> bool {
    let force = (load.force_n - other.force_n).norm();
    let torque = (load.torque_nm - other.torque_nm).norm();
    force.max(torque) <= printed_tolerance(other)
}

fn of_force(force: Vector3<f64>) -> Load {
    Load::force(force.x, force.y, force.z)
}

/// A load for a person: its force, and its torque where there is one.
pub fn in_words(load: &Load) -> String {
    let force = format!("{} N", vector(&load.force_n));
    if load.torque_nm == Vector3::zeros() {
        return force;
    }
    format!("{force} with {} N m", vector(&load.torque_nm))
}

fn vector(vector: &Vector3<f64>) -> String {
    let [x, y, z] = [vector.x, vector.y, vector.z].map(number);
    format!("({x}, {y}, {z})")
}

/// A number with as many decimals as it needs, six at most.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}
