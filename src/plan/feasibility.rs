//! Whether an experiment is possible: the bounds of the region, whether the robot rests, and what MuJoCo says of collisions
//! and of the tracker's sight, for the unloaded and the loaded robot.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::firmness::Firmness;
use super::region::{SmoothBound, bounds_of};
use super::{Experiment, Plan};
use crate::experiment::is_one_direction;
use crate::mujoco::State;
use crate::observation::LengthKind;
use crate::robot::{EquilibriumError, EquilibriumSolver, KinematicState, Kinematics, Load, Tool};
use crate::task::{Belief, Station, Task};

/// Bounds may be missed by this much (m, sine, or share of a torque) through rounding alone.
const ROUNDING: f64 = 1e-9;

/// The kind of a violation by a collision.
pub(super) const COLLISION: &str = "collision clearance";

/// The kind of the violation where the robot does not hold itself or the load.
const EQUILIBRIUM: &str = "static equilibrium";

/// The kinds of violations of a gauge: it reads along no direction that is allowed, or no such displacement.
const DIRECTION: &str = "direction";
const DISPLACEMENT: &str = "displacement along the gauge";

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
    fn in_words(what: &str, words: String) -> Self {
        Self {
            words: Some(words),
            ..Self::of_size(what.to_owned(), [f64::NAN; 2], "")
        }
    }

    /// What is found, with its bound in the same unit.
    fn of_size(what: String, [found, bound]: [f64; 2], unit: &'static str) -> Self {
        Self {
            experiment: None,
            what,
            found,
            bound,
            unit,
            words: None,
        }
    }

    /// Whether it is a gauge that cannot read.
    pub fn is_of_gauge(&self) -> bool {
        [DIRECTION, DISPLACEMENT].contains(&&*self.what)
    }

    /// The constraint that is violated, without names of geometries and numbers.
    pub fn kind(&self) -> String {
        match self.what.split_once(" of ") {
            Some(("distance", _)) => COLLISION.to_owned(),
            _ if self.what.starts_with("free line of sight") => "line of sight".to_owned(),
            _ if self.what.contains(EQUILIBRIUM) => EQUILIBRIUM.to_owned(),
            _ => self.what.clone(),
        }
    }
}

impl std::fmt::Display for Violation {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(experiment) = self.experiment {
            write!(formatter, "experiment {experiment}: ")?;
        }
        if let Some(words) = &self.words {
            return formatter.write_str(words);
        }
        let (what, unit) = (&self.what, self.unit);
        let (found, bound) = (self.found, self.bound);
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
    /// Whether nothing may stand in between: a gauge looks at nothing.
    pub is_seen: bool,
}

impl<'a> LookingAt<'a> {
    /// What is looked at where deflections are read: the calibration tool, by the one tracker, or by a gauge along a direction.
    const fn of_deflections(task: &'a Task, direction: Option<&Vector3<f64>>) -> Self {
        Self {
            target: &task.belief.calibration_tool,
            station: None,
            is_seen: direction.is_none(),
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
    firmness: Firmness,
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
            firmness: Firmness::new(&task.belief),
            task,
            simulation,
        }
    }

    /// Every violation of a plan.
    pub fn violations(&mut self, plan: &Plan) -> Vec<Violation> {
        let mandatory = &self.task.design.mandatory;
        let missing = plan.beside_mandatory(mandatory).err();
        let missing =
            missing.map(|missing| Violation::in_words("mandatory experiment", missing.to_string()));
        let each = plan.experiments.iter().enumerate();
        let of_experiments =
            each.flat_map(|(index, experiment)| self.violations_of(index + 1, experiment));
        missing.into_iter().chain(of_experiments).collect()
    }

    /// Every violation of one experiment, whose number in the plan is given.
    pub fn violations_of(&mut self, number: usize, experiment: &Experiment) -> Vec<Violation> {
        let looking = LookingAt::of_deflections(self.task, experiment.direction.as_ref());
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
        let mut violations = Vec::new();
        violations.extend(words.map(|words| Violation::in_words("load", words)));
        violations.extend(self.violated_ranges(experiment));
        let q = experiment.configuration_rad.as_slice();
        violations.extend(self.beyond_gauge(q, &experiment.load, experiment.direction.as_ref()));
        violations.extend(self.violated_bounds(q, &experiment.load));
        violations.extend(self.forbidden(q).map(|(index, (joint, found), bound)| {
            let what = format!("largest joint distance from forbidden configuration {index}");
            self.of_joint(joint, what, [found, bound])
        }));
        for load in [Load::NONE, experiment.load] {
            match self.seen_violations(q, &load, looking) {
                Ok(found) => violations.extend(found),
                Err(error) => {
                    let error = error.to_string();
                    violations.push(Violation::in_words(&error, error.clone()));
                    break;
                }
            }
        }
        violations.dedup_by(|one, other| one.what == other.what);
        for each in &mut violations {
            each.experiment = Some(number);
        }
        violations
    }

