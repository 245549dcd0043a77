//! Whether an experiment is possible: the bounds of the region, and what MuJoCo says of collisions
//! and of the tracker's sight, for the unloaded and the loaded robot.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::region::{SmoothBound, bounds_of};
use super::{Experiment, Plan};
use crate::mujoco::State;
use crate::robot::{EquilibriumError, EquilibriumSolver, KinematicState, Kinematics, Load, Tool};
use crate::task::{Belief, Station, Task};

/// Bounds may be missed by this much (m, sine, or share of a torque) through rounding alone.
const ROUNDING: f64 = 1e-9;

/// The kind of a violation by a collision.
pub(super) const COLLISION: &str = "collision clearance";

/// One thing that makes an experiment impossible.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Violation {
    /// The experiment's number in the plan, from 1; none where the plan as a whole is impossible.
    pub experiment: Option<usize>,
    /// What is wrong: "tool height", "`joint_3`", "collision of floor and `link_6`" ...
    pub what: String,
    /// The value found, in `unit`; NaN where it is no single number.
    pub found: f64,
    /// The bound, in `unit`.
    pub bound: f64,
    /// The unit of both.
    pub unit: &'static str,
    /// What is found and what is allowed, where that is no single number.
    #[serde(skip)]
    pub words: Option<String>,
}

impl Violation {
    /// What is wrong in words, without a number.
    fn in_words(experiment: Option<usize>, what: &str, words: String) -> Self {
        Self {
            experiment,
            what: what.to_owned(),
            found: f64::NAN,
            bound: f64::NAN,
            unit: "",
            words: Some(words),
        }
    }

    /// What is found of an experiment, with its bound in the same unit.
    fn of_size(number: usize, what: String, found: f64, bound: f64, unit: &'static str) -> Self {
        Self {
            experiment: Some(number),
            what,
            found,
            bound,
            unit,
            words: None,
        }
    }

    /// The constraint that is violated, without the names of the geometries.
    pub fn kind(&self) -> String {
        match self.what.split_once(" of ") {
            Some(("distance", _)) => COLLISION.to_owned(),
            _ if self.what.starts_with("free line of sight") => "line of sight".to_owned(),
            _ => self.what.clone(),
        }
    }
}

impl std::fmt::Display for Violation {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            experiment,
            what,
            found,
            bound,
            unit,
            words,
        } = self;
        if let Some(experiment) = experiment {
            write!(formatter, "experiment {experiment}: ")?;
        }
        if let Some(words) = words {
            return formatter.write_str(words);
        }
        write!(
            formatter,
            "{what} is {found:.3} {unit}; the bound is {bound:.3} {unit}"
        )
    }
}

/// What the instrument looks at, and from where.
#[derive(Debug, Clone, Copy)]
pub struct LookingAt<'a> {
    /// What is read.
    pub target: &'a Tool,
    /// The station; none for the scenario's one tracker.
    pub station: Option<&'a Station>,
}

impl<'a> LookingAt<'a> {
    /// What is looked at where deflections are read: the calibration tool, by the one tracker.
    const fn of_deflections(task: &'a Task) -> Self {
        Self {
            target: &task.belief.calibration_tool,
            station: None,
        }
    }

    /// Whether a station says from how far, or at which angle, it can read.
    const fn has_limits(&self) -> bool {
        match self.station {
            None => false,
            Some(station) => {
                station.incidence_max_rad.is_some() || !matches!(station.range_m, [None, None])
            }
        }
    }
}

/// Judges experiments against a task's region.
#[derive(Debug)]
pub struct Feasibility<'a> {
    task: &'a Task,
    bounds: Vec<SmoothBound>,
    state: KinematicState,
    solver: EquilibriumSolver,
    simulation: Option<State>,
}

