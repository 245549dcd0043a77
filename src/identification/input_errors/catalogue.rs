//! The input errors that are looked for: what may be wrong, what to do about it, and how the table is read without it.

use std::f64::consts::FRAC_PI_2;
use std::fmt::Display;

use nalgebra::{DVector, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::super::frames::Sight;
use crate::measurement::Measurement;
use crate::robot::{Commands, SerialChain};

/// The standard gravity (m/s^2): one kilogram weighs 9.81 N.
const GRAVITY: f64 = 9.81;
/// Up to so many joints every set of signs is tried.
const ALL_SIGNS: usize = 7;

/// An error that a table may have.
pub(super) struct InputError {
    /// Its stable word in records.
    pub kind: &'static str,
    /// What may be wrong, a question mark, and what to do about it.
    pub words: String,
    /// Joints (indices) that turn the other way.
    pub reversed: Vec<usize>,
    /// How the table is read without it.
    pub change: Correction,
}

type Corrections<T> = Box<dyn Fn(&mut T) + Send + Sync>;
type DeflectionCorrection = Box<dyn Fn(&mut Measurement, &Matrix3<f64>) + Send + Sync>;

/// How a table is read without an error.
pub(super) enum Correction {
    /// The commanded angles (rad; m).
    Commands(Corrections<DVector<f64>>),
    /// A deflection, with the tool's axes in the world.
    Deflection(DeflectionCorrection),
    /// What was seen.
    Sight(Corrections<Sight>),
    /// The instrument was moved before this reading (from 0).
    StationMoved(usize),
}

impl InputError {
    fn new(
        kind: &'static str,
        (question, remedy): (impl Display, impl Display),
        change: Correction,
    ) -> Self {
        Self {
            kind,
            words: format!("{question}? {remedy}"),
            reversed: Vec::new(),
            change,
        }
    }

    /// What may be wrong.
    pub fn question(&self) -> &str {
        self.words.split('?').next().unwrap_or_default()
    }

    /// Commanded angles without it.
    pub fn correct_commands(&self, q: &mut DVector<f64>) {
        if let Correction::Commands(change) = &self.change {
            change(q);
        }
    }
}

fn commands(change: impl Fn(&mut DVector<f64>) + Send + Sync + 'static) -> Correction {
    Correction::Commands(Box::new(change))
}

fn deflection(
    change: impl Fn(&mut Measurement, &Matrix3<f64>) + Send + Sync + 'static,
) -> Correction {
    Correction::Deflection(Box::new(change))
}

fn seen(change: impl Fn(&mut Sight) + Send + Sync + 'static) -> Correction {
    Correction::Sight(Box::new(change))
}

/// A joint by its column and its name.
pub(super) fn named(chain: &SerialChain, joint: usize) -> String {
    let name = &chain.joints[joint].name;
    let column = Commands::from(chain).column(joint);
    column.map_or_else(|| name.clone(), |column| format!("{column} ({name})"))
}

/// Errors of commanded angles by their kinds: joints that turn the other way, the smaller sets of them first and single ones of many
/// joints; offsets; units; columns that are swapped; angles that count from the joint before.
pub(super) fn of_commands(chain: &SerialChain) -> [Vec<InputError>; 5] {
    let joints = chain.len();
    let plain = |joint: usize| Commands::from(chain).column(joint).unwrap_or_default();
    let named = |joint: usize| named(chain, joint);
    let set = |bits: usize| (0..joints).filter(|joint| bits >> joint & 1 == 1).collect();
    let mut sets: Vec<Vec<usize>> = (1..1 << joints.min(ALL_SIGNS)).map(set).collect();
    sets.sort_by_key(Vec::len);
    if joints > ALL_SIGNS {
        sets = (0..joints).map(|joint| vec![joint]).collect();
    }
    let reversed = |joints: Vec<usize>| {
        let [names, columns] = [&named as &dyn Fn(usize) -> String, &plain]
            .map(|name| joints.iter().map(|&joint| name(joint)).collect::<Vec<_>>())
            .map(|names| names.join(", "));
        let turn = if joints.len() == 1 { "turns" } else { "turn" };
        let question = format!("{names} {turn} the other way than in the model");
        let remedy = format!("Change the sign of {columns}, or of the joints' axes in the model");
        let change = {
            let joints = joints.clone();
            move |q: &mut DVector<f64>| joints.iter().for_each(|&joint| q[joint] *= -1.0)
        };
        InputError {
            reversed: joints,
            ..InputError::new("joint_signs", (question, remedy), commands(change))
        }
    };
    let offset = |joint: usize, quarters: i8| {
        let question = format!("are angles of {} counted from elsewhere", named(joint));
        let [degrees, turn] = [90.0, FRAC_PI_2].map(|quarter| f64::from(quarters) * quarter);
        let remedy = format!("Add {degrees} deg to {}", plain(joint));
        let change = commands(move |q| q[joint] += turn);
        InputError::new("joint_offset", (question, remedy), change)
    };
    let turning = || (0..joints).filter(|&joint| !chain.joints[joint].drive.slides);
    let swapped = |one: usize, other: usize| {
        let [[own, other_name], [column, other_column]] =
            [&named as &dyn Fn(usize) -> String, &plain].map(|name| [one, other].map(name));
        let question = format!("are the columns {own} and {other_name} swapped");
        let remedy = format!("Swap {column} and {other_column}");
        let change = commands(move |q| q.swap_rows(one, other));
        InputError::new("joints_swapped", (question, remedy), change)
    };
    let from_before = |joint: usize, times: f64| {
        let own = named(joint);
        let question = format!("are angles of {own} counted from the joint before it");
        let [own, before] = [joint, joint - 1].map(plain);
        let remedy = if times < 0.0 {
            format!("Subtract {before} from {own}")
        } else {
            format!("Add {before} to {own}")
        };
        let change = move |q: &mut DVector<f64>| q[joint] += times * q[joint - 1];
        InputError::new("joint_from_before", (question, remedy), commands(change))
    };
    [
        sets.into_iter().map(reversed).collect(),
        (turning().flat_map(|joint| [1, -1, 2].map(|quarters| offset(joint, quarters)))).collect(),
        units(chain),
        (0..joints)
            .flat_map(|other| (0..other).map(move |one| swapped(one, other)))
            .collect(),
        (1..joints)
            .flat_map(|joint| [1.0, -1.0].map(|times| from_before(joint, times)))
            .collect(),
    ]
}

/// Units of angles and slides.
fn units(chain: &SerialChain) -> Vec<InputError> {
    let kind_of = |joint: usize| usize::from(chain.joints[joint].drive.slides);
    // By which factors angles and slides are wrong, where they are.
    let unit = |question: &str, factors: [Option<f64>; 2]| {
        let joints = 0..chain.len();
        let remedies = (0..2).filter_map(|kind| {
            let wrong = joints.clone().filter(|&joint| kind_of(joint) == kind);
            let columns = wrong.filter_map(|joint| Commands::from(chain).column(joint));
            let columns: Vec<String> = columns.collect();
            Some(format!("{} by {:.6}", columns.join(", "), factors[kind]?))
        });
        let remedy = format!("Multiply {}", remedies.collect::<Vec<_>>().join(", "));
        let of = joints.clone().map(|joint| factors[kind_of(joint)]);
        let of: Vec<f64> = of.map(|factor| factor.unwrap_or(1.0)).collect();
        let change = move |q: &mut DVector<f64>| {
            (q.iter_mut().zip(&of)).for_each(|(value, factor)| *value *= factor);
        };
        InputError::new("angle_unit", (question, remedy), commands(change))
    };
    let degrees = 1_f64.to_degrees();
    let radians = "are the angles in radians instead of degrees";
    let twice = "were the angles converted to degrees twice";
    let metres = "are the slides in m instead of mm";
    let both = "are the angles in radians and the slides in m, instead of degrees and mm";
    let mut all = vec![
        unit(radians, [Some(degrees), None]),
        unit(twice, [Some(degrees.recip()), None]),
    ];
    if (0..chain.len()).any(|joint| kind_of(joint) == 1) {
        all.push(unit(metres, [None, Some(1e3)]));
        all.push(unit(both, [Some(degrees), Some(1e3)]));
    }
    all
}

/// What a table of measurements has: deflections of three coordinates, displacements along a direction, or both.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum RowKinds {
    Deflections,
    Displacements,
    Both,
}