    /// Whether the nominal robot rests, and MuJoCo finds it free of collisions and in the tracker's sight where the region asks
    /// for that, unloaded and loaded, and away from forbidden configurations.
    pub fn is_clear(&mut self, q: &[f64], load: &Load, direction: Option<&Vector3<f64>>) -> bool {
        if self.forbidden(q).is_some() || self.beyond_gauge(q, load, direction).is_some() {
            return false;
        }
        if self.simulation.is_none() && self.firmness.holds(load) {
            return true;
        }
        let looking = LookingAt::of_deflections(self.task, direction);
        [Load::NONE, *load].iter().all(|load| {
            self.seen_violations(q, load, looking)
                .is_ok_and(|violations| violations.is_empty())
        })
    }

    /// What keeps a gauge from reading an experiment: that it is set along no direction that is allowed, or moves further than it shows.
    fn beyond_gauge(
        &mut self,
        q: &[f64],
        load: &Load,
        direction: Option<&Vector3<f64>>,
    ) -> Option<Violation> {
        let (belief, allowed) = (&self.task.belief, &self.task.directions);
        let gauge = belief.instrument.gauge?;
        let is_it = |each: &Option<Vector3<f64>>| is_one_direction(each.as_ref(), direction);
        if !allowed.iter().any(is_it) {
            let [found, allowed] = [&[direction.copied()], &allowed[..]].map(directions_in_words);
            let words = format!("direction is {found}; allowed {allowed}");
            return Some(Violation::in_words(DIRECTION, words));
        }
        let (direction, range_m) = (direction?, gauge.range_m?);
        let [unloaded_m, loaded_m] = belief.nominal_rests_m(&mut self.solver, q, load)?;
        let moved_m = direction.dot(&(loaded_m - unloaded_m)).abs();
        let sizes = [moved_m, range_m].map(|size| size * 1e3);
        (moved_m > range_m + ROUNDING)
            .then(|| Violation::of_size(DISPLACEMENT.to_owned(), sizes, "mm"))
    }

