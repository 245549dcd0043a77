//! A sheet of stills: the robot in each configuration of a plan, so that a person sees what it will do.
//!
//! The pictures are orthographic, all from the same side: the one that shows the arms at their widest.
//! Deflections of some millimetres would not show; the arm stands at the commanded angles.

mod painter;

use std::fmt::Write;

use nalgebra::{Point3, Vector3};

use self::painter::{Camera, Painter};
use super::markup::escaped;
use super::mesh::Mesh;
use super::recording::{LAST_SHOWN_GROUP, is_moved};
use crate::experiment::Candidate;
use crate::mujoco::{Geometry, Shape, State};
use crate::plan::{Experiment, Plan};
use crate::record::messages::ProvenanceMessage;
use crate::robot::{Commands, Load, SerialChain, Tool};
use crate::scenario::Scenario;
use crate::task::station_named;
use crate::text::wording::counted;

/// The width of a still and the space between stills (px).
const STILL_PX: f64 = 400.0;
const GAP_PX: f64 = 20.0;
/// The height of the lines of text over a still and over the sheet (px).
const CAPTION_PX: f64 = 40.0;
const HEADING_PX: f64 = 62.0;
/// The most stills in a row.
const COLUMNS: usize = 3;
/// How far above the horizontal the viewer stands (rad).
const ELEVATION: f64 = 0.33;
/// The length of the largest force's arrow (m).
const ARROW_M: f64 = 0.55;
/// The side of a square of the floor's grid (m).
const GRID_M: f64 = 0.5;
/// Fixed things whose middle is nearer to axis 1 than this are always in the picture (m).
const NEAR_M: f64 = 1.0;
/// A station that is further away from what is read is not in the picture, but so much of the line of sight (m).
const FAR_M: f64 = 5.0;
const LEAVES_M: f64 = 1.5;

/// What a still shows.
struct Scene {
    /// Surfaces in world coordinates with their colours.
    surfaces: Vec<(Mesh, [f32; 4])>,
    /// Which of them have to be in the picture: the robot.
    is_robot: Vec<bool>,
    tool: Point3<f64>,
    arrow_end: Point3<f64>,
    /// What is read.
    read: Point3<f64>,
    /// Where the instrument stands.
    tracker: Option<Point3<f64>>,
    /// Whether the plan says so: the model has nothing there.
    is_planned: bool,
}

/// The sheet as an SVG document.
pub fn sheet(scenario: &Scenario, plan: &Plan) -> String {
    sheet_of(scenario, plan, &[])
}

/// The sheet of a plan of absolute readings, each so often: with what is read, and from where.
pub fn sheet_of_readings(scenario: &Scenario, readings: &[(&Candidate, u32)]) -> String {
    let (plan, rows) = plan_of(readings);
    sheet_of(scenario, &plan, &rows)
}

/// The stills as figures of a page.
pub fn figures(scenario: &Scenario, plan: &Plan) -> String {
    figures_of(scenario, plan, &[])
}

/// Those of a plan of absolute readings, each so often.
pub fn figures_of_readings(scenario: &Scenario, readings: &[(&Candidate, u32)]) -> String {
    let (plan, rows) = plan_of(readings);
    figures_of(scenario, &plan, &rows)
}

/// Absolute readings as experiments, with what is read in each.
fn plan_of<'a>(readings: &[(&'a Candidate, u32)]) -> (Plan, Vec<&'a Candidate>) {
    let experiments = readings.iter().map(|(row, repeats)| Experiment {
        configuration_rad: row.configuration_rad.clone(),
        load: row.load.unwrap_or(Load::NONE),
        repeats: *repeats,
        approach: row.approach.clone(),
    });
    let plan = Plan {
        experiments: experiments.collect(),
    };
    (plan, readings.iter().map(|(row, _)| *row).collect())
}

fn figures_of(scenario: &Scenario, plan: &Plan, rows: &[&Candidate]) -> String {
    let scenes = scenes(scenario, plan, rows);
    let camera = camera(&scenes);
    let commands = scenario.task.belief.commands();
    let mut figures = String::new();
    for (index, (experiment, scene)) in plan.experiments.iter().zip(&scenes).enumerate() {
        let of_reading = rows.get(index).map(|row| read_words(scenario, row));
        let [angles, loads] = words(&commands, experiment, of_reading.as_deref());
        let number = index + 1;
        let drawing = framed(&camera, scene, None, &format!("Experiment {number}"));
        let _ = writeln!(
            figures,
            "<figure class=\"still\"><figcaption><b>{number}</b> {angles}; <b>{} x</b><br><span class=\"load\">{loads}</span>\
             </figcaption>{}</figure>",
            experiment.repeats,
            with_shared(drawing, index, &camera)
        );
    }
    figures
}

