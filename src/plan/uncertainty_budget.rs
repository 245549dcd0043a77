//! The uncertainty budget of a predicted accuracy, in the terms of the GUM (JCGM 100).
//!
//! ```text
//! u_i = |c_i| u(x_i),   u_c^2 = sum u_i^2,   U = k u_c
//! ```
//!
//! A contribution u_i is what a source leaves at the test poses, rms in space, through the one gain of the plan's estimate, so that
//! squares add up. U is the radius that holds 95 % of errors of that covariance: k is 1.96 along a line, 1.61 where all three
//! coordinates are alike.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::csv::word_field;
use crate::parameter::{ParameterKind, ReadingSource, SourceLevel, TransmissionError};
use crate::quantities::units::shown_unit;
use crate::task::{Belief, Extended};
use crate::text::wording::significant;

/// What the instrument's own noise is called.
pub const NOISE: &str = "noise";
/// What an earlier identification is called.
pub const EARLIER: &str = "earlier identification";
/// What is known before without a name in the scenario, as of a payload that nobody weighed.
const BEFORE: &str = "known before";
/// Standard uncertainties that differ by less than this share are equal.
const EQUAL: f64 = 1e-9;
/// All columns of a budget.
const COLUMNS: &str = "source,distribution,evaluation,level,standard_uncertainty,unit,sensitivity,sensitivity_unit,contribution_um,\
                       variance_share_percent,degrees_of_freedom";

/// How a standard uncertainty was evaluated (GUM 2.3.2, 2.3.3), not whether its error is random.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Evaluation {
    /// From statistics of readings.
    A,
    /// Given: a data sheet, a certificate, experience.
    B,
}

impl Evaluation {
    /// Its letter.
    pub const fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
        }
    }
}

/// A source of a budget. A source with several parameters, as of six joints, has u(x_i) of each where they are equal, and else the
/// contribution of all alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BudgetSource {
    /// Its name: "noise", "earlier identification", or that of an uncertainty of the scenario.
    pub source: String,
    /// From which distribution its standard uncertainty was evaluated: normal, uniform, triangular or arcsine.
    pub distribution: String,
    /// How its standard uncertainty was evaluated.
    pub evaluation: Evaluation,
    /// Where it takes a new value.
    pub level: SourceLevel,
    /// u(`x_i`) of each parameter in `unit`; null where they differ.
    pub standard_uncertainty: Option<f64>,
    /// The unit of that; "1" for a share.
    pub unit: Option<String>,
    /// |`c_i`| = `u_i` / u(`x_i`), in `sensitivity_unit`.
    pub sensitivity: Option<f64>,
    /// The unit of that.
    pub sensitivity_unit: Option<String>,
    /// The contribution `u_i`, rms over the test poses (um).
    pub contribution_um: f64,
    /// `u_i`^2 / `u_c`^2 (%).
    pub variance_share_percent: f64,
    /// Those of the residual scale where it was estimated; null where there is no end of them.
    pub degrees_of_freedom: Option<f64>,
    /// What it does not move, where its name might be read otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

/// The uncertainty budget of a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UncertaintyBudget {
    /// The combined standard uncertainty `u_c`, the predicted rms distance rho0 (um).
    pub combined_standard_uncertainty_um: f64,
    /// The expanded uncertainty U, the radius that holds 95 % of errors (um).
    pub expanded_uncertainty_um: Option<f64>,
    /// k = U / `u_c`.
    pub coverage_factor: Option<f64>,
    /// The instrument's noise, an earlier identification where there is one, then the uncertainties of the scenario.
    pub sources: Vec<BudgetSource>,
}

impl UncertaintyBudget {
    /// What sources contribute that the whole plan shares (m), however often is measured.
    pub fn shared_m(&self) -> f64 {
        let shared = (self.sources.iter()).filter(|each| each.level.is_shared_by_plan());
        let square_um2: f64 = shared.map(|each| each.contribution_um.powi(2)).sum();
        // A sum of nothing is -0.
        square_um2.abs().sqrt() * 1e-6
    }

    /// What a prediction of so-called measurements counts, in words that follow it.
    pub fn in_words(budget: Option<&Self>, noun: &str) -> String {
        match budget.filter(|budget| budget.has_more_than_noise()) {
            Some(_) => "with the whole uncertainty budget".to_owned(),
            None => format!("for the {noun}s' noise alone"),
        }
    }
}

