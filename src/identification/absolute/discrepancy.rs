//! The model discrepancy of absolute readings: by how much residuals exceed the readings' covariances, what of that one visit
//! shares, and fits that weigh readings by it.

use nalgebra::{DVector, Matrix6xX, Vector3, Vector6};

use super::super::discrepancy::{WEIGHINGS, discrepancy_of};
use super::super::fit::{FittedReadings, Haste, LinearReadings, ParameterFit, fit_parameters};
use super::case::whitener;
use super::visits::LEAST_VISITS;
use super::{AbsoluteCase, FitResult, ReadingResidual};
use crate::experiment::together;
use crate::observation::{SharedErrors, SharingReadings};
use crate::parameter::{ElasticArm, ParameterSet};

/// A discrepancy below this is none (m, rad).
const LEAST_DISCREPANCY: f64 = 1e-9;
/// Weights that change by no larger share are the same.
const SETTLED: f64 = 1e-6;

impl AbsoluteCase<'_> {
    /// Weighs the readings by their own covariance and by what no parameter explains besides: a standard deviation of each
    /// coordinate of the position (m) and of the rotation (rad). Readings of one visit share that but for what differs within visits.
    pub(super) fn weigh(&mut self, discrepancy: [f64; 2]) {
        let within = [0, 1].map(|part| self.within[part].min(discrepancy[part]));
        let mut more = vec![discrepancy; self.observations.len()];
        let groups = self.sharing_discrepancy();
        let several = groups.iter().filter(|group| group.len() > 1);
        for &index in several.filter(|_| !self.is_sharing_known).flatten() {
            more[index] = within;
        }
        let known = self.shared.as_ref().filter(|_| self.is_sharing_known);
        let of_others = known.map(SharedErrors::covariances);
        for (index, each) in self.observations.iter_mut().enumerate() {
            let mut covariance = self.covariances[index];
            if let Some(of_others) = &of_others {
                covariance -= of_others[index];
            }
            for row in 0..6 {
                covariance[(row, row)] += more[index][row / 3].powi(2);
            }
            each.whitener = whitener(&covariance);
        }
        if self.is_sharing_known {
            return;
        }
        let all = [0, 1].map(|part| (discrepancy[part].powi(2) - within[part].powi(2)).sqrt());
        let effects = Matrix6xX::from_columns(
            &[0, 1, 2, 3, 4, 5].map(|row| Vector6::ith(row, all[row / 3].max(LEAST_DISCREPANCY))),
        );
        let of_visit = |visit: &Vec<usize>| SharingReadings {
            effects: match visit.len() {
                1 => vec![Matrix6xX::zeros(0)],
                several => vec![effects.clone(); several],
            },
            readings: visit.clone(),
        };
        let has_any = groups.len() < self.observations.len();
        self.shared = has_any.then(|| SharedErrors {
            groups: groups.iter().map(of_visit).collect(),
        });
    }

    /// Readings that share a discrepancy: those of a visit, and where visits are too few to tell what is new at each, those of a configuration
    /// as a station sees it.
    fn sharing_discrepancy(&self) -> Vec<Vec<usize>> {
        if self.visits.len() >= LEAST_VISITS {
            return self.visits.clone();
        }
        let setup = |place: usize| &self.observations[place].setup;
        let is_alike = |one, other| setup(one).station == setup(other).station;
        let pose = |place| setup(place).pose();
        together(self.observations.len(), pose, is_alike)
    }

    /// A fit with the weights that the readings have, from values (p) that are near.
    pub(super) fn fit_near(
        &self,
        set: &ParameterSet,
        values: &[f64],
        haste: Haste,
    ) -> FitResult<ParameterFit> {
        let start = values.to_vec().into();
        self.fitted_readings(set).fit_from(&start, haste)
    }

    pub(super) fn fitted_readings<'a>(&'a self, set: &'a ParameterSet) -> FittedReadings<'a> {
        FittedReadings {
            nominal: &self.arm,
            set,
            observations: &self.observations,
            shared: self.shared.as_ref(),
            linear: None,
        }
    }

    /// The sum of squares of the whitened residuals that an arm leaves.
    pub(super) fn square_at(&self, arm: &ElasticArm) -> FitResult<f64> {
        let nothing = ParameterSet::empty();
        let readings = FittedReadings {
            nominal: arm,
            ..self.fitted_readings(&nothing)
        };
        Ok(readings.equations(&DVector::zeros(0))?.square)
    }

    /// What is left of the readings at values (p), by what is known of them to first order.
    pub(super) fn left_by(
        &self,
        linear: &LinearReadings,
        values: &DVector<f64>,
    ) -> Vec<ReadingResidual> {
        let left = self.observations.iter().enumerate().map(|(place, each)| {
            let rows = linear.observations.residual(place, values);
            let rows = &rows.as_slice()[..each.reading.kind().rows()];
            ReadingResidual::of_rows(&DVector::from_column_slice(rows))
        });
        left.collect()
    }

    /// A fit that weighs readings by what the model leaves, too; the first weight comes from another fit, or from the frames alone
    /// where there is none.
    pub(super) fn with_discrepancy(
        &mut self,
        set: &ParameterSet,
        other: Option<&ParameterFit>,
    ) -> FitResult<(ParameterFit, Option<[f64; 2]>)> {
        let (mut found, mut values) = if let Some(fit) = other {
            (self.estimated_discrepancy(fit)?, self.rebased(fit))
        } else {
            let fit = self.fit_of_frames()?;
            let found = self.estimated_discrepancy(&fit)?;
            self.rebased(&fit);
            (found, set.prior().mean.clone())
        };
        for _ in 0..WEIGHINGS {
            self.weigh(found);
            let fit = (self.fitted_readings(set)).fit_from(&values, Haste::Weights)?;
            let next = self.estimated_discrepancy(&fit)?;
            values = self.rebased(&fit);
            let is_settled =
                (next.iter().zip(found)).all(|(next, last)| (next - last).abs() <= SETTLED * next);
            found = next;
            if is_settled {
                break;
            }
        }
        self.weigh(found);
        Ok((
            self.fit_near(set, values.as_slice(), Haste::Near)?,
            Some(found),
        ))
    }

    /// The frames of stations and targets alone that suit the readings best, all else as it is.
    fn fit_of_frames(&self) -> FitResult<ParameterFit> {
        fit_parameters(&self.arm, &self.frames()?, &self.observations)
    }

    /// The robot as it is in the frames that suit the readings best.
    ///
    /// # Errors
    /// The readings do not determine frames.
    pub fn in_best_frames(&self) -> FitResult<ElasticArm> {
        self.check_frames()?;
        Ok(self.fit_of_frames()?.belief)
    }

    /// What residuals are larger than the readings' own covariances make them, as standard deviations of position (m) and
    /// rotation (rad); and notes what of it readings of one visit do not share.
    pub(super) fn estimated_discrepancy(&mut self, fit: &ParameterFit) -> FitResult<[f64; 2]> {
        let left = self.left(&fit.belief)?;
        self.within = self.within_visits(&left, fit.spare());
        Ok(self.discrepancy_of(&left, fit))
    }

    /// The degrees of freedom of the variance that a coordinate has with a discrepancy from a fit's residuals: readings that share it count
    /// as one.
    pub(super) fn degrees_of(&self, fit: &ParameterFit) -> f64 {
        (self.alone() * fit.rows as f64 - fit.determined).max(1.0)
    }

    /// The share of the readings that are one for each discrepancy.
    fn alone(&self) -> f64 {
        self.sharing_discrepancy().len() as f64 / self.observations.len() as f64
    }

    pub(super) fn discrepancy_of(&self, left: &[ReadingResidual], fit: &ParameterFit) -> [f64; 2] {
        // Each reading has its part in what was fitted.
        let spare = if self.visits.len() < LEAST_VISITS {
            self.degrees_of(fit) / (self.alone() * fit.rows as f64)
        } else {
            fit.spare()
        };
        discrepancy_of(left, &self.covariances, spare)
    }

    /// By how much residuals within visits differ more than the readings' own covariances make them: standard deviations of each
    /// coordinate of the position (m) and of the rotation (rad). `spare` is the share of the numbers that the fit did not use up.
    fn within_visits(&self, left: &[ReadingResidual], spare: f64) -> [f64; 2] {
        let groups = self.sharing_discrepancy();
        [0, 1].map(|number| {
            let (mut square, mut own, mut freedom) = (0.0, 0.0, 0.0);
            for visit in &groups {
                let part = visit.iter();
                let part = part.filter_map(|&index| Some((index, left[index].part(number)?)));
                let part: Vec<(usize, (Vector3<f64>, usize))> = part.collect();
                let [(_, (_, coordinates)), _, ..] = part[..] else {
                    continue;
                };
                let count = part.len() as f64;
                let mean = part.iter().map(|(_, each)| each.0).sum::<Vector3<f64>>() / count;
                for (index, (each, coordinates)) in &part {
                    let rows = 3 * number..3 * number + coordinates;
                    let variances = rows.map(|row| self.covariances[*index][(row, row)]);
                    square += (each - mean).norm_squared();
                    own += variances.sum::<f64>() * (1.0 - 1.0 / count);
                }
                freedom += coordinates as f64 * (count - 1.0);
            }
            ((square / spare - own) / f64::max(freedom, 1.0))
                .max(0.0)
                .sqrt()
        })
    }
}