    /// The pairs of geometries that come too near to each other in an experiment, unloaded or loaded.
    pub(super) fn colliding_pairs(&mut self, experiment: &Experiment) -> BTreeSet<[String; 2]> {
        let (Some(simulation), Some(clearance)) =
            (&mut self.simulation, self.task.region.collision_clearance_m)
        else {
            return BTreeSet::new();
        };
        let belief = &self.task.belief;
        let q = experiment.configuration_rad.as_slice();
        let mut pairs = BTreeSet::new();
        for load in [Load::NONE, experiment.load] {
            let mut arm = belief.nominal.chain.at(&belief.calibration_tool);
            let compliance = &belief.nominal.compliance_rad_per_nm;
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
        let mut all = self.task.region.forbidden.iter().enumerate();
        all.find_map(|(index, forbidden)| {
            let apart = forbidden.too_near(&self.task.belief.nominal.chain, q)?;
            Some((index + 1, apart, forbidden.within_rad))
        })
    }

    /// A violation of a joint: what is found and its bound (rad; m where it slides).
    fn of_joint(&self, joint: usize, what: String, sizes: [f64; 2]) -> Violation {
        let drive = self.task.belief.nominal.chain.joints[joint].drive;
        let [(found, unit), (bound, _)] = sizes.map(|size| drive.shown(size));
        Violation::of_size(what, [found, bound], unit)
    }

    fn violated_ranges(&self, experiment: &Experiment) -> Vec<Violation> {
        let ranges = &self.task.region.joint_range_rad;
        let joints = &self.task.belief.nominal.chain.joints;
        let angles = experiment.configuration_rad.iter().zip(ranges).enumerate();
        angles
            .filter_map(|(joint, (&angle, &[low, high]))| {
                let bound = if angle < low - ROUNDING {
                    low
                } else if angle > high + ROUNDING {
                    high
                } else {
                    return None;
                };
                Some(self.of_joint(joint, joints[joint].name.clone(), [angle, bound]))
            })
            .collect()
    }

    fn violated_bounds(&mut self, q: &[f64], load: &Load) -> Vec<Violation> {
        let (chain, tool) = (
            &self.task.belief.nominal.chain,
            &self.task.belief.calibration_tool,
        );
        let (gravity, state) = (chain.gravity_m_s2, &mut self.state);
        chain.at(tool).update(q, state);
        let bounds = self.bounds.iter();
        bounds
            .filter(|bound| bound.margin(state, load, &gravity) < -ROUNDING)
            .map(|bound| {
                let (what, found, bound, unit) = bound.describe(state, load, &gravity);
                Violation::of_size(what, [found, bound], unit)
            })
            .collect()
    }

    /// Collisions of the nominal robot at rest, and what keeps the instrument from reading a target.
    fn seen_violations(
        &mut self,
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
            violations.extend(out_of_reach(station, &reflector, &facing));
        }
        let Some(simulation) = &mut self.simulation else {
            return Ok(violations);
        };
        simulation.move_to(self.solver.q());
        if let Some(clearance) = region.collision_clearance_m {
            let contact = simulation.nearest_contact(clearance);
            violations.extend(contact.map(|contact| {
                let [one, other] = &contact.between;
                let what = format!("distance of {one} and {other}");
                Violation::of_size(what, [contact.distance_m, clearance].map(|m| m * 1e3), "mm")
            }));
        }
        if (region.line_of_sight && looking.is_seen)
            && let Some(viewpoint) = Viewpoint::new(
                simulation,
                looking.station,
                &reflector,
                instrument.tracker_site,
            )
        {
            let hidden = hidden_by(simulation, &viewpoint, &reflector);
            violations.extend(hidden.map(|(name, free_m, length_m)| {
                let what = format!("free line of sight from the reflector (blocked by {name})");
                Violation::of_size(what, [free_m, length_m].map(|m| m * 1e3), "mm")
            }));
        }
        Ok(violations)
    }
}

/// What of a station's range and of a reflector's is exceeded, for a reflector that faces along a unit vector.
fn out_of_reach(
    station: &Station,
    reflector: &Vector3<f64>,
    facing: &Vector3<f64>,
) -> impl Iterator<Item = Violation> {
    let ray = station.sees_from(reflector) - reflector;
    let length = |kind: LengthKind| kind.row(&(reflector - station.position_m)).0;
    let range = station.reads.map_or_else(|| ray.norm(), length);
    let name = &station.name;
    let missed = station.missed(range, ROUNDING).map(|bound| {
        let what = format!("range from station {name:?}");
        Violation::of_size(what, [range, bound].map(|m| m * 1e3), "mm")
    });
    let incidence = facing.angle(&ray);
    let most = station.incidence_max_rad;
    let turned = most.filter(|most| incidence > most + ROUNDING).map(|most| {
        let what = format!("incidence to station {name:?}");
        Violation::of_size(what, [incidence, most].map(f64::to_degrees), "deg")
    });
    missed.into_iter().chain(turned)
}

/// Directions as they are listed.
fn directions_in_words(directions: &[Option<Vector3<f64>>]) -> String {
    let one = |direction: &Option<Vector3<f64>>| match direction {
        None => "none".to_owned(),
        Some(direction) => format!(
            "({:.4}, {:.4}, {:.4})",
            direction.x, direction.y, direction.z
        ),
    };
    let all: Vec<String> = directions.iter().map(one).collect();
    all.join(" or ")
}

/// From where the instrument looks.
struct Viewpoint {
    from_m: Vector3<f64>,
    /// The body of the model's tracker, which hides nothing: it is the instrument.
    tracker: Option<usize>,
}

impl Viewpoint {
    /// At a station, or else at the site of the model's tracker.
    fn new(
        simulation: &State,
        station: Option<&Station>,
        reflector: &Vector3<f64>,
        site: Option<usize>,
    ) -> Option<Self> {
        let tracker = site.map(|site| simulation.model().site_body(site).0);
        match (station, site) {
            // A site of the world itself says nothing of what the tracker is.
            (Some(station), _) => Some(Self {
                from_m: station.sees_from(reflector),
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
