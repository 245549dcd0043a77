//! The simulated truth of a run's error sources, sampled as a function of seed and run.
//!
//! What the whole plan shares is drawn once a run, what is new in each reading for every reading. Frames of links and
//! tools move in MuJoCo's model; zeros change what the joints are commanded, loads what hangs on the robot.

use nalgebra::{DVector, Isometry3, Rotation3, Vector3};

use crate::experiment::{Experiment, Plan};
use crate::measurement::Measurement;
use crate::mujoco::{ModelChange, TorqueLaw};
use crate::numeric::markov::SampledFunction;
use crate::numeric::random::normal::LANES;
use crate::numeric::random::{generator, streams};
use crate::parameter::{
    Axis, ElasticArm, FrameChange, JointFunction, ParameterError, ParameterKind, ParameterSet,
    RangeNoise, ReadingSource, Source, SourceLevel, Uncertainty, Unloaded,
};
use crate::robot::{Approach, Load};
use crate::task::Instrument;

use super::instrument::{OF_ONE_READING, measurement};
use super::truth::SampledValue;
use super::virtual_robot::{Displacement, MeasurementError, VirtualRobot};

/// Where a run's robot, loads and instrument differ from what is said of them.
#[derive(Debug, Clone)]
pub struct Circumstances {
    nominal: ElasticArm,
    /// What differs, each once.
    set: ParameterSet,
    /// How many of them sources have in common with an earlier campaign; they come first.
    kept: usize,
    /// For each number that a run shares: which parameter it moves, and by how much.
    shared: Vec<(usize, f64)>,
    sources: Vec<ReadingSource>,
    /// Which reading without the load deflections rest on.
    unloaded: Unloaded,
    /// What differs in this run, in the parameters' units.
    values: Vec<f64>,
    /// The nominal arm with that.
    here: ElasticArm,
    /// Of absolute readings: the joints' error functions,
    functions: Vec<JointFunction>,
    /// and as they are in this run.
    sampled_functions: Vec<SampledFunction>,
}

impl Circumstances {
    /// A laboratory in which a belief's arm has these uncertainties, and what sources have in common with an earlier campaign; it is as
    /// nominal before anything is drawn.
    ///
    /// # Errors
    /// An uncertainty is about something that the arm does not have.
    pub fn new(
        nominal: ElasticArm,
        uncertainties: &[Uncertainty],
        kept: &[ParameterKind],
    ) -> Result<Self, ParameterError> {
        let mut kinds = kept.to_vec();
        let mut shared = Vec::new();
        let mut sources = Vec::new();
        for each in uncertainties {
            match &each.source {
                Source::Reading(source) => sources.push(source.clone()),
                Source::Plan(parameters) => {
                    for &(kind, deviation) in parameters {
                        let known = kinds.iter().position(|other| *other == kind);
                        let place = known.unwrap_or_else(|| {
                            kinds.push(kind);
                            kinds.len() - 1
                        });
                        shared.push((place, deviation));
                    }
                }
            }
        }
        // With a prior, positive quantities are in their logarithm.
        let set = ParameterSet::new(&nominal, kinds.into_iter().map(|kind| (kind, Some(1.0))))?;
        Ok(Self {
            values: vec![0.0; set.len()],
            here: nominal.clone(),
            nominal,
            set,
            kept: kept.len(),
            shared,
            sources,
            unloaded: Unloaded::Own,
            functions: Vec::new(),
            sampled_functions: Vec::new(),
        })
    }

    /// The same where targets are read by themselves: joints then err by functions of their angles, which the robot keeps, where
    /// sources say so. Deflections hardly show them: there they are new in each configuration.
    pub fn of_single_readings(mut self) -> Self {
        self.functions = (self.sources.iter())
            .flat_map(ReadingSource::functions)
            .collect();
        self
    }

    /// Samples the joints' error functions of a run under a seed.
    pub fn sample_functions(&mut self, seed: u64, run: u64) {
        let random = generator(seed, streams::joint_functions(run));
        let numbered = self.functions.iter().enumerate();
        self.sampled_functions = numbered
            .map(|(number, each)| {
                let kernel = each.kernel_on(&self.nominal.chain);
                SampledFunction::new(kernel, random.clone(), number)
            })
            .collect();
    }

    /// The same where deflections rest on such readings without the load.
    pub const fn resting_on(mut self, unloaded: Unloaded) -> Self {
        self.unloaded = unloaded;
        self
    }

