//! Compliances from deflections, and robots from absolute readings, with residuals and likely input errors.

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::codes::{Condition, ConditionCode};
use crate::identification::input_errors::{
    LikelyInputError, conditions_of_table, outside_limits, suspected_input_errors,
    unknown_approaches,
};
use crate::identification::patterns::{Patterns, looked_at};
use crate::identification::{
    AbsoluteCase, AbsoluteFit, AbsoluteMessage, Case, FitChoices, Identification,
    IdentificationBasis, IdentificationError, IdentificationMessage, Inconsistencies,
    MeasurementResidual, ModelSelection, ParameterGroup, ReadingWeights, RejectedReading,
    RepeatComponents, Repeats, Robustness, Told, left_out, residuals,
};
use crate::measurement::{AbsoluteReading, Digested, Measurement, digests_of};
use crate::numeric::tolerance::ends;
use crate::quantities::units::thousandths;
use crate::record::messages::{ProvenanceMessage, results};
use crate::robot::{SerialChain, Tool};
use crate::scenario::Scenario;
use crate::task::{Belief, Gauge, station_named};

/// What measurements say.
#[derive(Debug)]
pub struct Identified {
    /// The compliances, and how well they are known.
    pub identification: Identification,
    /// The measurements that were left out, since they lie far out.
    pub rejected: Vec<RejectedReading>,
    /// What is left of each measurement.
    pub residuals: Vec<MeasurementResidual>,
    /// What the table shows by itself.
    pub of_table: Vec<Condition>,
    /// What a gauge shows beyond its range.
    beyond_range: Option<String>,
    /// Likely input errors.
    pub input_errors: Vec<LikelyInputError>,
    /// What the residuals go with.
    pub patterns: Patterns,
    /// What repeated measurements show, where there are some.
    pub repeats: Option<Repeats>,
}

/// Why nothing was identified.
#[derive(Debug)]
pub struct NotIdentified {
    /// The reason.
    pub error: IdentificationError,
    /// What the table shows by itself, and likely input errors.
    pub conditions: Vec<Condition>,
}

/// Identifies what a belief leaves open. Input errors are looked for in all measurements, patterns in those that were not left out.
pub fn identify_measurements(
    case: Case<'_>,
    robustness: Robustness,
) -> Result<Identified, NotIdentified> {
    let measurements = case.measurements;
    let failed = |error| NotIdentified {
        error,
        conditions: conditions_of_table(&case)
            .into_iter()
            .chain(
                suspected_input_errors(&case, None)
                    .iter()
                    .map(LikelyInputError::condition),
            )
            .collect(),
    };
    let robust = case.identify_robustly(robustness).map_err(failed)?;
    let identification = &robust.identification;
    let all = case;
    let case = Case {
        held: &robust.held,
        ..all
    };
    let weighed = case.with(&robust.weighed);
    let residuals = residuals(&weighed, identification, &robust.rejected).map_err(failed)?;
    let of_table = conditions_of_table(&all);
    let input_errors = suspected_input_errors(&all, Some(&robust.of_all));
    let looked = looked_at(&case, &robust);
    let rows: Vec<usize> = (0..measurements.len()).collect();
    let repeats = Repeats::of_deflections(measurements, &robust.of_kept(&rows));
    Ok(Identified {
        repeats,
        patterns: looked.patterns(&robust.rejected),
        identification: robust.identification,
        rejected: robust.rejected,
        residuals,
        of_table,
        beyond_range: beyond_gauge(all.belief.instrument.gauge, measurements),
        input_errors,
    })
}

impl Identified {
    /// What must be looked at.
    pub fn conditions(&self) -> impl Iterator<Item = Condition> {
        let conditions = self.identification.conditions().into_iter();
        conditions.chain(self.further_doubts())
    }

    /// Those besides the identification's own.
    fn further_doubts(&self) -> impl Iterator<Item = Condition> {
        let left_out = self.left_out().and_then(Result::ok).into_iter();
        let input_errors = self.input_errors.iter().map(LikelyInputError::condition);
        (left_out.chain(self.of_table.iter().cloned())).chain(input_errors)
    }

