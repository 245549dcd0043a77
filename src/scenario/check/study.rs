//! The table `[study]`: which plans a Monte Carlo study compares, over how many runs.

use super::Checker;
use crate::files::FileError;
use crate::plan::Criterion;
use crate::scenario::file::{StudyPlanTable, StudyTable};
use crate::scenario::{Design, PlanFile, Study, StudyPlan, StudySource};

/// The statistics are exact up to so many runs.
const MOST_TRIALS: u64 = 1_000_000_000_000;
/// Without the key `trials`.
const DEFAULT_TRIALS: u64 = 10_000;

/// What the rest of the scenario says that the study depends on.
pub(super) struct Context<'a> {
    pub design: &'a Design,
    pub plans: &'a [PlanFile],
    pub parameters: usize,
    pub joints: usize,
}

impl Checker<'_> {
    pub(super) fn study(
        &self,
        table: &StudyTable,
        context: &Context<'_>,
    ) -> Result<Study, FileError> {
        let trials = table.trials.unwrap_or(DEFAULT_TRIALS);
        if !(1..=MOST_TRIALS).contains(&trials) {
            let problem = format!("found {trials}; 1 to {MOST_TRIALS} are allowed");
            return Err(self.wrong("study.trials", problem));
        }
        let experiments = table.experiments.unwrap_or(context.design.experiments);
        self.enough("study.experiments", experiments, context.parameters)?;
        let plans = match &table.plan {
            None => self.default_plans(experiments, context)?,
            Some(tables) if tables.is_empty() => {
                let problem = "is empty; leave the key out for the default plans";
                return Err(self.wrong("study.plan", problem));
            }
            Some(tables) => self.study_plans(tables, experiments, context)?,
        };
        Ok(Study {
            trials,
            experiments,
            level: table.level,
            plans,
        })
    }

    fn enough(&self, key: &str, experiments: u32, parameters: usize) -> Result<(), FileError> {
        let fewest = u32::try_from(parameters.div_ceil(3)).unwrap_or(u32::MAX);
        if (fewest..=10_000).contains(&experiments) {
            return Ok(());
        }
        let problem = format!("found {experiments}; {fewest} to 10000 are allowed");
        Err(self.wrong(key, problem))
    }

    /// The scenario's plans that whole repetitions fill up, an optimal plan, and random ones.
    fn default_plans(
        &self,
        experiments: u32,
        context: &Context<'_>,
    ) -> Result<Vec<StudyPlan>, FileError> {
        let mut plans = Vec::new();
        for (index, file) in context.plans.iter().enumerate() {
            let plan = self.plan(&format!("plan[{index}].file"), &file.path, context.joints)?;
            if experiments.is_multiple_of(plan.measurements().max(1)) {
                plans.push(StudyPlan {
                    name: file.name.clone(),
                    source: StudySource::File(plan),
                });
            }
        }
        let configurations =
            (context.design.configurations).filter(|_| context.design.experiments == experiments);
        let named = [
            (
                "optimal",
                StudySource::Optimal {
                    criterion: Criterion::TestPose,
                    configurations,
                    experiments,
                },
            ),
            ("random_each", StudySource::RandomEach),
        ];
        for (name, source) in named {
            if plans.iter().all(|plan| plan.name != name) {
                let name = name.to_owned();
                plans.push(StudyPlan { name, source });
            }
        }
        Ok(plans)
    }

    fn study_plans(
        &self,
        tables: &[StudyPlanTable],
        experiments: u32,
        context: &Context<'_>,
    ) -> Result<Vec<StudyPlan>, FileError> {
        let mut plans: Vec<StudyPlan> = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            let key = format!("study.plan[{index}]");
            let (name, source) = self.study_source(&key, table, experiments, context)?;
            if name.trim().is_empty() {
                return Err(self.wrong(&format!("{key}.name"), "is empty"));
            }
            if plans.iter().any(|plan| plan.name == *name) {
                let problem = format!("found {name:?} twice");
                return Err(self.wrong(&format!("{key}.name"), problem));
            }
            plans.push(StudyPlan {
                name: name.clone(),
                source,
            });
        }
        Ok(plans)
    }

    fn study_source<'a>(
        &self,
        key: &str,
        table: &'a StudyPlanTable,
        all: u32,
        context: &Context<'_>,
    ) -> Result<(&'a String, StudySource), FileError> {
        Ok(match table {
            StudyPlanTable::Random { name } => (name, StudySource::Random),
            StudyPlanTable::RandomEach { name } => (name, StudySource::RandomEach),
            StudyPlanTable::File { name, file } => {
                let key = format!("{key}.file");
                let plan = self.plan(&key, &self.resolve(file), context.joints)?;
                self.divides(&key, plan.measurements(), all)?;
                (name, StudySource::File(plan))
            }
            StudyPlanTable::Optimal {
                name,
                criterion,
                configurations,
                experiments,
            } => {
                let experiments_key = format!("{key}.experiments");
                let experiments = experiments.unwrap_or(all);
                self.enough(&experiments_key, experiments, context.parameters)?;
                self.divides(&experiments_key, experiments, all)?;
                let mandatory = context.design.mandatory.measurements();
                if experiments < mandatory {
                    let problem =
                        format!("found {experiments}; design.mandatory alone has {mandatory}");
                    return Err(self.wrong(&experiments_key, problem));
                }
                if let Some(configurations) = *configurations {
                    let key = format!("{key}.configurations");
                    self.enough(&key, configurations, context.parameters)?;
                    if configurations > experiments {
                        let problem =
                            format!("found {configurations}; at most {experiments} are allowed");
                        return Err(self.wrong(&key, problem));
                    }
                }
                let source = StudySource::Optimal {
                    criterion: *criterion,
                    configurations: *configurations,
                    experiments,
                };
                (name, source)
            }
        })
    }

    fn divides(&self, key: &str, experiments: u32, all: u32) -> Result<(), FileError> {
        if experiments > 0 && all.is_multiple_of(experiments) {
            return Ok(());
        }
        let problem = format!(
            "found {experiments} measurements; whole repetitions must make up study.experiments = {all}"
        );
        Err(self.wrong(key, problem))
    }
}
