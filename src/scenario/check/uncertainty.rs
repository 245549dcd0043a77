//! The tables `[[uncertainty]]`: error sources.

use nalgebra::{DVector, Vector3};

use super::Checker;
use crate::files::FileError;
use crate::mujoco::State;
use crate::parameter::{
    Axis, ParameterError, ParameterKind, RangeNoise, ReadingSource, Source, TransmissionError,
    Uncertainty, Unloaded,
};
use crate::quantities::plausible::{
    DEVIATION, FORCE_LIMIT, GAP_DEVIATION, Kind, PER_HOUR_DEVIATION, PER_METRE_DEVIATION,
    RELATIVE_DEVIATION, ROTATION_DEVIATION, TORQUE_LIMIT,
};
use crate::robot::TrueRobot;
use crate::scenario::file::{File, UncertaintyKind, UncertaintyTable};
use crate::task::{Belief, Extended, Station};
use crate::text::wrong_name;

/// What readings are beside the robot: the hours between the unloaded and the loaded one of a deflection, where the
/// instrument may stand, and the first test pose.
#[derive(Clone, Copy)]
pub(super) struct ReadingPlaces<'a> {
    pub between_h: f64,
    pub stations: &'a [Station],
    pub test_pose_rad: &'a DVector<f64>,
}

/// More are no list of what is uncertain.
const MOST: usize = 100;

/// A torque that some uncertainties of joints come with.
struct TorqueKey {
    kind: UncertaintyKind,
    key: &'static str,
    given: fn(&UncertaintyTable) -> Option<f64>,
    is_needed: bool,
    /// Why others do not.
    others: &'static str,
    /// Why a joint has one.
    one: &'static str,
}

/// At which what a joint carries decides as much as the side of approach on which side of its gap it stands.
const TURNED_OVER: TorqueKey = TorqueKey {
    kind: UncertaintyKind::Backlash,
    key: "turned_over_at_nm",
    given: |table| table.turned_over_at_nm,
    is_needed: false,
    others: "has no gap to be turned over",
    one: "a joint has one gap: give both the same torque",
};

/// At which a share is one of what the joint's spring gives.
const STIFFENING: TorqueKey = TorqueKey {
    kind: UncertaintyKind::Stiffening,
    key: "at_nm",
    given: |table| table.at_nm,
    is_needed: true,
    others: "is not one at a torque",
    one: "a joint has one law: give both the same torque",
};

