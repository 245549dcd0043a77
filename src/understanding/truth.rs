//! What the virtual robot has and the planner's model does not, and how far its equalities give way.

use crate::mujoco::GivingWay;
use crate::robot::{Load, SerialChain, Spring};
use crate::scenario::Scenario;
use crate::testbed::VirtualRobot;

/// A loop or a coupling that gives way by more than this spoils measurements (m, rad).
const GIVES_WAY: f64 = 1e-4;

/// What a true chain has and the belief's has not, in words.
fn differences(belief: &SerialChain, truth: &SerialChain) -> Option<String> {
    let is_known = |name: &str| belief.joints.iter().any(|joint| joint.name == name);
    let passive = truth
        .joints
        .iter()
        .filter(|joint| joint.drive.passive_at.is_some());
    let passive = passive.map(|joint| joint.name.as_str());
    let passive: Vec<&str> = passive.filter(|name| !is_known(name)).collect();
    let numbers = |spring: &Spring| {
        let [low, high] = spring.rest_m;
        [spring.stiffness_n_per_m, low, high].map(f64::to_bits)
    };
    let is_alike = |spring: &&Spring| {
        let mut all = belief.elements.springs.iter();
        all.any(|known| known.name == spring.name && numbers(known) == numbers(spring))
    };
    let springs = truth
        .elements
        .springs
        .iter()
        .filter(|spring| !is_alike(spring));
    let springs: Vec<&str> = springs.map(|spring| spring.name.as_str()).collect();
    let mut all = Vec::new();
    for (what, names) in [("passive joints", passive), ("springs", springs)] {
        if !names.is_empty() {
            all.push(format!("{what}: {}", names.join(", ")));
        }
    }
    if truth.elements.joint_springs != belief.elements.joint_springs
        || truth.elements.offsets != belief.elements.offsets
    {
        all.push("springs or constant forces in joints".to_owned());
    }
    (!all.is_empty()).then(|| {
        let all = all.join("; ");
        format!("it has what the planner's model has not: {all}")
    })
}

/// A virtual robot that is more than a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct UnderstoodTruth {
    /// Why its model is no belief.
    pub reason: String,
    /// What it obeys and a belief would refuse: an element of each kind, in words.
    pub beyond_belief: Vec<String>,
    /// How far its equality constraints give way at most: at the test poses without a load and under the
    /// task load.
    pub gives_way: Vec<GivingWay>,
    /// The test poses at which it does not rest, with the reason.
    pub restless: Vec<(String, String)>,
}

impl UnderstoodTruth {
    /// What is to be known of a scenario's virtual robot; none where it is a plain chain.
    pub(super) fn new(scenario: &Scenario) -> Option<Self> {
        let robot = &scenario.truth.robot;
        let reason = match &robot.chain {
            Err(reason) => reason.clone(),
            Ok(chain) => differences(&scenario.task.belief.nominal.chain, chain)?,
        };
        let mut truth = Self {
            reason,
            beyond_belief: robot.model.beyond_belief(),
            gives_way: Vec::new(),
            restless: Vec::new(),
        };
        let mut virtual_robot =
            VirtualRobot::new(robot, &scenario.task.belief.machining_tool.name).ok()?;
        for pose in &scenario.task.test_poses {
            for load in [&Load::NONE, &pose.load] {
                match virtual_robot.rest(&pose.configuration_rad, load) {
                    Ok(_) => truth.gather(virtual_robot.giving_way(load)),
                    Err(error) => {
                        truth.restless.push((pose.name.clone(), error.to_string()));
                        break;
                    }
                }
            }
        }
        Some(truth)
    }

    /// Keeps the largest distances.
    fn gather(&mut self, found: Vec<GivingWay>) {
        for each in found {
            let known = (self.gives_way.iter_mut()).find(|known| known.element == each.element);
            match known {
                Some(known) => {
                    known.distance = known.distance.max(each.distance);
                    known.weld_rad = (known.weld_rad.into_iter())
                        .chain(each.weld_rad)
                        .reduce(f64::max);
                }
                None => self.gives_way.push(each),
            }
        }
    }

    /// What is likely to be a mistake.
    pub(super) fn warnings(&self) -> Vec<String> {
        let restless = self.restless.iter().map(|(pose, reason)| {
            format!("the virtual robot does not rest at the test pose {pose:?}: {reason}")
        });
        let soft = (self.gives_way.iter())
            .filter(|each| each.distance.max(each.weld_rad.unwrap_or(0.0)) > GIVES_WAY)
            .map(|each| {
                format!(
                    "true_robot: {} gives way by {}: MuJoCo's constraints are soft; solref=\"0.002 1\" (at least two time steps) solimp=\"0.999 0.9999 0.001\" make it stiffer",
                    each.element,
                    each.words()
                )
            });
        restless.chain(soft).collect()
    }
}
