//! Virtual readings of a plan of absolute readings: what an instrument shows of a virtual robot, visit by visit.

use std::collections::BTreeMap;

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion,
    Vector3, Vector6,
};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::experiment::{Candidate, Experiment};
use crate::files::FileError;
use crate::measurement::AbsoluteReading;
use crate::numeric::random::generator;
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::{Stream, frames_of_trial};
use crate::observation::ReadLength;
use crate::plan::absolute::{AbsolutePlanning, RepeatedReading};
use crate::robot::{EquilibriumError, Load};
use crate::task::{Belief, Loading, Station, Task, station_named};
use crate::testbed::{ReadingNumbers, SeenFrom, TrueRobots, Truth};

/// The instrument is within such a cube about the robot (m).
const AWAY_M: f64 = 3.0;
/// What lengths are read from is within such a cube about where it is believed to be (m): measured with a ruler.
const OFF_M: f64 = 1e-3;
/// A reading has this share of the standard deviation of a deflection, which is made of two.
const OF_DEFLECTION: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Why there are no readings.
#[derive(Debug, Error)]
pub enum VirtualReadingError {
    /// The virtual robot lacks something.
    #[error(transparent)]
    Model(#[from] FileError),
    /// It does not rest.
    #[error("line {line}: {error}")]
    Rest {
        /// The line of the plan.
        line: usize,
        /// Why it does not.
        error: EquilibriumError,
    },
}

/// A plan of absolute readings as it is carried out.
#[derive(Debug)]
pub struct ReadPlan<'a> {
    planning: &'a AbsolutePlanning<'a>,
    plan: &'a [(usize, u32)],
    /// The readings by configuration, those that visits repeat alike together.
    pub groups: Vec<Vec<RepeatedReading>>,
    /// What is sampled for each of them, visit by visit.
    numbers: Vec<Vec<ReadingNumbers>>,
}

/// A row of a plan with the visits in which it is read.
#[derive(Debug)]
pub struct VisitedRow<'a> {
    /// The row.
    pub row: &'a Candidate,
    /// What is read, and from where.
    pub seen: SeenFrom<'a>,
    /// The station, where the scenario has it.
    pub station: Option<&'a Station>,
    /// What is sampled, visit by visit.
    pub numbers: &'a [ReadingNumbers],
    each: RepeatedReading,
}

impl VisitedRow<'_> {
    /// Where the target is and its axes in a visit, under a load, as they are read without the instrument's own noise.
    pub fn rest(
        &self,
        robots: &mut TrueRobots,
        numbers: ReadingNumbers,
        load: Load,
    ) -> Result<(Vector3<f64>, Matrix3<f64>), VirtualReadingError> {
        let experiment = Experiment {
            load,
            ..self.row.experiment(1)
        };
        let rest = robots.read(&experiment, self.seen, numbers);
        rest.map_err(|error| VirtualReadingError::Rest {
            line: self.row.line,
            error,
        })
    }
}

/// What an instrument shows of a target once, in its own frame.
#[derive(Debug, Clone, Copy)]
pub struct TargetReading {
    /// Which reading of the plan it is, and of which visit: rows count in their order, each with its repeats.
    pub numbers: ReadingNumbers,
    /// Where the target is (m); of lengths the first coordinate is the length,
    pub position_m: Vector3<f64>,
    /// and its axes.
    pub rotation: Rotation3<f64>,
}

impl<'a> ReadPlan<'a> {
    /// A plan: candidates by their places, and how often each is read.
    pub fn new(planning: &'a AbsolutePlanning<'a>, plan: &'a [(usize, u32)]) -> Self {
        let groups = planning.by_configuration(plan);
        Self {
            planning,
            plan,
            numbers: numbers(planning, plan, &groups),
            groups,
        }
    }

    /// How many readings there are.
    pub fn count(&self) -> usize {
        self.plan.iter().map(|(_, times)| *times as usize).sum()
    }

    /// What the rows of the plan read.
    pub fn targets(&self) -> impl Iterator<Item = &str> {
        (self.plan.iter()).map(|&(place, _)| self.planning.target(place))
    }

    /// The rows by configuration, those that visits repeat alike together.
    pub fn rows<'b>(&'b self, belief: &'b Belief) -> impl Iterator<Item = VisitedRow<'b>> {
        let visited = self.groups.iter().flatten().zip(&self.numbers);
        visited.map(|(each, numbers)| {
            let row = &self.planning.candidates[each.place];
            let name = row.station.as_deref();
            let station = station_named(&belief.stations, name);
            VisitedRow {
                row,
                seen: SeenFrom {
                    target: self.planning.target(each.place),
                    station_m: station.map(|station| station.position_m),
                    by_tracker: belief.reads_by_tracker(name),
                },
                station,
                numbers,
                each: *each,
            }
        })
    }