    /// What holds since the fit counts it, and nobody need act on.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.identification.notes();
        notes.extend(self.beyond_range.clone());
        notes.extend(self.left_out().and_then(Result::err));
        notes
    }

    fn left_out(&self) -> Option<Told> {
        left_out(&self.rejected, self.residuals.len(), "measurement")
    }

    /// The record for `compensate`, and for whoever looks at it.
    pub fn json(
        &self,
        scenario: &Scenario,
        measurements: &[Measurement],
        provenance: &ProvenanceMessage,
        sigma_from_residuals: bool,
    ) -> serde_json::Result<Value> {
        let nominal = &scenario.task.belief.nominal.compliance_rad_per_nm;
        let mut message = IdentificationMessage::new(&self.identification, nominal);
        message.conditions.extend(self.further_doubts());
        let discrepancy = self.identification.discrepancy;
        let has_rotations = (self.residuals.iter()).any(|each| each.standardised.len() > 3);
        let more = json!({
            "sigma_from_residuals": sigma_from_residuals,
            "residuals": self.residuals,
            "diagnoses": self.input_errors,
            "discrepancy_mm": discrepancy.map(|[position_m, _]| position_m * 1e3),
            "discrepancy_mrad": discrepancy.filter(|_| has_rotations).map(|[_, rotation_rad]| rotation_rad * 1e3),
            "rejected": self.rejected,
            "patterns": self.patterns,
            "repeats": self.repeats,
            "notes": self.notes(),
        });
        let keys = [json!(message), json!(basis(scenario, measurements)), more];
        Ok(results("identify", provenance, keys))
    }
}

/// What rests on a scenario and on readings.
pub fn basis<R: Digested>(scenario: &Scenario, readings: &[R]) -> IdentificationBasis {
    let belief = &scenario.task.belief;
    let before = belief.prior_campaign.iter();
    let before = before.flat_map(|each| each.reading_digests.iter().copied());
    IdentificationBasis {
        identified_with: Some(belief.fingerprint()),
        earlier_left_out: (belief.prior_campaign.as_ref()).map(|each| each.left_out.clone()),
        scenario_file: scenario.path.to_str().map(str::to_owned),
        error_sources: Some(belief.source_names()),
        reading_digests: Some(before.chain(digests_of(readings)).collect()),
    }
}

/// A target is another one where it is further than this from its place (m)
const MOUNTED_M: f64 = 0.01;
/// and nearer to that one's by this factor.
const EXCHANGED: f64 = 0.25;

/// What absolute readings say.
#[derive(Debug)]
pub struct IdentifiedRobot<'a> {
    /// The readings, with stations and targets.
    pub case: AbsoluteCase<'a>,
    /// The fit.
    pub fit: AbsoluteFit,
    /// What its residuals go with.
    pub patterns: Patterns,
    /// What goes with order, time or temperature beside joint error functions, where there are some: these hide it.
    pub drifts: Option<Patterns>,
    /// What repeated visits show, where there are some.
    pub repeats: Option<Repeats>,
    /// Variance components of these.
    pub repeat_components: Option<RepeatComponents>,
    /// The input error that explains what frames alone leave.
    pub likely: Option<Condition>,
    /// Lengths that nothing shows where they were read.
    beyond_range: Option<String>,
    /// The halves of joint space beside each other, where each has enough readings; and other series.
    pub inconsistencies: Vec<Inconsistencies>,
}

/// Readings that are fitted so.
fn chosen<'a>(
    belief: &'a Belief,
    readings: &[AbsoluteReading],
    choices: FitChoices,
) -> Result<AbsoluteCase<'a>, IdentificationError> {
    let mut case = AbsoluteCase::new(belief, readings)?.counting_sources_of_lengths();
    case.choices = choices;
    Ok(case)
}

/// Fits what a belief leaves open, or groups of parameters, with all frames. Readings are weighed so; those that lie far out are
/// left out, unless all are to be kept.
pub fn identify_absolute<'a>(
    belief: &'a Belief,
    readings: &[AbsoluteReading],
    groups: &[ParameterGroup],
    choices: FitChoices,
) -> Result<IdentifiedRobot<'a>, IdentificationError> {
    let mistaken = |source: IdentificationError| {
        let placed = AbsoluteCase::placed(belief, readings).ok();
        match placed.and_then(|placed| placed.likely_input_error()) {
            Some(likely) => IdentificationError::Mistaken {
                source: Box::new(source),
                likely: likely.text,
            },
            None => source,
        }
    };
    let mut case = chosen(belief, readings, choices).map_err(mistaken)?;
    let likely = case.likely_input_error();
    let fit = case.fit(groups, choices.weights).map_err(mistaken)?;
    // Geometry and elasticity may explain what frames alone do not.
    let likely = likely.filter(|_| !fit.explains_all());
    // What lies far out is no pattern, and no inconsistency.
    let mut kept = case.kept(&fit);
    let looked = kept.looked_at(&fit, &fit.of_kept(readings))?;
    let beside = kept.looked_at_beside_joint_errors(&fit, &fit.of_kept(readings))?;
    let halves = halves(&mut kept, &fit);
    // These are of three coordinates.
    let mut repeated = fit.kept();
    repeated.retain(|&place| readings[place].length.is_none());
    let residuals_m: Vec<Vector3<f64>> = fit.left.iter().map(|each| each.position_m).collect();
    Ok(IdentifiedRobot {
        repeat_components: case.repeat_components(&fit),
        repeats: Repeats::of_readings(readings, &residuals_m, &repeated, &case.visits),
        patterns: looked.patterns(&fit.rejected),
        drifts: beside.map(|beside| beside.drifts(&fit.rejected)),
        inconsistencies: halves.into_iter().collect(),
        likely,
        beyond_range: beyond_stations(belief, readings),
        case,
        fit,
    })
}