impl RowKinds {
    pub fn of(measurements: &[Measurement]) -> Self {
        let along = |each: &Measurement| each.direction.is_some();
        if measurements.iter().all(along) {
            Self::Displacements
        } else if measurements.iter().any(along) {
            Self::Both
        } else {
            Self::Deflections
        }
    }

    /// Those that may be wrong together: all, or where there are both those of one instrument.
    const fn parts(self) -> &'static [Self] {
        match self {
            Self::Both => &[Self::Both, Self::Deflections, Self::Displacements],
            Self::Deflections => &[Self::Deflections],
            Self::Displacements => &[Self::Displacements],
        }
    }

    fn has(self, each: &Measurement) -> bool {
        self == Self::Both || (self == Self::Displacements) == each.direction.is_some()
    }

    /// What they are, and their columns.
    const fn words(self) -> [&'static str; 2] {
        match self {
            Self::Both => [
                "deflections and displacements",
                "dx_mm, dy_mm, dz_mm, displacement_mm",
            ],
            Self::Deflections => ["deflections", "dx_mm, dy_mm, dz_mm"],
            Self::Displacements => ["displacements", "displacement_mm"],
        }
    }
}

/// Errors of deflections and loads by their kinds: signs, units of loads and of deflections, the tool's frame, and frames of right angles,
/// which are those of three coordinates.
pub(super) fn of_deflections(rows: RowKinds) -> [Vec<InputError>; 5] {
    let signs = |part: RowKinds| {
        let [noun, columns] = part.words();
        let question = if part == rows {
            "are all signs reversed, loaded and unloaded swapped or the loads' sign".to_owned()
        } else {
            format!("are the signs of all {noun} reversed")
        };
        let along = match part {
            RowKinds::Deflections => "",
            _ => ", displacements positive along their direction",
        };
        let right = format!(
            "Deflections are loaded minus unloaded{along}; a weight has a negative fz_n where z points up: change the sign of {columns}, \
             or of the loads"
        );
        let reversed = move |each: &mut Measurement, _: &_| {
            if part.has(each) {
                turn(each, &-Matrix3::identity(), 1.0);
            }
        };
        InputError::new("signs_reversed", (question, right), deflection(reversed))
    };
    let load_unit = |(factor, what): (f64, &str)| {
        let shown = (factor * 1e3).round() / 1e3;
        let question = format!("are the loads {what}");
        let remedy = format!("Multiply fx_n to tz_nm by {shown}");
        let change = move |each: &mut Measurement, _: &_| each.load = each.load.scaled(factor);
        InputError::new("load_unit", (question, remedy), deflection(change))
    };
    let unit = |part: RowKinds, (factor, unit): (f64, &str)| {
        let [noun, columns] = part.words();
        let question = format!("are the {noun} in {unit} instead of mm");
        let remedy = format!("Multiply {columns} by {factor}");
        let change = move |each: &mut Measurement, _: &_| {
            if part.has(each) {
                each.deflection_m *= factor;
                each.sigma_m = each.sigma_m.map(|sigma| sigma * factor);
            }
        };
        InputError::new("deflection_unit", (question, remedy), deflection(change))
    };
    let in_tool_frame = |what: &str, kind, change| {
        let question = format!("are the {what} in the tool's frame instead of the world's");
        InputError::new(kind, (question, "Turn them into the world frame"), change)
    };
    let turned = deflection(|each, axes| turn(each, axes, 1.0));
    let loads = |each: &mut Measurement, axes: &Matrix3<f64>| {
        each.load.force_n = axes * each.load.force_n;
        each.load.torque_nm = axes * each.load.torque_nm;
    };
    let load_units = [
        (GRAVITY, "in kg instead of N"),
        (GRAVITY.recip(), "multiplied by 9.81 once too often"),
        (1000.0, "in kN instead of N"),
        (0.001, "1000 times too large, in mN or g"),
    ];
    let parts = rows.parts().iter();
    let units = [(1000.0, "m"), (25.4, "inches"), (0.001, "um")];
    let mut in_tool = vec![in_tool_frame(
        "loads",
        "loads_in_tool_frame",
        deflection(loads),
    )];
    let mut frames = Vec::new();
    if rows == RowKinds::Deflections {
        let own = in_tool_frame("deflections", "deflections_in_tool_frame", turned);
        in_tool.insert(0, own);
        frames.extend(right_angles().into_iter().map(in_frame));
    }
    [
        parts.clone().map(|&part| signs(part)).collect(),
        load_units.map(load_unit).into(),
        (parts.flat_map(|&part| units.map(|each| unit(part, each)))).collect(),
        in_tool,
        frames,
    ]
}

