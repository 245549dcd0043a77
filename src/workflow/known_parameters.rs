//! What the file of an identified robot says of its parameters, and where the instrument stood.

use std::path::Path;

use nalgebra::{DMatrix, Isometry3};

use super::stored_robot::{StoredRobot, wrong};
use crate::files::FileError;
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet, SourceLevel};
use crate::task::Belief;

pub(super) const NO_FRAME: &str =
    "is no place: finite numbers and a quaternion of length 1 are needed";

/// Where an instrument stood.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedStation {
    /// The station's word; none where the readings name no station.
    pub name: Option<String>,
    /// The robot's base in the frame in which the instrument gave its readings there.
    pub instrument_from_base: Isometry3<f64>,
}

/// Where the instrument stood, from a file of absolute readings.
pub(super) fn identified_stations(
    path: &Path,
    stored: &StoredRobot,
) -> Result<Vec<IdentifiedStation>, FileError> {
    let stations = stored.message.stations.iter().enumerate();
    stations
        .map(|(index, station)| {
            let frame = (station.frame(&Isometry3::identity()))
                .ok_or_else(|| wrong(path, format!("stations[{index}]"), NO_FRAME.to_owned()))?;
            Ok(IdentifiedStation {
                name: station.name.clone(),
                instrument_from_base: stored.shifted(frame, &station.unknowns),
            })
        })
        .collect()
}

/// What is known of the robot's own parameters, wherever the stations are, and of the task's force, of which no reading says anything.
pub(super) fn known(
    path: &Path,
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
        .map_err(|error| wrong(path, "unknowns".to_owned(), error.to_string()))?;
    let factors: Vec<f64> = (own.iter())
        .map(|&(index, kind)| unknowns[index].parameter(Some(kind)).1)
        .collect();
    let hidden: Vec<usize> = (0..own.len())
        .filter(|&place| unknowns[own[place].0].standard_error.is_none())
        .collect();
    let mut all = DMatrix::zeros(set.len(), set.len());
    all.view_mut((0, 0), (own.len(), own.len()))
        .copy_from(&DMatrix::from_fn(own.len(), own.len(), |row, column| {
            stored.covariance[(own[row].0, own[column].0)] * factors[row] * factors[column]
        }));
    for (place, (_, deviation)) in (own.len()..).zip(&of_task) {
        all[(place, place)] = deviation.powi(2);
    }
    let posterior = Posterior {
        names: (set.parameters().iter())
            .map(|each| each.name.clone())
            .collect(),
        mean: set.prior().mean.as_slice().to_vec(),
        covariance: all,
        estimable: Estimable::with_hidden(
            set.scales().as_slice(),
            DMatrix::identity(set.len(), set.len()).select_columns(&hidden),
        ),
    };
    Ok((set, posterior))
}
