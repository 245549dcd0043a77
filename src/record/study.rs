//! The records of a Monte Carlo study, with the unit of every number in its key.

use serde::Serialize;
use strum::VariantArray;

use crate::csv::word_field;
use crate::study::Conditions;
use crate::study::account::{Account, Contribution};
use crate::study::summary::{Measured, ObservedQuantile, QUANTILES};
use crate::study::tally::{Failure, Tally};
use crate::study::verdict::{Kept, MonteCarloOutcome, STANDARD_ERRORS, numerical_tolerance};
use crate::task::AccuracyKind;
use crate::text::wording::{in_um, joined, significant};

/// What many runs of one plan say. Numbers that do not exist are `null`.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct StudyPlanMessage {
    /// The plan's name.
    pub name: String,
    /// The number M of measurements in each run.
    pub experiments: u32,
    /// The standard deviation of each coordinate of a deflection, or of an absolute reading (mm).
    pub sigma_mm: f64,
    /// How many times the loads are those of the scenario and the plan.
    pub load_scale: f64,
    /// Runs that did not fail.
    pub runs: u64,
    /// Runs that failed.
    pub failed: u64,
    /// Why they failed and how many.
    pub failures: Vec<(String, u64)>,
    /// The mean distance that compensation leaves (mm).
    pub mean_mm: Option<f64>,
    /// The standard error of the mean (mm).
    pub mean_std_mm: Option<f64>,
    /// The 95 % interval of the mean (mm).
    pub mean_ci95_mm: Option<[f64; 2]>,
    /// The rms distance (mm).
    pub rms_mm: Option<f64>,
    /// The standard error of the rms distance (mm).
    pub rms_std_mm: Option<f64>,
    /// The rms distance that eq. 20 predicts (mm).
    pub predicted_rms_mm: Option<f64>,
    /// What the belief predicts for the rms (mm), where the scenario lists uncertainties.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub combined_rms_mm: Option<f64>,
    /// The distance that the belief predicts 95 % of the runs to stay below (mm); nothing where every run has a plan of its
    /// own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_quantile95_mm: Option<f64>,
    /// The contributions to the errors of the simulated truth, to first order; their squares add up to the square of what is to be
    /// expected.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contributions: Vec<Contribution>,
    /// Whether the prediction holds, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verdict: Option<String>,
    /// The comparison of the predicted expanded uncertainty with that of the runs (JCGM 101, clause 8).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation: Option<ValidationMessage>,
    /// The distances that 5, 50, 95 and 99 % of the runs do not exceed (mm).
    pub quantiles_mm: Option<[f64; 4]>,
    /// How often which distances were left.
    pub histogram: HistogramMessage,
    /// Observed minus predicted mean square in the standard deviations that are predicted for it.
    pub z: Option<f64>,
    /// The mean of the normalised estimation error squared.
    pub nees: Option<f64>,
    /// What is expected for it: the number of compliances, or of their combinations, that are determined
    /// (the mean, rounded, where it differs from run to run).
    pub nees_expected: usize,
    /// Its deviation in standard deviations.
    pub nees_z: Option<f64>,
    /// The share of the 95 % intervals of compliances that hold the true one; there is none by the linear model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage95: Option<f64>,
    /// The mean distance over that of the first random plan.
    pub mean_ratio_to_random: Option<f64>,
    /// The 95 % interval of that ratio.
    pub mean_ratio_to_random_ci95: Option<[f64; 2]>,
}

/// A predicted expanded uncertainty U beside that of a Monte Carlo study (JCGM 101, clause 8).
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ValidationMessage {
    /// The predicted radius that holds 95 % (um).
    pub predicted_um: f64,
    /// That of the runs (um).
    pub monte_carlo_um: f64,
    /// Its 95 % interval (um); so few runs that all of them may well be below have no upper end.
    pub monte_carlo_ci95_um: (f64, Option<f64>),
    /// The numerical tolerance of the predicted standard uncertainty with two significant digits (um).
    pub numerical_tolerance_um: f64,
    /// `validated`, `not validated`, or `undecided` by so few runs.
    #[schemars(with = "String")]
    pub outcome: MonteCarloOutcome,
}

