//! Identifiability of a robot: a minimal set of parameters for each
//! kind of reading, and why the others are redundant.

use nalgebra::{DVector, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, UnitSphere};

use crate::experiment::Loads;
use crate::numeric::{random::generator, random::streams::UNKNOWNS};
use crate::observation::{PlannedReading, ReadingKind, Setup, Whitener, planned_information};
use crate::parameter::{ElasticArm, Freedom, Freedoms, ParameterKind, ParameterSet};
use crate::robot::Load;
use crate::task::Task;

/// Random setups that stand for all that a scenario allows; far more than are needed.
const SETUPS: usize = 300;
/// The standard deviation of rotations (rad) where the instrument has none.
const ROTATION_SIGMA_RAD: f64 = 1e-4;

/// What one kind of reading can tell of the frames of base, links and calibration tool, joint zeros,
/// compliances, and the scale of the load.
#[derive(Debug, Clone, PartialEq)]
pub struct Unknowns {
    /// What is read at the calibration tool.
    pub reading: ReadingKind,
    /// All parameters.
    pub names: Vec<String>,
    /// What cannot be separated, each with the parameter that can be left out without loss.
    pub freedoms: Vec<Freedom>,
}

impl Unknowns {
    /// The names of a minimal set of parameters: all of them are determined, and the others would add
    /// nothing.
    pub fn minimal(&self) -> Vec<&str> {
        let is_redundant = |index| self.freedoms.iter().any(|each| each.redundant == index);
        (0..self.names.len())
            .filter(|&index| !is_redundant(index))
            .map(|index| self.names[index].as_str())
            .collect()
    }
}

/// For deflections, positions and poses, at random configurations in the joints' ranges under loads of
/// the task, drawn under a seed.
pub fn unknowns(task: &Task, seed: u64) -> Vec<Unknowns> {
    let robot = &task.belief.nominal;
    let belief = ElasticArm::new(
        robot.chain.clone(),
        robot.compliance_rad_per_nm.clone(),
        vec![task.belief.calibration_tool.clone()],
    );
    let kinds = ParameterKind::all_of(&belief);
    let Ok(set) = ParameterSet::new(&belief, kinds.into_iter().map(|kind| (kind, None))) else {
        return Vec::new();
    };
    let setups = setups(task, seed);
    let instrument = &task.belief.instrument;
    let rotation = instrument.rotation_sigma_rad.unwrap_or(ROTATION_SIGMA_RAD);
    let whitener = Whitener::independent(
        Vector3::repeat(instrument.sigma_m),
        Vector3::repeat(rotation),
    );
    [
        ReadingKind::Deflection,
        ReadingKind::Position,
        ReadingKind::Pose,
    ]
    .map(|kind| {
        let planned: Vec<PlannedReading> = (setups.iter())
            .map(|setup| PlannedReading {
                setup: setup.clone(),
                kind,
                whitener,
            })
            .collect();
        let information = planned_information(&set, &belief, &set.prior().mean, &planned);
        Unknowns {
            reading: kind,
            names: set
                .parameters()
                .iter()
                .map(|each| each.name.clone())
                .collect(),
            freedoms: Freedoms::new(&belief, &set, &information).named,
        }
    })
    .into()
}

fn setups(task: &Task, seed: u64) -> Vec<Setup> {
    let mut random = generator(seed, UNKNOWNS);
    (0..SETUPS)
        .map(|_| Setup {
            commanded_rad: DVector::from_iterator(
                task.belief.joints(),
                (task.region.joint_range_rad.iter())
                    .map(|[low, high]| low + (high - low) * random.random::<f64>()),
            ),
            load: match &task.loads {
                Loads::Fixed(load) => *load,
                Loads::Direction { direction, force_n } => {
                    let share: f64 = random.random();
                    let [x, y, z] =
                        (direction * (force_n[0] + (force_n[1] - force_n[0]) * share)).into();
                    Load::force(x, y, z)
                }
                Loads::Any { force_max_n } => {
                    let [x, y, z]: [f64; 3] = UnitSphere.sample(&mut random);
                    Load::force(x * force_max_n, y * force_max_n, z * force_max_n)
                }
                Loads::List(loads) => loads[random.random_range(0..loads.len())],
            },
            hangs_on: None,
            target: 0,
            station: 0,
            approach: None,
        })
        .collect()
}