/// Deflections must be multiplied by this orthogonal matrix to be in the world frame.
pub(super) fn in_frame(matrix: Matrix3<f64>) -> InputError {
    let parity = matrix.determinant();
    let (proper, mirrored) = if parity < 0.0 {
        (-matrix, "a left-handed frame, mirrored and ")
    } else {
        (matrix, "a frame ")
    };
    let rotation = Rotation3::from_matrix_unchecked(proper);
    // Half turns have an axis, too.
    let axis_angle = UnitQuaternion::from_rotation_matrix(&rotation).axis_angle();
    let turned = axis_angle.map_or_else(String::new, |(axis, angle)| {
        let mut letters = ["x", "y", "z"].into_iter().zip(axis.iter());
        let (sign, about) = match letters.find(|(_, share)| share.abs() > 0.999) {
            Some((letter, share)) => (share.signum(), format!("the {letter} axis")),
            None => (
                1.0,
                format!("({:.2}, {:.2}, {:.2})", axis.x, axis.y, axis.z),
            ),
        };
        let degrees = sign * angle.to_degrees();
        format!("turned by {degrees:.1} deg about {about} ")
    });
    let remedy = written(&matrix, ["dx_mm", "dy_mm", "dz_mm"]);
    let question =
        format!("are the deflections in {mirrored}{turned}against the model's world frame");
    let change = deflection(move |each, _| turn(each, &matrix, parity));
    InputError::new("frame", (question, remedy), change)
}

