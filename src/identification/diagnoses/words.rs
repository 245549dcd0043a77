//! A diagnosis in words.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::hypotheses::{GRAVITY, Hypothesis};
use super::{Case, Identification, Mistake};
use crate::robot::{Commands, Joint};

/// So many pairs of rows are listed.
const LISTED: usize = 5;

/// What the file itself shows.
pub fn fact(case: &Case<'_>, mistake: &Mistake) -> String {
    match mistake {
        Mistake::AnglesOutsideRange {
            measurements,
            measurement,
            joint,
            angle_rad,
        } => {
            let Joint {
                range_rad: [from, to],
                drive,
                ..
            } = case.nominal.chain.joints[*joint];
            let [(angle, unit), (from, _), (to, _)] =
                [*angle_rad, from, to].map(|value| drive.shown(value));
            format!(
                "{measurements} of {} measurements have commanded angles outside the joint limits: \
                 {} of measurement {} is {angle:.1} {unit}, allowed are {from:.1} to {to:.1} {unit}",
                case.measurements.len(),
                column(case, *joint),
                measurement + 1,
            )
        }
        Mistake::IdenticalRows(pairs) => format!(
            "equal rows, with the same reading to the last digit: {}",
            listed(pairs)
        ),
        Mistake::IdenticalReadings(pairs) => format!(
            "the same reading to the last digit at different angles or loads: {}",
            listed(pairs)
        ),
        other => name(case, other),
    }
}

fn listed(pairs: &[[usize; 2]]) -> String {
    let text = |[one, other]: &[usize; 2]| format!("{} and {}", one + 1, other + 1);
    let first: Vec<String> = pairs.iter().take(LISTED).map(text).collect();
    let more = match pairs.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("measurements {}{more}", first.join(", "))
}

/// The likeliest mistake, what it would change, and which others are as probable.
pub fn likely(
    case: &Case<'_>,
    best: &[(Hypothesis, f64)],
    before: Option<&Identification>,
    after: Option<&Identification>,
) -> String {
    let Some((first, others)) = best.split_first() else {
        return String::new();
    };
    let mistake = &first.0.mistake;
    let mut text = format!("{}? {}", name(case, mistake), remedy(case, mistake));
    if let Some(after) = after {
        text += &format!(". Then {}", outcome(case, after));
        text += &match before {
            Some(before) => format!("; as read, {}", outcome(case, before)),
            None => "; as read, nothing can be identified".to_owned(),
        };
    }
    if !others.is_empty() {
        let names: Vec<String> = (others.iter().take(2))
            .map(|(other, _)| name(case, &other.mistake))
            .collect();
        text += &format!(". As likely: {}", names.join("; "));
    }
    text
}

/// Residuals and compliances of an identification.
fn outcome(case: &Case<'_>, identification: &Identification) -> String {
    let residuals = identification.residual_sigma_m.map_or_else(
        || "there are no residuals".to_owned(),
        |sigma| format!("residual sigma {} mm", short(sigma * 1e3)),
    );
    let nominal = &case.nominal.compliance_rad_per_nm;
    let ratios = || {
        (identification.parameters.iter())
            .filter_map(|each| Some(each.estimate?.value / nominal[each.joint]))
            .filter(|ratio| ratio.is_finite())
    };
    let smallest = ratios().fold(f64::INFINITY, f64::min);
    let largest = ratios().fold(f64::NEG_INFINITY, f64::max);
    if smallest > largest {
        residuals
    } else {
        format!(
            "{residuals}, compliances {} to {} times nominal",
            short(smallest),
            short(largest)
        )
    }
}

/// Three digits.
fn short(value: f64) -> String {
    let size = value.abs();
    if (1e-4..1e5).contains(&size) {
        let before = size.log10().floor();
        let decimals = [5, 4, 3, 2, 1, 0]
            .into_iter()
            .find(|&decimals| before + f64::from(decimals) <= 2.0);
        let decimals = usize::try_from(decimals.unwrap_or(0)).unwrap_or(0);
        format!("{value:.decimals$}")
    } else {
        format!("{value:.1e}")
    }
}

fn column(case: &Case<'_>, joint: usize) -> String {
    let chain = &case.nominal.chain;
    let name = &chain.joints[joint].name;
    match Commands::from(chain).column(joint) {
        Some(column) => format!("{column} ({name})"),
        None => name.clone(),
    }
}

fn columns(case: &Case<'_>, joints: &[usize]) -> String {
    let names: Vec<String> = joints.iter().map(|&joint| column(case, joint)).collect();
    names.join(", ")
}

