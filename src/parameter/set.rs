//! Parameters, ordered sets of them, and beliefs made from vectors of their values.

use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DVector, DefaultAllocator, Dim, Dyn, OMatrix};
use thiserror::Error;

use super::frames::{Displacements, FrameChange};
use super::kind::Owner;
use super::prior::Prior;
use super::{ElasticArm, ParameterKind};

/// Why a set of parameters makes no sense for a robot.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum ParameterError {
    /// A parameter is listed twice.
    #[error("{0} is listed twice")]
    Twice(String),
    /// The robot has no such joint, link or tool.
    #[error("{0} does not exist: the robot has {1} joints and {2} tools")]
    Missing(&'static str, usize, usize),
    /// A parameter of a payload, and there is none.
    #[error("a payload's parameter needs a payload with a mass")]
    NoPayload,
    /// A mass's or a centre of mass's parameter of a link without one.
    #[error("link_{0} has no mass")]
    NoMass(usize),
    /// A gear's wave of a joint that does not turn.
    #[error("{0} slides: its transmission error has no harmonics")]
    NoTurns(String),
    /// A relative prior of something that is nominally zero.
    #[error("{0} has a relative prior, which a nominal value of zero cannot have")]
    RigidWithPrior(String),
    /// A standard deviation that is none.
    #[error("{0}: a prior's standard deviation must be positive and finite")]
    Deviation(String),
    /// A covariance that is none.
    #[error("the prior's covariance is not positive definite")]
    Covariance,
}

/// One unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// What it is.
    pub kind: ParameterKind,
    /// Its unique name.
    pub name: String,
    /// Whether its value is a logarithm of a ratio to the nominal quantity.
    pub is_logarithmic: bool,
    /// Its value in the nominal belief: 0 for logarithms and for deviations of frames.
    pub nominal: f64,
    /// Its typical size: the prior's standard deviation where there is one. What is determined is judged
    /// in these sizes.
    pub scale: f64,
    /// The standard deviation of its own prior about the nominal value, where there is one.
    pub prior_deviation: Option<f64>,
    /// Whether it is of a joint that slides.
    pub slides: bool,
    /// Whether an earlier campaign found it: of what has the same effect, others are left out first.
    pub is_found: bool,
}

impl Parameter {
    /// The unit of its value.
    pub const fn unit(&self) -> &'static str {
        self.of_joint(self.kind.unit(self.is_logarithmic))
    }

    /// The unit of the quantity itself, logarithms undone.
    pub const fn quantity_unit(&self) -> &'static str {
        self.of_joint(self.kind.quantity_unit())
    }

    /// A unit of joints that turn, as it is of this one's joint.
    pub const fn of_joint(&self, unit: &'static str) -> &'static str {
        match unit.as_bytes() {
            b"rad" if self.slides => "m",
            b"rad/(N m)" if self.slides => "m/N",
            _ => unit,
        }
    }

    /// How far a fit may change it in one step, in its own unit: beyond this a linear model says nothing.
    pub(crate) fn longest_step(&self) -> f64 {
        match self.kind {
            _ if self.is_logarithmic => 1.0,
            ParameterKind::JointCompliance { .. } => 3.0 * self.nominal.max(self.scale),
            ParameterKind::SpringStiffness { .. } => 3.0 * self.nominal.abs().max(self.scale),
            ParameterKind::LinkCentre { .. }
            | ParameterKind::PayloadCentre { .. }
            | ParameterKind::SpringRest { .. } => 0.3,
            ParameterKind::LinkPosition { .. }
            | ParameterKind::ToolPosition { .. }
            | ParameterKind::BasePosition { .. }
            | ParameterKind::LoadOffset
            | ParameterKind::TaskForce { .. } => f64::INFINITY,
            _ => 1.0,
        }
    }

    /// The quantity itself, in SI units, for a value of the parameter: itself, or the nominal
    /// quantity times its exponential.
    pub fn quantity(&self, nominal: &ElasticArm, value: f64) -> f64 {
        if !self.is_logarithmic {
            return value;
        }
        // What has no place is the task's, of which the arm has none.
        self.kind.quantity(nominal).unwrap_or(1.0) * value.exp()
    }
}

