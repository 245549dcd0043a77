//! Rows that follow unknowns and processes of several coordinates, and what some of them tell of all.
//!
//! With the covariance K of what all show before any is read, and R of what is new at each, a choice S leaves
//!
//! ```text
//! C = K - K_.S (K_SS + R_S)^-1 K_S.
//! ```
//!
//! of all. Near places are alike: that is counted without knots, for any two. One more, or one less, changes C by low rank.

use nalgebra::{Cholesky, DMatrix};
use rayon::prelude::*;

use super::markov::{Kernel, ProcessPoint};

/// A reading: a position and perhaps more.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelatedReading {
    /// How its rows, the position first, follow the unknowns (p x r), which are independent normal numbers before anything is read.
    pub by_unknowns: DMatrix<f64>,
    /// How they follow the processes.
    pub by_processes: ProcessPoint,
    /// A number, and how they follow what all readings of that number share (r x s).
    pub shared: (usize, DMatrix<f64>),
    /// The covariance of what is new at it (r x r).
    pub new: DMatrix<f64>,
}

/// Readings, with the processes that they follow.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrelatedList {
    /// What each process is.
    pub kernels: Vec<Kernel>,
    /// All of them.
    pub readings: Vec<CorrelatedReading>,
    /// The first may be chosen, each so often,
    pub most: Vec<u32>,
    /// and the last so many are read already. Others are predicted alone.
    pub known: usize,
}

impl CorrelatedList {
    /// K between two readings (r x r'), before anything is read.
    fn between(&self, one: usize, other: usize) -> DMatrix<f64> {
        let [one, other] = [&self.readings[one], &self.readings[other]];
        let mut between = (one.by_processes).covariance(&other.by_processes, &self.kernels);
        between.gemm_tr(1.0, &one.by_unknowns, &other.by_unknowns, 1.0);
        if one.shared.0 == other.shared.0 {
            between += &one.shared.1 * other.shared.1.transpose();
        }
        between
    }

    /// K between all readings and one of them.
    fn with(&self, one: usize) -> Vec<DMatrix<f64>> {
        let all = (0..self.readings.len()).into_par_iter();
        all.map(|each| self.between(each, one)).collect()
    }
}

/// What is known of all readings where some are chosen, each of which has a place of its own in the matrices.
#[derive(Debug, Clone)]
pub struct KnownOfReadings<'a> {
    list: &'a CorrelatedList,
    /// The readings whose positions are predicted, and which of them each reading is.
    wanted: Vec<usize>,
    place_among_wanted: Vec<Option<usize>>,
    /// What is chosen, by its place.
    chosen: Vec<Option<usize>>,
    /// How often each reading is.
    times: Vec<u32>,
    /// The rows of a place.
    width: usize,
    /// K between each reading (r) and those that are chosen.
    with_chosen: Vec<DMatrix<f64>>,
    /// (K_SS + R_S)^-1.
    inverse: DMatrix<f64>,
    /// C between the wanted positions (3 w) and each reading (r).
    wanted_with: Vec<DMatrix<f64>>,
    /// C of each reading (r x r).
    own: Vec<DMatrix<f64>>,
}

impl<'a> KnownOfReadings<'a> {
    /// Before any is chosen, with room for so many; the mean square error of the positions of `wanted` is the cost.
    pub fn before(list: &'a CorrelatedList, wanted: &[usize], room: usize) -> Self {
        let count = list.readings.len();
        let rows = |each: usize| list.readings[each].new.nrows();
        let width = (0..count).map(rows).max().unwrap_or(0);
        let wanted_with = (0..count).into_par_iter().map(|each| {
            let mut block = DMatrix::zeros(3 * wanted.len(), rows(each));
            for (place, &wanted) in wanted.iter().enumerate() {
                let between = list.between(wanted, each);
                block.rows_mut(3 * place, 3).copy_from(&between.rows(0, 3));
            }
            block
        });
        let mut place_among_wanted = vec![None; count];
        for (place, &wanted) in wanted.iter().enumerate() {
            place_among_wanted[wanted] = Some(place);
        }
        Self {
            wanted_with: wanted_with.collect(),
            own: (0..count).map(|each| list.between(each, each)).collect(),
            wanted: wanted.to_vec(),
            place_among_wanted,
            chosen: vec![None; room],
            times: vec![0; count],
            with_chosen: (0..count)
                .map(|each| DMatrix::zeros(rows(each), width * room))
                .collect(),
            inverse: DMatrix::zeros(width * room, width * room),
            width,
            list,
        }
    }

    /// With some chosen.
    pub fn informed(&self, chosen: impl IntoIterator<Item = usize>) -> Option<Self> {
        let mut known = self.clone();
        for (place, each) in chosen.into_iter().enumerate() {
            known.add(place, each)?;
        }
        Some(known)
    }

