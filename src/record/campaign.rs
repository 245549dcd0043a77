//! A plan as it is carried out in the laboratory.

use nalgebra::DVector;
use serde_json::{Value, json};

use crate::laboratory::{Campaign, Costs, Stop};
use crate::robot::Commands;

/// The record of a campaign: minutes, angles as files have them (deg; mm of joints that slide), wrenches in N and N m, and
/// stops and experiments counted from 1.
pub fn campaign_json(commands: &Commands, costs: &Costs, campaign: &Campaign) -> Value {
    let written = |q: &DVector<f64>| commands.numbers(q.as_slice());
    let stop = |(index, stop): (usize, &Stop)| {
        let mut record = json!({
            "stop": index + 1,
            "experiments": stop.experiments.iter().map(|index| index + 1).collect::<Vec<_>>(),
            "q_deg": written(&stop.configuration),
            "wrench": stop.load.map(|load| <[f64; 6]>::from(load.wrench())),
            "changes_load": stop.changes_load,
            "readings": stop.readings,
            "side": stop.side.0,
            "approach_deg": stop.approach.as_ref().map(written),
            "via_deg": stop.way.via.iter().map(written).collect::<Vec<_>>(),
        });
        if !stop.targets.is_empty() {
            record["targets"] = json!(stop.targets);
            record["station"] = json!(stop.station);
        }
        if let Some(direction) = stop.direction {
            record["direction"] = json!(<[f64; 3]>::from(direction));
        }
        if let Some(at_gauge) = stop.at_gauge {
            record["target_mm"] = json!(<[f64; 3]>::from(at_gauge.target_m * 1e3));
            record["displacement_mm"] = json!(at_gauge.displacement_m * 1e3);
        }
        record
    };
    json!({
        "minutes": campaign.minutes,
        "costs": costs,
        "set_ups": campaign.set_ups(),
        "load_changes": campaign.load_changes(),
        "readings": campaign.readings(),
        "travel_deg": campaign.travel().to_degrees(),
        "is_checked": campaign.is_checked,
        "home_deg": campaign.home.as_ref().map(written),
        "stops": campaign.stops.iter().enumerate().map(stop).collect::<Vec<_>>(),
    })
}