    /// Whether a source's part in the unloaded reading is that of all deflections of one configuration.
    fn is_halved(&self, source: &ReadingSource) -> bool {
        self.unloaded == Unloaded::Shared && source.is_of_both_readings()
    }

    /// How many normal numbers a reading takes for a source: as many again for the unloaded one, where that is another's, too.
    fn numbers_for(&self, source: &ReadingSource) -> usize {
        source.numbers() * if self.is_halved(source) { 2 } else { 1 }
    }

    /// Whether nothing is uncertain.
    pub fn is_certain(&self) -> bool {
        self.set.is_empty() && self.sources.is_empty()
    }

    /// How many normal numbers a run takes for so many measurements.
    pub fn numbers(&self, measurements: usize) -> usize {
        self.shared.len() + measurements * self.numbers_of_reading()
    }

    fn numbers_of_reading(&self) -> usize {
        let each = self.sources.iter();
        each.map(|source| self.numbers_for(source)).sum()
    }

    /// Whether each number that a run shares is the same in a later campaign.
    pub fn is_kept(&self) -> impl Iterator<Item = bool> {
        let parameters = self.set.parameters();
        let shared = self.shared.iter();
        shared.map(|&(place, _)| parameters[place].kind.is_kept_between_campaigns())
    }

    /// Draws what a run shares, from the first normals of a lane, beside what it has in common with an earlier campaign (by how much it
    /// differs from what is nominal).
    pub fn draw(&mut self, kept: &[f64], normals: &[[f64; LANES]], lane: usize) {
        self.values.fill(0.0);
        self.values[..self.kept].copy_from_slice(kept);
        for (&(place, deviation), normal) in self.shared.iter().zip(normals) {
            self.values[place] += deviation * normal[lane];
        }
        for (value, parameter) in self.values.iter_mut().zip(self.set.parameters()) {
            *value += parameter.nominal;
        }
        self.here = self.set.apply(&self.nominal, &self.values);
        // The virtual robot's joints hold by their laws: what they give follows from these.
        for each in &mut self.here.stiffening {
            each.share = 0.0;
        }
    }

    /// All that this run shares.
    pub fn sampled(&self) -> Vec<SampledValue> {
        let each = self.set.parameters().iter().zip(&self.values);
        each.map(|(parameter, &value)| SampledValue {
            name: parameter.name.clone(),
            unit: parameter.unit(),
            value,
        })
        .collect()
    }

    /// The laws by which joints hold in this run, whose compliances are these (rad/(N m)).
    pub fn torque_laws(&self, compliance_rad_per_nm: &[f64]) -> Vec<(usize, TorqueLaw)> {
        let law = |joint: usize| {
            let kind = ParameterKind::JointStiffening { joint };
            let share = self.set.index_of(kind).map(|_| self.difference(kind))?;
            let law = TorqueLaw {
                share,
                at: self.nominal.stiffening[joint].at,
            };
            Some((joint, law.by_deflection(compliance_rad_per_nm[joint])))
        };
        (0..compliance_rad_per_nm.len()).filter_map(law).collect()
    }

    /// By how much a parameter differs in this run from what is nominal, in its unit; nothing where it is not uncertain.
    pub fn difference(&self, kind: ParameterKind) -> f64 {
        self.sampled_difference(kind).unwrap_or(0.0)
    }

    /// The same where it is uncertain.
    pub fn sampled_difference(&self, kind: ParameterKind) -> Option<f64> {
        let index = self.set.index_of(kind)?;
        Some(self.values[index] - self.set.parameters()[index].nominal)
    }

    /// By how much a parameter differs in the run of a lane, in its unit.
    pub fn drawn(&self, kind: ParameterKind, normals: &[[f64; LANES]], lane: usize) -> f64 {
        let Some(index) = self.set.index_of(kind) else {
            return 0.0;
        };
        let numbers = self.shared.iter().zip(normals);
        numbers
            .filter(|((place, _), _)| *place == index)
            .map(|((_, deviation), normal)| deviation * normal[lane])
            .sum()
    }

    /// The load that acts at a test pose where this one is said to.
    pub fn acting_at_test_pose(&self, said: &Load) -> Load {
        let mut load = said.scaled(self.difference(ParameterKind::TaskScale).exp());
        for axis in Axis::ALL {
            load.force_n[axis.index()] += self.difference(ParameterKind::TaskForce { axis });
        }
        load
    }

