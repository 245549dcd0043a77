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
//! large as stated (contrasts within visits have s R alone), and of the joints' returns v_j with the derivatives J_j by their angles. The variances maximise the likelihood of all contrasts by the minorisation of
//! [`mixed`](super::mixed). With the expected information I, the effective degrees of freedom of a variance are 2 v^2 (I / var v).

use std::collections::BTreeMap;
use std::iter;

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::mixed::in_blocks;
use super::residuals::LinearReading;
use super::{AbsoluteCase, AbsoluteFit};
use crate::experiment::together;
use crate::numeric::quantile::TWO_SIDED_95;
use crate::numeric::tolerance::pose_repeatability;
use crate::quantities::written::from_one;

/// Improvements of the variances, and the change of a deviation that ends them.
const ROUNDS: usize = 500;
const FOUND: f64 = 1e-5;
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
        let (classes, variances) = all.components(joints.len())?;
        let (_, information) = all.improved(&classes, &variances)?;
        let errors = Cholesky::new(information)?.inverse();
        let alone = all.degrees_alone(&classes);
        let chain = &self.arm.chain.joints;
        let component = |level, joints: Vec<usize>, place: usize| {
            let slides = joints.iter().filter(|&&joint| chain[joint].drive.slides);
            let (unit, factor) = match (level, slides.count()) {
                ("reading", _) => ("1", 1.0),
                (_, 0) => ("mrad", 1e3),
                (_, all) if all == joints.len() => ("mm", 1e3),
                _ => ("mrad, mm", 1e3),
            };
            let own = joints.iter().map(|&joint| chain[joint].name.clone());
            let variance = variances[place];
            let degrees_of_freedom = 2.0 * variance * variance / errors[(place, place)];
            let interval95 = interval95(variance, errors[(place, place)], alone[place]);
            RepeatComponent {
                level,
                names: own.collect(),
                joints,
                unit,
                standard_uncertainty: variance.sqrt() * factor,
                interval95: interval95.map(|end| end * factor),
                degrees_of_freedom,
            }
        };
        let (mut components, mut not_separated) = (Vec::new(), Vec::new());
        if within > 0 {
            components.push(component("reading", Vec::new(), 0));
        } else {
            let words = "reading from visit: standard deviations of readings are taken as exact; two readings of a target in one visit \
                         would tell";
            not_separated.push(words.to_owned());
        }
        for (class, own) in classes.iter().enumerate() {
            let own = own.iter().map(|&joint| joints[joint]).collect();
            let found = component("visit", own, 1 + class);
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
                    covariance += column * column.transpose() * variances[1 + class];
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
    /// Which joints have a variance in common; that of the readings, then those of these classes.
    fn components(&self, joints: usize) -> Option<(Vec<Vec<usize>>, Vec<f64>)> {
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
            let variances = self.likeliest(&classes)?;
            let (_, information) = self.improved(&classes, &variances)?;
            let inverse = Cholesky::new(information.clone()).map(|factor| factor.inverse());
            let is_inflated = |place: &usize| {
                let own = information[(*place, *place)];
                let inverse = inverse.as_ref();
                inverse.is_none_or(|inverse| inverse[(*place, *place)] * own > INFLATED)
            };
            let alike = |&(one, other): &(usize, usize)| {
                let size = information[(one, one)] * information[(other, other)];
                information[(one, other)] / size.sqrt()
            };
            let all = 1..variances.len();
            // The two that are told apart worst become one.
            let pairs = (all.clone().filter(is_inflated))
                .flat_map(|one| all.clone().map(move |other| (one, other)))
                .filter(|(one, other)| one != other);
            let worst = pairs.max_by(|one, other| alike(one).total_cmp(&alike(other)));
            let Some((one, other)) = worst else {
                return Some((classes, variances));
            };
            let joined = classes.remove(one.max(other) - 1);
            let class = &mut classes[one.min(other) - 1];
            class.extend(joined);
            class.sort_unstable();
        }
    }

    /// The likeliest variances: from half of what contrasts scatter on.
    fn likeliest(&self, classes: &[Vec<usize>]) -> Option<Vec<f64>> {
        let (mut square, mut moved) = (0.0, 0.0);
        for each in &self.contrasts {
            square += each.scatter.trace();
            moved += each.count * each.joints.norm_squared();
        }
        let returns = 0.5 * square / f64::max(moved, f64::MIN_POSITIVE);
        let mut variances = vec![returns; 1 + classes.len()];
        variances[0] = 1.0;
        for _ in 0..ROUNDS {
            let (next, _) = self.improved(classes, &variances)?;
            let change = next.iter().zip(&variances).map(|(next, before)| {
                (next.sqrt() - before.sqrt()).abs() / before.sqrt().max(f64::MIN_POSITIVE)
            });
            let change = change.fold(0.0, f64::max);
            variances = next;
            if change < FOUND {
                break;
            }
        }
        Some(variances)
    }

    /// Likelier variances, and the expected information of those that were given.
    fn improved(
        &self,
        classes: &[Vec<usize>],
        variances: &[f64],
    ) -> Option<(Vec<f64>, DMatrix<f64>)> {
        let count = variances.len();
        let mut sums = vec![[0.0; 2]; count];
        let mut information = DMatrix::zeros(count, count);
        for each in &self.contrasts {
            // How each variance moves the covariance of a contrast.
            let returns = classes.iter().map(|class| {
                let moved = each.joints.select_columns(class);
                &moved * moved.transpose()
            });
            let parts: Vec<DMatrix<f64>> = iter::once(each.own.clone()).chain(returns).collect();
            let all = parts.iter().zip(variances);
            let covariance: DMatrix<f64> = all.map(|(part, variance)| part * *variance).sum();
            let weight = Cholesky::new(covariance)?.inverse();
            let weighed: Vec<DMatrix<f64>> = parts.iter().map(|part| &weight * part).collect();
            let scatter = &weight * &each.scatter;
            for (row, one) in weighed.iter().enumerate() {
                sums[row][0] += (one * &scatter).trace();
                sums[row][1] += each.count * one.trace();
                for (column, other) in weighed.iter().enumerate() {
                    information[(row, column)] += 0.5 * each.count * one.dot(&other.transpose());
                }
            }
        }
        let improved = variances.iter().zip(&sums);
        let improved = improved.map(|(variance, [square, expected])| {
            variance * (square / f64::max(*expected, f64::MIN_POSITIVE)).sqrt()
        });
        let mut improved: Vec<f64> = improved.collect();
        if !self.is_reading_estimated {
            improved[0] = 1.0;
            information.row_mut(0).fill(0.0);
            information.column_mut(0).fill(0.0);
            information[(0, 0)] = 1.0;
        }
        Some((improved, information))
    }

    /// The degrees of freedom of each variance if there were no other: of the readings', then of these classes.
    fn degrees_alone(&self, classes: &[Vec<usize>]) -> Vec<f64> {
        let sum = |rows: &dyn Fn(&Contrasts) -> usize| {
            let contrasts = self.contrasts.iter();
            contrasts.map(|each| each.count * rows(each) as f64).sum()
        };
        let of_class = |class: &Vec<usize>| {
            sum(&|each| {
                let is_moved = |joint: &&usize| each.joints.column(**joint).amax() > 0.0;
                class.iter().filter(is_moved).count().min(each.own.nrows())
            })
        };
        let of_readings = sum(&|each| each.own.nrows());
        iter::once(of_readings)
            .chain(classes.iter().map(of_class))
            .collect()
    }
}

/// The interval of 95 % of a standard deviation, by its square v, the variance of that, and the degrees of freedom that v would have if there
/// were nothing else: chi-square then, and normal in what else it is told from (modified large samples, Graybill and Wang 1980).
fn interval95(variance: f64, spread: f64, alone: f64) -> [f64; 2] {
    let beside = TWO_SIDED_95.powi(2) * (spread - 2.0 * variance * variance / alone).max(0.0);
    let law = ChiSquared::new(alone);
    let own = |share: f64| {
        let factor = (law.as_ref()).map_or(f64::INFINITY, |law| alone / law.inverse_cdf(share));
        variance * (factor - 1.0)
    };
    let [below, above] = [0.975, 0.025].map(|share| (own(share).powi(2) + beside).sqrt());
    [
        (variance - below).max(0.0).sqrt(),
        (variance + above).sqrt(),
    ]
}
