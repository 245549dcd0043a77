//! Likely input errors: how readings would have to be read for frames alone to explain them.
//!
//! Geometry may take up a joint's sign or a quarter of a turn as if a maker could have built it. Frames cannot: as it is read, a right table is off by
//! what robots are off by, a wrong one by much more. An input error is named where reading the table without it leaves a quarter at most.

use nalgebra::{DVector, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::super::frames::{MountedFrames, RobustFrames, Sight, median_or_zero, reach};
use super::AbsoluteCase;
use crate::codes::{Condition, ConditionCode};

/// Frames alone leave less than this share of how far positions reach, whatever robot it is.
const LOOKED_AT: f64 = 5e-3;
/// An input error explains a table where no more than this share is left without it.
const EXPLAINS: f64 = 0.25;
/// Of two errors the one of fewer joints, unless another one leaves less than this share of what it leaves.
const CLEARLY: f64 = 0.5;
/// So many readings are enough to see it.
const ENOUGH: usize = 80;
/// Stations may have been changed after so many parts of the table.
const PARTS: usize = 8;
/// Up to so many joints every set of signs is tried.
const ALL_SIGNS: usize = 7;

/// How the columns of positions are called.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Changes commanded angles.
type CommandChange = dyn Fn(&mut DVector<f64>) + Send + Sync;
/// Changes what was seen, by its place.
type SightChange = dyn Fn(usize, &mut Sight) + Send + Sync;

/// How readings would have to be read.
enum Reread {
    /// The commanded angles.
    Commands(Box<CommandChange>),
    /// What was seen, by its place.
    Sights(Box<SightChange>),
}

/// A way in which a table may be wrong, with what to do about it.
struct InputError {
    reread: Reread,
    words: String,
}

/// An error of the joint angles.
fn commands(
    words: String,
    reread: impl Fn(&mut DVector<f64>) + Send + Sync + 'static,
) -> InputError {
    let reread = Reread::Commands(Box::new(reread));
    InputError { reread, words }
}

/// An error of what was seen.
fn sights(words: String, reread: impl Fn(usize, &mut Sight) + Send + Sync + 'static) -> InputError {
    let reread = Reread::Sights(Box::new(reread));
    InputError { reread, words }
}

/// An error of the orientations.
fn rotations(
    words: &str,
    reread: impl Fn(&Rotation3<f64>) -> Rotation3<f64> + Send + Sync + 'static,
) -> InputError {
    sights(words.to_owned(), move |_, sight| {
        let read = sight.rotation.map(Rotation3::from_matrix_unchecked);
        sight.rotation = read.map(|read| reread(&read).into_inner());
    })
}

impl AbsoluteCase<'_> {
    /// The input error that explains why frames alone do not explain the readings; none where they do, or where none explains it.
    pub fn likely_input_error(&self) -> Option<Condition> {
        let step = self.observations.len().div_ceil(ENOUGH).max(1);
        let some = self.part_of(|index| index % step == 0);
        let sights = some.sights();
        let robust = RobustFrames::guessed(&sights, some.stations.len(), &some.link_from_tools());
        let as_it_is_m = robust.median_m;
        if as_it_is_m <= LOOKED_AT * reach(&sights) {
            return None;
        }
        // Where positions hardly differ, whatever makes the robot's hardly differ would leave little of them.
        let explained_m = EXPLAINS * as_it_is_m.min(reach(&sights));
        let explaining = |errors| {
            some.best_of(errors)
                .filter(|(_, left_m)| *left_m <= explained_m)
        };
        let (error, left_m) =
            explaining(some.simple_errors(step)).or_else(|| explaining(some.sets_of_signs()))?;
        Some(ConditionCode::InputError.with(format!(
            "likely input error: {} Residuals of frames alone: {:.2} mm so, {:.2} mm as read (medians)",
            error.words,
            left_m * 1e3,
            as_it_is_m * 1e3
        )))
    }

    /// The error without which the least is left; an earlier one unless a later one is clearly better.
    fn best_of(&self, errors: Vec<InputError>) -> Option<(InputError, f64)> {
        let left: Vec<f64> = (errors.par_iter())
            .map(|error| self.left_without(error))
            .collect();
        let better = |best: (InputError, f64), next: (InputError, f64)| {
            if next.1 < CLEARLY * best.1 {
                next
            } else {
                best
            }
        };
        errors.into_iter().zip(left).reduce(better)
    }

    /// What frames alone leave of the readings without an error (m, a median, with rotations as lengths).
    fn left_without(&self, error: &InputError) -> f64 {
        let sights = match &error.reread {
            Reread::Commands(reread) => {
                let mut case = self.clone();
                for each in &mut case.observations {
                    reread(&mut each.setup.commanded_rad);
                }
                case.sights()
            }
            Reread::Sights(reread) => {
                let mut sights = self.sights();
                let each = sights.iter_mut().enumerate();
                each.for_each(|(place, sight)| reread(place, sight));
                sights
            }
        };
        let stations = sights.iter().map(|sight| sight.station + 1);
        let stations = stations.fold(self.stations.len(), usize::max);
        let frames = MountedFrames::guessed(&sights, stations, &self.link_from_tools());
        let left = |sight: &Sight| frames.square(sight).sqrt();
        median_or_zero(sights.iter().map(left).collect())
    }

    /// All but signs of several joints; of the readings every so many are looked at.
    fn simple_errors(&self, step: usize) -> Vec<InputError> {
        let joints = &self.arm.chain.joints;
        let name = |joint: usize| &joints[joint].name;
        let mut all: Vec<InputError> = (0..joints.len())
            .map(|joint| self.signs(vec![joint]))
            .collect();
        for joint in (0..joints.len()).filter(|&joint| !joints[joint].drive.slides) {
            all.extend([1, -1, 2].map(|quarters| {
                let words = format!(
                    "are angles of {} counted from elsewhere? Add {} deg to q{}.",
                    name(joint),
                    90 * quarters,
                    joint + 1
                );
                let angle = f64::from(quarters) * std::f64::consts::FRAC_PI_2;
                commands(words, move |q| q[joint] += angle)
            }));
        }
        let mut readings = self.observations.iter();
        let has_rotations = readings.any(|each| each.reading.kind().rows() == 6);
        if has_rotations {
            all.extend(errors_of_rotations());
        }
        let words = "are the axes of the instrument left-handed? Change the sign of one column of positions, and of orientations with it.";
        all.push(sights(words.to_owned(), |_, sight| {
            let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
            sight.position_m = mirror * sight.position_m;
            sight.rotation = sight.rotation.map(|each| mirror * each * mirror);
        }));
        if has_rotations {
            // Two columns or one sign: orientations say along which axes, the base's frame takes the rest.
            all.extend([0, 1, 2].map(|axis| {
                let words = format!("is the sign of {}_mm wrong? Change it.", AXES[axis]);
                sights(words, move |_, sight| sight.position_m[axis] *= -1.0)
            }));
            all.extend([[0, 1], [0, 2], [1, 2]].map(|[one, other]| {
                let words = format!(
                    "are {0}_mm and {1}_mm swapped? Swap them.",
                    AXES[one], AXES[other]
                );
                sights(words, move |_, sight| {
                    sight.position_m.swap_rows(one, other);
                })
            }));
        }
        let degrees = 1_f64.to_degrees();
        for (factor, is, not) in [(degrees, "rad", "deg"), (degrees.recip(), "deg", "rad")] {
            let words = format!("are the joint angles in {is} where {not} are read?");
            all.push(commands(words, move |q| *q *= factor));
        }
        for other in 0..joints.len() {
            all.extend((0..other).map(|one| {
                let words = format!(
                    "are the columns of {} and {} swapped? Swap q{} and q{}.",
                    name(one),
                    name(other),
                    one + 1,
                    other + 1
                );
                commands(words, move |q| q.swap_rows(one, other))
            }));
        }
        for joint in 1..joints.len() {
            let both = [(1.0, "Add", "to"), (-1.0, "Subtract", "from")];
            all.extend(both.map(|(sign, how, to)| {
                let words = format!(
                    "are angles of {} counted from the joint before it? {how} q{joint} {to} q{}.",
                    name(joint),
                    joint + 1
                );
                commands(words, move |q| q[joint] += sign * q[joint - 1])
            }));
        }
        let stations = self.stations.len();
        all.extend((1..PARTS).map(|part| {
            let from = part * self.observations.len() / PARTS;
            let words = format!(
                "was the instrument moved near reading {}? Give the readings from there on a station of their own.",
                from * step + 1
            );
            sights(words, move |place, sight| {
                sight.station += if place >= from { stations } else { 0 };
            })
        }));
        all
    }

    /// Joints that turn the other way.
    fn signs(&self, joints: Vec<usize>) -> InputError {
        let names: Vec<&str> = (joints.iter())
            .map(|&joint| self.arm.chain.joints[joint].name.as_str())
            .collect();
        let columns: Vec<String> = joints
            .iter()
            .map(|joint| format!("q{}", joint + 1))
            .collect();
        let words = format!(
            "do angles of {} count the other way? Change the sign of {}.",
            names.join(", "),
            columns.join(", ")
        );
        commands(words, move |q| {
            for &joint in &joints {
                q[joint] *= -1.0;
            }
        })
    }

    /// Signs of two joints and more, the smaller sets first.
    fn sets_of_signs(&self) -> Vec<InputError> {
        let joints = self.arm.chain.len();
        if joints > ALL_SIGNS {
            return Vec::new();
        }
        let mut sets: Vec<Vec<usize>> = (1_usize..1 << joints)
            .map(|bits| (0..joints).filter(|joint| bits >> joint & 1 == 1).collect())
            .filter(|set: &Vec<usize>| set.len() > 1)
            .collect();
        sets.sort_by_key(Vec::len);
        sets.into_iter().map(|set| self.signs(set)).collect()
    }
}

/// Of orientations alone.
fn errors_of_rotations() -> Vec<InputError> {
    let inverted = "are the orientations inverted, from the instrument to the target? Invert them.";
    let mut all = vec![rotations(inverted, Rotation3::inverse)];
    // The places of w, x, y and z among what was read as these.
    all.extend([[3, 0, 1, 2], [1, 2, 3, 0]].map(|places: [usize; 4]| {
        let words = "are the quaternions in another order (x, y, z, w for w, x, y, z)? Put the columns qw to qz in theirs.";
        rotations(words, move |rotation| {
            let read = UnitQuaternion::from_rotation_matrix(rotation);
            let read = [read.w, read.i, read.j, read.k];
            let [w, x, y, z] = places.map(|place| read[place]);
            let turned = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            turned.to_rotation_matrix()
        })
    }));
    let order = "are the Euler angles in the other order (z y x for x y z, or about fixed axes)? Change axes or about in the mapping.";
    all.push(rotations(order, |rotation| {
        // About fixed axes x, y, z is about those that turn along z, y, x.
        let (x, y, z) = rotation.euler_angles();
        let about = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle);
        about(Vector3::x(), x) * about(Vector3::y(), y) * about(Vector3::z(), z)
    }));
    all
}
