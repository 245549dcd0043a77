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
        let wrong = |key: String, problem: String| FileError::new(path, problem).at(key);
        check_unknowns(path, &self.unknowns, &self.covariance)?;
        let all = covariance_of(&self.covariance, &ANY_VARIANCE)
            .map_err(|(place, problem)| wrong(format!("covariance{place}"), problem))?;
        let kinds = self.kinds(path, robot)?;
        let unknowns = &self.unknowns;
        if all.nrows() != unknowns.len() {
            let (rows, unknowns) = (all.nrows(), unknowns.len());
            let problem = format!("found {rows} rows; there are {unknowns} unknowns");
            return Err(wrong("covariance".to_owned(), problem));
        }
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
        // A logarithm is of the ratio to what is nominal.
        let is_logarithm =
            |place: usize| kinds[place].is_some_and(|kind| kind.is_logarithmic(false));
        let value = |place: usize| {
            let UnknownMessage { value, nominal, .. } = unknowns[place];
            if is_logarithm(place) {
                (value / nominal).ln()
            } else {
                value
            }
        };
        let factor = |place: usize| {
            let value = unknowns[place].value;
            if is_logarithm(place) {
                value.recip()
            } else {
                1.0
            }
        };
        let mean: Vec<f64> = places.iter().map(|&place| value(place)).collect();
        if let Some(place) = mean.iter().position(|value| !value.is_finite()) {
            let (key, found) = (places[place], unknowns[places[place]].value);
            return Err(wrong(
                format!("unknowns[{key}].value"),
                format!("found {found}"),
            ));
        }
        let covariance = DMatrix::from_fn(places.len(), places.len(), |row, column| {
            let (row, column) = (places[row], places[column]);
            all[(row, column)] * factor(row) * factor(column)
        });
        let typical = robot.typical_rad_per_nm(&joints);
        let names: Vec<String> = (places.iter())
            .map(|&place| unknowns[place].name.clone())
            .collect();
        let own = joints.len();
        let posterior = Posterior {
            names: names[..own].to_vec(),
            mean: mean[..own].to_vec(),
            covariance: covariance.view((0, 0), (own, own)).into_owned(),
            estimable: Estimable::with_hidden(&typical, DMatrix::zeros(own, 0)),
        };
        let all = Posterior {
            names,
            mean,
            covariance,
            estimable: Estimable::with_hidden(
                &vec![1.0; places.len()],
                DMatrix::zeros(places.len(), 0),
            ),
        };
        let left_out = self.left_out(path, &places, &factor)?;
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
    fn kinds(&self, path: &Path, robot: &Robot) -> Result<Vec<Option<ParameterKind>>, FileError> {
        let compliance = robot.compliance_rad_per_nm.clone();
        let arm = ElasticArm::new(robot.chain.clone(), compliance, Vec::new());
        let listed = ParameterKind::of_robot(&arm);
        let unknowns = self.unknowns.iter().enumerate();
        let kind = |(index, UnknownMessage { name, .. }): (usize, &UnknownMessage)| {
            if self.is_of_frame(name) {
                return Ok(None);
            }
            let kind = ParameterKind::named(name, &listed, &arm);
            kind.map(Some).ok_or_else(|| {
                let wrong = FileError::new(path, format!("the robot has no {name:?}"));
                let wrong = wrong.at(format!("unknowns[{index}].name"));
                wrong.code(ErrorCode::OtherRobot)
            })
        };
        unknowns.map(kind).collect()
    }

    /// What was left nominal, with what was found in its place at some places.
    fn left_out(
        &self,
        path: &Path,
        places: &[usize],
        factor: &dyn Fn(usize) -> f64,
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
                    let change = shift[place] * factor(place);
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

/// Whether unknowns and their covariance agree, as far as it is there.
///
/// # Errors
/// They do not, by the key.
pub fn check_unknowns(
    path: &Path,
    unknowns: &[UnknownMessage],
    covariance: &[Vec<f64>],
) -> Result<(), FileError> {
    for (index, unknown) in unknowns.iter().enumerate() {
        let Some(&variance) = covariance.get(index).and_then(|row| row.get(index)) else {
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
    Ok(())
}