impl ValidationMessage {
    /// That of a predicted U (m) with its standard uncertainty (m).
    fn new(
        predicted_m: f64,
        standard_m: f64,
        observed_m: ObservedQuantile,
        failed_share: f64,
    ) -> Self {
        let tolerance_m = numerical_tolerance(standard_m);
        let outcome = MonteCarloOutcome::of(predicted_m, observed_m, tolerance_m, failed_share);
        let observed_um = observed_m.times(1e6);
        Self {
            predicted_um: predicted_m * 1e6,
            monte_carlo_um: observed_um.value,
            monte_carlo_ci95_um: (observed_um.lower, observed_um.upper),
            numerical_tolerance_um: tolerance_m * 1e6,
            outcome,
        }
    }
}

impl std::fmt::Display for ValidationMessage {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let um = |value: f64| in_um(value * 1e-6, 3);
        let (lower, upper) = self.monte_carlo_ci95_um;
        let interval = upper.map_or_else(
            || format!("from {} up", um(lower)),
            |upper| format!("{} to {}", um(lower), um(upper)),
        );
        write!(
            formatter,
            "U = {} um (95 %) predicted, {} um by Monte Carlo ({interval}), numerical tolerance {} um: {}",
            um(self.predicted_um),
            um(self.monte_carlo_um),
            significant(self.numerical_tolerance_um, 1),
            self.outcome
        )
    }
}

/// A histogram of distances; bins grow with the distance, 8 an octave.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct HistogramMessage {
    /// The edges of the bins (mm), one more than there are bins.
    pub edges_mm: Vec<f64>,
    /// The number of runs in each bin.
    pub counts: Vec<u64>,
}

impl HistogramMessage {
    /// Low and high end (mm) of bins as wide as so few runs need, and the share of the runs in each; by Scott's rule on the logarithm,
    /// `3.49 s n^(-1/3)`.
    pub fn bins(&self) -> Vec<[f64; 3]> {
        let bins = self.counts.len();
        let runs = self.counts.iter().sum::<u64>() as f64;
        let place = |index: usize| self.edges_mm[index].log10();
        let middle = |index: usize| f64::midpoint(place(index), place(index + 1));
        let moment = |of: &dyn Fn(f64) -> f64| {
            let counts = self.counts.iter().enumerate();
            counts
                .map(|(index, count)| *count as f64 * of(middle(index)))
                .sum::<f64>()
                / runs
        };
        let mean = moment(&|value| value);
        let deviation = moment(&|value| (value - mean).powi(2)).sqrt();
        let fewest =
            |width: f64| (1..=bins).find(|&parts| place(bins) - place(0) <= width * parts as f64);
        let parts = fewest(3.49 * deviation / runs.cbrt()).unwrap_or(bins);
        let ends = (0..=parts)
            .map(|part| part * bins / parts.max(1))
            .collect::<Vec<_>>();
        let bin = |pair: &[usize]| {
            let count: u64 = self.counts[pair[0]..pair[1]].iter().sum();
            [
                self.edges_mm[pair[0]],
                self.edges_mm[pair[1]],
                count as f64 / runs,
            ]
        };
        ends.windows(2).map(bin).collect()
    }
}

