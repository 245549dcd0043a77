//! What the file of an identified robot says of its parameters, and where the instrument stood.

use nalgebra::{DMatrix, Isometry3};

use crate::files::FileError;
use crate::identification::StoredRobot;
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet, SourceLevel};
use crate::task::Belief;

/// Where an instrument stood.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedStation {
    /// The station's word; none where the readings name no station.
    pub name: Option<String>,
    /// The robot's base in the frame in which the instrument gave its readings there.
    pub instrument_from_base: Isometry3<f64>,
}

/// Where the instrument stood, from a file of absolute readings.
pub(super) fn identified_stations(stored: &StoredRobot) -> Vec<IdentifiedStation> {
    let stations = stored.message.stations.iter();
    stations
        .map(|station| IdentifiedStation {
            name: station.name.clone(),
            instrument_from_base: station.frame(&Isometry3::identity()),
        })
        .collect()
}

/// What is known of the robot's own parameters, wherever the stations are, and of the task's force, of which no reading says anything.
pub(super) fn known(
    stored: &StoredRobot,
    (arm, belief): (&ElasticArm, &Belief),
    kinds: &[Option<ParameterKind>],
) -> Result<(ParameterSet, Posterior), FileError> {
    let unknowns = &stored.message.unknowns;
    let own: Vec<(usize, ParameterKind)> = (kinds.iter().enumerate())
        .filter_map(|(index, kind)| Some((index, (*kind)?)))
        .collect();
    let of_task = belief.uncertain.set().parameters().iter();
    let of_task = of_task.filter(|each| each.kind.level() == SourceLevel::Task);
    let of_task: Vec<(ParameterKind, f64)> = of_task
        .filter_map(|each| Some((each.kind, each.prior_deviation?)))
        .collect();
    let all = own.iter().map(|&(_, kind)| kind);
    let all = all.chain(of_task.iter().map(|&(kind, _)| kind));
    let set = ParameterSet::new(arm, all.map(|kind| (kind, None)))
        .map_err(|error| stored.wrong("unknowns", error.to_string()))?;
    let hidden: Vec<usize> = (0..own.len())
        .filter(|&place| unknowns[own[place].0].standard_error.is_none())
        .collect();
    let values = stored.values(arm)?;
    let factor = |&(index, _): &(usize, ParameterKind)| values[index].factor;
    let covariance = DMatrix::from_fn(set.len(), set.len(), |row, column| {
        match (own.get(row), own.get(column)) {
            (Some(one), Some(other)) => {
                stored.covariance[(one.0, other.0)] * factor(one) * factor(other)
            }
            _ if row == column => of_task[row - own.len()].1.powi(2),
            _ => 0.0,
        }
    });
    let posterior = Posterior {
        names: (set.parameters().iter())
            .map(|each| each.name.clone())
            .collect(),
        mean: set.prior().mean.as_slice().to_vec(),
        covariance,
        estimable: Estimable::with_hidden(
            set.scales().as_slice(),
            DMatrix::identity(set.len(), set.len()).select_columns(&hidden),
        ),
    };
    Ok((set, posterior))
}
