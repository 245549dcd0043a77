//! The keys of what was identified from deflections.

use serde::{Deserialize, Serialize};

use super::checks::{CheckedFile, rows_of};
use super::impossible::hold_impossible;
use crate::codes::{Condition, ErrorCode};
use crate::files::FileError;
use crate::identification::{Identification, UncertainEstimate};
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, ParameterKind};
use crate::quantities::plausible::{ANY_VARIANCE, ELASTIC_COMPLIANCE, VARIANCE};
use crate::quantities::units;
use crate::robot::Robot;
use crate::task::Method;

/// Smaller compliances (rad/(N m)) are as good as zero.
const LEAST_SIZE: f64 = 1e-15;

/// What was identified, and how well; the arrays go by `parameters`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct IdentificationMessage {
    /// `linear` or `nonlinear`.
    #[schemars(with = "String")]
    pub method: Method,
    /// The names of the identified joints.
    pub parameters: Vec<String>,
    /// The compliances (rad/(N m)); null where the measurements do not determine one.
    pub compliance_rad_per_nm: Vec<Option<f64>>,
    /// Their standard errors (rad/(N m)).
    pub compliance_std_rad_per_nm: Vec<Option<f64>>,
    /// Their 95 % intervals (rad/(N m)).
    pub compliance_ci95_rad_per_nm: Vec<Option<[f64; 2]>>,
    /// The values that compensation applies (rad/(N m)): the estimates; where only combinations are
    /// determined, values that give these and are nominal in all other directions; else nominal values. Nominal ones, too, in place of
    /// what no joint has.
    pub compliance_applied_rad_per_nm: Vec<f64>,
    /// What is not determined: orthonormal combinations of the compliances, each divided by its typical
    /// size.
    pub undetermined_directions: Vec<Vec<f64>>,
    /// The typical sizes of the compliances (rad/(N m)).
    pub compliance_typical_rad_per_nm: Vec<f64>,
    /// Their covariance (rad^2/(N m)^2), of what is determined; zero for those of which nothing is.
    pub covariance_rad2_per_n2m2: Vec<Vec<f64>>,
    /// What else the scenario lists as uncertain and the whole plan shares, and what the measurements say of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub uncertain: Vec<UncertainEstimate>,
    /// What is not determined of the compliances and of these together: orthonormal combinations, each divided by its
    /// typical size.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub undetermined_of_all: Vec<Vec<f64>>,
    /// The covariance of the compliances and of these together, in their units.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub covariance_of_all: Vec<Vec<f64>>,
    /// The standard deviation of a deflection's coordinate that the uncertainties rest on (mm).
    pub sigma_mm: f64,
    /// The one that the residuals show, if there are more equations than unknowns (mm).
    pub residual_sigma_mm: Option<f64>,
    /// The probability of residuals at least this large if model and sigma are right.
    pub consistency: Option<f64>,
    /// The probability of residuals at least this small if model and sigma are right.
    pub consistency_lower: Option<f64>,
    /// What must be looked at.
    #[serde(default)]
    pub conditions: Vec<Condition>,
    /// The number of independent combinations of compliances that the measurements determine.
    pub rank: usize,
    /// The condition number of the observation matrix with columns scaled to length one; null
    /// where it is infinite.
    pub condition: Option<f64>,
    /// The number of Gauss-Newton steps; 1 for the linear method.
    pub iterations: usize,
    /// Measured minus modelled deflection of each measurement (mm).
    pub residuals_mm: Vec<[f64; 3]>,
}

