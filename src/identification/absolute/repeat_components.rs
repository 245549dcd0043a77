//! Variance components of repeated visits by restricted maximum likelihood (REML): what is new at each reading and at each visit, by joint.
//!
//! Visits of one command pose that read the same targets differ by what is new at them. Orthonormal contrasts of n visits have no part of
//! what the pose has for itself, parameters, frames or discrepancy; n - 1 of them are independent, with the covariance
//!
//! ```text
//! S = s R + sum_j v_j J_j J_j^T
//! ```
//!
//! of the readings' own covariance R, the instrument's with what the planner's model lists as new in each reading, which may be s times as
//! large as stated (contrasts within visits have s R alone), and of the joints' returns v_j with the derivatives J_j by their angles. The
//! variances are the [likeliest](crate::numeric::likelihood) of all contrasts, their intervals those of its profile. With the expected
//! information I, the effective degrees of freedom of a variance are 2 v^2 (I / var v).

use std::collections::BTreeMap;
use std::iter;

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::Serialize;

use super::mixed::in_blocks;
use super::residuals::LinearReading;
use super::{AbsoluteCase, AbsoluteFit};
use crate::experiment::together;
use crate::numeric::factorisation::inverse_of;
use crate::numeric::likelihood::{Likeliest, Likelihood, LimitedLikelihood};
use crate::numeric::tolerance::pose_repeatability;
use crate::quantities::written::from_one;
use crate::robot::Joint;

/// What a variance is at least (m^2, rad^2) where it is looked for, and the share of a plain estimate that is nothing.
const LEAST: f64 = 1e-24;
const NOTHING: f64 = 1e-8;
/// So many numbers at least for each variance, else all joints have one.
const NUMBERS_PER_VARIANCE: f64 = 4.0;
/// A joint that moves what is read by less than this share of what another does is not shown: its axis goes through the target.
const SHOWN: f64 = 1e-3;
/// A variance that is known so many times worse beside the others than by itself is not told from them.
const INFLATED: f64 = 100.0;

/// A variance component of repeats: how joints return whose variances cannot be told apart, one alone where they can, or readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatComponent {
    /// Where it is new: `reading` or `visit`.
    pub level: &'static str,
    /// The joints; none of readings.
    #[serde(skip)]
    pub joints: Vec<usize>,
    /// Their names.
    #[serde(rename = "joints")]
    pub names: Vec<String>,
    /// The unit of the standard deviation: `mrad`, `mm`, both where slides and hinges share it, or 1 of what is stated for readings.
    pub unit: &'static str,
    /// The standard deviation.
    pub standard_uncertainty: f64,
    /// Its interval of 95 %.
    pub interval95: [f64; 2],
    /// The effective degrees of freedom of its square.
    pub degrees_of_freedom: f64,
}

/// The pose repeatability of a pose that was visited again.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseReturn {
    /// Its first row, from 0; from 1 in records.
    #[serde(serialize_with = "from_one")]
    pub first: usize,
    /// RP (mm) without the instrument's noise.
    pub rp_mm: f64,
}

/// What repeated visits say.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatComponents {
    /// That of readings, where a visit reads a target more than once, then those of visits.
    pub components: Vec<RepeatComponent>,
    /// The poses that were visited again.
    pub poses: Vec<PoseReturn>,
    /// What is not told apart, and what would tell it.
    pub not_separated: Vec<String>,
}

/// Contrasts of one covariance.
struct Contrasts {
    /// The sum of their squares (m x m), and their number.
    scatter: DMatrix<f64>,
    count: f64,
    /// The readings' own covariance, and derivatives by the joints' angles (m x k).
    own: DMatrix<f64>,
    joints: DMatrix<f64>,
}

/// The readings of one visit, those of a target averaged.
struct AveragedVisit {
    first: usize,
    /// Which stations and targets, under which loads.
    read: Vec<(usize, usize, [u64; 6])>,
    residual: DVector<f64>,
    own: DMatrix<f64>,
    joints: DMatrix<f64>,
}

