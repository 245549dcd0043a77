//! elastocal: a virtual calibration testbed for the joint stiffness of industrial robots.
//!
//! A heavy robot bends under its task load. To compensate, its controller needs each joint's
//! compliance, which is identified by hanging loads on the robot and measuring how the tool
//! deflects. Which configurations and loads to measure decides how good the compensation gets.
//! This crate designs such plans for the pose where the robot must work (the test pose), tries them
//! on a virtual robot in MuJoCo, identifies, compensates, and compares.
//!
//! # The problem in equations
//!
//! After A. Klimchik, A. Pashkevich, Y. Wu, S. Caro, B. Furet, *Design of calibration experiments
//! for identification of manipulator elastostatic parameters*, Journal of Mechanics Engineering and
//! Automation 2 (2012) 531-542; the equation numbers are that paper's.
//!
//! ```text
//! K_C = J^-T K_theta J^-1                                   Cartesian stiffness          (1)
//! dt  = J k_theta J^T W                                     deflection under a wrench    (2)
//! dt  = A k,   A = [J_1 J_1^T W, ..., J_n J_n^T W]          the same, linear in k        (3, 4)
//! dp  = A^(p) k                                             its position rows            (7, 8)
//! k^  = (sum A^(p)T A^(p))^-1 sum A^(p)T dp                 identification               (9)
//! k^  = k_0 + (sum A^(p)T A^(p))^-1 sum A^(p)T eps         its error                    (10, 11)
//! cov(k^) = sigma^2 (sum A^(p)T A^(p))^-1                   its covariance               (12, 13)
//! q   = q_0 - k_theta J_0^T W_0                             compensation                 (15)
//! rho_0^2 = sigma^2 trace(A_0 (sum A^(p)T A^(p))^-1 A_0^T)  residual error, mean square (16 to 20)
//! rho_0 -> min over {q_i, W_i}                              the plan                     (21, 22)
//! ```
//!
//! Deflections of a real robot are not linear in k: the virtual robot, the non-linear
//! identification and the non-linear compensation solve the static equilibrium
//! `q = q_commanded + k tau(q)` with gravity instead of eq. 2.
//!
//! # How the data flows
//!
//! Each module uses only those that stand before it.
//!
//! - [`quantities`], [`text`], [`codes`], [`files`], [`csv`]: what every stage needs to read and to print: ranges and
//!   units, names and words, stable codes of conditions and errors, whole files, tables.
//! - [`numeric`]: identifiable subspace, least squares, posterior; random
//!   streams. It knows of no robot.
//! - [`mujoco`]: MJCF models in MuJoCo; the only user of the simulator's bindings.
//! - [`robot`]: the serial chain read from the model; Jacobians, elastostatics, static equilibrium.
//! - [`parameter`]: kinds of parameters, priors, error sources with their levels, and what is unidentifiable.
//! - [`experiment`]: plans of experiments, their files, and the set of loads that they may use.
//! - [`observation`]: readings, predicted with derivatives by any parameters.
//! - [`task`]: the planner's model, what must be accurate (the quantity of interest), and which experiments may
//!   be made.
//! - [`measurement`]: measured deflections, the laboratory's or the virtual robot's.
//! - [`testbed`]: the simulated truth: the virtual robot in MuJoCo, and its instrument.
//! - [`identification`]: compliances with their uncertainty, and what cannot be identified; the file of what was.
//! - [`compensation`]: the joint angles to command at a test pose.
//! - [`plan`]: predicted accuracy of plans with its uncertainty budget, feasibility, and [`plan::search`] for the best one with
//!   its certificate.
//! - [`laboratory`]: a plan as it is carried out: the order of its stops, the ways there, the minutes, and the
//!   robot's program.
//! - [`calibration`]: the whole loop once.
//! - [`study`]: Monte Carlo.
//! - [`gate`]: how much worse results may get.
//! - [`scenario`]: one TOML file becomes a checked [`Scenario`](scenario::Scenario), in SI units: the task,
//!   the truth, a study, a gate. Only what follows knows all of them.
//! - [`understanding`]: the robot as a scenario was understood, and what is implausible about it.
//! - [`record`]: results as JSON records, and tallies of studies as files.
//! - [`workflow`]: the use cases, run, plan, study and identify; they print nothing.
//! - [`paper`]: the published numbers, and the same by this program.
//! - [`comparison`]: two results files against the gate.
//! - [`view`]: recordings, pages and pictures of records; computes nothing. It is there with the feature
//!   `view`, which is on by default.
//! - [`cli`]: the command line, which the program and the Python package run.
//!
//! # Invariants
//!
//! - Identification and planning see a [`Belief`](task::Belief) and measurements, never the
//!   [`Truth`](testbed::Truth).
//! - One MJCF file is the only source of a robot's geometry and masses.
//! - Nothing in a model that can move the robot's rest is ignored silently: it is honoured, or
//!   refused by name.
//! - Random numbers are a function of the seed and the run alone, and results do not depend on the
//!   number of threads, to the bit.
//! - What cannot be determined is named, and is no number: `None` here, `null` in JSON.
//! - An output file is whole or not there.
//!
//! # Notation
//!
//! | paper | here | unit |
//! |---|---|---|
//! | q, q_0 | `configuration_rad` | rad |
//! | W = (F, T) | [`robot::Load`] | N, N m; world frame |
//! | J | [`robot::KinematicState::jacobian`] | m, 1; world frame |
//! | k, k_theta | `compliance_rad_per_nm` | rad/(N m) |
//! | A, A^(p), A^(phi) | [`robot::ObservationMatrix`] | m N m/rad |
//! | A_0^(p) | [`compensation::test_pose_matrix`] | m N m/rad |
//! | dp | `deflection_m` | m; loaded minus unloaded |
//! | sigma | `sigma_m`: of each coordinate of a deflection | m |
//! | sum A^T A | `information` | m^2 (N m/rad)^2; relative units in the search |
//! | cov(k) | [`numeric::posterior::Posterior::covariance`] | (rad/(N m))^2 |
//! | rho_0 | `rho0_m`, `predicted_m` | m |
//! | m | `experiments`: measurements, repeats counted | |
//!
//! # The whole loop
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use elastocal::calibration::calibrate;
//! use elastocal::plan::Criterion;
//! use elastocal::plan::search::{Bound, PlanSize, Problem, Watch, approximate_design, exact_design};
//! use elastocal::scenario::Scenario;
//!
//! let scenario = Scenario::load("scenarios/klimchik2012.toml".as_ref())?;
//! let (task, truth, seed) = (&scenario.task, &scenario.truth, scenario.seed);
//! let mut problem = Problem::new(task, Criterion::TestPose);
//! problem.effort.searches = 8; // a quick search
//! let approximate = approximate_design(&problem, seed)?;
//! let watch = Watch { stop: &AtomicBool::new(false), progress: &|_, _, _| {} };
//! let best = exact_design(&problem, &approximate, PlanSize::all_different(4), seed, watch, &[])?;
//! let calibration = calibrate(task, truth, &best.plan, seed, 0)?;
//! let pose = &calibration.poses[0];
//! let no_plan_is_below_m = Bound::new(task, &approximate).of_plan(&best.plan)?.best;
//! assert!(best.cost.sqrt() >= no_plan_is_below_m);
//! assert!(pose.seen.residual_m.norm() < 0.05 * pose.seen.uncompensated_m.norm());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![expect(clippy::doc_markdown, reason = "the paper's symbols")]

pub mod calibration;
pub mod cli;
pub mod codes;
pub mod comparison;
pub mod compensation;
pub mod csv;
pub mod experiment;
pub mod files;
pub mod gate;
pub mod identification;
pub mod laboratory;
pub mod measurement;
pub mod mujoco;
pub mod numeric;
pub mod observation;
pub mod paper;
pub mod parameter;
pub mod plan;
pub mod quantities;
pub mod record;
pub mod robot;
pub mod scenario;
pub mod study;
pub mod task;
pub mod testbed;
pub mod text;
pub mod understanding;
pub mod view;
pub mod workflow;

/// The version of elastocal.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The commit that it was built from, with "-dirty" where its sources had been changed since.
pub const COMMIT: &str = env!("ELASTOCAL_COMMIT");
