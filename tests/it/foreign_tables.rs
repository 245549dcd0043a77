//! `import`: tables of other programs become measurement files through a mapping of their columns.

use elastocal::measurement::foreign::import;
use elastocal::measurement::{MeasuredFile, read_measured};
use nalgebra::{UnitQuaternion, Vector3};

use crate::support::{Outcome, Workplace, list, numbers, project};

/// Intrinsic Euler angles in degrees, decimal commas, a joint that the controller counts the other way.
pub const TABLE: &str = "no;A1;A2;X;Y;Z;RX;RY;RZ;sx;sy;sz;srx;sry;srz;T;side;kg\n\
    1;0,5;-10;1000,5;-200;300;10;20;30;0,01;0,02;0,03;0,001;0,002;0,003;21,5;+;10\n\
    2;1,25;20;1010,5;-210;310;-15;25;-80;0,01;0,02;0,03;0,001;0,002;0,003;21,6;-;10\n";
pub const MAPPING: &str = r#"[[joint]]
column = "A1"
unit = "rad"
sign = -1
offset = 0.1

[[joint]]
column = "A2"
unit = "deg"

[position]
columns = ["X", "Y", "Z"]
unit = "mm"
std_columns = ["sx", "sy", "sz"]

[rotation]
convention = "intrinsic xyz"
columns = ["RX", "RY", "RZ"]
unit = "deg"
std_columns = ["srx", "sry", "srz"]

[weight]
column = "kg"
unit = "kg"

[station]
value = "door"

[approach]
column = "side"

[temperature]
column = "T"
unit = "C"
"#;

fn workplace(table: &str, mapping: &str) -> Workplace {
    let place = Workplace::with("table.csv", table);
    place.write("mapping.toml", mapping);
    place
}

fn run(place: &Workplace) -> Outcome {
    place.run("import table.csv --mapping mapping.toml --measurements-out m.csv --json")
}

fn readings(place: &Workplace) -> Vec<elastocal::measurement::AbsoluteReading> {
    match read_measured(&place.path("m.csv"), 2).expect("a measurement file") {
        MeasuredFile::Absolute(readings) => readings,
        MeasuredFile::Deflections(_) => panic!("these are absolute readings"),
    }
}

#[test]
fn a_table_is_understood() {
    let place = workplace(TABLE, MAPPING);
    let json = run(&place).ends_with(0).json();
    assert_eq!(json["rows"], 2);
    assert_eq!(json["unread"], serde_json::json!(["no"]));
    let column = |name: &str| {
        let all = list(&json["columns"]);
        numbers(&all.iter().find(|each| each["column"] == name).expect(name)["range"])
    };
    assert_eq!(column("x_mm"), [1000.5, 1010.5]);
    assert_eq!(column("temperature_c"), [21.5, 21.6]);

    let all = readings(&place);
    let first = &all[0];
    let angles = first.configuration_rad.as_slice();
    assert!(
        (angles[0] - (0.1 - 0.5)).abs() < 1e-15 && (angles[1] + 10_f64.to_radians()).abs() < 1e-15
    );
    assert!((first.load.force_n.z + 98.0665).abs() < 1e-12);
    assert_eq!(first.station.as_deref(), Some("door"));
    assert_eq!(
        first
            .approach
            .as_ref()
            .map(elastocal::robot::Approach::word),
        Some("++".to_owned())
    );
    let turn =
        |axis: Vector3<f64>, deg: f64| UnitQuaternion::from_scaled_axis(axis * deg.to_radians());
    let expected = turn(Vector3::x(), 10.0) * turn(Vector3::y(), 20.0) * turn(Vector3::z(), 30.0);
    assert!(first.rotation.expect("a pose").angle_to(&expected) < 1e-12);
    // The deviations of the three angles are about axes that are not perpendicular.
    let covariance = first.covariance.expect("it is given");
    assert!((covariance[(1, 1)].sqrt() - 2e-5).abs() < 1e-12);
    let columns = [
        Vector3::x(),
        turn(Vector3::x(), 10.0) * Vector3::y(),
        turn(Vector3::x(), 10.0) * turn(Vector3::y(), 20.0) * Vector3::z(),
    ];
    let mut expected = nalgebra::Matrix3::zeros();
    for (column, deg) in columns.iter().zip([0.001_f64, 0.002, 0.003]) {
        expected += column * column.transpose() * deg.to_radians().powi(2);
    }
    let found = covariance.fixed_view::<3, 3>(3, 3);
    assert!(
        (found - expected).amax() < 1e-8 * expected.amax(),
        "{found} {expected}"
    );
}

