//! `lab`: a plan goes to the laboratory.

use crate::files::make_folder;
use crate::laboratory::{Campaign, CampaignError, Program, hang_or_apply, program};
use crate::measurement::{
    AbsoluteReading, CONTROLLER_COMPENSATES, RowToFillIn, readings_to_fill_in, table_to_fill_in,
};
use crate::parameter::Unloaded;
use crate::plan::absolute::AbsolutePlanning;
use crate::plan::{Feasibility, Plan};
use crate::record::campaign::campaign_json;
use crate::robot::ReadsAlong;
use crate::study::TakenPlan;
use crate::text::wording::duration;
use crate::view::run_sheet::run_sheet;
use crate::view::stills::Stills;
use nalgebra::Vector3;

use super::command_prelude::*;
use super::dialect::dialect_if_suitable;
use super::results;
use super::views::RUN_SHEET;
use super::written::record_text;

/// The table to fill in, and the record.
const FILES: [&str; 2] = ["measurements.csv", "campaign.json"];

#[derive(Debug, Args)]
#[command(mut_args(without_effect(&["threads", "seed"])))]
pub struct Lab {
    #[command(flatten)]
    pub common: Common,
    /// The plan to carry out.
    #[arg(long, value_name = "FILE")]
    plan: PathBuf,
    /// Keep the plan's order of experiments and loads.
    #[arg(long)]
    keep_order: bool,
    /// The dialect of the robot's program: krl, urscript, or a file that ends in .toml; the scenario's if not given.
    #[arg(long, value_name = "NAME|FILE")]
    dialect: Option<String>,
}

impl Lab {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let scenario = self.common.open("lab")?;
        let commands = scenario.task.belief.commands();
        let (dialect, no_program) = dialect_if_suitable(self.dialect.as_deref(), &scenario)?;
        let name = &scenario.name;
        let folder = self.common.folder(&scenario).join("lab");
        // Their names do not depend on what is in them.
        let files = |program: &Program| match &dialect {
            Some(dialect) => program.files(dialect, &scenario.laboratory, &commands, name),
            None => Ok(Vec::new()),
        };
        let empty = files(&Program::default())?;
        let programs = empty.iter().map(|file| &*file.name);
        let names: Vec<&str> = FILES
            .into_iter()
            .chain([RUN_SHEET])
            .chain(programs)
            .collect();
        self.common
            .check_files(&scenario, Some((&folder, &names)))?;

