//! One of the tables `[[uncertainty]]`: the error source that it is.

use std::collections::BTreeMap;

use nalgebra::{DVector, Vector3};
use toml::Table;

use super::Checker;
use super::certificate::SIZES;
use crate::files::FileError;
use crate::mujoco::State;
use crate::parameter::{
    Axis, ParameterKind as Of, RangeNoise, ReadingSource, Source, UnexplainedError,
};
use crate::robot::{Drive, ReadsAlong, Robot};
use crate::scenario::file::{UncertaintyKind as Kind, UncertaintyTable};
use crate::task::{Belief, Instrument, wrong_station};
use crate::text::wording::joined;

/// What readings are beside the robot: the hours between the unloaded and the loaded one of a deflection, where the
/// instrument may stand, and the first test pose.
#[derive(Clone, Copy)]
pub(super) struct ReadingPlaces<'a> {
    pub between_h: f64,
    pub test_pose_rad: &'a DVector<f64>,
}

/// The keys that all kinds have.
const OF_ALL: [&str; 6] = [
    "kind",
    "name",
    "hidden",
    "replaced",
    "distribution",
    "coverage_factor",
];

/// One table under its key, of a belief.
pub(super) struct UncertaintyEntry<'a> {
    pub checker: &'a Checker<'a>,
    key: String,
    pub table: &'a UncertaintyTable,
    /// The same by its keys, of those that are given,
    given: Table,
    /// and the standard deviations among them (SI).
    sizes: BTreeMap<&'static str, f64>,
    pub belief: &'a Belief,
    pub places: ReadingPlaces<'a>,
}

impl<'a> UncertaintyEntry<'a> {
    /// A table in which only keys of its kind are given, a size among them.
    pub fn new(
        checker: &'a Checker<'a>,
        key: String,
        table: &'a UncertaintyTable,
        (belief, places): (&'a Belief, ReadingPlaces<'a>),
    ) -> Result<Self, FileError> {
        let given = Table::try_from(table).unwrap_or_default();
        let mut entry = Self {
            checker,
            key,
            table,
            given,
            sizes: BTreeMap::new(),
            belief,
            places,
        };
        let [sizes, further] = table.kind.keys().map(|keys| keys.split_whitespace());
        let own: Vec<&str> = sizes.clone().chain(further).collect();
        let kind = table.kind.name();
        for key in entry.given.keys() {
            let of_mpe = SIZES.iter().find(|size| size.mpe == key);
            let meant = of_mpe.map_or(key.as_str(), |size| size.key);
            if !OF_ALL.contains(&meant) && !own.contains(&meant) {
                let all = own.join(" or ");
                return Err(entry.wrong(key, format!("a {kind} has no such key; it has {all}")));
            }
        }
        if let Some(problem) = other_instrument(table, &belief.instrument) {
            return Err(entry.wrong("kind", problem));
        }
        entry.sizes = checker.deviations(&entry.key, &entry.given, &SIZES)?;
        if !sizes.clone().any(|size| entry.gives(size)) {
            let all = joined(sizes, " or ");
            let problem = format!("a {kind} needs its standard deviation: {all}");
            return Err(checker.wrong(&entry.key, problem));
        }
        Ok(entry)
    }

    pub fn wrong(&self, key: &str, problem: impl Into<String>) -> FileError {
        self.checker.wrong(&self.path(key), problem)
    }

    /// The dotted path of a key.
    pub fn path(&self, key: &str) -> String {
        format!("{}.{key}", self.key)
    }

    /// What is uncertain, and by how much.
    pub fn source(&self) -> Result<Source, FileError> {
        use ReadingSource as New;
        let [sizes, _] = self.table.kind.keys();
        let key = sizes.split(' ').next().unwrap_or_default();
        Ok(Source::Reading(match self.table.kind {
            Kind::LoadDirection => New::LoadDirection(self.size(key)?),
            Kind::LoadPoint => New::LoadPoint(self.size(key)?),
            Kind::GaugeDirection => New::GaugeDirection(self.size(key)?),
            Kind::Discrepancy => New::Discrepancy(UnexplainedError {
                deviation_m: self.size(key)?,
                of: self.table.of,
            }),
            Kind::JointRepeatability => self.joint_repeatability()?,
            Kind::TrackerRange => New::Range(self.tracker_range()?),
            Kind::TransmissionError => return self.transmission_error(),
            Kind::TaskForce => return Ok(self.task_force()),
            Kind::JointZero | Kind::Backlash => {
                let of = |(joint, size)| match self.table.kind {
                    Kind::Backlash => (Of::JointBacklash { joint }, size),
                    _ => (Of::JointZero { joint }, size),
                };
                return Ok(Source::Plan(self.joint_sizes(key)?.map(of).collect()));
            }
            kind => {
                let times = if kind == Kind::Drift {
                    self.places.between_h
                } else {
                    1.0
                };
                let (parameters, size) = (self.parameters()?, self.size(key)? * times);
                let sized = parameters.into_iter().map(|kind| (kind, size));
                return Ok(Source::Plan(sized.collect()));
            }
        }))
    }

