//! The planner's model: what planning and identification assume.

use clap::ValueEnum;
use nalgebra::{DMatrix, Isometry3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Extended, Gauge, PriorCampaign, Station, station_named};
use crate::numeric::quantisation::shared_rounding;
use crate::observation::{BareArm, DeflectionPrecision, LengthKind};
use crate::parameter::{
    ElasticArm, ErrorDistribution, ParameterError, ParameterSet, Prior, ReadingSource, SourceLevel,
    Unloaded,
};
use crate::robot::{Commands, EquilibriumSolver, Load, ReadsAlong, Robot, Tool};

/// How deflections are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
    /// The standard deviation of each coordinate of a rotation (rad), where rotations are measured.
    pub rotation_sigma_rad: Option<f64>,
    /// The site of the model where the tracker stands.
    pub tracker_site: Option<usize>,
    /// Which reading without the load deflections rest on.
    pub unloaded: Unloaded,
    /// From which distribution its standard deviation was evaluated.
    pub distribution: ErrorDistribution,
    /// What a gauge shows, where displacements along a direction are read, in place of all three coordinates or in some experiments.
    pub gauge: Option<Gauge>,
    /// What shows each kind of lengths, in their order, where they are read from all stations or from some of them. As of all else, the
    /// standard deviation is that of the difference of two.
    pub by_length: [Option<Gauge>; LengthKind::ALL.len()],
}

impl Instrument {
    /// How precisely it reads.
    pub fn precision(&self) -> DeflectionPrecision {
        DeflectionPrecision {
            sigma_m: self.sigma_m,
            rotation_sigma_rad: self.rotation_sigma_rad,
            unloaded: self.unloaded,
            along_sigma_m: self.gauge.map(|_| self.along_sigma_m()),
            along_step_m: self.along_step_m(),
            reads_all: self.reads_along() != ReadsAlong::Always,
        }
    }

    /// Which readings are displacements along a direction.
    pub const fn reads_along(&self) -> ReadsAlong {
        match &self.gauge {
            None => ReadsAlong::Never,
            Some(gauge) if gauge.beside_m.is_some() => ReadsAlong::Sometimes,
            Some(_) => ReadsAlong::Always,
        }
    }

    /// The standard deviations (m) of a deflection's coordinate and of what a gauge beside reads, in words; none without one.
    pub fn both_sigmas(&self, shown: impl Fn(f64) -> String) -> Option<String> {
        let [coordinate, along] = [self.sigma_m, self.gauge?.beside_m?].map(shown);
        Some(format!(
            "{coordinate} of a coordinate and {along} of the gauge"
        ))
    }

    /// The kinds of lengths that are read, with what shows them.
    pub fn lengths(&self) -> impl Iterator<Item = (LengthKind, Gauge)> {
        let kinds = LengthKind::ALL.into_iter().zip(self.by_length);
        kinds.filter_map(|(kind, shows)| Some((kind, shows?)))
    }

    /// What shows lengths of a kind, where they are read.
    pub fn shows_length(&self, kind: LengthKind) -> Option<Gauge> {
        let mut lengths = self.lengths();
        lengths.find(|each| each.0 == kind).map(|(_, shows)| shows)
    }

    /// The kind of lengths that alone is read; none where absolute readings may be positions or poses.
    pub fn length_alone(&self) -> Option<LengthKind> {
        let mut lengths = self.lengths();
        let alone = lengths.find(|(_, shows)| shows.beside_m.is_none());
        alone.map(|(kind, _)| kind)
    }

    /// Whether absolute readings may be positions or poses.
    pub fn reads_positions(&self) -> bool {
        self.length_alone().is_none()
    }

    /// The standard deviation of what a gauge shows (m), alone or beside another instrument; without one, of a coordinate.
    pub fn sigma_by_m(&self, gauge: Option<Gauge>) -> f64 {
        (gauge.and_then(|gauge| gauge.beside_m)).unwrap_or(self.sigma_m)
    }

    /// The standard deviation of a displacement along a direction (m).
    pub fn along_sigma_m(&self) -> f64 {
        self.sigma_by_m(self.gauge)
    }

    /// The variance of rounding (m^2) in a deflection, which is made of two lengths.
    pub fn rounding_m2(&self) -> f64 {
        let alone = |gauge: Option<Gauge>| gauge.filter(|gauge| gauge.beside_m.is_none());
        let length = (self.length_alone()).and_then(|kind| self.shows_length(kind));
        let [once, twice] =
            [self.gauge, length].map(|gauge| alone(gauge).map_or(0.0, |gauge| gauge.rounding_m2()));
        once + 2.0 * twice
    }