impl AbsoluteCase<'_> {
    /// What the repeated visits of a fit's positions say, without those that were rejected; none where there are none.
    pub fn repeat_components(&self, fit: &AbsoluteFit) -> Option<RepeatComponents> {
        let kept = self.without(&fit.rejected).of_positions();
        let kept = kept.counting_reading_errors();
        let joints = kept.commanded_joints();
        let mean = &fit.posterior.mean;
        let rows = kept.rows_at(&kept.arm, &fit.set, mean, &joints).ok()?;
        let mut contrasts = Vec::new();
        let visits: Vec<AveragedVisit> = (kept.visits.iter())
            .map(|visit| averaged(&kept, &rows, visit, &mut contrasts))
            .collect();
        let setup = |visit: usize| &kept.observations[visits[visit].first].setup;
        let is_alike = |one: usize, other: usize| visits[one].read == visits[other].read;
        let groups = together(visits.len(), |visit| setup(visit).pose(), is_alike);
        let within = contrasts.len();
        let mut poses = Vec::new();
        for group in groups.iter().filter(|group| group.len() > 1) {
            let all: Vec<&AveragedVisit> = group.iter().map(|&visit| &visits[visit]).collect();
            poses.push((all[0].first, contrasts.len()));
            let parts: Vec<_> = all.iter().map(|each| (&each.residual, &each.own)).collect();
            contrasts.push(about_mean(&parts, all[0].joints.clone()).1);
        }
        if poses.is_empty() {
            return None;
        }
        let all = AllContrasts {
            contrasts,
            is_reading_estimated: within > 0,
        };
        let (classes, best) = all.components(joints.len())?;
        let errors = inverse_of(&Cholesky::new(all.information(&best))?);
        let likelihood = all.likelihood(&classes);
        // A deviation, which is nothing at its lower limit.
        let deviation = |place: usize, at: f64| {
            let nothing = likelihood.limits[0][place];
            if at > nothing { (0.5 * at).exp() } else { 0.0 }
        };
        let chain = &self.arm.chain.joints;
        let component = |level, joints: Vec<usize>, place: usize| {
            let interval95 = likelihood.interval95(&best, place)?;
            let (unit, factor) = unit_of(&joints, chain);
            let own = joints.iter().map(|&joint| chain[joint].name.clone());
            let std = deviation(place, best.at[place]);
            Some(RepeatComponent {
                level,
                names: own.collect(),
                joints,
                unit,
                standard_uncertainty: std * factor,
                interval95: interval95.map(|end| deviation(place, end) * factor),
                degrees_of_freedom: 2.0 * std.powi(4) / errors[(place, place)],
            })
        };
        let (mut components, mut not_separated) = (Vec::new(), Vec::new());
        if within > 0 {
            components.push(component("reading", Vec::new(), 0)?);
        } else {
            let words = "reading from visit: standard deviations of readings are taken as exact; two readings of a target in one visit \
                         would tell";
            not_separated.push(words.to_owned());
        }
        for (class, own) in classes.iter().enumerate() {
            let own = own.iter().map(|&joint| joints[joint]).collect();
            let found = component("visit", own, 1 + class)?;
            if found.names.len() > 1 {
                let names = found.names.join(", ");
                let told = "repeats at poses where they move the target otherwise, or more repeats, would tell";
                not_separated.push(format!("{names} from each other: {told}"));
            }
            components.push(found);
        }
        for (place, &joint) in joints.iter().enumerate() {
            if !classes.iter().any(|class| class.contains(&place)) {
                let told = "does not show: a target off its axis, or rotations, would tell";
                not_separated.push(format!("{} {told}", chain[joint].name));
            }
        }
        let rows = fit.kept();
        let pose = |(reading, place): (usize, usize)| {
            let moved = all.contrasts[place].joints.rows(0, 3);
            let mut covariance = DMatrix::zeros(3, 3);
            for (class, own) in classes.iter().enumerate() {
                for &joint in own {
                    let column = moved.column(joint);
                    let std = deviation(1 + class, best.at[1 + class]);
                    covariance += column * column.transpose() * (std * std);
                }
            }
            Some(PoseReturn {
                first: rows[reading],
                rp_mm: pose_repeatability(&covariance)? * 1e3,
            })
        };
        Some(RepeatComponents {
            components,
            poses: poses.into_iter().filter_map(pose).collect(),
            not_separated,
        })
    }
}

