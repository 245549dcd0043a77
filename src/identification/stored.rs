//! An identified file of deflections, read.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::agreement::{agree, agree_of_estimate};
use super::covariance::covariance_of;
use super::estimate::UncertainEstimate;
use crate::codes::{Condition, ConditionCode, ErrorCode};
use crate::files::schema::read_results;
use crate::files::typed::from_json;
use crate::files::{FileError, hexadecimal, sha256_of};
use crate::measurement::{Origin, SimulatedRun};
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, ParameterKind};
use crate::quantities::plausible::{ANY_VARIANCE, ELASTIC_COMPLIANCE, VARIANCE};
use crate::robot::{Joint, Robot};
use crate::task::{Fingerprint, LeftNominal, Method};

/// Which file is wanted.
const WANTED: &str = "the file must be one that `elastocal identify --identified-out` wrote";

/// What others leave of a variance below this share is rounding.
const ROUNDING: f64 = 1e-12;
/// Smaller compliances (rad/(N m)) are as good as zero.
const LEAST_SIZE: f64 = 1e-15;

/// An identification as its file tells it.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredIdentification {
    /// The identified joints, as indices of the robot that it is read for.
    pub joints: Vec<usize>,
    /// What is known of their compliances.
    pub posterior: Posterior,
    /// The same of these and of what else was uncertain together, whose typical sizes the file does not say: as if they were one.
    pub all: Option<Posterior>,
    /// The conditions with which it was made, besides what is not determined.
    pub conditions: Vec<Condition>,
    /// The standard deviations that error sources gave what else was uncertain; in the units of `all`.
    pub listed: Vec<Option<f64>>,
    /// Which of it was determined.
    pub determined: Vec<bool>,
    /// What was left nominal, then and before.
    pub left_out: Vec<LeftNominal>,
    /// The names of the error sources with which it was made; some files do not say.
    pub error_sources: Option<Vec<String>>,
    /// What the model leaves unexplained, of positions (m) and rotations (rad); nothing where the measurements did not show any.
    pub discrepancy: [f64; 2],
    /// The degrees of freedom that this was estimated with; `None` where nothing was.
    pub degrees_of_freedom: Option<f64>,
    /// What it rests on; files of earlier versions do not say.
    pub identified_with: Option<Fingerprint>,
}

#[derive(Deserialize)]
struct StoredResidual {
    #[serde(default)]
    standardised: Vec<Option<f64>>,
    #[serde(default)]
    leverage: f64,
}

/// The keys that are read.
#[derive(Deserialize)]
struct IdentificationFile {
    #[expect(dead_code, reason = "must be one of those there are")]
    method: Method,
    parameters: Vec<String>,
    compliance_rad_per_nm: Vec<Option<f64>>,
    #[serde(default)]
    compliance_std_rad_per_nm: Vec<Option<f64>>,
    #[serde(default)]
    compliance_ci95_rad_per_nm: Vec<Option<[f64; 2]>>,
    compliance_applied_rad_per_nm: Vec<f64>,
    undetermined_directions: Vec<Vec<f64>>,
    compliance_typical_rad_per_nm: Vec<f64>,
    covariance_rad2_per_n2m2: Vec<Vec<f64>>,
    #[serde(default)]
    uncertain: Vec<UncertainEstimate>,
    #[serde(default)]
    undetermined_of_all: Vec<Vec<f64>>,
    #[serde(default)]
    covariance_of_all: Vec<Vec<f64>>,
    rank: usize,
    discrepancy_mm: Option<f64>,
    discrepancy_mrad: Option<f64>,
    #[serde(default)]
    residuals: Vec<StoredResidual>,
    #[serde(default)]
    conditions: Vec<Condition>,
    identified_with: Option<Fingerprint>,
    error_sources: Option<Vec<String>>,
    earlier_left_out: Option<Vec<LeftNominal>>,
}

/// The keys of any identified file that say under which scenario it was made.
#[derive(Debug, Deserialize)]
pub(crate) struct StoredOrigin {
    scenario_file: Option<String>,
    simulated: Option<SimulatedRun>,
    provenance: Option<StoredProvenance>,
}