impl Checker<'_> {
    /// All uncertainties, and what a belief carries of them, with what else is to be found by name.
    pub(super) fn uncertain(
        &self,
        belief: &mut Belief,
        (file, true_robot): (&File, &TrueRobot),
        further: &[&str],
        places: ReadingPlaces<'_>,
    ) -> Result<Vec<Uncertainty>, FileError> {
        self.at_most("uncertainty", file.uncertainty.len(), MOST)?;
        let tables = self.with_standard_deviations(&file.uncertainty)?;
        let uncertainties = self.uncertainties(&tables, belief, places)?;
        self.one_law(belief, true_robot, &uncertainties)?;
        belief.turned_over_at_nm = self.torques(&tables, belief, &TURNED_OVER)?;
        belief.stiffening_at_nm = self.torques(&tables, belief, &STIFFENING)?;
        let further = self.further(belief, further)?;
        belief.uncertain = self.extended(belief, &further, &uncertainties)?;
        Ok(uncertainties)
    }

    /// All uncertainties, hidden ones among them.
    fn uncertainties(
        &self,
        tables: &[UncertaintyTable],
        belief: &Belief,
        places: ReadingPlaces<'_>,
    ) -> Result<Vec<Uncertainty>, FileError> {
        let mut all: Vec<Uncertainty> = Vec::new();
        for (index, table) in tables.iter().enumerate() {
            let key = format!("uncertainty[{index}]");
            let name = table.name.as_deref().unwrap_or(table.kind.name());
            if let Some(problem) = wrong_name(name) {
                return Err(self.wrong(&format!("{key}.name"), problem));
            }
            if all.iter().any(|other| other.name == name) {
                let problem = format!("the name {name:?} is there twice");
                let wrong = self.wrong(&format!("{key}.name"), problem);
                return Err(wrong.hint("give each uncertainty of a kind a name of its own"));
            }
            let source = self.source(&key, table, belief, places)?;
            let what = format!("a {}", table.kind.name());
            self.check_level(&key, &what, &table.certificate(), source.level())?;
            all.push(Uncertainty {
                name: name.to_owned(),
                is_hidden: table.hidden,
                distribution: table.distribution.unwrap_or_default(),
                source,
            });
        }
        Ok(all)
    }

    fn source(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
        places: ReadingPlaces<'_>,
    ) -> Result<Source, FileError> {
        self.check_sizes(key, table)?;
        if table.joints.is_some() && !table.kind.is_of_joints() {
            let problem = format!("a {} is not one of joints", table.kind.name());
            return Err(self.wrong(&format!("{key}.joints"), problem));
        }
        if table.correlation_deg.is_some()
            && (table.kind != UncertaintyKind::TransmissionError || table.harmonics.is_some())
        {
            let key = format!("{key}.correlation_deg");
            let problem = "only a transmission_error without harmonics has a correlation length";
            return Err(self.wrong(&key, problem));
        }
        if let Some(harmonics) = &table.harmonics {
            return Ok(Source::Plan(self.waves(key, table, belief, harmonics)?));
        }
        if let Some(rp_mm) = table.rp_mm {
            let source = self.joint_repeatability(key, (table, rp_mm), belief, places)?;
            return Ok(Source::Reading(source));
        }
        let size = |name: &str| self.size(key, table, name);
        let source = match table.kind {
            UncertaintyKind::LoadDirection => ReadingSource::LoadDirection(size("std_mrad")?),
            UncertaintyKind::LoadPoint => ReadingSource::LoadPoint(size("std_mm")?),
            UncertaintyKind::Discrepancy => ReadingSource::Discrepancy(size("std_mm")?),
            UncertaintyKind::JointRepeatability | UncertaintyKind::TransmissionError => {
                let mut sizes = vec![0.0; belief.nominal.chain.len()];
                for (joint, size) in self.joint_sizes(key, table, belief, "std_mrad")? {
                    sizes[joint] = size;
                }
                if table.kind == UncertaintyKind::JointRepeatability {
                    return Ok(Source::Reading(ReadingSource::JointRepeatability(sizes)));
                }
                ReadingSource::TransmissionError(TransmissionError {
                    correlation_rad: self.correlation(key, table, belief, &sizes)?,
                    deviations: sizes,
                })
            }
            UncertaintyKind::TrackerRange => {
                let per_metre = size("std_um_per_m")?;
                let along_per_metre = match table.along_um_per_m {
                    Some(_) => size("along_um_per_m")?,
                    None => per_metre,
                };
                let from_m = tracker_m(belief, places.stations).ok_or_else(|| {
                    let problem = "the noise grows with the distance from the tracker, and nothing says where it is";
                    let wrong = self.wrong(&format!("{key}.kind"), problem);
                    wrong.hint("name a site of the model by instrument.tracker_site")
                })?;
                ReadingSource::Range(RangeNoise {
                    from_m,
                    per_metre,
                    along_per_metre,
                })
            }
            _ => {
                let parameters = self.shared(key, table, belief, places.between_h)?;
                return Ok(Source::Plan(parameters));
            }
        };
        Ok(Source::Reading(source))
    }

    /// The parameters of a kind that the whole plan shares, with their standard deviations.
    fn shared(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
        between_h: f64,
    ) -> Result<Vec<(ParameterKind, f64)>, FileError> {
        use ParameterKind as Of;
        use UncertaintyKind as Kind;
        let sizes = |of_angle| self.joint_sizes(key, table, belief, of_angle);
        let of_joints = |kind: &dyn Fn(usize) -> Of, sizes: Vec<(usize, f64)>| {
            let each = sizes.into_iter().map(|(joint, size)| (kind(joint), size));
            Ok(each.collect())
        };
        let joints =
            |is_meant: &dyn Fn(usize) -> bool| self.uncertain_joints(key, table, belief, is_meant);
        let has_mass = |link: usize| belief.nominal.chain.joints[link].mass_kg > 0.0;
        let is_elastic = |joint: usize| {
            belief.nominal.compliance_rad_per_nm[joint] > 0.0
                && (table.joints.is_some() || !belief.parameters.contains(&joint))
        };
        let axes = |kind: &dyn Fn(Axis) -> Of| Axis::ALL.map(kind).to_vec();
        let of_links = |kind: &dyn Fn(usize, Axis) -> Of, links: Vec<usize>| -> Vec<Of> {
            let of = |link| Axis::ALL.map(|axis| kind(link, axis));
            links.into_iter().flat_map(of).collect()
        };
        let each = |joints: Vec<usize>, kind: &dyn Fn(usize) -> Of| -> Vec<Of> {
            joints.into_iter().map(kind).collect()
        };
        let springs = |kind: &dyn Fn(usize) -> Of| self.of_springs(key, belief, kind);
        let (size, kinds) = match table.kind {
            Kind::JointZero => {
                return of_joints(&|joint| Of::JointZero { joint }, sizes("std_mrad")?);
            }
            Kind::Backlash => {
                return of_joints(&|joint| Of::JointBacklash { joint }, sizes("std_arcsec")?);
            }
            Kind::Drift => {
                let size = self.size(key, table, "std_um_per_h")? * between_h;
                return Ok(Axis::ALL.map(|axis| (Of::Drift { axis }, size)).to_vec());
            }
            Kind::TaskForce => {
                let mut all = Vec::new();
                if table.std_relative.is_some() {
                    all.push((Of::TaskScale, self.size(key, table, "std_relative")?));
                }
                if table.std_n.is_some() {
                    let size = self.size(key, table, "std_n")?;
                    all.extend(Axis::ALL.map(|axis| (Of::TaskForce { axis }, size)));
                }
                return Ok(all);
            }
            Kind::Compliance => {
                let of = |joint| Of::JointCompliance { joint };
                ("std_relative", each(joints(&is_elastic)?, &of))
            }
            Kind::Stiffening => {
                let of = |joint| Of::JointStiffening { joint };
                let joints = self.stiffening_joints(key, table, belief)?;
                ("std_relative", each(joints, &of))
            }
            Kind::LinkMass => {
                let of = |link| Of::LinkMass { link };
                ("std_relative", each(joints(&has_mass)?, &of))
            }
            Kind::LinkPosition => {
                let of = |link, axis| Of::LinkPosition { link, axis };
                ("std_mm", of_links(&of, joints(&|_| true)?))
            }
            Kind::LinkRotation => {
                let of = |link, axis| Of::LinkRotation { link, axis };
                ("std_mrad", of_links(&of, joints(&|_| true)?))
            }
            Kind::LinkCentre => {
                let of = |link, axis| Of::LinkCentre { link, axis };
                ("std_mm", of_links(&of, joints(&has_mass)?))
            }
            Kind::SpringStiffness => {
                let of = |spring| Of::SpringStiffness { spring };
                ("std_relative", springs(&of)?)
            }
            Kind::SpringRest => ("std_mm", springs(&|spring| Of::SpringRest { spring })?),
            Kind::ToolPosition => ("std_mm", axes(&|axis| Of::ToolPosition { tool: 0, axis })),
            Kind::BaseRotation => (
                "std_mrad",
                axes(&|axis| Of::BaseRotation { station: 0, axis }),
            ),
            Kind::LoadScale => ("std_relative", vec![Of::LoadScale]),
            Kind::LoadOffset => ("std_n", vec![Of::LoadOffset]),
            Kind::LoadDirection
            | Kind::LoadPoint
            | Kind::JointRepeatability
            | Kind::TrackerRange
            | Kind::TransmissionError
            | Kind::Discrepancy => return Ok(Vec::new()),
        };
        let size = self.size(key, table, size)?;
        Ok(kinds.into_iter().map(|kind| (kind, size)).collect())
    }

    /// A parameter of each spring between places of the arm.
    fn of_springs(
        &self,
        key: &str,
        belief: &Belief,
        kind: &dyn Fn(usize) -> ParameterKind,
    ) -> Result<Vec<ParameterKind>, FileError> {
        let count = belief.nominal.chain.elements.springs.len();
        if count == 0 {
            let problem = "the model has no springs between places of the arm";
            let wrong = self.wrong(&format!("{key}.kind"), problem);
            return Err(wrong.hint("a spring is a spatial tendon through sites with a stiffness"));
        }
        Ok((0..count).map(kind).collect())
    }

    /// Only the sizes that a kind has may be given.
    fn check_sizes(&self, key: &str, table: &UncertaintyTable) -> Result<(), FileError> {
        let allowed = table.kind.sizes();
        for (name, value) in table.given() {
            if value.is_some() && !allowed.contains(&name) {
                let problem = format!(
                    "a {} has no such size; it has {}",
                    table.kind.name(),
                    allowed.join(" or ")
                );
                return Err(self.wrong(&format!("{key}.{name}"), problem));
            }
        }
        if table.given().iter().all(|(_, value)| value.is_none()) {
            let problem = format!(
                "a {} needs its standard deviation: {}",
                table.kind.name(),
                allowed.join(" or ")
            );
            return Err(self.wrong(key, problem));
        }
        Ok(())
    }

    /// A standard deviation in SI units.
    fn size(&self, key: &str, table: &UncertaintyTable, name: &str) -> Result<f64, FileError> {
        let (kind, unit): (&Kind, f64) = match name {
            "std_relative" => (&RELATIVE_DEVIATION, 1.0),
            "std_mm" => (&DEVIATION, 1e-3),
            "std_mrad" => (&ROTATION_DEVIATION, 1e-3),
            "std_arcsec" => (&GAP_DEVIATION, (1.0_f64 / 3600.0).to_radians()),
            "std_n" => (&FORCE_LIMIT, 1.0),
            "std_um_per_h" => (&PER_HOUR_DEVIATION, 1e-6),
            _ => (&PER_METRE_DEVIATION, 1e-6),
        };
        let given = table.given().into_iter().find(|(each, _)| *each == name);
        let key = format!("{key}.{name}");
        let Some((_, Some(value))) = given else {
            let problem = format!(
                "is missing: the standard deviation of a {}",
                table.kind.name()
            );
            return Err(self.wrong(&key, problem));
        };
        Ok(self.number(&key, value, kind)? * unit)
    }

    /// The joints that are named, or all that may be meant.
    pub(super) fn uncertain_joints(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
        is_meant: &dyn Fn(usize) -> bool,
    ) -> Result<Vec<usize>, FileError> {
        let key = format!("{key}.joints");
        let chain = &belief.nominal.chain;
        let Some(names) = &table.joints else {
            let joints: Vec<usize> = (0..chain.len()).filter(|&joint| is_meant(joint)).collect();
            if joints.is_empty() {
                let problem = format!("no joint is left for a {}", table.kind.name());
                return Err(self
                    .wrong(&key, problem)
                    .hint("name the joints that are meant"));
            }
            return Ok(joints);
        };
        let mut joints = Vec::new();
        for name in names {
            let joint = self.joint(&key, chain, name)?;
            if joints.contains(&joint) {
                return Err(self.wrong(&key, format!("found {name:?} twice")));
            }
            if !is_meant(joint) {
                let problem = match table.kind {
                    UncertaintyKind::LinkMass | UncertaintyKind::LinkCentre => {
                        format!("the link that {name} moves has no mass")
                    }
                    _ => format!(
                        "{name} is rigid: its compliance is zero and cannot be wrong by a share"
                    ),
                };
                return Err(self.wrong(&key, problem));
            }
            joints.push(joint);
        }
        if joints.is_empty() {
            return Err(self.wrong(&key, "is empty; leave it out to mean all joints"));
        }
        joints.sort_unstable();
        Ok(joints)
    }

    /// The torque (N m; N where it slides) that uncertainties of a kind give by a key for each of their joints; none where nothing
    /// says so.
    fn torques(
        &self,
        tables: &[UncertaintyTable],
        belief: &Belief,
        of: &TorqueKey,
    ) -> Result<Vec<Option<f64>>, FileError> {
        let mut all: Vec<Option<Option<f64>>> = vec![None; belief.nominal.chain.len()];
        for (index, table) in tables.iter().enumerate() {
            let key = format!("uncertainty[{index}]");
            let own = format!("{key}.{}", of.key);
            let given = (of.given)(table);
            if table.kind != of.kind {
                if given.is_some() {
                    let problem = format!("a {} {}", table.kind.name(), of.others);
                    return Err(self.wrong(&own, problem));
                }
                continue;
            }
            let value = self.optional(&own, given, &TORQUE_LIMIT)?;
            if value.is_none() && of.is_needed {
                let problem = "is missing: the torque (N m; N where a joint slides) at which a joint gives less by \
                               this share than its spring would";
                return Err(self.wrong(&own, problem));
            }
            let joints = if table.kind == UncertaintyKind::Stiffening {
                self.stiffening_joints(&key, table, belief)?
            } else {
                let sizes = self.joint_sizes(&key, table, belief, "std_arcsec")?;
                sizes.into_iter().map(|(joint, _)| joint).collect()
            };
            for joint in joints {
                if all[joint].is_some_and(|known| known != value) {
                    let name = &belief.nominal.chain.joints[joint].name;
                    let kind = of.kind.name();
                    let problem = format!("another {kind} says something else of {name}");
                    let wrong = self.wrong(&own, problem);
                    return Err(wrong.hint(of.one));
                }
                all[joint] = Some(value);
            }
        }
        Ok(all.into_iter().map(Option::flatten).collect())
    }

    /// The elastic joints that a stiffening names, or all that are commanded.
    fn stiffening_joints(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
    ) -> Result<Vec<usize>, FileError> {
        let chain = &belief.nominal.chain;
        let is_passive = |joint: usize| chain.joints[joint].drive.passive_at.is_some();
        let is_meant = |joint: usize| {
            belief.nominal.compliance_rad_per_nm[joint] > 0.0
                && (table.joints.is_some() || !is_passive(joint))
        };
        let joints = self.uncertain_joints(key, table, belief, &is_meant)?;
        if let Some(&joint) = joints.iter().find(|&&joint| is_passive(joint)) {
            let name = &chain.joints[joint].name;
            let problem = format!("{name} is passive: its spring is the model's");
            return Err(self.wrong(&format!("{key}.joints"), problem));
        }
        Ok(joints)
    }

    /// A joint of the virtual robot has one law.
    fn one_law(
        &self,
        belief: &Belief,
        true_robot: &TrueRobot,
        uncertainties: &[Uncertainty],
    ) -> Result<(), FileError> {
        for (index, each) in uncertainties.iter().enumerate() {
            let Source::Plan(parameters) = &each.source else {
                continue;
            };
            let of_truth = true_robot.torque_laws.iter().map(|(joint, _)| *joint);
            let is_stiffening = |&joint: &usize| {
                (parameters.iter())
                    .any(|(kind, _)| *kind == ParameterKind::JointStiffening { joint })
            };
            if let Some(joint) = of_truth.into_iter().find(is_stiffening) {
                let name = &belief.nominal.chain.joints[joint].name;
                let problem =
                    format!("{name} has a law of its own, by true_robot.torque_law already");
                let wrong = self.wrong(&format!("uncertainty[{index}].joints"), problem);
                return Err(wrong.hint("a joint has one law: leave it out of one of the two"));
            }
        }
        Ok(())
    }

    /// Joints with a size each: angles of those that turn, lengths of those that slide.
    pub(super) fn joint_sizes(
        &self,
        key: &str,
        table: &UncertaintyTable,
        belief: &Belief,
        of_angle: &str,
    ) -> Result<Vec<(usize, f64)>, FileError> {
        let given = |key: &str| {
            (table.given().into_iter()).any(|(each, value)| each == key && value.is_some())
        };
        let drive = |joint: usize| &belief.nominal.chain.joints[joint].drive;
        let has_size = |joint: usize| {
            let size = if drive(joint).slides {
                "std_mm"
            } else {
                of_angle
            };
            given(size) && drive(joint).passive_at.is_none()
        };
        let count = belief.nominal.chain.len();
        if table.joints.is_none() && !(0..count).any(has_size) {
            let (moves, size, other) = if given("std_mm") {
                ("slides", "std_mm", of_angle)
            } else {
                ("turns", of_angle, "std_mm")
            };
            let problem = format!(
                "no joint is left for a {}: none {moves}, and {size} is the size of those that do",
                table.kind.name()
            );
            let wrong = self.wrong(&format!("{key}.joints"), problem);
            return Err(wrong.hint(format!("give {other}")));
        }
        let is_meant = |joint: usize| table.joints.is_some() || has_size(joint);
        let joints = self.uncertain_joints(key, table, belief, &is_meant)?;
        (joints.into_iter())
            .map(|joint| {
                if drive(joint).passive_at.is_some() {
                    let name = &belief.nominal.chain.joints[joint].name;
                    let problem = format!("{name} is passive: nothing commands it");
                    return Err(self.wrong(&format!("{key}.joints"), problem));
                }
                let name = if drive(joint).slides {
                    "std_mm"
                } else {
                    of_angle
                };
                Ok((joint, self.size(key, table, name)?))
            })
            .collect()
    }

    /// What a belief carries of them.
    fn extended(
        &self,
        belief: &Belief,
        further: &[ParameterKind],
        uncertainties: &[Uncertainty],
    ) -> Result<Option<Extended>, FileError> {
        let known = uncertainties.iter().filter(|each| !each.is_hidden);
        let known: Vec<Uncertainty> = known.cloned().collect();
        let unloaded = belief.instrument.unloaded;
        if known.is_empty() && further.is_empty() && unloaded == Unloaded::Own {
            return Ok(None);
        }
        let (joints, prior) = (&belief.parameters, belief.prior.as_ref());
        let extended = Extended::new(belief.arm(), joints, further, prior, &known);
        let extended = extended.map(|extended| Some(extended.resting_on(unloaded)));
        extended.map_err(|error| {
            let hint = matches!(error, ParameterError::Twice(_))
                .then_some("two uncertainties are about the same: leave one out, or hide it");
            self.wrong("uncertainty", error.to_string()).hinted(hint)
        })
    }
}

/// Where the tracker stands, if the scenario says so: its site, or the first of its stations.
fn tracker_m(belief: &Belief, stations: &[Station]) -> Option<Vector3<f64>> {
    match belief.instrument.tracker_site {
        Some(site) => {
            let mut state = State::new(&belief.nominal.model);
            state.update_kinematics();
            Some(state.site(site).0)
        }
        None => stations.first().map(|station| station.position_m),
    }
}
