//! How a target moves with each parameter, from one sweep over the joints.
//!
//! A parameter of geometry moves all that is beyond a place of the chain by a twist: rotation omega,
//! and velocity v + omega x p of a point p. With the joints m and further moved, it changes the torques
//!
//! ```text
//! dtau_j = z_j . (dp x F + dmoment x g)                      j < m
//! dtau_j = omega . (J_j x F + z_j x T + moment_j x g)        j >= m
//! ```
//!
//! where J_j is a column of the Jacobian, moment_j the first moment by which joint j moves the mass that
//! it carries, and dmoment the moment by which the twist moves the mass beyond it. The target moves by
//! Z dtau, Z = Y diag(k): Y = J (I - k dtau/dq)^-1 at rest, Y = J to first order in compliance. The
//! sums over j are made once for all parameters.

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6x3, Matrix6xX, Rotation3, Vector3, Vector6};

use super::reading::Hook;
use super::reading_errors::column as jacobian_column;
use super::rotation::left_jacobian;
use crate::parameter::{
    Axis, ElasticArm, GearWave, Leaning, ParameterKind, ParameterSet, Payload, along,
};
use crate::robot::{KinematicState, Load, Motion, SerialChain};

/// The directions of a frame's displacement and rotation parameters.
#[derive(Debug, Clone, Copy)]
struct FrameAxes {
    /// As columns, in the frame before.
    displacement: Matrix3<f64>,
    rotation: Matrix3<f64>,
}

impl FrameAxes {
    fn new(nominal: &Isometry3<f64>, rotation: &Vector3<f64>) -> Self {
        let displacement = Rotation3::from(nominal.rotation).into_inner();
        Self {
            displacement,
            rotation: displacement * left_jacobian(rotation),
        }
    }
}

/// All that derivatives need besides the kinematic state.
#[derive(Debug, Clone)]
pub(super) struct Sweep {
    links: Vec<FrameAxes>,
    tools: Vec<FrameAxes>,
    bases: Vec<FrameAxes>,
    /// The orientation of the frame before each link (the previous link), and of the last link.
    before: Vec<Matrix3<f64>>,
    /// Y^T at rest, n x 6.
    pub response: DMatrix<f64>,
    /// Y's columns: how the target moves with each joint's rest angle.
    columns: Vec<Vector6<f64>>,
    /// Sums over the joints before m of `Z_j z_j^T`, for m = 0 to n.
    inner: Vec<Matrix6x3<f64>>,
    /// Sums over the joints from m on of `Z_j` times what multiplies omega.
    outer: Vec<Matrix6x3<f64>>,
    /// To first order in compliance: sums of `z_j delta_j` over the joints before m, and of
    /// `J_j delta_j` from m on, where delta = k tau.
    bent_before: Vec<Vector3<f64>>,
    bent_from: Vec<Vector3<f64>>,
}

/// What a sweep is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct SweepPose<'a> {
    pub set: &'a ParameterSet,
    pub belief: &'a ElasticArm,
    /// The chain with the payload.
    pub chain: &'a SerialChain,
    pub state: &'a KinematicState,
    pub q: &'a [f64],
    /// What the joints are commanded (rad), by which gears err.
    pub asked_rad: &'a [f64],
    pub target: usize,
    /// The load that acts, its scale included.
    pub load: &'a Load,
    /// The tool that it hangs on and its geometry, if that is another than the target: nothing of the target moves it.
    pub hook: Option<(&'a Hook, &'a KinematicState)>,
    pub gravity_m_s2: &'a Vector3<f64>,
    /// The joint torques (N m).
    pub torque: &'a [f64],
    /// How the joints stand off their springs, and how they stood without the load; where some do.
    pub leanings: Option<[&'a [Leaning]; 2]>,
    pub shown: SweptForm,
    /// How passive joints' deflections are made up for by commands (rad, m), where what is compensated has such.
    pub made_up: Option<&'a [f64]>,
}