/// What in absolute readings contradicts the planner's model, by which accuracies are predicted; nothing where they cannot be fitted yet.
pub fn contradictions(
    belief: &Belief,
    readings: &[AbsoluteReading],
    groups: &[ParameterGroup],
) -> Vec<Condition> {
    let weights = ReadingWeights::AsNeeded;
    let fit = chosen(belief, readings, FitChoices::weighed(weights))
        .and_then(|mut case| case.fit(groups, weights));
    fit.map_or_else(|_| Vec::new(), |fit| fit.contradictions(belief))
}

/// The halves of joint space beside each other.
fn halves(case: &mut AbsoluteCase<'_>, fit: &AbsoluteFit) -> Option<Inconsistencies> {
    let (half_of, found) = case.inconsistencies_of_halves(fit)?;
    let reach = |joint: usize, half: usize| {
        let all = case.observations.iter().zip(&half_of);
        let own = all.filter(|(_, other)| **other == half);
        ends(own.map(|(each, _)| each.setup.commanded_rad[joint]))
    };
    let is_apart = |joint: &usize| {
        let [one, other] = [0, 1].map(|half| reach(*joint, half));
        one[1] < other[0] || other[1] < one[0]
    };
    let joint = (0..case.arm.chain.len()).find(is_apart)?;
    let of_half = |half: usize| {
        let moving = &case.arm.chain.joints[joint];
        let [low, high] = reach(joint, half).map(|value| {
            let (value, unit) = moving.drive.shown(value);
            format!("{value:.1} {unit}")
        });
        format!("where {} is {low} to {high}", moving.name)
    };
    Some(Inconsistencies {
        between: [of_half(0), of_half(1)],
        ..found
    })
}

/// The uncertainties that are new in each reading, where readings were not weighed by them: a discrepancy that the residuals show consists of
/// them. Joint error functions are fitted.
pub fn uncounted(identified: &IdentifiedRobot<'_>) -> Vec<String> {
    let sources = identified.case.belief.uncertain.sources();
    let counts_them = identified.fit.counts_sources;
    let new = sources.filter(|(_, source)| !counts_them && !source.is_function());
    new.map(|(name, _)| name.to_owned()).collect()
}

/// Models with more and more parameters, compared by blocks of joint space. Readings are weighed so; those that lie far out are
/// left out, unless all are to be kept.
pub fn model_selection(
    belief: &Belief,
    readings: &[AbsoluteReading],
    choices: FitChoices,
) -> Result<ModelSelection, IdentificationError> {
    let mut case = chosen(belief, readings, choices)?;
    case.model_selection(choices.weights)
}

impl<'a> IdentifiedRobot<'a> {
    /// Holds another series of readings of the same robot beside this one, each in words; the other one is fitted apart with the
    /// same groups.
    ///
    /// # Errors
    /// See [`IdentificationError`]: of the other series.
    pub fn compare(
        &mut self,
        belief: &'a Belief,
        readings: &[AbsoluteReading],
        groups: &[ParameterGroup],
        between: [String; 2],
    ) -> Result<(), IdentificationError> {
        let mut other = chosen(belief, readings, self.case.choices)?;
        let fit = other.fit(groups, self.case.choices.weights)?;
        let (mut kept, mut other) = (self.case.kept(&self.fit), other.kept(&fit));
        let found = kept.inconsistencies_with(&self.fit, &mut other, &fit)?;
        self.inconsistencies
            .push(Inconsistencies { between, ..found });
        Ok(())
    }

    /// What must be looked at.
    pub fn conditions(&self) -> Vec<Condition> {
        let mut conditions: Vec<Condition> = self.likely.iter().cloned().collect();
        conditions.extend(self.exchanged_targets());
        conditions.extend(self.fit.conditions());
        let (belief, readings) = (self.case.belief, self.case.observations.iter());
        let commands = (readings.clone()).map(|each| &each.setup.commanded_rad);
        conditions.extend(outside_limits(&belief.nominal.chain, "reading", commands));
        let sides = readings.map(|each| each.setup.approach.as_ref());
        conditions.extend(unknown_approaches(&belief.uncertain, "reading", sides));
        let inconsistencies = self.inconsistencies.iter();
        conditions.extend(inconsistencies.flat_map(Inconsistencies::conditions));
        conditions
    }

