//! Files of absolute readings: what is read is what was written, and what cannot be is told in words.

use elastocal::measurement::{
    AbsoluteReading, MeasuredFile, absolute_table, read_measured, read_measurements,
};
use elastocal::robot::{Approach, Load};
use nalgebra::{DVector, Matrix6, UnitQuaternion, Vector3, Vector6};
use rand::RngExt;

use crate::support::{Workplace, assert_has};

/// A reading of an arm of six joints with everything that may be known of it.
pub fn reading(random: &mut impl rand::Rng, row: usize, is_pose: bool) -> AbsoluteReading {
    let mut number = |size: f64| random.random_range(-size..size);
    // Three rows of one stand: two reflectors without a load, one with it.
    let stand = row / 3;
    let mut covariance = Matrix6::from_diagonal(&Vector6::repeat(1e-10));
    if is_pose {
        let root = Matrix6::from_fn(|_, _| number(2e-5));
        covariance += root * root.transpose();
    }
    AbsoluteReading {
        configuration_rad: DVector::from_fn(6, |joint, _| 0.25 * (stand * 6 + joint) as f64 - 1.0),
        load: if row % 3 == 2 {
            Load::force(0.0, 12.5, -250.0)
        } else {
            Load::NONE
        },
        target: Some(["cat's eye", "ball, upper"][row % 2].to_owned()),
        station: Some(format!("S{}", row / 4)),
        visit: Some(format!("stand {stand}")),
        position_m: Vector3::new(number(2.0), number(2.0), number(2.0)),
        rotation: is_pose
            .then(|| UnitQuaternion::from_euler_angles(number(3.0), number(1.5), number(3.0))),
        covariance: Some(covariance),
        approach: (row > 0)
            .then(|| Approach(vec![true, false, row.is_multiple_of(2), true, false, true])),
        length: None,
        time_s: Some(1.7e9 + row as f64),
        temperature_c: Some(21.5),
    }
}

fn written(workplace: &Workplace, name: &str, text: impl AsRef<[u8]>) -> std::path::PathBuf {
    workplace.write(name, text);
    workplace.path(name)
}

#[test]
fn what_is_read_is_what_was_written() {
    let workplace = Workplace::new();
    let mut random = elastocal::numeric::random::generator(1, 0);
    for is_pose in [false, true] {
        let all: Vec<_> = (0..7)
            .map(|row| reading(&mut random, row, is_pose))
            .collect();
        let path = written(&workplace, "m.csv", absolute_table(&6.into(), &all));
        let Ok(MeasuredFile::Absolute(found)) = read_measured(&path, 6) else {
            panic!("{:?}", read_measured(&path, 6));
        };
        assert_eq!(found.len(), all.len());
        for (found, written) in found.iter().zip(&all) {
            let mut same = found.clone();
            // These are rounded on the way, once.
            same.rotation = written.rotation;
            same.covariance = written.covariance;
            assert_eq!(same, *written);
            let [one, other] = [found, written].map(|each| each.covariance.expect("known"));
            let rows = if is_pose { 6 } else { 3 };
            assert!((one - other).view((0, 0), (rows, rows)).amax() < 1e-14 * other.amax());
            if let (Some(one), Some(other)) = (found.rotation, written.rotation) {
                assert!(one.angle_to(&other) < 1e-7, "{one} {other}");
            }
        }
        let error = read_measurements(&path, 6)
            .expect_err("no deflections")
            .to_string();
        assert_has(&error, "holds absolute readings (x_mm,y_mm,z_mm)");
    }
}

/// The least that a file needs, and German decimals.
#[test]
fn a_position_at_joint_angles_is_enough() {
    let workplace = Workplace::new();
    let path = written(
        &workplace,
        "m.csv",
        "q1_deg;q2_deg;q3_deg;x_mm;y_mm;z_mm;approach\n10,5;20;-30;100,25;-0,5;1000;+\n",
    );
    let Ok(MeasuredFile::Absolute(found)) = read_measured(&path, 3) else {
        panic!("{:?}", read_measured(&path, 3));
    };
    assert_eq!(found[0].position_m, Vector3::new(100.25e-3, -0.5e-3, 1.0));
    assert_eq!(found[0].load, Load::NONE);
    assert_eq!(found[0].approach, Some(Approach(vec![true; 3])));
    assert_eq!((&found[0].covariance, &found[0].visit), (&None, &None));
}

