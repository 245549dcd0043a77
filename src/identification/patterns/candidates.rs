//! What residuals may correlate with: columns of the effect of each on the readings.

use nalgebra::{DMatrix, Matrix6xX, Vector6};

use super::rows::{LookedAt, ReadingRows};

/// What numbers of readings a drift goes with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Course {
    /// Their order.
    Order,
    /// When they were read.
    Time,
    /// How warm it was.
    Temperature,
}

/// What drifts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Drifting {
    /// The robot's base in the station's frame, or a deflection as a whole: a shift.
    Base,
    /// The robot's size, or the instrument's scale.
    Size,
    /// A joint's zero; of deflections, its compliance.
    Joint(usize),
}

impl Drifting {
    /// Its word in records.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Size => "size",
            Self::Joint(_) => "joint",
        }
    }
}

/// What residuals may go with. Joints count from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Against {
    /// A joint's angle: so many waves in a revolution.
    Angle {
        /// The joint.
        joint: usize,
        /// How many waves.
        waves: usize,
    },
    /// A joint's torque.
    Torque {
        /// The joint.
        joint: usize,
    },
    /// The side from which a joint came.
    Approach {
        /// The joint.
        joint: usize,
    },
    /// Order, time or temperature.
    Course(Course, Drifting),
    /// The distance from the instrument, along the line of sight.
    Range,
}

/// So many waves in a revolution are looked for: harmonic drives have up to 160 teeth a turn, twice of which is seen.
const MOST_WAVES: usize = 360;
/// With few readings fewer: twice their number, but no less than these.
const FEWEST_WAVES: usize = 12;

/// One column of a candidate: what a base of each reading is multiplied by.
pub(super) struct PatternColumn {
    pub base: Base,
    pub factors: Vec<f64>,
}

/// What a column is a multiple of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Base {
    Moved(usize),
    Bent(usize),
    Placed(usize),
}

impl Base {
    pub fn of(self, reading: &ReadingRows) -> Vector6<f64> {
        let (rows, place): (&Matrix6xX<f64>, usize) = match self {
            Self::Moved(joint) => (&reading.moved, joint),
            Self::Bent(joint) => (&reading.bent, joint),
            Self::Placed(place) => (&reading.placed, place),
        };
        rows.column(place).into_owned()
    }
}

impl LookedAt {
    /// All that these readings can be looked at against, as far as they say anything of it.
    pub(super) fn candidates(&self) -> Vec<Against> {
        let count = self.readings.len();
        let waves = (2 * count).clamp(FEWEST_WAVES, MOST_WAVES);
        let turning = (0..self.joints.len()).filter(|&joint| self.joints[joint].1);
        let angles =
            turning.flat_map(|joint| (1..=waves).map(move |waves| Against::Angle { joint, waves }));
        let mut all: Vec<Against> = angles.collect();
        for joint in 0..self.joints.len() {
            all.push(Against::Torque { joint });
            if self.approached(joint).iter().any(|sign| *sign != 0.0) {
                all.push(Against::Approach { joint });
            }
        }
        for course in [Course::Order, Course::Time, Course::Temperature] {
            if self.course(course).iter().all(|value| *value == 0.0) {
                continue;
            }
            all.push(Against::Course(course, Drifting::Base));
            if !self.is_of_deflections {
                all.push(Against::Course(course, Drifting::Size));
            }
            let joints = 0..self.joints.len();
            all.extend(joints.map(|joint| Against::Course(course, Drifting::Joint(joint))));
        }
        if self.readings.iter().any(|each| each.range_m.is_some()) {
            all.push(Against::Range);
        }
        all
    }

    /// What a candidate does to the rows of all readings (6 N x q).
    pub(super) fn rows_of(&self, against: Against) -> DMatrix<f64> {
        let columns = self.columns(against);
        let mut rows = DMatrix::zeros(6 * self.readings.len(), columns.len());
        for (place, column) in columns.iter().enumerate() {
            for (index, reading) in self.readings.iter().enumerate() {
                let own = column.base.of(reading) * column.factors[index];
                rows.fixed_view_mut::<6, 1>(6 * index, place)
                    .copy_from(&own);
            }
        }
        rows
    }