    /// Targets that are found where the model has another one on the same link: their names may be exchanged.
    fn exchanged_targets(&self) -> Vec<Condition> {
        let model = &self.case.belief.nominal.model;
        let places = self.case.targets.iter().zip(&self.fit.arm.tools);
        let places: Vec<(Tool, &Tool)> = places
            .filter_map(|(name, found)| Some((SerialChain::tool(model, name).ok()?, found)))
            .collect();
        let sites = model.named_sites().into_iter();
        let sites: Vec<Tool> = sites
            .filter_map(|(name, _)| SerialChain::tool(model, &name).ok())
            .collect();
        let nearest = |(own, found): &(Tool, &Tool)| {
            let place = found.link_from_tool.translation.vector;
            let away_m = |tool: &Tool| (place - tool.link_from_tool.translation.vector).norm();
            let others = sites.iter().filter(|tool| tool.joints == own.joints);
            let others = others.filter(|tool| tool.name != own.name);
            let others = others.map(|tool| (away_m(tool), &tool.name));
            let (other_m, other) = others.min_by(|one, other| one.0.total_cmp(&other.0))?;
            let is_other = away_m(own) > MOUNTED_M && other_m < EXCHANGED * away_m(own);
            is_other.then(|| {
                let name = &own.name;
                ConditionCode::InputError.with(format!(
                    "likely input error: are targets exchanged? {name:?} is {:.1} mm from where the model has it, and {:.1} mm from {other:?}",
                    away_m(own) * 1e3,
                    other_m * 1e3
                ))
            })
        };
        places.iter().filter_map(nearest).collect()
    }

    /// What holds since the fit counts it, and nobody need act on.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.fit.notes();
        if !self.case.positions().is_empty()
            && let Some(lengths) = self.case.lengths_in_words()
        {
            notes.push(format!(
                "positions are weighed by the scenario's error sources, as the {lengths} beside them are"
            ));
        }
        notes.extend(self.beyond_range.clone());
        notes
    }

    /// The record.
    pub fn json(
        &self,
        scenario: &Scenario,
        readings: &[AbsoluteReading],
        provenance: &ProvenanceMessage,
        groups: &[ParameterGroup],
    ) -> serde_json::Result<Value> {
        let message = AbsoluteMessage::new(&self.case, &self.fit);
        let more = json!({
            "kind": "absolute",
            "groups": groups,
            "patterns": self.patterns,
            "drifts_beside_joint_errors": self.drifts,
            "repeats": self.repeats,
            "repeat_components": self.repeat_components,
            "inconsistencies": self.inconsistencies,
            "not_counted": uncounted(self),
            "conditions": self.conditions(),
            "notes": self.notes(),
        });
        let keys = [
            serde_json::to_value(message)?,
            json!(basis(scenario, readings)),
            more,
        ];
        Ok(results("identify", provenance, keys))
    }
}

/// Rounding of files.
const ROUNDING: f64 = 1e-9;

/// The displacements beyond a gauge's range, by their numbers.
pub fn beyond_gauge(gauge: Option<Gauge>, measurements: &[Measurement]) -> Option<String> {
    let range_m = gauge?.range_m?;
    let is_beyond = |each: &Measurement| {
        each.direction.is_some() && each.deflection_m.norm() > range_m * (1.0 + ROUNDING)
    };
    let beyond = numbers(measurements.iter().map(is_beyond))?;
    let range = thousandths(range_m);
    Some(format!(
        "the gauge shows at most {range} mm to either side, and more in measurement {beyond}"
    ))
}

/// The lengths outside of what their stations read, by their numbers.
pub fn beyond_stations(belief: &Belief, readings: &[AbsoluteReading]) -> Option<String> {
    let is_beyond = |each: &AbsoluteReading| {
        let station = station_named(&belief.stations, each.station.as_deref());
        (each.length.zip(station)).is_some_and(|(read, station)| {
            let room_m = ROUNDING * read.length_m;
            station.missed(read.length_m, room_m).is_some()
        })
    };
    let beyond = numbers(readings.iter().map(is_beyond))?;
    Some(format!(
        "lengths outside of the range of their stations, which no instrument shows there: reading {beyond}"
    ))
}

/// The numbers from 1 of those that hold; none where none does.
fn numbers(all: impl Iterator<Item = bool>) -> Option<String> {
    let beyond = (all.zip(1..)).filter(|(is_beyond, _)| *is_beyond);
    let beyond: Vec<String> = beyond
        .map(|(_, number): (_, usize)| number.to_string())
        .collect();
    (!beyond.is_empty()).then(|| beyond.join(", "))
}
