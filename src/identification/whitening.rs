//! The weights of readings: each with its own covariance, those of one configuration together where they share something.

use nalgebra::allocator::Allocator;
use nalgebra::{
    DMatrix, DVector, DefaultAllocator, Dim, Dyn, Matrix6, OMatrix, U1, Vector3, Vector6,
};

use super::case::Case;
use super::discrepancy::six_rows;
use super::equations::rows_of;
use crate::measurement::{Measurement, by_configuration, by_experiment};
use crate::numeric::quantisation::shared_by_repeats;
use crate::observation::{DeflectionPrecision, PlannedReadings};

/// The factors L of the readings' covariances L L^T, block by block.
#[derive(Debug)]
pub(super) struct Whitening {
    /// The rows of readings that share something, and L.
    blocks: Vec<(Vec<usize>, DMatrix<f64>)>,
}

impl Whitening {
    /// Multiplies readings' rows by L^-1.
    pub fn whiten<C: Dim>(&self, rows: &mut OMatrix<f64, Dyn, C>)
    where
        DefaultAllocator: Allocator<Dyn, C> + Allocator<U1, C>,
    {
        for (places, factor) in &self.blocks {
            let mut own = rows.select_rows(places);
            factor.solve_lower_triangular_unchecked_mut(&mut own);
            for (own, &place) in own.row_iter().zip(places) {
                rows.set_row(place, &own);
            }
        }
    }

    /// Multiplies them by L: takes the weights off again.
    pub fn take_off(&self, rows: &mut DVector<f64>) {
        for (places, factor) in &self.blocks {
            let own = factor * rows.select_rows(places);
            for (own, &place) in own.iter().zip(places) {
                rows[place] = *own;
            }
        }
    }
}