/// What of a target is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SweptForm {
    /// Where it rests.
    Rest,
    /// Where it is to first order in compliance, Y = J,
    Pose,
    /// its deflection alone,
    Deflection,
    /// and what the joints' own deflections move it by: what is left where the nominal ones are compensated.
    Uncompensated,
}

impl SweepPose<'_> {
    fn is_first_order(&self) -> bool {
        self.shown != SweptForm::Rest
    }

    /// Whether the target's rigid motion counts.
    fn has_rigid_motion(&self) -> bool {
        matches!(self.shown, SweptForm::Rest | SweptForm::Pose)
    }

    /// The geometry of the tool that the load acts at.
    fn loaded(&self) -> &KinematicState {
        self.hook.map_or(self.state, |(_, hook)| hook)
    }

    /// Whether the load hangs on a tool that is another than the target.
    fn hangs_on(&self, tool: usize) -> bool {
        (self.hook).is_some_and(|(hook, _)| *hook == Hook::Tool(tool))
    }

    fn is_uncompensated(&self) -> bool {
        self.shown == SweptForm::Uncompensated
    }

    /// By how much a joint is made to stand elsewhere to make up for passive joints, or does so itself.
    fn made_up(&self, joint: usize) -> f64 {
        self.made_up.map_or(0.0, |all| all[joint])
    }
}

/// A motion of all that is beyond a place of the chain.
#[derive(Debug, Clone, Copy)]
struct Twist {
    velocity: Vector3<f64>,
    omega: Vector3<f64>,
}

impl Twist {
    fn translation(direction: Vector3<f64>) -> Self {
        Self {
            velocity: direction,
            omega: Vector3::zeros(),
        }
    }

    fn rotation(axis: Vector3<f64>, through: &Vector3<f64>) -> Self {
        Self {
            velocity: through.cross(&axis),
            omega: axis,
        }
    }

    fn at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.velocity + self.omega.cross(point)
    }
}

impl Sweep {
    /// Room for an arm, with the frames' axes at values of the parameters.
    pub fn new(set: &ParameterSet, nominal: &ElasticArm, values: &[f64]) -> Self {
        let joints = nominal.chain.len();
        let at = set.displacements(nominal, values);
        let links = nominal.chain.joints.iter().zip(&at.links);
        let tools = nominal.tools.iter().zip(&at.tools);
        Self {
            links: links
                .map(|(joint, at)| FrameAxes::new(&joint.previous_from_link, &at.rotation_rad))
                .collect(),
            tools: tools
                .map(|(tool, at)| FrameAxes::new(&tool.link_from_tool, &at.rotation_rad))
                .collect(),
            bases: (nominal.instrument_from_base.iter().zip(&at.bases))
                .map(|(base, at)| FrameAxes::new(base, &at.rotation_rad))
                .collect(),
            before: vec![Matrix3::identity(); joints + 1],
            response: DMatrix::zeros(joints, 6),
            columns: vec![Vector6::zeros(); joints],
            inner: vec![Matrix6x3::zeros(); joints + 1],
            outer: vec![Matrix6x3::zeros(); joints + 1],
            bent_before: vec![Vector3::zeros(); joints + 1],
            bent_from: vec![Vector3::zeros(); joints + 1],
        }
    }

