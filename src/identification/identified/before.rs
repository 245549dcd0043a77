//! What an identified file says of a robot to whoever measures it again.
//!
//! Frames of stations and targets are of the campaign: whatever they are, the covariance of the others is theirs. What absolute readings
//! did not determine by itself tells nothing.

use nalgebra::DMatrix;

use super::checks::CheckedFile;
use super::deflections::IdentificationMessage;
use super::file::{IdentifiedFile, IdentifiedRecord, Remainder, ResidualKeys};
use super::impossible::hold_impossible;
use super::robot::{StoredRobot, UnknownValue};
use crate::codes::{Condition, ConditionCode, ErrorCode};
use crate::files::FileError;
use crate::identification::LeftOut;
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, ParameterKind};
use crate::robot::{Joint, Robot};
use crate::task::LeftNominal;

/// What is known of a robot by an identified file.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredIdentification {
    /// The identified joints, as indices of the robot that it is read for.
    pub joints: Vec<usize>,
    /// What is known of their compliances.
    pub posterior: Posterior,
    /// The same of these and of what else was uncertain together, whose typical sizes the file does not say: as if they were one.
    pub all: Posterior,
    /// The conditions with which it was made, besides what is not determined.
    pub conditions: Vec<Condition>,
    /// The standard deviations that error sources gave what else was uncertain; in the units of `all`.
    pub listed: Vec<Option<f64>>,
    /// Which of it was determined.
    pub determined: Vec<bool>,
    /// What was left nominal, then and before.
    pub left_out: Vec<LeftNominal>,
    /// What the model leaves unexplained, of positions (m) and rotations (rad); nothing where the measurements did not show any.
    pub discrepancy: [f64; 2],
    /// The degrees of freedom that this was estimated with; `None` where nothing was.
    pub degrees_of_freedom: Option<f64>,
}

impl IdentifiedFile {
    /// What is known by it of a robot with the same joints' names.
    ///
    /// # Errors
    /// What is wrong with it, with its key.
    pub fn known(&self, robot: &Robot) -> Result<StoredIdentification, FileError> {
        let known = match &self.record {
            IdentifiedRecord::Deflections(message, left) => {
                self.of_deflections(message, left, robot)
            }
            IdentifiedRecord::Readings(found) => self.of_readings(found, robot),
        };
        known.map_err(|wrong| wrong.or_code(ErrorCode::IdentifiedFile))
    }

    fn of_deflections(
        &self,
        message: &IdentificationMessage,
        left: &Remainder,
        robot: &Robot,
    ) -> Result<StoredIdentification, FileError> {
        let file = CheckedFile(&self.path);
        let joints = message.joints(file, robot)?;
        let posterior = message.compliances(file)?;
        let all = message.with_others(file, &posterior, robot)?;
        let sizes = [left.discrepancy_mm, left.discrepancy_mrad];
        file.sizes([("discrepancy_mm", sizes[0]), ("discrepancy_mrad", sizes[1])])?;
        let discrepancy = sizes.map(|size| size.unwrap_or(0.0) * 1e-3);
        // What the numbers are more than the fit takes up.
        let spare = |each: &ResidualKeys| each.standardised.len() as f64 - each.leverage;
        let freedom: f64 = left.residuals.iter().map(spare).sum();
        let is_estimated = discrepancy.iter().sum::<f64>() > 0.0;
        let others = message.uncertain.iter();
        let found = StoredIdentification {
            joints,
            posterior,
            all,
            conditions: message.conditions.clone(),
            listed: others.clone().map(|each| each.prior_deviation).collect(),
            determined: others.map(|each| each.standard_error.is_some()).collect(),
            left_out: self.basis.earlier_left_out.clone().unwrap_or_default(),
            discrepancy,
            degrees_of_freedom: Some(freedom).filter(|freedom| is_estimated && *freedom > 0.0),
        }
        .possible(robot);
        message.check_agreement(file, &found.posterior.mean)?;
        Ok(found)
    }