impl IdentificationMessage {
    /// The record of an identification of a robot with these nominal compliances of all joints (rad/(N m)).
    pub fn new(identification: &Identification, nominal_rad_per_nm: &[f64]) -> Self {
        let joints = &identification.parameters;
        let mut applied = identification.posterior.mean.clone();
        hold_impossible(
            &mut applied,
            &identification.posterior.covariance,
            |place| {
                let found = joints.get(place).filter(|each| each.estimate.is_some())?;
                Some((
                    nominal_rad_per_nm[found.joint],
                    found.name.as_str(),
                    found.unit,
                ))
            },
        );
        applied.truncate(joints.len());
        // What else is uncertain stands apart.
        let all = (!identification.uncertain.is_empty()).then_some(&identification.posterior);
        let posterior = all.map_or_else(
            || identification.posterior.clone(),
            |all| all.of_first(identification.parameters.len()),
        );
        let estimates = || identification.parameters.iter().map(|each| each.estimate);
        Self {
            method: identification.method,
            parameters: (identification.parameters.iter())
                .map(|parameter| parameter.name.clone())
                .collect(),
            compliance_rad_per_nm: estimates().map(|estimate| Some(estimate?.value)).collect(),
            compliance_std_rad_per_nm: estimates()
                .map(|estimate| Some(estimate?.standard_error))
                .collect(),
            compliance_ci95_rad_per_nm: estimates()
                .map(|estimate| Some(estimate?.interval95))
                .collect(),
            compliance_applied_rad_per_nm: applied,
            undetermined_directions: rows_of(&posterior.estimable.hidden().transpose()),
            compliance_typical_rad_per_nm: posterior.estimable.typical().to_vec(),
            covariance_rad2_per_n2m2: rows_of(&posterior.covariance),
            uncertain: identification.uncertain.clone(),
            undetermined_of_all: all
                .map_or_else(Vec::new, |all| rows_of(&all.estimable.hidden().transpose())),
            covariance_of_all: all.map_or_else(Vec::new, |all| rows_of(&all.covariance)),
            sigma_mm: units::thousandths(identification.sigma_m),
            residual_sigma_mm: identification.residual_sigma_m.map(|sigma| sigma * 1e3),
            consistency: identification.consistency,
            consistency_lower: identification.consistency_lower,
            conditions: identification.conditions(),
            rank: identification.posterior.estimable.rank(),
            condition: Some(identification.condition).filter(|value| value.is_finite()),
            iterations: identification.iterations,
            residuals_mm: (identification.residuals_m.as_chunks().0.iter())
                .map(|residual: &[f64; 3]| residual.map(|value| value * 1e3))
                .collect(),
        }
    }

    /// Its joints, as indices of a robot's.
    ///
    /// # Errors
    /// The robot has no such joint, or one is named twice.
    pub(super) fn joints(
        &self,
        file: CheckedFile<'_>,
        robot: &Robot,
    ) -> Result<Vec<usize>, FileError> {
        let mut joints = Vec::new();
        for name in &self.parameters {
            let known = || robot.chain.joints.iter().map(|joint| &*joint.name);
            let problem = match known().position(|joint| joint == name) {
                Some(joint) if !joints.contains(&joint) => {
                    joints.push(joint);
                    continue;
                }
                Some(_) => format!("found {name:?} twice"),
                None => {
                    let known = known().collect::<Vec<_>>().join(", ");
                    format!("found {name:?}; the robot's joints are: {known}")
                }
            };
            let wrong = file.wrong("parameters", problem);
            return Err(wrong.code(ErrorCode::OtherRobot));
        }
        Ok(joints)
    }

    /// What is known of the compliances.
    ///
    /// # Errors
    /// Lists have other lengths, or hold what no compliance or covariance is, by their keys.
    pub(super) fn compliances(&self, file: CheckedFile<'_>) -> Result<Posterior, FileError> {
        let (estimates, typical) = (
            &self.compliance_rad_per_nm,
            &self.compliance_typical_rad_per_nm,
        );
        let size = self.parameters.len();
        for (key, found) in [
            ("compliance", estimates.len()),
            ("compliance_std", self.compliance_std_rad_per_nm.len()),
            ("compliance_ci95", self.compliance_ci95_rad_per_nm.len()),
            (
                "compliance_applied",
                self.compliance_applied_rad_per_nm.len(),
            ),
            ("compliance_typical", typical.len()),
        ] {
            if found != size {
                let problem = format!("found {found} values; there are {size} parameters");
                return Err(file.wrong(format!("{key}_rad_per_nm"), problem));
            }
        }
        for (index, value) in estimates.iter().enumerate() {
            // What scatters below zero is dealt with later.
            let size = value.unwrap_or_default().abs().max(LEAST_SIZE);
            ELASTIC_COMPLIANCE.check(size).map_err(|problem| {
                let key = format!("compliance_rad_per_nm[{index}]");
                file.wrong(key, format!("{}: {problem}", self.parameters[index])).hint(
                    "measure again with loads that bend this joint, or take it out of robot.parameters",
                )
            })?;
        }
        if let Some(found) = typical.iter().find(|value| **value <= 0.0) {
            let problem = format!("found {found}; positive numbers are allowed");
            return Err(file.wrong("compliance_typical_rad_per_nm", problem));
        }
        let (rows, directions) = (
            &self.covariance_rad2_per_n2m2,
            &self.undetermined_directions,
        );
        let counted = (size, "parameters");
        let both = estimates.iter().zip(&self.compliance_applied_rad_per_nm);
        let posterior = Posterior {
            names: self.parameters.clone(),
            mean: (both.map(|(estimate, applied)| estimate.unwrap_or(*applied))).collect(),
            covariance: file.covariance("covariance_rad2_per_n2m2", rows, counted, &VARIANCE)?,
            estimable: Estimable::with_hidden(
                typical,
                file.orthonormal("undetermined_directions", directions, counted)?,
            ),
        };
        let is_known = |index: usize| posterior.standard_error(index).is_some();
        if let Some(index) = (0..size).find(|&index| estimates[index].is_some() != is_known(index))
        {
            let problem = "is a number where undetermined_directions say that there is none, or the other \
                           way round: the file is damaged";
            return Err(file.wrong(format!("compliance_rad_per_nm[{index}]"), problem));
        }
        Ok(posterior)
    }