impl StudyPlanMessage {
    /// The record of a plan's tally, whose distances are in units of the conditions' sigma, beside that of the plan that it is compared
    /// with.
    pub fn new(
        name: &str,
        (conditions, accuracy): (&Conditions, AccuracyKind),
        parameters: usize,
        (tally, reference): (&Tally, Option<&Tally>),
        (account, predicted_quantile95_m): (Option<&Account>, Option<f64>),
    ) -> Self {
        let reference = reference.filter(|&other| !std::ptr::eq(other, tally));
        let sigma_m = conditions.sigma_m;
        let runs = Some(tally).filter(|tally| tally.runs > 0);
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        let of = |value: fn(&Tally) -> f64| finite(runs.map(value));
        let measured_m = |value: fn(&Tally) -> Measured| Some(value(runs?).times(sigma_m));
        let (mean_m, rms_m) = (measured_m(Tally::mean), measured_m(Tally::rms));
        let ratio = runs
            .zip(reference)
            .and_then(|(tally, other)| tally.ratio_to(other));
        let (edges, counts) = tally.histogram();
        let failed_share = tally.failed_share();
        Self {
            name: name.to_owned(),
            experiments: conditions.experiments,
            // 0.03 and not 0.030000000000000002.
            sigma_mm: conditions.sigma_mm(accuracy),
            load_scale: conditions.load_scale,
            runs: tally.runs,
            failed: tally.failures(),
            failures: reasons(tally),
            mean_mm: finite(mean_m.map(|each| each.value * 1e3)),
            mean_std_mm: finite(mean_m.map(|each| each.standard_error * 1e3)),
            // A distance is not negative.
            mean_ci95_mm: mean_m.map(|each| each.interval95().map(|value| value.max(0.0) * 1e3)),
            rms_mm: finite(rms_m.map(|each| each.value * 1e3)),
            rms_std_mm: finite(rms_m.map(|each| each.standard_error * 1e3)),
            predicted_rms_mm: of(Tally::predicted_rms).map(|each| each * sigma_m * 1e3),
            combined_rms_mm: account.map(|account| account.predicted_m * 1e3),
            predicted_quantile95_mm: predicted_quantile95_m.map(|value| value * 1e3),
            contributions: account.map_or_else(Vec::new, |account| account.parts.clone()),
            verdict: (account.zip(rms_m))
                .map(|(account, rms_m)| account.verdict(rms_m, tally.runs, failed_share)),
            validation: (predicted_quantile95_m.zip(tally.radius95())).map(
                |(predicted_m, radius95)| {
                    let standard_m = account.map_or_else(
                        || tally.predicted_rms() * sigma_m,
                        |account| account.predicted_m,
                    );
                    ValidationMessage::new(
                        predicted_m,
                        standard_m,
                        radius95.times(sigma_m),
                        failed_share,
                    )
                },
            ),
            quantiles_mm: runs.map(|tally| {
                let quantile = |share| tally.quantile(share).unwrap_or(f64::NAN);
                QUANTILES.map(|share| quantile(share) * sigma_m * 1e3)
            }),
            histogram: HistogramMessage {
                edges_mm: (edges.iter()).map(|edge| edge * sigma_m * 1e3).collect(),
                counts,
            },
            z: of(Tally::z),
            nees: of(Tally::nees),
            nees_expected: expected(tally).unwrap_or(parameters),
            nees_z: of(Tally::nees_z),
            coverage95: tally.coverage(),
            mean_ratio_to_random: ratio.map(|ratio| ratio.value),
            mean_ratio_to_random_ci95: ratio.map(|ratio| ratio.interval95()),
        }
    }

    /// The same with the verdict on a prediction of the instrument's noise alone, where it is exceeded. A few runs' own scatter
    /// does not tell that.
    pub fn judged_by_noise(mut self, failed_share: f64) -> Self {
        let numbers = (self.rms_mm.zip(self.rms_std_mm)).zip(self.predicted_rms_mm.zip(self.z));
        if let Some(((value, standard_error), (predicted_mm, z))) = numbers {
            let observed_mm = Measured {
                value,
                standard_error,
            };
            let kept = Kept::of(predicted_mm, observed_mm, self.runs, failed_share);
            self.verdict = (kept == Kept::Exceeded && z > STANDARD_ERRORS).then(|| {
                format!(
                    "exceeded: {:.3} times what is predicted of noise alone; the simulated truth is another robot, or \
                     deflections are not linear enough",
                    value / predicted_mm
                )
            });
        }
        self
    }

