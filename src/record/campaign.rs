//! A plan as it is carried out in the laboratory.

use serde::{Deserialize, Serialize};

use crate::laboratory::{Campaign, Costs, Stop};
use crate::robot::Commands;

/// One place where the robot stands and is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct StopMessage {
    /// Its number, from 1.
    pub stop: usize,
    /// The experiments of the plan that are measured here, from 1.
    pub experiments: Vec<usize>,
    /// The commanded joint angles (deg), and lengths (mm) of joints that slide.
    pub q_deg: Vec<f64>,
    /// Force (N) and torque (N m) of what hangs on the robot; `null` without a load.
    pub wrench: Option<[f64; 6]>,
    /// Whether the load is hung here.
    pub changes_load: bool,
    /// How often the instrument is read.
    pub readings: u32,
    /// For each commanded joint, whether it turns positively (1) or negatively (-1) in the end.
    pub side: Vec<i8>,
    /// Where the approach begins (deg, mm).
    pub approach_deg: Option<Vec<f64>>,
    /// Safe poses on the way there (deg, mm).
    pub via_deg: Vec<Vec<f64>>,
}

/// What work in the laboratory costs (minutes).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct CostsMessage {
    /// To set up a station of the instrument.
    pub station_min: f64,
    /// To go to another configuration, beside the time that the joints turn.
    pub move_min: f64,
    /// To hang another load.
    pub load_change_min: f64,
    /// To read the instrument once.
    pub reading_min: f64,
}

/// A plan as it is carried out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "view", derive(schemars::JsonSchema))]
pub struct CampaignMessage {
    /// How long it takes.
    pub minutes: f64,
    /// What that consists of.
    pub costs: CostsMessage,
    /// How many times a load is hung.
    pub load_changes: usize,
    /// How often the instrument is read.
    pub readings: u32,
    /// How far the joint that moves most moves, all in all (deg).
    pub travel_deg: f64,
    /// Whether moves were looked at for collisions.
    pub is_checked: bool,
    /// Where the robot starts and ends (deg, mm).
    pub home_deg: Option<Vec<f64>>,
    /// The stops in their order.
    pub stops: Vec<StopMessage>,
}

impl From<&Costs> for CostsMessage {
    fn from(costs: &Costs) -> Self {
        Self {
            station_min: costs.station_min,
            move_min: costs.move_min,
            load_change_min: costs.load_change_min,
            reading_min: costs.reading_min,
        }
    }
}

impl CampaignMessage {
    /// The record of a campaign.
    #[must_use]
    pub fn new(commands: &Commands, costs: &Costs, campaign: &Campaign) -> Self {
        let stops = campaign.stops.iter().enumerate();
        Self {
            minutes: campaign.minutes,
            costs: costs.into(),
            load_changes: campaign.load_changes(),
            readings: campaign.readings(),
            travel_deg: campaign.travel().to_degrees(),
            is_checked: campaign.is_checked,
            home_deg: (campaign.home.as_ref()).map(|q| commands.numbers(q.as_slice())),
            stops: stops
                .map(|(index, stop)| StopMessage::new(commands, index + 1, stop))
                .collect(),
        }
    }
}

impl StopMessage {
    fn new(commands: &Commands, number: usize, stop: &Stop) -> Self {
        let written = |q: &nalgebra::DVector<f64>| commands.numbers(q.as_slice());
        Self {
            stop: number,
            experiments: stop.experiments.iter().map(|index| index + 1).collect(),
            q_deg: written(&stop.configuration),
            wrench: stop.load.map(|load| load.wrench().into()),
            changes_load: stop.changes_load,
            readings: stop.readings,
            side: stop.side.0.clone(),
            approach_deg: stop.approach.as_ref().map(written),
            via_deg: stop.way.via.iter().map(written).collect(),
        }
    }
}