    /// Writes the derivatives (6 x p, in the robot's base frame) of the target's position and of its
    /// orientation as an angular velocity; without rigid motion, of the deflection and its rotation
    /// vector. Parameters of the base are left out. Does not allocate.
    pub fn derivatives(&mut self, pose: &SweepPose<'_>, derivatives: &mut Matrix6xX<f64>) {
        self.orient(pose.state);
        for (joint, column) in self.columns.iter_mut().enumerate() {
            *column = if pose.is_first_order() {
                jacobian_column(pose.state, joint)
            } else {
                Vector6::from_fn(|row, _| self.response[(joint, row)])
            };
        }
        self.sum(pose);
        for (index, parameter) in pose.set.parameters().iter().enumerate() {
            let column = match parameter.kind {
                ParameterKind::JointCompliance { joint } => {
                    let factor = if parameter.is_logarithmic {
                        pose.belief.compliance_rad_per_nm[joint]
                    } else {
                        1.0
                    };
                    let column = self.columns[joint] * (pose.torque[joint] * factor);
                    if pose.leanings.is_none() {
                        column
                    } else {
                        column + self.of_law(pose, joint) * factor
                    }
                }
                ParameterKind::JointZero { joint } => self.of_zero(pose, joint),
                ParameterKind::JointWave { joint, wave } => self.of_wave(pose, joint, wave),
                ParameterKind::JointBacklash { joint } => {
                    self.of_leaning(pose, joint, |leaning| leaning.side)
                }
                ParameterKind::JointStiffening { joint } => {
                    self.of_leaning(pose, joint, |leaning| pose.belief.gives_by(joint, leaning))
                }
                ParameterKind::SpringStiffness { spring } => {
                    let nominal = &pose.chain.elements.springs[spring];
                    let (tension, stiffness) = Self::tension(pose, spring);
                    let stretched = if stiffness == 0.0 {
                        0.0
                    } else {
                        tension / stiffness
                    };
                    let factor = if parameter.is_logarithmic {
                        nominal.stiffness_n_per_m
                    } else {
                        1.0
                    };
                    self.of_tension(pose, spring, stretched * factor)
                }
                ParameterKind::SpringRest { spring } => {
                    let (_, stiffness) = Self::tension(pose, spring);
                    self.of_tension(pose, spring, -stiffness)
                }
                ParameterKind::LinkPosition { link, axis } => {
                    let direction =
                        self.before[link] * self.links[link].displacement.column(axis.index());
                    self.beyond(pose, link, &Twist::translation(direction))
                }
                ParameterKind::LinkRotation { link, axis } => {
                    let about = self.before[link] * self.links[link].rotation.column(axis.index());
                    self.beyond(
                        pose,
                        link,
                        &Twist::rotation(about, &pose.state.anchor[link]),
                    )
                }
                ParameterKind::ToolPosition { tool, axis } if tool == pose.target => {
                    let direction = self.tool_axis(pose.state, tool, axis);
                    self.of_tool(pose, &Twist::translation(direction))
                }
                ParameterKind::ToolRotation { tool, axis } if tool == pose.target => {
                    let joints = pose.state.tool_joints;
                    let about =
                        self.before[joints] * self.tools[tool].rotation.column(axis.index());
                    self.of_tool(pose, &Twist::rotation(about, &pose.state.tool_position))
                }
                ParameterKind::ToolPosition { tool, axis } if pose.hangs_on(tool) => {
                    let moved = self.tool_axis(pose.loaded(), tool, axis);
                    self.inner[pose.loaded().tool_joints] * moved.cross(&pose.load.force_n)
                }
                ParameterKind::LinkMass { link } => self.of_mass(pose, &mass_of_link(pose, link)),
                ParameterKind::LinkCentre { link, axis } => {
                    self.of_centre(pose, &mass_of_link(pose, link), axis)
                }
                ParameterKind::PayloadMass => (pose.belief.payload)
                    .map_or_else(Vector6::zeros, |payload| self.of_mass(pose, &payload)),
                ParameterKind::PayloadCentre { axis } => (pose.belief.payload)
                    .map_or_else(Vector6::zeros, |payload| {
                        self.of_centre(pose, &payload, axis)
                    }),
                ParameterKind::LoadScale
                | ParameterKind::LoadOffset
                | ParameterKind::TaskScale
                | ParameterKind::TaskForce { .. } => self.of_load_parameter(pose, parameter.kind),
                ParameterKind::ToolPosition { .. }
                | ParameterKind::ToolRotation { .. }
                | ParameterKind::BasePosition { .. }
                | ParameterKind::BaseRotation { .. }
                | ParameterKind::Drift { .. } => Vector6::zeros(),
            };
            derivatives.set_column(index, &column);
        }
    }

    /// What more of a joint's commanded angle moves.
    fn of_zero(&self, pose: &SweepPose<'_>, joint: usize) -> Vector6<f64> {
        let (axis, anchor) = (pose.state.axis[joint], &pose.state.anchor[joint]);
        let twist = if pose.state.slides[joint] {
            Twist::translation(axis)
        } else {
            Twist::rotation(axis, anchor)
        };
        self.beyond(pose, joint, &twist) + self.of_joint_springs(pose, joint)
    }

