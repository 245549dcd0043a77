//! The static compliance of the tool at test poses.

use serde::Serialize;

use crate::compensation::StaticCompliance;

/// The static compliance at the test poses, as far as it is known.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct StaticComplianceMessage {
    /// The joints whose compliances are taken as exact: they are not identified, and no error source is about them.
    pub assumed_exact: Vec<String>,
    /// One for each test pose.
    pub test_poses: Vec<PoseComplianceMessage>,
}

/// Three rows of three entries: displacement along an axis, force along an axis.
type Entries<T> = [[T; 3]; 3];

/// The static compliance at a test pose: rows are displacements, columns forces, along x, y and z of the base.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct PoseComplianceMessage {
    /// The test pose.
    pub name: String,
    /// The entries (mm/N).
    pub mm_per_n: Entries<f64>,
    /// Their standard uncertainties (mm/N); null where they depend on what is not determined.
    pub standard_uncertainty_mm_per_n: Entries<Option<f64>>,
    /// Their 95 % intervals (mm/N).
    pub interval95_mm_per_n: Entries<Option<[f64; 2]>>,
}

impl PoseComplianceMessage {
    /// Of a test pose by its name.
    pub fn new(name: &str, compliance: &StaticCompliance) -> Self {
        let mm = |value: f64| value * 1e3;
        let each = [0, 1, 2];
        let uncertainty = compliance.standard_uncertainty_m_per_n;
        Self {
            name: name.to_owned(),
            mm_per_n: each.map(|row| each.map(|column| mm(compliance.m_per_n[(row, column)]))),
            standard_uncertainty_mm_per_n: uncertainty.map(|row| row.map(|each| each.map(mm))),
            interval95_mm_per_n: each.map(|row| {
                each.map(|column| {
                    let interval = compliance.interval95_m_per_n(row, column);
                    interval.map(|ends| ends.map(mm))
                })
            }),
        }
    }
}