/// The same rotations in every way of writing them.
#[test]
fn every_convention_gives_the_same_rotation() {
    let angles = [0.3, -0.8, 2.0];
    let truth = UnitQuaternion::from_scaled_axis(Vector3::z() * angles[0])
        * UnitQuaternion::from_scaled_axis(Vector3::y() * angles[1])
        * UnitQuaternion::from_scaled_axis(Vector3::z() * angles[2]);
    let [x, y, z, w]: [f64; 4] = truth.coords.into();
    let vector = truth.scaled_axis();
    let cases: [(&str, Vec<f64>); 3] = [
        ("intrinsic zyz\"\nunit = \"rad", angles.to_vec()),
        ("quaternion wxyz", vec![w, x, y, z]),
        (
            "rotation_vector\"\nunit = \"mrad",
            (vector * 1e3).as_slice().to_vec(),
        ),
    ];
    for (keys, values) in cases {
        let names: Vec<String> = (0..values.len()).map(|index| format!("r{index}")).collect();
        let fields: Vec<String> = values.iter().map(ToString::to_string).collect();
        let table = format!(
            "q1\tq2\tx\ty\tz\t{}\n0\t0\t1\t2\t3\t{}\n",
            names.join("\t"),
            fields.join("\t")
        );
        let mapping = format!(
            "[[joint]]\ncolumn = \"q1\"\nunit = \"deg\"\n[[joint]]\ncolumn = \"q2\"\nunit = \"deg\"\n[position]\ncolumns = [\"x\", \"y\", \"z\"]\nunit = \"m\"\n[rotation]\nconvention = \"{keys}\"\ncolumns = {names:?}\n"
        );
        let place = workplace(&table, &mapping);
        run(&place).ends_with(0);
        let found = readings(&place)[0].rotation.expect("a pose");
        assert!(found.angle_to(&truth) < 1e-12, "{keys}: {found}");
    }
}

#[test]
fn deflections_and_slides() {
    let table = "# some words of the program\na,b,dx,dy,dz,sx,sy,sz,kg,note\n1,100,0.5,-0.25,0.1,3,3,5,50,x\n\n2,150,0.25,0.5,0.2,3,3,5,0,x\n";
    let mapping = "[[joint]]\ncolumn = \"a\"\nunit = \"deg\"\n[[joint]]\ncolumn = \"b\"\nunit = \"mm\"\n[weight]\ncolumn = \"kg\"\nunit = \"N\"\n\
        [deflection]\ncolumns = [\"dx\", \"dy\", \"dz\"]\nunit = \"um\"\nstd_columns = [\"sx\", \"sy\", \"sz\"]\n";
    let place = workplace(table, mapping);
    let json = run(&place).ends_with(0).json();
    assert_eq!(json["unread"], serde_json::json!(["note"]));
    let text = place.read("m.csv");
    assert_eq!(
        text,
        "q1_deg,q2_mm,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,dx_mm,dy_mm,dz_mm,sx_mm,sy_mm,sz_mm\n\
         1,100,0,0,-50,0,0,0,0.0005,-0.00025,0.0001,0.003,0.003,0.005\n\
         2,150,0,0,0,0,0,0,0.00025,0.0005,0.0002,0.003,0.003,0.005\n"
    );
}

