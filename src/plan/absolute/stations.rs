//! The stations that a plan of absolute readings is read from.

use std::collections::{BTreeMap, BTreeSet};

use super::AbsolutePlanning;
use crate::observation::ReadingKind;
use crate::parameter::ParameterKind;

/// A frame takes so many positions or lengths, each of another target or in another configuration.
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
                let place = (self.neighbours.configurations[place], setup.target);
                read.entry(setup.station).or_default().insert(place);
            }
        }
        let few = read.into_iter().filter(|(_, places)| places.len() < FEWEST);
        let words = few.map(|(station, places)| {
            let name = (self.case.stations[station].as_ref()).map_or_else(
                || "the station".to_owned(),
                |name| format!("station {name:?}"),
            );
            let count = places.len();
            format!("the frame of {name}, which is read at {count} of at least {FEWEST} places")
        });
        words.collect()
    }
}
