//! The unknown parameters: frames always, and those that the planner's model or groups of parameters add.

use nalgebra::{DVector, Vector3};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::{AbsoluteCase, FitResult, IdentificationError};
use crate::numeric::random::generator;
use crate::observation::{Observation, PlannedReading, planned_information};
use crate::parameter::{Axis, ElasticArm, Freedoms, Parameter, ParameterKind, ParameterSet};
use crate::robot::{Elements, Load};

/// Configurations that stand for all that a robot can do, for each station and target.
const CONFIGURATIONS: usize = 40;

/// Of the logarithm of what the last link weighs with all that it carries.
const MASS_DEVIATION: f64 = 1.0;
/// Of its centre along each axis (m).
const CENTRE_DEVIATION_M: f64 = 0.1;

/// A group of parameters of a robot.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, clap::ValueEnum, strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ParameterGroup {
    /// Where stations and targets are: always.
    Frames,
    /// Joint zeros.
    Zeros,
    /// Positions and orientations of the links' frames.
    Links,
    /// Joint zeros and links.
    Geometry,
    /// Joint compliances.
    Compliances,
    /// Stiffnesses and rest lengths of springs.
    Springs,
    /// Mass and centre of the last link with all that it carries, with priors: its mass is right to a factor of about three,
    /// its centre to a decimetre.
    Payload,
    /// All of these.
    All,
}

impl ParameterGroup {
    /// Its word on the command line.
    pub fn word(self) -> &'static str {
        self.into()
    }

    /// What it adds to the frames of an arm.
    fn kinds(self, arm: &ElasticArm) -> Vec<ParameterKind> {
        let joints = 0..arm.chain.len();
        match self {
            Self::Frames => Vec::new(),
            Self::Zeros => (joints.map(|joint| ParameterKind::JointZero { joint })).collect(),
            Self::Links => joints
                .flat_map(|link| {
                    let position = Axis::ALL.map(|axis| ParameterKind::LinkPosition { link, axis });
                    let rotation = Axis::ALL.map(|axis| ParameterKind::LinkRotation { link, axis });
                    position.into_iter().chain(rotation)
                })
                .collect(),
            Self::Geometry => of_all(&[Self::Zeros, Self::Links], arm),
            Self::Compliances => joints
                .map(|joint| ParameterKind::JointCompliance { joint })
                .collect(),
            Self::Springs => (0..arm.chain.elements.springs.len())
                .flat_map(|spring| {
                    [
                        ParameterKind::SpringStiffness { spring },
                        ParameterKind::SpringRest { spring },
                    ]
                })
                .collect(),
            Self::Payload => {
                let last = arm.chain.joints.iter().enumerate().next_back();
                let heavy = last.filter(|(_, joint)| joint.mass_kg > 0.0);
                let kinds = heavy.map(|(link, _)| {
                    let centre = Axis::ALL.map(|axis| ParameterKind::LinkCentre { link, axis });
                    [&[ParameterKind::LinkMass { link }][..], &centre].concat()
                });
                kinds.unwrap_or_default()
            }
            Self::All => of_all(
                &[
                    Self::Geometry,
                    Self::Compliances,
                    Self::Springs,
                    Self::Payload,
                ],
                arm,
            ),
        }
    }
}

fn of_all(groups: &[ParameterGroup], arm: &ElasticArm) -> Vec<ParameterKind> {
    groups.iter().flat_map(|group| group.kinds(arm)).collect()
}

/// What is known of a parameter that only a group names: masses and centres, which a fit without would send anywhere.
fn prior_deviation(kind: ParameterKind) -> Option<f64> {
    match kind {
        ParameterKind::LinkMass { .. } => Some(MASS_DEVIATION),
        ParameterKind::LinkCentre { .. } => Some(CENTRE_DEVIATION_M),
        _ => None,
    }
}

pub(super) const fn is_geometry(kind: ParameterKind) -> bool {
    matches!(
        kind,
        ParameterKind::JointZero { .. }
            | ParameterKind::LinkPosition { .. }
            | ParameterKind::LinkRotation { .. }
    )
}

/// A parameter that no reading can tell from others, and that was left out for that, or a compliance that readings hardly show.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// Why, in a sentence.
    #[serde(rename = "reason")]
    pub sentence: String,
    /// By how much the unknowns, in their order and units, change for one unit of it: they were found as if it were nominal.
    #[serde(default)]
    pub shift: Vec<f64>,
}

/// A parameter that is unknown, with the deviation of what is known of it by itself.
type Unknown = (ParameterKind, Option<f64>);

