//! A sheet of stills: the robot in each configuration of a plan, so that a person sees what it will do.
//!
//! The pictures are orthographic, all from the same side: the one that shows the arms at their widest.
//! Deflections of some millimetres would not show; the arm stands at the commanded angles.

mod painter;
mod scene;
mod turning;

use std::fmt::Write;

use nalgebra::{Point3, Vector3};

use self::painter::{Camera, Painter};
use self::scene::{Scene, Scenery};
use super::markup::{escaped, unbroken};
use crate::experiment::Candidate;
use crate::plan::{Experiment, Plan};
use crate::record::messages::ProvenanceMessage;
use crate::robot::Load;
use crate::scenario::Scenario;
use crate::text::wording::{counted, listed};

/// The width of a still and the space between stills (px).
const STILL_PX: f64 = 400.0;
const GAP_PX: f64 = 20.0;
/// The height of the lines of text over a still and over the sheet (px).
const CAPTION_PX: f64 = 40.0;
const HEADING_PX: f64 = 62.0;
/// The most stills in a row.
const COLUMNS: usize = 3;
/// The side of a square of the floor's grid (m).
const GRID_M: f64 = 0.5;
/// What stands behind the floor, and how lines of sight and gauges are drawn.
const GROUND: &str = "#eef1f4";
const GREEN: &str = "#08693f";

/// The robot in each configuration of a plan.
pub struct Stills<'a> {
    scenario: &'a Scenario,
    /// The plan.
    pub plan: Plan,
    /// Of a plan of absolute readings: what is read in each experiment, and from where.
    rows: Vec<&'a Candidate>,
    scenery: Scenery,
    camera: Camera,
}

/// Pictures of an experiment for the sheet that is taken to the laboratory.
pub struct Pictures {
    /// The robot without a load.
    pub unloaded: String,
    /// Where its load hangs.
    pub load: String,
}

impl<'a> Stills<'a> {
    /// Of a plan.
    pub fn of_plan(scenario: &'a Scenario, plan: &Plan) -> Self {
        Self::new(scenario, plan.clone(), Vec::new())
    }

