//! The weights of readings: each with its own covariance, those of one configuration together where they share something.

use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DefaultAllocator, Dim, Dyn, OMatrix};

use super::case::Case;
use super::equations::rows_of;
use super::extended::of_rows_there;
use crate::measurement::by_configuration;
use crate::observation::PlannedReadings;

/// The factors L of the readings' covariances L L^T, block by block.
#[derive(Debug, Clone)]
pub(super) struct Whitening {
    /// The rows of readings that share something, and L.
    blocks: Vec<(Vec<usize>, DMatrix<f64>)>,
}

impl Whitening {
    /// Multiplies readings' rows by L^-1.
    pub fn whiten<C: Dim>(&self, rows: &mut OMatrix<f64, Dyn, C>)
    where
        DefaultAllocator: Allocator<Dyn, C>,
    {
        for mut column in rows.column_iter_mut() {
            for (places, factor) in &self.blocks {
                for (row, &place) in places.iter().enumerate() {
                    let value = column[place] / factor[(row, row)];
                    column[place] = value;
                    for (below, &place) in (row + 1..).zip(&places[row + 1..]) {
                        column[place] -= factor[(below, row)] * value;
                    }
                }
            }
        }
    }

    /// Multiplies them by L: takes the weights off again.
    pub fn take_off<C: Dim>(&self, rows: &mut OMatrix<f64, Dyn, C>)
    where
        DefaultAllocator: Allocator<Dyn, C> + Allocator<nalgebra::U1, C>,
    {
        for (places, factor) in &self.blocks {
            let own = factor * rows.select_rows(places);
            for (own, &place) in own.row_iter().zip(places) {
                rows.set_row(place, &own);
            }
        }
    }
}

impl Case<'_> {
    /// The weights: the instrument's noise, the measurement's own where it brings some, what else is new in each reading, and what
    /// readings of one configuration share.
    pub(super) fn whitening(&self) -> Whitening {
        let ranges: Vec<_> = self.rows_of_each().collect();
        let mut model = (self.uncertain).map(|extended| self.readings(extended));
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

    /// Measurements that share something, together, else each alone.
    fn sharing(&self) -> Vec<Vec<usize>> {
        match self.uncertain {
            Some(extended) if extended.is_shared_by_configuration() => {
                by_configuration(self.measurements)
            }
            _ => (0..self.measurements.len())
                .map(|index| vec![index])
                .collect(),
        }
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
        let mut at = 0;
        for place in 0..members.len() {
            let mut beside = 0;
            for other in 0..members.len() {
                let [own, another] = [measured(place), measured(other)];
                let mut block = self.shared_noise(own, another);
                if let Some(model) = &mut model {
                    if place == other {
                        model.read_along(own.direction.as_ref());
                        block += model.covariance_of_all(&own.load);
                    } else {
                        block *= model.unloaded().shared_part();
                        block += model.covariance_shared(&own.load, &another.load);
                    }
                }
                let block = of_rows_there(&block, [own, another]);
                let mut entries = covariance.view_mut((at, beside), (rows(place), rows(other)));
                entries.copy_from(&block.view((0, 0), (rows(place), rows(other))));
                beside += rows(other);
            }
            at += rows(place);
        }
        covariance
    }
}
