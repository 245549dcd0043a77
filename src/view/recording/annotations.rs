//! What acts on the arms in a step, as both recordings draw it.

use nalgebra::Vector3;

use super::{Body, Recording, ShownTool, Step};

/// How far labels are from what they name (m).
const LABEL_AWAY_M: f64 = 0.3;
// Labels take the colour of what they name, and viewers put them on dark ground.
const FORCE_RGB: [u8; 3] = [255, 100, 100];
const DEFLECTION_RGB: [u8; 3] = [255, 200, 40];
const TRACKER_RGB: [u8; 3] = [40, 200, 110];

/// An arrow or a line.
#[derive(Debug, Clone)]
pub struct Annotation {
    /// What it is.
    pub name: &'static str,
    /// Whether it has a head.
    pub is_arrow: bool,
    /// From where to where (m), if it is there in this step.
    pub ends_m: Option<[Vector3<f64>; 2]>,
    /// Half its thickness (m).
    pub radius_m: f32,
    /// Red, green and blue.
    pub rgb: [u8; 3],
    /// Its label, with its place (m).
    pub label: Option<(Vector3<f64>, String)>,
}

impl Recording {
    /// Deflection, force and, where one is known in any step, line of sight.
    pub fn annotations(&self, step: &Step) -> Vec<Annotation> {
        let tool_m = step.unloaded.tool_m;
        let label = displacement_label(step);
        let deflection_m = step.displacement_m() * step.enlargement;
        let force = step.force_arrow_m;
        let force = force.map(|force| [step.enlarged.tool_m, step.enlarged.tool_m + force]);
        let mut drawn = vec![
            Annotation {
                name: "deflection",
                is_arrow: true,
                ends_m: label.as_ref().map(|_| [tool_m, tool_m + deflection_m]),
                radius_m: 0.014,
                rgb: DEFLECTION_RGB,
                // Away from the arrows, where labels would hide them and the arm.
                label: label.map(|label| (tool_m + Vector3::z() * LABEL_AWAY_M, label)),
            },
            Annotation {
                name: "force",
                is_arrow: true,
                ends_m: force,
                radius_m: 0.018,
                rgb: FORCE_RGB,
                label: force.zip(step.load_label()).map(|([from, tip], label)| {
                    let behind = (tip - from).normalize() * (LABEL_AWAY_M / 2.5);
                    (tip + behind, label)
                }),
            },
        ];
        if self.has_lines_of_sight {
            drawn.push(Annotation {
                name: "tracker_line",
                is_arrow: false,
                ends_m: step.instrument_m.map(|from| [from, tool_m]),
                radius_m: 0.006,
                rgb: TRACKER_RGB,
                label: None,
            });
        }
        drawn
    }

    /// The links that are there with one tool alone, and whether this is the one.
    pub fn tools(&self, tool: ShownTool) -> impl Iterator<Item = (&Body, bool)> {
        let links = self.links.iter();
        links.filter_map(move |body| Some((body, body.only_with? == tool)))
    }
}

/// The deflection of the tool as it is drawn, in words; none where nothing bends it.
fn displacement_label(step: &Step) -> Option<String> {
    let micrometres = step.displacement_m().norm() * 1e6;
    if micrometres <= 0.0 {
        return None;
    }
    let length = if micrometres < 100.0 {
        format!("{micrometres:.1} µm")
    } else {
        format!("{:.3} mm", micrometres * 1e-3)
    };
    let times = step.enlargement;
    Some(format!("{length} (drawn {times} times as long)"))
}