    /// What is known of the compliances and of other unknowns together; logarithms of ratios to what is nominal now.
    ///
    /// # Errors
    /// Lists have other lengths, or hold what no ratio or covariance is, by their keys.
    pub(super) fn with_others(
        &self,
        file: CheckedFile<'_>,
        compliances: &Posterior,
        robot: &Robot,
    ) -> Result<Posterior, FileError> {
        if self.uncertain.is_empty() {
            return Ok(compliances.clone());
        }
        let size = self.parameters.len() + self.uncertain.len();
        let counted = (size, "unknowns");
        let (rows, directions) = (&self.covariance_of_all, &self.undetermined_of_all);
        let covariance = file.covariance("covariance_of_all", rows, counted, &ANY_VARIANCE)?;
        let hidden = file.orthonormal("undetermined_of_all", directions, counted)?;
        let (mut names, mut mean) = (compliances.names.clone(), compliances.mean.clone());
        let nominal = robot.compliance_rad_per_nm.clone();
        let arm = ElasticArm::new(robot.chain.clone(), nominal, Vec::new());
        let kinds = ParameterKind::of_robot(&arm);
        for (index, each) in self.uncertain.iter().enumerate() {
            let own = ParameterKind::named(&each.name, &kinds, &arm);
            let own = own.and_then(|kind| kind.quantity(&arm));
            let ratio = (each.nominal.zip(own)).map_or(1.0, |(then, now)| then / now);
            if !(ratio > 0.0 && ratio.is_finite()) {
                let problem = format!("found a share of {:?}, which is nothing", each.nominal);
                let wrong = file.wrong(format!("uncertain[{index}].nominal"), problem);
                return Err(wrong.code(ErrorCode::OtherRobot));
            }
            names.push(each.name.clone());
            mean.push(each.value.unwrap_or(0.0) + ratio.ln());
        }
        Ok(Posterior {
            names,
            mean,
            covariance,
            estimable: Estimable::with_hidden(&vec![1.0; size], hidden),
        })
    }

    /// Whether what it says twice agrees; its lists have their lengths, and these values are applied. Files of earlier versions have
    /// the estimates for them.
    ///
    /// # Errors
    /// What does not agree, by its key.
    pub(super) fn check_agreement(
        &self,
        file: CheckedFile<'_>,
        applied: &[f64],
    ) -> Result<(), FileError> {
        let size = self.parameters.len();
        let (rows, all) = (&self.covariance_rad2_per_n2m2, &self.covariance_of_all);
        let has_others = !self.uncertain.is_empty();
        let at = |key: &str, row: usize, column: usize| format!("{key}[{row}][{column}]");
        for (index, value) in self.compliance_rad_per_nm.iter().enumerate() {
            let key = |name: &str| format!("compliance{name}_rad_per_nm[{index}]");
            let entry = |column: usize| at("covariance_rad2_per_n2m2", index, column);
            if let Some(value) = *value {
                let found = self.compliance_applied_rad_per_nm[index];
                let agrees = |value| file.agree((&key("_applied"), found), (&key(""), value));
                agrees(applied[index]).or_else(|_| agrees(value))?;
                file.agree_of_estimate(
                    (&key(""), value),
                    (&entry(index), rows[index][index]),
                    (&key("_std"), self.compliance_std_rad_per_nm[index]),
                    (&key("_ci95"), self.compliance_ci95_rad_per_nm[index]),
                )?;
            }
            for column in (0..size).filter(|_| has_others) {
                let other = (&*at("covariance_of_all", index, column), all[index][column]);
                file.agree((&entry(column), rows[index][column]), other)?;
            }
        }
        for (index, each) in self.uncertain.iter().enumerate() {
            let place = size + index;
            if let Some(error) = each.standard_error {
                let root = all[place][place].max(0.0).sqrt();
                let other = (&*at("covariance_of_all", place, place), root);
                file.agree((&format!("uncertain[{index}].std"), error), other)?;
            }
        }
        let (key, hidden) = if has_others {
            ("undetermined_of_all", &self.undetermined_of_all)
        } else {
            ("undetermined_directions", &self.undetermined_directions)
        };
        let left = (size + self.uncertain.len()) as f64 - hidden.len() as f64;
        file.agree(("rank", self.rank as f64), (key, left))
    }
}
