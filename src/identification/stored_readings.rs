//! An identified file of absolute readings, as what is known of the robot before another campaign.
//!
//! Frames of stations and targets are of the campaign: whatever they are, the covariance of the others is theirs. What the readings did not
//! determine by itself tells nothing.

use std::path::Path;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::absolute::LeftOut;
use super::agreement::agree_of_estimate;
use super::covariance::covariance_of;
use super::stored::{StoredIdentification, read_identified};
use crate::codes::{Condition, ConditionCode, ErrorCode};
use crate::files::FileError;
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, ParameterKind};
use crate::quantities::plausible::ANY_VARIANCE;
use crate::robot::Robot;
use crate::task::{Fingerprint, LeftNominal};

/// A parameter that was fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct UnknownMessage {
    /// Its name, such as `elbow.zero`, `link_3.x` or `base.rz`.
    pub name: String,
    /// What it is, in words.
    pub what: String,
    /// The unit of its value.
    pub unit: String,
    /// Its nominal value; displacements and rotations of frames count from the nominal frame, those of base and targets from
    /// the frames that are listed.
    pub nominal: f64,
    /// Its value.
    pub value: f64,
    /// Its standard error; null where it is not determined.
    pub standard_error: Option<f64>,
    /// Its interval of 95 %.
    pub interval95: Option<[f64; 2]>,
}

#[derive(Deserialize)]
struct StoredFrame {
    unknowns: String,
}

#[derive(Deserialize)]
struct StoredDiscrepancy {
    joints: Vec<serde_json::Value>,
}

/// The keys that are read.
#[derive(Deserialize)]
struct ReadingsFile {
    unknowns: Vec<UnknownMessage>,
    covariance: Vec<Vec<f64>>,
    stations: Vec<StoredFrame>,
    targets: Vec<StoredFrame>,
    left_out: Vec<LeftOut>,
    #[serde(default)]
    stays_nominal: Vec<LeftOut>,
    discrepancy_mm: Option<f64>,
    discrepancy_mrad: Option<f64>,
    discrepancy_degrees: Option<f64>,
    discrepancy_model: Option<StoredDiscrepancy>,
    conditions: Vec<Condition>,
    identified_with: Fingerprint,
    error_sources: Option<Vec<String>>,
    #[serde(default)]
    earlier_left_out: Option<Vec<LeftNominal>>,
}

impl StoredIdentification {
    /// Reads what is known of a robot, with the same joints' names, before another campaign, from deflections or absolute readings.
    ///
    /// # Errors
    /// What is wrong with the file, with its key.
    pub fn before(path: &Path, robot: &Robot) -> Result<Self, FileError> {
        match read_identified::<ReadingsFile>(path, true)? {
            Some(file) => {
                (file.known(path, robot)).map_err(|wrong| wrong.or_code(ErrorCode::IdentifiedFile))
            }
            None => Self::read(path, robot),
        }
    }
}

impl ReadingsFile {
    /// What was determined of the robot and the load cell: compliances, then all else.
    fn known(self, path: &Path, robot: &Robot) -> Result<StoredIdentification, FileError> {
        let all = covariance_of_unknowns(path, &self.unknowns, &self.covariance)?;
        let compliance = robot.compliance_rad_per_nm.clone();
        let arm = ElasticArm::new(robot.chain.clone(), compliance, Vec::new());
        let kinds = self.kinds(path, &arm)?;
        let unknowns = &self.unknowns;
        let joint = |place: &usize| match kinds[*place] {
            Some(ParameterKind::JointCompliance { joint }) => Some(joint),
            _ => None,
        };
        let known = (0..kinds.len()).filter(|&place| unknowns[place].standard_error.is_some());
        let (mut places, others): (Vec<usize>, Vec<usize>) = known
            .filter(|&place| kinds[place].is_some_and(ParameterKind::is_kept_between_campaigns))
            .partition(|place| joint(place).is_some());
        let joints: Vec<usize> = places.iter().filter_map(joint).collect();
        places.extend(&others);
        let (values, factors): (Vec<f64>, Vec<f64>) = (unknowns.iter().zip(&kinds))
            .map(|(unknown, kind)| unknown.parameter(*kind, &arm))
            .unzip();
        if let Some(&place) = places.iter().find(|&&place| !values[place].is_finite()) {
            let problem = format!("found {}", unknowns[place].value);
            return Err(FileError::new(path, problem).at(format!("unknowns[{place}].value")));
        }
        let of_first = |count: usize, typical: &[f64]| {
            let places = &places[..count];
            let name = |&place: &usize| unknowns[place].name.clone();
            Posterior {
                names: places.iter().map(name).collect(),
                mean: places.iter().map(|&place| values[place]).collect(),
                covariance: DMatrix::from_fn(count, count, |row, column| {
                    let (row, column) = (places[row], places[column]);
                    all[(row, column)] * factors[row] * factors[column]
                }),
                estimable: Estimable::with_hidden(typical, DMatrix::zeros(count, 0)),
            }
        };
        let posterior = of_first(joints.len(), &robot.typical_rad_per_nm(&joints));
        let all = of_first(places.len(), &vec![1.0; places.len()]);
        let left_out = self.left_out(path, &places, &factors)?;
        let sizes = [self.discrepancy_mm, self.discrepancy_mrad];
        let mut conditions = self.conditions;
        let functions = self.discrepancy_model.map_or(0, |model| model.joints.len());
        if functions > 0 {
            conditions.push(ConditionCode::SameJointErrors.with(format!(
                "joint error functions of {functions} joints: the robot has the same in the next campaign, where they count as new"
            )));
        }
        Ok(StoredIdentification {
            joints,
            posterior,
            all: Some(all),
            conditions,
            listed: vec![None; others.len()],
            determined: vec![true; others.len()],
            left_out,
            error_sources: self.error_sources,
            discrepancy: sizes.map(|size| size.unwrap_or(0.0) * 1e-3),
            degrees_of_freedom: self.discrepancy_degrees.filter(|degrees| *degrees > 0.0),
            identified_with: Some(self.identified_with),
        }
        .possible(robot))
    }