    /// Of a plan of absolute readings, each so often: with what is read, and from where.
    pub fn of_readings(scenario: &'a Scenario, readings: &[(&'a Candidate, u32)]) -> Self {
        let experiments = readings
            .iter()
            .map(|(row, repeats)| row.experiment(*repeats));
        let plan = Plan {
            experiments: experiments.collect(),
        };
        let rows = readings.iter().map(|(row, _)| *row).collect();
        Self::new(scenario, plan, rows)
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

    /// What is shown, from the first experiment on.
    fn shown(&self) -> impl Iterator<Item = (usize, &Experiment, &Scene)> {
        let both = self.plan.experiments.iter().zip(&self.scenery.scenes);
        both.enumerate()
            .map(|(index, (experiment, scene))| (index, experiment, scene))
    }

    /// The view that turns, and the stills, as figures of a page.
    pub fn figures(&self) -> String {
        let mut figures = turning::view(&self.scenery);
        for (index, experiment, scene) in self.shown() {
            let [angles, loads] = self.words(index, experiment);
            let number = index + 1;
            let class = if experiment.load == Load::NONE {
                ""
            } else {
                "load"
            };
            let drawing = self.framed(scene, None, &format!("Experiment {number}"));
            let _ = writeln!(
                figures,
                "<figure class=\"still\"><figcaption><b>{number}</b> {angles}; <b>{}\u{a0}x</b><br><span class=\"{class}\">{loads}</span>\
                 </figcaption>{}</figure>",
                experiment.repeats,
                with_shared(drawing, index, &self.camera)
            );
        }
        figures
    }

    /// The sheet as an SVG document.
    pub fn sheet(&self) -> String {
        let [still_width, still_height] = self.camera.size_px;
        let count = self.plan.experiments.len();
        let columns = count.clamp(1, COLUMNS);
        let place =
            |count: usize, size: f64| f64::from(u32::try_from(count).unwrap_or(u32::MAX)) * size;
        // The heading needs the room of two stills.
        let width = GAP_PX + place(columns, still_width + GAP_PX).max(2.0 * (STILL_PX + GAP_PX));
        let height =
            HEADING_PX + place(count.div_ceil(columns), CAPTION_PX + still_height + GAP_PX);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" \
             width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"Helvetica, Arial, sans-serif\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{}{}\n",
            self.heading(),
            shared(&self.camera)
        );
        for (index, experiment, scene) in self.shown() {
            let x = GAP_PX + place(index % columns, still_width + GAP_PX);
            let y = HEADING_PX + place(index / columns, CAPTION_PX + still_height + GAP_PX);
            let _ = write!(
                svg,
                "<g class=\"still\" transform=\"translate({x:.1} {y:.1})\">"
            );
            let [angles, loads] = self.words(index, experiment);
            let _ = write!(
                svg,
                "<g fill=\"#222\" font-size=\"13\"><text y=\"14\"><tspan font-weight=\"bold\">{}</tspan>\
                 <tspan x=\"20\">{angles}</tspan></text><text x=\"20\" y=\"31\" fill=\"#b3261e\">{loads}</text>\
                 <text x=\"{still_width:.0}\" y=\"31\" text-anchor=\"end\" font-weight=\"bold\">{} x</text></g>\
                 <g transform=\"translate(0 {CAPTION_PX})\">",
                index + 1,
                experiment.repeats
            );
            self.picture(&mut svg, scene, true);
            svg.push_str("</g></g>\n");
        }
        svg.push_str("</svg>\n");
        svg
    }

    /// Pictures of each experiment, for one page.
    pub fn pictures(mut self) -> Vec<Pictures> {
        let scenes = std::mem::take(&mut self.scenery.scenes);
        let picture = |(index, mut scene): (usize, Scene)| {
            let number = index + 1;
            let label = format!("Where the load of experiment {number} hangs");
            let load = self.framed(&scene, Some(close_up(&self.camera, &scene)), &label);
            scene.arrow_end = scene.tool;
            let label = format!("Experiment {number} without load");
            let unloaded = self.framed(&scene, None, &label);
            let unloaded = with_shared(unloaded, index, &self.camera);
            Pictures { unloaded, load }
        };
        scenes.into_iter().enumerate().map(picture).collect()
    }

    /// A scene as a drawing of its own: all of it, or what is in a box.
    fn framed(&self, scene: &Scene, within: Option<[f64; 4]>, label: &str) -> String {
        let is_whole = within.is_none();
        let [width, height] = self.camera.size_px;
        let [x, y, width, height] = within.unwrap_or([0.0, 0.0, width, height]);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{x:.1} {y:.1} {width:.1} {height:.1}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" style=\"background: {GROUND}\" role=\"img\" aria-label=\"{}\">",
            escaped(label)
        );
        self.picture(&mut svg, scene, is_whole);
        svg + "</svg>"
    }

    /// What the sheet is about.
    fn heading(&self) -> String {
        let provenance = ProvenanceMessage::new(self.scenario);
        let what = if self.rows.is_empty() {
            "measurement"
        } else {
            "absolute reading"
        };
        let title = format!(
            "{}: {} in {}",
            escaped(&self.scenario.name),
            counted(self.plan.measurements().into(), what),
            counted(self.plan.experiments.len() as u64, "configuration")
        );
        format!(
            "<title>{title}</title>\n<desc>elastocal {} ({}), scenario {}, seed {}</desc>\n\
             <g transform=\"translate({GAP_PX} 0)\" fill=\"#222\">\
             <text y=\"30\" font-size=\"18\" font-weight=\"bold\">{title}</text>\
             <text y=\"49\" font-size=\"12\" fill=\"#666\">{}</text></g>\n",
            provenance.version,
            escaped(&provenance.commit),
            provenance.scenario_sha256,
            provenance.seed,
            escaped(&self.scenario.description),
        )
    }

    /// The numbers over a still: angles and loads, with what is read, and from where.
    fn words(&self, index: usize, experiment: &Experiment) -> [String; 2] {
        let commands = self.scenario.task.belief.commands();
        let q = commands.shown(experiment.configuration_rad.as_slice());
        let (load, row) = (&experiment.load, self.rows.get(index));
        let mut loads = match row {
            Some(_) if *load == Load::NONE => "no load".to_owned(),
            _ => unbroken(&format!(
                "F = {} N",
                listed(load.force_n.iter().copied(), 1)
            )),
        };
        if load.torque_nm != Vector3::zeros() {
            let torque = listed(load.torque_nm.iter().copied(), 1);
            let _ = write!(loads, ", {}", unbroken(&format!("T = {torque} N m")));
        }
        if let Some(direction) = &experiment.direction {
            let along = unbroken(&listed(direction.iter().copied(), 4));
            let _ = write!(loads, "; read along {along}");
        }
        if let Some(row) = row {
            let own = &self.scenario.task.belief.calibration_tool.name;
            let _ = write!(
                loads,
                "; reads {}",
                escaped(row.target.as_ref().unwrap_or(own))
            );
            if let Some(station) = &row.station {
                let _ = write!(loads, " from {}", escaped(station));
            }
        }
        [format!("q = {} {}", listed(q, 1), commands.unit()), loads]
    }

    /// A still: the floor, the robot, the line of sight or the gauge, the force; of a whole one with the name of what reads from outside.
    fn picture(&self, svg: &mut String, scene: &Scene, is_whole: bool) {
        let camera = &self.camera;
        let mut painter = Painter::new(camera);
        for (part, mesh) in self.scenery.surfaces(scene) {
            // What is only half in the picture would be hard to make out.
            if part.is_robot || mesh.vertices.iter().all(|corner| camera.is_seen(corner)) {
                painter.add(&mesh, part.rgba);
            }
        }
        let picture = painter.picture();
        let _ = write!(
            svg,
            "<g clip-path=\"url(#still)\"><use href=\"#floor\"/>{picture}"
        );
        let [x, y, _] = camera.see(&scene.read);
        let is_gauge = scene.sight.is_some_and(|sight| sight.is_gauge());
        let sight = scene.sight_ends();
        if let Some([from, _]) = sight.filter(|_| !is_gauge) {
            line_of_sight(svg, camera, scene, &from, is_whole);
        }
        arrow(
            svg,
            camera,
            [&scene.tool, &scene.arrow_end],
            ("#d32f2f", 3.0),
        );
        if let Some([from, to]) = sight.filter(|_| is_gauge) {
            arrow(svg, camera, [&from, &to], (GREEN, 2.4));
        }
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.2\" fill=\"#fff\" stroke=\"#111\" stroke-width=\"1.2\"/></g>"
        );
    }
}