    /// The standard deviation (m) of its noise before it rounds.
    pub fn noise_m(&self) -> f64 {
        before_rounding(self.sigma_m, self.rounding_m2())
    }

    /// The same of a displacement along a direction.
    pub fn along_noise_m(&self) -> f64 {
        let rounding_m2 = self.gauge.map_or(0.0, |gauge| gauge.rounding_m2());
        before_rounding(self.along_sigma_m(), rounding_m2)
    }

    /// The step (m) of what it shows of a displacement, where that is so coarse beside its noise that repeats, alike in all else, share
    /// errors of rounding; else nothing.
    pub fn along_step_m(&self) -> f64 {
        let step_m = self.gauge.map_or(0.0, |gauge| gauge.resolution_m);
        if shared_rounding(step_m, self.along_noise_m().powi(2)) > 0.0 {
            step_m
        } else {
            0.0
        }
    }

    /// The same of the difference of two lengths.
    pub fn length_noise_m(&self, shows: Gauge) -> f64 {
        before_rounding(self.sigma_by_m(Some(shows)), 2.0 * shows.rounding_m2())
    }
}

fn before_rounding(sigma_m: f64, rounding_m2: f64) -> f64 {
    if rounding_m2 > 0.0 {
        (sigma_m.powi(2) - rounding_m2).max(0.0).sqrt()
    } else {
        sigma_m
    }
}

/// How compliances are identified and deflections compensated.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema, Serialize, ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Linear least squares (eq. 9) and linear compensation (eq. 15).
    Linear,
    /// Through the static equilibrium of the nominal model: no linearisation.
    #[default]
    Nonlinear,
}

/// How a load comes onto the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Loading {
    /// The robot visits configurations without it, and returns to each with it.
    #[default]
    Returns,
    /// It is hung where the robot stands, in one visit.
    InPlace,
}

/// What planner and identification believe of the robot, its tools and the instrument, and what they are to
/// find out.
#[derive(Debug, Clone)]
pub struct Belief {
    /// The robot as it is taken to be.
    pub nominal: Robot,
    /// The tool that carries the reflector and the weight.
    pub calibration_tool: Tool,
    /// The tool that machines.
    pub machining_tool: Tool,
    /// The joints whose compliances are identified, as indices in ascending order.
    pub parameters: Vec<usize>,
    /// What an earlier identification told of these compliances (rad/(N m)); its means are the nominal ones.
    pub prior: Option<Prior>,
    /// The error sources of the campaign behind that.
    pub prior_campaign: Option<PriorCampaign>,
    /// The vector of unknowns: the identified compliances, what else is to be found, and what is uncertain besides the instrument's noise.
    pub uncertain: Extended,
    /// The torque (N m; N where it slides) at which what a joint carries decides as much as the side of approach on which side
    /// of its gap it stands, where it has one; none where the side of approach alone decides.
    pub turned_over_at_nm: Vec<Option<f64>>,
    /// The torque (N m; N where it slides) at which it is said by what share a joint gives less than its spring would; none where
    /// it is a spring.
    pub stiffening_at_nm: Vec<Option<f64>>,
    /// How deflections are measured.
    pub instrument: Instrument,
    /// How a load comes onto the robot, and so whether readings under several may be of one visit.
    pub loading: Loading,
    /// Where the instrument may stand for absolute readings; none where the scenario does not say.
    pub stations: Vec<Station>,
    /// The method of identification and compensation.
    pub method: Method,
}

impl Belief {
    /// How the robot is commanded: what plans and measurements have columns for.
    pub fn commands(&self) -> Commands {
        Commands::from(&self.nominal.chain).reading_along(self.instrument.reads_along())
    }

    /// The lengths that are read from a station of this name, with what shows them; none where positions are read.
    pub fn length_from(&self, station: Option<&str>) -> Option<(LengthKind, Gauge)> {
        let kind = station_named(&self.stations, station)?.reads?;
        Some((kind, self.instrument.shows_length(kind)?))
    }

    /// Where the nominal robot has the calibration tool at rest at commanded angles, without a load and under one (m, world frame); none
    /// where it does not rest.
    pub fn nominal_rests_m(
        &self,
        solver: &mut EquilibriumSolver,
        q: &[f64],
        load: &Load,
    ) -> Option<[Vector3<f64>; 2]> {
        let mut arm = self.nominal.chain.at(&self.calibration_tool);
        let mut place = |load: &Load| {
            let compliance = &self.nominal.compliance_rad_per_nm;
            solver.solve(&mut arm, compliance, q, load).ok()?;
            Some(solver.state().tool_position)
        };
        Some([place(&Load::NONE)?, place(load)?])
    }