impl<'a> Feasibility<'a> {
    /// A judge for a task's region.
    pub fn new(task: &'a Task) -> Self {
        let region = &task.region;
        let simulation =
            (region.collision_clearance_m.is_some() || region.line_of_sight).then(|| {
                let clearance = region.collision_clearance_m.unwrap_or(0.0);
                State::new(&task.belief.nominal.model.with_clearance(clearance))
            });
        Self {
            bounds: bounds_of(region),
            state: KinematicState::new(task.belief.joints()),
            solver: EquilibriumSolver::new(task.belief.joints()),
            task,
            simulation,
        }
    }

    /// Every violation of a plan.
    pub fn violations(&mut self, plan: &Plan) -> Vec<Violation> {
        let mandatory = &self.task.design.mandatory;
        let missing = plan.beside_mandatory(mandatory).err();
        let missing = missing
            .map(|missing| Violation::in_words(None, "mandatory experiment", missing.to_string()));
        let each = plan.experiments.iter().enumerate();
        let of_experiments =
            each.flat_map(|(index, experiment)| self.violations_of(index + 1, experiment));
        missing.into_iter().chain(of_experiments).collect()
    }

    /// Every violation of one experiment, whose number in the plan is given.
    pub fn violations_of(&mut self, number: usize, experiment: &Experiment) -> Vec<Violation> {
        let looking = LookingAt::of_deflections(self.task);
        self.violations_of_reading(number, experiment, looking)
    }

    /// The same where something may be read, from somewhere.
    pub fn violations_of_reading(
        &mut self,
        number: usize,
        experiment: &Experiment,
        looking: LookingAt<'_>,
    ) -> Vec<Violation> {
        let words = self.task.loads.outside(&experiment.load);
        let mut violations: Vec<_> = words
            .map(|words| Violation::in_words(Some(number), "load", words))
            .into_iter()
            .collect();
        violations.extend(self.violated_ranges(number, experiment));
        let q = experiment.configuration_rad.as_slice();
        violations.extend(self.violated_bounds(number, q, &experiment.load));
        violations.extend(self.forbidden(q).map(|(index, (joint, found), bound)| {
            let drive = self.task.belief.nominal.chain.joints[joint].drive;
            let (found, unit) = drive.shown(found);
            Violation::of_size(
                number,
                format!("largest joint distance from forbidden configuration {index}"),
                found,
                drive.shown(bound).0,
                unit,
            )
        }));
        if self.simulation.is_some() || looking.has_limits() {
            for load in [Load::NONE, experiment.load] {
                match self.seen_violations(number, q, &load, looking) {
                    Ok(found) => violations.extend(found),
                    Err(error) => {
                        let error = error.to_string();
                        violations.push(Violation::in_words(Some(number), &error, error.clone()));
                    }
                }
            }
            violations.dedup_by(|one, other| one.what == other.what);
        }
        violations
    }

    /// Whether MuJoCo finds the experiment free of collisions and in the tracker's sight, unloaded
    /// and loaded, where the region asks for that, and away from forbidden configurations.
    pub fn is_clear(&mut self, q: &[f64], load: &Load) -> bool {
        if self.forbidden(q).is_some() {
            return false;
        }
        let looking = LookingAt::of_deflections(self.task);
        self.simulation.is_none()
            || [Load::NONE, *load].iter().all(|load| {
                self.seen_violations(0, q, load, looking)
                    .is_ok_and(|violations| violations.is_empty())
            })
    }

    /// The pairs of geometries that come too near to each other in an experiment, unloaded or loaded.
    pub(super) fn colliding_pairs(&mut self, experiment: &Experiment) -> BTreeSet<[String; 2]> {
        let (Some(simulation), Some(clearance)) =
            (&mut self.simulation, self.task.region.collision_clearance_m)
        else {
            return BTreeSet::new();
        };
        let Belief {
            nominal,
            calibration_tool,
            ..
        } = &self.task.belief;
        let q = experiment.configuration_rad.as_slice();
        let mut pairs = BTreeSet::new();
        for load in [Load::NONE, experiment.load] {
            let mut arm = nominal.chain.at(calibration_tool);
            let compliance = &nominal.compliance_rad_per_nm;
            if self.solver.solve(&mut arm, compliance, q, &load).is_ok() {
                simulation.move_to(self.solver.q());
                pairs.append(&mut simulation.contacts(clearance));
            }
        }
        pairs
    }

