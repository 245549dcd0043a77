//! The level of an error source (random effects): where it takes a new value, and so what averages it.

/// Where an error source takes a new value: what is drawn anew in each averages over as many of them.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    serde::Deserialize,
    serde::Serialize,
    schemars::JsonSchema,
    strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum SourceLevel {
    /// In each reading.
    Reading,
    /// Each time the robot comes to a command pose.
    Visit,
    /// In each configuration, shared by its readings, under whatever load and however often.
    Configuration,
    /// Once a campaign: frames of stations, mounted tools, drift.
    Campaign,
    /// Kept until the instrument is replaced: the load cell.
    Instrument,
    /// The robot's own, kept over campaigns.
    Robot,
    /// New at the task: no reading shows it.
    Task,
}

impl SourceLevel {
    /// Its word, as in JSON.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether all readings of a plan share its value, so that no number of them averages it.
    pub fn is_shared_by_plan(self) -> bool {
        self >= Self::Campaign
    }
}
