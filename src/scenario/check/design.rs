//! The table `[design]` and the plans of `[[plan]]`.

use super::Checker;
use crate::experiment::Loads;
use crate::experiment::Plan;
use crate::files::FileError;
use crate::quantities::limits::{MOST_EXPERIMENTS, MOST_NAMED};
use crate::robot::Commands;
use crate::scenario::PlanFile;
use crate::scenario::file::{DesignTable, PlanTable};
use crate::task::Design;

impl Checker<'_> {
    pub(super) fn design(
        &self,
        table: &DesignTable,
        parameters: usize,
        commands: &Commands,
        loads: &Loads,
    ) -> Result<Design, FileError> {
        let key = "design.experiments";
        let fewest = u32::try_from(parameters.div_ceil(3).max(1)).unwrap_or(u32::MAX);
        if table.experiments > MOST_EXPERIMENTS {
            let problem = format!(
                "found {}; at most {MOST_EXPERIMENTS} are allowed",
                table.experiments
            );
            return Err(self.wrong(key, problem));
        }
        if table.experiments < fewest {
            let problem = format!(
                "found {}; at least {fewest} are needed, since each gives three numbers and {parameters} compliances are unknown",
                table.experiments
            );
            return Err(self.wrong(key, problem));
        }
        if let Some(configurations) = table.configurations
            && !(fewest..=table.experiments).contains(&configurations)
        {
            let problem = format!(
                "found {configurations}; {fewest} to design.experiments = {} are allowed",
                table.experiments
            );
            return Err(self.wrong("design.configurations", problem));
        }
        let mandatory = match &table.mandatory {
            Some(path) => self.plan("design.mandatory", &self.resolve(path), commands)?,
            None => Plan::default(),
        };
        if mandatory.measurements() > table.experiments {
            let problem = format!(
                "found {} experiments; at most design.experiments = {} are allowed",
                mandatory.measurements(),
                table.experiments
            );
            return Err(self.wrong("design.mandatory", problem));
        }
        let given = mandatory.experiments.iter().map(|each| &each.load);
        if let Some(outside) = loads.outside_all("experiment", given) {
            return Err(self
                .wrong("design.mandatory", outside.text)
                .hint("allow that load in [load] too, as one of kind = \"list\""));
        }
        Ok(Design {
            accuracy: table.accuracy,
            experiments: table.experiments,
            configurations: table.configurations,
            mandatory,
        })
    }

    /// Plans are read once here, so that a wrong one is found before any work is done.
    pub(super) fn plans(
        &self,
        tables: &[PlanTable],
        commands: &Commands,
    ) -> Result<Vec<PlanFile>, FileError> {
        self.at_most("plan", tables.len(), MOST_NAMED)?;
        let mut plans: Vec<PlanFile> = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            if plans.iter().any(|plan| plan.name == table.name) {
                let problem = format!("found {:?} twice", table.name);
                return Err(self.wrong(&format!("plan[{index}].name"), problem));
            }
            let path = self.resolve(&table.file);
            self.plan(&format!("plan[{index}].file"), &path, commands)?;
            plans.push(PlanFile {
                name: table.name.clone(),
                path,
            });
        }
        Ok(plans)
    }
}
