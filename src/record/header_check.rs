//! Whether there can be a study with the header of a tally file.

use super::account::size;
use super::tally_file::{Header, PlanHeader};
use crate::quantities::limits::{
    MOST_EXPERIMENTS, MOST_JOINTS, MOST_NAMED, MOST_SHARDS, MOST_STUDIED, MOST_TRIALS,
};
use crate::quantities::plausible::{DEVIATION, FACTOR, shown};
use crate::study::tally_check::{Wrong, within, wrong};
use crate::text::{is_unseen, wrong_name};

/// More unknowns has no scenario: a hundred uncertainties of as many joints.
const MOST_UNKNOWNS: usize = 100_000;

impl Header {
    /// Whether there can be such a study.
    pub fn check(&self) -> Result<(), Wrong> {
        within("study.trials", self.trials, [1, MOST_TRIALS])?;
        within("study.shards", self.shards, [1, MOST_SHARDS])?;
        within("study.plans", self.plans.len(), [1, MOST_STUDIED])?;
        within("study.parameters", self.parameters.len(), [1, MOST_JOINTS])?;
        within("study.unknowns", self.unknowns(), [1, MOST_UNKNOWNS])?;
        if let Some(absolute) = &self.absolute {
            let poses = absolute.test_poses;
            within("study.absolute.test_poses", poses, [1, MOST_NAMED])?;
            let hash = absolute.candidates_sha256.as_ref();
            if hash.is_some_and(|hash| hash.contains(is_unseen)) {
                return wrong("study.absolute.candidates_sha256", "is none");
            }
        }
        let provenance = &self.provenance;
        for (key, text) in [
            ("version", &provenance.version),
            ("commit", &provenance.commit),
            ("scenario_sha256", &provenance.scenario_sha256),
            ("platform", &provenance.platform),
        ] {
            if text.contains(is_unseen) {
                return wrong(format!("study.{key}"), format!("found {text:?}"));
            }
        }
        let names = [("study.scenario".to_owned(), &provenance.scenario)];
        let joints = self.parameters.iter().enumerate();
        let joints = joints.map(|(index, name)| (format!("study.parameters[{index}]"), name));
        let plans = self.plans.iter().enumerate();
        let plans = plans.map(|(index, plan)| (format!("study.plans[{index}].name"), &plan.name));
        for (key, name) in names.into_iter().chain(joints).chain(plans) {
            if let Some(problem) = wrong_name(name) {
                return wrong(key, problem);
            }
        }
        for (index, plan) in self.plans.iter().enumerate() {
            self.check_plan(plan)
                .map_err(|(key, problem)| (format!("study.plans[{index}].{key}"), problem))?;
        }
        self.gate
            .check()
            .map_err(|(key, problem)| (format!("study.gate.{key}"), problem))
    }

    fn check_plan(&self, plan: &PlanHeader) -> Result<(), Wrong> {
        within("experiments", plan.experiments, [1, MOST_EXPERIMENTS])?;
        for (key, value, kind, unit) in [
            ("sigma_m", plan.sigma_m, &DEVIATION, 1e3),
            ("load_scale", plan.load_scale, &FACTOR, 1.0),
        ] {
            // A deflection's deviation is up to 1.5 times a position's.
            let is_plausible =
                |value: f64| kind.allows(value * unit) || kind.allows(value * unit / 1.5);
            if !is_plausible(value) {
                let (found, allowed) = (shown(value), kind.allowed());
                return wrong(key, format!("found {found}; {allowed}, in SI units"));
            }
        }
        if (plan.sha256.as_ref()).is_some_and(|hash| hash.contains(is_unseen)) {
            return wrong("sha256", "is none");
        }
        if let Some(account) = &plan.account {
            (account.check()).map_err(|(key, problem)| (format!("account.{key}"), problem))?;
        }
        if let Some(quantile) = &plan.predicted_quantile95_m {
            size("predicted_quantile95_m", *quantile)?;
        }
        let Some(reference) = plan.reference else {
            return Ok(());
        };
        within("reference", reference, [0, self.plans.len() - 1])?;
        if self.plans[reference].conditions() != plan.conditions() {
            let problem = format!("found {reference}, a plan under other conditions");
            return wrong("reference", problem);
        }
        Ok(())
    }

    /// The runs in the first blocks of a shard.
    pub fn runs_of(&self, shard: u64, blocks_done: u64) -> u64 {
        let size = self.block_runs();
        let last = shard - 1 + blocks_done.saturating_sub(1) * self.shards;
        // The study's last block may be smaller.
        let beyond = ((last + 1) * size).saturating_sub(self.trials);
        match blocks_done {
            0 => 0,
            _ => blocks_done * size - beyond,
        }
    }
}
