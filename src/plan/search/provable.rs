//! The error sources that a proof of a bound takes into account, and those that it assumes exact, which can only lower
//! the bound.

use nalgebra::DVector;

use crate::experiment::Loads;
use crate::parameter::{ParameterKind, Prior, ReadingSource, Source, Uncertainty, Unloaded};
use crate::plan::Criterion;
use crate::plan::proof::{NoProof, Question, ReadingSpread};
use crate::robot::Joint;
use crate::task::{Extended, Task};

use super::problem::Problem;

/// What a proof takes each deflection to have of its own is called.
const UNLOADED: &str = "shared unloaded reading";

/// A task of which bounds can be proved, and of which no plan leaves more than of the task that it was made of.
pub(super) struct ProvableTask {
    pub task: Task,
    /// The names of what is assumed exact there.
    pub left_out: Vec<String>,
}

impl ProvableTask {
    /// Why nothing is proved about such a problem, whatever is assumed exact: bounds by other criteria, arms of
    /// which more than hinges bends, and what would make a proved bound far weaker than that of searches.
    pub fn refused(problem: &Problem<'_>) -> Option<NoProof> {
        let chain = &problem.task.belief.nominal.chain;
        let is_hinge = |joint: &Joint| !joint.drive.slides && joint.drive.passive_at.is_none();
        if problem.criterion != Criterion::TestPose {
            Some(NoProof::Criterion)
        } else if !problem.task.design.mandatory.experiments.is_empty() {
            Some(NoProof::Mandatory)
        } else if chain.elements.has_springs()
            || !chain.joints.iter().all(is_hinge)
            || problem.task.belief.instrument.rotation_sigma_rad.is_some()
            || problem.task.region.joint_torque_max_nm.is_some()
        {
            Some(NoProof::Springs)
        } else if (problem.task.test_poses.iter()).any(|pose| pose.load_axes.is_some()) {
            Some(NoProof::TurningLoad)
        } else if problem.task.belief.instrument.gauge.is_some() {
            Some(NoProof::Gauge)
        } else {
            None
        }
    }

    /// Whether a problem is about such a task itself.
    pub fn is_itself(problem: &Problem<'_>) -> bool {
        problem
            .extended
            .is_none_or(|extended| is_provable(problem.task, extended))
    }

    /// Why none of a problem can be proved as it is.
    pub fn refusal(problem: &Problem<'_>) -> NoProof {
        match problem.extended {
            Some(extended) if !is_alike(extended) => NoProof::RestsElsewhere,
            _ => NoProof::Uncertain,
        }
    }

    /// Those of a problem in which more is uncertain, the nearest first. Compliances that are uncertain stay, identified or
    /// not, with what is known of them, and so does, in the first, what the covariance of readings can be told of.
    pub fn simpler(problem: &Problem<'_>) -> Vec<Self> {
        let task = problem.task;
        let Some(extended) = problem.extended.filter(|extended| is_alike(extended)) else {
            return Vec::new();
        };
        let mut parameters = parameters_left_out(extended);
        if extended.unloaded() == Unloaded::Shared {
            parameters.push(UNLOADED.to_owned());
        }
        let Some(certain) = about_compliances(task, extended) else {
            return Vec::new();
        };
        let weighted = with_readings(&certain, extended)
            .filter(|_| !is_provable(task, extended))
            .map(|(task, left)| Self {
                task,
                left_out: parameters.iter().cloned().chain(left).collect(),
            });
        let sources = extended.sources().map(|(name, _)| name.to_owned());
        let certain = Self {
            task: certain,
            left_out: parameters.iter().cloned().chain(sources).collect(),
        };
        weighted.into_iter().chain([certain]).collect()
    }
}

/// A task with what is new in each reading as far as the covariance can be told, and the names of what cannot; `None` where
/// there is no such thing.
fn with_readings(certain: &Task, extended: &Extended) -> Option<(Task, Vec<String>)> {
    let (kept, left): (Vec<_>, Vec<_>) =
        (extended.sources()).partition(|(_, source)| is_known(certain, source));
    if kept.is_empty() {
        return None;
    }
    let uncertainty = |(name, source): (&str, &ReadingSource)| Uncertainty {
        name: name.to_owned(),
        is_hidden: false,
        is_replaced: false,
        distribution: extended.distribution(name),
        source: Source::Reading(source.clone()),
    };
    let kept: Vec<Uncertainty> = kept.into_iter().map(uncertainty).collect();
    let mut task = certain.clone();
    let belief = &mut task.belief;
    let prior = belief.prior.as_ref();
    let extended = Extended::new(belief.arm(), &belief.parameters, &[], prior, None, &kept).ok()?;
    belief.uncertain = extended;
    let left = left.into_iter().map(|(name, _)| name.to_owned());
    Some((task, left.collect()))
}

/// Whether the covariance of readings can be told with a source, over boxes of configurations: under each of some loads.
fn is_known(task: &Task, source: &ReadingSource) -> bool {
    !matches!(task.loads, Loads::Any { .. })
        && match source {
            ReadingSource::JointRepeatability(_)
            | ReadingSource::LoadDirection(_)
            | ReadingSource::LoadPoint(_)
            | ReadingSource::Discrepancy(_) => true,
            // Noise that depends on where the instrument stands has not the symmetries that the proof rests on.
            ReadingSource::Range(_)
            | ReadingSource::TransmissionError(_)
            | ReadingSource::GaugeDirection(_) => false,
        }
}

/// Whether what compensation leaves is told of the compliances just as where nothing else is uncertain: without what makes it
/// depend on where the arm rests.
fn is_alike(extended: &Extended) -> bool {
    let mut all = extended.set().parameters().iter();
    !all.any(|each| each.kind.is_turned_over(extended.arm()))
}

