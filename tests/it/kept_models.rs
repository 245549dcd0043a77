//! Compiled models with large meshes are kept for the next command, which says the same; any other model is compiled.

use std::fs;
use std::path::PathBuf;

use crate::support::{Outcome, Workplace};

/// Steps about and along a bumpy sphere, and how many spheres: enough triangles that compiling takes more than a second.
const STEPS: usize = 300;
const MESHES: usize = 4;

/// A binary STL of a bumpy sphere.
fn sphere(bump: f32) -> Vec<u8> {
    let point = |i: usize, j: usize| {
        let [polar, turn] = [i, 2 * j].map(|k| std::f32::consts::PI * k as f32 / STEPS as f32);
        let radius = 0.1 * (1.0 + bump * (7.0 * polar).sin() * (5.0 * turn).cos());
        let [x, y] = [turn.cos(), turn.sin()].map(|part| radius * polar.sin() * part);
        [x, y, radius * polar.cos()]
    };
    let mut triangles = Vec::new();
    for i in 0..STEPS {
        for j in 0..STEPS {
            let [a, b, c, d] =
                [(i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)].map(|(i, j)| point(i, j % STEPS));
            triangles.extend((i > 0).then_some([a, c, b]));
            triangles.extend((i + 1 < STEPS).then_some([b, c, d]));
        }
    }
    let mut bytes = vec![0; 80];
    let count = u32::try_from(triangles.len()).expect("they are few");
    bytes.extend(count.to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.into_iter().flatten().flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// The planar arm with spheres beside it, and a scenario for it.
fn workplace() -> Workplace {
    let workplace = Workplace::new();
    let model = fs::read_to_string(crate::support::project("models/planar_3r.xml"));
    let model = model.expect("it can be read");
    let (mut assets, mut balls) = (String::new(), String::new());
    for number in 0..MESHES {
        workplace.write(
            &format!("{number}.stl"),
            sphere(0.05 + 0.001 * number as f32),
        );
        assets += &format!("<mesh name=\"{number}\" file=\"{number}.stl\"/>");
        balls += &format!(
            "<geom type=\"mesh\" mesh=\"{number}\" mass=\"0\" contype=\"0\" conaffinity=\"0\"/>"
        );
    }
    let model = model.replacen(
        "<worldbody>",
        &format!("<asset>{assets}</asset>\n  <worldbody>"),
        1,
    );
    workplace.write(
        "arm.xml",
        model.replace("</worldbody>", &format!("{balls}</worldbody>")),
    );
    let project = crate::support::project("models/planar_3r.xml");
    let text = crate::support::scenario_text("planar_3r");
    let mine = text.replace(&*project.to_string_lossy(), "arm.xml");
    assert_ne!(mine, text);
    workplace.write("my.toml", mine);
    workplace
}

/// `check` with models kept in the folder.
fn check(workplace: &Workplace) -> Outcome {
    workplace.shell("ELASTOCAL_CACHE=$PWD/kept elastocal check my.toml --quiet")
}

fn kept(workplace: &Workplace) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(workplace.path("kept")) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

#[test]
fn a_model_with_a_large_mesh_is_kept_and_says_the_same() {
    let workplace = workplace();
    let compiled = workplace.shell("ELASTOCAL_CACHE= elastocal check my.toml --quiet");
    let compiled = compiled.ends_with(0).stdout;
    assert_eq!(kept(&workplace), Vec::<PathBuf>::new());
    assert_eq!(check(&workplace).ends_with(0).stdout, compiled);
    let first = kept(&workplace);
    let endings: Vec<_> = first.iter().filter_map(|path| path.extension()).collect();
    assert_eq!(endings, ["json", "mjb"]);
    assert_eq!(check(&workplace).ends_with(0).stdout, compiled);
    assert_eq!(kept(&workplace), first);
    // It is what the next command loads: with the binary of a heavier arm in its place there is a heavier arm.
    let model = workplace.read("arm.xml");
    workplace.write("arm.xml", model.replace("mass=\"14\"", "mass=\"24\""));
    let heavier = check(&workplace).ends_with(0).stdout;
    assert_ne!(heavier, compiled);
    workplace.write("arm.xml", &model);
    let other = kept(&workplace)
        .into_iter()
        .find(|path| path.extension() == first[1].extension() && !first.contains(path));
    let bytes = fs::read(&first[1]).expect("it is there");
    fs::copy(other.expect("both are kept"), &first[1]).expect("it can be written");
    assert_eq!(check(&workplace).ends_with(0).stdout, heavier);
    // One that is not whole is compiled again.
    fs::write(&first[1], &bytes[..bytes.len() / 2]).expect("it can be written");
    assert_eq!(check(&workplace).ends_with(0).stdout, compiled);
    assert_eq!(fs::read(&first[1]).expect("it is there").len(), bytes.len());
    // Another mesh is another model.
    workplace.write("0.stl", sphere(0.1));
    check(&workplace).ends_with(0);
    assert_eq!(kept(&workplace).len(), 6);
}

#[test]
fn a_small_model_is_not_kept() {
    let workplace = Workplace::with("my.toml", crate::support::scenario_text("planar_3r"));
    check(&workplace).ends_with(0);
    assert_eq!(kept(&workplace), Vec::<PathBuf>::new());
}
