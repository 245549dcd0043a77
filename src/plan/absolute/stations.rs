//! The stations that a plan of absolute readings is read from.

use std::collections::{BTreeMap, BTreeSet};

use super::AbsolutePlanning;
use crate::observation::ReadingKind;
use crate::parameter::ParameterKind;

/// A frame takes no more positions or lengths, each of another target or in another configuration.
const FEWEST: usize = 3;

impl AbsolutePlanning<'_> {
    /// The names of the stations that candidates are read from; one without a name where they name none.
    pub fn stations(&self) -> &[Option<String>] {
        &self.case.stations
    }

    /// The stations in whose frames the tool's place may count, by their numbers.
    pub(super) fn frames(&self) -> Vec<usize> {
        let first = self.poses.iter().take(1);
        first
            .flat_map(|pose| pose.by_station.keys().copied())
            .collect()
    }

    /// Whether an unknown is of a station or of a target that no reading of a plan is from or of.
    pub fn is_elsewhere(&self, unknown: usize, plan: &[(usize, u32)]) -> bool {
        let mut setups = plan
            .iter()
            .map(|&(place, _)| &self.case.observations[place].setup);
        match self.set.parameters()[unknown].kind {
            ParameterKind::BasePosition { station, .. }
            | ParameterKind::BaseRotation { station, .. } => {
                setups.all(|setup| setup.station != station)
            }
            ParameterKind::ToolPosition { tool, .. } | ParameterKind::ToolRotation { tool, .. } => {
                setups.all(|setup| setup.target != tool)
            }
            _ => false,
        }
    }

    /// The stations whose frames what is measured and planned cannot determine, in words: an identification refuses such readings.
    pub fn unplaced_stations(&self, plan: &[(usize, u32)]) -> Vec<String> {
        let mut read: BTreeMap<usize, BTreeSet<(usize, usize)>> = BTreeMap::new();
        for &(place, _) in plan.iter().chain(&self.measured) {
            let (setup, kind) = self.setup(place);
            if kind != ReadingKind::Pose {
                let place = (self.configurations[place], setup.target);
                read.entry(setup.station).or_default().insert(place);
            }
        }
        let is_unknown = |kind: &ParameterKind| {
            let own = self.set.index_of(*kind);
            own.is_none_or(|own| self.set.parameters()[own].prior_deviation.is_none())
        };
        let words = read.into_iter().filter_map(|(station, places)| {
            let unknown = self.case.base_kinds(station).into_iter();
            let fewest = unknown.filter(is_unknown).count().min(FEWEST);
            let name = (self.case.stations[station].as_ref()).map_or_else(
                || "the station".to_owned(),
                |name| format!("station {name:?}"),
            );
            let count = places.len();
            (count < fewest).then(|| {
                format!("the frame of {name}, which is read at {count} of at least {fewest} places")
            })
        });
        words.collect()
    }
}
