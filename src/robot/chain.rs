//! The serial kinematic chain with rigid links, independent of any simulator.

use std::f64::consts::TAU;

use nalgebra::{DVector, Isometry3, Point3, Rotation3, Unit, UnitQuaternion, Vector3};

use super::elements::Elements;
use super::kinematic_state::{KinematicState, Kinematics};

/// How a joint moves, and what holds it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drive {
    /// Whether it slides along its axis instead of turning about it: its coordinate is then in metres,
    /// its torque a force in newtons, and its compliance in m/N.
    pub slides: bool,
    /// Where the spring of a passive joint, which nothing commands, is relaxed (rad or m).
    pub passive_at: Option<f64>,
}

impl Drive {
    /// The unit of its coordinate.
    pub const fn unit(self) -> &'static str {
        if self.slides { "m" } else { "rad" }
    }

    /// The unit of its compliance.
    pub const fn compliance_unit(self) -> &'static str {
        if self.slides { "m/N" } else { "rad/(N m)" }
    }

    /// A coordinate, or a difference of two, as a person reads it: in degrees, or in millimetres where the
    /// joint slides.
    pub fn shown(self, value: f64) -> (f64, &'static str) {
        if self.slides {
            (value * 1e3, "mm")
        } else {
            (value.to_degrees(), "deg")
        }
    }
}

/// One joint, hinge or slide, and the rigid link that it moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// The joint's name in the model.
    pub name: String,
    /// The link's frame in that of the previous link (the world for the first) at zero angle; its
    /// origin lies on the axis.
    pub previous_from_link: Isometry3<f64>,
    /// How it moves, and what holds it.
    pub drive: Drive,
    /// The axis in the link's frame, about which a positive angle turns right-handed.
    pub axis: Unit<Vector3<f64>>,
    /// Lower and upper limit (rad).
    pub range_rad: [f64; 2],
    /// Mass of the link with all that is fixed to it, as far as it weighs on the arm (kg).
    pub mass_kg: f64,
    /// Centre of that mass in the link's frame (m).
    pub centre_of_mass_m: Vector3<f64>,
    /// The compliance that the model gives the joint (rad/(N m)), if it gives one.
    pub model_compliance_rad_per_nm: Option<f64>,
}

impl Joint {
    /// The middle of the turn (rad) in which its angle counts for what comes again in each turn, where its range allows more than one: that
    /// of its range.
    pub fn turn_about(&self) -> Option<f64> {
        let [low, high] = self.range_rad;
        let has_several = !self.drive.slides && high - low > TAU * (1.0 + 1e-9);
        has_several.then(|| f64::midpoint(low, high))
    }

    /// The period of what comes again in each turn (rad), where its range allows more than one.
    pub fn period(&self) -> Option<f64> {
        self.turn_about().map(|_| TAU)
    }

    /// The same place (rad; m where it slides) in that turn.
    pub fn in_turn(&self, place: f64) -> f64 {
        nearest_turn(place, self.turn_about())
    }

    /// The same angle by whole turns as near another one as can be in a range (rad), or next to the range if it has none; a slide's stays.
    pub fn turned_into(&self, [low, high]: [f64; 2], angle: f64, near: f64) -> f64 {
        if self.drive.slides {
            return angle;
        }
        let nearest = angle + TAU * ((near - angle) / TAU).round();
        let above = nearest + TAU * ((low - nearest) / TAU).ceil().max(0.0);
        let below = nearest - TAU * ((nearest - high) / TAU).ceil().max(0.0);
        let beyond = |angle: f64| (low - angle).max(angle - high).max(0.0);
        let turns = [nearest, above, above - TAU, below, below + TAU];
        let best = turns.into_iter();
        (best.min_by(|one, other| beyond(*one).total_cmp(&beyond(*other)))).unwrap_or(nearest)
    }
}

/// An angle (rad) on the turn about some middle, if there is one, from half a turn below it.
pub fn nearest_turn(angle: f64, about: Option<f64>) -> f64 {
    about.map_or(angle, |middle| {
        let low = middle - 0.5 * TAU;
        low + (angle - low).rem_euclid(TAU)
    })
}

/// A frame fixed to a link, such as a tool centre point.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// The name of the site in the model.
    pub name: String,
    /// How many joints move it.
    pub joints: usize,
    /// Its frame in that of the link that carries it.
    pub link_from_tool: Isometry3<f64>,
}

/// An arm of joints in series.
#[derive(Debug, Clone, PartialEq)]
pub struct SerialChain {
    /// The joints from the base to the flange.
    pub joints: Vec<Joint>,
    /// The acceleration of gravity in the world frame (m/s^2).
    pub gravity_m_s2: Vector3<f64>,
    /// Springs and constant forces beside the joints' own elasticity.
    pub elements: Elements,
}

impl SerialChain {
    /// The way from the first joint to a tool along the links (m).
    pub fn reach_m(&self, tool: &Tool) -> f64 {
        let links = self.joints[..tool.joints].iter().skip(1);
        links
            .map(|joint| joint.previous_from_link.translation.vector.norm())
            .sum::<f64>()
            + tool.link_from_tool.translation.vector.norm()
    }