    /// Whether each repeat of a deflection is a visit by itself: something is new at each.
    pub fn repeats_are_visits(&self) -> bool {
        let mut sources = self.uncertain.sources().map(|(_, source)| source);
        sources.any(|source| {
            let is_of_gauge = matches!(source, ReadingSource::GaugeDirection(_));
            source.level() == SourceLevel::Visit && !is_of_gauge
        })
    }

    /// Whether what errs by a tracker's range counts there: not where lengths are read beside one.
    pub fn reads_by_tracker(&self, station: Option<&str>) -> bool {
        let length = self.length_from(station);
        length.is_none_or(|(_, shows)| shows.beside_m.is_none())
    }

    /// The station whose name stands for all from which readings of one visit may be: while the robot waits, lengths are read beside the
    /// only tracker's positions; otherwise its own.
    pub fn station_of_visit<'a>(&'a self, station: Option<&'a str>) -> Option<&'a str> {
        let mut trackers = self.stations.iter().filter(|each| each.reads.is_none());
        match (trackers.next(), trackers.next()) {
            (Some(only), None) if self.length_from(station).is_some() => Some(&only.name),
            _ => station,
        }
    }

    /// The unit of its parameters' compliances in so small parts, for a heading: that of joints that turn, and of any that slide.
    pub fn compliance_unit(&self, part: &str) -> String {
        let slides = |&joint: &usize| self.nominal.chain.joints[joint].drive.slides;
        let of_slides = if self.parameters.iter().any(slides) {
            format!("; slides {part} m/N")
        } else {
            String::new()
        };
        format!("{part} rad/(N m){of_slides}")
    }

    /// The number of joints, passive ones counted.
    pub fn joints(&self) -> usize {
        self.nominal.chain.len()
    }

    /// The nominal arm with one of its tools.
    pub fn arm_with<'a>(&'a self, tool: &'a Tool) -> BareArm<'a> {
        BareArm {
            chain: &self.nominal.chain,
            compliance_rad_per_nm: &self.nominal.compliance_rad_per_nm,
            tool,
        }
    }

    /// The nominal arm: the calibration tool first, then the machining tool where it is another one.
    pub fn arm(&self) -> ElasticArm {
        let mut tools = vec![self.calibration_tool.clone()];
        if self.machining_tool != self.calibration_tool {
            tools.push(self.machining_tool.clone());
        }
        let mut arm = ElasticArm::new(
            self.nominal.chain.clone(),
            self.nominal.compliance_rad_per_nm.clone(),
            tools,
        );
        for (gap, &torque_nm) in arm.backlash.iter_mut().zip(&self.turned_over_at_nm) {
            gap.turned_over_at_nm = torque_nm;
        }
        for (law, &torque_nm) in arm.stiffening.iter_mut().zip(&self.stiffening_at_nm) {
            law.at = torque_nm;
        }
        // Each station has a frame of its own, of which a source may say something.
        (arm.instrument_from_base).resize(self.stations.len().max(1), Isometry3::identity());
        arm.drift_along = (self.instrument.gauge).map_or(1.0, |gauge| gauge.drift_share);
        arm
    }

    /// The compliance of every joint (rad/(N m)) at values of the unknowns (p).
    pub fn compliance_at(&self, values: &[f64]) -> Vec<f64> {
        if !self.uncertain.is_plain() {
            return self.uncertain.arm_at(values).compliance_rad_per_nm;
        }
        let mut compliance_rad_per_nm = self.nominal.compliance_rad_per_nm.clone();
        for (&joint, &value) in self.parameters.iter().zip(values) {
            compliance_rad_per_nm[joint] = value;
        }
        compliance_rad_per_nm
    }

    /// The arm at values of the unknowns (p); the last of its tools machines.
    pub fn arm_at(&self, values: &[f64]) -> ElasticArm {
        let mut arm = self.arm();
        self.set_values(&mut arm, values);
        arm
    }

    /// Makes [that](Self::arm_at) of one that was made so for other values.
    pub fn set_values(&self, arm: &mut ElasticArm, values: &[f64]) {
        if self.uncertain.is_plain() {
            arm.compliance_rad_per_nm = self.compliance_at(values);
        } else {
            *arm = self.uncertain.arm_at(values);
        }
    }

