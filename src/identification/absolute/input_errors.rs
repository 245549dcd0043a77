//! Likely input errors: how readings would have to be read for frames alone to explain them.
//!
//! Geometry may take up a joint's sign or a quarter of a turn as if a maker could have built it. Frames cannot: as it is read, a right table is off by
//! what robots are off by, a wrong one by much more. An input error is named where reading the table without it leaves a quarter at most.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
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

/// A way in which a table may be wrong.
#[derive(Debug, Clone, PartialEq)]
enum InputError {
    /// Joints that turn the other way.
    Signs(Vec<usize>),
    /// A joint that is counted from elsewhere, by quarters of a turn.
    Quarters(usize, i8),
    /// Two joints' columns.
    Swapped(usize, usize),
    /// A joint whose angle is counted from the one before it, or not.
    Coupled(usize, f64),
    /// All angles in another unit.
    AngleUnit(f64),
    /// From the target's to the instrument's frame, or the other way round.
    Inverted,
    /// Quaternions in another order: the places of w, x, y and z among what was read as these.
    Quaternion([usize; 4]),
    /// Angles about x and z taken for one another.
    EulerOrder,
    /// Left-handed axes.
    Mirrored,
    /// One column of positions with the wrong sign, orientations right.
    Sign(usize),
    /// Two columns of positions swapped, orientations right.
    Columns([usize; 2]),
    /// From this reading on another station.
    Station(usize),
}