/// An ordered set of unknowns of a robot with unique names.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSet {
    parameters: Vec<Parameter>,
    prior: Prior,
    /// The parameters that stay as they are believed to be, as indices, in order.
    nominal: Vec<usize>,
}

impl ParameterSet {
    /// The set of these unknowns of a belief, each with the standard deviation of its prior, in the
    /// parameter's unit, where it has one.
    pub fn new(
        belief: &ElasticArm,
        unknowns: impl IntoIterator<Item = (ParameterKind, Option<f64>)>,
    ) -> Result<Self, ParameterError> {
        Self::of(belief, unknowns.into_iter().collect())
    }

    /// The same of a list: compiled once, and not for every way to write one.
    fn of(
        belief: &ElasticArm,
        unknowns: Vec<(ParameterKind, Option<f64>)>,
    ) -> Result<Self, ParameterError> {
        let mut parameters: Vec<Parameter> = Vec::new();
        let mut arm = belief.clone();
        for (kind, prior_deviation) in unknowns {
            check(belief, kind)?;
            let name = kind.name(belief);
            if parameters.iter().any(|other| other.kind == kind) {
                return Err(ParameterError::Twice(name));
            }
            if !prior_deviation.is_none_or(|deviation| deviation > 0.0 && deviation.is_finite()) {
                return Err(ParameterError::Deviation(name));
            }
            let has_prior = prior_deviation.is_some();
            let is_logarithmic = kind.is_logarithmic(has_prior);
            let whole = kind.place(&mut arm).map_or(0.0, |place| *place);
            let is_compliance = matches!(kind, ParameterKind::JointCompliance { .. });
            if is_logarithmic && is_compliance && whole <= 0.0 {
                return Err(ParameterError::RigidWithPrior(name));
            }
            let nominal = if is_logarithmic { 0.0 } else { whole };
            parameters.push(Parameter {
                kind,
                name,
                is_logarithmic,
                nominal,
                scale: prior_deviation.unwrap_or_else(|| kind.typical_size(belief, has_prior)),
                prior_deviation,
                is_found: false,
                slides: matches!(kind.owner(), Owner::Joint(joint) if belief.chain.joints[joint].drive.slides),
            });
        }
        let precision = parameters
            .iter()
            .map(|each| each.prior_deviation.map_or(0.0, |d| (d * d).recip()));
        let count = parameters.len();
        let prior = Prior::new(
            DVector::from_iterator(count, parameters.iter().map(|p| p.nominal)),
            DMatrix::from_diagonal(&DVector::from_iterator(count, precision)),
        );
        Ok(Self {
            nominal: Vec::new(),
            parameters,
            prior,
        })
    }

    /// The set without unknowns.
    pub fn empty() -> Self {
        Self {
            parameters: Vec::new(),
            nominal: Vec::new(),
            prior: Prior::new(DVector::zeros(0), DMatrix::zeros(0, 0)),
        }
    }

    /// The compliances of these joints, linear and without priors: the paper's unknowns.
    pub fn compliances(belief: &ElasticArm, joints: &[usize]) -> Result<Self, ParameterError> {
        let unknown = |&joint| (ParameterKind::JointCompliance { joint }, None);
        Self::new(belief, joints.iter().map(unknown))
    }

    /// The same set, in which the positive parameter at a place is known besides to this standard deviation, about the value that it has in
    /// the mean already: to first order, since its logarithm is normal.
    pub fn with_deviation(mut self, place: usize, deviation: f64) -> Self {
        self.prior.precision[(place, place)] += deviation.powi(-2);
        let mean = self.prior.mean[place];
        if mean > 0.0 {
            self.prior.ratios.push((place, deviation / mean));
        }
        let scale = &mut self.parameters[place].scale;
        *scale = scale.min(deviation);
        self
    }

    /// The same set, in which an earlier identification found parameters at some places: its means (n) and its precision (n x n), in their
    /// units, are what is known of them.
    pub fn with_earlier(
        mut self,
        places: &[usize],
        mean: &DVector<f64>,
        precision: &DMatrix<f64>,
    ) -> Self {
        (self.prior.ratios).retain(|(place, _)| !places.contains(place));
        for (row, &place) in places.iter().enumerate() {
            self.prior.mean[place] = mean[row];
            for (column, &other) in places.iter().enumerate() {
                self.prior.precision[(place, other)] = precision[(row, column)];
            }
        }
        self
    }

