//! The table `[instrument]` of a scenario's file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use crate::observation::LengthKind;
use crate::parameter::{ErrorDistribution, Unloaded};

/// What the instrument's sigma is the standard deviation of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, IntoStaticStr, JsonSchema, Serialize)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum SigmaOf {
    /// Of each coordinate of the deflection, as in the paper.
    Deflection,
    /// Of each coordinate of the two positions whose difference is the deflection.
    Position,
    /// Of a distance.
    Distance,
    /// Of a height.
    Height,
}

impl SigmaOf {
    /// The standard deviation of a deflection's coordinate over the given one.
    pub(super) fn deflection_factor(self) -> f64 {
        match self {
            Self::Deflection => 1.0,
            Self::Position | Self::Distance | Self::Height => 2.0_f64.sqrt(),
        }
    }
}

/// What the instrument reads.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, IntoStaticStr, JsonSchema, Serialize,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum InstrumentReads {
    /// All three coordinates of a deflection, as a tracker does.
    #[default]
    Deflection,
    /// The displacement along one direction, as a dial gauge does.
    Displacement,
    /// The distance of a target from a station, as a ballbar or a wire encoder does.
    Distance,
    /// The height of a target above the plane of a station, as a height gauge on a surface table does.
    Height,
}

#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct InstrumentTable {
    pub sigma_mm: Option<f64>,
    pub mpe_um: Option<f64>,
    pub sigma_of: SigmaOf,
    #[serde(default)]
    pub reads: InstrumentReads,
    pub directions: Option<Vec<Vec<f64>>>,
    pub range_mm: Option<f64>,
    pub resolution_mm: Option<f64>,
    pub rotation_sigma_mrad: Option<f64>,
    pub rotation_mpe_mrad: Option<f64>,
    pub distribution: Option<ErrorDistribution>,
    pub coverage_factor: Option<f64>,
    pub tracker_site: Option<String>,
    #[serde(default)]
    pub unloaded: Unloaded,
    /// A gauge beside a tracker, which reads some of the experiments.
    pub gauge: Option<GaugeTable>,
    /// What reads distances beside a tracker, from some of the stations.
    pub distance: Option<LengthTable>,
    /// The same of heights.
    pub height: Option<LengthTable>,
}

impl InstrumentTable {
    /// What reads lengths of a kind beside a tracker.
    pub(super) const fn length(&self, kind: LengthKind) -> Option<&LengthTable> {
        match kind {
            LengthKind::Distance => self.distance.as_ref(),
            LengthKind::Height => self.height.as_ref(),
        }
    }
}

#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LengthTable {
    pub sigma_mm: Option<f64>,
    pub mpe_um: Option<f64>,
    pub distribution: Option<ErrorDistribution>,
    pub coverage_factor: Option<f64>,
    pub resolution_mm: Option<f64>,
}

#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GaugeTable {
    pub sigma_mm: Option<f64>,
    pub mpe_um: Option<f64>,
    pub distribution: Option<ErrorDistribution>,
    pub coverage_factor: Option<f64>,
    pub directions: Vec<Vec<f64>>,
    pub range_mm: Option<f64>,
    pub resolution_mm: Option<f64>,
}
