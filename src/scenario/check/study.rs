//! The table `[study]`: which plans a Monte Carlo study compares, over how many runs.

use std::collections::BTreeSet;
use std::path::Path;

use super::ArmChecker;
use crate::experiment::{Candidate, read_candidates};
use crate::files::FileError;
use crate::plan::search::SearchError;
use crate::plan::{Criterion, Plan};
use crate::quantities::limits::{MOST_CONDITIONS, MOST_EXPERIMENTS, MOST_STUDIED, MOST_TRIALS};
use crate::quantities::plausible::SPREAD;
use crate::scenario::PlanFile;
use crate::scenario::file::{Spread, StudyPlanTable, SweepTable};
use crate::study::{Conditions, StudyPlan, StudySettings, StudySource};
use crate::task::{AccuracyKind, Design};
use crate::text::wording::joined;

/// Without the key `trials`.
const DEFAULT_TRIALS: u64 = 10_000;
/// The same of absolute readings: each robot is drawn, read and fitted.
const DEFAULT_ROBOTS: u64 = 2_000;

/// What the rest of the scenario says that the study depends on.
pub(super) struct Context<'a> {
    pub sigma_m: f64,
    pub design: &'a Design,
    pub plans: &'a [PlanFile],
    pub parameters: usize,
    /// Those under which plans are compared; none yet where they are not read.
    pub conditions: Vec<Conditions>,
}

