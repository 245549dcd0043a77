//! A sheet of stills: the robot in each configuration of a plan, so that a person sees what it will do.
//!
//! The pictures are orthographic, all from the same side: the one that shows the arms at their widest.
//! Deflections of some millimetres would not show; the arm stands at the commanded angles.

mod painter;
mod scene;
mod turning;

use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

use self::painter::{Camera, Painter};
use self::scene::{Scene, Scenery};
use super::markup::{PageError, filled};
use crate::experiment::Candidate;
use crate::numeric::tolerance::ends;
use crate::plan::{Experiment, Plan};
use crate::record::messages::{ProvenanceMessage, merge};
use crate::robot::Load;
use crate::scenario::Scenario;
use crate::study::TakenPlan;
use crate::text::wording::counted;

/// The width of a still and the space between stills (px).
const STILL_PX: f64 = 400.0;
const GAP_PX: f64 = 20.0;
/// The height of the lines of text over a still and over the sheet (px).
const CAPTION_PX: f64 = 40.0;
const HEADING_PX: f64 = 62.0;
/// What is in a still stands so far from its edges at least (px), and a still shows at least this share of the width that all share.
const AROUND_PX: f64 = 14.0;
const CLOSEST: f64 = 0.6;
/// The most stills in a row.
const COLUMNS: usize = 3;

/// The robot in each configuration of a plan.
pub struct Stills<'a> {
    scenario: &'a Scenario,
    /// The plan.
    pub plan: Plan,
    /// Of a plan of absolute readings: what is read in each experiment, and from where.
    rows: Vec<&'a Candidate>,
    scenery: Scenery,
    /// From where it is seen.
    pub camera: Camera,
}

impl<'a> Stills<'a> {
    /// Of a plan.
    pub fn of_plan(scenario: &'a Scenario, plan: &Plan) -> Self {
        Self::new(scenario, plan.clone(), Vec::new())
    }

    /// Of a plan, whatever is measured: of absolute readings with what is read, and from where.
    pub fn of_taken(scenario: &'a Scenario, plan: &'a TakenPlan<'_>) -> Self {
        let readings = match plan {
            TakenPlan::Deflections(plan) => return Self::of_plan(scenario, plan),
            TakenPlan::Readings(taken) => taken.planning.readings(&taken.plan),
        };
        let experiments = (readings.iter()).map(|(row, repeats)| row.experiment(*repeats));
        let experiments = experiments.collect();
        let rows = readings.iter().map(|(row, _)| *row).collect();
        Self::new(scenario, Plan { experiments }, rows)
    }

    fn new(scenario: &'a Scenario, plan: Plan, rows: Vec<&'a Candidate>) -> Self {
        let scenery = Scenery::new(scenario, &plan, &rows);
        let camera = scenery.camera();
        Self {
            scenario,
            plan,
            rows,
            scenery,
            camera,
        }
    }

    /// The stills, each with its experiment.
    fn shown(&self) -> Vec<Value> {
        let belief = &self.scenario.task.belief;
        let commands = belief.commands();
        let own = &belief.calibration_tool.name;
        let both = self.plan.experiments.iter().zip(&self.scenery.scenes);
        let still = |(index, (experiment, scene)): (usize, (&Experiment, &Scene))| {
            let mut still = self.drawn(scene);
            let Load { force_n, torque_nm } = experiment.load;
            let reads = self.rows.get(index).map(
                |row| json!({ "target": row.target.as_ref().unwrap_or(own), "station": row.station }),
            );
            let row = json!({
                "number": index + 1,
                "q": commands.shown(experiment.configuration_rad.as_slice()),
                "unit": commands.unit(),
                "has_load": experiment.load != Load::NONE,
                "force_n": array(force_n),
                "torque_nm": Some(torque_nm).filter(|torque| *torque != Vector3::zeros()).map(array),
                "direction": experiment.direction.map(array),
                "reads": reads,
                "repeats": experiment.repeats,
            });
            merge(&mut still, row);
            still
        };
        both.enumerate().map(still).collect()
    }

    /// The view that turns, and the stills, as figures of a page.
    pub fn figures(&self) -> Value {
        json!({
            "plan": turning::plan(&self.scenery),
            "script": turning::SCRIPT,
            "stills": self.shown(),
            "camera": self.camera.shown(),
        })
    }