/// The first drawing of a page has what stands once for all.
fn with_shared(drawing: String, index: usize, camera: &Camera) -> String {
    match index {
        0 => drawing.replacen('>', &format!(">{}", shared(camera)), 1),
        _ => drawing,
    }
}

/// A square around the tool and its load (px).
fn close_up(camera: &Camera, scene: &Scene) -> [f64; 4] {
    let [from, to] = [&scene.tool, &scene.arrow_end].map(|point| camera.see(point));
    let side = 2.4 * (to[0] - from[0]).hypot(to[1] - from[1]).max(20.0);
    let corner = |axis: usize| f64::midpoint(from[axis], to[axis]) - 0.5 * side;
    [corner(0), corner(1), side, side]
}

/// What stands once for all stills: the floor is the same in every one.
fn shared(camera: &Camera) -> String {
    let [width, height] = camera.size_px;
    format!(
        "<defs><clipPath id=\"still\"><rect width=\"{width:.1}\" height=\"{height:.1}\" \
         rx=\"6\"/></clipPath>\n<g id=\"floor\">{}</g></defs>",
        floor(camera)
    )
}

/// The floor with its grid, as far as the pictures reach.
fn floor(camera: &Camera) -> String {
    const LINES: i32 = 30;
    let [width, height] = camera.size_px;
    let mut svg = format!("<rect width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{GROUND}\"/>");
    let reach = f64::from(LINES) * GRID_M;
    let corner = |x: f64, y: f64| {
        let [x, y, _] = camera.see(&Point3::new(x, y, 0.0));
        format!("{x:.1},{y:.1}")
    };
    let _ = write!(
        svg,
        "<path fill=\"#dfe3e7\" d=\"M{}L{}L{}L{}z\"/><path fill=\"none\" stroke=\"#c9ced4\" stroke-width=\".7\" d=\"",
        corner(-reach, -reach),
        corner(reach, -reach),
        corner(reach, reach),
        corner(-reach, reach)
    );
    for line in -LINES..=LINES {
        let at = f64::from(line) * GRID_M;
        let _ = write!(svg, "M{}L{}", corner(at, -reach), corner(at, reach));
        let _ = write!(svg, "M{}L{}", corner(-reach, at), corner(reach, at));
    }
    svg.push_str("\"/>");
    svg
}