/// The unit of what joints have in common, or of readings, which are none, and how many of it make one of SI.
fn unit_of(joints: &[usize], chain: &[Joint]) -> (&'static str, f64) {
    let slides = joints.iter().filter(|&&joint| chain[joint].drive.slides);
    match (joints.len(), slides.count()) {
        (0, _) => ("1", 1.0),
        (_, 0) => ("mrad", 1e3),
        (all, slides) if slides == all => ("mm", 1e3),
        _ => ("mrad, mm", 1e3),
    }
}

/// A visit with the readings of each target averaged; what these differ by within it are contrasts of their own.
fn averaged(
    case: &AbsoluteCase<'_>,
    rows: &[LinearReading],
    visit: &[usize],
    contrasts: &mut Vec<Contrasts>,
) -> AveragedVisit {
    let mut targets: BTreeMap<(usize, usize, [u64; 6]), Vec<usize>> = BTreeMap::new();
    for &index in visit {
        let setup = &case.observations[index].setup;
        let target = targets.entry((setup.station, setup.target, setup.load.bits()));
        target.or_default().push(index);
    }
    let joints = rows[visit[0]].joints.ncols();
    let (mut residual, mut owns, mut moved) = (Vec::new(), Vec::new(), Vec::new());
    for own in targets.values() {
        let parts = (own.iter()).map(|&index| (&rows[index].residual, &rows[index].own));
        let within = DMatrix::zeros(rows[own[0]].residual.len(), joints);
        let (mean, of_target) = about_mean(&parts.collect::<Vec<_>>(), within);
        residual.extend_from_slice(mean.as_slice());
        owns.push(&of_target.own / own.len() as f64);
        moved.extend(rows[own[0]].joints.row_iter());
        contrasts.extend((own.len() > 1).then_some(of_target));
    }
    AveragedVisit {
        first: visit[0],
        read: targets.keys().copied().collect(),
        residual: DVector::from_vec(residual),
        own: in_blocks(&owns),
        joints: DMatrix::from_rows(&moved),
    }
}

/// The mean of residuals of one size, each with its own covariance, and what they are about it, which joints move like this.
fn about_mean(
    parts: &[(&DVector<f64>, &DMatrix<f64>)],
    joints: DMatrix<f64>,
) -> (DVector<f64>, Contrasts) {
    let (size, count) = (parts[0].0.len(), parts.len() as f64);
    let sum = (parts.iter()).fold(DVector::zeros(size), |sum, (residual, _)| sum + *residual);
    let mean = sum / count;
    let mut of = Contrasts {
        scatter: DMatrix::zeros(size, size),
        count: count - 1.0,
        own: DMatrix::zeros(size, size),
        joints,
    };
    for (residual, own) in parts {
        let off = *residual - &mean;
        of.scatter += &off * off.transpose();
        of.own += *own / count;
    }
    (mean, of)
}

/// All contrasts, and whether some within visits tell the variance of readings: else it is as stated.
struct AllContrasts {
    contrasts: Vec<Contrasts>,
    is_reading_estimated: bool,
}

impl AllContrasts {
    /// Which joints have a variance in common; the likeliest logarithms of that of the readings, then of those of these classes.
    fn components(&self, joints: usize) -> Option<(Vec<Vec<usize>>, Likeliest)> {
        let contrasts = self.contrasts.iter();
        let moved = |joint: usize| {
            let columns = contrasts.clone().map(|each| each.joints.column(joint));
            columns.map(|column| column.amax()).fold(0.0, f64::max)
        };
        let most = (0..joints).map(moved).fold(0.0, f64::max);
        let moving: Vec<usize> = (0..joints)
            .filter(|&joint| moved(joint) > SHOWN * most)
            .collect();
        let numbers = (contrasts.clone()).map(|each| each.count * each.own.nrows() as f64);
        let wanted = NUMBERS_PER_VARIANCE * (moving.len() + 1) as f64;
        let mut classes: Vec<Vec<usize>> = if numbers.sum::<f64>() < wanted {
            vec![moving]
        } else {
            moving.into_iter().map(|joint| vec![joint]).collect()
        };
        loop {
            let best = self.likelihood(&classes).likeliest(self.start(&classes))?;
            let information = self.information(&best);
            let inverse = Cholesky::new(information.clone()).map(|factor| inverse_of(&factor));
            let is_inflated = |place: &usize| {
                let own = information[(*place, *place)];
                let inverse = inverse.as_ref();
                inverse.is_none_or(|inverse| inverse[(*place, *place)] * own > INFLATED)
            };
            let alike = |&(one, other): &(usize, usize)| {
                let size = information[(one, one)] * information[(other, other)];
                information[(one, other)] / size.sqrt()
            };
            let all = 1..best.at.len();
            // The two that are told apart worst become one.
            let pairs = (all.clone().filter(is_inflated))
                .flat_map(|one| all.clone().map(move |other| (one, other)))
                .filter(|(one, other)| one != other);
            let worst = pairs.max_by(|one, other| alike(one).total_cmp(&alike(other)));
            let Some((one, other)) = worst else {
                return Some((classes, best));
            };
            let joined = classes.remove(one.max(other) - 1);
            let class = &mut classes[one.min(other) - 1];
            class.extend(joined);
            class.sort_unstable();
        }
    }