    fn is_of_frame(&self, name: &str) -> bool {
        let owner = name.rsplit_once('.').map_or("", |(owner, _)| owner);
        let mut frames = self.stations.iter().chain(&self.targets);
        frames.any(|frame| frame.unknowns == owner)
    }

    /// What the unknowns are; none of frames.
    fn kinds(
        &self,
        path: &Path,
        arm: &ElasticArm,
    ) -> Result<Vec<Option<ParameterKind>>, FileError> {
        let listed = ParameterKind::of_robot(arm);
        let unknowns = self.unknowns.iter().enumerate();
        let kind = |(index, UnknownMessage { name, .. }): (usize, &UnknownMessage)| {
            if self.is_of_frame(name) {
                return Ok(None);
            }
            let kind = ParameterKind::named(name, &listed, arm);
            kind.map(Some).ok_or_else(|| {
                let wrong = FileError::new(path, format!("the robot has no {name:?}"));
                let wrong = wrong.at(format!("unknowns[{index}].name"));
                wrong.code(ErrorCode::OtherRobot)
            })
        };
        unknowns.map(kind).collect()
    }

    /// What was left nominal, with what was found in its place at some places, where parameters change by these factors.
    fn left_out(
        &self,
        path: &Path,
        places: &[usize],
        factors: &[f64],
    ) -> Result<Vec<LeftNominal>, FileError> {
        let mut all: Vec<LeftNominal> = Vec::new();
        for (key, list) in [
            ("left_out", &self.left_out),
            ("stays_nominal", &self.stays_nominal),
        ] {
            for (index, LeftOut { name, shift, .. }) in list.iter().enumerate() {
                if shift.len() != self.unknowns.len() {
                    let (found, count) = (shift.len(), self.unknowns.len());
                    let problem = format!("found {found} numbers; there are {count} unknowns");
                    let wrong = FileError::new(path, problem).at(format!("{key}[{index}].shift"));
                    return Err(
                        wrong.hint("identify again: files of earlier versions do not say it")
                    );
                }
                let change = |&place: &usize| {
                    let change = shift[place] * factors[place];
                    (change != 0.0).then(|| (self.unknowns[place].name.clone(), change))
                };
                if !self.is_of_frame(name) {
                    all.push((name.clone(), places.iter().filter_map(change).collect()));
                }
            }
        }
        // What was found since, or left out again, is what the file says of it.
        let is_found = |(name, _): &&LeftNominal| {
            (places.iter()).any(|&place| self.unknowns[place].name == *name)
        };
        let earlier = self.earlier_left_out.iter().flatten();
        let earlier: Vec<LeftNominal> = earlier
            .filter(|each| !is_found(each) && all.iter().all(|own| own.0 != each.0))
            .cloned()
            .collect();
        all.extend(earlier);
        Ok(all)
    }
}

impl UnknownMessage {
    /// Its value as a parameter of a kind has it, and by how much that changes with the value: a logarithm is of the ratio to what an arm
    /// has, which may be another than was nominal then.
    pub fn parameter(&self, kind: Option<ParameterKind>, arm: &ElasticArm) -> (f64, f64) {
        match kind {
            Some(kind) if kind.is_logarithmic(false) => {
                let nominal = kind.quantity(arm).unwrap_or(self.nominal);
                ((self.value / nominal).ln(), self.value.recip())
            }
            _ => (self.value, 1.0),
        }
    }
}

/// The covariance of unknowns, in their units.
///
/// # Errors
/// It is none, or does not agree with what they say of it, by the key.
pub fn covariance_of_unknowns(
    path: &Path,
    unknowns: &[UnknownMessage],
    rows: &[Vec<f64>],
) -> Result<DMatrix<f64>, FileError> {
    for (index, (unknown, row)) in unknowns.iter().zip(rows).enumerate() {
        let Some(&variance) = row.get(index) else {
            continue;
        };
        let key = |name: &str| format!("unknowns[{index}].{name}");
        agree_of_estimate(
            path,
            (&key("value"), unknown.value),
            (&format!("covariance[{index}][{index}]"), variance),
            (&key("standard_error"), unknown.standard_error.map(f64::abs)),
            (&key("interval95"), unknown.interval95),
        )?;
    }
    let wrong = |place: &str, problem: String| {
        let wrong = FileError::new(path, problem).at(format!("covariance{place}"));
        wrong.code(ErrorCode::IdentifiedFile)
    };
    if rows.len() != unknowns.len() {
        let (rows, unknowns) = (rows.len(), unknowns.len());
        let problem = format!("found {rows} rows; there are {unknowns} unknowns");
        return Err(wrong("", problem));
    }
    covariance_of(rows, &ANY_VARIANCE).map_err(|(place, problem)| wrong(&place, problem))
}
