//! A plan as it is carried out in the laboratory.

use serde::{Deserialize, Serialize};

use crate::laboratory::{Campaign, Costs, Stop};
use crate::robot::Commands;

/// One place where the robot stands and is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
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

/// A plan as it is carried out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CampaignMessage {
    /// How long it takes.
    pub minutes: f64,
    /// What that consists of.
    pub costs: Costs,
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

impl CampaignMessage {
    /// The record of a campaign.
    pub fn new(commands: &Commands, costs: &Costs, campaign: &Campaign) -> Self {
        let stops = campaign.stops.iter().enumerate();
        Self {
            minutes: campaign.minutes,
            costs: *costs,
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