    /// The sheet as an SVG document.
    ///
    /// # Errors
    /// See [`PageError`].
    pub fn sheet(&self) -> Result<String, PageError> {
        let [still_width, still_height] = self.camera.size_px;
        let [across, down] = [still_width + GAP_PX, CAPTION_PX + still_height + GAP_PX];
        let mut stills = self.shown();
        let columns = stills.len().clamp(1, COLUMNS);
        for (index, still) in stills.iter_mut().enumerate() {
            let [column, row] = [index % columns, index / columns].map(|place| place as f64);
            still["at"] = json!([GAP_PX + column * across, (HEADING_PX + row * down).round()]);
        }
        let what = ["measurement", "absolute reading"][usize::from(!self.rows.is_empty())];
        let title = format!(
            "{}: {} in {}",
            self.scenario.name,
            counted(self.plan.measurements().into(), what),
            counted(stills.len() as u64, "configuration")
        );
        // The heading needs the room of two stills.
        let width = GAP_PX + (columns as f64 * across).max(2.0 * (STILL_PX + GAP_PX));
        let height = HEADING_PX + stills.len().div_ceil(columns) as f64 * down;
        let sheet = json!({
            "title": title,
            "description": self.scenario.description,
            "provenance": ProvenanceMessage::new(self.scenario),
            "width": width.round(),
            "height": height.round(),
            "gap": GAP_PX,
            "caption": CAPTION_PX,
            "camera": self.camera.shown(),
            "stills": stills,
        });
        filled("stills.svg", &sheet)
    }

    /// Stills of each experiment for the sheet that is taken to the laboratory: without a load, and of where its load hangs.
    pub fn pictures(&self) -> Vec<[Value; 2]> {
        let stills = self.shown().into_iter().zip(&self.scenery.scenes);
        let both = stills.map(|(mut unloaded, scene)| {
            let mut load = unloaded.clone();
            load["box"] = json!(close_up(&self.camera, scene));
            unloaded["force"] = Value::Null;
            [unloaded, load]
        });
        both.collect()
    }

    /// A still (px): the robot, what is read and how, the force; and the part of the picture that they are in.
    fn drawn(&self, scene: &Scene) -> Value {
        let camera = &self.camera;
        let mut painter = Painter::new(camera);
        let mut places = [scene.tool, scene.read, scene.arrow_end].to_vec();
        for (part, mesh) in self.scenery.surfaces(scene) {
            // What is only half in the picture would be hard to make out.
            if part.is_robot || mesh.vertices.iter().all(|corner| camera.is_seen(corner)) {
                painter.add(&mesh, part.rgba);
            }
            if part.is_robot {
                places.extend(&mesh.vertices);
            }
        }
        let [width, height] = camera.size_px;
        let shown = part_around(camera, &places, width / height, CLOSEST * width);
        let sight = scene.sight.map(|sight| {
            let [from, to] = sight.ends_m.map(Point3::from);
            let class = ["tracker", "station"][usize::from(scene.station.is_some())];
            let [x, y] = camera.place(&from);
            let is_in = (shown[0]..shown[0] + shown[2]).contains(&x)
                && (shown[1]..shown[1] + shown[3]).contains(&y);
            json!({
                "from": [x, y],
                "to": camera.place(&to),
                "is_gauge": sight.is_gauge,
                "is_far": !is_in,
                "class": class,
                "name": scene.station.as_deref().unwrap_or(class),
                "metres": (from - scene.read).norm(),
            })
        });
        let force = (scene.arrow_end != scene.tool).then(|| camera.place(&scene.arrow_end));
        json!({
            "picture": painter.png(),
            "read": camera.place(&scene.read),
            "tool": camera.place(&scene.tool),
            "force": force,
            "sight": sight,
            "box": shown,
        })
    }
}

fn array(vector: Vector3<f64>) -> [f64; 3] {
    vector.into()
}

/// A square around the tool and its load (px), inside the picture.
fn close_up(camera: &Camera, scene: &Scene) -> [f64; 4] {
    let ends = [scene.tool, scene.arrow_end];
    let [from, to] = ends.each_ref().map(|point| camera.see(point));
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    part_around(camera, &ends, 1.0, 2.4 * length.max(20.0))
}

