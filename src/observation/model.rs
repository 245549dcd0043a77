//! The observation model: readings and their derivatives with respect to any parameters.

use std::borrow::Cow;

use nalgebra::{DVector, Isometry3, Matrix3, Matrix3x6, Matrix6xX, Rotation3, Vector3, Vector6};

use super::reading::{Prediction, ReadingKind, Setup};
use super::rotation::{exponential, inverse_left_jacobian};
use super::sweep::{Sweep, SweepPose, SweptForm};
use crate::parameter::{ElasticArm, Leaning, ParameterKind, ParameterSet};
use crate::robot::{
    EquilibriumError, EquilibriumSolver, KinematicState, Kinematics, Load, SerialChain, made_up,
};

/// What loads are changed by to see what they move (N, N m).
const PROBE: f64 = 10.0;

/// Predicts readings of an arm with the derivatives with respect to a set of parameters, at one vector
/// of their values. Keeps its workspace, so that predicting does not allocate.
#[derive(Debug, Clone)]
pub struct ObservationModel<'a> {
    set: Cow<'a, ParameterSet>,
    belief: ElasticArm,
    chain: SerialChain,
    solver: EquilibriumSolver,
    /// The geometry to first order in compliance, and where it is: a target's number, and the joints' angles.
    state: KinematicState,
    state_is_of: (usize, Vec<f64>),
    /// The same of the tool that the load of the last setup hangs on, if that is another than the target.
    hook: KinematicState,
    sweep: Sweep,
    /// What the joints are commanded, and where they stand by that before anything holds them.
    asked_rad: Vec<f64>,
    commanded_rad: Vec<f64>,
    torque: Vec<f64>,
    unloaded: Matrix6xX<f64>,
    bases: Vec<StationBase>,
    off_springs: Option<Box<OffSprings>>,
    /// Near what torques equilibria are sought.
    near: Option<RestTorques>,
    /// The share of the instrument's drift that the reading has.
    drift_share: f64,
}

/// The joints' torques (N m) at the equilibria of a reading without and with its load; none where they are not known.
pub type RestTorques = [Vec<f64>; 2];

/// Where joints have gaps, or give besides their springs: how they stand off these, which is a matter of the nominal arm alone.
#[derive(Debug, Clone)]
struct OffSprings {
    nominal: ElasticArm,
    /// Under the load of the last setup, or without one.
    here: Vec<Leaning>,
    /// Without a load.
    unloaded: Vec<Leaning>,
}

/// Where the robot's base is in the frame of a station.
#[derive(Debug, Clone)]
struct StationBase {
    rotation: Matrix3<f64>,
    translation_m: Vector3<f64>,
    is_identity: bool,
}

impl StationBase {
    fn new(instrument_from_base: &Isometry3<f64>) -> Self {
        Self {
            rotation: Rotation3::from(instrument_from_base.rotation).into_inner(),
            translation_m: instrument_from_base.translation.vector,
            is_identity: *instrument_from_base == Isometry3::identity(),
        }
    }
}

impl<'a> ObservationModel<'a> {
    /// The model of a nominal belief in which the parameters have these values (p).
    pub fn new(set: &'a ParameterSet, nominal: &ElasticArm, values: &[f64]) -> Self {
        Self::made_of(Cow::Borrowed(set), nominal, values)
    }

    fn made_of(set: Cow<'a, ParameterSet>, nominal: &ElasticArm, values: &[f64]) -> Self {
        let belief = set.apply(nominal, values);
        let joints = belief.chain.len();
        let bases = belief.instrument_from_base.iter().map(StationBase::new);
        let leans = nominal.leans() || set.parameters().iter().any(|each| each.kind.leans());
        Self {
            chain: belief.loaded_chain(),
            solver: EquilibriumSolver::of_derivatives(joints),
            state: KinematicState::new(joints),
            state_is_of: (usize::MAX, vec![0.0; joints]),
            hook: KinematicState::new(joints),
            sweep: Sweep::new(&set, nominal, values),
            asked_rad: vec![0.0; joints],
            commanded_rad: vec![0.0; joints],
            torque: vec![0.0; joints],
            unloaded: Matrix6xX::zeros(set.len()),
            bases: bases.collect(),
            off_springs: leans.then(|| {
                Box::new(OffSprings {
                    nominal: nominal.clone(),
                    here: vec![Leaning::default(); joints],
                    unloaded: vec![Leaning::default(); joints],
                })
            }),
            near: None,
            drift_share: 1.0,
            belief,
            set,
        }
    }