/// Turns a deflection; rotation vectors are multiplied by `parity`, too.
fn turn(each: &mut Measurement, matrix: &Matrix3<f64>, parity: f64) {
    let turned_sigma = |sigma: Vector3<f64>| {
        let variance = matrix.component_mul(matrix) * sigma.component_mul(&sigma);
        variance.map(f64::sqrt)
    };
    each.deflection_m = matrix * each.deflection_m;
    each.sigma_m = each.sigma_m.map(turned_sigma);
    if let Some(rotation) = &mut each.rotation {
        rotation.vector_rad = matrix * rotation.vector_rad * parity;
        rotation.sigma_rad = turned_sigma(rotation.sigma_rad);
    }
}

/// The ways to put three columns in another order and change their signs, but for those that change nothing or all signs.
pub(super) fn right_angles() -> Vec<Matrix3<f64>> {
    let mut all = Vec::new();
    for (first, second) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
        let order = [first, second, 3 - first - second];
        for bits in 0..8 {
            let sign = |row: usize| if bits >> row & 1 == 1 { -1.0 } else { 1.0 };
            all.push(Matrix3::from_fn(|row, column| {
                if order[row] == column { sign(row) } else { 0.0 }
            }));
        }
    }
    all.retain(|matrix| *matrix != Matrix3::identity() && *matrix != -Matrix3::identity());
    all
}

/// By quaternions whose w, x, y and z stand in these places.
fn reordered(rotation: Rotation3<f64>, places: [usize; 4]) -> Rotation3<f64> {
    let read = UnitQuaternion::from_rotation_matrix(&rotation);
    let read = [read.w, read.i, read.j, read.k];
    let [w, x, y, z] = places.map(|place| read[place]);
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix()
}