impl Case<'_> {
    /// The weights: the instrument's noise, the measurement's own where it brings some, what else is new in each reading, and what
    /// readings of one configuration share.
    pub(super) fn whitening(&self) -> Whitening {
        let ranges: Vec<_> = self.rows_of_each().collect();
        let mut model = self.readings();
        let block = |members: Vec<usize>| {
            let covariance = self.covariance_together(model.as_mut(), &members);
            let rows = members.into_iter().flat_map(|index| ranges[index].clone());
            let typical = covariance.diagonal().map(f64::sqrt);
            let factor = covariance.cholesky().map(|factor| factor.l());
            let factor = factor.unwrap_or_else(|| DMatrix::from_diagonal(&typical));
            (rows.collect(), factor)
        };
        Whitening {
            blocks: self.sharing().into_iter().map(block).collect(),
        }
    }

    /// The covariance of each measured deflection with its rotation (m^2, m rad, rad^2), whatever repeats it; of what is along a
    /// direction the first element.
    pub(super) fn covariances(&self) -> Vec<Matrix6<f64>> {
        let mut model = self.readings();
        let alone = |index| six_rows(&self.covariance_together(model.as_mut(), &[index]));
        (0..self.measurements.len()).map(alone).collect()
    }

    /// Measurements that share something, together, else each alone.
    fn sharing(&self) -> Vec<Vec<usize>> {
        let uncertain = &self.belief.uncertain;
        if uncertain.is_shared_by_configuration() {
            return by_configuration(self.measurements);
        }
        if uncertain.along_step_m() > 0.0 {
            return by_experiment(self.measurements);
        }
        let all = 0..self.measurements.len();
        all.map(|index| vec![index]).collect()
    }

    /// The covariance of readings of one configuration (m^2, m rad, rad^2): what each reads on the diagonal, and what two of them share
    /// beside it.
    pub(super) fn covariance_together(
        &self,
        mut model: Option<&mut PlannedReadings<'_>>,
        members: &[usize],
    ) -> DMatrix<f64> {
        let measured = |place: usize| &self.measurements[members[place]];
        if let Some(model) = &mut model {
            model.move_to(measured(0).configuration_rad.as_slice());
        }
        let rows = |place: usize| rows_of(measured(place));
        let size = (0..members.len()).map(rows).sum();
        let mut covariance = DMatrix::zeros(size, size);
        let share_along = self.belief.uncertain.share_along();
        let mut at = 0;
        for place in 0..members.len() {
            let mut beside = 0;
            for other in 0..members.len() {
                let [own, another] = [measured(place), measured(other)];
                let mut block = self.shared_noise(own, another);
                if let Some(model) = &mut model {
                    if place == other {
                        model.read_along(own.direction.as_ref());
                        let share = own.direction.map_or(1.0, |_| share_along);
                        block += model.covariance_of_all(&own.load) * (share * share);
                    } else {
                        block *= model.unloaded().shared_part();
                        let pair = [own, another].map(|each| (&each.load, each.direction.as_ref()));
                        block += model.covariance_shared(pair);
                    }
                }
                leave_rows_there(&mut block, [own, another]);
                let mut entries = covariance.view_mut((at, beside), (rows(place), rows(other)));
                entries.copy_from(&block.view((0, 0), (rows(place), rows(other))));
                beside += rows(other);
            }
            at += rows(place);
        }
        self.round_alike(members, &mut covariance);
        covariance
    }

    /// Adds what repeats of a displacement, each one row, share of rounding to the covariance of the members' rows: by what is on its
    /// diagonal besides.
    fn round_alike(&self, members: &[usize], covariance: &mut DMatrix<f64>) {
        let step_m = self.belief.uncertain.along_step_m();
        if step_m <= 0.0 {
            return;
        }
        let all = covariance.diagonal();
        let mut along: Vec<(usize, &Measurement)> = Vec::new();
        let mut row = 0;
        for measured in members.iter().map(|&place| &self.measurements[place]) {
            let repeated = along.iter().filter(|(_, other)| {
                (other.load, other.direction) == (measured.load, measured.direction)
            });
            for &(other, _) in repeated {
                let variance = f64::midpoint(all[row], all[other]);
                let shared = shared_by_repeats(step_m, variance, all[row].min(all[other]));
                covariance[(row, other)] += shared;
                covariance[(other, row)] += shared;
            }
            if measured.direction.is_some() {
                along.push((row, measured));
            }
            row += rows_of(measured);
        }
    }

    /// The readings of these measurements as planning sees them: of rotations, too, where some are measured. The
    /// instrument's noise is the measurements' own; none where there is nothing else.
    fn readings(&self) -> Option<PlannedReadings<'_>> {
        let extended = &self.belief.uncertain;
        if extended.is_plain() {
            return None;
        }
        let has_rotations = self.measurements.iter().any(|each| each.rotation.is_some());
        let precision = DeflectionPrecision {
            sigma_m: self.sigma.weight_m(),
            rotation_sigma_rad: has_rotations.then_some(1.0),
            unloaded: extended.unloaded(),
            along_sigma_m: None,
            along_step_m: 0.0,
            reads_all: true,
        };
        Some(extended.readings_of_all(precision))
    }

    /// What the covariance of two readings by the instrument would be, were all their noise the same. Of readings with deviations of
    /// their own, the unloaded one has a part of each: the readings' correlation is that part.
    fn shared_noise(&self, one: &Measurement, other: &Measurement) -> Matrix6<f64> {
        let rotation = |each: &Measurement| {
            (each.rotation).map_or_else(Vector3::zeros, |rotation| rotation.sigma_rad)
        };
        let p = self.sigma_of(one).component_mul(&self.sigma_of(other));
        let r = rotation(one).component_mul(&rotation(other));
        Matrix6::from_diagonal(&Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z))
    }
}

/// Leaves of a covariance the rows that two measurements have, first in their places: of what is along a direction one alone.
fn leave_rows_there(whole: &mut Matrix6<f64>, of: [&Measurement; 2]) {
    if of.iter().all(|each| each.direction.is_none()) {
        return;
    }
    let [one, other] = of.map(|each| {
        each.direction.map_or_else(Matrix6::identity, |direction| {
            let mut shown = Matrix6::zeros();
            (shown.fixed_view_mut::<1, 3>(0, 0)).copy_from(&direction.transpose());
            shown
        })
    });
    *whole = one * *whole * other.transpose();
}
