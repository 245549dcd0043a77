//! Selections of readings and their residual errors, as a record.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::identification::DistanceStatistics;
use crate::study::selection::{Chosen, Selection, SelectionOfSize, spread_of};

/// What a twentieth of values stay below, their median, and what a twentieth are above.
pub type SpreadMessage = [f64; 3];

/// What came of choices of readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelectionMessage {
    /// How many readings there are.
    pub readings: usize,
    /// The names of what is fitted.
    pub unknowns: Vec<String>,
    /// Of how many of them something is known before.
    pub known_before: usize,
    /// What was left out since no reading can tell it from others.
    pub left_out: Vec<String>,
    /// The joints whose errors are functions of their own angles in the planner's model, and so in every fit.
    pub joint_errors: Vec<JointFunctionMessage>,
    /// What no unknown explains, of each coordinate (mm); null where the readings' own deviations explain all.
    pub discrepancy_mm: Option<f64>,
    /// What a fit of all readings leaves of them (mm).
    pub all_mm: DistanceStatistics,
    /// By size.
    pub sizes: Vec<SelectionSizeMessage>,
}

/// A joint error function, as the planner's model has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFunctionMessage {
    /// The joint's name.
    pub joint: String,
    /// The standard deviation (mrad).
    pub std_mrad: f64,
    /// The correlation length (deg).
    pub correlation_deg: f64,
}

/// What came of choices of one size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SelectionSizeMessage {
    /// How many readings were chosen.
    pub size: u32,
    /// Planned choices, by criterion.
    pub planned: Vec<PlannedChoiceMessage>,
    /// Random choices.
    pub random: RandomChoicesMessage,
}

/// A planned choice.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PlannedChoiceMessage {
    /// The criterion; `test_pose` stands for absolute accuracy over all readings, `test_pose_with_joint_errors` for the same with joint error
    /// functions.
    pub criterion: String,
    /// The chosen readings, from 1.
    pub readings: Vec<usize>,
    /// What independent errors leave, rms over all readings (mm); with joint error functions, over all other readings.
    pub rho0_mm: Option<f64>,
    /// The predicted rms distance at all other readings (mm): the same with what is new at each.
    pub predicted_rms_mm: Option<f64>,
    /// What no choice of as many readings is below (mm), of the choice for absolute accuracy.
    pub lower_bound_rho0_mm: Option<f64>,
    /// Distances at all other readings (mm); null where there is no fit.
    pub distance_mm: Option<DistanceStatistics>,
    /// The rms distance from the robot that all readings are fitted to (mm).
    pub from_all_mm: Option<f64>,
    /// The share of random choices whose mean distance is larger.
    pub better_than_random: Option<f64>,
    /// The rms distance from the true robot without discrepancy, over all times that it was read (mm).
    pub without_discrepancy_from_true_mm: Option<f64>,
    /// Why there is no such choice.
    pub problem: Option<String>,
}

/// Random choices.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RandomChoicesMessage {
    /// How many.
    pub draws: usize,
    /// Of them without a fit.
    pub failed: usize,
    /// The spreads of numbers of one choice each (mm), by name as in [`SPREADS`].
    #[serde(flatten)]
    pub spreads: BTreeMap<&'static str, Option<SpreadMessage>>,
    /// The mean of each choice (mm), for the picture.
    pub means_mm: Vec<f64>,
}

/// A number of a choice (m).
type OfChoice = fn(&Chosen) -> Option<f64>;

/// What independent errors leave; the predicted rms distance at all other readings; of the distances at all other readings the mean,
/// the rms, what 95 % stay below, and the largest; the rms distance from the robot that all readings are fitted to; and the same
/// from the true robot without discrepancy, over all times that it was read.
pub const SPREADS: [(&str, OfChoice); 8] = [
    ("rho0_mm", |chosen| chosen.predicted_m),
    ("predicted_rms_mm", |chosen| chosen.predicted_distance_m),
    ("mean_mm", |chosen| Some(chosen.judged?.distance.mean)),
    ("rms_mm", |chosen| Some(chosen.judged?.distance.rms)),
    ("quantile95_mm", |chosen| {
        Some(chosen.judged?.distance.quantile95)
    }),
    ("largest_mm", |chosen| Some(chosen.judged?.distance.largest)),
    ("from_all_mm", |chosen| Some(chosen.judged?.from_all_m)),
    ("without_discrepancy_from_true_mm", without_discrepancy_m),
];