    /// The same set, in which parameters are known by their ratios to the mean, as far as the precision has it already.
    pub fn with_ratios(mut self, ratios: Vec<(usize, f64)>) -> Self {
        self.prior.ratios = ratios;
        self
    }

    /// The same set, of which an earlier campaign found those of these names.
    pub fn with_found(mut self, names: &[String]) -> Self {
        for each in &mut self.parameters {
            each.is_found = names.contains(&each.name);
        }
        self
    }

    /// The same set, in which of the first parameters this precision (q x q, in their units) is known besides,
    /// about the values that they have in the mean already.
    pub fn with_precision(mut self, precision: &DMatrix<f64>) -> Self {
        let size = precision.nrows();
        let mut own = self.prior.precision.view_mut((0, 0), (size, size));
        own += precision;
        self
    }

    /// The parameters with others besides, nominal in what they are not known of; the places of the others.
    ///
    /// # Errors
    /// The arm does not have one of them.
    pub fn with_more(
        &self,
        arm: &ElasticArm,
        more: impl Iterator<Item = ParameterKind>,
    ) -> Result<(Self, Vec<usize>), ParameterError> {
        let mut unknowns: Vec<(ParameterKind, Option<f64>)> = (self.parameters.iter())
            .map(|each| (each.kind, each.prior_deviation))
            .collect();
        let places = more
            .map(|kind| {
                let known = unknowns.iter().position(|(other, _)| *other == kind);
                known.unwrap_or_else(|| {
                    unknowns.push((kind, None));
                    unknowns.len() - 1
                })
            })
            .collect();
        Ok((Self::new(arm, unknowns)?, places))
    }

    /// Some of the parameters, at `indices`, with what is known of them when the others are at their
    /// prior's mean.
    pub fn subset(&self, indices: &[usize]) -> Self {
        Self {
            parameters: indices
                .iter()
                .map(|&index| self.parameters[index].clone())
                .collect(),
            prior: Prior {
                mean: self.prior.mean.select_rows(indices),
                precision: (self.prior.precision.select_rows(indices)).select_columns(indices),
                ratios: self.prior.ratios_at(indices),
            },
            nominal: Vec::new(),
        }
    }

    /// The same set, in which some more parameters stay as they are believed to be, as indices.
    pub fn with_nominal(mut self, indices: &[usize]) -> Self {
        self.nominal.extend(indices);
        self.nominal.sort_unstable();
        self
    }

    /// The same set, in which none stays so.
    pub fn without_nominal(mut self) -> Self {
        self.nominal.clear();
        self
    }

    /// The parameters that stay as they are believed to be, as indices, in order.
    pub fn nominal(&self) -> &[usize] {
        &self.nominal
    }

    /// The number p of parameters.
    pub fn len(&self) -> usize {
        self.parameters.len()
    }

    /// Whether nothing is unknown.
    pub fn is_empty(&self) -> bool {
        self.parameters.is_empty()
    }

    /// The parameters in their order.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// What is known before any reading.
    pub fn prior(&self) -> &Prior {
        &self.prior
    }

    /// Whether something is known before of the frame that a parameter is of, which then counts from where that has it.
    pub(crate) fn knows_frame_of(&self, kind: ParameterKind) -> bool {
        let mut own = (self.parameters.iter()).filter(|each| each.kind.owner() == kind.owner());
        kind.is_mounted() && own.any(|each| each.prior_deviation.is_some())
    }

    /// The place of a parameter in the set.
    pub fn index_of(&self, kind: ParameterKind) -> Option<usize> {
        self.parameters.iter().position(|each| each.kind == kind)
    }

    /// The typical sizes (p).
    pub fn scales(&self) -> DVector<f64> {
        DVector::from_iterator(self.len(), self.parameters.iter().map(|each| each.scale))
    }

