//! Readings together with the arm that they are of: stations and targets by number.

use std::iter;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Matrix6, Matrix6xX, Rotation3, Vector3, Vector6};

use super::super::copies::{CopiedReadings, ReadBits, may_repeat};
use super::super::frames::{MountedFrames, RobustFrames, Sight, evenly, groups, median_or_zero};
use super::super::outliers::RejectedReading;
use super::IdentificationError;
use super::choices::{FitChoices, ReadingWeights};
use super::visits::{loads_of_visits, visit_classes, visits};
use crate::measurement::AbsoluteReading;
use crate::observation::{
    BareArm, Hook, LengthKind, Observation, ObservationModel, Reading, ReadingErrors, Setup,
    SharedErrors, Whitener,
};
use crate::parameter::{ElasticArm, ParameterSet, ReadingSource};
use crate::robot::{KinematicState, Kinematics, Load, SerialChain, Tool};
use crate::task::{Belief, station_named};

/// Readings spread by more, or by less, than this many times what the robot does are in another unit.
const OTHER_UNIT: f64 = 8.0;
/// Of a station and a target so many readings are looked at for that.
const APART_AMONG: usize = 60;
/// Less than this is no sign of anything (m).
const LITTLE_M: f64 = 1e-3;
/// With more than this share of the spread left, frames explain nothing.
const UNLIKE: f64 = 0.5;

/// Absolute readings of a robot that somebody has a belief of.
#[derive(Debug, Clone)]
pub struct AbsoluteCase<'a> {
    /// What is believed.
    pub belief: &'a Belief,
    /// The arm with a tool for each target and a base for each station, as the belief and a closed form have them.
    pub arm: ElasticArm,
    /// The stations' names in the order of the file; one without a name where the file names none.
    pub stations: Vec<Option<String>>,
    /// The targets' sites.
    pub targets: Vec<String>,
    /// The readings, each with its own covariance.
    pub observations: Vec<Observation>,
    /// The covariances of all errors of each (m^2, m rad, rad^2).
    pub covariances: Vec<Matrix6<f64>>,
    /// The readings by their places: those of one visit together.
    pub visits: Vec<Vec<usize>>,
    /// Which of the loads of its visit each is under, from 1, or none (0); and how many these are at most.
    pub loads: Vec<[usize; 2]>,
    /// Of what no parameter explains, the standard deviation that readings of one visit do not share: of each coordinate of the
    /// position (m) and of the rotation (rad).
    pub within: [f64; 2],
    /// Errors that readings share besides as they are weighed.
    pub(super) shared: Option<SharedErrors>,
    /// Whether the planner's model says which these are: they are not found from residuals then.
    pub(super) is_sharing_known: bool,
    /// How they are fitted.
    pub choices: FitChoices,
    /// The readings that are far out of any frames, which no fit begins with.
    pub far_from_frames: Vec<RejectedReading>,
    /// Readings that are equal to the last digit.
    pub copies: CopiedReadings,
}

impl<'a> AbsoluteCase<'a> {
    /// Readings of the robot of a belief, with frames from their closed forms.
    ///
    /// # Errors
    /// A target does not exist, or cannot be where the load is; nothing says how precise orientations are, or where a station is
    /// that lengths are read from; the units cannot be right.
    pub fn new(
        belief: &'a Belief,
        readings: &[AbsoluteReading],
    ) -> Result<Self, IdentificationError> {
        let mut case = Self::placed(belief, readings)?;
        case.hang_where_found();
        let positions = case.positions();
        if positions.is_empty() {
            // Places of lengths are known well enough to begin with.
            case.copies = case.copied();
            return Ok(case);
        }
        let sights = case.sights();
        check_units(&sights, &case.arm)?;
        let found = RobustFrames::guessed(&sights, case.stations.len(), &case.link_from_tools());
        let wrong = found.wrong();
        case.far_from_frames = (wrong.iter())
            .map(|&place| RejectedReading {
                reading: positions[place],
                deviations: found.off[place],
            })
            .collect();
        case.set_frames(case.beside_lengths(found.frames));
        let mut right = sights;
        let mut places = 0..right.len();
        right.retain(|_| (places.next()).is_some_and(|place| wrong.binary_search(&place).is_err()));
        case.check_likeness(&right)?;
        case.copies = case.copied();
        Ok(case)
    }