impl ArmChecker<'_> {
    pub(super) fn study(&self, mut context: Context<'_>) -> Result<StudySettings, FileError> {
        let table = &self.file.study;
        let usual = if self.is_absolute() {
            DEFAULT_ROBOTS
        } else {
            DEFAULT_TRIALS
        };
        let trials = table.trials.unwrap_or(usual);
        self.count("study.trials", trials, 1..=MOST_TRIALS)?;
        let base = Conditions {
            sigma_m: context.sigma_m,
            experiments: table.experiments.unwrap_or(context.design.experiments),
            load_scale: 1.0,
        };
        if table.experiments.is_some() {
            self.enough("study.experiments", base.experiments, &context)?;
        }
        context.conditions = self.conditions(&table.sweep, base, &context)?;
        let plans = match &table.plan {
            None => self.default_plans(&context)?,
            Some(tables) if tables.is_empty() => {
                let problem = "is empty; leave the key out for the default plans";
                return Err(self.wrong("study.plan", problem));
            }
            Some(tables) => {
                self.at_most(
                    "study.plan",
                    tables.len(),
                    MOST_STUDIED / context.conditions.len(),
                )?;
                self.study_plans(tables, &context)?
            }
        };
        Ok(StudySettings {
            trials,
            level: table.level,
            conditions: context.conditions,
            plans,
        })
    }

    /// The standard deviation of each compliance's logarithm.
    pub(super) fn spread(&self) -> Result<Vec<f64>, FileError> {
        let (key, joints) = ("study.compliance_spread", self.chain.len());
        match &self.file.study.compliance_spread {
            Spread::All(value) => Ok(vec![*value; joints]),
            Spread::Each(values) => self.one_per_joint(key, values, joints).map(<[f64]>::to_vec),
        }
        .and_then(|all| {
            let each = all.iter().map(|&value| self.number(key, value, &SPREAD));
            each.collect()
        })
        .map_err(|error| error.hint("0.1 lets the compliances vary by about 10 %"))
    }

    /// The base conditions with all combinations of what is swept.
    fn conditions(
        &self,
        table: &SweepTable,
        base: Conditions,
        context: &Context<'_>,
    ) -> Result<Vec<Conditions>, FileError> {
        let times = |unit: f64| move |_: &str, &value: &f64| Ok(value * unit);
        let enough = |key: &str, &m: &u32| self.enough(key, m, context).map(|()| m);
        let mm = 1e-3 * self.file.instrument.sigma_of.deflection_factor();
        let (counts, sigmas) = (table.experiments.as_ref(), table.sigma_mm.as_ref());
        let scales = table.load_scale.as_ref();
        let numbers = [
            counts.map(Vec::len),
            sigmas.map(Vec::len),
            scales.map(Vec::len),
        ];
        let combinations = (numbers.into_iter().flatten()).fold(1, usize::saturating_mul);
        self.at_most("study.sweep", combinations, MOST_CONDITIONS)?;
        let counts = self.swept("experiments", counts, base.experiments, enough)?;
        let scales = self.swept("load_scale", scales, base.load_scale, times(1.0))?;
        let sigmas_m = self.swept("sigma_mm", sigmas, base.sigma_m, times(mm))?;
        let mut all = Vec::with_capacity(combinations);
        for &experiments in &counts {
            for &load_scale in &scales {
                all.extend(sigmas_m.iter().map(|&sigma_m| Conditions {
                    sigma_m,
                    experiments,
                    load_scale,
                }));
            }
        }
        Ok(all)
    }

    /// The values of a condition that is swept, each once; the one that it has where none are given.
    fn swept<T: PartialEq + std::fmt::Display>(
        &self,
        name: &str,
        values: Option<&Vec<T>>,
        base: T,
        check: impl Fn(&str, &T) -> Result<T, FileError>,
    ) -> Result<Vec<T>, FileError> {
        let Some(values) = values else {
            return Ok(vec![base]);
        };
        let key = format!("study.sweep.{name}");
        if values.is_empty() {
            return Err(self.wrong(&key, "is empty; at least one number is needed"));
        }
        let one = |(index, value): (usize, &T)| {
            if values[..index].contains(value) {
                return Err(self.wrong(&key, format!("found {value} twice")));
            }
            check(&key, value)
        };
        values.iter().enumerate().map(one).collect()
    }

    fn enough(&self, key: &str, experiments: u32, context: &Context<'_>) -> Result<(), FileError> {
        let fewest = self.commands.reads_along.fewest(context.parameters);
        self.count(key, experiments, fewest..=MOST_EXPERIMENTS)
            .map(drop)
    }

    /// The scenario's plans that whole repetitions fill up, an optimal plan, and random ones.
    fn default_plans(&self, context: &Context<'_>) -> Result<Vec<StudyPlan>, FileError> {
        let conditions = &context.conditions;
        let mut plans = Vec::new();
        for (index, file) in context.plans.iter().enumerate() {
            let (plan, readings) = self.study_file(&format!("plan[{index}].file"), &file.path)?;
            if fits_any(plan.measurements(), conditions) {
                plans.push(StudyPlan {
                    name: file.name.clone(),
                    source: StudySource::File { plan, readings },
                });
            }
        }
        let as_designed = |each: &Conditions| each.experiments == context.design.experiments;
        let optimal = StudySource::Optimal {
            criterion: Criterion::TestPose,
            configurations: (context.design.configurations)
                .filter(|_| conditions.iter().all(as_designed)),
            experiments: None,
            noise_only: false,
        };
        // A plan of absolute readings takes long to be judged: one random plan stands for all.
        let random = if self.is_absolute() {
            ("random", StudySource::Random)
        } else {
            ("random_each", StudySource::RandomEach)
        };
        for (name, source) in [("optimal", optimal), random] {
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
        context: &Context<'_>,
    ) -> Result<Vec<StudyPlan>, FileError> {
        let names = tables.iter().map(StudyPlanTable::name);
        self.named("study.plan", MOST_STUDIED, names)?;
        let plans = self.each("study.plan", MOST_STUDIED, tables, |key, table| {
            Ok(StudyPlan {
                name: table.name().clone(),
                source: self.study_source(key, table, context)?,
            })
        })?;
        for each in &context.conditions {
            if !plans.iter().any(|plan| plan.source.fits(each.experiments)) {
                let problem = format!("found none for {} measurements", each.experiments);
                return Err(self.wrong("study.plan", problem));
            }
        }
        Ok(plans)
    }

    /// A plan's file; of absolute readings with what is read from where.
    fn study_file(&self, key: &str, path: &Path) -> Result<(Plan, Vec<Candidate>), FileError> {
        if !self.is_absolute() {
            let plan = self.plan(key, path)?;
            return Ok((plan, Vec::new()));
        }
        let rows = read_candidates(path, self.commands.clone());
        let rows = rows.map_err(|error| self.named_file(key, error))?;
        self.inputs.borrow_mut().add(path)?;
        let experiments = rows.iter();
        let experiments = experiments.map(|row| row.experiment(row.most.unwrap_or(1)));
        let plan = Plan {
            experiments: experiments.collect(),
        };
        Ok((plan, rows))
    }

    fn study_source(
        &self,
        key: &str,
        table: &StudyPlanTable,
        context: &Context<'_>,
    ) -> Result<StudySource, FileError> {
        Ok(match table {
            StudyPlanTable::Random { .. } => StudySource::Random,
            StudyPlanTable::RandomEach { .. } => StudySource::RandomEach,
            StudyPlanTable::File { file, .. } => {
                let key = format!("{key}.file");
                let (plan, readings) = self.study_file(&key, &self.resolve(file))?;
                self.divides(&key, plan.measurements(), &context.conditions)?;
                StudySource::File { plan, readings }
            }
            StudyPlanTable::Optimal {
                criterion,
                configurations,
                experiments,
                noise_only,
                ..
            } => {
                if criterion.bounded_as().is_none() {
                    let criterion = criterion.name();
                    let problem = SearchError::NotOptimised(criterion).to_string();
                    return Err(self.wrong(&format!("{key}.criterion"), problem));
                }
                let experiments_key = format!("{key}.experiments");
                if let Some(experiments) = *experiments {
                    self.enough(&experiments_key, experiments, context)?;
                    self.divides(&experiments_key, experiments, &context.conditions)?;
                }
                let fewest_studied = context.conditions.iter().map(|each| each.experiments).min();
                let fewest = experiments.or(fewest_studied).unwrap_or(0);
                let mandatory = context.design.mandatory.measurements();
                if fewest < mandatory {
                    let problem = format!("found {fewest}; design.mandatory alone has {mandatory}");
                    return Err(self.wrong(&experiments_key, problem));
                }
                if let Some(configurations) = *configurations {
                    let key = format!("{key}.configurations");
                    self.enough(&key, configurations, context)?;
                    if configurations > fewest {
                        let problem =
                            format!("found {configurations}; at most {fewest} are allowed");
                        return Err(self.wrong(&key, problem));
                    }
                }
                StudySource::Optimal {
                    criterion: *criterion,
                    configurations: *configurations,
                    experiments: *experiments,
                    noise_only: *noise_only,
                }
            }
        })
    }

    fn is_absolute(&self) -> bool {
        self.file.design.accuracy == AccuracyKind::Absolute
    }

    fn divides(
        &self,
        key: &str,
        measurements: u32,
        conditions: &[Conditions],
    ) -> Result<(), FileError> {
        if fits_any(measurements, conditions) {
            return Ok(());
        }
        let problem = format!(
            "found {measurements} measurements; whole repetitions must make up study.experiments = {}",
            joined(
                (conditions.iter().map(|each| each.experiments)).collect::<BTreeSet<u32>>(),
                " or "
            )
        );
        Err(self.wrong(key, problem))
    }
}

fn fits_any(measurements: u32, conditions: &[Conditions]) -> bool {
    (conditions.iter())
        .any(|each| measurements > 0 && each.experiments.is_multiple_of(measurements))
}