/// A standard uncertainty in SI units, and its unit.
pub(crate) type Input = (f64, &'static str);

impl BudgetSource {
    /// One whose standard uncertainty is given, with what it leaves (m^2).
    fn new(source: &str, level: SourceLevel, input: Option<Input>, variance_m2: f64) -> Self {
        let contribution_um = variance_m2.max(0.0).sqrt() * 1e6;
        let input = input.map(|(value, unit)| {
            let (factor, unit) = shown_unit(unit);
            (rounded(value * factor), unit)
        });
        let sensitivity_unit = |unit: &str| match unit {
            "1" => "um".to_owned(),
            unit if unit.contains('/') => format!("um/({unit})"),
            unit => format!("um/{unit}"),
        };
        Self {
            source: source.to_owned(),
            distribution: "normal".to_owned(),
            evaluation: Evaluation::B,
            level,
            standard_uncertainty: input.map(|(value, _)| value),
            unit: input.map(|(_, unit)| unit.to_owned()),
            sensitivity: input.map(|(value, _)| contribution_um / value),
            sensitivity_unit: input.map(|(_, unit)| sensitivity_unit(unit)),
            contribution_um,
            variance_share_percent: 0.0,
            degrees_of_freedom: None,
            remark: None,
        }
    }

    /// That of errors of readings.
    fn of_readings(
        name: &str,
        source: &ReadingSource,
        extended: &Extended,
        (level, variance_m2): (SourceLevel, f64),
    ) -> Self {
        let of_joints = |deviations: &[f64]| {
            let joints = deviations.iter().zip(&extended.arm().chain.joints);
            common(joints.map(|(&deviation, joint)| {
                let unit = if joint.drive.slides { "m" } else { "rad" };
                (deviation, unit)
            }))
        };
        let input = match source {
            ReadingSource::JointRepeatability(each)
            | ReadingSource::TransmissionError(TransmissionError {
                deviations: each, ..
            }) => of_joints(each),
            ReadingSource::LoadDirection(deviation) | ReadingSource::GaugeDirection(deviation) => {
                Some((*deviation, "rad"))
            }
            ReadingSource::LoadPoint(deviation) => Some((*deviation, "m")),
            ReadingSource::Discrepancy(error) => Some((error.deviation_m, "m")),
            ReadingSource::Range(noise) => {
                common([noise.per_metre, noise.along_per_metre].map(|each| (each, "m/m")))
            }
        };
        Self {
            distribution: extended.distribution(name).name().to_owned(),
            remark: (source.remark())
                .filter(|_| level == source.level())
                .map(str::to_owned),
            ..Self::new(name, level, input, variance_m2)
        }
    }

    /// That of parameters at places of the extended vector.
    fn of_parameters(name: &str, extended: &Extended, places: &[usize], variance_m2: f64) -> Self {
        let parameters = extended.set().parameters();
        let input = common(places.iter().map(|&place| {
            let parameter = &parameters[place];
            let deviation = extended.own_precision(place).sqrt().recip();
            let whole = if parameter.is_logarithmic {
                1.0
            } else {
                parameter.kind.whole(extended.arm()).abs()
            };
            (
                deviation / whole,
                parameter.of_joint(parameter.kind.unit(true)),
            )
        }));
        let first = places.first().map(|&place| parameters[place].kind);
        let level = first.map_or(SourceLevel::Robot, ParameterKind::level);
        Self {
            distribution: extended.distribution(name).name().to_owned(),
            remark: first
                .and_then(|kind| remark(extended, kind))
                .map(str::to_owned),
            ..Self::new(name, level, input, variance_m2)
        }
    }

    /// All columns as CSV, a row for each source.
    pub fn csv(sources: &[Self]) -> String {
        let text = |word: &Option<String>| word.as_deref().map_or_else(String::new, word_field);
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let row = |each: &Self| {
            [
                word_field(&each.source),
                each.distribution.clone(),
                each.evaluation.name().to_owned(),
                each.level.name().to_owned(),
                number(each.standard_uncertainty),
                text(&each.unit),
                number(each.sensitivity),
                text(&each.sensitivity_unit),
                each.contribution_um.to_string(),
                each.variance_share_percent.to_string(),
                (each.degrees_of_freedom).map_or_else(|| "inf".to_owned(), |each| each.to_string()),
            ]
            .join(",")
        };
        let rows: String = sources.iter().map(|each| row(each) + "\n").collect();
        format!("{COLUMNS}\n{rows}")
    }
}

/// What the errors of each source leave at the test poses (m^2), in the order of the belief.
pub(super) struct Squares {
    /// The instrument's noise, with u(x) where one number says it.
    pub noise: (Option<Input>, f64),
    /// What is known before without a source of its own, where there is such.
    pub before: Option<f64>,
    /// Errors of readings, with the level at which they count.
    pub readings: Vec<(SourceLevel, f64)>,
    /// Groups of parameters.
    pub parameters: Vec<f64>,
}

impl Squares {
    /// The budget of all, with the radius (m) that holds 95 % of errors.
    pub fn budget(self, belief: &Belief, radius95_m: Option<f64>) -> UncertaintyBudget {
        let (input, noise) = self.noise;
        let mut sources = vec![BudgetSource {
            distribution: belief.instrument.distribution.name().to_owned(),
            ..BudgetSource::new(NOISE, SourceLevel::Reading, input, noise)
        }];
        sources.extend(self.before.map(|square| {
            let of = |name| BudgetSource::new(name, SourceLevel::Robot, None, square);
            if belief.prior.is_none() {
                return of(BEFORE);
            }
            let campaign = belief.prior_campaign.as_ref();
            BudgetSource {
                evaluation: Evaluation::A,
                degrees_of_freedom: campaign.and_then(|each| each.degrees_of_freedom),
                remark: kept(belief),
                ..of(EARLIER)
            }
        }));
        let extended = &belief.uncertain;
        let readings = extended.sources().zip(self.readings);
        sources.extend(readings.map(|((name, source), square)| {
            BudgetSource::of_readings(name, source, extended, square)
        }));
        let parameters = extended.shared().iter().zip(self.parameters);
        sources.extend(parameters.map(|((name, places), square)| {
            BudgetSource::of_parameters(name, extended, places, square)
        }));
        UncertaintyBudget::new(sources, radius95_m)
    }
}

/// To twelve digits: 0.3 and not 0.29999999999999993.
fn rounded(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// The standard uncertainty that all parameters of a source have; those that are zero are not meant.
pub(crate) fn common(each: impl IntoIterator<Item = Input>) -> Option<Input> {
    let mut meant = (each.into_iter()).filter(|(value, _)| *value != 0.0);
    let first = meant.next().filter(|(value, _)| value.is_finite())?;
    let is_first =
        |(value, unit): Input| (value - first.0).abs() <= EQUAL * first.0 && unit == first.1;
    meant.all(is_first).then_some(first)
}

/// The error sources whose values are the same as in the earlier campaign, in words.
fn kept(belief: &Belief) -> Option<String> {
    let kept = belief.uncertain.kept().iter();
    let names: Vec<&str> = kept.map(|(name, _)| name.as_str()).collect();
    let others = other_sizes(belief);
    let others = if others.is_empty() {
        String::new()
    } else {
        let others = others.join(", ");
        format!(
            ", and what the earlier one had of it counts, not the size that is listed here ({others})"
        )
    };
    (!names.is_empty()).then(|| {
        let names = names.join(", ");
        format!("includes {names}: one value in both campaigns{others}")
    })
}

/// The first parameter of each error source that the earlier campaign listed with another standard deviation, in words.
fn other_sizes(belief: &Belief) -> Vec<String> {
    let Some(campaign) = &belief.prior_campaign else {
        return Vec::new();
    };
    let parameters = belief.uncertain.set().parameters();
    let other = |&place: &usize| {
        let parameter = &parameters[place];
        let found = campaign
            .names
            .iter()
            .position(|name| *name == parameter.name)?;
        let (there, here) = (campaign.listed[found]?, parameter.prior_deviation?);
        let (factor, unit) = shown_unit(parameter.unit());
        let [there, here] = [there, here].map(|value| significant(value * factor, 3));
        let unit = if unit == "1" {
            String::new()
        } else {
            format!(" {unit}")
        };
        (there != here)
            .then(|| format!("{}: {there}{unit} there, {here}{unit} here", parameter.name))
    };
    let kept = belief.uncertain.kept().iter();
    kept.filter_map(|(_, places)| places.iter().find_map(other))
        .collect()
}

/// What a source of such parameters does not move.
fn remark(extended: &Extended, kind: ParameterKind) -> Option<&'static str> {
    let is_of_tool = matches!(
        kind,
        ParameterKind::ToolPosition { .. } | ParameterKind::ToolRotation { .. }
    );
    let is_of_the_only_tool = is_of_tool && extended.machining_tool() == 0;
    let is_turned_over = kind.is_turned_over(extended.arm());
    let mut all = extended.set().parameters().iter();
    if is_turned_over && all.any(|each| each.kind.turns_over_others()) {
        return Some(
            "to first order at the nominal torque: where springs and masses that are uncertain turn it over does not count",
        );
    }
    kind.remark().filter(|_| !is_of_the_only_tool)
}

impl UncertaintyBudget {
    /// Of all sources, with the radius (m) that holds 95 % of errors.
    fn new(mut sources: Vec<BudgetSource>, radius95_m: Option<f64>) -> Self {
        let square = |source: &BudgetSource| source.contribution_um.powi(2);
        let variance_um2: f64 = sources.iter().map(square).sum();
        for source in &mut sources {
            source.variance_share_percent = 100.0 * square(source) / variance_um2;
        }
        let combined = variance_um2.sqrt();
        let expanded = radius95_m.map(|radius_m| radius_m * 1e6);
        Self {
            combined_standard_uncertainty_um: combined,
            expanded_uncertainty_um: expanded,
            coverage_factor: (expanded.map(|expanded| expanded / combined))
                .filter(|factor| factor.is_finite()),
            sources,
        }
    }

    /// Whether there is more than the instrument's noise.
    pub const fn has_more_than_noise(&self) -> bool {
        self.sources.len() > 1
    }
}
