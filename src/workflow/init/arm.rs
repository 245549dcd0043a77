//! Which joints of a model are the arm, and which are locked beside it.

use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::mujoco::Model;
use crate::robot::SerialChain;

/// An arm that has so many joints has come to its hand where it branches into fingers ...
const ARM: usize = 4;
/// ... of so many joints at most.
const FINGER: usize = 2;

/// The arm in a model.
pub(super) struct FoundArm {
    /// The model with the other joints locked.
    pub model: Model,
    /// The chain of the joints that are not.
    pub chain: SerialChain,
    /// The locked joints: name, coordinate (rad, m), whether it slides.
    pub locked: Vec<(String, f64, bool)>,
    /// Why the model's actuators do not count, if they do not.
    pub actuators_ignored: Option<String>,
    /// The last body that all its joints move.
    pub last_body: usize,
    /// The site that was named as its tip.
    pub tip: Option<String>,
}

impl FoundArm {
    /// The longest series of joints, as far as it does not branch into fingers; to a body, if one is named.
    pub fn find(model: &Model, tip: Option<&str>) -> Result<Self, FileError> {
        let bodies = match tip {
            Some(tip) => way_to(model, model.body_or_site(tip)?.0),
            None => without_jaw(model, longest(model)),
        };
        let arm: Vec<usize> = (bodies.iter())
            .flat_map(|&body| model.joints_of(body))
            .collect();
        let others = (0..model.joints()).filter(|joint| !arm.contains(joint));
        let mut locked = Vec::new();
        for joint in others {
            let [low, high] = model.joint_range(joint);
            let drawn = model.joint_reference(joint).clamp(low, high);
            locked.push((model.joint_name(joint), drawn, model.is_slide(joint)));
        }
        let pairs: Vec<(String, f64)> =
            locked.iter().map(|each| (each.0.clone(), each.1)).collect();
        let model = model.with_locked(&pairs)?;
        let (model, chain, actuators_ignored) = match SerialChain::from_model(&model) {
            Ok(chain) => (model, chain, None),
            Err(reason) if reason.code == ErrorCode::ModelStatics => {
                let without = model.without_actuators();
                match SerialChain::from_model(&without) {
                    Ok(chain) => (without, chain, Some(reason.problem)),
                    Err(_) => return Err(reason),
                }
            }
            Err(other) => return Err(other),
        };
        let last = arm.last().copied();
        let last_body = (bodies.iter().rev())
            .find(|&&body| last.is_some_and(|last| model.joints_of(body).any(|each| each == last)));
        Ok(Self {
            last_body: last_body.copied().unwrap_or_default(),
            tip: tip
                .filter(|tip| model.body(tip).is_none())
                .map(str::to_owned),
            model,
            chain,
            locked,
            actuators_ignored,
        })
    }

    /// The bodies that all joints of the arm move.
    pub fn carried(&self) -> impl Iterator<Item = usize> {
        (1..self.model.bodies()).filter(|&body| {
            self.model.joints_that_move(body) == self.chain.len()
                && way_to(&self.model, body).contains(&self.last_body)
        })
    }
}

/// The bodies from the base to one.
fn way_to(model: &Model, mut body: usize) -> Vec<usize> {
    let mut way = Vec::new();
    while body != 0 {
        way.push(body);
        body = model.parent(body);
    }
    way.reverse();
    way
}

/// Words in the names of grippers' joints. The body that carries a jaw may be called so as well.
const GRIPPERS: [&str; 4] = ["grip", "jaw", "finger", "claw"];

/// The way to the arm's hand, where the longest one goes on to a single moving jaw that is called so.
fn without_jaw(model: &Model, mut bodies: Vec<usize>) -> Vec<usize> {
    let is_jaw = |joint| {
        let name = model.joint_name(joint).to_lowercase();
        GRIPPERS.iter().any(|word| name.contains(word))
    };
    if let Some((&last, before)) = bodies.split_last() {
        let joints: usize = before
            .iter()
            .map(|&body| model.joints_of(body).count())
            .sum();
        if joints >= ARM && model.joints_of(last).all(is_jaw) {
            bodies.pop();
        }
    }
    bodies
}

/// The bodies along the longest series of joints.
fn longest(model: &Model) -> Vec<usize> {
    let count = |body: usize| model.joints_of(body).count();
    // Of the most joints in a row from each body outwards; bodies come after their parents.
    let mut depth: Vec<usize> = (0..model.bodies()).map(count).collect();
    for body in (1..model.bodies()).rev() {
        let parent = model.parent(body);
        depth[parent] = depth[parent].max(count(parent) + depth[body]);
    }
    let (mut way, mut joints, mut at) = (Vec::new(), 0, 0);
    loop {
        let ahead: Vec<usize> = (1..model.bodies())
            .filter(|&body| model.parent(body) == at && depth[body] > 0)
            .collect();
        // Of several that are as long, the first.
        let best = (ahead.iter().copied()).reduce(|best, body| {
            if depth[body] > depth[best] {
                body
            } else {
                best
            }
        });
        let Some(best) = best else { return way };
        let alike = ahead.iter().filter(|&&body| depth[body] == depth[best]);
        let is_hand =
            joints >= ARM && ahead.len() > 1 && (depth[best] <= FINGER || alike.count() > 1);
        if is_hand {
            return way;
        }
        way.push(best);
        joints += count(best);
        at = best;
    }
}