    /// What of the robot's model differs: frames of links and of the calibration tool, what links weigh, springs.
    pub fn model_changes(&self) -> Vec<ModelChange> {
        let moved = self.set.displacements(&self.nominal, &self.values);
        let isometry = |change: &FrameChange| change.isometry();
        let links = (moved.links.iter().enumerate())
            .filter(|(_, change)| **change != FrameChange::default())
            .map(|(joint, change)| ModelChange::Link(joint, isometry(change)));
        let tools = (moved.tools.iter().zip(&self.nominal.tools))
            .filter(|(change, _)| **change != FrameChange::default())
            .map(|(change, tool)| ModelChange::Site(tool.name.clone(), isometry(change)));
        let springs = &self.nominal.chain.elements.springs;
        let name_of = |spring: usize| springs[spring].name.clone();
        let masses = self.set.parameters().iter().filter_map(|parameter| {
            let differs = self.difference(parameter.kind);
            match parameter.kind {
                ParameterKind::LinkMass { link } => Some(ModelChange::Mass(link, differs.exp())),
                ParameterKind::LinkCentre { link, axis } => {
                    let by = Vector3::ith(axis.index(), differs);
                    Some(ModelChange::Centre(link, by))
                }
                ParameterKind::SpringStiffness { spring } => {
                    Some(ModelChange::Spring(name_of(spring), differs.exp(), 0.0))
                }
                ParameterKind::SpringRest { spring } => {
                    Some(ModelChange::Spring(name_of(spring), 1.0, differs))
                }
                _ => None,
            }
        });
        links.chain(tools).chain(masses).collect()
    }

    /// What the joints really are commanded (rad) where a controller commands this: zeros and gaps are in it. A load acts at
    /// the calibration tool or, at a test pose, at the machining tool.
    pub fn commanded(
        &self,
        q: &DVector<f64>,
        load: &Load,
        is_test_pose: bool,
        approach: Option<&Approach>,
    ) -> DVector<f64> {
        let tool = if is_test_pose {
            self.here.tools.len() - 1
        } else {
            0
        };
        let offsets = (self.here).offsets_rad(q.as_slice(), tool, load, approach);
        let mut commanded =
            DVector::from_iterator(q.len(), q.iter().zip(offsets).map(|(q, offset)| q + offset));
        for (function, sampled) in self.functions.iter().zip(&self.sampled_functions) {
            let joint = function.joint;
            let place = self.nominal.chain.joints[joint].in_turn(q[joint]);
            commanded[joint] += function.deviation_rad * sampled.at(place);
        }
        commanded
    }