    /// What more of what a joint stands off its spring by moves: the joint, by so much. Without rigid motion, where a
    /// deflection is seen, besides by how much more that is than without the load.
    fn of_leaning(
        &self,
        pose: &SweepPose<'_>,
        joint: usize,
        by: impl Fn(&Leaning) -> f64,
    ) -> Vector6<f64> {
        let Some(leanings) = pose.leanings else {
            return Vector6::zeros();
        };
        let [here, unloaded] = leanings.map(|all| by(&all[joint]));
        // Before the load acts it stands off its spring, too; what that adds is compensated.
        let before = if pose.is_uncompensated() {
            unloaded
        } else {
            here
        };
        let mut column = self.of_zero(pose, joint) * before;
        if !pose.has_rigid_motion() {
            column += jacobian_column(pose.state, joint) * (here - unloaded);
        }
        column
    }

    /// What more of a joint's compliance moves by what the joint gives besides its spring, which grows with it.
    #[cold]
    fn of_law(&self, pose: &SweepPose<'_>, joint: usize) -> Vector6<f64> {
        let law = &pose.belief.stiffening[joint];
        self.of_leaning(pose, joint, |leaning| {
            law.beside_spring(1.0, leaning.torque_nm)
        })
    }

    /// What more of a wave in a joint's gear moves. Where the joint is commanded back by what its spring gives, the gear errs by more
    /// or less.
    fn of_wave(&self, pose: &SweepPose<'_>, joint: usize, wave: GearWave) -> Vector6<f64> {
        let here = wave.at(pose.asked_rad[joint]);
        let mut column = self.of_zero(pose, joint) * here;
        if pose.is_uncompensated() {
            let back =
                pose.belief.compliance_rad_per_nm[joint] * pose.torque[joint] - pose.made_up(joint);
            let there = wave.at(pose.asked_rad[joint] - back);
            column += jacobian_column(pose.state, joint) * (there - here);
        }
        column
    }

    /// The twists of the base in the instrument's frame, for a target there: displacement directions
    /// as columns, rotation axes as columns, and where these go through.
    pub fn base_axes(&self, station: usize) -> (&Matrix3<f64>, &Matrix3<f64>) {
        let base = &self.bases[station];
        (&base.displacement, &base.rotation)
    }

    fn orient(&mut self, state: &KinematicState) {
        for (matrix, before) in self.before.iter_mut().zip(&state.before) {
            *matrix = before.to_rotation_matrix().into_inner();
        }
    }

    /// How far a joint stands off its spring under the load and not without it, where that is seen beside its deflection (rad).
    fn crossed(pose: &SweepPose<'_>, joint: usize) -> f64 {
        match pose.leanings {
            Some(leanings) if !pose.has_rigid_motion() => {
                let [here, unloaded] = leanings.map(|all| pose.belief.leans_by(joint, &all[joint]));
                here - unloaded
            }
            _ => 0.0,
        }
    }

    fn sum(&mut self, pose: &SweepPose<'_>) {
        let (state, joints) = (pose.state, pose.torque.len());
        let compliance = &pose.belief.compliance_rad_per_nm;
        for (joint, &compliance) in compliance.iter().enumerate() {
            // How a joint stands off where it would: of what is compensated that which makes up for passive joints remains.
            let off = if pose.is_uncompensated() {
                pose.made_up(joint)
            } else {
                compliance * pose.torque[joint] + Self::crossed(pose, joint)
            };
            let moved = self.columns[joint] * compliance;
            self.inner[joint + 1] = self.inner[joint] + moved * state.turning[joint].transpose();
            self.bent_before[joint + 1] =
                self.bent_before[joint] + state.rotation_column(joint) * off;
            self.bent_from[joint] = state.position_column(joint) * off;
        }
        let loaded = pose.loaded();
        for joint in (0..joints).rev() {
            let moved = self.columns[joint] * compliance[joint];
            let turned = loaded.position_column(joint).cross(&pose.load.force_n)
                + loaded.rotation_column(joint).cross(&pose.load.torque_nm)
                + state.weight_moment(joint, pose.gravity_m_s2);
            self.outer[joint] = self.outer[joint + 1] + moved * turned.transpose();
            let beyond = self.bent_from[joint + 1];
            self.bent_from[joint] += beyond;
        }
    }

