//! What an identification rests on, as hashes: so that its results are not taken for another robot's.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Belief;
use crate::files::hexadecimal;
use crate::parameter::Unloaded;
use crate::robot::{SerialChain, Tool};

/// What an identification rests on. Neither test poses nor loads, plans, surroundings or a description
/// belong to that.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// SHA-256, in hexadecimal, of the robot's kinematics: its joints' names, axes and places.
    pub robot_sha256: String,
    /// SHA-256 of all that is believed: the kinematics, masses, gravity, compliances and which of them are
    /// identified, the calibration tool, and the instrument's standard deviations.
    pub belief_sha256: String,
}

impl Belief {
    /// What an identification with this belief rests on.
    pub fn fingerprint(&self) -> Fingerprint {
        let chain = &self.nominal.chain;
        let robot_sha256 = robot_sha256(chain);
        let mut belief = Hash::default();
        belief.text(&robot_sha256);
        belief.rounded(chain.gravity_m_s2.iter().copied());
        for joint in &chain.joints {
            belief.rounded([joint.mass_kg]);
            belief.rounded(joint.centre_of_mass_m.iter().copied());
        }
        belief.numbers(self.nominal.compliance_rad_per_nm.iter().copied());
        for name in self.parameter_names() {
            belief.text(&name);
        }
        belief.tool(&self.calibration_tool);
        if let Some(prior) = &self.prior {
            belief.numbers(prior.precision.iter().copied());
        }
        let extended = &self.uncertain;
        if !extended.is_plain() {
            belief.text(&format!("{:?}", extended.sources().collect::<Vec<_>>()));
            for name in extended.other_names() {
                belief.text(&name);
            }
            let prior = extended.set().prior();
            belief.numbers(prior.precision.iter().copied());
            belief.numbers(
                extended
                    .kept_others()
                    .into_iter()
                    .map(|place| prior.mean[place]),
            );
            belief.numbers(self.turned_over_at_nm.iter().copied().flatten());
            belief.numbers(self.stiffening_at_nm.iter().copied().flatten());
        }
        if self.instrument.unloaded == Unloaded::Shared {
            belief.text("deflections of one configuration rest on one unloaded reading");
        }
        if let Some(gauge) = &self.instrument.gauge {
            belief.text("displacements along a direction are read");
            belief.numbers(gauge.beside_m);
            // Finer ones are part of the noise alone.
            belief.numbers(Some(extended.along_step_m()).filter(|step_m| *step_m > 0.0));
        }
        for (kind, shows) in self.instrument.lengths() {
            belief.text(&format!("{}s from stations are read", kind.name()));
            belief.numbers(shows.beside_m);
        }
        let rotation = self.instrument.rotation_sigma_rad;
        belief.numbers([self.instrument.sigma_m].into_iter().chain(rotation));
        Fingerprint {
            robot_sha256,
            belief_sha256: belief.finish(),
        }
    }
}

/// SHA-256, in hexadecimal, of a robot's kinematics: its joints' names, axes and places.
pub fn robot_sha256(chain: &SerialChain) -> String {
    let mut robot = Hash::default();
    robot.kinematics(chain);
    robot.finish()
}

#[derive(Default)]
struct Hash(Sha256);

impl Hash {
    fn text(&mut self, text: &str) {
        self.0.update((text.len() as u64).to_le_bytes());
        self.0.update(text);
    }

    fn numbers(&mut self, numbers: impl IntoIterator<Item = f64>) {
        for number in numbers {
            // Zero has two forms.
            self.0.update((number + 0.0).to_le_bytes());
        }
    }

    /// Numbers that a simulator has calculated with, whose last digits depend on the machine.
    fn rounded(&mut self, numbers: impl IntoIterator<Item = f64>) {
        self.numbers(numbers.into_iter().map(|number| (number * 1e9).round()));
    }

    fn frame(&mut self, frame: &nalgebra::Isometry3<f64>) {
        self.rounded(frame.translation.vector.iter().copied());
        self.rounded(frame.rotation.coords.iter().copied());
    }

    fn kinematics(&mut self, chain: &SerialChain) {
        for joint in &chain.joints {
            self.text(&joint.name);
            self.frame(&joint.previous_from_link);
            self.rounded(joint.axis.iter().copied());
        }
    }

    fn tool(&mut self, tool: &Tool) {
        self.0.update((tool.joints as u64).to_le_bytes());
        self.frame(&tool.link_from_tool);
    }

    fn finish(self) -> String {
        hexadecimal(&self.0.finalize())
    }
}