/// Whether nothing has to be left out.
fn is_provable(task: &Task, extended: &Extended) -> bool {
    is_alike(extended)
        && extended.unloaded() == Unloaded::Own
        && extended.further().next().is_none()
        // What a source knows of compliances is not in the belief's own prior, of which a proof knows.
        && extended.shared().is_empty()
        && extended.kept().is_empty()
        && extended.sources().all(|(_, source)| is_known(task, source))
}

/// By how much of itself the covariance that the load makes is taken for less, so that it holds for loads that are printed
/// alike, too.
const PRINTED_SHARE: f64 = 1e-5;

/// What is new in each reading of a task of which all is provable, for a question without it; loads may be off by so much
/// (N, N m) through printing. With G the columns of a load W, those of W + w have
/// (G + g) (G + g)^T >= (1 - s) G G^T - g g^T / s for every share s, and g g^T <= |g|^2 I.
///
/// `None` where the loads' own share is more than what is left of the instrument's.
pub(super) fn spread(
    question: &Question,
    compliance_rad_per_nm: &[f64],
    extended: &Extended,
    sigma_m: f64,
    printed: f64,
) -> Option<ReadingSpread> {
    // A covariance that is a little too small only makes the bound weaker.
    let down = 1.0 - 4.0 * f64::EPSILON;
    let over = |deviation: f64| deviation / sigma_m * down;
    let joints = compliance_rad_per_nm.len();
    let mut squares = vec![0.0; joints];
    let (mut everywhere, mut turned, mut shifted) = (1.0, 0.0_f64, 0.0_f64);
    for (_, source) in extended.sources() {
        match source {
            ReadingSource::JointRepeatability(deviations) => {
                for (square, deviation) in squares.iter_mut().zip(deviations) {
                    *square += over(*deviation).powi(2);
                }
            }
            ReadingSource::LoadDirection(deviation) => turned = turned.hypot(over(*deviation)),
            ReadingSource::LoadPoint(deviation) => shifted = shifted.hypot(over(*deviation)),
            ReadingSource::Discrepancy(error) => {
                everywhere += over(error.in_deflection_m()).powi(2);
            }
            ReadingSource::Range(_)
            | ReadingSource::TransmissionError(_)
            | ReadingSource::GaugeDirection(_) => {}
        }
    }
    let reaches = question.reaches_m();
    let product = |share: &dyn Fn(f64) -> f64| -> f64 {
        let terms = compliance_rad_per_nm.iter().zip(&reaches);
        terms.map(|(k, reach)| k * reach * share(*reach)).sum()
    };
    // |g| of a unit load: of each of three turns and shifts.
    let unit = 3.0
        * ((turned * product(&|reach| reach + 1.0)).powi(2)
            + (shifted * product(&|_| 1.0)).powi(2));
    everywhere -= unit * printed * printed / PRINTED_SHARE * (1.0 + 1e-9);
    let smaller = (1.0 - PRINTED_SHARE).sqrt() * down * down;
    (everywhere >= 0.5).then(|| ReadingSpread {
        everywhere: everywhere * down * down,
        joint_repeatability: squares
            .into_iter()
            .map(|square: f64| square.sqrt() * down * down)
            .collect(),
        compliance_rad_per_nm: compliance_rad_per_nm.to_vec(),
        turned: turned * smaller,
        shifted: shifted * smaller,
    })
}

fn compliance_of(kind: ParameterKind) -> Option<usize> {
    match kind {
        ParameterKind::JointCompliance { joint } => Some(joint),
        _ => None,
    }
}

fn parameters_left_out(extended: &Extended) -> Vec<String> {
    let parameters = extended.set().parameters();
    let is_kept = |place: &usize| compliance_of(parameters[*place].kind).is_some();
    let further = (extended
        .further()
        .map(str::to_owned)
        .zip(extended.identified()..))
    .filter(|(_, place)| !is_kept(place))
    .map(|(name, _)| name);
    let shared = (extended.shared().iter().chain(extended.kept()))
        .filter(|(_, places)| !places.iter().all(is_kept))
        .map(|(name, _)| name.clone());
    further.chain(shared).collect()
}

/// With all other unknowns at their means, what is known of the compliances is their block of the precision.
fn about_compliances(task: &Task, extended: &Extended) -> Option<Task> {
    let set = extended.set();
    let mut kept: Vec<(usize, usize)> = (set.parameters().iter().enumerate())
        .filter_map(|(place, parameter)| Some((compliance_of(parameter.kind)?, place)))
        .collect();
    kept.sort_unstable();
    let places: Vec<usize> = kept.iter().map(|&(_, place)| place).collect();
    let joints: Vec<usize> = kept.iter().map(|&(joint, _)| joint).collect();
    let nominal = &task.belief.nominal.compliance_rad_per_nm;
    let mut precision = (set.prior().precision.select_rows(&places)).select_columns(&places);
    for (index, (&place, &joint)) in places.iter().zip(&joints).enumerate() {
        if set.parameters()[place].is_logarithmic {
            // d ln k = dk / k
            precision.row_mut(index).scale_mut(nominal[joint].recip());
            precision
                .column_mut(index)
                .scale_mut(nominal[joint].recip());
        }
    }
    let mean = DVector::from_iterator(joints.len(), joints.iter().map(|&joint| nominal[joint]));
    let prior = (precision.amax() > 0.0).then(|| Prior::new(mean, precision));
    let mut certain = task.clone();
    certain.belief = task.belief.of_compliances(joints, prior).ok()?;
    // In plans that hang one load in each configuration repeats then tell no less.
    certain.belief.instrument.unloaded = Unloaded::Own;
    Some(certain)
}
