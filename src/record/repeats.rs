//! What repeated visits of measurement files show.

use serde::Serialize;

use crate::identification::{PlaceDrift, RepeatedPose, Repeats};

/// Repeatability, accuracy and drift of what was read more than once.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct RepeatsMessage {
    /// The poses that were visited more than once.
    pub poses: Vec<RepeatedPoseMessage>,
    /// RP (mm) by the covariance pooled over them.
    pub rp_mm: f64,
    /// Its degrees of freedom in each coordinate.
    pub degrees_of_freedom: usize,
    /// Null where nothing was visited at different times.
    pub drift: Option<PlaceDriftMessage>,
}

/// A pose that was visited more than once.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct RepeatedPoseMessage {
    /// Its first row, from 1.
    pub first: usize,
    /// The number of visits.
    pub visits: usize,
    /// RP (mm); null of two visits.
    pub rp_mm: Option<f64>,
    /// AP (mm), from the predicted place; null of deflections.
    pub ap_mm: Option<f64>,
}

/// How places move over the visits.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct PlaceDriftMessage {
    /// What the slope is by: `row`, in the file's order, or `hour`.
    pub by: &'static str,
    /// The slope (mm).
    pub slope_mm: [f64; 3],
    /// Its standard errors.
    pub standard_error_mm: [f64; 3],
    /// The probability of slopes at least as large where there is no drift; null where the visits are too few.
    pub probability: Option<f64>,
}

impl From<&Repeats> for RepeatsMessage {
    fn from(repeats: &Repeats) -> Self {
        let pose = |each: &RepeatedPose| RepeatedPoseMessage {
            first: each.first + 1,
            visits: each.visits,
            rp_mm: each.repeatability_m.map(|length| length * 1e3),
            ap_mm: each.accuracy_m.map(|length| length * 1e3),
        };
        let drift = |each: PlaceDrift| PlaceDriftMessage {
            by: if each.is_by_hour { "hour" } else { "row" },
            slope_mm: (each.slope_m * 1e3).into(),
            standard_error_mm: (each.standard_error_m * 1e3).into(),
            probability: each.probability,
        };
        Self {
            poses: repeats.poses.iter().map(pose).collect(),
            rp_mm: repeats.repeatability_m * 1e3,
            degrees_of_freedom: repeats.degrees_of_freedom,
            drift: repeats.drift.map(drift),
        }
    }
}
