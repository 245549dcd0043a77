//! An input error in words.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::{GRAVITY, InputError};
use crate::robot::{Commands, SerialChain};

/// An error of deflections, which others are as likely, and the weighted residuals without it and as read (rms).
pub(super) fn of_deflections(
    chain: &SerialChain,
    error: &InputError,
    others: &[&InputError],
    [without, as_read]: [f64; 2],
) -> String {
    let mut text = format!(
        "{}. Weighted residuals with nominal compliances as prior: {without:.3} so, {as_read:.3} as read (rms)",
        error.advice(chain)
    );
    if !others.is_empty() {
        let names = others.iter().take(2).map(|other| other.question(chain));
        text += &format!(". As likely: {}", names.collect::<Vec<_>>().join("; "));
    }
    text
}

/// A joint by its column and its name.
pub(super) fn column(chain: &SerialChain, joint: usize) -> String {
    let name = &chain.joints[joint].name;
    match Commands::from(chain).column(joint) {
        Some(column) => format!("{column} ({name})"),
        None => name.clone(),
    }
}

impl InputError {
    /// Its stable word in records.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::SignsReversed => "signs_reversed",
            Self::LoadUnit(_) => "load_unit",
            Self::DeflectionUnit(_) => "deflection_unit",
            Self::AngleUnit(_) => "angle_unit",
            Self::JointSigns(_) => "joint_signs",
            Self::JointsSwapped(_) => "joints_swapped",
            Self::JointOffset(..) => "joint_offset",
            Self::JointFromBefore(..) => "joint_from_before",
            Self::Frame(_) => "frame",
            Self::DeflectionsInToolFrame => "deflections_in_tool_frame",
            Self::LoadsInToolFrame => "loads_in_tool_frame",
            Self::LeftHanded => "left_handed",
            Self::PositionColumns(_) => "position_columns",
            Self::RotationsInverted => "rotations_inverted",
            Self::QuaternionOrder(_) => "quaternion_order",
            Self::EulerOrder => "euler_order",
            Self::StationMoved(_) => "station_moved",
        }
    }

    /// What may be wrong, and what to do about it.
    pub(super) fn advice(&self, chain: &SerialChain) -> String {
        format!("{}? {}", self.question(chain), self.remedy(chain))
    }

    fn question(&self, chain: &SerialChain) -> String {
        let column = |joint: usize| column(chain, joint);
        let plain = match self {
            Self::SignsReversed => {
                "are all signs reversed, loaded and unloaded swapped or the loads' sign"
            }
            Self::LoadUnit(factor) if *factor > GRAVITY => "are the loads in kN instead of N",
            Self::LoadUnit(factor) if *factor > 1.0 => "are the loads in kg instead of N",
            Self::LoadUnit(factor) if *factor < GRAVITY.recip() => {
                "are the loads 1000 times too large, in mN or g"
            }
            Self::LoadUnit(_) => "are the loads multiplied by 9.81 once too often",
            Self::DeflectionUnit(factor) if *factor > 1.0 => {
                "are the deflections in m instead of mm"
            }
            Self::DeflectionUnit(_) => "are the deflections in um instead of mm",
            Self::AngleUnit(factor) if *factor > 1.0 => {
                "are the angles in radians instead of degrees"
            }
            Self::AngleUnit(_) => "were the angles converted to degrees twice",
            Self::DeflectionsInToolFrame => {
                "are the deflections in the tool's frame instead of the world's"
            }
            Self::LoadsInToolFrame => "are the loads in the tool's frame instead of the world's",
            Self::LeftHanded => "are the axes of the instrument left-handed",
            Self::PositionColumns(_) => "are the columns of positions swapped or of another sign",
            Self::RotationsInverted => {
                "are the orientations inverted, from the instrument to the target"
            }
            Self::QuaternionOrder(_) => {
                "are the quaternions in another order (x, y, z, w for w, x, y, z)"
            }
            Self::EulerOrder => {
                "are the Euler angles in the other order (z y x for x y z, or about fixed axes)"
            }
            Self::JointSigns(joints) => {
                let names: Vec<String> = joints.iter().map(|&joint| column(joint)).collect();
                let turn = if joints.len() == 1 { "turns" } else { "turn" };
                let names = names.join(", ");
                return format!("{names} {turn} the other way than in the model");
            }
            Self::JointsSwapped([one, other]) => {
                return format!(
                    "are the columns {} and {} swapped",
                    column(*one),
                    column(*other)
                );
            }
            Self::JointOffset(joint, _) => {
                return format!("are angles of {} counted from elsewhere", column(*joint));
            }
            Self::JointFromBefore(joint, _) => {
                let column = column(*joint);
                return format!("are angles of {column} counted from the joint before it");
            }
            Self::Frame(matrix) => return format!("are the deflections in {}", frame(matrix)),
            Self::StationMoved(reading) => {
                return format!("was the instrument moved near reading {}", reading + 1);
            }
        };
        plain.to_owned()
    }

    fn remedy(&self, chain: &SerialChain) -> String {
        let column = |joint: usize| Commands::from(chain).column(joint).unwrap_or_default();
        let plain = match self {
            Self::SignsReversed => {
                "Deflections are loaded minus unloaded; a weight has a negative fz_n where z points up: \
                 change the sign of dx_mm, dy_mm, dz_mm, or of the loads"
            }
            Self::DeflectionsInToolFrame | Self::LoadsInToolFrame => {
                "Turn them into the world frame"
            }
            Self::LeftHanded => {
                "Change the sign of one column of positions, and of orientations with it"
            }
            Self::RotationsInverted => "Invert them",
            Self::QuaternionOrder(_) => "Put the columns qw to qz in theirs",
            Self::EulerOrder => "Change axes or about in the mapping",
            Self::StationMoved(_) => "Give the readings from there on a station of their own",
            Self::LoadUnit(factor) if *factor < 1.0 => {
                return format!("Multiply fx_n to tz_nm by {factor:.3}");
            }
            Self::LoadUnit(factor) => return format!("Multiply fx_n to tz_nm by {factor}"),
            Self::DeflectionUnit(factor) => {
                return format!("Multiply dx_mm, dy_mm, dz_mm by {factor}");
            }
            Self::AngleUnit(factor) => {
                let mut angles = Commands::from(chain).columns();
                angles.retain(|column| column.ends_with("_deg"));
                return format!("Multiply {} by {factor:.6}", angles.join(", "));
            }
            Self::JointSigns(joints) => {
                let columns: Vec<String> = joints.iter().map(|&joint| column(joint)).collect();
                return format!(
                    "Change the sign of {}, or of the joints' axes in the model",
                    columns.join(", ")
                );
            }
            Self::JointsSwapped([one, other]) => {
                return format!("Swap {} and {}", column(*one), column(*other));
            }
            Self::JointOffset(joint, quarters) => {
                return format!(
                    "Add {} deg to {}",
                    90 * i32::from(*quarters),
                    column(*joint)
                );
            }
            Self::JointFromBefore(joint, times) => {
                let [own, before] = [*joint, joint - 1].map(column);
                return if *times < 0.0 {
                    format!("Subtract {before} from {own}")
                } else {
                    format!("Add {before} to {own}")
                };
            }
            Self::Frame(matrix) => return written(matrix, ["dx_mm", "dy_mm", "dz_mm"]),
            Self::PositionColumns(matrix) => return written(matrix, ["x_mm", "y_mm", "z_mm"]),
        };
        plain.to_owned()
    }
}