    /// What more of the loads moves: of those of readings, or, where the task's are compensated, of these.
    fn of_load_parameter(&self, pose: &SweepPose<'_>, kind: ParameterKind) -> Vector6<f64> {
        let force = |force_n| Load {
            force_n,
            torque_nm: Vector3::zeros(),
        };
        let load = match (kind, pose.is_uncompensated()) {
            (ParameterKind::LoadScale, false) | (ParameterKind::TaskScale, true) => *pose.load,
            (ParameterKind::LoadOffset, false) => force(along(pose.load) * pose.belief.load_scale),
            (ParameterKind::TaskForce { axis }, true) => force(Vector3::ith(axis.index(), 1.0)),
            _ => return Vector6::zeros(),
        };
        self.of_load(pose, &load)
    }

    /// What more of a load moves.
    fn of_load(&self, pose: &SweepPose<'_>, load: &Load) -> Vector6<f64> {
        let mut column = Vector6::zeros();
        for joint in 0..pose.torque.len() {
            let torque = pose.loaded().load_torque(joint, load);
            let compliance = pose.belief.compliance_rad_per_nm[joint];
            column += self.columns[joint] * (torque * compliance);
        }
        column
    }

    /// The tension of a spring (N) and its stiffness (N/m) there; nothing to first order in compliance.
    fn tension(pose: &SweepPose<'_>, spring: usize) -> (f64, f64) {
        if pose.is_first_order() {
            return (0.0, 0.0);
        }
        let elements = &pose.chain.elements;
        elements.springs[spring].tension(elements.length_m(spring, pose.state))
    }

    /// What more tension of a spring (N) moves.
    fn of_tension(&self, pose: &SweepPose<'_>, spring: usize, tension: f64) -> Vector6<f64> {
        let mut column = Vector6::zeros();
        if tension != 0.0 {
            for joint in 0..pose.torque.len() {
                let torque = tension * pose.chain.elements.pull(spring, pose.state, joint);
                let compliance = pose.belief.compliance_rad_per_nm[joint];
                column += self.columns[joint] * (torque * compliance);
            }
        }
        column
    }

    /// What the springs beside a joint's own change where it is moved.
    fn of_joint_springs(&self, pose: &SweepPose<'_>, joint: usize) -> Vector6<f64> {
        if pose.is_first_order() {
            return Vector6::zeros();
        }
        let springs = pose.chain.elements.joint_springs.iter();
        let stiffness: f64 = springs
            .filter(|spring| spring.joint == joint)
            .map(|spring| spring.stiffness)
            .sum();
        let compliance = pose.belief.compliance_rad_per_nm[joint];
        self.columns[joint] * (-stiffness * compliance)
    }

    /// What a twist of all from joint m on changes by the places of springs that it moves.
    fn of_places(&self, pose: &SweepPose<'_>, m: usize, twist: &Twist) -> Vector6<f64> {
        let mut column = Vector6::zeros();
        if pose.is_first_order() || pose.chain.elements.springs.is_empty() {
            return column;
        }
        let motion = Motion {
            joints: m,
            velocity: twist.velocity,
            omega: twist.omega,
        };
        let mut change = vec![0.0; pose.torque.len()];
        (pose.chain.elements).add_change(pose.state, &motion, &mut change);
        for (joint, torque) in change.iter().enumerate() {
            let compliance = pose.belief.compliance_rad_per_nm[joint];
            column += self.columns[joint] * (torque * compliance);
        }
        column
    }

