//! What acts on the arms in a step, as both recordings draw it.

use nalgebra::Vector3;

use super::{Body, Recording, ShownTool, Step};
use crate::mujoco::State;
use crate::task::Instrument;
use crate::text::wording::micrometres;

/// How far labels are from what they name (m).
const LABEL_AWAY_M: f64 = 0.3;
// Labels take the colour of what they name, and viewers put them on dark ground.
const FORCE_RGB: [u8; 3] = [255, 100, 100];
const DEFLECTION_RGB: [u8; 3] = [255, 200, 40];
const SIGHT_RGB: [u8; 3] = [40, 200, 110];
/// How long the arrow of a gauge is drawn (m).
const GAUGE_M: f64 = 0.35;

/// How a target is read, as all pictures show it: by a line of sight, or by an arrow the way that a gauge reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SightLine {
    /// Whether a gauge reads.
    pub is_gauge: bool,
    /// From where to where it is drawn (m).
    pub ends_m: [Vector3<f64>; 2],
}

impl SightLine {
    /// Of a target (m) along a gauge's direction (unit vector), or from a station (m), or from the model's tracker, if something says so.
    pub fn new(
        instrument: &Instrument,
        state: &State,
        target_m: Vector3<f64>,
        direction: Option<Vector3<f64>>,
        station_m: Option<Vector3<f64>>,
    ) -> Option<Self> {
        let tracker_m = || Some(state.site(instrument.tracker_site?).0);
        let ends_m = match direction {
            Some(direction) => [target_m, target_m + direction * GAUGE_M],
            None => [station_m.or_else(tracker_m)?, target_m],
        };
        let is_gauge = direction.is_some();
        Some(Self { is_gauge, ends_m })
    }
}

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
    /// Deflection, force and, where one is known in any step, line of sight or gauge.
    pub fn annotations(&self, step: &Step) -> Vec<Annotation> {
        let [tool_m, _, enlarged_m] = step.arms.each_ref().map(|arm| arm.tool_m);
        let label = displacement_label(step);
        let deflection_m = step.did.displacement_m() * step.enlargement;
        let force = step.force_arrow_m;
        let force = force.map(|force| [enlarged_m, enlarged_m + force]);
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
        let sights = [("tracker_line", false, 0.006), ("gauge", true, 0.022)];
        for ((name, is_gauge, radius_m), is_known) in sights.into_iter().zip(self.has_sights) {
            let sight = step.sight.filter(|sight| sight.is_gauge == is_gauge);
            drawn.extend(is_known.then(|| Annotation {
                name,
                is_arrow: is_gauge,
                ends_m: sight.map(|sight| sight.ends_m),
                radius_m,
                rgb: SIGHT_RGB,
                label: None,
            }));
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
    let length_mm = step.did.displacement_m().norm() * 1e3;
    let (length, times) = (micrometres(Some(length_mm)), step.enlargement);
    (length_mm > 0.0).then(|| format!("{length} (drawn {times} times as long)"))
}