impl AbsoluteCase<'_> {
    /// The frames of stations and targets, with what is known of them; how a target is turned shows in poses alone.
    pub(super) fn frames(&self) -> FitResult<ParameterSet> {
        let all = self.named(&[ParameterGroup::Frames])?;
        let is_shown = |kind: ParameterKind| kind.is_mounted() && self.shows(kind);
        let mut places: Vec<usize> = (0..all.len()).collect();
        places.retain(|&place| is_shown(all.parameters()[place].kind));
        Ok(all.subset(&places))
    }

    /// Whether readings of such a kind show a frame's parameter at all.
    fn shows(&self, kind: ParameterKind) -> bool {
        let ParameterKind::ToolRotation { tool, .. } = kind else {
            return true;
        };
        let mut readings = self.observations.iter();
        readings.any(|each| each.setup.target == tool && each.reading.kind().rows() == 6)
    }

    /// The parameters of the base in a station's frame; of one that lengths are read from those that these show.
    pub fn base_kinds(&self, station: usize) -> Vec<ParameterKind> {
        let [position, rotation] = ParameterKind::of_base(station);
        let mut kinds = [position, rotation].concat();
        if let Some(length) = self.length_from(station) {
            kinds.retain(|kind| length.shows(*kind));
        }
        kinds
    }

    /// What the belief leaves open, and of what it knows something before, or what groups name, with the frames: without what
    /// neither these readings nor others that are asked about could tell from the rest.
    ///
    /// # Errors
    /// A parameter that the robot cannot have.
    pub fn unknowns_beside(
        &self,
        groups: &[ParameterGroup],
        asked: &[PlannedReading],
    ) -> Result<ParameterSet, IdentificationError> {
        Ok(self.told_apart(groups, asked)?.0)
    }

    /// The names of what the belief leaves open and groups leave out: it is as the scenario has it.
    pub fn unasked(&self, groups: &[ParameterGroup]) -> Vec<String> {
        let (asked, _) = self.named_unknowns(groups);
        let (open, _) = self.named_unknowns(&[]);
        let left = open
            .into_iter()
            .filter(|(kind, _)| asked.iter().all(|(each, _)| each != kind));
        left.map(|(kind, _)| kind.name(&self.arm)).collect()
    }

    /// What is unknown, and the places of the first of it in the belief's vector.
    fn named_unknowns(&self, groups: &[ParameterGroup]) -> (Vec<Unknown>, Vec<usize>) {
        let named = of_all(groups, &self.arm);
        let is_loaded = (self.observations.iter()).any(|each| each.setup.load != Load::NONE);
        let precision = self.belief.precision();
        let wanted = |place: usize, kind: ParameterKind| match kind {
            // These have no part in readings.
            ParameterKind::TaskScale
            | ParameterKind::TaskForce { .. }
            | ParameterKind::Drift { .. } => false,
            ParameterKind::LoadScale | ParameterKind::LoadOffset if !is_loaded => false,
            _ => groups.is_empty() || named.contains(&kind) || precision[(place, place)] > 0.0,
        };
        let before = self.belief.uncertain.set().parameters().iter().enumerate();
        let before = before.filter_map(|(place, each)| {
            let kind = self.kind_here(each.kind)?;
            wanted(place, kind).then_some((place, (kind, each.prior_deviation)))
        });
        let (places, mut unknowns): (Vec<usize>, Vec<Unknown>) = before.unzip();
        let stations = (0..self.stations.len()).flat_map(|station| self.base_kinds(station));
        let targets = (0..self.targets.len()).flat_map(ParameterKind::of_tool);
        for kind in (named.into_iter()).chain(stations).chain(targets.flatten()) {
            if !unknowns.iter().any(|(known, _)| *known == kind) {
                unknowns.push((kind, prior_deviation(kind)));
            }
        }
        (unknowns, places)
    }

    /// The same as a set, with all that is known before.
    fn named(&self, groups: &[ParameterGroup]) -> FitResult<ParameterSet> {
        let (unknowns, known) = self.named_unknowns(groups);
        let all = ParameterSet::new(&self.arm, unknowns)?;
        let first: Vec<usize> = (0..known.len()).collect();
        let mean = DVector::from_vec(self.belief.values()).select_rows(&known);
        let precision = (self.belief.precision().select_rows(&known)).select_columns(&known);
        let all = all.with_earlier(&first, &mean, &precision);
        let all = self.belief.beside_left_out(all, &known);
        let about = self.about_places(&all);
        let (mean, precision) = (all.prior().mean.clone(), all.prior().precision.clone());
        let places: Vec<usize> = (0..all.len()).collect();
        let all = all.with_earlier(&places, &mean, &about.tr_mul(&(precision * &about)));
        Ok(all.with_ratios(self.belief.uncertain.set().prior().ratios_at(&known)))
    }

    /// The same with what was left out.
    pub(super) fn told_apart(
        &self,
        groups: &[ParameterGroup],
        asked: &[PlannedReading],
    ) -> Result<(ParameterSet, Vec<LeftOut>), IdentificationError> {
        let all = self.named(groups)?;
        let left_out = self.redundant(&all, asked);
        let is_kept = |place: &usize| {
            let is_left_out = left_out.iter().any(|each| each.0 == *place);
            !is_left_out && self.shows(all.parameters()[*place].kind)
        };
        let kept: Vec<usize> = (0..all.len()).filter(is_kept).collect();
        let of_kept = |(_, mut each): (usize, LeftOut)| {
            each.shift = kept.iter().map(|&place| each.shift[place]).collect();
            each
        };
        let left_out = left_out.into_iter().map(of_kept).collect();
        Ok((all.subset(&kept), left_out))
    }

    /// The parameters of geometry, by their places in a set, that no reading of a rigid robot can tell from the others, and that no
    /// prior settles: the same is left out whatever was read. What goes with each is by all places.
    fn redundant(&self, all: &ParameterSet, asked: &[PlannedReading]) -> Vec<(usize, LeftOut)> {
        let kind = |place: usize| all.parameters()[place].kind;
        let places: Vec<usize> = (0..all.len())
            .filter(|&place| kind(place).is_mounted() || is_geometry(kind(place)))
            .collect();
        let set = all.subset(&places);
        let mut readings = self.planned();
        readings.extend_from_slice(asked);
        let freedoms = self.rigid_freedoms(&set, &self.anywhere(&readings));
        (freedoms.named.into_iter())
            .filter(|each| each.is_structural)
            .map(|each| {
                let mut shift = vec![0.0; all.len()];
                for (&place, value) in places.iter().zip(&each.direction) {
                    shift[place] = *value;
                }
                let left_out = LeftOut {
                    name: set.parameters()[each.redundant].name.clone(),
                    sentence: each.sentence,
                    shift,
                };
                (places[each.redundant], left_out)
            })
            .collect()
    }

    pub(super) fn planned(&self) -> Vec<PlannedReading> {
        self.observations.iter().map(Observation::planned).collect()
    }

    /// What readings of a rigid robot leave of a set. Gravity and loads may tell more, if hardly: how far along parallel axes a target
    /// is shows where a joint across them gives. About nominal values, whatever is known of them: what is left out is the same then.
    fn rigid_freedoms(&self, set: &ParameterSet, readings: &[PlannedReading]) -> Freedoms {
        let mut rigid = self.arm.clone();
        rigid.compliance_rad_per_nm.fill(0.0);
        rigid.chain.elements = Elements::default();
        rigid.chain.gravity_m_s2 = Vector3::zeros();
        let nominal = set.parameters().iter().map(|each| each.nominal);
        let nominal = DVector::from_iterator(set.len(), nominal);
        let information = planned_information(set, &rigid, &nominal, readings);
        Freedoms::new(&rigid, set, &information)
    }

    /// Whether the readings determine the frames as far as this robot, were it rigid, lets anybody.
    pub(super) fn check_frames(&self) -> Result<(), IdentificationError> {
        let set = self.frames()?;
        let readings = self.planned();
        let rows: usize = readings.iter().map(|each| each.kind.rows()).sum();
        let is_unknown = |each: &&Parameter| each.prior_deviation.is_none();
        let unknowns = set.parameters().iter().filter(is_unknown).count();
        if rows < unknowns {
            return Err(IdentificationError::TooFew { rows, unknowns });
        }
        let found = self.rigid_freedoms(&set, &readings);
        if found.named.is_empty() {
            return Ok(());
        }
        let anywhere = self.rigid_freedoms(&set, &self.anywhere(&readings));
        if found.directions.ncols() <= anywhere.directions.ncols() {
            return Ok(());
        }
        let stations: Vec<&str> = self.stations.iter().flatten().map(String::as_str).collect();
        let what = match stations.as_slice() {
            [] => format!("base and targets ({})", self.targets.join(", ")),
            stations => format!(
                "base and targets ({}; stations in their order: {})",
                self.targets.join(", "),
                stations.join(", ")
            ),
        };
        let sentences = found.named.into_iter().map(|each| each.sentence).collect();
        Err(IdentificationError::Frames { what, sentences })
    }

    /// The same kinds of readings anywhere within the joints' ranges.
    fn anywhere(&self, readings: &[PlannedReading]) -> Vec<PlannedReading> {
        let mut random = generator(0, 0);
        let mut different: Vec<&PlannedReading> = Vec::new();
        for each in readings {
            let is_same = |known: &&PlannedReading| {
                (known.setup.station, known.setup.target, known.kind)
                    == (each.setup.station, each.setup.target, each.kind)
            };
            if !different.iter().any(is_same) {
                different.push(each);
            }
        }
        let joints = &self.arm.chain.joints;
        let mut all = Vec::new();
        for each in different {
            for _ in 0..CONFIGURATIONS {
                let mut reading = each.clone();
                reading.setup.load = Load::NONE;
                reading.setup.commanded_rad = DVector::from_fn(joints.len(), |joint, _| {
                    let [low, high] = joints[joint].range_rad;
                    match joints[joint].drive.passive_at {
                        Some(rest) => rest,
                        None if low < high => random.random_range(low..=high),
                        None => low,
                    }
                });
                all.push(reading);
            }
        }
        all
    }
}