    /// What is chosen, in the order of its places.
    pub fn chosen(&self) -> impl Iterator<Item = usize> {
        self.chosen.iter().copied().flatten()
    }

    /// The mean square error (m^2) of the wanted positions that are not chosen.
    pub fn cost(&self) -> f64 {
        let (sum, count) = self.unread();
        sum / count as f64
    }

    /// The same as a sum, and how many there are.
    fn unread(&self) -> (f64, usize) {
        let unread = self.wanted.iter().filter(|each| self.times[**each] == 0);
        unread.fold((0.0, 0), |(sum, count), &each| {
            (sum + self.square(each), count + 1)
        })
    }

    /// The mean square error of a reading's position (m^2).
    fn square(&self, each: usize) -> f64 {
        self.own[each].diagonal().rows(0, 3).sum()
    }

    /// The reading with which the cost is least, and that cost. Those that are wanted are chosen once at most.
    pub fn most_helpful(&self) -> Option<(usize, f64)> {
        let (sum, count) = self.unread();
        let read: Vec<usize> = (self.chosen())
            .filter_map(|each| self.place_among_wanted[each])
            .collect();
        let offered = self.list.most.par_iter().enumerate();
        let others = offered.filter_map(|(each, &most)| {
            let mine = self.place_among_wanted[each];
            let left = count - usize::from(mine.is_some());
            if self.times[each] >= most || left == 0 {
                return None;
            }
            let with = &self.wanted_with[each];
            let mut told = with.tr_mul(with);
            for &place in read.iter().chain(&mine) {
                let rows = with.fixed_rows::<3>(3 * place);
                told.gemm_tr(-1.0, &rows, &rows, 1.0);
            }
            let shown = &self.own[each] + &self.list.readings[each].new;
            let falls = Cholesky::new(shown)?.solve(&told).trace();
            let own = mine.map_or(0.0, |_| self.square(each));
            Some((each, (sum - falls - own) / left as f64))
        });
        let others: Vec<(usize, f64)> = others.collect();
        (others.into_iter()).min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// Chooses one more, at a place that is free.
    pub fn add(&mut self, place: usize, one: usize) -> Option<()> {
        let mut moved = self.list.with(one);
        let (first, rows) = (place * self.width, moved[one].ncols());
        // B K_S1, with B = (K_SS + R_S)^-1.
        let by = &self.inverse * self.with_chosen[one].transpose();
        for (each, moved) in moved.iter_mut().enumerate() {
            let to = &mut self.with_chosen[each];
            to.columns_mut(first, rows).copy_from(moved);
        }
        let from = self.with_chosen.par_iter().zip(&mut moved);
        from.for_each(|(with, moved)| moved.gemm(-1.0, with, &by, 1.0));
        let shown = &self.own[one] + &self.list.readings[one].new;
        let told = Cholesky::new(shown)?.inverse();
        self.change(&moved, &-&told);
        let beside = &by * &told;
        self.inverse.gemm(1.0, &beside, &by.transpose(), 1.0);
        (self.inverse.view_mut((0, first), (beside.nrows(), rows))).copy_from(&-&beside);
        (self.inverse.view_mut((first, 0), (rows, beside.nrows()))).copy_from(&-beside.transpose());
        (self.inverse.view_mut((first, first), (rows, rows))).copy_from(&told);
        self.chosen[place] = Some(one);
        self.times[one] += 1;
        Some(())
    }

    /// Takes the chosen one at a place away, and says which it was.
    pub fn remove(&mut self, place: usize) -> Option<usize> {
        let one = self.chosen[place].take()?;
        let (first, rows) = (place * self.width, self.own[one].nrows());
        let by = self.inverse.columns(first, rows).into_owned();
        let back = Cholesky::new(by.rows(first, rows).into_owned())?.inverse();
        let from = self.with_chosen.par_iter();
        let moved: Vec<DMatrix<f64>> = from.map(|with| with * &by).collect();
        self.change(&moved, &back);
        self.inverse.gemm(-1.0, &(&by * back), &by.transpose(), 1.0);
        self.inverse.columns_mut(first, rows).fill(0.0);
        self.inverse.rows_mut(first, rows).fill(0.0);
        for with in &mut self.with_chosen {
            with.columns_mut(first, rows).fill(0.0);
        }
        self.times[one] -= 1;
        Some(one)
    }

    /// Adds V U V^T to C.
    fn change(&mut self, moved: &[DMatrix<f64>], by: &DMatrix<f64>) {
        let mut of_wanted = DMatrix::zeros(3 * self.wanted.len(), by.nrows());
        for (place, &wanted) in self.wanted.iter().enumerate() {
            let position = moved[wanted].rows(0, 3) * by;
            of_wanted.rows_mut(3 * place, 3).copy_from(&position);
        }
        let all = self.wanted_with.par_iter_mut().zip(&mut self.own);
        all.zip(moved).for_each(|((with, own), moved)| {
            // Few columns: faster than a product of matrices.
            for (mut to, row) in with.column_iter_mut().zip(moved.row_iter()) {
                for (share, from) in row.iter().zip(of_wanted.column_iter()) {
                    to.axpy(*share, &from, 1.0);
                }
            }
            own.gemm(1.0, &(moved * by), &moved.transpose(), 1.0);
        });
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::numeric::markov::Correlation;

    /// Twenty readings.
    pub fn list() -> CorrelatedList {
        let value = |seed: usize| ((seed * 37 % 101) as f64 / 101.0) - 0.4;
        let reading = |each: usize| {
            let rows = if each.is_multiple_of(4) { 6 } else { 3 };
            let of = |first: usize| {
                move |row: usize, column: usize| value(7 * each + 3 * row + 11 * column + first)
            };
            CorrelatedReading {
                by_unknowns: DMatrix::from_fn(5, rows, of(1)),
                by_processes: ProcessPoint {
                    columns: DMatrix::from_fn(rows, 2, of(50)) * 0.5,
                    places: vec![value(each), value(5 * each + 3)],
                },
                shared: (each / 2, DMatrix::from_fn(rows, 1, of(70)) * 0.1),
                new: DMatrix::identity(rows, rows) * 0.01,
            }
        };
        CorrelatedList {
            kernels: vec![
                Kernel::exponential(0.2),
                Kernel {
                    correlation: Correlation::Matern32,
                    length: 0.3,
                    period: None,
                },
            ],
            readings: (0..20).map(reading).collect(),
            most: vec![1; 20],
            known: 0,
        }
    }

    /// The mean square error of positions that are not chosen, by one factorisation of everything.
    fn direct(list: &CorrelatedList, chosen: &[usize]) -> f64 {
        let stacked = |rows: &[usize], columns: &[usize]| {
            let rows = rows.iter().map(|&row| {
                let blocks = columns.iter().map(|&column| list.between(row, column));
                let blocks: Vec<DMatrix<f64>> = blocks.collect();
                let width = blocks.iter().map(DMatrix::ncols).sum();
                let columns = blocks.iter().flat_map(DMatrix::column_iter);
                let columns: Vec<_> = columns.collect();
                let mut all = DMatrix::zeros(blocks[0].nrows(), width);
                for (mut to, from) in all.column_iter_mut().zip(&columns) {
                    to.copy_from(from);
                }
                all.transpose()
            });
            let rows: Vec<DMatrix<f64>> = rows.collect();
            let columns: Vec<_> = rows.iter().flat_map(DMatrix::column_iter).collect();
            DMatrix::from_columns(&columns).transpose()
        };
        let mut read = stacked(chosen, chosen);
        let mut first = 0;
        for &each in chosen {
            let new = &list.readings[each].new;
            let mut block = read.view_mut((first, first), new.shape());
            block += new;
            first += new.nrows();
        }
        let factor = Cholesky::new(read).expect("regular");
        let others: Vec<usize> = (0..list.readings.len())
            .filter(|each| !chosen.contains(each))
            .collect();
        let squares = others.iter().map(|&each| {
            let with = stacked(chosen, &[each]);
            let left = list.between(each, each) - with.tr_mul(&factor.solve(&with));
            left.diagonal().rows(0, 3).sum()
        });
        squares.sum::<f64>() / others.len() as f64
    }

    /// What updates give is what a factorisation gives, and so is what one more would change.
    #[test]
    fn updates_are_factorisations() {
        let list = list();
        let wanted: Vec<usize> = (0..20).collect();
        let nothing = KnownOfReadings::before(&list, &wanted, 4);
        let mut known = nothing.informed([2, 4, 7, 11]).expect("regular");
        assert_eq!(known.remove(1), Some(4));
        let is_same = |one: f64, other: f64| (one / other - 1.0).abs() < 1e-9;
        assert!(is_same(known.cost(), direct(&list, &[2, 7, 11])));
        let (best, least) = known.most_helpful().expect("some");
        assert!(is_same(least, direct(&list, &[2, 7, 11, best])));
        for each in (0..20).filter(|each| ![2, 7, 11].contains(each)) {
            assert!(
                direct(&list, &[2, 7, 11, each]) >= least * (1.0 - 1e-9),
                "{each}"
            );
        }
    }
}