/// The sheet of a plan; of absolute readings, `rows` say what is read in each experiment, and from where.
fn sheet_of(scenario: &Scenario, plan: &Plan, rows: &[&Candidate]) -> String {
    let scenes = scenes(scenario, plan, rows);
    let camera = camera(&scenes);
    let [still_width, still_height] = camera.size_px;
    let columns = plan.experiments.len().clamp(1, COLUMNS);
    let lines = plan.experiments.len().div_ceil(columns);
    let place =
        |count: usize, size: f64| f64::from(u32::try_from(count).unwrap_or(u32::MAX)) * size;
    // The heading needs the room of two stills.
    let width = GAP_PX + place(columns, still_width + GAP_PX).max(2.0 * (STILL_PX + GAP_PX));
    let height = HEADING_PX + place(lines, CAPTION_PX + still_height + GAP_PX);
    let mut svg = String::new();
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" \
         width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"Helvetica, Arial, sans-serif\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{}",
        heading(
            scenario,
            plan,
            if rows.is_empty() {
                "measurement"
            } else {
                "absolute reading"
            }
        )
    );
    let _ = writeln!(svg, "{}", shared(&camera));
    for (index, (experiment, scene)) in plan.experiments.iter().zip(&scenes).enumerate() {
        let x = GAP_PX + place(index % columns, still_width + GAP_PX);
        let y = HEADING_PX + place(index / columns, CAPTION_PX + still_height + GAP_PX);
        let _ = write!(
            svg,
            "<g class=\"still\" transform=\"translate({x:.1} {y:.1})\">"
        );
        let commands = scenario.task.belief.commands();
        let of_reading = rows.get(index).map(|row| read_words(scenario, row));
        let words = words(&commands, experiment, of_reading.as_deref());
        caption(&mut svg, &words, index + 1, experiment.repeats, still_width);
        picture(&mut svg, &camera, scene);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Pictures of an experiment for the sheet that is taken to the laboratory.
pub struct Pictures {
    /// The robot without a load.
    pub unloaded: String,
    /// Where its load hangs.
    pub load: String,
}

/// Those of each experiment of a plan, for one page.
pub fn pictures(scenario: &Scenario, plan: &Plan) -> Vec<Pictures> {
    let scenes = scenes(scenario, plan, &[]);
    let camera = camera(&scenes);
    (scenes.into_iter().enumerate())
        .map(|(index, mut scene)| {
            let number = index + 1;
            let label = format!("Where the load of experiment {number} hangs");
            let load = framed(&camera, &scene, Some(close_up(&camera, &scene)), &label);
            scene.arrow_end = scene.tool;
            let label = format!("Experiment {number} without load");
            let unloaded = framed(&camera, &scene, None, &label);
            let unloaded = with_shared(unloaded, index, &camera);
            Pictures { unloaded, load }
        })
        .collect()
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

/// A scene as a drawing of its own: all of it, or what is in a box.
fn framed(camera: &Camera, scene: &Scene, within: Option<[f64; 4]>, label: &str) -> String {
    let [x, y, width, height] = within.unwrap_or([0.0, 0.0, camera.size_px[0], camera.size_px[1]]);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{x:.1} {y:.1} {width:.1} {height:.1}\" width=\"{width:.0}\" \
         height=\"{height:.0}\" role=\"img\" aria-label=\"{}\"><g transform=\"translate(0 -{CAPTION_PX})\">",
        escaped(label)
    );
    picture(&mut svg, camera, scene);
    svg + "</g></svg>"
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

/// The robot in every configuration.
fn scenes(scenario: &Scenario, plan: &Plan, rows: &[&Candidate]) -> Vec<Scene> {
    let robot = &scenario.task.belief.nominal;
    let targets: Vec<Option<Tool>> = (rows.iter())
        .map(|row| SerialChain::tool(&robot.model, row.target.as_ref()?).ok())
        .collect();
    let shown: Vec<(Geometry, Mesh)> = (robot.model.scenery().into_iter())
        .filter(|each| each.group <= LAST_SHOWN_GROUP && each.shape != Shape::Plane)
        .map(|each| {
            let mesh = Mesh::new(&each.shape);
            (each, mesh)
        })
        .collect();
    let moves: Vec<bool> = (shown.iter())
        .map(|(each, _)| is_moved(&robot.model, robot.model.geometry_body(each.id)))
        .collect();
    let largest_n = (plan.experiments.iter())
        .map(|each| each.load.force_n.norm())
        .fold(f64::MIN_POSITIVE, f64::max);
    let mut state = State::new(&robot.model);
    (plan.experiments.iter().enumerate())
        .map(|(index, experiment)| {
            let q = experiment.configuration_rad.as_slice();
            let calibration = &scenario.task.belief.calibration_tool;
            let tool = place_of(&robot.chain, calibration, q);
            let target = targets.get(index).and_then(Option::as_ref);
            let station = (rows.get(index))
                .and_then(|row| station_named(&scenario.task.stations, row.station.as_deref()));
            state.move_to(q);
            let posed = |(each, mesh): &(Geometry, Mesh)| {
                let mesh = mesh.clone().transformed(&state.geometry_pose(each.id));
                (mesh, each.rgba)
            };
            let surfaces: Vec<_> = shown.iter().map(posed).collect();
            let near = |(mesh, _): &(Mesh, _)| {
                let is_near = |corner: &Point3<f64>| corner.x.hypot(corner.y) < NEAR_M;
                mesh.vertices.iter().all(is_near)
            };
            Scene {
                is_robot: (surfaces.iter().zip(&moves))
                    .map(|(surface, moves)| *moves || near(surface))
                    .collect(),
                surfaces,
                arrow_end: tool + experiment.load.force_n * (ARROW_M / largest_n),
                tool,
                read: target.map_or(tool, |target| place_of(&robot.chain, target, q)),
                // Where no station has a place of its own, the model's tracker is where all are.
                tracker: match station {
                    Some(station) => Some(Point3::from(station.position_m)),
                    None => (scenario.task.belief.instrument.tracker_site)
                        .map(|site| Point3::from(state.site(site).0)),
                },
                is_planned: station.is_some(),
            }
        })
        .collect()
}

fn place_of(chain: &SerialChain, tool: &Tool, q: &[f64]) -> Point3<f64> {
    Point3::from(chain.at(tool).state(q).tool_position)
}

/// What a reading is of, and from where.
fn read_words(scenario: &Scenario, row: &Candidate) -> String {
    let own = &scenario.task.belief.calibration_tool.name;
    let target = row.target.as_ref().unwrap_or(own);
    match &row.station {
        Some(station) => format!("reads {target} from {station}"),
        None => format!("reads {target}"),
    }
}

/// A camera that sees all stills alike, from the side that shows the arms at their widest.
fn camera(scenes: &[Scene]) -> Camera {
    let reach = |azimuth: f64| -> f64 {
        let across = Vector3::new(-azimuth.sin(), azimuth.cos(), 0.0);
        (scenes.iter())
            .map(|scene| scene.tool.coords.dot(&across).abs())
            .sum()
    };
    // The first of equals: with the arm along x, from the right and a little from the front.
    let azimuth = (0..8)
        .map(|step| (f64::from(step) * 45.0 - 70.0).to_radians())
        .reduce(|best, other| {
            if reach(other) > reach(best) * 1.01 {
                other
            } else {
                best
            }
        })
        .unwrap_or(0.0);
    let mut points = vec![Point3::origin()];
    for scene in scenes {
        let robot = scene.surfaces.iter().zip(&scene.is_robot);
        for ((mesh, _), _) in robot.filter(|(_, is_robot)| **is_robot) {
            points.extend(&mesh.vertices);
        }
        // A place for the arrow and the tripod.
        points.push(scene.arrow_end);
        points.push(scene.read);
        if let Some(tracker) = scene.tracker {
            let away = tracker - scene.read;
            if scene.is_planned && away.norm() > FAR_M {
                // The line leaves the picture: the robot would be lost in it.
                points.push(scene.read + away * (LEAVES_M / away.norm()));
                continue;
            }
            for (x, y) in [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)] {
                points.push(tracker + Vector3::new(x, y, 0.2));
                points.push(Point3::new(tracker.x + x, tracker.y + y, 0.0));
            }
        }
    }
    let margin = Vector3::new(0.12, 0.12, 0.12);
    let spread: Vec<_> = (points.iter())
        .flat_map(|point| [point + margin, point - margin])
        .collect();
    Camera::new(azimuth, ELEVATION).framing(&spread, STILL_PX)
}

/// What the sheet is about.
fn heading(scenario: &Scenario, plan: &Plan, what: &str) -> String {
    let ProvenanceMessage {
        version,
        commit,
        scenario_sha256,
        seed,
        ..
    } = ProvenanceMessage::new(scenario);
    let name = escaped(&scenario.name);
    let title = format!(
        "{name}: {} in {}",
        counted(plan.measurements().into(), what),
        counted(plan.experiments.len() as u64, "configuration")
    );
    format!(
        "<title>{title}</title>\n<desc>elastocal {version} ({}), scenario {scenario_sha256}, seed {seed}</desc>\n\
         <g transform=\"translate({GAP_PX} 0)\" fill=\"#222\">\
         <text y=\"30\" font-size=\"18\" font-weight=\"bold\">{title}</text>\
         <text y=\"49\" font-size=\"12\" fill=\"#666\">{}</text></g>\n",
        escaped(&commit),
        escaped(&scenario.description),
    )
}

/// The numbers over a still: angles and loads, with what is read.
fn words(commands: &Commands, experiment: &Experiment, read: Option<&str>) -> [String; 2] {
    let q = commands.shown(experiment.configuration_rad.as_slice());
    let q: Vec<_> = q.into_iter().map(short).collect();
    let vector = |values: &Vector3<f64>| {
        let values: Vec<_> = values.iter().map(|&value| short(value)).collect();
        values.join(", ")
    };
    let load = &experiment.load;
    let mut loads = match read {
        Some(_) if *load == Load::NONE => "no load".to_owned(),
        _ => format!("F = {} N", vector(&load.force_n)),
    };
    if load.torque_nm != Vector3::zeros() {
        let _ = write!(loads, ", T = {} N m", vector(&load.torque_nm));
    }
    if let Some(read) = read {
        let _ = write!(loads, "; {}", escaped(read));
    }
    [format!("q = {} {}", q.join(", "), commands.unit()), loads]
}

/// They stand over a still of a sheet.
fn caption(
    svg: &mut String,
    [angles, loads]: &[String; 2],
    number: usize,
    repeats: u32,
    width: f64,
) {
    let _ = write!(
        svg,
        "<g fill=\"#222\" font-size=\"13\"><text y=\"14\"><tspan font-weight=\"bold\">{number}</tspan>\
         <tspan x=\"20\">{angles}</tspan></text><text x=\"20\" y=\"31\" fill=\"#b3261e\">{loads}</text>\
         <text x=\"{width:.0}\" y=\"31\" text-anchor=\"end\" font-weight=\"bold\">{repeats} x</text></g>"
    );
}

/// With one decimal, and none where it would be a zero.
fn short(value: f64) -> String {
    let text = format!("{value:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// The floor with its grid, as far as the pictures reach.
fn floor(camera: &Camera) -> String {
    const LINES: i32 = 30;
    let [width, height] = camera.size_px;
    let mut svg = format!("<rect width=\"{width:.1}\" height=\"{height:.1}\" fill=\"#eef1f4\"/>");
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

/// A still: the floor, the robot, the tracker's line, the force.
fn picture(svg: &mut String, camera: &Camera, scene: &Scene) {
    let mut painter = Painter::new(camera);
    for ((mesh, rgba), is_robot) in scene.surfaces.iter().zip(&scene.is_robot) {
        // What is only half in the picture would be hard to make out.
        if *is_robot || mesh.vertices.iter().all(|corner| camera.is_seen(corner)) {
            painter.add(mesh, *rgba);
        }
    }
    let _ = write!(
        svg,
        "<g transform=\"translate(0 {CAPTION_PX})\" clip-path=\"url(#still)\"><use href=\"#floor\"/>\
         <g transform=\"scale(.1)\" fill=\"currentColor\" stroke=\"currentColor\" stroke-width=\"5\" \
         stroke-linejoin=\"round\">{}</g>",
        painter.paint()
    );
    let [x, y, _] = camera.see(&scene.read);
    if let Some(tracker) = &scene.tracker {
        let [from_x, from_y, _] = camera.see(tracker);
        let _ = write!(
            svg,
            "<path stroke=\"#0a7d4f\" stroke-width=\"1.2\" stroke-dasharray=\"5 3\" \
             d=\"M{from_x:.1},{from_y:.1}L{x:.1},{y:.1}\"/>"
        );
        if scene.is_planned {
            let _ = write!(
                svg,
                "<circle class=\"station\" cx=\"{from_x:.1}\" cy=\"{from_y:.1}\" r=\"5\" fill=\"#0a7d4f\"/>"
            );
        }
    }
    arrow(svg, camera, scene);
    let _ = write!(
        svg,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.2\" fill=\"#fff\" stroke=\"#111\" stroke-width=\"1.2\"/></g>"
    );
}

/// The force as an arrow that starts at the tool.
fn arrow(svg: &mut String, camera: &Camera, scene: &Scene) {
    const HEAD_PX: f64 = 11.0;
    let [x, y, _] = camera.see(&scene.tool);
    let [end_x, end_y, _] = camera.see(&scene.arrow_end);
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
        "<path stroke=\"#d32f2f\" stroke-width=\"3\" d=\"M{x:.1},{y:.1}L{back_x:.1},{back_y:.1}\"/>\
         <path fill=\"#d32f2f\" d=\"M{end_x:.1},{end_y:.1}L{:.1},{:.1}L{:.1},{:.1}z\"/>",
        back_x - dy * half,
        back_y + dx * half,
        back_x + dy * half,
        back_y - dx * half
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::read_plan;
    use crate::robot::Load;

    fn project(path: &str) -> std::path::PathBuf {
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
    }

    fn sheet_of(name: &str, plan: &str) -> String {
        let path = project(&format!("scenarios/{name}.toml"));
        let scenario = Scenario::load(&path).expect("the scenario is valid");
        let plan =
            read_plan(&project(plan), scenario.task.belief.commands()).expect("the plan is valid");
        sheet(&scenario, &plan)
    }

    /// Every tag is closed in turn, and attributes are quoted; returns the names of the elements.
    fn elements(svg: &str) -> Vec<&str> {
        let mut open = Vec::new();
        let mut elements = Vec::new();
        for tag in svg.split('<').skip(1) {
            let (tag, text) = tag.split_once('>').expect("the tag ends");
            assert!(!text.contains('&') || text.contains(';'));
            assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
            if let Some(name) = tag.strip_prefix('/') {
                assert_eq!(open.pop(), Some(name));
                continue;
            }
            let name = tag.split([' ', '/']).next().unwrap_or_default();
            elements.push(name);
            if !tag.ends_with('/') {
                open.push(name);
            }
        }
        assert!(open.is_empty(), "{open:?}");
        elements
    }

    #[test]
    fn a_sheet_is_well_formed_with_a_still_for_every_configuration() {
        let svg = sheet_of("klimchik2012", "scenarios/plans/klimchik2012_m12.csv");
        let elements = elements(&svg);
        assert_eq!(elements[0], "svg");
        assert_eq!(svg.matches("class=\"still\"").count(), 12);
        assert_eq!(svg.matches(" 1 x").count(), 0);
        assert_eq!(svg.matches(">1 x<").count(), 12);
        assert!(svg.contains("q = 0, -83.8, 127.6, -120, -60.9, -173.8 deg"));
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
    fn of_two_boxes_the_nearer_is_painted_last() {
        // Seen from -y, with the farther one larger.
        let cuboid = |y: f64| {
            let pose = nalgebra::Isometry3::translation(0.0, y, 0.0);
            Mesh::new(&Shape::Box(Vector3::repeat(0.5 + 0.2 * y))).transformed(&pose)
        };
        let colours = [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
        let boxes = [cuboid(-1.0), cuboid(1.0)];
        let points = boxes.each_ref().map(|each| each.vertices.clone()).concat();
        let camera = Camera::new(-90_f64.to_radians(), 0.0).framing(&points, 100.0);
        for order in [[0, 1], [1, 0]] {
            let mut painter = Painter::new(&camera);
            for index in order {
                painter.add(&boxes[index], colours[index]);
            }
            let svg = painter.paint();
            let painted: Vec<_> = svg
                .split("color=\"#")
                .skip(1)
                .map(|path| &path[..2])
                .collect();
            assert_eq!(painted.len(), 2);
            assert!(painted[0] == "00" && painted[1] != "00", "{svg}");
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
        };
        let plan = Plan {
            experiments: vec![experiment],
        };
        let svg = sheet(&scenario, &plan);
        elements(&svg);
        assert!(svg.contains(">4 x<") && !svg.contains("NaN"));
        assert_eq!(elements(&sheet(&scenario, &Plan::default()))[0], "svg");
    }
}
