//! Fits of parts of the readings, all with the same unknowns, priors and weights.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6xX, Rotation3, Vector3, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::super::discrepancy::{discrepancy_covariance, three_rows};
use super::super::fit::Haste;
use super::mixed::VarianceComponents;
use super::residuals::LinearReading;
use super::sharing::new_together;
use super::{
    AbsoluteCase, AbsoluteFit, DiscrepancyModel, FitResult, IdentificationError, ParameterGroup,
    ReadingWeights,
};
use crate::numeric::correlated::{CorrelatedList, CorrelatedReading};
use crate::numeric::markov::{ProcessPoint, SampledFunction};
use crate::observation::{
    Observation, ObservationModel, ReadLength, Reading, SharingReadings,
    planned_information_of_groups, planned_positions,
};
use crate::parameter::{ParameterSet, relative_precision};
use crate::robot::EquilibriumError;

/// What stands for nothing known: this share of what a reading tells in the mean, and of typical sizes where none tells anything.
const FAINT: f64 = 1e-4;

/// Readings of which any part can be fitted as all were: the same unknowns, what is known of them before, and weights.
#[derive(Debug, Clone)]
pub struct PartsOfReadings<'a> {
    /// The readings, with the weights that all together ask for.
    pub case: AbsoluteCase<'a>,
    /// What all together say.
    pub all: AbsoluteFit,
    /// Where each position is as all together say (m), without what is new at it.
    pub expected_m: Vec<Vector3<f64>>,
    /// Which readings belong to a part together, by their places: those of one visit, and those that share errors besides.
    pub together: Vec<SharingReadings>,
    /// What is new at each visit, and the joint error functions that are part of every fit.
    pub known: VarianceComponents,
}

/// Readings of a robot that is as the planner's model says.
#[derive(Debug, Clone)]
pub struct SimulatedReadings {
    /// The readings.
    pub observations: Vec<Observation>,
    /// Where each position is (m), without what is new at it.
    pub expected_m: Vec<Vector3<f64>>,
}

/// What a fit of some readings predicts of all.
#[derive(Debug, Clone)]
pub struct PredictedPositions {
    /// Where they are (m).
    pub positions_m: Vec<Vector3<f64>>,
    /// The predicted mean square distance from there (m^2): of the places, without what is new at each reading, and of the readings; over the
    /// readings that were not fitted.
    pub squares_m2: [f64; 2],
}

/// Readings that share no error.
fn by_itself(readings: &[usize]) -> SharingReadings {
    SharingReadings {
        readings: readings.to_vec(),
        effects: vec![Matrix6xX::zeros(0); readings.len()],
    }
}

impl<'a> AbsoluteCase<'a> {
    /// Fits all readings, those far out among them, and keeps what fits of parts of them share. Where the planner's model has joint error
    /// functions, these are part of every fit, and what is new at each position is as large as it says.
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub fn in_parts(mut self, groups: &[ParameterGroup]) -> FitResult<PartsOfReadings<'a>> {
        self.choices.keeps_all = true;
        let all = self.fit(groups, ReadingWeights::AsNeeded)?;
        let model = all.discrepancy_model.as_ref();
        let rest = model.map_or(all.discrepancy.unwrap_or_default(), |each| each.model.rest);
        // What readings share by the planner's model is in their weights already.
        let known = self.known_components(rest);
        let left = match (&known, model) {
            (Some(_), Some(model)) => &model.left,
            _ => &all.left,
        };
        let known = known.unwrap_or_else(|| VarianceComponents {
            functions: Vec::new(),
            rest: all.discrepancy.unwrap_or_default(),
        });
        // The fit leaves the readings with their own weights.
        if all.discrepancy.is_some() || !known.functions.is_empty() {
            self.weigh(known.rest);
        }
        let together = match &self.shared {
            Some(shared) => shared.groups.clone(),
            None => self.visits.iter().map(|visit| by_itself(visit)).collect(),
        };
        let read = self.observations.iter().map(Observation::position_m);
        let expected_m = read.zip(left).map(|(read, left)| read - left.position_m);
        Ok(PartsOfReadings {
            expected_m: expected_m.collect(),
            case: self,
            all,
            together,
            known,
        })
    }
}