impl AbsoluteCase<'_> {
    /// The input error that explains why frames alone do not explain the readings; none where they do, or where none explains it.
    pub fn likely_input_error(&self) -> Option<Condition> {
        let step = self.observations.len().div_ceil(ENOUGH).max(1);
        let some = self.part_of(|index| index % step == 0);
        let sights = some.sights();
        let robust = RobustFrames::guessed(&sights, some.stations.len(), &some.tools());
        if robust.median_m <= LOOKED_AT * reach(&sights) {
            return None;
        }
        let as_it_is_m = robust.median_m;
        // Where positions hardly differ, whatever makes the robot's hardly differ would leave little of them.
        let explained_m = EXPLAINS * as_it_is_m.min(reach(&sights));
        let found = some
            .best_of(some.simple_errors())
            .filter(|(_, left_m)| *left_m <= explained_m);
        let found = found.or_else(|| {
            some.best_of(some.sets_of_signs())
                .filter(|(_, left_m)| *left_m <= explained_m)
        });
        let (error, left_m) = found?;
        Some(ConditionCode::InputError.with(format!(
            "likely input error: {} Residuals of frames alone: {:.2} mm so, {:.2} mm as read (medians)",
            some.words(&error, step),
            left_m * 1e3,
            as_it_is_m * 1e3
        )))
    }

    fn tools(&self) -> Vec<nalgebra::Isometry3<f64>> {
        self.arm
            .tools
            .iter()
            .map(|tool| tool.link_from_tool)
            .collect()
    }

    /// The error without which the least is left; an earlier one unless a later one is clearly better.
    fn best_of(&self, errors: Vec<InputError>) -> Option<(InputError, f64)> {
        let left: Vec<f64> = errors
            .par_iter()
            .map(|error| self.left_without(error))
            .collect();
        errors.into_iter().zip(left).reduce(|best, next| {
            if next.1 < CLEARLY * best.1 {
                next
            } else {
                best
            }
        })
    }

    /// What frames alone leave of the readings without an error (m, a median, with rotations as lengths).
    fn left_without(&self, error: &InputError) -> f64 {
        let mut case = self.clone();
        for each in &mut case.observations {
            let q = &mut each.setup.commanded_rad;
            match error {
                InputError::Signs(joints) => joints.iter().for_each(|&joint| q[joint] *= -1.0),
                InputError::Quarters(joint, quarters) => {
                    q[*joint] += f64::from(*quarters) * std::f64::consts::FRAC_PI_2;
                }
                InputError::Swapped(one, other) => q.swap_rows(*one, *other),
                InputError::Coupled(joint, sign) => q[*joint] += sign * q[*joint - 1],
                InputError::AngleUnit(factor) => *q *= *factor,
                _ => {}
            }
        }
        let mut sights = case.sights();
        let mut stations = self.stations.len();
        for (place, sight) in sights.iter_mut().enumerate() {
            match error {
                InputError::Station(from) if place >= *from => sight.station += self.stations.len(),
                InputError::Mirrored => {
                    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
                    sight.position_m = mirror * sight.position_m;
                    sight.rotation = sight.rotation.map(|each| mirror * each * mirror);
                }
                InputError::Sign(axis) => sight.position_m[*axis] *= -1.0,
                InputError::Columns([one, other]) => sight.position_m.swap_rows(*one, *other),
                _ => sight.rotation = sight.rotation.map(|each| reread(error, &each)),
            }
        }
        if matches!(error, InputError::Station(_)) {
            stations *= 2;
        }
        let frames = MountedFrames::guessed(&sights, stations, &self.tools());
        let left = |sight: &Sight| frames.square(sight).sqrt();
        median_or_zero(sights.iter().map(left).collect())
    }

    fn simple_errors(&self) -> Vec<InputError> {
        let joints = self.arm.chain.len();
        let turns = |joint: &usize| !self.arm.chain.joints[*joint].drive.slides;
        let mut all: Vec<InputError> = (0..joints)
            .map(|joint| InputError::Signs(vec![joint]))
            .collect();
        for joint in (0..joints).filter(turns) {
            all.extend([1, -1, 2].map(|quarters| InputError::Quarters(joint, quarters)));
        }
        let has_rotations = self
            .observations
            .iter()
            .any(|each| each.reading.kind().rows() == 6);
        if has_rotations {
            all.push(InputError::Inverted);
            all.extend([[3, 0, 1, 2], [1, 2, 3, 0]].map(InputError::Quaternion));
            all.push(InputError::EulerOrder);
        }
        all.push(InputError::Mirrored);
        if has_rotations {
            // Two columns or one sign: orientations say along which axes, the base's frame takes the rest.
            all.extend((0..3).map(InputError::Sign));
            all.extend([[0, 1], [0, 2], [1, 2]].map(InputError::Columns));
        }
        let degrees = 1_f64.to_degrees();
        all.extend([degrees, degrees.recip()].map(InputError::AngleUnit));
        all.extend(
            (0..joints).flat_map(|one| (0..one).map(move |other| InputError::Swapped(other, one))),
        );
        all.extend(
            (1..joints).flat_map(|joint| [1.0, -1.0].map(|sign| InputError::Coupled(joint, sign))),
        );
        let count = self.observations.len();
        all.extend((1..PARTS).map(|part| InputError::Station(part * count / PARTS)));
        all
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
        sets.into_iter().map(InputError::Signs).collect()
    }

    fn words(&self, error: &InputError, step: usize) -> String {
        let name = |joint: usize| &self.arm.chain.joints[joint].name;
        match error {
            InputError::Signs(joints) => {
                let names: Vec<&str> = joints.iter().map(|&joint| name(joint).as_str()).collect();
                let columns: Vec<String> = joints.iter().map(|joint| format!("q{}", joint + 1)).collect();
                format!("do angles of {} count the other way? Change the sign of {}.", names.join(", "), columns.join(", "))
            }
            InputError::Quarters(joint, quarters) => format!(
                "are angles of {} counted from elsewhere? Add {} deg to q{}.",
                name(*joint),
                90 * i32::from(*quarters),
                joint + 1
            ),
            InputError::Swapped(one, other) => format!(
                "are the columns of {} and {} swapped? Swap q{} and q{}.",
                name(*one),
                name(*other),
                one + 1,
                other + 1
            ),
            InputError::Coupled(joint, sign) => format!(
                "are angles of {} counted from the joint before it? {} q{joint} {} q{}.",
                name(*joint),
                if *sign > 0.0 { "Add" } else { "Subtract" },
                if *sign > 0.0 { "to" } else { "from" },
                joint + 1
            ),
            InputError::AngleUnit(factor) => {
                let [is, not] = if *factor > 1.0 { ["rad", "deg"] } else { ["deg", "rad"] };
                format!("are the joint angles in {is} where {not} are read?")
            }
            InputError::Inverted => "are the orientations inverted, from the instrument to the target? Invert them.".to_owned(),
            InputError::Quaternion(_) => {
                "are the quaternions in another order (x, y, z, w for w, x, y, z)? Put the columns qw to qz in theirs.".to_owned()
            }
            InputError::EulerOrder => {
                "are the Euler angles in the other order (z y x for x y z, or about fixed axes)? Change axes or about in the mapping.".to_owned()
            }
            InputError::Mirrored => "are the axes of the instrument left-handed? Change the sign of one column of positions, and of orientations with it.".to_owned(),
            InputError::Sign(axis) => format!("is the sign of {}_mm wrong? Change it.", AXES[*axis]),
            InputError::Columns([one, other]) => {
                format!("are {0}_mm and {1}_mm swapped? Swap them.", AXES[*one], AXES[*other])
            }
            InputError::Station(from) => format!(
                "was the instrument moved near reading {}? Give the readings from there on a station of their own.",
                from * step + 1
            ),
        }
    }
}

/// An orientation as it would have been read without an error.
fn reread(error: &InputError, rotation: &Matrix3<f64>) -> Matrix3<f64> {
    match error {
        InputError::Inverted => rotation.transpose(),
        InputError::Quaternion(places) => {
            let read =
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
            let read = [read.w, read.i, read.j, read.k];
            let [w, x, y, z] = places.map(|place| read[place]);
            let turned = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            turned.to_rotation_matrix().into_inner()
        }
        InputError::EulerOrder => {
            // About fixed axes x, y, z is about those that turn along z, y, x.
            let (x, y, z) = Rotation3::from_matrix_unchecked(*rotation).euler_angles();
            let about = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle);
            (about(Vector3::x(), x) * about(Vector3::y(), y) * about(Vector3::z(), z)).into_inner()
        }
        _ => *rotation,
    }
}