    /// The forbidden configuration (from 1) that is too near, the joint with the largest difference, that,
    /// and its bound (rad; m where the joint slides).
    fn forbidden(&self, q: &[f64]) -> Option<(usize, (usize, f64), f64)> {
        self.task
            .region
            .forbidden
            .iter()
            .enumerate()
            .find_map(|(index, forbidden)| {
                let apart = forbidden
                    .configuration_rad
                    .iter()
                    .zip(q)
                    .map(|(one, other)| (one - other).abs())
                    .enumerate()
                    .fold(
                        (0, 0.0),
                        |most, next| if next.1 > most.1 { next } else { most },
                    );
                let is_near = apart.1 <= forbidden.within_rad;
                is_near.then_some((index + 1, apart, forbidden.within_rad))
            })
    }

    fn violated_ranges(&self, number: usize, experiment: &Experiment) -> Vec<Violation> {
        let ranges = &self.task.region.joint_range_rad;
        let joints = &self.task.belief.nominal.chain.joints;
        experiment
            .configuration_rad
            .iter()
            .zip(ranges)
            .zip(joints)
            .filter_map(|((&angle, &[low, high]), joint)| {
                let bound = if angle < low - ROUNDING {
                    low
                } else if angle > high + ROUNDING {
                    high
                } else {
                    return None;
                };
                let (found, unit) = joint.drive.shown(angle);
                Some(Violation::of_size(
                    number,
                    joint.name.clone(),
                    found,
                    joint.drive.shown(bound).0,
                    unit,
                ))
            })
            .collect()
    }

    fn violated_bounds(&mut self, number: usize, q: &[f64], load: &Load) -> Vec<Violation> {
        let Belief {
            nominal,
            calibration_tool,
            ..
        } = &self.task.belief;
        let gravity = nominal.chain.gravity_m_s2;
        nominal
            .chain
            .at(calibration_tool)
            .update(q, &mut self.state);
        self.bounds
            .iter()
            .filter(|bound| bound.margin(&self.state, load, &gravity) < -ROUNDING)
            .map(|bound| {
                let (what, found, bound, unit) = bound.describe(&self.state, load, &gravity);
                Violation::of_size(number, what, found, bound, unit)
            })
            .collect()
    }

    /// Collisions of the nominal robot at rest, and what keeps the instrument from reading a target.
    fn seen_violations(
        &mut self,
        number: usize,
        q: &[f64],
        load: &Load,
        looking: LookingAt<'_>,
    ) -> Result<Vec<Violation>, EquilibriumError> {
        let Belief {
            nominal,
            calibration_tool,
            instrument,
            ..
        } = &self.task.belief;
        let region = &self.task.region;
        let mut arm = nominal.chain.at(calibration_tool);
        self.solver
            .solve(&mut arm, &nominal.compliance_rad_per_nm, q, load)?;
        let seen = if looking.target.name == calibration_tool.name {
            self.solver.state()
        } else {
            let mut arm = nominal.chain.at(looking.target);
            arm.update(self.solver.q(), &mut self.state);
            &self.state
        };
        let reflector = seen.tool_position;
        let mut violations = Vec::new();
        if let Some(station) = looking.station {
            let facing = seen.tool_rotation.column(2).into_owned();
            violations.extend(out_of_reach(number, station, &reflector, &facing));
        }
        let Some(simulation) = &mut self.simulation else {
            return Ok(violations);
        };
        simulation.move_to(self.solver.q());
        if let Some(clearance) = region.collision_clearance_m {
            let contact = simulation.nearest_contact(clearance);
            violations.extend(contact.map(|contact| {
                Violation::of_size(
                    number,
                    format!(
                        "distance of {} and {}",
                        contact.between[0], contact.between[1]
                    ),
                    contact.distance_m * 1e3,
                    clearance * 1e3,
                    "mm",
                )
            }));
        }
        if region.line_of_sight
            && let Some(viewpoint) =
                Viewpoint::new(simulation, looking.station, instrument.tracker_site)
        {
            let hidden = hidden_by(simulation, &viewpoint, &reflector);
            violations.extend(hidden.map(|(name, free_m, length_m)| {
                Violation::of_size(
                    number,
                    format!("free line of sight from the reflector (blocked by {name})"),
                    free_m * 1e3,
                    length_m * 1e3,
                    "mm",
                )
            }));
        }
        Ok(violations)
    }
}