    /// What was determined of the robot and the load cell: compliances, then all else.
    fn of_readings(
        &self,
        found: &StoredRobot,
        robot: &Robot,
    ) -> Result<StoredIdentification, FileError> {
        let compliance = robot.compliance_rad_per_nm.clone();
        let arm = ElasticArm::new(robot.chain.clone(), compliance, Vec::new());
        let (message, values) = (&found.message, found.values(&arm)?);
        let unknowns = &message.unknowns;
        let joint = |place: &usize| match values[*place].kind {
            Some(ParameterKind::JointCompliance { joint }) => Some(joint),
            _ => None,
        };
        let is_kept = |place: &usize| {
            let kind = values[*place]
                .kind
                .filter(|kind| kind.is_kept_between_campaigns());
            kind.is_some() && unknowns[*place].standard_error.is_some()
        };
        let (mut places, others): (Vec<usize>, Vec<usize>) = (0..values.len())
            .filter(is_kept)
            .partition(|place| joint(place).is_some());
        let joints: Vec<usize> = places.iter().filter_map(joint).collect();
        places.extend(&others);
        let of_first = |count: usize, typical: &[f64]| {
            let places = &places[..count];
            let name = |&place: &usize| unknowns[place].name.clone();
            Posterior {
                names: places.iter().map(name).collect(),
                mean: places.iter().map(|&place| values[place].value).collect(),
                covariance: DMatrix::from_fn(count, count, |row, column| {
                    let (row, column) = (places[row], places[column]);
                    found.covariance[(row, column)] * values[row].factor * values[column].factor
                }),
                estimable: Estimable::with_hidden(typical, DMatrix::zeros(count, 0)),
            }
        };
        let mut conditions = message.conditions.clone();
        let model = message.discrepancy_model.as_ref();
        let functions = model.map_or(0, |model| model.joints.len());
        if functions > 0 {
            conditions.push(ConditionCode::SameJointErrors.with(format!(
                "joint error functions of {functions} joints: the robot has the same in the next campaign, where they count as new"
            )));
        }
        Ok(StoredIdentification {
            posterior: of_first(joints.len(), &robot.typical_rad_per_nm(&joints)),
            all: of_first(places.len(), &vec![1.0; places.len()]),
            joints,
            conditions,
            listed: vec![None; others.len()],
            determined: vec![true; others.len()],
            left_out: self.left_out(found, &places, &values)?,
            discrepancy: message.discrepancy(),
            degrees_of_freedom: message.discrepancy_degrees.filter(|degrees| *degrees > 0.0),
        }
        .possible(robot))
    }

    /// What was left nominal, with what was found in its place at some places, where parameters have these values.
    fn left_out(
        &self,
        StoredRobot { message, .. }: &StoredRobot,
        places: &[usize],
        values: &[UnknownValue],
    ) -> Result<Vec<LeftNominal>, FileError> {
        let mut all: Vec<LeftNominal> = Vec::new();
        for (key, list) in [
            ("left_out", &message.left_out),
            ("stays_nominal", &message.stays_nominal),
        ] {
            for (index, LeftOut { name, shift, .. }) in list.iter().enumerate() {
                if shift.len() != values.len() {
                    let (found, count) = (shift.len(), values.len());
                    let problem = format!("found {found} numbers; there are {count} unknowns");
                    let file = CheckedFile(&self.path);
                    let wrong = file.wrong(format!("{key}[{index}].shift"), problem);
                    return Err(
                        wrong.hint("identify again: files of earlier versions do not say it")
                    );
                }
                let change = |&place: &usize| {
                    let change = shift[place] * values[place].factor;
                    (change != 0.0).then(|| (message.unknowns[place].name.clone(), change))
                };
                if !message.is_of_frame(name) {
                    all.push((name.clone(), places.iter().filter_map(change).collect()));
                }
            }
        }
        // What was found since, or left out again, is what the file says of it.
        let is_found = |name: &str| {
            let mut found = places.iter().map(|&place| &*message.unknowns[place].name);
            found.any(|each| each == name) || all.iter().any(|own| own.0 == name)
        };
        let earlier = self.basis.earlier_left_out.iter().flatten();
        let earlier: Vec<LeftNominal> =
            earlier.filter(|each| !is_found(&each.0)).cloned().collect();
        all.extend(earlier);
        Ok(all)
    }
}

impl StoredIdentification {
    /// The same with nominal compliances in place of those that no joint has, and without conditions that are not of the identification.
    fn possible(mut self, robot: &Robot) -> Self {
        let mut values = self.all.mean.clone();
        let joints = &self.joints;
        let compliance = |place: usize| {
            let joint = *joints.get(place)?;
            self.posterior.standard_error(place)?;
            let Joint { name, drive, .. } = &robot.chain.joints[joint];
            let nominal = robot.compliance_rad_per_nm[joint];
            Some((nominal, name.as_str(), drive.compliance_unit()))
        };
        let (held, shift) = hold_impossible(&mut values, &self.all.covariance, compliance);
        self.conditions.extend(held);
        // What stands in where only combinations are determined went with that when the file was written.
        let stands_in = |place: &usize| self.posterior.standard_error(*place).is_none();
        for place in (0..joints.len()).filter(stands_in) {
            values[place] = self.posterior.mean[place];
        }
        for each in [&mut self.posterior, &mut self.all] {
            let size = each.mean.len();
            each.mean.copy_from_slice(&values[..size]);
            let own = shift.rows(0, size);
            each.covariance.ger(1.0, &own, &own, 1.0);
        }
        // Whether a test pose needs what is not determined is asked there.
        self.conditions.retain(|condition| {
            let is_own = condition.code.is_of_identification();
            is_own && condition.code != ConditionCode::Unidentifiable
        });
        self
    }
}
