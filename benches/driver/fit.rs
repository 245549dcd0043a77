//! The fit of 45 parameters to 1000 poses of a KR-270 with two reflectors and a payload.

use elastocal::identification::{ParameterFit, fit_parameters};
use elastocal::numeric::random::generator;
use elastocal::observation::{
    Observation, ObservationModel, PlannedReading, Reading, ReadingKind, Setup, Whitener,
    planned_information,
};
use elastocal::parameter::{Axis, ElasticArm, Freedoms, ParameterKind, ParameterSet, Payload};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use nalgebra::{DVector, Matrix6xX, Rotation3, Vector3};
use rand::RngExt;
use serde_json::{Value, json};

const POSES: usize = 1000;
const SIGMA_M: f64 = 1e-5;
const SIGMA_RAD: f64 = 1e-5;

/// The belief, its unknowns, and what was read.
pub struct Fit {
    pub belief: ElasticArm,
    pub set: ParameterSet,
    pub observations: Vec<Observation>,
}

impl Fit {
    pub fn new(scenario: &Scenario) -> Self {
        let robot = &scenario.task.belief.nominal;
        let tools = vec![
            scenario.task.belief.calibration_tool.clone(),
            scenario.task.belief.machining_tool.clone(),
        ];
        let mut belief = ElasticArm::new(
            robot.chain.clone(),
            robot.compliance_rad_per_nm.clone(),
            tools,
        );
        belief.payload = Some(Payload {
            link: 5,
            mass_kg: 250.0,
            centre_of_mass_m: Vector3::new(0.4, 0.1, -0.2),
        });
        let setups = setups(scenario);
        let set = minimal(&belief, &setups);
        assert_eq!(set.len(), 45, "{:?}", set.parameters());
        let mut random = generator(1, 1);
        let truth = set
            .parameters()
            .iter()
            .map(|each| each.nominal + 0.5 * each.scale * random.random_range(-1.0..1.0));
        let truth = DVector::from_iterator(set.len(), truth);
        let mut model = ObservationModel::new(&set, &belief, truth.as_slice());
        let mut ignored = Matrix6xX::zeros(set.len());
        let mut error = |size: f64| {
            Vector3::from_fn(|_, _| 3.0_f64.sqrt() * size * random.random_range(-1.0..1.0))
        };
        let observations = setups
            .into_iter()
            .map(|setup| {
                let seen = model
                    .predict(&setup, ReadingKind::Pose, &mut ignored)
                    .expect("stable");
                Observation {
                    setup,
                    reading: Reading::Pose {
                        position_m: seen.position_m + error(SIGMA_M),
                        rotation: Rotation3::from_scaled_axis(error(SIGMA_RAD)) * seen.rotation,
                    },
                    whitener: whitener(),
                }
            })
            .collect();
        Self {
            belief,
            set,
            observations,
        }
    }

    pub fn solve(&self) -> ParameterFit {
        fit_parameters(&self.belief, &self.set, &self.observations).expect("a fit")
    }

    /// All that another program needs to do the same, with what came of it here.
    pub fn record(&self) -> Value {
        let fit = self.solve();
        let matrix = |rotation: &nalgebra::Matrix3<f64>| rotation.transpose().as_slice().to_vec();
        let poses = self.observations.iter().map(|each| match each.reading {
            Reading::Pose {
                position_m,
                rotation,
            } => (position_m, rotation),
            _ => unreachable!("poses"),
        });
        let poses: Vec<_> = poses.collect();
        let payload = self.belief.payload.expect("a payload");
        json!({
            "parameters": self.set.parameters().iter().map(|each| json!({
                "name": each.name,
                "nominal": each.nominal,
                "scale": each.scale,
            })).collect::<Vec<_>>(),
            "payload": {
                "link": payload.link,
                "mass_kg": payload.mass_kg,
                "centre_of_mass_m": payload.centre_of_mass_m.as_slice(),
            },
            "sigma_m": SIGMA_M,
            "sigma_rad": SIGMA_RAD,
            "q_rad": self.observations.iter().map(|each| each.setup.commanded_rad.as_slice()).collect::<Vec<_>>(),
            "force_n": self.observations.iter().map(|each| each.setup.load.force_n.as_slice()).collect::<Vec<_>>(),
            "target": self.observations.iter().map(|each| each.setup.target).collect::<Vec<_>>(),
            "position_m": poses.iter().map(|(position, _)| position.as_slice()).collect::<Vec<_>>(),
            "rotation": poses.iter().map(|(_, rotation)| matrix(rotation)).collect::<Vec<_>>(),
            "values": fit.posterior.mean,
            "square": fit.square,
            "iterations": fit.iterations,
        })
    }
}

fn setups(scenario: &Scenario) -> Vec<Setup> {
    let mut random = generator(1, 0);
    (0..POSES)
        .map(|index| Setup {
            hangs_on: None,
            commanded_rad: DVector::from_iterator(
                scenario.task.belief.joints(),
                (scenario.task.region.joint_range_rad.iter())
                    .map(|[low, high]| random.random_range(*low..=*high)),
            ),
            load: Load::force(
                random.random_range(-500.0..500.0),
                random.random_range(-500.0..500.0),
                0.0,
            ),
            target: index % 2,
            station: 0,
            approach: None,
        })
        .collect()
}

fn whitener() -> Whitener {
    Whitener::independent(Vector3::repeat(SIGMA_M), Vector3::repeat(SIGMA_RAD))
}

/// Frames, compliances and the payload, without those that are redundant.
fn minimal(belief: &ElasticArm, setups: &[Setup]) -> ParameterSet {
    let mut kinds = Vec::new();
    for axis in Axis::ALL {
        kinds.push(ParameterKind::BasePosition { station: 0, axis });
        kinds.push(ParameterKind::BaseRotation { station: 0, axis });
        for tool in 0..2 {
            kinds.push(ParameterKind::ToolPosition { tool, axis });
            kinds.push(ParameterKind::ToolRotation { tool, axis });
        }
        for link in 1..6 {
            kinds.push(ParameterKind::LinkPosition { link, axis });
            kinds.push(ParameterKind::LinkRotation { link, axis });
        }
        kinds.push(ParameterKind::PayloadCentre { axis });
    }
    kinds.extend((1..6).map(|joint| ParameterKind::JointCompliance { joint }));
    kinds.push(ParameterKind::PayloadMass);
    let unknown = |kinds: &[ParameterKind]| {
        ParameterSet::new(belief, kinds.iter().map(|&kind| (kind, None))).expect("a set")
    };
    let all = unknown(&kinds);
    let planned: Vec<PlannedReading> = (setups.iter())
        .map(|setup| PlannedReading {
            setup: setup.clone(),
            kind: ReadingKind::Pose,
            whitener: whitener(),
        })
        .collect();
    let information = planned_information(&all, belief, &all.prior().mean, &planned);
    let redundant = Freedoms::new(belief, &all, &information).redundant();
    let kept = (0..kinds.len()).filter(|index| !redundant.contains(index));
    let kept: Vec<ParameterKind> = kept.map(|index| kinds[index]).collect();
    unknown(&kept)
}