/// What stands behind the joint angles, header and row, and what is said of it; what begins with a comma stands behind a position.
const WRONG: &[(&str, &str, &str)] = &[
    ("x_mm,y_mm", "1,2", "line 1: the column \"z_mm\" is missing"),
    (",dx_mm", ",4", "unknown column \"dx_mm\""),
    (",fx_n", ",4", "these columns come together"),
    (",qw,qx", ",1,0", "these columns come together"),
    (
        "x_mm,y_mm,z_mm",
        "1,nan,3",
        "line 2: y_mm: found \"nan\"; a finite number is allowed",
    ),
    ("x_mm,y_mm,z_mm", "1,2e7,3", "line 2: y_mm: found 2e7"),
    (
        ",qw,qx,qy,qz",
        ",1,0.1,0,0",
        "qw,qx,qy,qz: found a quaternion of length 1.004988; 1 is allowed",
    ),
    (
        ",qw,qx,qy,qz",
        ",0,0,0,0",
        "found a quaternion of length 0;",
    ),
    (",sx_mm,sy_mm", ",1,1", "these columns come together"),
    (
        ",sx_mm,sy_mm,sz_mm",
        ",1,0,1",
        "sx_mm,sy_mm,sz_mm: found 1, 0, 1; a positive number",
    ),
    (
        ",srx_mrad,sry_mrad,srz_mrad",
        ",1,1,1",
        "found \"srx_mrad\" without \"qw\"",
    ),
    (
        ",qw,qx,qy,qz,sx_mm,sy_mm,sz_mm",
        ",1,0,0,0,1,1,1",
        "these columns come together",
    ),
    (
        ",UPPER",
        ",1,0,0,-1,0,1",
        "cyy_mm2: found -1; a variance is allowed",
    ),
    (
        ",UPPER",
        ",1,2,0,1,0,1",
        "the covariance is not positive definite",
    ),
    (
        ",UPPER,sx_mm,sy_mm,sz_mm",
        ",1,0,0,1,0,1,1,1,1",
        "standard deviations or a covariance are allowed",
    ),
    (
        ",UPPER,crxrx_mrad2",
        ",1,0,0,1,0,1,1",
        "found \"crxrx_mrad2\" without \"qw\"",
    ),
    (",cxx_mm2", ",1", "these columns come together"),
    (
        ",target",
        ",",
        "target: found \"\"; a name of one line is allowed",
    ),
    (
        ",approach",
        ",+-",
        "approach: found \"+-\"; + or - for all joints is allowed, or 3 signs",
    ),
    (",approach", ",up", "approach: found \"up\""),
    (",temperature_c", ",294000", "temperature_c: found 294000"),
    (",time_s", ",noon", "time_s: found \"noon\""),
    (",colour", ",4", "unknown column \"colour\""),
];

#[test]
fn wrong_entries_are_told_in_words() {
    let workplace = Workplace::new();
    let q = "q1_deg,q2_deg,q3_deg,";
    let upper = "cxx_mm2,cxy_mm2,cxz_mm2,cyy_mm2,cyz_mm2,czz_mm2";
    for (header, row, expected) in WRONG {
        let position = if header.starts_with(',') {
            ["x_mm,y_mm,z_mm", "1,2,3"]
        } else {
            ["", ""]
        };
        let header = &(position[0].to_owned() + &header.replace("UPPER", upper));
        let table = format!("{q}{header}\n0,0,0,{}{row}\n", position[1]);
        let path = written(&workplace, "wrong.csv", table);
        let error = read_measured(&path, 3).expect_err(header).to_string();
        assert!(error.contains(expected), "{header}: {error}");
    }
    let rows = "visit,x_mm,y_mm,z_mm\n0,0,0,A,1,2,3\n0,0,0,B,1,2,3\n0,1,0,A,1,2,3\n";
    let path = written(&workplace, "wrong.csv", format!("{q}{rows}"));
    let error = read_measured(&path, 3)
        .expect_err("a visit that moves")
        .to_string();
    assert!(
        error.contains("line 4: visit: found \"A\" at other joint angles than in line 2"),
        "{error}"
    );
}