    /// The parameters of a kind that are all alike uncertain.
    fn parameters(&self) -> Result<Vec<Of>, FileError> {
        let axes = |of: &dyn Fn(Axis) -> Of| Axis::ALL.map(of).to_vec();
        let each = |which: Vec<usize>, of: fn(usize) -> Of| which.into_iter().map(of).collect();
        let axes_of_each = |which: Vec<usize>, of: fn(usize, Axis) -> Of| {
            let axes = |link| Axis::ALL.map(|axis| of(link, axis));
            which.into_iter().flat_map(axes).collect()
        };
        let obstacle = |joint| self.obstacle(joint);
        let joints = || self.joints(|_| true, obstacle);
        Ok(match self.table.kind {
            // Of joints whose compliances are not to be found, or those that are named.
            Kind::Compliance => {
                let is_known = |joint: usize| !self.belief.parameters.contains(&joint);
                let joints = self.joints(is_known, obstacle)?;
                each(joints, |joint| Of::JointCompliance { joint })
            }
            Kind::Stiffening => {
                if self.torque("at_nm").is_none() {
                    let problem = "is missing: the torque (N m; N where a joint slides) at which a joint gives less by this share than \
                                   its spring would";
                    return Err(self.wrong("at_nm", problem));
                }
                each(joints()?, |joint| Of::JointStiffening { joint })
            }
            Kind::LinkMass => each(joints()?, |link| Of::LinkMass { link }),
            Kind::LinkCentre => axes_of_each(joints()?, |link, axis| Of::LinkCentre { link, axis }),
            Kind::LinkPosition => {
                axes_of_each(joints()?, |link, axis| Of::LinkPosition { link, axis })
            }
            Kind::LinkRotation => {
                axes_of_each(joints()?, |link, axis| Of::LinkRotation { link, axis })
            }
            Kind::SpringStiffness => each(self.springs()?, |spring| Of::SpringStiffness { spring }),
            Kind::SpringRest => each(self.springs()?, |spring| Of::SpringRest { spring }),
            Kind::ToolPosition => axes(&|axis| Of::ToolPosition { tool: 0, axis }),
            Kind::BaseRotation => axes(&|axis| Of::BaseRotation { station: 0, axis }),
            Kind::StationPosition => self.of_stations(0)?,
            Kind::StationRotation => self.of_stations(1)?,
            Kind::Drift => axes(&|axis| Of::Drift { axis }),
            Kind::LoadOffset => vec![Of::LoadOffset],
            _ => vec![Of::LoadScale],
        })
    }