/// The line from an instrument to what it reads; where the instrument is not in the picture, with what it is and how far away.
fn line_of_sight(
    svg: &mut String,
    camera: &Camera,
    scene: &Scene,
    from: &Point3<f64>,
    is_named: bool,
) {
    let [x, y, _] = camera.see(&scene.read);
    let [from_x, from_y, _] = camera.see(from);
    let class = match scene.station {
        Some(_) => "station",
        None => "tracker",
    };
    let _ = write!(
        svg,
        "<path class=\"{class}\" stroke=\"{GREEN}\" stroke-width=\"1.2\" stroke-dasharray=\"5 3\" \
         d=\"M{from_x:.1},{from_y:.1}L{x:.1},{y:.1}\"/>"
    );
    if camera.is_seen(from) {
        if scene.station.is_some() {
            let _ = write!(
                svg,
                "<circle cx=\"{from_x:.1}\" cy=\"{from_y:.1}\" r=\"5\" fill=\"{GREEN}\"/>"
            );
        }
        return;
    }
    if !is_named {
        return;
    }
    // In the lower corner on that side, where there is floor.
    let [width, height] = camera.size_px;
    let metres = (from - scene.read).norm();
    let name = escaped(scene.station.as_deref().unwrap_or("tracker"));
    let (x, anchor, words) = if from_x < x {
        (8.0, "start", format!("\u{25c2} {name}, {metres:.1} m"))
    } else {
        (
            width - 8.0,
            "end",
            format!("{name}, {metres:.1} m \u{25b8}"),
        )
    };
    let _ = write!(
        svg,
        "<text x=\"{x:.1}\" y=\"{:.1}\" font-size=\"12\" fill=\"{GREEN}\" stroke=\"{GROUND}\" stroke-width=\"4\" \
         paint-order=\"stroke\" text-anchor=\"{anchor}\">{words}</text>",
        height - 9.0
    );
}

/// An arrow in a colour, so thick (px).
fn arrow(svg: &mut String, camera: &Camera, ends: [&Point3<f64>; 2], (colour, thick): (&str, f64)) {
    const HEAD_PX: f64 = 11.0;
    let [[x, y, _], [end_x, end_y, _]] = ends.map(|end| camera.see(end));
    let (dx, dy) = (end_x - x, end_y - y);
    let length = dx.hypot(dy);
    if length < 1.0 {
        return;
    }
    let (dx, dy) = (dx / length, dy / length);
    let (back_x, back_y) = (end_x - dx * HEAD_PX, end_y - dy * HEAD_PX);
    let half = 0.42 * HEAD_PX;
    let _ = write!(
        svg,
        "<path stroke=\"{colour}\" stroke-width=\"{thick}\" d=\"M{x:.1},{y:.1}L{back_x:.1},{back_y:.1}\"/>\
         <path fill=\"{colour}\" d=\"M{end_x:.1},{end_y:.1}L{:.1},{:.1}L{:.1},{:.1}z\"/>",
        back_x - dy * half,
        back_y + dx * half,
        back_x + dy * half,
        back_y - dx * half
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mujoco::Shape;
    use crate::plan::read_plan;
    use crate::view::mesh::Mesh;

    fn project(path: &str) -> std::path::PathBuf {
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
    }

    fn sheet_of(name: &str, plan: &str) -> String {
        let path = project(&format!("scenarios/{name}.toml"));
        let scenario = Scenario::load(&path).expect("the scenario is valid");
        let plan =
            read_plan(&project(plan), scenario.task.belief.commands()).expect("the plan is valid");
        Stills::of_plan(&scenario, &plan).sheet()
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
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
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
        let svg = Stills::of_plan(&scenario, &plan).sheet();
        assert!(svg.contains(">4 x<") && !svg.contains("NaN"));
        for svg in [svg, Stills::of_plan(&scenario, &Plan::default()).sheet()] {
            roxmltree::Document::parse(&svg).expect("well-formed");
        }
    }
}
