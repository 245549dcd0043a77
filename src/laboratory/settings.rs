//! What work in the laboratory costs, and how the robot is to move there.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// How long work in the laboratory takes (minutes).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Costs {
    /// To set up a station of the instrument.
    pub station_min: f64,
    /// To go to another configuration, beside the time that the joints turn.
    pub move_min: f64,
    /// To hang another load.
    pub load_change_min: f64,
    /// To read the instrument once.
    pub reading_min: f64,
}

impl Costs {
    /// How long after the unloaded reading of a deflection the loaded one is taken (h) where so many configurations are visited
    /// without a load first, then with it, in the same order; the time that joints turn is not counted.
    pub fn between_readings_h(&self, configurations: u32) -> f64 {
        let visits = f64::from(configurations) * (self.move_min + self.reading_min);
        (visits + self.load_change_min) / 60.0
    }
}

impl Default for Costs {
    fn default() -> Self {
        Self {
            station_min: 20.0,
            move_min: 1.0,
            load_change_min: 10.0,
            reading_min: 0.5,
        }
    }
}

/// The laboratory of a scenario: the table `[laboratory]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Laboratory {
    /// How long work takes.
    pub costs: Costs,
    /// How fast the slowest joint of a move turns (rad/s), or slides (m/s).
    pub axis_speed_per_s: f64,
    /// How far before each configuration the final approach begins (rad, m); zero for none.
    pub approach: f64,
    /// Configurations (rad, m) from which and to which straight moves are likely to be free, the first being
    /// where the robot starts and ends.
    pub safe_poses: Vec<DVector<f64>>,
    /// The dialect of the robot's program: its name, or a file.
    pub dialect: String,
    /// The speed of the program in percent of the robot's.
    pub speed_percent: u32,
    /// The number of the tool in the controller.
    pub tool_number: u32,
    /// The number of the base in the controller.
    pub base_number: u32,
}

impl Laboratory {
    /// Where the robot starts and ends (rad, m), where a safe pose is named.
    pub fn home(&self) -> Option<&[f64]> {
        self.safe_poses.first().map(DVector::as_slice)
    }
}

impl Default for Laboratory {
    fn default() -> Self {
        Self {
            costs: Costs::default(),
            axis_speed_per_s: 10_f64.to_radians(),
            approach: 2_f64.to_radians(),
            safe_poses: Vec::new(),
            dialect: "krl".to_owned(),
            speed_percent: 10,
            tool_number: 1,
            base_number: 0,
        }
    }
}
