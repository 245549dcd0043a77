//! The table `[design]` and the plans of `[[plan]]`.

use super::ArmChecker;
use crate::experiment::Loads;
use crate::experiment::Plan;
use crate::files::FileError;
use crate::quantities::limits::{MOST_EXPERIMENTS, MOST_NAMED};
use crate::scenario::PlanFile;
use crate::task::Design;

impl ArmChecker<'_> {
    pub(super) fn design(&self, parameters: usize, loads: &Loads) -> Result<Design, FileError> {
        let (table, reads_along) = (&self.file.design, self.commands.reads_along);
        // As many numbers as there are unknowns.
        let fewest = reads_along.fewest(parameters);
        let experiments = table.experiments;
        self.at_most(
            "design.experiments",
            experiments as usize,
            MOST_EXPERIMENTS as usize,
        )?;
        if experiments < fewest {
            let each = if reads_along.numbers() == 1 {
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
            Some(path) => self.plan("design.mandatory", &self.resolve(path))?,
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
    pub(super) fn plans(&self) -> Result<Vec<PlanFile>, FileError> {
        let tables = &self.file.plan;
        self.named("plan", MOST_NAMED, tables.iter().map(|each| &each.name))?;
        self.each("plan", MOST_NAMED, tables, |key, table| {
            let path = self.resolve(&table.file);
            self.plan(&format!("{key}.file"), &path)?;
            Ok(PlanFile {
                name: table.name.clone(),
                path,
            })
        })
    }
}