    /// Measures a plan on a virtual robot in this laboratory, without the instrument's own noise.
    /// `normals` are those of [`Self::draw`].
    pub fn measure(
        &self,
        robot: &mut VirtualRobot,
        plan: &Plan,
        instrument: &Instrument,
        normals: &[[f64; LANES]],
        lane: usize,
    ) -> Result<Vec<Measurement>, MeasurementError> {
        let read = |visit: Visit<'_>| {
            let moved = visit.displacement(robot)?;
            let shown = self.read(&visit, &moved);
            Ok(measurement(visit.experiment, instrument, shown))
        };
        let visits = self.visits(plan, normals, lane).into_iter();
        visits.map(read).collect()
    }

    /// What each reading of a plan comes about by, in its order. `normals` are those of [`Self::draw`].
    pub fn visits<'a>(
        &self,
        plan: &'a Plan,
        normals: &[[f64; LANES]],
        lane: usize,
    ) -> Vec<Visit<'a>> {
        // What one configuration shares is drawn with the first of its measurements.
        let firsts = self.first_of_configuration(plan);
        let mut visits = Vec::with_capacity(plan.measurements() as usize);
        for (index, experiment) in plan.experiments.iter().enumerate() {
            for _ in 0..experiment.repeats {
                // A deflection is a visit of its own.
                let own = visits.len();
                let numbers = ReadingNumbers {
                    reading: own,
                    load: own,
                    visit: own,
                    configuration: firsts[index],
                };
                visits.push(self.visit(index + 1, experiment, (normals, lane), numbers));
            }
        }
        visits
    }

    /// The number of the first measurement in the configuration of each experiment.
    fn first_of_configuration(&self, plan: &Plan) -> Vec<usize> {
        let mut count = 0;
        let own: Vec<usize> = (plan.experiments.iter())
            .map(|experiment| {
                count += experiment.repeats as usize;
                count - experiment.repeats as usize
            })
            .collect();
        let is_shared = |source: &ReadingSource| source.shared_part(self.unloaded) > 0.0;
        if !self.sources.iter().any(is_shared) {
            return own;
        }
        let mut firsts = own.clone();
        for members in plan.by_configuration() {
            for &member in &members {
                firsts[member] = own[members[0]];
            }
        }
        firsts
    }

    fn visit<'a>(
        &self,
        number: usize,
        experiment: &'a Experiment,
        normals: (&[[f64; LANES]], usize),
        numbers: ReadingNumbers,
    ) -> Visit<'a> {
        let (q, approach) = (&experiment.configuration_rad, experiment.approach.as_ref());
        let mut unloaded = self.commanded(q, &Load::NONE, false, approach);
        let mut load: Load = self.here.acting(&experiment.load);
        // A load that turns joints over their gaps moves them between the two readings.
        let mut returned = if self.here.leans() {
            self.commanded(q, &load, false, approach) - &unloaded
        } else {
            unloaded.map(|_| 0.0)
        };
        let turn = |cause, joint: usize, by_rad| match cause {
            OffBy::Return => returned[joint] += by_rad,
            OffBy::Gear => unloaded[joint] += by_rad,
        };
        let noise = self.noise(&mut load, 1.0, normals, numbers, turn);
        let loaded = &unloaded + returned;
        Visit {
            number,
            experiment,
            commanded_rad: [unloaded, loaded],
            load,
            noise,
        }
    }

    /// What the instrument shows of a displacement, without its own noise: of position (m) and rotation (rad).
    fn read(&self, visit: &Visit<'_>, displacement: &Displacement) -> (Vector3<f64>, Vector3<f64>) {
        let mut moved = displacement.position_m + visit.noise.discrepancy_m;
        let is_along = visit.experiment.direction.is_some();
        if !is_along {
            for (range, normals) in &visit.noise.by_distance {
                moved += range.drawn(normals, &(displacement.at_m - range.from_m));
            }
        }
        let base: &Isometry3<f64> = &self.here.instrument_from_base[0];
        // A gauge that is turned shows what one that is not shows of what is turned back.
        let (turned_rad, drift_share) = if is_along {
            (visit.noise.turned_rad, self.here.drift_along)
        } else {
            (Vector3::zeros(), 1.0)
        };
        let turned_back = Rotation3::new(-turned_rad);
        (
            turned_back * (base.rotation * moved + self.here.drift_m * drift_share),
            base.rotation * displacement.rotation_rad,
        )
    }
}

/// What a reading of a deflection comes about by in a run.
#[derive(Debug, Clone)]
pub struct Visit<'a> {
    /// The number of its experiment, from 1.
    number: usize,
    experiment: &'a Experiment,
    /// What the joints are commanded before and under the load (rad).
    pub commanded_rad: [DVector<f64>; 2],
    /// What acts at the calibration tool.
    pub load: Load,
    noise: ReadingNoise,
}

impl Visit<'_> {
    /// What no model explains of the deflection (m).
    pub const fn discrepancy_m(&self) -> Vector3<f64> {
        self.noise.discrepancy_m
    }

    /// How far a virtual robot's tool moves.
    pub fn displacement(&self, robot: &mut VirtualRobot) -> Result<Displacement, MeasurementError> {
        let [unloaded, loaded] = &self.commanded_rad;
        robot.displacement_between(self.number, (unloaded, loaded), &self.load)
    }
}

/// Which reading of a run brings what is new in this one: itself, the first under its load in its visit, the first of the visit, and the
/// first in its configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadingNumbers {
    /// The reading.
    pub reading: usize,
    /// The first under its load in its visit.
    pub load: usize,
    /// The first of its visit.
    pub visit: usize,
    /// The first in its configuration.
    pub configuration: usize,
}

/// What differs when a target is read by itself, not twice for a deflection.
#[derive(Debug, Clone)]
pub(super) struct SingleReading {
    /// What the joints are commanded (rad).
    pub commanded_rad: DVector<f64>,
    /// What hangs on the calibration tool.
    pub load: Load,
    /// What the place that is read is off by.
    pub noise: ReadingNoise,
}