    /// The frame of each station in a run, whatever else is read: anywhere about the robot; of those that lengths are read from near
    /// where they are believed to be, as far as the run's robot, which is as it was sampled last, does not say.
    pub fn frames(&self, robots: &TrueRobots, seed: u64, run: u64) -> Vec<Isometry3<f64>> {
        let stations = self.planning.stations().iter();
        let anywhere = stations.map(|name| self.frame(name.as_deref(), seed, run));
        let sampled = |kind| robots.sampled_of(kind);
        (self.planning).frames_of_run(anywhere.collect(), OFF_M / AWAY_M, sampled)
    }

    /// Where a station's instrument stands in a run: one of the scenario by its place in there, another by its name.
    fn frame(&self, name: Option<&str>, seed: u64, run: u64) -> Isometry3<f64> {
        let known = &self.planning.task().belief.stations;
        let place = known.iter().position(|each| Some(&*each.name) == name);
        let own = name.filter(|_| place.is_none()).map_or(0, |name| {
            let digest = Sha256::digest(name.as_bytes());
            (digest.iter().take(8)).fold(0, |all, &byte| all << 8 | u64::from(byte))
        });
        let mut random = generator(seed ^ own, frames_of_trial(run));
        for _ in 0..place.unwrap_or(0) {
            anywhere(&mut random);
        }
        anywhere(&mut random)
    }

    /// Reads the robot of a run from instruments with these frames: each of the readings that visits repeat alike, so often.
    pub fn read(
        &self,
        task: &Task,
        robots: &mut TrueRobots,
        frames: &[Isometry3<f64>],
        seed: u64,
        run: u64,
    ) -> Result<Vec<(RepeatedReading, Vec<TargetReading>)>, VirtualReadingError> {
        let sigma = &task.belief.instrument;
        let sigma_rad = OF_DEFLECTION * sigma.rotation_sigma_rad.unwrap_or(0.0);
        let mut noise = vec![[0.0; LANES]; 6 * self.count()];
        fill_normals(Stream::Noise, seed, run, &mut noise);
        let mut all = Vec::with_capacity(self.numbers.len());
        for visited in self.rows(&task.belief) {
            let each = visited.each;
            let load = visited.row.load.unwrap_or(Load::NONE);
            let frame = &frames[self.planning.station_of(each.place)];
            let length = task.belief.length_from(visited.row.station.as_deref());
            let noise_m = match length {
                None => sigma.noise_m(),
                Some((_, shows)) => sigma.length_noise_m(shows),
            };
            let sigma_m = OF_DEFLECTION * noise_m;
            let shown = visited.numbers.iter().map(|&numbers| {
                let (at_m, axes) = visited.rest(robots, numbers, load)?;
                let own = &noise[6 * numbers.reading..];
                let three = |from: usize| Vector3::from_fn(|axis, _| own[from + axis][0]);
                let exact_m = (frame * Point3::from(at_m)).coords;
                Ok(TargetReading {
                    numbers,
                    position_m: match length {
                        None => exact_m + three(0) * sigma_m,
                        Some((kind, shows)) => {
                            let read_m = kind.row(&exact_m).0 + own[0][0] * sigma_m;
                            Vector3::ith(0, shows.rounded_m(read_m))
                        }
                    },
                    rotation: Rotation3::new(three(3) * sigma_rad)
                        * frame.rotation.to_rotation_matrix()
                        * Rotation3::from_matrix_unchecked(axes),
                })
            });
            all.push((each, shown.collect::<Result<_, VirtualReadingError>>()?));
        }
        Ok(all)
    }