/// The part of a picture (px: left, top, width, height) around some places that has a shape, width over height, and at least a width.
fn part_around(camera: &Camera, places: &[Point3<f64>], shape: f64, least: f64) -> [f64; 4] {
    let size = camera.size_px;
    let seen: Vec<[f64; 3]> = places.iter().map(|place| camera.see(place)).collect();
    let sides = [0, 1].map(|axis| ends(seen.iter().map(|place| place[axis])));
    let [across, down] = sides.map(|[low, high]| high - low + 2.0 * AROUND_PX);
    let width = across.max(down * shape).max(least);
    let width = width.min(size[0]).min(size[1] * shape);
    let part = [width, width / shape];
    let corner = |axis: usize| {
        let about = f64::midpoint(sides[axis][0], sides[axis][1]) - 0.5 * part[axis];
        about.min(size[axis] - part[axis]).max(0.0)
    };
    [corner(0), corner(1), part[0], part[1]].map(f64::floor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mujoco::Mesh;
    use crate::mujoco::Shape;
    use crate::plan::read_plan;

    fn project(path: &str) -> std::path::PathBuf {
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
    }

    fn sheet_of(name: &str, plan: &str) -> String {
        let path = project(&format!("scenarios/{name}.toml"));
        let scenario = Scenario::load(&path).expect("the scenario is valid");
        let plan =
            read_plan(&project(plan), scenario.task.belief.commands()).expect("the plan is valid");
        Stills::of_plan(&scenario, &plan).sheet().expect("drawn")
    }

    #[test]
    fn a_sheet_is_well_formed_with_a_still_for_every_configuration() {
        let svg = sheet_of("klimchik2012", "scenarios/plans/klimchik2012_m12.csv");
        let document = roxmltree::Document::parse(&svg).expect("well-formed");
        assert!(
            document
                .root_element()
                .has_tag_name(("http://www.w3.org/2000/svg", "svg"))
        );
        assert_eq!(svg.matches("class=\"still\"").count(), 12);
        assert_eq!(svg.matches(" 1 x").count(), 0);
        assert_eq!(svg.matches(">1 x<").count(), 12);
        assert!(
            svg.contains(
                "q = 0, \u{2212}83.8, 127.6, \u{2212}120, \u{2212}60.9, \u{2212}173.8 deg"
            )
        );
        let is_picture = |part: &&str| part.starts_with("data:image/png;base64,");
        let words = || svg.split('"').filter(|part| !is_picture(part));
        assert!(!words().any(|part| part.contains("NaN") || part.contains("inf")));
        assert!(svg.len() < 300_000, "{} bytes", svg.len());
    }

    #[test]
    fn the_stills_lie_within_the_sheet() {
        let svg = sheet_of("kr270", "scenarios/plans/klimchik2012_m4.csv");
        let numbers = |text: &str| -> Vec<f64> {
            text.split([' ', ','])
                .map(|number| number.parse().expect("a number"))
                .collect()
        };
        let between = |text: &str, from: &str, to: &str| -> String {
            let (_, rest) = text.split_once(from).expect("it is there");
            rest.split_once(to).expect("it ends").0.to_owned()
        };
        let size = numbers(&between(&svg, "viewBox=\"0 0 ", "\""));
        let clip = between(&svg, "<clipPath id=\"still\">", "</clipPath>");
        let width = numbers(&between(&clip, "width=\"", "\""))[0];
        let height = numbers(&between(&clip, "height=\"", "\""))[0];
        for still in svg.split("class=\"still\"").skip(1) {
            let place = numbers(&between(still, "translate(", ")"));
            assert!(place[0] > 0.0 && place[0] + width < size[0]);
            assert!(place[1] > 0.0 && place[1] + CAPTION_PX + height < size[1]);
            // The tool and its tracker's line are in the picture.
            let tool = between(still, "<circle cx=\"", "\" r=").replace("\" cy=\"", " ");
            let tool = numbers(&tool);
            assert!((0.0..width).contains(&tool[0]) && (0.0..height).contains(&tool[1]));
            assert!(still.contains("stroke-dasharray"));
        }
    }

    #[test]
    fn of_two_boxes_the_nearer_is_seen() {
        // Seen from -y, with the farther one larger.
        let cuboid = |y: f64| {
            let pose = nalgebra::Isometry3::translation(0.0, y, 0.0);
            Mesh::new(&Shape::Box(Vector3::repeat(0.5 + 0.2 * y))).transformed(&pose)
        };
        let colours = [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
        let boxes = [cuboid(-1.0), cuboid(1.0)];
        let points = boxes.each_ref().map(|each| each.vertices.clone()).concat();
        let camera = Camera::new(-90_f64.to_radians(), 0.0, &points, 100.0);
        for order in [[0, 1], [1, 0]] {
            let mut painter = Painter::new(&camera);
            for index in order {
                painter.add(&boxes[index], colours[index]);
            }
            let count = |channel: usize| {
                let samples = painter.pixels.chunks(4);
                samples.filter(|sample| sample[channel] > 0).count() as f64
            };
            let all = count(3);
            // Sides of 0.6 and 1.4 m.
            assert!((count(0) / all / (0.6 / 1.4_f64).powi(2) - 1.0).abs() < 0.02);
            assert!((count(0) + count(2) - all).abs() < 0.5);
        }
    }

    #[test]
    fn a_plan_without_forces_has_a_sheet_too() {
        let path = project("scenarios/planar_3r.toml");
        let scenario = Scenario::load(&path).expect("the scenario is valid");
        let experiment = Experiment {
            configuration_rad: scenario.task.test_poses[0].configuration_rad.clone(),
            load: Load::NONE,
            repeats: 4,
            approach: None,
            direction: None,
        };
        let plan = Plan {
            experiments: vec![experiment],
        };
        let svg = Stills::of_plan(&scenario, &plan).sheet().expect("drawn");
        assert!(svg.contains(">4 x<") && !svg.contains("NaN"));
        let none = Stills::of_plan(&scenario, &Plan::default()).sheet();
        for svg in [svg, none.expect("drawn")] {
            roxmltree::Document::parse(&svg).expect("well-formed");
        }
    }
}