    /// The same with stations where the robot's own world is, and targets and what loads hang on where the model has them.
    ///
    /// # Errors
    /// As [`new`](Self::new), but for units.
    pub fn placed(
        belief: &'a Belief,
        readings: &[AbsoluteReading],
    ) -> Result<Self, IdentificationError> {
        let classes = visit_classes(readings, belief);
        let mut case = Self {
            belief,
            arm: ElasticArm {
                tools: Vec::new(),
                ..belief.arm()
            },
            stations: Vec::new(),
            targets: Vec::new(),
            observations: Vec::new(),
            covariances: Vec::new(),
            visits: visits(readings, &classes),
            loads: loads_of_visits(readings, &classes),
            within: [0.0; 2],
            shared: None,
            is_sharing_known: false,
            choices: FitChoices::weighed(ReadingWeights::AsNeeded),
            far_from_frames: Vec::new(),
            copies: CopiedReadings::default(),
        };
        let hook = Arc::new(belief.calibration_tool.clone());
        for (index, reading) in readings.iter().enumerate() {
            let station = case.station(reading.station.as_deref());
            let target = case.target(index, reading.target.as_deref())?;
            let tool = &case.arm.tools[target];
            let carried = belief.calibration_tool.joints;
            if reading.load != Load::NONE && tool.joints > carried {
                let target = tool.name.clone();
                return Err(IdentificationError::BeyondLoad {
                    reading: index + 1,
                    target,
                });
            }
            let hangs_on = (tool.name != hook.name).then(|| Hook::Unread(Arc::clone(&hook)));
            let covariance = case.covariance(reading)?;
            case.check_kind(index, reading)?;
            case.covariances.push(covariance);
            case.observations.push(Observation {
                setup: Setup {
                    commanded_rad: reading.configuration_rad.clone(),
                    load: reading.load,
                    hangs_on,
                    target,
                    station,
                    approach: reading.approach.clone(),
                },
                reading: match (reading.length, reading.rotation) {
                    (Some(length), _) => Reading::Length(length),
                    (None, None) => Reading::Position {
                        position_m: reading.position_m,
                    },
                    (None, Some(rotation)) => Reading::Pose {
                        position_m: reading.position_m,
                        rotation: rotation.to_rotation_matrix().into_inner(),
                    },
                },
                whitener: whitener(&covariance),
            });
        }
        let frames = (0..case.stations.len()).map(|station| case.placed_frame(station));
        case.arm.instrument_from_base = frames.collect();
        Ok(case)
    }

    /// Hangs loads on the calibration tool where its own readings find it, if there are any: in place of where the model has it.
    pub fn hang_where_found(&mut self) {
        let calibration = &self.belief.calibration_tool.name;
        if let Some(place) = self.targets.iter().position(|name| name == calibration) {
            for Observation { setup, .. } in &mut self.observations {
                setup.hangs_on = setup.hangs_on.take().map(|_| Hook::Tool(place));
            }
        }
    }

    /// The same where readings, weighed by their own covariances, share errors besides.
    pub fn sharing(mut self, shared: SharedErrors) -> Self {
        for (covariance, more) in self.covariances.iter_mut().zip(shared.covariances()) {
            *covariance += more;
        }
        self.shared = Some(shared);
        self.is_sharing_known = true;
        self
    }