    /// Why a table of its kind cannot be about a joint, or about the link that it moves.
    fn obstacle(&self, joint: usize) -> Option<&'static str> {
        let Robot {
            chain,
            compliance_rad_per_nm,
            ..
        } = &self.belief.nominal;
        let is_passive = chain.joints[joint].drive.passive_at.is_some();
        let is_rigid = compliance_rad_per_nm[joint] <= 0.0;
        match self.table.kind {
            Kind::LinkMass | Kind::LinkCentre if chain.joints[joint].mass_kg <= 0.0 => {
                Some("moves a link that has no mass")
            }
            Kind::Stiffening if is_passive => Some("is passive: its spring is the model's"),
            Kind::Compliance | Kind::Stiffening if is_rigid => {
                Some("is rigid: its compliance is zero and cannot be wrong by a share")
            }
            Kind::JointZero
            | Kind::Backlash
            | Kind::JointRepeatability
            | Kind::TransmissionError
                if is_passive =>
            {
                Some("is passive: nothing commands it")
            }
            _ => None,
        }
    }

    /// The coordinates of positions (0) or rotations (1) of stations that are named, or of all, as far as lengths from there show them.
    fn of_stations(&self, which: usize) -> Result<Vec<Of>, FileError> {
        let stations = &self.belief.stations;
        let shown = |station: usize| {
            let mut kinds = Of::of_base(station)[which].to_vec();
            let reads = stations[station].reads;
            kinds.retain(|kind| reads.is_some_and(|length| length.shows(*kind)));
            kinds
        };
        let none = "reads no lengths that show it";
        let obstacle = |station: usize| shown(station).is_empty().then_some(none);
        let number = |name: &str| match wrong_station(stations, Some(name)) {
            Some([problem, hint]) => Err(self.wrong("stations", problem).hint(hint)),
            None => Ok((stations.iter().position(|each| each.name == name)).unwrap_or_default()),
        };
        let meant = match &self.table.stations {
            Some(names) => self.named("stations", names, number, obstacle)?,
            None => (0..stations.len()).collect(),
        };
        let kinds: Vec<Of> = meant.into_iter().flat_map(shown).collect();
        if kinds.is_empty() {
            return Err(self.wrong("kind", "no station reads lengths that show it"));
        }
        Ok(kinds)
    }

    fn task_force(&self) -> Source {
        let [scale, force] = ["std_relative", "std_n"].map(|key| self.sizes.get(key));
        let axes = force.map(|&size| Axis::ALL.map(|axis| (Of::TaskForce { axis }, size)));
        let all = scale.map(|&size| (Of::TaskScale, size)).into_iter();
        Source::Plan(all.chain(axes.into_iter().flatten()).collect())
    }

    /// The noise that grows with the distance from the tracker.
    fn tracker_range(&self) -> Result<RangeNoise, FileError> {
        let per_metre = self.size("std_um_per_m")?;
        let along = self.sizes.get("along_um_per_m").copied();
        let from_m = tracker_m(self.belief).ok_or_else(|| {
            let problem =
                "the noise grows with the distance from the tracker, and nothing says where it is";
            let wrong = self.wrong("kind", problem);
            wrong.hint("name a site of the model by instrument.tracker_site")
        })?;
        Ok(RangeNoise {
            from_m,
            per_metre,
            along_per_metre: along.unwrap_or(per_metre),
        })
    }

    /// The springs between places of the arm.
    fn springs(&self) -> Result<Vec<usize>, FileError> {
        let count = self.belief.nominal.chain.elements.springs.len();
        if count == 0 {
            let wrong = self.wrong("kind", "the model has no springs between places of the arm");
            return Err(wrong.hint("a spring is a spatial tendon through sites with a stiffness"));
        }
        Ok((0..count).collect())
    }

    /// A torque (N m; N where a joint slides).
    pub fn torque(&self, key: &str) -> Option<f64> {
        self.given.get(key).and_then(toml::Value::as_float)
    }

    /// Whether it gives a key, or a size by a maximum permissible error.
    pub fn gives(&self, key: &str) -> bool {
        self.given.contains_key(key) || self.sizes.contains_key(key)
    }

    /// A standard deviation in SI units.
    pub fn size(&self, key: &str) -> Result<f64, FileError> {
        self.sizes.get(key).copied().ok_or_else(|| {
            let kind = self.table.kind.name();
            let problem = format!("is missing: the standard deviation of a {kind}");
            self.wrong(key, problem)
        })
    }

    pub fn drive(&self, joint: usize) -> &Drive {
        &self.belief.nominal.chain.joints[joint].drive
    }

    /// The joints that are named, or all of those that are meant, in ascending order; `obstacle` says of a joint why it cannot be one.
    pub fn joints(
        &self,
        is_meant: impl Fn(usize) -> bool,
        obstacle: impl Fn(usize) -> Option<&'static str>,
    ) -> Result<Vec<usize>, FileError> {
        let chain = &self.belief.nominal.chain;
        let Some(names) = &self.table.joints else {
            let can_be = |joint: &usize| is_meant(*joint) && obstacle(*joint).is_none();
            let joints: Vec<usize> = (0..chain.len()).filter(can_be).collect();
            if joints.is_empty() {
                let kind = self.table.kind.name();
                let wrong = self.wrong("joints", format!("no joint is left for a {kind}"));
                return Err(wrong.hint(
                    "name the joints that are meant, identified ones too; std_mm is the size of those that slide",
                ));
            }
            return Ok(joints);
        };
        let joint = |name: &str| self.checker.joint(&self.path("joints"), chain, name);
        self.named("joints", names, joint, obstacle)
    }

    /// What names under a key mean, each by its number, in ascending order.
    fn named(
        &self,
        key: &str,
        names: &[String],
        number: impl Fn(&str) -> Result<usize, FileError>,
        obstacle: impl Fn(usize) -> Option<&'static str>,
    ) -> Result<Vec<usize>, FileError> {
        let mut all = Vec::new();
        for name in names {
            let one = number(name)?;
            if all.contains(&one) {
                return Err(self.wrong(key, format!("found {name:?} twice")));
            }
            if let Some(obstacle) = obstacle(one) {
                return Err(self.wrong(key, format!("{name} {obstacle}")));
            }
            all.push(one);
        }
        if all.is_empty() {
            return Err(self.wrong(key, format!("is empty; leave it out to mean all {key}")));
        }
        all.sort_unstable();
        Ok(all)
    }

    /// The joints that are named, or all that turn at a command, or slide.
    pub fn moving_joints(&self, slides: bool) -> Result<Vec<usize>, FileError> {
        let words = ["does not turn at a command", "does not slide at a command"];
        let obstacle = |joint: usize| {
            let drive = self.drive(joint);
            let is_other = drive.slides != slides || drive.passive_at.is_some();
            is_other.then_some(words[usize::from(slides)])
        };
        self.joints(|_| true, obstacle)
    }

    /// Commanded joints with a size each: angles of those that turn, lengths of those that slide.
    fn joint_sizes(
        &self,
        of_angle: &str,
    ) -> Result<impl Iterator<Item = (usize, f64)> + use<>, FileError> {
        let key = |joint: usize| {
            let slides = self.drive(joint).slides;
            if slides { "std_mm" } else { of_angle }
        };
        let obstacle = |joint| self.obstacle(joint);
        let joints = self.joints(|joint| self.gives(key(joint)), obstacle)?;
        for (size, of_these) in [("std_mm", "slides"), (of_angle, "turns")] {
            let is_left = |joint: &usize| key(*joint) == size && obstacle(*joint).is_none();
            let all = 0..self.belief.nominal.chain.len();
            if self.table.joints.is_none()
                && !self.gives(size)
                && let Some(left) = all.into_iter().find(is_left)
            {
                let name = &self.belief.nominal.chain.joints[left].name;
                let problem = format!("is missing: {name} {of_these}");
                let wrong = self.wrong(size, problem);
                return Err(wrong.hint("give its size, or name the joints that are meant"));
            }
            if self.gives(size) && !joints.iter().any(|&joint| key(joint) == size) {
                return Err(self.wrong(
                    size,
                    format!("none of the joints that are meant {of_these}"),
                ));
            }
        }
        let sizes: Result<Vec<f64>, _> =
            joints.iter().map(|&joint| self.size(key(joint))).collect();
        Ok(joints.into_iter().zip(sizes?))
    }

    /// The same of all joints; zero of those that are not meant.
    pub fn all_sizes(&self) -> Result<Vec<f64>, FileError> {
        let mut all = vec![0.0; self.belief.nominal.chain.len()];
        for (joint, size) in self.joint_sizes("std_mrad")? {
            all[joint] = size;
        }
        Ok(all)
    }
}