#[derive(Debug, Deserialize)]
struct StoredProvenance {
    scenario_sha256: Option<String>,
}

impl StoredOrigin {
    /// That scenario.
    pub fn origin(self) -> Option<Origin> {
        Some(Origin {
            scenario: self.scenario_file?.into(),
            scenario_sha256: self.provenance?.scenario_sha256?,
            simulated: self.simulated,
        })
    }
}

impl StoredIdentification {
    /// Under which scenario it was made, as the file says.
    ///
    /// # Errors
    /// The file is no identification.
    pub fn origin(path: &Path) -> Result<Option<Origin>, FileError> {
        Ok(of_deflections::<StoredOrigin>(path)?.origin())
    }

    /// Reads what `identify --identified-out` or `run` wrote, for a robot with the same joints' names.
    ///
    /// # Errors
    /// What is wrong with it, with its key.
    pub fn read(path: &Path, robot: &Robot) -> Result<Self, FileError> {
        let stored = of_deflections::<IdentificationFile>(path);
        let found = stored.and_then(|stored| stored.known(path, robot));
        found.map_err(|wrong| wrong.or_code(ErrorCode::IdentifiedFile))
    }

    /// The same with nominal compliances in place of those that no joint has, and without conditions that are not of the identification.
    pub(super) fn possible(mut self, robot: &Robot) -> Self {
        let known = self.all.as_ref().unwrap_or(&self.posterior);
        let mut values = known.mean.clone();
        let joints = &self.joints;
        let compliance = |place: usize| {
            let joint = *joints.get(place)?;
            self.posterior.standard_error(place)?;
            let Joint { name, drive, .. } = &robot.chain.joints[joint];
            let nominal = robot.compliance_rad_per_nm[joint];
            Some((nominal, name.as_str(), drive.compliance_unit()))
        };
        let (held, shift) = hold_impossible(&mut values, &known.covariance, compliance);
        self.conditions.extend(held);
        // What stands in where only combinations are determined went with that when the file was written.
        let stands_in = |place: &usize| self.posterior.standard_error(*place).is_none();
        for place in (0..joints.len()).filter(stands_in) {
            values[place] = self.posterior.mean[place];
        }
        for each in [Some(&mut self.posterior), self.all.as_mut()]
            .into_iter()
            .flatten()
        {
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

impl IdentificationFile {
    fn known(mut self, path: &Path, robot: &Robot) -> Result<StoredIdentification, FileError> {
        let joints = joints_of(path, &self.parameters, robot)?;
        let posterior = posterior(path, &self)?;
        let all = posterior_of_all(path, &self, &posterior, robot)?;
        let discrepancy = [
            size(path, "discrepancy_mm", self.discrepancy_mm)? * 1e-3,
            size(path, "discrepancy_mrad", self.discrepancy_mrad)? * 1e-3,
        ];
        // What the numbers are more than the fit takes up.
        let spare = |each: &StoredResidual| each.standardised.len() as f64 - each.leverage;
        let freedom: f64 = self.residuals.iter().map(spare).sum();
        let is_estimated = discrepancy.iter().sum::<f64>() > 0.0;
        let found = StoredIdentification {
            posterior,
            all,
            listed: (self.uncertain.iter().map(|each| each.prior_deviation)).collect(),
            determined: (self
                .uncertain
                .iter()
                .map(|each| each.standard_error.is_some()))
            .collect(),
            left_out: self.earlier_left_out.take().unwrap_or_default(),
            joints,
            error_sources: self.error_sources.take(),
            discrepancy,
            degrees_of_freedom: Some(freedom).filter(|freedom| is_estimated && *freedom > 0.0),
            conditions: std::mem::take(&mut self.conditions),
            identified_with: self.identified_with.take(),
        }
        .possible(robot);
        check_agreement(path, &self, &found.posterior.mean)?;
        Ok(found)
    }
}

/// Takes the nominal compliance for identified ones that no joint has, and all else as it goes with that: what was done, and by how much all
/// moved. What errs about the values that are taken has this shift, squared, beside the covariance. Of a compliance its place tells the
/// nominal value, its joint's name and its unit.
pub fn hold_impossible<'a>(
    values: &mut [f64],
    covariance: &DMatrix<f64>,
    compliance: impl Fn(usize) -> Option<(f64, &'a str, &'a str)>,
) -> (Vec<Condition>, DVector<f64>) {
    let found = DVector::from_column_slice(values);
    let mut given = covariance.clone();
    let (mut held, mut done): (Vec<(usize, f64)>, Vec<Condition>) = (Vec::new(), Vec::new());
    // One that moves along may become impossible in its turn.
    while let Some((place, (nominal, joint, unit))) = (0..values.len())
        .filter(|place| held.iter().all(|each| each.0 != *place))
        .filter(|&place| !ELASTIC_COMPLIANCE.allows(values[place]))
        .find_map(|place| Some((place, compliance(place)?)))
    {
        held.push((place, nominal));
        done.push(ConditionCode::ImpossibleCompliance.with(format!(
            "the identified compliance of {joint} is {:.3e} {unit}, which no joint has: replaced by the nominal value, the \
             other parameters conditioned on it",
            values[place]
        )));
        let (off, own) = (nominal - values[place], given[(place, place)]);
        if own > ROUNDING * covariance[(place, place)] {
            let column = given.column(place).into_owned();
            for (value, with) in values.iter_mut().zip(&column) {
                *value += with * (off / own);
            }
            given.ger(-own.recip(), &column, &column, 1.0);
        }
    }
    for (place, nominal) in held {
        values[place] = nominal;
    }
    let shift = DVector::from_column_slice(values) - found;
    (done, shift)
}

/// Zero where the file has none.
fn size(path: &Path, key: &str, size: Option<f64>) -> Result<f64, FileError> {
    let size = size.unwrap_or(0.0);
    if size >= 0.0 && size.is_finite() {
        return Ok(size);
    }
    let problem = format!("found {size}; zero or a size is needed");
    Err(FileError::new(path, problem).at(key))
}

fn of_deflections<T: DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    read_identified(path, false)?.ok_or_else(|| {
        let problem = "was identified from absolute readings; what is identified from deflections is needed here";
        let wrong = FileError::new(path, problem).at("kind");
        wrong.code(ErrorCode::OtherAccuracy)
    })
}

/// What `identify --identified-out` or `run` wrote of absolute readings, or of deflections; `None` if the file is of the others.
pub(crate) fn read_identified<T: DeserializeOwned>(
    path: &Path,
    is_absolute: bool,
) -> Result<Option<T>, FileError> {
    let coded = |wrong: FileError| wrong.or_code(ErrorCode::IdentifiedFile);
    let (text, json) = read_results(path, &["identify", "run"], WANTED).map_err(coded)?;
    if (json["kind"] == "absolute") != is_absolute {
        return Ok(None);
    }
    from_json(path, &text).map_err(|wrong: FileError| coded(wrong.hint(WANTED)))
}

/// Whether a file is the one that an identified file was made from, by its hash.
///
/// # Errors
/// One of the two cannot be read.
pub fn is_identified_from(path: &Path, measurements: &Path) -> Result<bool, FileError> {
    let (_, json) = read_results(path, &["identify", "run"], WANTED)?;
    let hash = &json["provenance"]["inputs_sha256"]["measurements"];
    Ok(*hash == hexadecimal(&sha256_of(measurements)?))
}

fn joints_of(path: &Path, names: &[String], robot: &Robot) -> Result<Vec<usize>, FileError> {
    let mut joints = Vec::new();
    for name in names {
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
        let wrong = FileError::new(path, problem).at("parameters");
        return Err(wrong.code(ErrorCode::OtherRobot));
    }
    Ok(joints)
}

/// Whether what the file says twice agrees; its lists have their lengths, and these values are applied. Files of earlier versions have
/// the estimates for them.
fn check_agreement(
    path: &Path,
    stored: &IdentificationFile,
    applied: &[f64],
) -> Result<(), FileError> {
    let size = stored.parameters.len();
    let (rows, all) = (&stored.covariance_rad2_per_n2m2, &stored.covariance_of_all);
    let has_others = !stored.uncertain.is_empty();
    let at = |key: &str, row: usize, column: usize| format!("{key}[{row}][{column}]");
    for (index, value) in stored.compliance_rad_per_nm.iter().enumerate() {
        let key = |name: &str| format!("compliance{name}_rad_per_nm[{index}]");
        let entry = |column: usize| at("covariance_rad2_per_n2m2", index, column);
        if let Some(value) = *value {
            let found = stored.compliance_applied_rad_per_nm[index];
            let agrees = |value| agree(path, (&key("_applied"), found), (&key(""), value));
            agrees(applied[index]).or_else(|_| agrees(value))?;
            let errors = &stored.compliance_std_rad_per_nm;
            let intervals = &stored.compliance_ci95_rad_per_nm;
            agree_of_estimate(
                path,
                (&key(""), value),
                (&entry(index), rows[index][index]),
                (&key("_std"), errors.get(index).copied().flatten()),
                (&key("_ci95"), intervals.get(index).copied().flatten()),
            )?;
        }
        for column in (0..size).filter(|_| has_others) {
            let other = (&*at("covariance_of_all", index, column), all[index][column]);
            agree(path, (&entry(column), rows[index][column]), other)?;
        }
    }
    for (index, each) in stored.uncertain.iter().enumerate() {
        let place = size + index;
        if let Some(error) = each.standard_error {
            let root = all[place][place].max(0.0).sqrt();
            let other = (&*at("covariance_of_all", place, place), root);
            agree(path, (&format!("uncertain[{index}].std"), error), other)?;
        }
    }
    let (key, hidden) = if has_others {
        ("undetermined_of_all", &stored.undetermined_of_all)
    } else {
        ("undetermined_directions", &stored.undetermined_directions)
    };
    let unknowns = (size + stored.uncertain.len()) as f64;
    let left = unknowns - hidden.len() as f64;
    agree(path, ("rank", stored.rank as f64), (key, left))
}

/// What is known of the compliances and of other unknowns together, where there are any; logarithms of ratios to what is nominal now.
fn posterior_of_all(
    path: &Path,
    stored: &IdentificationFile,
    compliances: &Posterior,
    robot: &Robot,
) -> Result<Option<Posterior>, FileError> {
    if stored.uncertain.is_empty() {
        return Ok(None);
    }
    let key = "covariance_of_all";
    let size = stored.parameters.len() + stored.uncertain.len();
    let rows = &stored.covariance_of_all;
    if rows.len() != size {
        let problem = format!("found {} rows; there are {size} unknowns", rows.len());
        return Err(FileError::new(path, problem).at(key));
    }
    let covariance = covariance_of(rows, &ANY_VARIANCE)
        .map_err(|(place, problem)| FileError::new(path, problem).at(format!("{key}{place}")))?;
    let directions = &stored.undetermined_of_all;
    let hidden = orthonormal(path, "undetermined_of_all", directions, size)?;
    let (mut names, mut mean) = (compliances.names.clone(), compliances.mean.clone());
    let nominal = robot.compliance_rad_per_nm.clone();
    let arm = ElasticArm::new(robot.chain.clone(), nominal, Vec::new());
    let kinds = ParameterKind::of_robot(&arm);
    for (index, each) in stored.uncertain.iter().enumerate() {
        let value = each.value.unwrap_or(0.0);
        if !value.is_finite() {
            let problem = format!("found {value}; a finite number is needed");
            return Err(FileError::new(path, problem).at(format!("uncertain[{index}].value")));
        }
        let own = ParameterKind::named(&each.name, &kinds, &arm);
        let own = own.and_then(|kind| kind.quantity(&arm));
        let ratio = (each.nominal.zip(own)).map_or(1.0, |(then, now)| then / now);
        if !(ratio > 0.0 && ratio.is_finite()) {
            let problem = format!("found a share of {:?}, which is nothing", each.nominal);
            let wrong = FileError::new(path, problem).at(format!("uncertain[{index}].nominal"));
            return Err(wrong.code(ErrorCode::OtherRobot));
        }
        names.push(each.name.clone());
        mean.push(value + ratio.ln());
    }
    Ok(Some(Posterior {
        names,
        mean,
        covariance,
        estimable: Estimable::with_hidden(&vec![1.0; size], hidden),
    }))
}

fn posterior(path: &Path, stored: &IdentificationFile) -> Result<Posterior, FileError> {
    let wrong = |key: &str, problem: String| FileError::new(path, problem).at(key);
    let (names, estimates) = (&stored.parameters, &stored.compliance_rad_per_nm);
    let applied = &stored.compliance_applied_rad_per_nm;
    let typical = &stored.compliance_typical_rad_per_nm;
    let (rows, size) = (&stored.covariance_rad2_per_n2m2, names.len());
    for (key, found) in [
        ("compliance_rad_per_nm", estimates.len()),
        ("covariance_rad2_per_n2m2", rows.len()),
        ("compliance_applied_rad_per_nm", applied.len()),
        ("compliance_typical_rad_per_nm", typical.len()),
    ] {
        if found != size {
            let problem = format!("found {found} values; there are {size} parameters");
            return Err(wrong(key, problem));
        }
    }
    for (index, value) in estimates.iter().enumerate() {
        // What scatters below zero is dealt with later.
        let size = value.unwrap_or_default().abs().max(LEAST_SIZE);
        ELASTIC_COMPLIANCE.check(size).map_err(|problem| {
            let key = format!("compliance_rad_per_nm[{index}]");
            wrong(&key, format!("{}: {problem}", names[index])).hint(
                "measure again with loads that bend this joint, or take it out of robot.parameters",
            )
        })?;
    }
    let covariance = covariance_of(rows, &VARIANCE)
        .map_err(|(place, problem)| wrong(&format!("covariance_rad2_per_n2m2{place}"), problem))?;
    if let Some(found) = (typical.iter()).find(|value| value.is_nan() || **value <= 0.0) {
        let problem = format!("found {found}; positive numbers are allowed");
        return Err(wrong("compliance_typical_rad_per_nm", problem));
    }
    let (key, directions) = ("undetermined_directions", &stored.undetermined_directions);
    let hidden = orthonormal(path, key, directions, size)?;
    let both = estimates.iter().zip(applied);
    let posterior = Posterior {
        names: names.clone(),
        mean: (both.map(|(estimate, applied)| estimate.unwrap_or(*applied))).collect(),
        covariance,
        estimable: Estimable::with_hidden(typical, hidden),
    };
    let is_known = |index: usize| posterior.standard_error(index).is_some();
    if let Some(index) = (0..size).find(|&index| estimates[index].is_some() != is_known(index)) {
        let problem = "is a number where undetermined_directions say that there is none, or the other \
                       way round: the file is damaged";
        let key = format!("compliance_rad_per_nm[{index}]");
        return Err(wrong(&key, problem.to_owned()));
    }
    Ok(posterior)
}

/// Orthonormal directions among so many parameters, as columns.
fn orthonormal(
    path: &Path,
    key: &str,
    directions: &[Vec<f64>],
    size: usize,
) -> Result<DMatrix<f64>, FileError> {
    let wrong = |problem: String| FileError::new(path, problem).at(key);
    if let Some(found) = directions.iter().find(|direction| direction.len() != size) {
        let problem = format!("found {} values; there are {size} parameters", found.len());
        return Err(wrong(problem));
    }
    let hidden = DMatrix::from_fn(size, directions.len(), |row, column| {
        directions[column][row]
    });
    let gram = hidden.tr_mul(&hidden);
    let off = (&gram - DMatrix::identity(gram.nrows(), gram.ncols())).amax();
    if off.is_nan() || off > 1e-9 {
        let problem = "these are not orthonormal: the file is damaged";
        return Err(wrong(problem.to_owned()));
    }
    Ok(hidden)
}