    /// What some sources disturb a reading by, by its place, besides the instrument, where the calibration tool carries a load; of a
    /// length what it shows. In the robot's base frame.
    pub fn disturbed<'s>(
        &self,
        place: usize,
        load: &Load,
        sources: impl IntoIterator<Item = &'s ReadingSource>,
    ) -> ReadingErrors {
        let Observation { setup, reading, .. } = &self.observations[place];
        let belief = self.belief;
        let arm = BareArm {
            chain: &belief.nominal.chain,
            compliance_rad_per_nm: &belief.nominal.compliance_rad_per_nm,
            tool: &self.arm.tools[setup.target],
        };
        let name = self.stations[setup.station].as_deref();
        let station_m = station_named(&belief.stations, name).map(|station| &station.position_m);
        let q = setup.commanded_rad.as_slice();
        let carried = (&belief.calibration_tool, load);
        let by_tracker = belief.reads_by_tracker(name);
        let sources = sources
            .into_iter()
            .filter(|source| by_tracker || !matches!(source, ReadingSource::Range(_)));
        let errors = ReadingErrors::new(arm, q, carried, station_m, sources);
        let errors = errors.under(self.loads[place]);
        match (station_m, reading) {
            (Some(station_m), Reading::Length(read)) => {
                let apart_m = arm.chain.at(arm.tool).state(q).tool_position - station_m;
                errors.along(&read.kind.row(&apart_m).1)
            }
            _ => errors,
        }
    }

    fn station(&mut self, name: Option<&str>) -> usize {
        let known = (self.stations.iter()).position(|each| each.as_deref() == name);
        known.unwrap_or_else(|| {
            self.stations.push(name.map(str::to_owned));
            self.stations.len() - 1
        })
    }

    fn target(&mut self, index: usize, name: Option<&str>) -> Result<usize, IdentificationError> {
        let calibration = &self.belief.calibration_tool;
        let name = name.unwrap_or(&calibration.name);
        if let Some(place) = self.targets.iter().position(|each| each == name) {
            return Ok(place);
        }
        let tool = if *name == calibration.name {
            calibration.clone()
        } else {
            SerialChain::tool(&self.belief.nominal.model, name).map_err(|source| {
                IdentificationError::Target {
                    reading: index + 1,
                    source: Box::new(source),
                }
            })?
        };
        self.targets.push(name.to_owned());
        self.arm.tools.push(tool);
        Ok(self.targets.len() - 1)
    }

    /// A reading's own covariance, or that of one of the two readings that make the scenario's deflections.
    fn covariance(&self, reading: &AbsoluteReading) -> Result<Matrix6<f64>, IdentificationError> {
        if let Some(covariance) = reading.covariance {
            return Ok(covariance);
        }
        let instrument = &self.belief.instrument;
        let kind = reading.length.map(|read| read.kind);
        let shows = kind.and_then(|kind| instrument.shows_length(kind));
        if kind.map_or(!instrument.reads_positions(), |_| shows.is_none()) {
            let name = kind.map_or("position", LengthKind::name);
            return Err(IdentificationError::NoSigma(name));
        }
        let sigma_m = instrument.sigma_by_m(shows);
        let rotation_rad = match (reading.rotation, instrument.rotation_sigma_rad) {
            (None, _) => 1.0,
            (Some(_), Some(sigma)) => sigma,
            (Some(_), None) => return Err(IdentificationError::NoRotationSigma),
        };
        let variances = [sigma_m, rotation_rad].map(|sigma| sigma * sigma / 2.0);
        Ok(Matrix6::from_diagonal(&Vector6::from_fn(|row, _| {
            variances[row / 3]
        })))
    }

    pub(in crate::identification) fn link_from_tools(&self) -> Vec<Isometry3<f64>> {
        let tools = self.arm.tools.iter();
        tools.map(|tool| tool.link_from_tool).collect()
    }

    /// Where stations and targets are to begin with: by closed forms of positions, and those of lengths where the planner's model has them.
    pub fn first_frames(&self) -> MountedFrames {
        let link_from_tool = self.link_from_tools();
        if self.positions().is_empty() {
            let instrument_from_base = self.arm.instrument_from_base.clone();
            return MountedFrames {
                instrument_from_base,
                link_from_tool,
            };
        }
        let frames = MountedFrames::guessed(&self.sights(), self.stations.len(), &link_from_tool);
        self.beside_lengths(frames)
    }

    /// What closed forms need of the readings of positions; of all where there are none.
    pub fn sights(&self) -> Vec<Sight> {
        let mut state = KinematicState::new(self.arm.chain.len());
        let mut seen = self.positions();
        if seen.is_empty() {
            seen = (0..self.observations.len()).collect();
        }
        (seen.into_iter())
            .map(|place| {
                let each = &self.observations[place];
                let carrier = Tool {
                    link_from_tool: Isometry3::identity(),
                    ..self.arm.tools[each.setup.target].clone()
                };
                let q = each.setup.commanded_rad.as_slice();
                self.arm.chain.at(&carrier).update(q, &mut state);
                let rotation = Rotation3::from_matrix_unchecked(state.tool_rotation);
                let base_from_link =
                    Isometry3::from_parts(state.tool_position.into(), rotation.into());
                Sight {
                    station: each.setup.station,
                    target: each.setup.target,
                    base_from_link,
                    position_m: each.position_m(),
                    rotation: rotation_of(&each.reading),
                    weight: 1.0,
                }
            })
            .collect()
    }

    fn copied(&self) -> CopiedReadings {
        let mut copies = CopiedReadings::default();
        let mut nominal = ObservationModel::of(ParameterSet::empty(), &self.arm, &[]);
        let mut ignored = Matrix6xX::zeros(0);
        for (own, coordinates, resolution_m) in self.bits_by_kind() {
            let more = CopiedReadings::of(&own, coordinates, resolution_m, |place| {
                let Observation { setup, reading, .. } = &self.observations[place];
                let kind = reading.kind();
                (nominal.predict_as_planned(None, setup, kind, &mut ignored)).position_m
            });
            copies.rows.extend(more.rows);
            copies.readings.extend(more.readings);
        }
        copies
    }

    /// Whether other readings of the same may be these again to the last digit by chance.
    pub fn may_repeat(&self) -> bool {
        may_repeat(self.bits_by_kind())
    }

    /// The readings of positions, and of each kind of lengths, to the bit, with their number of coordinates and their resolution (m).
    fn bits_by_kind(&self) -> impl Iterator<Item = (Vec<ReadBits>, usize, f64)> {
        let kinds = iter::once(None).chain(LengthKind::ALL.map(Some));
        kinds.map(|kind| {
            let mut own = self.read_bits();
            own.retain(|each| self.observations[each.place].reading.kind().length() == kind);
            let shows = kind.and_then(|kind| self.belief.instrument.shows_length(kind));
            let coordinates = if kind.is_some() { 1 } else { 3 };
            (
                own,
                coordinates,
                shows.map_or(0.0, |shows| shows.resolution_m),
            )
        })
    }

    /// What was read, and where, to the bit.
    fn read_bits(&self) -> Vec<ReadBits> {
        (self.observations.iter().zip(&self.covariances).enumerate())
            .map(|(place, (each, covariance))| {
                let setup = &each.setup;
                let wrench = setup.load.wrench();
                let of_setup = setup.commanded_rad.iter().chain(wrench.iter());
                ReadBits {
                    place,
                    setup: of_setup.map(|value| value.to_bits()).collect(),
                    of: [setup.station, setup.target],
                    more: rotation_of(&each.reading)
                        .iter()
                        .flatten()
                        .copied()
                        .collect(),
                    position_m: each.position_m(),
                    sigma_m: Vector3::from_fn(|axis, _| covariance[(axis, axis)].sqrt()),
                }
            })
            .collect()
    }

    /// Puts stations and targets somewhere.
    pub fn set_frames(&mut self, frames: MountedFrames) {
        self.arm.instrument_from_base = frames.instrument_from_base;
        for (tool, frame) in self.arm.tools.iter_mut().zip(frames.link_from_tool) {
            tool.link_from_tool = frame;
        }
    }

    /// Whether the frames explain the readings at all.
    fn check_likeness(&self, sights: &[Sight]) -> Result<(), IdentificationError> {
        let left = sights.iter().map(|sight| {
            let tool = self.arm.tools[sight.target].link_from_tool;
            let base = self.arm.instrument_from_base[sight.station];
            let seen = base * sight.base_from_link * tool;
            (seen.translation.vector - sight.position_m).norm_squared()
        });
        let left_m = (left.sum::<f64>() / sights.len().max(1) as f64).sqrt();
        let spread_m = spread(sights);
        if left_m > UNLIKE * spread_m && left_m > LITTLE_M {
            let [left, spread] = [left_m, spread_m].map(|value| format!("{:.1}", value * 1e3));
            return Err(IdentificationError::Unlike { left, spread });
        }
        Ok(())
    }
}