/// Where the tracker stands, if the scenario says so: its site, or the first of its stations.
fn tracker_m(belief: &Belief) -> Option<Vector3<f64>> {
    match belief.instrument.tracker_site {
        Some(site) => {
            let mut state = State::new(&belief.nominal.model);
            state.update_kinematics();
            Some(state.site(site).0)
        }
        None => belief.stations.first().map(|station| station.position_m),
    }
}

/// Why an uncertainty of a kind is not of what reads, a gauge or not; nothing where it is.
fn other_instrument(table: &UncertaintyTable, instrument: &Instrument) -> Option<&'static str> {
    use ReadsAlong::{Always, Never};
    let reads_along = instrument.reads_along();
    let length = instrument.length_alone();
    match table.kind {
        Kind::GaugeDirection if reads_along == Never => {
            Some("is of a gauge, and instrument.reads is not \"displacement\"")
        }
        Kind::TrackerRange if reads_along == Always => {
            Some("is of an instrument with a frame, and instrument.reads is \"displacement\"")
        }
        Kind::TrackerRange if length.is_some_and(|kind| !kind.is_sighted()) => Some(
            "is of an instrument that reads along a line of sight, and instrument.reads is none",
        ),
        Kind::BaseRotation if reads_along != Never => Some(
            "is of an instrument with a frame, and a gauge reads, alone or beside one, along the directions of the world",
        ),
        Kind::BaseRotation if instrument.lengths().next().is_some() => Some(
            "is of an instrument with a frame; of where lengths are read from, see station_rotation",
        ),
        Kind::StationPosition | Kind::StationRotation if instrument.lengths().next().is_none() => {
            Some("is of a place that lengths are read from, and the instrument reads none")
        }
        _ => None,
    }
}