/// Errors of what instruments show; some of orientations, where there are any.
pub(super) fn of_sights(has_rotations: bool) -> Vec<InputError> {
    let left_handed = "are the axes of the instrument left-handed";
    let remedy = "Change the sign of one column of positions, and of orientations with it";
    let mirrored = |sight: &mut Sight| {
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        sight.position_m = mirror * sight.position_m;
        sight.rotation = sight.rotation.map(|each| mirror * each * mirror);
    };
    let left_handed = InputError::new("left_handed", (left_handed, remedy), seen(mirrored));
    if !has_rotations {
        return vec![left_handed];
    }
    let turned = |kind, words: (&str, &str), change: fn(Rotation3<f64>) -> Rotation3<f64>| {
        let turned = move |sight: &mut Sight| {
            let rotation = sight.rotation.map(Rotation3::from_matrix_unchecked);
            sight.rotation = rotation.map(|each| change(each).into_inner());
        };
        InputError::new(kind, words, seen(turned))
    };
    let inverted = "are the orientations inverted, from the instrument to the target";
    let quaternion = (
        "are the quaternions in another order (x, y, z, w for w, x, y, z)",
        "Put the columns qw to qz in theirs",
    );
    let euler = (
        "are the Euler angles in the other order (z y x for x y z, or about fixed axes)",
        "Change rotation.convention in the mapping",
    );
    let mut all = vec![
        turned("rotations_inverted", (inverted, "Invert them"), |each| {
            each.inverse()
        }),
        turned("quaternion_order", quaternion, |each| {
            reordered(each, [3, 0, 1, 2])
        }),
        turned("quaternion_order", quaternion, |each| {
            reordered(each, [1, 2, 3, 0])
        }),
        turned("euler_order", euler, |each| {
            // About fixed axes x, y, z is about those that turn along z, y, x.
            let (x, y, z) = each.euler_angles();
            let about = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle);
            about(Vector3::x(), x) * about(Vector3::y(), y) * about(Vector3::z(), z)
        }),
        turned("euler_order", euler, |each| {
            let (x, y, z) = each.inverse().euler_angles();
            Rotation3::from_euler_angles(-x, -y, -z)
        }),
        left_handed,
    ];
    // Two columns or one sign: orientations say along which axes, the base's frame takes the rest.
    let mut columns = [Matrix3::identity(); 6];
    for (axis, [one, other]) in [[0, 1], [0, 2], [1, 2]].into_iter().enumerate() {
        columns[axis][(axis, axis)] = -1.0;
        columns[3 + axis].swap_rows(one, other);
    }
    all.extend(columns.map(|matrix| {
        let remedy = written(&matrix, ["x_mm", "y_mm", "z_mm"]);
        let question = "are the columns of positions swapped or of another sign";
        let moved = move |sight: &mut Sight| sight.position_m = matrix * sight.position_m;
        InputError::new("position_columns", (question, remedy), seen(moved))
    }));
    all
}

/// The instrument was moved before this reading (from 0).
pub(super) fn station_moved(reading: usize) -> InputError {
    let question = format!("was the instrument moved before reading {}", reading + 1);
    let remedy = "Give the readings from there on a station of their own";
    let change = Correction::StationMoved(reading);
    InputError::new("station_moved", (question, remedy), change)
}

/// How columns follow from those of the file.
fn written(matrix: &Matrix3<f64>, columns: [&str; 3]) -> String {
    let term = |(value, column): (&f64, &str)| match *value {
        value if value.abs() <= 5e-5 => None,
        value if (value - 1.0).abs() < 1e-12 => Some(column.to_owned()),
        value if (value + 1.0).abs() < 1e-12 => Some(format!("-{column}")),
        value => Some(format!("{value:.4} {column}")),
    };
    let line = |row: usize| {
        let terms = matrix.row(row).into_owned();
        let terms: Vec<String> = terms.iter().zip(columns).filter_map(term).collect();
        format!("{} = {}", columns[row], terms.join(" + "))
    };
    format!("Write {}", [0, 1, 2].map(line).join(", "))
}
