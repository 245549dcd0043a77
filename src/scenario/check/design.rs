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
        // As many numbers as there are unknowns.
        let fewest = commands.reads_along.fewest(parameters);
        let experiments = table.experiments;
        self.at_most(
            "design.experiments",
            experiments as usize,
            MOST_EXPERIMENTS as usize,
        )?;
        if experiments < fewest {
            let each = if commands.reads_along.numbers() == 1 {
                "one number"
            } else {
                "three numbers"
            };
            let reason = match parameters {
                0 => String::new(),
                _ => format!(", since each gives {each} and {parameters} compliances are unknown"),
            };
            let problem = format!("found {experiments}; at least {fewest} are needed{reason}");
            return Err(self.wrong("design.experiments", problem));
        }
        if let Some(configurations) = table.configurations
            && !(fewest..=experiments).contains(&configurations)
        {
            let problem = format!(
                "found {configurations}; {fewest} to design.experiments = {experiments} are allowed"
            );
            return Err(self.wrong("design.configurations", problem));
        }
        let mandatory = match &table.mandatory {
            Some(path) => self.plan("design.mandatory", &self.resolve(path), commands)?,
            None => Plan::default(),
        };
        if mandatory.measurements() > experiments {
            let found = mandatory.measurements();
            let problem = format!(
                "found {found} experiments; at most design.experiments = {experiments} are allowed"
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
            experiments,
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
        self.named("plan", MOST_NAMED, tables.iter().map(|each| &each.name))?;
        self.each("plan", MOST_NAMED, tables, |key, table| {
            let path = self.resolve(&table.file);
            self.plan(&format!("{key}.file"), &path, commands)?;
            Ok(PlanFile {
                name: table.name.clone(),
                path,
            })
        })
    }
}