/// What of a station's range and of a reflector's is exceeded, for a reflector that faces along a unit vector.
fn out_of_reach(
    number: usize,
    station: &Station,
    reflector: &Vector3<f64>,
    facing: &Vector3<f64>,
) -> Vec<Violation> {
    let ray = station.position_m - reflector;
    let range = ray.norm();
    let violation = |what: String, found: f64, bound: f64, unit: &'static str| {
        Violation::of_size(number, what, found, bound, unit)
    };
    let name = &station.name;
    let [least, most] = station.range_m;
    let missed = (least.filter(|least| range < least - ROUNDING))
        .or_else(|| most.filter(|most| range > most + ROUNDING));
    let mut violations: Vec<Violation> = missed
        .map(|bound| {
            violation(
                format!("range from station {name:?}"),
                range * 1e3,
                bound * 1e3,
                "mm",
            )
        })
        .into_iter()
        .collect();
    let incidence = facing.angle(&ray);
    violations.extend(
        (station
            .incidence_max_rad
            .filter(|most| incidence > most + ROUNDING))
        .map(|most| {
            let [found, bound] = [incidence, most].map(f64::to_degrees);
            violation(
                format!("incidence to station {name:?}"),
                found,
                bound,
                "deg",
            )
        }),
    );
    violations
}

/// From where the instrument looks.
struct Viewpoint {
    from_m: Vector3<f64>,
    /// The body of the model's tracker, which hides nothing: it is the instrument.
    tracker: Option<usize>,
}

impl Viewpoint {
    /// At a station, or else at the site of the model's tracker.
    fn new(simulation: &State, station: Option<&Station>, site: Option<usize>) -> Option<Self> {
        let tracker = site.map(|site| simulation.model().site_body(site).0);
        match (station, site) {
            // A site of the world itself says nothing of what the tracker is.
            (Some(station), _) => Some(Self {
                from_m: station.position_m,
                tracker: tracker.filter(|body| *body != 0),
            }),
            (None, Some(site)) => Some(Self {
                from_m: simulation.site(site).0,
                tracker,
            }),
            (None, None) => None,
        }
    }
}

/// What stands between the instrument and the reflector: the first geometry on the line of sight, the
/// length of the line that is free before it, and the whole length (m). The tracker itself and what
/// lies within a reflector's radius of the reflector do not hide it.
fn hidden_by(
    simulation: &mut State,
    viewpoint: &Viewpoint,
    reflector: &Vector3<f64>,
) -> Option<(String, f64, f64)> {
    /// A 1.5 inch reflector's radius, and a little (m).
    const REFLECTOR_M: f64 = 0.025;
    let ray = viewpoint.from_m - reflector;
    let length = ray.norm();
    let start = reflector + ray * (REFLECTOR_M / length);
    let (geometry, distance) = simulation.ray(&start, &ray, viewpoint.tracker)?;
    let free = distance * length + REFLECTOR_M;
    (free < length).then(|| (simulation.model().geometry_name(geometry), free, length))
}