        let chain = &scenario.task.belief.nominal.chain;
        let axes = match &dialect {
            Some(dialect) => dialect.axes_of(&commands)?,
            None => (chain.commanded())
                .map(|joint| chain.joints[joint].name.as_str())
                .collect(),
        };
        let taken = TakenPlan::read(&scenario.task, &[], &self.plan)?;
        let (campaign, table, conditions) = self.carry_out(&scenario, &taken)?;
        let stills = Stills::of_taken(&scenario, &taken);
        let sheet = run_sheet(&scenario, &stills, &campaign, &axes, dialect.is_some())?;
        make_folder(&folder)?;
        let title = format!("elastocal: {name}, {}", self.plan.display());
        let gravity = &scenario.task.belief.nominal.chain.gravity_m_s2;
        let files = files(&program(&campaign, gravity, &title))?;
        let text = describe(stills.plan.measurements(), &campaign, gravity);
        let mut report = Report::new(Value::Null, text, conditions);
        report.save(&folder.join(RUN_SHEET), &sheet);
        for file in &files {
            report.save(&folder.join(&file.name), &file.text);
        }
        let provenance = self.common.provenance(&scenario)?;
        let costs = &scenario.laboratory.costs;
        let record = campaign_json(&commands, costs, &campaign);
        report.json = results("lab", &provenance, [record]);
        let [to_fill, record] = FILES.map(|name| folder.join(name));
        report.save(&to_fill, &table);
        report.conditions.extend(no_program);
        let of_campaign = campaign.conditions(&scenario.laboratory);
        report.conditions.extend(of_campaign);
        let record_text = record_text(&mut report.json, &report.conditions)?;
        report.save(&record, &record_text);
        Ok(report)
    }

    /// A plan as it is carried out, the table to fill in, and what must be looked at.
    fn carry_out(
        &self,
        scenario: &Scenario,
        plan: &TakenPlan<'_>,
    ) -> Result<(Campaign, String, Vec<Condition>), FileError> {
        let (task, laboratory) = (&scenario.task, &scenario.laboratory);
        let count = match plan {
            TakenPlan::Deflections(plan) => counted(plan.experiments.len() as u64, "experiment"),
            TakenPlan::Readings(taken) => counted(taken.plan.len() as u64, "absolute reading"),
        };
        (self.common).say(&format!("looking for ways and an order for {count}"));
        let campaign = match plan {
            TakenPlan::Deflections(plan) => Campaign::new(task, laboratory, plan, self.keep_order),
            TakenPlan::Readings(taken) => {
                let readings = (&taken.planning, &*taken.plan);
                Campaign::of_readings(task, laboratory, readings, self.keep_order)
            }
        };
        let campaign = campaign.map_err(|error| {
            let wrong = FileError::new(&self.plan, error.to_string());
            wrong.code(ErrorCode::Campaign).hint(CampaignError::HINT)
        })?;
        let plan = match plan {
            TakenPlan::Deflections(plan) => plan,
            TakenPlan::Readings(taken) => {
                let table = readings_table(scenario, &taken.planning, &campaign);
                return Ok((campaign, table, Vec::new()));
            }
        };
        let violations = Feasibility::new(task).violations(plan);
        let violated = violations.first().map(|first| {
            let count = counted(violations.len() as u64, "violation");
            let plan = self.plan.display();
            ConditionCode::Violation.with(format!("{plan}: the plan has {count}: {first}"))
        });
        let drifts = campaign.drifts_otherwise(task, laboratory);
        let conditions = violated.into_iter().chain(drifts).collect();
        let table = to_fill_in(scenario, plan, &campaign);
        Ok((campaign, table, conditions))
    }
}

/// Whether a table says from which side configurations are approached.
fn says_sides(scenario: &Scenario, plan_says: bool) -> bool {
    plan_says || scenario.task.belief.uncertain.has_backlash()
}

/// A file of absolute readings that are to be filled in, in the order of work.
fn readings_table(
    scenario: &Scenario,
    planning: &AbsolutePlanning<'_>,
    campaign: &Campaign,
) -> String {
    let plan_says = (planning.candidates.iter()).any(|each| each.approach.is_some());
    let says_sides = says_sides(scenario, plan_says);
    let stops = campaign.stops.iter().enumerate();
    let readings = stops.flat_map(|(place, stop)| {
        // All candidates are the plan, in its order.
        (stop.experiments.iter()).map(move |&index| AbsoluteReading {
            configuration_rad: stop.configuration.clone(),
            visit: Some((campaign.came_at(place) + 1).to_string()),
            approach: stop.side.as_approach().filter(|_| says_sides),
            ..planning.blank_reading(index)
        })
    });
    let readings: Vec<AbsoluteReading> = readings.collect();
    head(
        scenario,
        "# what the instrument shows at each stop, in a frame of its own; visit is the number of the stop at which the robot came\n",
    ) + &readings_to_fill_in(&scenario.task.belief.commands(), &readings)
}

/// What stands over a table to fill in.
fn head(scenario: &Scenario, what: &str) -> String {
    scenario.origin().comments()
        + &format!("# {CONTROLLER_COMPENSATES}no\n")
        + "# does the controller compensate deflections by itself (KUKA: $ABS_ACCUR)? Write yes or no there.\n"
        + what
}