    /// What a candidate's columns are multiples of.
    pub(super) fn columns(&self, against: Against) -> Vec<PatternColumn> {
        let of = |base: Base, factor: &dyn Fn(&ReadingRows) -> f64| PatternColumn {
            base,
            factors: self.readings.iter().map(factor).collect(),
        };
        let times = |base: Base, factors: &[f64]| PatternColumn {
            base,
            factors: factors.to_vec(),
        };
        match against {
            Against::Angle { joint, waves } => {
                let phase = |each: &ReadingRows| waves as f64 * each.angles[joint];
                let both = self.readings.iter().map(|each| phase(each).sin_cos());
                let (sines, cosines): (Vec<f64>, Vec<f64>) = both.unzip();
                [cosines, sines]
                    .map(|factors| PatternColumn {
                        base: Base::Moved(joint),
                        factors,
                    })
                    .into()
            }
            Against::Torque { joint } => {
                let torque = |each: &ReadingRows| each.torques[joint];
                let sizes = self.readings.iter().map(|each| torque(each).abs());
                let largest = sizes.fold(f64::MIN_POSITIVE, f64::max);
                let moved = Base::Moved(joint);
                if self.is_of_deflections {
                    return vec![
                        of(moved, &|each| torque(each).abs() / largest),
                        of(moved, &|each| torque(each).signum()),
                    ];
                }
                vec![
                    of(Base::Bent(joint), &|_| 1.0),
                    of(moved, &|each| {
                        torque(each) * torque(each).abs() / largest.powi(2)
                    }),
                    of(moved, &|each| torque(each).signum()),
                ]
            }
            Against::Approach { joint } => {
                vec![times(Base::Moved(joint), &self.approached(joint))]
            }
            Against::Course(course, Drifting::Base) => {
                let factors = self.course(course);
                (0..3)
                    .map(|axis| times(Base::Placed(axis), &factors))
                    .collect()
            }
            Against::Course(course, Drifting::Size) => {
                vec![times(Base::Placed(3), &self.course(course))]
            }
            Against::Course(course, Drifting::Joint(joint)) => {
                vec![times(Base::Moved(joint), &self.course(course))]
            }
            Against::Range => {
                let ranges: Vec<Option<f64>> =
                    self.readings.iter().map(|each| each.range_m).collect();
                let known: Vec<f64> = ranges
                    .iter()
                    .map(|each| f64::from(u8::from(each.is_some())))
                    .collect();
                vec![
                    times(Base::Placed(4), &known),
                    times(Base::Placed(4), &standardised(&ranges)),
                ]
            }
        }
    }

    /// The signs with which a joint was approached, their mean taken off; zero where none is known.
    fn approached(&self, joint: usize) -> Vec<f64> {
        let sign = |each: &ReadingRows| {
            let signs = each.approach.as_ref()?;
            Some(if *signs.get(joint)? { 1.0 } else { -1.0 })
        };
        standardised(&self.readings.iter().map(sign).collect::<Vec<_>>())
    }

    /// Order, time or temperature, their mean taken off, in standard deviations; zero where it is not known or always the same.
    pub(super) fn course(&self, course: Course) -> Vec<f64> {
        let readings = self.readings.iter().enumerate();
        let values: Vec<Option<f64>> = readings
            .map(|(index, each)| match course {
                Course::Order => Some(index as f64),
                Course::Time => each.time_s,
                Course::Temperature => each.temperature_c,
            })
            .collect();
        standardised(&values)
    }
}

fn standardised(values: &[Option<f64>]) -> Vec<f64> {
    let known: Vec<f64> = values.iter().copied().flatten().collect();
    let count = known.len().max(1) as f64;
    let mean = known.iter().sum::<f64>() / count;
    let square = known
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / count;
    let deviation = square.sqrt();
    let is_one = deviation <= 1e-9 * mean.abs().max(1e-9);
    let of = |value: &Option<f64>| match value {
        Some(value) if !is_one => (value - mean) / deviation,
        _ => 0.0,
    };
    values.iter().map(of).collect()
}