impl SelectionMessage {
    /// The record.
    pub fn new(selection: &Selection<'_>) -> Self {
        let all = &selection.parts.all;
        let set = &all.set;
        let left = DistanceStatistics::of(selection.parts.distances_m()).unwrap_or_default();
        let precision = &set.prior().precision;
        Self {
            readings: all.left.len(),
            unknowns: (set.parameters().iter())
                .map(|each| each.name.clone())
                .collect(),
            known_before: (0..set.len())
                .filter(|&index| precision[(index, index)] > 0.0)
                .count(),
            left_out: all.left_out.iter().map(|each| each.name.clone()).collect(),
            joint_errors: (selection.parts.functions().iter())
                .map(|each| JointFunctionMessage {
                    joint: all.arm.chain.joints[each.joint].name.clone(),
                    std_mrad: each.deviation_rad * 1e3,
                    correlation_deg: each.correlation_rad.to_degrees(),
                })
                .collect(),
            discrepancy_mm: selection.parts.discrepancy_m().map(|value| value * 1e3),
            all_mm: DistanceStatistics::in_thousandths(&left),
            sizes: (selection.sizes.iter())
                .map(SelectionSizeMessage::new)
                .collect(),
        }
    }
}

/// Over all times that the robot without discrepancy was read, rms.
fn without_discrepancy_m(chosen: &Chosen) -> Option<f64> {
    let squares: Vec<f64> = (chosen.without_discrepancy.iter())
        .map(|judged| judged.from_all_m.powi(2))
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

impl SelectionSizeMessage {
    fn new(of_size: &SelectionOfSize) -> Self {
        let random = RandomChoicesMessage::new(&of_size.random);
        let planned = (of_size.planned.iter())
            .map(|(criterion, chosen)| match chosen {
                Ok(chosen) => PlannedChoiceMessage::new(criterion, chosen, &random.means_mm),
                Err(problem) => PlannedChoiceMessage {
                    criterion: (*criterion).to_owned(),
                    problem: Some(problem.clone()),
                    ..PlannedChoiceMessage::default()
                },
            })
            .collect();
        Self {
            size: of_size.size,
            planned,
            random,
        }
    }
}

impl PlannedChoiceMessage {
    fn new(criterion: &str, chosen: &Chosen, means_mm: &[f64]) -> Self {
        let mean_mm = chosen.judged.map(|judged| judged.distance.mean * 1e3);
        let better = mean_mm.filter(|_| !means_mm.is_empty()).map(|mean_mm| {
            let worse = means_mm.iter().filter(|other| **other > mean_mm).count();
            worse as f64 / means_mm.len() as f64
        });
        let millimetres = |value: Option<f64>| value.map(|value| value * 1e3);
        Self {
            criterion: criterion.to_owned(),
            readings: chosen.readings.iter().map(|reading| reading + 1).collect(),
            rho0_mm: millimetres(chosen.predicted_m),
            predicted_rms_mm: millimetres(chosen.predicted_distance_m),
            lower_bound_rho0_mm: millimetres(chosen.bound_m),
            distance_mm: (chosen.judged).map(|judged| judged.distance.in_thousandths()),
            from_all_mm: millimetres(chosen.judged.map(|judged| judged.from_all_m)),
            better_than_random: better,
            without_discrepancy_from_true_mm: millimetres(without_discrepancy_m(chosen)),
            problem: (chosen.judged.is_none()).then(|| "there is no fit".to_owned()),
        }
    }
}

impl RandomChoicesMessage {
    fn new(random: &[Chosen]) -> Self {
        let millimetres = |of: OfChoice| -> Vec<f64> {
            let values = random.iter().filter_map(of);
            values.map(|value| value * 1e3).collect()
        };
        let [_, _, (_, mean), ..] = SPREADS;
        let means_mm = millimetres(mean);
        Self {
            draws: random.len(),
            failed: random.len() - means_mm.len(),
            spreads: (SPREADS.into_iter())
                .map(|(name, of)| (name, spread_of(millimetres(of))))
                .collect(),
            means_mm,
        }
    }
}
