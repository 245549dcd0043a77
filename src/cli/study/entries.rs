//! The plans of a study: read, designed or drawn.

use anyhow::Context;
use elastocal::plan::Plan;
use elastocal::plan::search::random_plan;
use elastocal::scenario::Scenario;
use elastocal::study::{Conditions, StudyPlan, StudySource};
use elastocal::study::{Entry, EntryKind, Setting, repeated};
use elastocal::wording::counted;

use crate::cli::Common;
use crate::cli::interruption::NEVER;
use crate::cli::plan::{Wanted, design};
use crate::cli::proof::ProofArgs;

/// The plans of a study, under all conditions for which whole repetitions make up the measurements.
pub fn entries(
    common: &Common,
    scenario: &Scenario,
    settings: &[Setting<'_>],
) -> anyhow::Result<Vec<Entry>> {
    let mut entries: Vec<Entry> = Vec::new();
    for (index, setting) in settings.iter().enumerate() {
        for plan in &scenario.study.plans {
            if !plan.source.fits(setting.conditions.experiments) {
                continue;
            }
            // Sigma changes no plan.
            let known = entries.iter().find(|entry| {
                let conditions = &settings[entry.setting].conditions;
                let sigma_m = setting.conditions.sigma_m;
                entry.name == plan.name
                    && Conditions {
                        sigma_m,
                        ..*conditions
                    } == setting.conditions
            });
            let kind = match known {
                Some(entry) => entry.kind.clone(),
                None => entry_kind(common, scenario.seed, setting, plan)?,
            };
            entries.push(Entry {
                name: plan.name.clone(),
                setting: index,
                kind,
            });
        }
    }
    Ok(entries)
}

/// Reads, designs or draws a plan, and repeats it as a whole.
fn entry_kind(
    common: &Common,
    seed: u64,
    setting: &Setting<'_>,
    plan: &StudyPlan,
) -> anyhow::Result<EntryKind> {
    let (task, conditions) = (&setting.task, &setting.conditions);
    let whole = |plan: &Plan| {
        let found = plan.measurements();
        repeated(plan, conditions.experiments).with_context(|| {
            let wanted = conditions.experiments;
            format!("{found} measurements do not make up {wanted} by whole repetitions")
        })
    };
    Ok(match &plan.source {
        StudySource::File(plan) => {
            let mut plan = whole(plan)?;
            for experiment in &mut plan.experiments {
                experiment.load = experiment.load.scaled(conditions.load_scale);
            }
            EntryKind::Fixed(plan)
        }
        StudySource::Optimal {
            criterion,
            configurations,
            experiments,
        } => {
            let experiments = experiments.unwrap_or(conditions.experiments);
            common.say(&format!(
                "designing the plan {:?} of {}",
                plan.name,
                counted(experiments.into(), "measurement")
            ));
            let designed = design(
                common,
                task,
                seed,
                Wanted {
                    criterion: *criterion,
                    experiments,
                    configurations: *configurations,
                },
                &ProofArgs::NONE,
                &NEVER,
            )?;
            EntryKind::Fixed(whole(&designed.exact.plan)?)
        }
        StudySource::Random => {
            EntryKind::Random(random_plan(task, conditions.experiments, seed, 0)?)
        }
        StudySource::RandomEach => EntryKind::RandomEach,
    })
}