    /// A twist of all from joint m on.
    fn beyond(&self, pose: &SweepPose<'_>, m: usize, twist: &Twist) -> Vector6<f64> {
        let state = pose.state;
        let carried = twist.at(&state.distal_centre[m]) * state.distal_mass[m];
        let mut moment = carried.cross(pose.gravity_m_s2);
        let mut column = self.outer[m] * twist.omega;
        let loaded = pose.loaded();
        if m < loaded.tool_joints {
            moment += (twist.at(&loaded.tool_position)).cross(&pose.load.force_n);
        }
        if m < state.tool_joints {
            column += self.rigidly(pose, m, &twist.at(&state.tool_position), &twist.omega);
        }
        column + self.inner[m] * moment + self.of_places(pose, m, twist)
    }

    /// An axis of a tool's displacement in the base frame, where the tool is.
    fn tool_axis(&self, state: &KinematicState, tool: usize, axis: Axis) -> Vector3<f64> {
        self.before[state.tool_joints] * self.tools[tool].displacement.column(axis.index())
    }

    fn of_tool(&self, pose: &SweepPose<'_>, twist: &Twist) -> Vector6<f64> {
        let m = pose.state.tool_joints;
        let moved = twist.at(&pose.state.tool_position);
        let column = self.rigidly(pose, m, &moved, &twist.omega);
        match pose.hook {
            Some(_) => column,
            None => column + self.inner[m] * moved.cross(&pose.load.force_n),
        }
    }

    /// The target's own motion, and that of its Jacobian where the deflection is J delta.
    fn rigidly(
        &self,
        pose: &SweepPose<'_>,
        m: usize,
        moved: &Vector3<f64>,
        omega: &Vector3<f64>,
    ) -> Vector6<f64> {
        let (mut position, mut rotation) = if pose.has_rigid_motion() {
            (*moved, *omega)
        } else {
            (Vector3::zeros(), Vector3::zeros())
        };
        if matches!(pose.shown, SweptForm::Pose | SweptForm::Deflection) || pose.made_up.is_some() {
            let before = self.bent_before[m];
            position += omega.cross(&self.bent_from[m]) + before.cross(moved);
            // The orientation is exp(phi) R, phi = sum z_j delta_j: its angular velocity is
            // dphi + omega + phi x omega, and dphi that of the joints from m on, which turn.
            rotation += if pose.has_rigid_motion() {
                before.cross(omega)
            } else {
                omega.cross(&(self.bent_before[pose.torque.len()] - before))
            };
        }
        let [px, py, pz] = position.into();
        let [rx, ry, rz] = rotation.into();
        Vector6::new(px, py, pz, rx, ry, rz)
    }

    /// What a mass on a link, or the link's own, changes where it grows by a share of it.
    fn of_mass(&self, pose: &SweepPose<'_>, mass: &Payload) -> Vector6<f64> {
        let mut column = Vector6::zeros();
        let link = mass.link;
        let mut origin = pose.state.anchor[link];
        if pose.state.slides[link] {
            origin += pose.state.axis[link] * pose.q[link];
        }
        let centre = origin + self.before[link + 1] * mass.centre_of_mass_m;
        for joint in 0..=link {
            let moved = pose.state.moves(joint, link + 1, &centre);
            let torque = moved.dot(pose.gravity_m_s2);
            let compliance = pose.belief.compliance_rad_per_nm[joint];
            column += self.columns[joint] * (torque * compliance * mass.mass_kg);
        }
        column
    }

    /// What it changes where its centre moves along an axis of the link.
    fn of_centre(&self, pose: &SweepPose<'_>, mass: &Payload, axis: Axis) -> Vector6<f64> {
        let moved = self.before[mass.link + 1].column(axis.index()).into_owned();
        self.inner[mass.link + 1] * (moved.cross(pose.gravity_m_s2) * mass.mass_kg)
    }
}

/// What a link weighs by itself.
fn mass_of_link(pose: &SweepPose<'_>, link: usize) -> Payload {
    let joint = &pose.belief.chain.joints[link];
    Payload {
        link,
        mass_kg: joint.mass_kg,
        centre_of_mass_m: joint.centre_of_mass_m,
    }
}