    /// The same where the compliances of these joints alone are unknown, with what is known of them before, and only the instrument's noise
    /// is uncertain.
    ///
    /// # Errors
    /// The arm does not have one of them.
    pub fn of_compliances(
        &self,
        parameters: Vec<usize>,
        prior: Option<Prior>,
    ) -> Result<Self, ParameterError> {
        let arm = self.arm();
        Ok(Self {
            uncertain: Extended::new(arm, &parameters, &[], prior.as_ref(), None, &[])?,
            parameters,
            prior,
            ..self.clone()
        })
    }

    /// The number p of unknowns: the identified compliances, and what else is uncertain and shared by a plan.
    pub fn unknowns(&self) -> usize {
        self.uncertain.set().len()
    }

    /// The typical sizes of the unknowns (p), in their units.
    pub fn sizes(&self) -> Vec<f64> {
        let mut sizes = self.nominal.typical_rad_per_nm(&self.parameters);
        sizes.extend(self.uncertain.other_sizes());
        sizes
    }

    /// The nominal values of the unknowns (p).
    pub fn values(&self) -> Vec<f64> {
        self.known().mean.as_slice().to_vec()
    }

    /// What is known of the unknowns before any measurement.
    fn known(&self) -> &Prior {
        self.uncertain.set().prior()
    }

    /// The standard deviations of the unknowns before any measurement, in their units; `None` where nothing is known of one.
    pub fn prior_deviations(&self) -> Vec<Option<f64>> {
        let prior = self.known();
        let spread = prior.spread(&self.sizes());
        let each = spread.row_iter().map(|row| row.norm());
        each.map(|deviation| Some(deviation).filter(|deviation| *deviation > 0.0))
            .collect()
    }

    /// The precision of what is known of the unknowns before any measurement (p x p), in their units.
    pub fn precision(&self) -> DMatrix<f64> {
        self.known().precision.clone()
    }

    /// A set of which the first parameters are some of the belief's vector, by their places there, with what is known of them, and others are
    /// not: those that the earlier campaign left nominal go with what it found, and are left out first.
    pub fn beside_left_out(&self, set: ParameterSet, places: &[usize]) -> ParameterSet {
        let Some(campaign) = &self.prior_campaign else {
            return set;
        };
        let (own, earlier) = (places.len(), self.uncertain.earlier());
        let mut precision = DMatrix::zeros(set.len(), set.len());
        let mut first = precision.view_mut((0, 0), (own, own));
        first.copy_from(&earlier.select_rows(places).select_columns(places));
        let found = campaign.as_found(&set, own);
        let with_others = found.tr_mul(&precision) * found;
        (set.with_precision(&(with_others - precision))).with_found(&campaign.names)
    }

    /// Whether deflections of one configuration share something that repeats do not average.
    pub fn is_shared_by_configuration(&self) -> bool {
        self.uncertain.is_shared_by_configuration()
    }

    /// The precision of what is known of the unknowns before any measurement, in units of typical sizes,
    /// p x p.
    pub fn prior_information(&self) -> DMatrix<f64> {
        self.known().relative(&self.sizes())
    }

    /// The same about other compliances of all joints (rad/(N m)), with what measurements tell besides what is known
    /// before: a precision of the unknowns (p x p, in one over their units).
    pub fn informed(&self, compliance_rad_per_nm: &[f64], precision: &DMatrix<f64>) -> Self {
        let mut informed = self.clone();
        (informed.nominal.compliance_rad_per_nm).copy_from_slice(compliance_rad_per_nm);
        informed.uncertain = (self.uncertain).informed(compliance_rad_per_nm, precision);
        if self.uncertain.is_plain() {
            informed.prior = Some(informed.known().clone());
            informed.prior_campaign = None;
        }
        informed
    }

    /// The names of the unknowns: joints for compliances that are identified.
    pub fn unknown_names(&self) -> Vec<String> {
        let mut names = self.parameter_names();
        names.extend(self.uncertain.other_names());
        names
    }

    /// The names of the error sources that all measurements share.
    pub fn source_names(&self) -> Vec<String> {
        let sources = (self.uncertain.shared().iter()).chain(self.uncertain.kept());
        sources.map(|(name, _)| name.clone()).collect()
    }

    /// The names of the identified joints.
    pub fn parameter_names(&self) -> Vec<String> {
        self.parameters
            .iter()
            .map(|&joint| self.nominal.chain.joints[joint].name.clone())
            .collect()
    }
}