#[test]
fn what_is_wrong_is_said_with_its_key_or_its_line() {
    for (from, to, said) in [
        (
            "\"A1\"",
            "\"A11\"",
            "mapping.toml: joint[0]: found \"A11\"; table.csv has no such column",
        ),
        ("\"A1\"", "\"A11\"", "did you mean \"A1\"?"),
        (
            "\"rad\"",
            "\"radian\"",
            "joint[0].unit: found \"radian\"; one of rad, deg",
        ),
        (
            "\"mm\"",
            "\"rad\"",
            "position.unit: found \"rad\"; one of mm, m, um, in is allowed",
        ),
        (
            "sign = -1",
            "sign = 2",
            "joint[0].sign: found 2; 1 or -1 is allowed",
        ),
        (
            "intrinsic xyz",
            "intrinsic xxz",
            "rotation.convention (line 17): found \"intrinsic xxz\"",
        ),
        (
            "intrinsic xyz",
            "quaternion wxyz",
            "rotation.columns: found 3; 4 are needed",
        ),
        (
            "std_columns = [\"sx\", \"sy\", \"sz\"]",
            "",
            "rotation: poses have standard deviations of both or of none",
        ),
        (
            "[\"X\", \"Y\", \"Z\"]",
            "[\"X\", \"Y\"]",
            "position.columns: found 2; 3 are needed",
        ),
        ("[weight]", "[wait]", "unknown field `wait`"),
        (
            "column = \"kg\"",
            "column = \"side\"",
            "line 2: side: found \"+\"; a finite number is allowed",
        ),
        (
            "value = \"door\"",
            "word = \"door\"",
            "unknown variant `word`",
        ),
        (
            "unit = \"mm\"",
            "unit = \"m\"",
            "table.csv: line 2: position: ",
        ),
        (
            "[position]",
            "[deflection]",
            "deflection: files of deflections have loads",
        ),
        (
            "column = \"side\"",
            "column = \"no\"",
            "line 2: approach: found \"1\"",
        ),
        ("unit = \"C\"", "unit = \"K\"", "temperature.unit: "),
    ] {
        assert!(MAPPING.contains(from), "{from}");
        let place = workplace(TABLE, &MAPPING.replacen(from, to, 1));
        let refused = run(&place).ends_with(1);
        assert!(refused.stderr.contains(said), "{to}: {}", refused.stderr);
        assert_eq!(place.listing(), ["mapping.toml", "table.csv"]);
    }
    for (from, to, said) in [
        (
            "1000,5",
            "a lot",
            "table.csv: line 2: X: found \"a lot\"; a finite number is allowed",
        ),
        ("1000,5", "", "line 2: X: found \"\""),
        ("1000,5", "1.000,5", "line 2: X: found \"1.000,5\""),
        ("no;A1;A2", "no;A1;A1", "which table.csv has twice"),
        (
            "2;1,25",
            "2;9;1,25",
            "line 3: found 19 fields; the header has 18",
        ),
        ("0,001;0,002", "-0,001;0,002", "line 2: rotation.std"),
    ] {
        let place = workplace(&TABLE.replacen(from, to, 1), MAPPING);
        let refused = run(&place).ends_with(1);
        assert!(refused.stderr.contains(said), "{to}: {}", refused.stderr);
    }
}

/// No column is two numbers, and deviations of angles whose axes coincide are none of a rotation.
#[test]
fn what_identify_would_refuse_is_refused() {
    for (from, to, said) in [
        (
            "\"A2\"",
            "\"A1\"",
            "mapping.toml: joint[1].column: found \"A1\", which joint[0].column has, too",
        ),
        (
            "\"X\", \"Y\"",
            "\"X\", \"X\"",
            "mapping.toml: position.columns[1]: found \"X\", which position.columns[0] has, too",
        ),
        (
            "-15;25;-80",
            "-15;90;-80",
            "table.csv: line 3: rotation: the covariance is not positive definite",
        ),
    ] {
        let place = workplace(&TABLE.replace(from, to), &MAPPING.replace(from, to));
        run(&place).ends_with(1).says(said);
        assert!(!place.path("m.csv").exists());
    }
}

/// The mapping that the documentation tells.
fn documented() -> String {
    let page = std::fs::read_to_string(project("docs/other_programs.md")).expect("it is there");
    let start = page
        .find("```toml file=ur10_tracker.toml\n")
        .expect("the mapping");
    let text = &page[start..];
    let text = &text[text.find('\n').expect("a line") + 1..];
    text[..text.find("```").expect("its end")].to_owned()
}

/// A public set of 2773 poses: `UR10_ACCURACY` names its file.
#[test]
fn two_thousand_poses_of_a_ur10() {
    let Some(table) = std::env::var_os("UR10_ACCURACY") else {
        eprintln!(
            "skipped: UR10_ACCURACY does not name the table of series C of ipa-robot-accuracy"
        );
        return;
    };
    let place = Workplace::with("mapping.toml", documented());
    let imported = import(table.as_ref(), &place.path("mapping.toml")).expect("it can be read");
    assert_eq!(imported.rows, 2773);
    place.write("m.csv", &imported.text);
    let MeasuredFile::Absolute(readings) =
        read_measured(&place.path("m.csv"), 6).expect("a measurement file")
    else {
        panic!("these are absolute readings");
    };
    assert_eq!(readings.len(), 2773);
    let first = &readings[0];
    assert!(
        (first.position_m - Vector3::new(0.383_971_23, -3.240_756_2, 0.201_726_21)).norm() < 1e-12
    );
    assert!((first.configuration_rad[5]).abs() < 1e-12);
    let covariance = first.covariance.expect("it is given");
    let sigma_mrad = covariance[(3, 3)].sqrt() * 1e3;
    assert!((0.01..0.3).contains(&sigma_mrad), "{sigma_mrad}");
}