    /// All readings of the robot of a run, each with the instrument's own covariance, in the order of the plan's rows.
    pub fn readings(
        &self,
        task: &Task,
        robots: &mut TrueRobots,
        seed: u64,
        run: u64,
    ) -> Result<Vec<AbsoluteReading>, VirtualReadingError> {
        let instrument = &task.belief.instrument;
        let stays = task.belief.loading == Loading::InPlace;
        let mut readings = Vec::with_capacity(self.count());
        let frames = self.frames(robots, seed, robots.campaign_of(run));
        for (each, shown) in self.read(task, robots, &frames, seed, robots.readings_of(run))? {
            let station = self.planning.candidates[each.place].station.as_deref();
            let shows = task.belief.length_from(station).map(|(_, shows)| shows);
            let [m, rad] = [
                instrument.sigma_by_m(shows),
                instrument.rotation_sigma_rad.unwrap_or(0.0),
            ]
            .map(|sigma| (OF_DEFLECTION * sigma).powi(2));
            let covariance = Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
            readings.extend(shown.into_iter().map(|shown| {
                let turned = instrument.rotation_sigma_rad.map(|_| shown.rotation);
                let reading = AbsoluteReading {
                    visit: stays.then(|| (shown.numbers.visit + 1).to_string()),
                    ..self.reading(each.place, shown.position_m, turned, covariance)
                };
                (shown.numbers.reading, reading)
            }));
        }
        readings.sort_by_key(|(number, _)| *number);
        Ok(readings.into_iter().map(|(_, reading)| reading).collect())
    }

    /// A row of a file with what was read there.
    pub fn reading(
        &self,
        place: usize,
        position_m: Vector3<f64>,
        rotation: Option<Rotation3<f64>>,
        covariance: Matrix6<f64>,
    ) -> AbsoluteReading {
        let blank = self.planning.blank_reading(place);
        let rotation = rotation.filter(|_| blank.length.is_none());
        AbsoluteReading {
            position_m,
            length: blank.length.map(|length| ReadLength {
                length_m: position_m.x,
                ..length
            }),
            rotation: rotation.map(|turned| UnitQuaternion::from_rotation_matrix(&turned)),
            covariance: Some(covariance),
            ..blank
        }
    }
}

/// What is sampled for the visits of each reading: readings count in the plan's order, each with its repeats, and the first of a
/// visit, under a load in it, or of a configuration brings what all of it share.
fn numbers(
    planning: &AbsolutePlanning<'_>,
    plan: &[(usize, u32)],
    groups: &[Vec<RepeatedReading>],
) -> Vec<Vec<ReadingNumbers>> {
    let mut firsts = BTreeMap::new();
    let mut count = 0;
    for &(place, times) in plan {
        firsts.insert(place, count);
        count += times as usize;
    }
    let mut all = Vec::new();
    for group in groups {
        let configuration = group.iter().map(|each| firsts[&each.place]).min();
        for visits in group.chunk_by(|one, other| one.visits == other.visits) {
            let visit = visits.iter().map(|each| firsts[&each.place]).min();
            let [visit, configuration] = [visit, configuration].map(Option::unwrap_or_default);
            for each in visits {
                let first = firsts[&each.place];
                let load = |each: &RepeatedReading| planning.load_of_visit(each.place);
                let under_it = visits.iter().filter(|other| load(other) == load(each));
                let under_it = under_it.map(|each| firsts[&each.place]).min();
                let of_visit = |number: usize| ReadingNumbers {
                    reading: first + number,
                    load: under_it.unwrap_or(first) + number,
                    visit: visit + number,
                    configuration,
                };
                all.push((0..each.times as usize).map(of_visit).collect());
            }
            for each in visits {
                if let Some(next) = firsts.get_mut(&each.place) {
                    *next += each.times as usize;
                }
            }
        }
    }
    all
}

/// All readings of all candidates in a run under a seed, each with the instrument's own covariance, in the order of the plan's rows: the
/// robot differs in what the scenario lists as uncertain, the instrument's frames are anywhere, and each reading has noise.
///
/// # Errors
/// The virtual robot lacks what is read, or does not rest.
pub fn virtual_readings(
    task: &Task,
    truth: &Truth,
    planning: &AbsolutePlanning<'_>,
    seed: u64,
    run: u64,
    campaign: u64,
    series: u64,
) -> Result<Vec<AbsoluteReading>, VirtualReadingError> {
    let whole = planning.whole();
    let plan = ReadPlan::new(planning, &whole);
    let robots = TrueRobots::of_readings(&task.belief, truth, plan.targets())?;
    let mut robots = robots.in_series(campaign, series);
    robots.become_run_of(truth, plan.count(), seed, run)?;
    plan.readings(task, &mut robots, seed, run)
}

/// A position (m), and a quaternion that is not of unit length.
fn anywhere(random: &mut impl Rng) -> Isometry3<f64> {
    let [x, y, z] = [(); 3].map(|()| AWAY_M * (2.0 * random.random::<f64>() - 1.0));
    let [w, i, j, k] = [(); 4].map(|()| StandardNormal.sample(random));
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
    )
}