impl PartsOfReadings<'_> {
    /// What is new at each position besides its reading's own error: the standard deviation of each coordinate (m); none where nothing is.
    pub fn discrepancy_m(&self) -> Option<f64> {
        let [position_m, _] = self.known.rest;
        (position_m > 0.0).then_some(position_m)
    }

    /// Whether a reading is judged on: positions alone where there are any.
    pub fn is_judged(&self, place: usize) -> bool {
        !self.case.is_length(place) || self.case.positions().is_empty()
    }

    /// Whether all are.
    pub fn are_all_judged(&self) -> bool {
        (0..self.case.observations.len()).all(|place| self.is_judged(place))
    }

    /// How far the readings that are judged on are from where all together say (m).
    pub fn distances_m(&self) -> Vec<f64> {
        let both = self.case.observations.iter().zip(&self.expected_m);
        let judged = both.enumerate().filter(|(place, _)| self.is_judged(*place));
        judged
            .map(|(_, (read, expected))| (read.position_m() - expected).norm())
            .collect()
    }

    /// What those together are: readings, visits or configurations.
    pub fn unit(&self) -> &'static str {
        let count = self.together.len();
        if count == self.case.observations.len() {
            "reading"
        } else if count == self.case.visits.len() {
            "visit"
        } else {
            "configuration"
        }
    }

    /// What readings together determine of the unknowns (p x p, in typical sizes), with the robot nominal, and frames where all readings
    /// say.
    pub fn told(&self) -> Vec<DMatrix<f64>> {
        let (set, arm) = (&self.all.set, &self.case.arm);
        let planned = self.case.planned();
        planned_information_of_groups(set, arm, &set.prior().mean, &planned, &self.together)
    }

    /// C^T (p x 3 n): how the positions, or the lengths, of the n readings that are judged on follow the unknowns (in typical sizes),
    /// times the root of 1/n, so that `rho_0`^2 is the mean square distance over them.
    pub fn positions(&self) -> DMatrix<f64> {
        let set = &self.all.set;
        let read =
            (self.case.observations.iter().enumerate()).filter(|(place, _)| self.is_judged(*place));
        let read = read.map(|(_, each)| (&each.setup, each.reading.kind()));
        let read: Vec<_> = read.collect();
        let rows = planned_positions(set, &self.case.arm, &set.prior().mean, &read);
        rows.transpose() / (read.len().max(1) as f64).sqrt()
    }

    /// What readings together show where joint error functions are unknown beside the unknowns; where some are several, each is predicted
    /// by itself, too.
    ///
    /// # Errors
    /// The robot has no equilibrium there, or the numbers have no factorisation.
    pub fn with_functions(&self) -> FitResult<CorrelatedList> {
        let (set, joints) = (&self.all.set, self.known.joints());
        let mean = &set.prior().mean;
        let rows = (self.case).rows_at(&self.case.arm, set, mean.as_slice(), &joints)?;
        let size = set.len();
        let told: DMatrix<f64> = self.told().iter().sum();
        let mean = told / self.together.len().max(1) as f64;
        let before = relative_precision(set) + (mean + DMatrix::identity(size, size)) * FAINT;
        let factor = Cholesky::new(before).ok_or(IdentificationError::NothingObserved)?;
        let sizes = DMatrix::from_diagonal(&set.scales());
        let deviations = self.known.functions.iter().map(|each| each.deviation_rad);
        let deviations: Vec<f64> = deviations.collect();
        let deviations = DMatrix::from_diagonal(&deviations.into());
        let mut visit_of = vec![0; rows.len()];
        for (visit, readings) in self.case.visits.iter().enumerate() {
            for &place in readings {
                visit_of[place] = visit;
            }
        }
        let reading = |(number, group): (usize, &SharingReadings)| {
            let places = &group.readings;
            let by = |of: fn(&LinearReading) -> &DMatrix<f64>| {
                let all = places.iter().flat_map(|&place| of(&rows[place]).row_iter());
                DMatrix::from_rows(&all.collect::<Vec<_>>())
            };
            let mut by_unknowns = &sizes * by(|each| &each.columns).transpose();
            (factor.l_dirty()).solve_lower_triangular_mut(&mut by_unknowns);
            let q = &self.case.observations[places[0]].setup.commanded_rad;
            CorrelatedReading {
                shared: (number, DMatrix::zeros(by_unknowns.ncols(), 0)),
                by_unknowns,
                by_processes: ProcessPoint {
                    columns: by(|each| &each.joints) * &deviations,
                    places: (joints.iter())
                        .map(|&joint| self.case.arm.chain.joints[joint].in_turn(q[joint]))
                        .collect(),
                },
                new: self.new_at(group, &rows, &visit_of),
            }
        };
        let count = rows.len();
        let mut all = self.together.clone();
        if all.len() < count {
            all.extend((0..count).map(|place| by_itself(&[place])));
        }
        Ok(CorrelatedList {
            kernels: (self.known.functions.iter())
                .map(|each| each.kernel_on(&self.case.arm.chain))
                .collect(),
            most: vec![1; self.together.len()],
            known: 0,
            readings: all.iter().enumerate().map(reading).collect(),
        })
    }

    /// The covariance of what is new at readings that belong together (r x r), one below the other, with the visit of each reading.
    fn new_at(
        &self,
        group: &SharingReadings,
        rows: &[LinearReading],
        visit_of: &[usize],
    ) -> DMatrix<f64> {
        let rest = discrepancy_covariance(self.known.rest);
        let mut visits: Vec<usize> = group.readings.iter().map(|&each| visit_of[each]).collect();
        visits.dedup();
        let each = group.readings.iter().zip(&group.effects);
        let each = each.map(|(&place, effects)| {
            let rows = &rows[place];
            let count = rows.own.nrows();
            let returns = self.known.returns(&rows.joints);
            let own =
                &rows.own + rest.view((0, 0), (count, count)) + &returns * returns.transpose();
            // What the planner's model says, then how joints return at each visit.
            let (known, functions) = (effects.ncols(), returns.ncols());
            let columns = known + visits.len() * functions;
            let mut effects = effects.rows(0, count).resize_horizontally(columns, 0.0);
            let number = visits.iter().position(|visit| *visit == visit_of[place]);
            let first = known + number.unwrap_or(0) * functions;
            effects.columns_mut(first, functions).copy_from(&returns);
            (own, effects)
        });
        new_together(&each.collect::<Vec<_>>())
    }

    /// What a fit of some of these observations, which may be those of the case or others in their places, predicts of all positions; none
    /// where there is no fit. `chosen` are in rising order.
    pub fn predicted_by(
        &self,
        observations: &[Observation],
        chosen: &[usize],
    ) -> Option<PredictedPositions> {
        let mut part = (self.case).part_of(|index| chosen.binary_search(&index).is_ok());
        for (to, &index) in part.observations.iter_mut().zip(chosen) {
            to.clone_from(&observations[index]);
        }
        let (arm, set) = (&self.case.arm, &self.all.set);
        let fit = part
            .fit_near(set, set.prior().mean.as_slice(), Haste::Near)
            .ok()?;
        let joints = self.known.joints();
        let model = if joints.is_empty() {
            DiscrepancyModel::plain(fit.posterior.covariance.clone(), self.known.rest)
        } else {
            let (_, mixed) = part.mixed_of(set, &fit.posterior, joints.clone(), self.known.rest)?;
            mixed.with_known(&self.known)?
        };
        let values = &fit.posterior.mean;
        let rows = self.case.rows_at(arm, set, values, &joints).ok()?;
        let places: Vec<usize> = (0..set.len()).collect();
        let mut squares = [0.0; 2];
        let mut others = 0.0;
        let of_reading = |(index, (rows, each)): (usize, (_, &Observation))| {
            let q = each.setup.commanded_rad.as_slice();
            let local = model.local(rows, &places, q);
            let (left, covariance) = (&local.left, model.covariance_of(&local));
            if chosen.binary_search(&index).is_err() && self.is_judged(index) {
                let new = discrepancy_covariance(model.rest) + self.case.covariances[index];
                let coordinates = left.len().min(3);
                let returns = self.known.returns(&rows.joints);
                let [all, new] = [
                    covariance.diagonal().rows(0, coordinates).sum(),
                    new.diagonal().rows(0, coordinates).sum()
                        + returns.rows(0, coordinates).norm_squared(),
                ];
                squares[0] += all - new;
                squares[1] += all;
                others += 1.0;
            }
            each.position_m() - three_rows(left, 0)
        };
        let positions_m = (rows.iter().zip(&self.case.observations).enumerate()).map(of_reading);
        Some(PredictedPositions {
            positions_m: positions_m.collect(),
            squares_m2: squares.map(|square| square / f64::max(others, 1.0)),
        })
    }

    /// The readings of a robot that is exactly as all readings together say but for joint error functions, which are sampled anew, with
    /// errors that are normal and as large as the weights say, shared ones among them.
    ///
    /// # Errors
    /// The robot has no equilibrium there.
    pub fn simulated(
        &self,
        random: &mut ChaCha8Rng,
    ) -> Result<SimulatedReadings, EquilibriumError> {
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &self.all.arm, &[]);
        let mut derivatives = Matrix6xX::zeros(0);
        let mut setups: Vec<_> = (self.case.observations.iter())
            .map(|each| each.setup.clone())
            .collect();
        let mut returned = setups.clone();
        // Their numbers are far from those of all else.
        let functions = random.clone();
        for (number, function) in self.known.functions.iter().enumerate() {
            let joint = function.joint;
            let sample = SampledFunction::new(
                function.kernel_on(&self.case.arm.chain),
                functions.clone(),
                1 + number,
            );
            for visit in &self.case.visits {
                let new: f64 = StandardNormal.sample(random);
                for &place in visit {
                    let (setup, returned) = (&mut setups[place], &mut returned[place]);
                    let chain = &self.case.arm.chain;
                    let place = chain.joints[joint].in_turn(setup.commanded_rad[joint]);
                    let error = sample.at(place);
                    setup.commanded_rad[joint] += function.deviation_rad * error;
                    returned.commanded_rad[joint] =
                        setup.commanded_rad[joint] + function.repeatability_rad * new;
                }
            }
        }
        let mut simulated = SimulatedReadings {
            observations: Vec::new(),
            expected_m: Vec::new(),
        };
        let mut shared = vec![Vector6::zeros(); setups.len()];
        for group in &self.together {
            let effects = group.effects.first().map_or(0, Matrix6xX::ncols);
            let normal = DVector::from_fn(effects, |_, _| StandardNormal.sample(random));
            for (&place, effects) in group.readings.iter().zip(&group.effects) {
                shared[place] = effects * &normal;
            }
        }
        let setups = setups.iter().zip(&returned).zip(&shared);
        for (each, ((setup, returned), shared)) in self.case.observations.iter().zip(setups) {
            let kind = each.reading.kind();
            let expected = model.predict(setup, kind, &mut derivatives)?;
            let predicted = model.predict(returned, kind, &mut derivatives)?;
            let normal = Vector6::from_fn(|_, _| StandardNormal.sample(random));
            let error = each.whitener.coloured(&normal) + shared;
            let position_m = predicted.position_m + error.fixed_rows::<3>(0);
            let turned = error.fixed_rows::<3>(3).into_owned();
            let reading = match each.reading {
                Reading::Pose { .. } => Reading::Pose {
                    position_m,
                    rotation: Rotation3::new(turned).into_inner() * predicted.rotation,
                },
                Reading::Length(read) => Reading::Length(ReadLength {
                    length_m: position_m.x,
                    ..read
                }),
                _ => Reading::Position { position_m },
            };
            simulated.expected_m.push(expected.position_m);
            simulated.observations.push(Observation {
                reading,
                ..each.clone()
            });
        }
        Ok(simulated)
    }
}