    /// The information of variances, not of logarithms: of that a variance which is next to nothing has none.
    fn information(&self, best: &Likeliest) -> DMatrix<f64> {
        let mut information = best.found.curvature.clone();
        let variances = best.at.map(f64::exp);
        for (row, one) in variances.iter().enumerate() {
            for (column, other) in variances.iter().enumerate() {
                information[(row, column)] /= one * other;
            }
        }
        if !self.is_reading_estimated {
            information.row_mut(0).fill(0.0);
            information.column_mut(0).fill(0.0);
            information[(0, 0)] = 1.0;
        }
        information
    }

    /// The likelihood of the logarithms of variances, within limits.
    fn likelihood<'a>(
        &'a self,
        classes: &'a [Vec<usize>],
    ) -> LimitedLikelihood<impl Fn(&DVector<f64>) -> Option<Likelihood> + 'a> {
        let start = self.start(classes);
        let limits = [NOTHING, 1.0 / NOTHING].map(|factor| {
            let mut limit = start.add_scalar(f64::ln(factor));
            if !self.is_reading_estimated {
                limit[0] = 0.0;
            }
            limit
        });
        LimitedLikelihood {
            of: |at: &DVector<f64>| self.told(classes, at),
            limits,
        }
    }

    /// The logarithms of half of what contrasts scatter.
    fn start(&self, classes: &[Vec<usize>]) -> DVector<f64> {
        let (mut square, mut moved) = (0.0, 0.0);
        for each in &self.contrasts {
            square += each.scatter.trace();
            moved += each.count * each.joints.norm_squared();
        }
        let returns = 0.5 * square / f64::max(moved, f64::MIN_POSITIVE);
        let mut start = DVector::from_element(1 + classes.len(), returns.max(LEAST).ln());
        start[0] = 0.0;
        start
    }

    /// The likelihood of these logarithms of variances, with the expected information.
    fn told(&self, classes: &[Vec<usize>], at: &DVector<f64>) -> Option<Likelihood> {
        let variances = at.map(f64::exp);
        let mut told = Likelihood {
            logarithm: 0.0,
            gradient: DVector::zeros(at.len()),
            curvature: DMatrix::zeros(at.len(), at.len()),
        };
        for each in &self.contrasts {
            // How the covariance of a contrast grows with each logarithm.
            let returns = classes.iter().map(|class| {
                let moved = each.joints.select_columns(class);
                &moved * moved.transpose()
            });
            let parts = iter::once(each.own.clone()).chain(returns);
            let parts = parts
                .zip(&variances)
                .map(|(part, variance)| part * *variance);
            let parts: Vec<DMatrix<f64>> = parts.collect();
            let factor = Cholesky::new(parts.iter().sum())?;
            let weight = inverse_of(&factor);
            let weighed: Vec<DMatrix<f64>> = parts.iter().map(|part| &weight * part).collect();
            let scatter = &weight * &each.scatter;
            let roots = factor.l_dirty().diagonal();
            told.logarithm -= each.count * roots.map(f64::ln).sum() + 0.5 * scatter.trace();
            for (row, one) in weighed.iter().enumerate() {
                told.gradient[row] += 0.5 * ((one * &scatter).trace() - each.count * one.trace());
                for (column, other) in weighed.iter().enumerate() {
                    told.curvature[(row, column)] += 0.5 * each.count * one.dot(&other.transpose());
                }
            }
        }
        Some(told)
    }
}