    /// The joint of which two configurations (rad; m where it slides) differ most, and by how much: after a whole turn the arm stands alike.
    pub fn largest_difference(&self, one: &[f64], other: &[f64]) -> (usize, f64) {
        let pairs = one.iter().zip(other).zip(&self.joints).enumerate();
        let apart = pairs.map(|(place, ((one, other), joint))| {
            let way = one - other;
            let turns = if joint.drive.slides {
                0.0
            } else {
                (way / TAU).round()
            };
            (place, (way - turns * TAU).abs())
        });
        apart.fold(
            (0, 0.0),
            |most, next| if next.1 > most.1 { next } else { most },
        )
    }

    /// The number of joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Whether the chain has no joint.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// The joints that are commanded, as indices.
    pub fn commanded(&self) -> impl Iterator<Item = usize> {
        let joints = self.joints.iter().enumerate();
        joints
            .filter(|(_, joint)| joint.drive.passive_at.is_none())
            .map(|(index, _)| index)
    }

    /// Whether some joint is not commanded.
    pub fn has_passive(&self) -> bool {
        self.commanded().count() < self.len()
    }

    /// Whether all joints are hinges that are commanded, and nothing else is elastic: the arm of the paper.
    pub fn is_plain(&self) -> bool {
        self.elements.is_empty()
            && (self.joints.iter()).all(|joint| joint.drive == Drive::default())
    }

    /// A configuration, far from those of other numbers: an additive recurrence with roots of primes.
    pub fn spread(&self, number: usize) -> DVector<f64> {
        const PRIMES: [f64; 8] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0];
        let joints = self.joints.iter().enumerate().map(|(index, joint)| {
            let root = (PRIMES[index % PRIMES.len()] + (index / PRIMES.len()) as f64 * 0.1).sqrt();
            let share = (number as f64 * root).fract();
            let [low, high] = joint.range_rad;
            low + share * (high - low)
        });
        DVector::from_iterator(self.len(), joints)
    }

    /// The chain as seen from one of its tools.
    pub fn at<'a>(&'a self, tool: &'a Tool) -> ChainAtTool<'a> {
        ChainAtTool { chain: self, tool }
    }
}

/// A chain together with the tool whose pose is asked for.
#[derive(Debug, Clone, Copy)]
pub struct ChainAtTool<'a> {
    chain: &'a SerialChain,
    tool: &'a Tool,
}

impl ChainAtTool<'_> {
    /// The kinematic state at the joint angles `q` (rad).
    pub fn state(mut self, q: &[f64]) -> KinematicState {
        let mut state = KinematicState::new(self.chain.len());
        self.update(q, &mut state);
        state
    }
}

impl Kinematics for ChainAtTool<'_> {
    fn gravity_m_s2(&self) -> Vector3<f64> {
        self.chain.gravity_m_s2
    }

    fn is_plain(&self) -> bool {
        self.chain.is_plain()
    }

    fn elements(&self) -> &Elements {
        &self.chain.elements
    }

    fn update(&mut self, q: &[f64], state: &mut KinematicState) {
        let mut world_from_link = Isometry3::identity();
        let mut hinges = self
            .chain
            .joints
            .iter()
            .map(|joint| joint.drive == Drive::default());
        state.first_axis = hinges.position(|is_commanded| is_commanded).unwrap_or(0);
        let elements = &self.chain.elements;
        let has_springs = !elements.springs.is_empty();
        if has_springs {
            state.places.clear();
            state
                .places
                .extend(elements.places().map(|place| place.position_m));
        }
        let mut world_from_tool = self.tool.link_from_tool;
        for (index, (joint, &angle)) in self.chain.joints.iter().zip(q).enumerate() {
            state.before[index] = world_from_link.rotation;
            world_from_link *= joint.previous_from_link;
            let axis = world_from_link.rotation * joint.axis.into_inner();
            let slides = joint.drive.slides;
            state.place_joint(index, slides, axis, world_from_link.translation.vector);
            if slides {
                world_from_link.translation.vector += axis * angle;
            } else {
                world_from_link.rotation *= UnitQuaternion::from_axis_angle(&joint.axis, angle);
            }
            if has_springs {
                for (place, position) in elements.places().zip(&mut state.places) {
                    if place.joints == index + 1 {
                        *position = (world_from_link * Point3::from(place.position_m)).coords;
                    }
                }
            }
            state.distal_mass[index] = joint.mass_kg;
            state.distal_centre[index] = world_from_link.rotation * joint.centre_of_mass_m
                + world_from_link.translation.vector;
            if index + 1 == self.tool.joints {
                world_from_tool = world_from_link * self.tool.link_from_tool;
            }
        }
        state.before[self.chain.len()] = world_from_link.rotation;
        state.gather_distal_masses();
        state.place_tool(
            self.tool.joints,
            world_from_tool.translation.vector,
            Rotation3::from(world_from_tool.rotation).into_inner(),
        );
        state.feel(elements, q);
    }
}
