//! The tables `[[uncertainty]]`: what a belief carries of them, and what the virtual robot samples.

use super::Checker;
use super::error_source::{ReadingPlaces, UncertaintyEntry};
use crate::files::FileError;
use crate::parameter::{ElasticArm, ParameterError, ParameterKind, Source, Uncertainty};
use crate::robot::{Robot, TrueRobot};
use crate::scenario::file::File;
use crate::task::{Belief, Extended};
use crate::text::wrong_name;

/// More are no list of what is uncertain.
const MOST: usize = 100;

impl Checker<'_> {
    /// All uncertainties, hidden ones among them, and what a belief carries of them, with what else is to be found by name.
    pub(super) fn uncertain(
        &self,
        belief: &mut Belief,
        (file, true_robot): (&File, &TrueRobot),
        further: &[&str],
        places: ReadingPlaces<'_>,
    ) -> Result<Vec<Uncertainty>, FileError> {
        self.at_most("uncertainty", file.uncertainty.len(), MOST)?;
        let mut all: Vec<Uncertainty> = Vec::new();
        let mut torques: Vec<(ParameterKind, Option<f64>)> = Vec::new();
        for (index, table) in file.uncertainty.iter().enumerate() {
            let entry = UncertaintyEntry::new(
                self,
                format!("uncertainty[{index}]"),
                table,
                (belief, places),
            )?;
            let name = table.name.as_deref().unwrap_or(table.kind.name());
            if let Some(problem) = wrong_name(name) {
                return Err(entry.wrong("name", problem));
            }
            if table.replaced && belief.prior.is_none() {
                let problem = "there is no earlier campaign: robot.prior is missing";
                return Err(entry.wrong("replaced", problem));
            }
            if all.iter().any(|other| other.name == name) {
                let wrong = entry.wrong("name", format!("the name {name:?} is there twice"));
                return Err(wrong.hint("give each uncertainty of a kind a name of its own"));
            }
            let source = entry.source()?;
            one_law(&entry, &source, true_robot, &mut torques)?;
            all.push(Uncertainty {
                name: name.to_owned(),
                is_hidden: table.hidden,
                is_replaced: table.replaced,
                distribution: table.distribution.unwrap_or_default(),
                source,
            });
        }
        for (kind, torque) in torques {
            match kind {
                ParameterKind::JointBacklash { joint } => belief.turned_over_at_nm[joint] = torque,
                ParameterKind::JointStiffening { joint } => belief.stiffening_at_nm[joint] = torque,
                _ => {}
            }
        }
        let further = self.further(belief, further)?;
        belief.uncertain = self.extended(belief, &further, &all)?;
        Ok(all)
    }

    /// What a belief carries before they are read.
    pub(super) fn nothing_uncertain(&self, nominal: &Robot) -> Result<Extended, FileError> {
        let compliance = nominal.compliance_rad_per_nm.clone();
        let arm = ElasticArm::new(nominal.chain.clone(), compliance, Vec::new());
        Extended::new(arm, &[], &[], None, None, &[])
            .map_err(|error| self.wrong("robot", error.to_string()))
    }

    /// What a belief carries of them.
    fn extended(
        &self,
        belief: &Belief,
        further: &[ParameterKind],
        uncertainties: &[Uncertainty],
    ) -> Result<Extended, FileError> {
        let known = uncertainties.iter().filter(|each| !each.is_hidden);
        let known: Vec<Uncertainty> = known.cloned().collect();
        let (joints, prior) = (&belief.parameters, belief.prior.as_ref());
        let campaign = belief.prior_campaign.as_ref();
        let extended = Extended::new(belief.arm(), joints, further, prior, campaign, &known);
        let instrument = &belief.instrument;
        let read = |each: Extended| {
            let resting = each.resting_on(instrument.unloaded);
            resting.shown_in_steps(instrument.along_step_m())
        };
        let extended = extended.map(read);
        extended.map_err(|error| {
            let hint = matches!(error, ParameterError::Twice(_))
                .then_some("two uncertainties are about the same: leave one out, or hide it");
            self.wrong("uncertainty", error.to_string()).hinted(hint)
        })
    }
}

/// Adds the torques at which joints' gaps and springs are told. A joint has one gap, and one law.
fn one_law(
    entry: &UncertaintyEntry<'_>,
    source: &Source,
    true_robot: &TrueRobot,
    torques: &mut Vec<(ParameterKind, Option<f64>)>,
) -> Result<(), FileError> {
    let Source::Plan(parameters) = source else {
        return Ok(());
    };
    for &(kind, _) in parameters {
        let (key, joint) = match kind {
            ParameterKind::JointBacklash { joint } => ("turned_over_at_nm", joint),
            ParameterKind::JointStiffening { joint } => ("at_nm", joint),
            _ => return Ok(()),
        };
        let name = &entry.belief.nominal.chain.joints[joint].name;
        if key == "at_nm"
            && true_robot
                .torque_laws
                .iter()
                .any(|(other, _)| *other == joint)
        {
            let problem = format!("{name} has a law of its own, by true_robot.torque_law already");
            let wrong = entry.wrong("joints", problem);
            return Err(wrong.hint("a joint has one law: leave it out of one of the two"));
        }
        let torque = entry.torque(key);
        match torques.iter().find(|(other, _)| *other == kind) {
            Some((_, known)) if *known != torque => {
                let of = entry.table.kind.name();
                let wrong = entry.wrong(key, format!("another {of} says something else of {name}"));
                return Err(
                    wrong.hint("a joint has one gap, and one law: give both the same torque")
                );
            }
            Some(_) => {}
            None => torques.push((kind, torque)),
        }
    }
    Ok(())
}