    /// How a place follows the parameters (r x p) under a load of the task: what changes the loads of readings has no part in that.
    pub fn under_loads_of_task<R: Dim>(&self, by: &mut OMatrix<f64, R, Dyn>)
    where
        DefaultAllocator: Allocator<R, Dyn>,
    {
        for (mut column, parameter) in by.column_iter_mut().zip(&self.parameters) {
            if parameter.kind.is_of_readings_loads() {
                column.fill(0.0);
            }
        }
    }

    /// A vector that is told in typical sizes, in the parameters' units (p).
    pub(super) fn in_units(&self, relative: &DVector<f64>) -> DVector<f64> {
        relative.component_mul(&self.scales())
    }

    /// The belief in which the parameters have these values (p, each in its unit), and all else is
    /// nominal.
    pub fn apply(&self, nominal: &ElasticArm, values: &[f64]) -> ElasticArm {
        let mut belief = nominal.clone();
        for (parameter, &value) in self.parameters.iter().zip(values) {
            let Some(place) = parameter.kind.place(&mut belief) else {
                continue;
            };
            let before = *place;
            *place = if parameter.is_logarithmic {
                before * value.exp()
            } else {
                value
            };
            if let ParameterKind::SpringRest { spring } = parameter.kind {
                belief.chain.elements.springs[spring].rest_m[1] += value - before;
            }
        }
        let displacements = self.displacements(nominal, values);
        for (joint, displacement) in belief.chain.joints.iter_mut().zip(&displacements.links) {
            displacement.apply(&mut joint.previous_from_link);
        }
        for (tool, displacement) in belief.tools.iter_mut().zip(&displacements.tools) {
            displacement.apply(&mut tool.link_from_tool);
        }
        let bases = belief.instrument_from_base.iter_mut();
        for (base, displacement) in bases.zip(&displacements.bases) {
            displacement.apply(base);
        }
        belief
    }

    /// How the frames of links, tools and base differ from the nominal ones at these values.
    pub(crate) fn displacements(&self, nominal: &ElasticArm, values: &[f64]) -> Displacements {
        let mut all = Displacements {
            links: vec![FrameChange::default(); nominal.chain.len()],
            tools: vec![FrameChange::default(); nominal.tools.len()],
            bases: vec![FrameChange::default(); nominal.instrument_from_base.len()],
        };
        for (parameter, &value) in self.parameters.iter().zip(values) {
            let frame = match parameter.kind.owner() {
                Owner::Link(link) => &mut all.links[link],
                Owner::Tool(tool) => &mut all.tools[tool],
                Owner::Station(station) => &mut all.bases[station],
                Owner::Joint(_) | Owner::Spring(_) | Owner::Only => continue,
            };
            let Some(place) = parameter.kind.place_of_frame(frame) else {
                continue;
            };
            *place = value;
        }
        all
    }
}

fn check(belief: &ElasticArm, kind: ParameterKind) -> Result<(), ParameterError> {
    let (joints, tools) = (belief.chain.len(), belief.tools.len());
    let (what, index, count) = match kind.owner() {
        Owner::Joint(joint) => ("the joint", joint, joints),
        Owner::Spring(spring) => ("the spring", spring, belief.chain.elements.springs.len()),
        Owner::Link(link) => ("the link", link, joints),
        Owner::Tool(tool) => ("the tool", tool, tools),
        Owner::Station(station) => ("the station", station, belief.instrument_from_base.len()),
        Owner::Only => ("", 0, 1),
    };
    if index >= count {
        return Err(ParameterError::Missing(what, joints, tools));
    }
    match kind {
        ParameterKind::JointWave { joint, .. } if belief.chain.joints[joint].drive.slides => {
            let name = &belief.chain.joints[joint].name;
            Err(ParameterError::NoTurns(name.clone()))
        }
        ParameterKind::LinkMass { link } | ParameterKind::LinkCentre { link, .. }
            if belief.chain.joints[link].mass_kg <= 0.0 =>
        {
            Err(ParameterError::NoMass(link + 1))
        }
        ParameterKind::PayloadMass | ParameterKind::PayloadCentre { .. }
            if belief.payload.is_none_or(|payload| payload.mass_kg <= 0.0) =>
        {
            Err(ParameterError::NoPayload)
        }
        _ => Ok(()),
    }
}