/// What a mistake is, in a few words.
fn name(case: &Case<'_>, mistake: &Mistake) -> String {
    match mistake {
        Mistake::SignsReversed => {
            "are all signs reversed, loaded and unloaded swapped or the loads' sign".to_owned()
        }
        Mistake::LoadUnit(factor) => format!("are the loads {}", unit_of_load(*factor)),
        Mistake::DeflectionUnit(factor) if *factor > 1.0 => {
            "are the deflections in m instead of mm".to_owned()
        }
        Mistake::DeflectionUnit(_) => "are the deflections in um instead of mm".to_owned(),
        Mistake::AngleUnit(factor) if *factor > 1.0 => {
            "are the angles in radians instead of degrees".to_owned()
        }
        Mistake::AngleUnit(_) => "were the angles converted to degrees twice".to_owned(),
        Mistake::JointSigns(joints) => format!(
            "{} {} the other way than in the model",
            columns(case, joints),
            if joints.len() == 1 { "turns" } else { "turn" }
        ),
        Mistake::JointsSwapped([one, other]) => format!(
            "are the columns {} and {} swapped",
            column(case, *one),
            column(case, *other)
        ),
        Mistake::Frame(matrix) => {
            format!("are the deflections in {}", frame(matrix))
        }
        Mistake::DeflectionsInToolFrame => {
            "are the deflections in the tool's frame instead of the world's".to_owned()
        }
        Mistake::LoadsInToolFrame => {
            "are the loads in the tool's frame instead of the world's".to_owned()
        }
        Mistake::AnglesOutsideRange { .. } => "angles outside the joints' ranges".to_owned(),
        Mistake::IdenticalRows(_) => "copied rows".to_owned(),
        Mistake::IdenticalReadings(_) => "copied readings".to_owned(),
    }
}

fn unit_of_load(factor: f64) -> &'static str {
    if factor > GRAVITY {
        "in kN instead of N"
    } else if factor > 1.0 {
        "in kg instead of N"
    } else if factor < GRAVITY.recip() {
        "1000 times too large, in mN or g"
    } else {
        "9.81 times too large, multiplied by 9.81 once too often"
    }
}

/// The frame from which a matrix leads to the world frame.
fn frame(matrix: &Matrix3<f64>) -> String {
    let proper = if matrix.determinant() < 0.0 {
        -matrix
    } else {
        *matrix
    };
    let mirrored = if matrix.determinant() < 0.0 {
        "a left-handed frame, mirrored and "
    } else {
        "a frame "
    };
    let rotation = Rotation3::from_matrix_unchecked(proper);
    let turned = UnitQuaternion::from_rotation_matrix(&rotation)
        .axis_angle()
        .map_or_else(String::new, |(axis, angle)| {
            let letter = ["x", "y", "z"]
                .into_iter()
                .zip(axis.iter())
                .find(|(_, share)| share.abs() > 0.999);
            let (sign, about) = match letter {
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

/// What to do about a mistake.
fn remedy(case: &Case<'_>, mistake: &Mistake) -> String {
    match mistake {
        Mistake::SignsReversed => {
            "Deflections are loaded minus unloaded; a weight has a negative fz_n where z points up: \
             change the sign of dx_mm, dy_mm, dz_mm, or of the loads"
                .to_owned()
        }
        Mistake::LoadUnit(factor) => {
            format!("Multiply fx_n to tz_nm by {}", short(*factor))
        }
        Mistake::DeflectionUnit(factor) => {
            format!("Multiply dx_mm, dy_mm, dz_mm by {factor}")
        }
        Mistake::AngleUnit(factor) => {
            let mut angles = Commands::from(&case.nominal.chain).columns();
            angles.retain(|column| column.ends_with("_deg"));
            if let [first, _, .., last] = angles.as_slice() {
                format!("Multiply {first} to {last} by {factor:.6}")
            } else {
                format!("Multiply {} by {factor:.6}", angles.join(", "))
            }
        }
        Mistake::JointSigns(_) => {
            "Change the sign of these angles, or of the joints' axes in the model".to_owned()
        }
        Mistake::JointsSwapped(_) => "Give the columns each other's names".to_owned(),
        Mistake::Frame(matrix) => format!("Write {}", world_columns(matrix)),
        Mistake::DeflectionsInToolFrame | Mistake::LoadsInToolFrame => {
            "Turn them into the world frame".to_owned()
        }
        _ => String::new(),
    }
}

/// How deflections in the world frame follow from those of the file.
fn world_columns(matrix: &Matrix3<f64>) -> String {
    let columns = ["dx_mm", "dy_mm", "dz_mm"];
    let line = |row: usize| {
        let terms: Vec<String> = (0..3)
            .filter(|&column| matrix[(row, column)].abs() > 5e-5)
            .map(|column| {
                let value = matrix[(row, column)];
                if (value.abs() - 1.0).abs() < 1e-12 {
                    let sign = if value < 0.0 { "-" } else { "" };
                    format!("{sign}{}", columns[column])
                } else {
                    format!("{value:.4} {}", columns[column])
                }
            })
            .collect();
        format!("{} = {}", columns[row], terms.join(" + "))
    };
    format!("{}, {}, {}", line(0), line(1), line(2))
}