/// The frame from which a matrix leads to the world frame.
fn frame(matrix: &Matrix3<f64>) -> String {
    let (proper, mirrored) = if matrix.determinant() < 0.0 {
        (-matrix, "a left-handed frame, mirrored and ")
    } else {
        (*matrix, "a frame ")
    };
    let rotation = Rotation3::from_matrix_unchecked(proper);
    let turned = UnitQuaternion::from_rotation_matrix(&rotation)
        .axis_angle()
        .map_or_else(String::new, |(axis, angle)| {
            let mut letters = ["x", "y", "z"].into_iter().zip(axis.iter());
            let (sign, about) = match letters.find(|(_, share)| share.abs() > 0.999) {
                Some((letter, share)) => (share.signum(), format!("the {letter} axis")),
                None => (
                    1.0,
                    format!("({:.2}, {:.2}, {:.2})", axis.x, axis.y, axis.z),
                ),
            };
            format!(
                "turned by {:.1} deg about {about} ",
                sign * angle.to_degrees()
            )
        });
    format!("{mirrored}{turned}against the model's world frame")
}

/// How columns follow from those of the file.
fn written(matrix: &Matrix3<f64>, columns: [&str; 3]) -> String {
    let term = |(value, column): (&f64, &str)| match *value {
        value if value.abs() <= 5e-5 => None,
        value if (value.abs() - 1.0).abs() < 1e-12 => {
            let sign = if value < 0.0 { "-" } else { "" };
            Some(format!("{sign}{column}"))
        }
        value => Some(format!("{value:.4} {column}")),
    };
    let line = |row: usize| {
        let terms = matrix.row(row).into_owned();
        let terms: Vec<String> = terms.iter().zip(columns).filter_map(term).collect();
        format!("{} = {}", columns[row], terms.join(" + "))
    };
    format!("Write {}, {}, {}", line(0), line(1), line(2))
}