/// A measurement CSV whose positions are to be filled in: a row for each measurement, in the order of work.
fn to_fill_in(scenario: &Scenario, plan: &Plan, campaign: &Campaign) -> String {
    let belief = &scenario.task.belief;
    let plan_says = (plan.experiments.iter()).any(|each| each.approach.is_some());
    let says_sides = says_sides(scenario, plan_says);
    let stops = || campaign.stops.iter().enumerate();
    let rows = stops().filter_map(|(place, stop)| Some((place + 1, stop, stop.load.as_ref()?)));
    let rows = rows.flat_map(|(place, stop, load)| {
        (stop.experiments.iter()).flat_map(move |&index| {
            let (unloaded, before) = campaign.without_load(plan, index, place - 1);
            (1..=stop.readings as usize).map(move |reading| RowToFillIn {
                unloaded: match belief.instrument.unloaded {
                    Unloaded::Own => [unloaded + 1, before as usize + reading],
                    Unloaded::Shared => [unloaded + 1, 1],
                },
                loaded: [place, reading],
                configuration_rad: &stop.configuration,
                load,
                approach: stop.side.as_approach().filter(|_| says_sides),
                direction: stop.direction,
            })
        })
    });
    let table = table_to_fill_in(
        &belief.commands(),
        belief.instrument.rotation_sigma_rad,
        rows,
    );
    let of_gauge = "# what the gauge shows under the load, set to zero without it: positive along its direction (world frame)\n";
    let of_positions = "# positions of the reflector without and with the load as the sheet has them, world frame; where the \
         instrument shows\n# their difference: dx_mm,dy_mm,dz_mm in place of the six columns\n";
    let what = match belief.instrument.reads_along() {
        ReadsAlong::Always => of_gauge.to_owned(),
        ReadsAlong::Sometimes => {
            format!("{of_positions}# rows with a direction: {}", &of_gauge[2..])
        }
        ReadsAlong::Never => of_positions.to_owned(),
    };
    head(scenario, &what) + &table
}

/// The stops for a person.
fn describe(measurements: u32, campaign: &Campaign, gravity_m_s2: &Vector3<f64>) -> String {
    let is_absolute = campaign.stops.iter().any(|stop| !stop.targets.is_empty());
    let has_stations = campaign.stops.iter().any(|stop| stop.station.is_some());
    let has_gauge = campaign.stops.iter().any(|stop| stop.at_gauge.is_some());
    let rows = (campaign.stops.iter().enumerate()).map(|(index, stop)| {
        let experiments: Vec<String> = (stop.experiments.iter())
            .map(|index| (index + 1).to_string())
            .collect();
        let load = match (&stop.load, stop.changes_load) {
            (None, _) => "none".to_owned(),
            (Some(load), true) => {
                let verb = hang_or_apply(load, gravity_m_s2);
                format!("{verb} {}", crate::experiment::in_words(load))
            }
            (Some(_), false) => "the same".to_owned(),
        };
        let mut row = vec![(index + 1).to_string()];
        row.extend(has_stations.then(|| stop.station.clone().unwrap_or_default()));
        row.extend([experiments.join(", "), load]);
        row.push(if is_absolute {
            stop.targets.join(", ")
        } else {
            stop.readings.to_string()
        });
        row.extend([stop.side.to_string(), stop.way.via.len().to_string()]);
        if has_gauge {
            row.push(or_dash(stop.at_gauge, |at| at.near()));
            row.push(or_dash(stop.at_gauge, |at| at.shows()));
        }
        row
    });
    let (experiment, reads, count) = if is_absolute {
        let readings = campaign.stops.iter().map(|stop| stop.experiments.len());
        let count = counted(readings.sum::<usize>() as u64, "absolute reading");
        ("reading", "reads", count)
    } else {
        (
            "experiment",
            "readings",
            counted(measurements.into(), "measurement"),
        )
    };
    let station = if has_stations { "station | " } else { "" };
    let gauge = if has_gauge {
        " | gauge near [mm] | should show [mm]"
    } else {
        ""
    };
    let header = format!(
        "stop | {station}{experiment} | load | {reads} | approached with | over safe poses{gauge}"
    );
    let looked = if campaign.is_checked {
        "Every move keeps the clearance."
    } else {
        "Moves were not looked at for collisions: the scenario names no region.collision_clearance_mm."
    };
    let stations = counted(campaign.set_ups() as u64, "station");
    let from = has_stations.then(|| format!(" from {stations}"));
    format!(
        "{}\n{} in {}{}, {} of load: {}. {looked}\n",
        table(&header, rows),
        count,
        counted(campaign.stops.len() as u64, "stop"),
        from.unwrap_or_default(),
        counted(campaign.load_changes() as u64, "change"),
        duration(campaign.minutes),
    )
}