    /// The same with a set of its own.
    pub fn of(
        set: ParameterSet,
        nominal: &ElasticArm,
        values: &[f64],
    ) -> ObservationModel<'static> {
        ObservationModel::made_of(Cow::Owned(set), nominal, values)
    }

    /// Predictions are from now on those of what a gauge reads, or of all else: the instrument drifts while a load is changed. Whether
    /// that is another share than before.
    pub fn read_along(&mut self, is_along: bool) -> bool {
        let share = if is_along {
            self.belief.drift_along
        } else {
            1.0
        };
        std::mem::replace(&mut self.drift_share, share).to_bits() != share.to_bits()
    }

    /// The parameters.
    pub fn set(&self) -> &ParameterSet {
        &self.set
    }

    /// Predicts a reading and writes its derivatives (6 x p, each column in m and rad per the
    /// parameter's unit; a reading of three rows leaves the last three to be ignored). Rotation rows
    /// are those of the rotation vector for a deflection, and the angular velocity for a pose. Through the static equilibrium under
    /// gravity, payload and load; derivatives without a column stay without.
    ///
    /// # Errors
    /// The arm has no equilibrium there.
    pub fn predict(
        &mut self,
        setup: &Setup,
        kind: ReadingKind,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Result<Prediction, EquilibriumError> {
        let load = self.command(setup);
        let mut prediction = if kind.is_deflection() {
            self.stand_off_springs(setup, false);
            let unloaded = if derivatives.ncols() == 0 {
                self.at_rest(false, &Load::NONE, setup, derivatives)?
            } else {
                let mut room = std::mem::replace(&mut self.unloaded, Matrix6xX::zeros(0));
                let unloaded = self.at_rest(false, &Load::NONE, setup, &mut room);
                self.unloaded = room;
                unloaded?
            };
            self.stand_off_springs(setup, true);
            let loaded = self.at_rest(true, &load, setup, derivatives)?;
            self.deflection(&unloaded, &loaded, kind, derivatives)
        } else {
            self.at_rest(true, &load, setup, derivatives)?
        };
        self.to_instrument(setup.station, kind, &mut prediction, derivatives);
        Ok(prediction)
    }

    /// The same begun near equilibria of other values of the parameters; their torques become those of these.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub fn predict_near(
        &mut self,
        torques: &mut RestTorques,
        setup: &Setup,
        kind: ReadingKind,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Result<Prediction, EquilibriumError> {
        self.near = Some(std::mem::take(torques));
        let prediction = self.predict(setup, kind, derivatives);
        *torques = self.near.take().unwrap_or_default();
        prediction
    }

    /// The same to first order in compliance, with torques and Jacobian at the commanded angles (eqs. 3 to 8), which always exists. Neither
    /// gravity nor springs beside the joints' own have a part in a deflection.
    /// The target's geometry there may be known already.
    pub fn predict_first_order(
        &mut self,
        state: Option<&KinematicState>,
        setup: &Setup,
        kind: ReadingKind,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Prediction {
        let load = self.command(setup);
        let shown = if kind.is_deflection() {
            SweptForm::Deflection
        } else {
            SweptForm::Pose
        };
        let mut prediction = self.first_order(state, &load, setup, shown, derivatives);
        self.to_instrument(setup.station, kind, &mut prediction, derivatives);
        prediction
    }

    /// The same as planning sees it: to first order in compliance, in which springs beside the joints' own do not show;
    /// with them through the static equilibrium, where there is one.
    pub fn predict_as_planned(
        &mut self,
        state: Option<&KinematicState>,
        setup: &Setup,
        kind: ReadingKind,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Prediction {
        if self.chain.elements.has_springs()
            && let Ok(prediction) = self.predict(setup, kind, derivatives)
        {
            return prediction;
        }
        self.predict_first_order(state, setup, kind, derivatives)
    }

    /// Writes the derivatives of what is left at a target under a load if the joints' own deflections at the model's values are
    /// compensated (6 x p, in the robot's base frame): what parameters change of these. To first order in compliance; the scale of the
    /// loads, the instrument and where things stand have no part in it, the task's force has.
    pub fn uncompensated(&mut self, setup: &Setup, derivatives: &mut Matrix6xX<f64>) {
        let load = self.command(setup);
        self.first_order(None, &load, setup, SweptForm::Uncompensated, derivatives);
    }

    /// Adds to derivatives at a target (6 x p, in the robot's base frame) what changes of its place where the load is given in its frame:
    /// parameters that turn the target turn the load by as much, which then bends the arm otherwise. The scale of the readings' loads
    /// has no part in it.
    pub fn add_turning_load(&mut self, setup: &Setup, derivatives: &mut Matrix6xX<f64>) {
        let mut turned = Matrix6xX::zeros(derivatives.ncols());
        self.rests(setup, &mut turned);
        let mut nothing = Matrix6xX::zeros(0);
        let response = Matrix3x6::from_columns(&std::array::from_fn::<_, 6, _>(|axis| {
            let [more_m, less_m] = [PROBE, -PROBE].map(|size| {
                let wrench = setup.load.wrench() + Vector6::ith(axis, size);
                let load = Load {
                    force_n: wrench.fixed_rows::<3>(0).into_owned(),
                    torque_nm: wrench.fixed_rows::<3>(3).into_owned(),
                };
                let setup = Setup {
                    load,
                    ..setup.clone()
                };
                self.rests(&setup, &mut nothing).position_m
            });
            (more_m - less_m) / (2.0 * PROBE)
        }));
        let columns = derivatives.column_iter_mut().zip(turned.column_iter());
        for ((mut column, turned), parameter) in columns.zip(self.set.parameters()) {
            if parameter.kind.is_of_readings_loads() {
                continue;
            }
            let omega = turned.fixed_rows::<3>(3).into_owned();
            let (force, torque) = (&setup.load.force_n, &setup.load.torque_nm);
            let bent = response.fixed_columns::<3>(0) * omega.cross(force)
                + response.fixed_columns::<3>(3) * omega.cross(torque);
            let mut place = column.fixed_rows_mut::<3>(0);
            place += bent;
        }
    }

    /// Where a target rests under a load as planning sees it, in the robot's base frame.
    fn rests(&mut self, setup: &Setup, derivatives: &mut Matrix6xX<f64>) -> Prediction {
        let load = self.command(setup);
        if self.chain.elements.has_springs()
            && let Ok(prediction) = self.at_rest(true, &load, setup, derivatives)
        {
            return prediction;
        }
        self.first_order(None, &load, setup, SweptForm::Pose, derivatives)
    }

    /// Sets the joints' angles, and returns the load that acts.
    fn command(&mut self, setup: &Setup) -> Load {
        self.asked_rad
            .copy_from_slice(setup.commanded_rad.as_slice());
        for (joint, commanded) in self.commanded_rad.iter_mut().enumerate() {
            *commanded = self.belief.stands_at(joint, setup.commanded_rad[joint]);
        }
        self.stand_off_springs(setup, true);
        self.belief.acting(&setup.load)
    }

    /// Moves joints that have gaps, or give besides their springs, to where they stand with the load of a setup, or without it.
    fn stand_off_springs(&mut self, setup: &Setup, is_loaded: bool) {
        let Some(off_springs) = &mut self.off_springs else {
            return;
        };
        let (nominal, approach) = (&off_springs.nominal, setup.approach.as_ref());
        let q = setup.commanded_rad.as_slice();
        let target = &nominal.tools[setup.target];
        let tool = (setup.hook()).map_or(target, |hook| hook.among(&nominal.tools));
        let under = |load: &Load| nominal.leanings(q, tool, load, approach);
        let unloaded = under(&Load::NONE);
        let here = if is_loaded {
            under(&nominal.acting(&setup.load))
        } else {
            unloaded.clone()
        };
        for (joint, leaning) in here.iter().enumerate() {
            self.commanded_rad[joint] =
                self.belief.stands_at(joint, q[joint]) + self.belief.leans_by(joint, leaning);
        }
        (off_springs.here, off_springs.unloaded) = (here, unloaded);
    }

    /// Brings the geometry to the joints' angles.
    fn stand(&mut self, target: usize) {
        let (last, q) = &mut self.state_is_of;
        if *last != target || *q != self.commanded_rad {
            let tool = &self.belief.tools[target];
            (self.chain.at(tool)).update(&self.commanded_rad, &mut self.state);
            *last = target;
            q.copy_from_slice(&self.commanded_rad);
        }
    }

    /// The target's position and orientation in the base frame, or J k J^T W and the rotation that
    /// goes with it.
    fn first_order(
        &mut self,
        given: Option<&KinematicState>,
        load: &Load,
        setup: &Setup,
        shown: SweptForm,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Prediction {
        let has_rigid_motion = shown == SweptForm::Pose;
        let given = given.filter(|_| self.commanded_rad == self.asked_rad);
        if given.is_none() {
            self.stand(setup.target);
        }
        let state = given.unwrap_or(&self.state);
        let hook = setup.hook().map(|hook| {
            let tool = hook.among(&self.belief.tools);
            (self.chain.at(tool)).update(&self.commanded_rad, &mut self.hook);
            (hook, &self.hook)
        });
        let gravity = if has_rigid_motion {
            self.chain.gravity_m_s2
        } else {
            Vector3::zeros()
        };
        let mut bent = Vector3::zeros();
        let mut turned = Vector3::zeros();
        for joint in 0..self.torque.len() {
            let loaded = hook.map_or(state, |(_, hook)| hook);
            self.torque[joint] =
                loaded.load_torque(joint, load) + state.gravity_torque(joint, &gravity);
            let angle = self.belief.compliance_rad_per_nm[joint] * self.torque[joint];
            bent += state.position_column(joint) * angle;
            turned += state.rotation_column(joint) * angle;
        }
        if let Some(off_springs) = self.off_springs.as_ref().filter(|_| !has_rigid_motion) {
            let leanings = off_springs.here.iter().zip(&off_springs.unloaded);
            for (joint, (here, unloaded)) in leanings.enumerate() {
                let crossed =
                    self.belief.leans_by(joint, here) - self.belief.leans_by(joint, unloaded);
                bent += state.position_column(joint) * crossed;
                turned += state.rotation_column(joint) * crossed;
            }
        }
        let compliance = &self.belief.compliance_rad_per_nm;
        let made_up = if shown == SweptForm::Uncompensated && self.chain.has_passive() {
            let springs = compliance.iter().zip(&self.torque);
            let deflections: Vec<f64> = springs.map(|(k, torque)| k * torque).collect();
            made_up(&self.chain, &state.jacobian(), &deflections)
        } else {
            None
        };
        let pose = SweepPose {
            set: &self.set,
            belief: &self.belief,
            chain: &self.chain,
            state,
            q: &self.commanded_rad,
            target: setup.target,
            asked_rad: &self.asked_rad,
            load,
            hook,
            gravity_m_s2: &gravity,
            torque: &self.torque,
            leanings: (self.off_springs.as_ref())
                .map(|leanings| [leanings.here.as_slice(), &leanings.unloaded]),
            shown,
            made_up: made_up.as_ref().map(DVector::as_slice),
        };
        if derivatives.ncols() > 0 {
            self.sweep.derivatives(&pose, derivatives);
        }
        if has_rigid_motion {
            Prediction {
                position_m: state.tool_position + bent,
                rotation: exponential(&turned) * state.tool_rotation,
            }
        } else {
            Prediction {
                position_m: bent,
                rotation: exponential(&turned),
            }
        }
    }

    fn at_rest(
        &mut self,
        is_loaded: bool,
        load: &Load,
        setup: &Setup,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Result<Prediction, EquilibriumError> {
        if let Some(off_springs) = &self.off_springs {
            self.belief.check_held(&off_springs.here)?;
        }
        let target = &self.belief.tools[setup.target];
        let hook = setup.hook().filter(|_| is_loaded);
        let carrier = hook.map_or(target, |hook| hook.among(&self.belief.tools));
        let mut arm = self.chain.at(carrier);
        let compliance = &self.belief.compliance_rad_per_nm;
        let commanded = &self.commanded_rad;
        match &mut self.near {
            Some(near) => {
                let near = &mut near[usize::from(is_loaded)];
                (self.solver).solve_near(&mut arm, compliance, commanded, load, near)?
            }
            None => self.solver.solve(&mut arm, compliance, commanded, load)?,
        };
        // What a load hangs on comes to rest, and the target with it.
        let read = hook.map(|_| {
            (self.chain.at(target)).update(self.solver.q(), &mut self.state);
            self.state_is_of.0 = usize::MAX;
            &self.state
        });
        let rests = read.unwrap_or_else(|| self.solver.state());
        let prediction = Prediction {
            position_m: rests.tool_position,
            rotation: rests.tool_rotation,
        };
        if derivatives.ncols() == 0 {
            return Ok(prediction);
        }
        (self.solver).response(compliance, read, &mut self.sweep.response);
        let pose = SweepPose {
            set: &self.set,
            belief: &self.belief,
            chain: &self.chain,
            state: read.unwrap_or_else(|| self.solver.state()),
            q: self.solver.q(),
            target: setup.target,
            asked_rad: &self.asked_rad,
            load,
            hook: hook.map(|hook| (hook, self.solver.state())),
            gravity_m_s2: &self.chain.gravity_m_s2,
            torque: self.solver.torque(),
            leanings: (self.off_springs.as_ref())
                .map(|leanings| [leanings.here.as_slice(), &leanings.unloaded]),
            shown: SweptForm::Rest,
            made_up: None,
        };
        self.sweep.derivatives(&pose, derivatives);
        Ok(prediction)
    }

    /// Loaded minus unloaded; `derivatives` are those of the loaded pose before, of the deflection
    /// after.
    fn deflection(
        &self,
        unloaded: &Prediction,
        loaded: &Prediction,
        kind: ReadingKind,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Prediction {
        let rotation = loaded.rotation * unloaded.rotation.transpose();
        if derivatives.ncols() > 0 && kind.rows() == 3 {
            *derivatives -= &self.unloaded;
        } else {
            let inverse = inverse_left_jacobian(&crate::robot::rotation_vector(&rotation));
            for (mut column, from) in derivatives
                .column_iter_mut()
                .zip(self.unloaded.column_iter())
            {
                let moved = column.fixed_rows::<3>(0) - from.fixed_rows::<3>(0);
                let turned =
                    inverse * (column.fixed_rows::<3>(3) - rotation * from.fixed_rows::<3>(3));
                column.fixed_rows_mut::<3>(0).copy_from(&moved);
                column.fixed_rows_mut::<3>(3).copy_from(&turned);
            }
        }
        Prediction {
            position_m: loaded.position_m - unloaded.position_m,
            rotation,
        }
    }

    /// From the robot's base frame to the instrument's, with the derivatives by the base's parameters; of a length what
    /// it shows.
    fn to_instrument(
        &self,
        station: usize,
        kind: ReadingKind,
        prediction: &mut Prediction,
        derivatives: &mut Matrix6xX<f64>,
    ) {
        let base = &self.bases[station];
        if !base.is_identity {
            let turn = &base.rotation;
            for mut column in derivatives.column_iter_mut() {
                let moved = turn * column.fixed_rows::<3>(0);
                let turned = turn * column.fixed_rows::<3>(3);
                column.fixed_rows_mut::<3>(0).copy_from(&moved);
                column.fixed_rows_mut::<3>(3).copy_from(&turned);
            }
            prediction.position_m = turn * prediction.position_m;
            if kind.is_deflection() {
                prediction.rotation = turn * prediction.rotation * turn.transpose();
            } else {
                prediction.position_m += base.translation_m;
                prediction.rotation = turn * prediction.rotation;
            }
        }
        let (displacement, rotation) = self.sweep.base_axes(station);
        let parameters = self.set.parameters().iter().enumerate();
        for (index, parameter) in parameters.take(derivatives.ncols()) {
            let (moved, turned) = match parameter.kind {
                ParameterKind::BasePosition { station: at, axis }
                    if at == station && !kind.is_deflection() =>
                {
                    (
                        displacement.column(axis.index()).into_owned(),
                        Vector3::zeros(),
                    )
                }
                ParameterKind::BaseRotation { station: at, axis } if at == station => {
                    let omega = rotation.column(axis.index()).into_owned();
                    if kind.is_deflection() {
                        let vector = crate::robot::rotation_vector(&prediction.rotation);
                        (omega.cross(&prediction.position_m), omega.cross(&vector))
                    } else {
                        let lever = prediction.position_m - base.translation_m;
                        (omega.cross(&lever), omega)
                    }
                }
                ParameterKind::Drift { axis } if kind.is_deflection() => {
                    let moved = Vector3::ith(axis.index(), self.drift_share);
                    (moved, Vector3::zeros())
                }
                _ => continue,
            };
            let mut column = derivatives.column_mut(index);
            column.fixed_rows_mut::<3>(0).copy_from(&moved);
            column.fixed_rows_mut::<3>(3).copy_from(&turned);
        }
        if kind.is_deflection() {
            prediction.position_m += self.belief.drift_m * self.drift_share;
        }
        if let ReadingKind::Length(kind) = kind {
            *prediction = prediction.length(kind, derivatives);
        }
    }
}