/// What the place that is read is off by, besides what joints and loads do.
#[derive(Debug, Clone)]
pub(super) struct ReadingNoise {
    /// By what no model of the robot explains (m, world frame),
    pub discrepancy_m: Vector3<f64>,
    /// and by the distance from the instrument, with its three numbers each.
    pub by_distance: Vec<(RangeNoise, Vector3<f64>)>,
    /// How a gauge is turned from its direction, a rotation vector (rad).
    pub turned_rad: Vector3<f64>,
}

/// Why a joint is elsewhere.
#[derive(Debug, Clone, Copy)]
enum OffBy {
    /// It does not come back.
    Return,
    /// Its gear.
    Gear,
}

impl Circumstances {
    /// A reading of a target by itself. Of what is told of deflections, joints that return and the instrument's range, it has half
    /// the variance.
    pub(super) fn reading(
        &self,
        experiment: &Experiment,
        normals: &[[f64; LANES]],
        lane: usize,
        numbers: ReadingNumbers,
    ) -> SingleReading {
        let (q, approach) = (&experiment.configuration_rad, experiment.approach.as_ref());
        let mut load = self.here.acting(&experiment.load);
        let mut commanded_rad = self.commanded(q, &load, false, approach);
        let turn = |_, joint: usize, by_rad| commanded_rad[joint] += by_rad;
        let noise = self.noise(&mut load, OF_ONE_READING, (normals, lane), numbers, turn);
        SingleReading {
            commanded_rad,
            load,
            noise,
        }
    }

    /// What is new in a reading, its visit or its configuration, of whose numbers it takes its own: what acts is moved, and so are
    /// the joints. What is told of deflections counts by `of_deflection`.
    fn noise(
        &self,
        load: &mut Load,
        of_deflection: f64,
        (normals, lane): (&[[f64; LANES]], usize),
        numbers: ReadingNumbers,
        mut turn: impl FnMut(OffBy, usize, f64),
    ) -> ReadingNoise {
        let size = self.numbers_of_reading();
        let number = |reading: usize, place: usize| {
            normals[self.shared.len() + reading * size + place][lane]
        };
        let (mut discrepancy_m, mut turned_rad) = (Vector3::zeros(), Vector3::zeros());
        let mut by_distance = Vec::new();
        let mut place = 0;
        for source in &self.sources {
            let own = match source.level() {
                SourceLevel::Reading => numbers.reading,
                SourceLevel::Visit if source.is_of_load() => numbers.load,
                SourceLevel::Visit => numbers.visit,
                _ => numbers.configuration,
            };
            let is_halved = self.is_halved(source);
            let mut next = |deviation: f64| {
                place += 1;
                if !is_halved {
                    return deviation * number(own, place - 1);
                }
                place += 1;
                let unloaded = number(numbers.configuration, place - 1);
                let loaded = number(own, place - 2);
                deviation * (loaded - unloaded) * OF_ONE_READING
            };
            let mut three = |deviation: f64| Vector3::from_fn(|_, _| next(deviation));
            match source {
                ReadingSource::JointRepeatability(deviations) => {
                    for (joint, &deviation) in deviations.iter().enumerate() {
                        turn(OffBy::Return, joint, next(deviation * of_deflection));
                    }
                }
                ReadingSource::TransmissionError(error) => {
                    let is_function = !self.functions.is_empty() && error.kernel.is_some();
                    let own = if is_function { 0.0 } else { 1.0 };
                    for (joint, &deviation) in error.deviations.iter().enumerate() {
                        turn(OffBy::Gear, joint, next(own * deviation));
                    }
                }
                ReadingSource::Discrepancy(error) => {
                    let is_single = of_deflection < 1.0;
                    discrepancy_m += three(if is_single {
                        error.in_reading_m(load)
                    } else {
                        error.in_deflection_m()
                    });
                }
                ReadingSource::LoadDirection(deviation) => {
                    let turn = Rotation3::new(three(*deviation));
                    *load = load.turned(turn.matrix());
                }
                ReadingSource::LoadPoint(deviation) => {
                    load.torque_nm += three(*deviation).cross(&load.force_n);
                }
                ReadingSource::GaugeDirection(deviation) => turned_rad += three(*deviation),
                ReadingSource::Range(noise) => {
                    by_distance.push((noise.scaled(of_deflection), three(1.0)));
                }
            }
        }
        ReadingNoise {
            discrepancy_m,
            by_distance,
            turned_rad,
        }
    }
}