    /// Whether more is left than the instrument's noise alone explains, and nothing else is listed as uncertain.
    pub const fn is_beyond_noise(&self) -> bool {
        self.combined_rms_mm.is_none() && self.verdict.is_some()
    }

    /// What was predicted of the runs and what became of it, in words; where nothing is listed as uncertain, if it is exceeded.
    pub fn outcome(&self) -> Option<String> {
        let predicted_mm = self.combined_rms_mm.or(self.predicted_rms_mm)?;
        let (predicted_um, verdict) = (in_um(predicted_mm * 1e-3, 3), self.verdict.as_ref()?);
        Some(format!(
            "predicted {predicted_um} um; the prediction {verdict}"
        ))
    }
}

/// The mean number of determined combinations, rounded.
fn expected(tally: &Tally) -> Option<usize> {
    let twice = tally.freedom.saturating_mul(2).saturating_add(tally.runs);
    usize::try_from(twice.checked_div(2 * tally.runs)?).ok()
}

/// A CSV table with one row for each plan.
pub fn study_csv(plans: &[StudyPlanMessage]) -> String {
    let mut text = String::from(
        "plan,experiments,sigma_mm,load_scale,runs,failed,mean_mm,mean_low95_mm,mean_high95_mm,rms_mm,predicted_rms_mm,\
         q05_mm,q50_mm,q95_mm,q99_mm,z,nees,nees_z,mean_ratio_to_random\n",
    );
    for plan in plans {
        let one = |value: Option<f64>| vec![value];
        let numbers = [
            one(plan.mean_mm),
            split(plan.mean_ci95_mm),
            one(plan.rms_mm),
            one(plan.predicted_rms_mm),
            split(plan.quantiles_mm),
            one(plan.z),
            one(plan.nees),
            one(plan.nees_z),
            one(plan.mean_ratio_to_random),
        ];
        let numbers = numbers.concat().into_iter().map(|each| joined(each, ""));
        text += &format!(
            "{},{},{},{},{},{},{}\n",
            word_field(&plan.name),
            plan.experiments,
            plan.sigma_mm,
            plan.load_scale,
            plan.runs,
            plan.failed,
            joined(numbers, ",")
        );
    }
    text
}

fn split<const N: usize>(values: Option<[f64; N]>) -> Vec<Option<f64>> {
    values.map_or([None; N], |values| values.map(Some)).to_vec()
}

fn reasons(tally: &Tally) -> Vec<(String, u64)> {
    (Failure::VARIANTS.iter())
        .zip(tally.failed)
        .filter(|(_, count)| *count > 0)
        .map(|(reason, count)| (reason.text().to_owned(), count))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every bin of three octaves has so many runs, or every third one.
    fn histogram(each: u64, step: usize) -> HistogramMessage {
        let count = |bin| if bin % step == 0 { each } else { 0 };
        HistogramMessage {
            edges_mm: (0..=24)
                .map(|edge| 2.0_f64.powf(f64::from(edge) / 8.0))
                .collect(),
            counts: (0..24).map(count).collect(),
        }
    }

    #[test]
    fn bins_are_as_wide_as_the_number_of_runs_needs() {
        let [few, many] = [histogram(1, 3), histogram(100_000, 1)].map(|each| each.bins());
        assert!(
            (2..=4).contains(&few.len()) && few.iter().all(|bin| bin[2] > 0.1),
            "{few:?}"
        );
        assert_eq!(many.len(), 24);
        for bins in [few, many] {
            let all: f64 = bins.iter().map(|bin| bin[2]).sum();
            assert!((all - 1.0).abs() < 1e-12);
            let reach = bins[bins.len() - 1][1] / bins[0][0];
            assert!((reach - 8.0).abs() < 1e-12);
        }
        let none = HistogramMessage {
            edges_mm: Vec::new(),
            counts: Vec::new(),
        };
        assert!(none.bins().is_empty());
    }
}