pub(super) const fn rotation_of(reading: &Reading) -> Option<Matrix3<f64>> {
    match reading {
        Reading::Pose { rotation, .. } => Some(*rotation),
        _ => None,
    }
}

/// Covariances that were read are positive definite.
pub(super) fn whitener(covariance: &Matrix6<f64>) -> Whitener {
    Whitener::of_covariance(covariance).unwrap_or_else(|| {
        let deviation = covariance.diagonal().map(f64::sqrt);
        let [position, rotation] = [0, 3].map(|row| deviation.fixed_rows::<3>(row).into_owned());
        Whitener::independent(position, rotation)
    })
}

/// How far positions lie about their mean, each station's and target's about its own (m, rms).
fn spread(sights: &[Sight]) -> f64 {
    let off = groups(sights).into_values().flat_map(|group| {
        let sum: Vector3<f64> = group.iter().map(|each| each.position_m).sum();
        let mean = sum / group.len() as f64;
        (group.into_iter()).map(move |each| (each.position_m - mean).norm_squared())
    });
    (off.sum::<f64>() / sights.len().max(1) as f64).sqrt()
}

/// How far apart a station's readings of a target lie: the median of the distances among some of them (m). It does not depend on frames.
fn apart(sights: &[Sight]) -> f64 {
    let some = evenly(sights, APART_AMONG);
    let among = groups(&some).into_values().flat_map(|group| {
        let pairs = (1..group.len()).flat_map(|one| (0..one).map(move |other| (one, other)));
        let apart_m = |one: usize, other: usize| group[one].position_m - group[other].position_m;
        let distance = |(one, other)| apart_m(one, other).norm();
        pairs.map(distance).collect::<Vec<f64>>()
    });
    median_or_zero(among.collect())
}

/// Distances between positions tell another unit.
fn check_units(sights: &[Sight], arm: &ElasticArm) -> Result<(), IdentificationError> {
    let found = apart(sights);
    let believed: Vec<Sight> = (sights.iter())
        .map(|sight| {
            let tool = arm.tools[sight.target].link_from_tool;
            let position_m = (sight.base_from_link * tool).translation.vector;
            Sight {
                position_m,
                ..sight.clone()
            }
        })
        .collect();
    let expected = apart(&believed);
    // A target that is not where it is believed to be adds its own.
    let is_other =
        found > OTHER_UNIT * expected.max(1e-2) || expected > OTHER_UNIT * found.max(1e-2);
    if is_other && sights.len() > 1 {
        let [found, expected] = [found, expected].map(|value| format!("{:.3}", value * 1e3));
        return Err(IdentificationError::Units { found, expected });
    }
    Ok(())
}
