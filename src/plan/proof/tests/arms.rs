//! Enclosures and proofs against single experiments, computed with plain matrices.

use nalgebra::{Matrix3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3};

use super::bound::{Ingredients, Target};
use super::branching::{NoProof, ProofLimits, Proved, prove, tasks};
use super::enclosure::{Cell, ProofTask};
use super::judgement::judge;
use super::polynomial::Polynomial;
use super::question::{Arm, ProofJoint, ProofLoads, Question, ReadingSpread, SmoothRegion};
use super::taylor::{LANES, ModelWorkspace};
use super::tests::Random;

const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

fn joint(offset_m: [f64; 3], axis: [f64; 3], range_deg: [f64; 2]) -> ProofJoint {
    ProofJoint {
        offset_m,
        rotation: UPRIGHT,
        axis,
        range_rad: range_deg.map(f64::to_radians),
    }
}

/// An arm like the KR-270, whose loads hang on the tool.
fn heavy_arm() -> Question {
    let joints = vec![
        joint([0.0; 3], [0.0, 0.0, -1.0], [-185.0, 185.0]),
        joint([0.35, 0.0, 0.75], [0.0, 1.0, 0.0], [-146.0, 0.0]),
        joint([1.25, 0.0, 0.0], [0.0, 1.0, 0.0], [-119.0, 155.0]),
        joint([1.1, 0.0, -0.055], [-1.0, 0.0, 0.0], [-350.0, 350.0]),
        joint([0.0; 3], [0.0, 1.0, 0.0], [-125.0, 125.0]),
        joint([0.0; 3], [-1.0, 0.0, 0.0], [-350.0, 350.0]),
    ];
    Question {
        arm: Arm {
            joints,
            tool_joints: 6,
            tool_offset_m: [0.6, 0.0, -0.46],
            tool_rotation: UPRIGHT,
        },
        parameters: vec![1, 2, 3, 4, 5],
        rows: vec![
            vec![1.0, -2.0, 0.5, 3.0, 1.0],
            vec![0.3, 0.2, 4.0, -2.0, 5.0],
            vec![-1.0, 1.0, 1.0, 2.0, -1.0],
        ],
        region: SmoothRegion {
            height_m: [Some(0.8), None],
            radius_m: [Some(0.6), Some(2.5)],
            elevation_sine: Some(0.5),
        },
        loads: ProofLoads::OneOf(vec![[0.0, 0.0, -2.5, 0.0, 0.0, 0.0]]),
        spread: None,
    }
}

/// The same where joints return as they like, and loads hang as they like.
fn with_spread(question: Question, random: &mut Random) -> Question {
    let joints = question.arm.joints.len();
    let mut sizes = |most: f64| -> Vec<f64> {
        let sizes = (0..joints).map(|_| most * random.number().max(0.0));
        sizes.collect()
    };
    Question {
        spread: Some(ReadingSpread {
            everywhere: 1.5,
            joint_repeatability: sizes(3.0),
            compliance_rad_per_nm: sizes(1.0),
            turned: 0.7,
            shifted: 0.9,
        }),
        ..question
    }
}

/// An arm of random joints in random frames, some of which are parallel.
fn random_arm(random: &mut Random, loads: ProofLoads) -> Question {
    let joints: Vec<ProofJoint> = (0..4)
        .map(|_| {
            let axes = [
                [0.0, 0.0, 1.0],
                [0.0, -1.0, 0.0],
                [0.0, 2.0, 0.0],
                random.vector(),
            ];
            let half = std::f64::consts::FRAC_1_SQRT_2;
            let turns = [UPRIGHT, UPRIGHT, [half, 0.0, 0.0, half], {
                let [x, y, z] = random.vector();
                [x, y, z, 1.0]
            }];
            ProofJoint {
                offset_m: random.vector(),
                rotation: turns[random.below(4)],
                axis: axes[random.below(4)],
                range_rad: [-2.0 + random.number(), 2.0 + random.number()],
            }
        })
        .collect();
    let [x, y, z] = random.vector();
    Question {
        arm: Arm {
            joints,
            tool_joints: 3 + random.below(2),
            tool_offset_m: random.vector(),
            tool_rotation: [x, y, z, 0.5],
        },
        parameters: vec![0, 1, 2],
        rows: (0..3).map(|_| random.vector().to_vec()).collect(),
        region: SmoothRegion {
            height_m: [Some(-0.5), Some(1.0)],
            radius_m: [Some(0.2), Some(1.5)],
            elevation_sine: Some(0.7),
        },
        loads,
        spread: None,
    }
}

/// The arm at one configuration, with plain matrices.
struct PlainPose {
    axes: Vec<Vector3<f64>>,
    anchors: Vec<Vector3<f64>>,
    tool: Vector3<f64>,
    tool_axis: Vector3<f64>,
    /// How the joints move and turn the tool.
    levers: Vec<Vector3<f64>>,
    turning: Vec<Vector3<f64>>,
}

fn pose(arm: &Arm, q: &[f64]) -> PlainPose {
    let turn = |[x, y, z, w]: [f64; 4]| {
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix()
    };
    let mut frame = Rotation3::identity();
    let mut origin = Vector3::zeros();
    let (mut axes, mut anchors) = (Vec::new(), Vec::new());
    let (mut tool, mut tool_axis) = (Vector3::zeros(), Vector3::z());
    for (index, joint) in arm.joints.iter().enumerate() {
        origin += frame * Vector3::from(joint.offset_m);
        frame *= turn(joint.rotation);
        let axis = Unit::new_normalize(Vector3::from(joint.axis));
        axes.push(frame * axis.into_inner());
        anchors.push(origin);
        frame *= Rotation3::from_axis_angle(&axis, q[index]);
        if index + 1 == arm.tool_joints {
            tool = origin + frame * Vector3::from(arm.tool_offset_m);
            tool_axis = frame * turn(arm.tool_rotation) * Vector3::z();
        }
    }
    let lever = |joint: usize| axes[joint].cross(&(tool - anchors[joint]));
    let of_tool =
        |joint: usize, vector: Vector3<f64>| vector * f64::from(u8::from(joint < arm.tool_joints));
    PlainPose {
        levers: (0..axes.len())
            .map(|joint| of_tool(joint, lever(joint)))
            .collect(),
        turning: (0..axes.len())
            .map(|joint| of_tool(joint, axes[joint]))
            .collect(),
        axes,
        anchors,
        tool,
        tool_axis,
    }
}

/// A column of the matrix of an experiment.
fn column(question: &Question, q: &[f64], load: &[f64; 6], joint: usize) -> Vector3<f64> {
    let pose = pose(&question.arm, q);
    let [force, torque] = [&load[..3], &load[3..]].map(Vector3::from_column_slice);
    pose.levers[joint] * (pose.levers[joint].dot(&force) + pose.turning[joint].dot(&torque))
}

/// R with plain matrices.
fn covariance(
    spread: &ReadingSpread,
    arm: &Arm,
    axes: &[Vector3<f64>],
    lever: &dyn Fn(usize) -> Vector3<f64>,
    force: &Vector3<f64>,
    torque: &Vector3<f64>,
) -> Matrix3<f64> {
    let mut covariance = Matrix3::identity() * spread.everywhere;
    let (mut turned, mut shifted) = (Matrix3::zeros(), Matrix3::zeros());
    for (joint, axis) in axes.iter().enumerate().take(arm.tool_joints) {
        let lever = lever(joint);
        covariance += lever * lever.transpose() * spread.joint_repeatability[joint].powi(2);
        let follows = lever * spread.compliance_rad_per_nm[joint];
        turned += follows * (force.cross(&lever) + torque.cross(axis)).transpose();
        shifted += follows * force.cross(axis).transpose();
    }
    covariance += turned * turned.transpose() * spread.turned.powi(2);
    covariance + shifted * shifted.transpose() * spread.shifted.powi(2)
}

/// One experiment with plain matrices: d (or the largest over all directions), and the margins.
fn experiment(question: &Question, q: &[f64], load: &[f64; 6]) -> (f64, Vec<f64>) {
    let arm = &question.arm;
    let PlainPose {
        axes,
        anchors,
        tool,
        tool_axis,
        levers,
        turning,
    } = pose(arm, q);
    let lever = |joint: usize| levers[joint];
    let [force, torque] = [&load[..3], &load[3..]].map(Vector3::from_column_slice);
    let turned_by = |joint: usize| levers[joint].dot(&force) + turning[joint].dot(&torque);
    let d = if let ProofLoads::AnyForce(size) = question.loads {
        let mut form = Matrix3::zeros();
        for row in &question.rows {
            let mut w = Matrix3::zeros();
            for (factor, &joint) in row.iter().zip(&question.parameters) {
                w += lever(joint) * lever(joint).transpose() * *factor;
            }
            form += w * w;
        }
        form.symmetric_eigenvalues().max() * size * size
    } else {
        let precision = (question.spread.as_ref())
            .and_then(|spread| {
                covariance(spread, arm, &turning, &lever, &force, &torque).try_inverse()
            })
            .unwrap_or_else(Matrix3::identity);
        let told = |row: &Vec<f64>| {
            let mut moved = Vector3::zeros();
            for (factor, &joint) in row.iter().zip(&question.parameters) {
                moved += lever(joint) * (turned_by(joint) * factor);
            }
            moved.dot(&(precision * moved))
        };
        question.rows.iter().map(told).sum()
    };
    let region = &question.region;
    let radius = axes[0].cross(&(tool - anchors[0])).norm();
    let [inner, outer] = region.radius_m;
    let mut margins = Vec::new();
    margins.extend(region.height_m[0].map(|low| tool.z - low));
    margins.extend(region.height_m[1].map(|high| high - tool.z));
    margins.extend(inner.map(|low| radius * radius - low * low));
    margins.extend(outer.map(|high| high * high - radius * radius));
    if let Some(sine) = region.elevation_sine {
        margins.extend([sine + tool_axis.z, sine - tool_axis.z]);
    }
    (d, margins)
}

/// A random point of a box: the angles of all joints, the load, and the point's coordinates.
fn point(
    task: &ProofTask<'_>,
    question: &Question,
    cell: &Cell,
    random: &mut Random,
) -> (Vec<f64>, [f64; 6]) {
    let coordinate: Vec<f64> = (0..task.variables())
        .map(|variable| cell.centre[variable] + task.half_width(cell, variable) * random.number())
        .collect();
    let mut q = Vec::new();
    let mut sum = 0.0;
    for joint in 0..question.arm.joints.len() {
        let link = task.links().get(joint);
        if link.is_none_or(|link| link.starts_run) {
            sum = 0.0;
        }
        let sign = link.map_or(1.0, |link| link.sign);
        let variable = task.domain.variable.get(joint).copied().flatten();
        let next = variable.map_or(sum, |variable| coordinate[variable]);
        q.push(sign * (next - sum));
        sum = next;
    }
    let load = match task.domain.load {
        super::domain::LoadCase::Wrench(wrench) => wrench,
        super::domain::LoadCase::Any(_) => [0.0; 6],
    };
    (q, load)
}

fn random_cell(task: &ProofTask<'_>, random: &mut Random) -> Cell {
    let mut cell = task.whole();
    for variable in 0..task.variables() {
        for _ in 0..random.below(9) {
            cell = task.halves(&cell, variable)[random.below(2)];
        }
    }
    cell
}

/// The bounds of a judgement, and the polynomials behind it, hold at random points.
fn assert_enclosed(question: &Question, boxes: usize, seed: u64) {
    let mut random = Random(seed);
    for mut task in tasks(question).unwrap_or_default() {
        let mut workspace = ModelWorkspace::new(task.variables());
        for middle in task.middles() {
            task.middle = middle;
            for _ in 0..boxes {
                let cells: [Cell; LANES] = std::array::from_fn(|_| random_cell(&task, &mut random));
                let threshold = 10.0_f64.powf(2.0 * random.number());
                let judgements = judge(&task, &mut workspace, &cells, LANES, threshold);
                let enclosure = task.enclose(&mut workspace, &cells, threshold);
                for (lane, (cell, judgement)) in cells.iter().zip(judgements).enumerate() {
                    for _ in 0..10 {
                        let (q, load) = point(&task, question, cell, &mut random);
                        let (d, margins) = experiment(question, &q, &load);
                        let inside = margins.iter().all(|margin| *margin >= 1e-9)
                            && task.is_within_limits(&q, 1e-9);
                        let bound = judgement.largest.max(threshold) * (1.0 + 1e-9) + 1e-9;
                        assert!(!inside || d <= bound, "{d} above {}", judgement.largest);
                        assert!(!inside || judgement.largest > f64::NEG_INFINITY);
                        for (model, truth) in enclosure.margins.iter().zip(&margins) {
                            let margin =
                                Polynomial::new(&workspace, *model, lane, task.variables());
                            // What is no number tells nothing.
                            let largest = margin.largest();
                            let bound = workspace.bound(*model)[lane];
                            assert!(
                                largest.is_nan() || largest >= truth - 1e-9,
                                "{truth} above {largest}: {question:?} at {q:?}"
                            );
                            assert!(bound.is_nan() || truth.abs() <= bound + 1e-9);
                        }
                    }
                }
            }
        }
    }
}

/// More than a hundred thousand experiments, so many times as `ENCLOSURES` says (`make enclosures`).
#[test]
fn boxes_enclose_the_experiments_of_arms() {
    let times = std::env::var("ENCLOSURES").ok();
    let times = times.and_then(|times| times.parse().ok()).unwrap_or(1);
    assert_enclosed(&heavy_arm(), 40 * times, 1);
    let mut question = heavy_arm();
    question.loads = ProofLoads::OneOf(vec![
        [0.0, 2.5, 0.0, 0.0, 0.0, 0.0],
        [1.0, 0.5, 0.0, 0.0, 0.3, 1.0],
    ]);
    assert_enclosed(&question, 30 * times, 2);
    question.loads = ProofLoads::AnyForce(2.5);
    assert_enclosed(&question, 30 * times, 3);
    let mut random = Random(5);
    assert_enclosed(&with_spread(heavy_arm(), &mut random), 30 * times, 6);
    for round in 0..40 {
        let [x, y, z] = random.vector();
        let loads = [
            ProofLoads::OneOf(vec![[x, y, z, y, z, x]]),
            ProofLoads::AnyForce(1.5),
            ProofLoads::OneOf(vec![[20.0 * x, y, z, 0.0, 0.0, 1.0]]),
        ];
        let question = random_arm(&mut random, loads[round % 3].clone());
        assert_enclosed(&question, 6 * times, round as u64);
        if round % 3 != 1 {
            let question = with_spread(question, &mut random);
            assert_enclosed(&question, 6 * times, round as u64);
        }
    }
}

fn random_configuration(question: &Question, random: &mut Random) -> Vec<f64> {
    (question.arm.joints.iter())
        .map(|joint| {
            let [low, high] = joint.range_rad;
            low + (high - low) * (random.number() + 1.0) / 2.0
        })
        .collect()
}

/// The largest d at random experiments, with the best of them.
fn sampled(question: &Question, count: usize, seed: u64) -> Vec<(f64, Vec<f64>, [f64; 6])> {
    let mut random = Random(seed);
    let loads: Vec<[f64; 6]> = match &question.loads {
        ProofLoads::OneOf(loads) => loads.clone(),
        ProofLoads::AnyForce(_) => vec![[0.0; 6]],
    };
    let mut found = Vec::new();
    for _ in 0..count {
        let q = random_configuration(question, &mut random);
        let load = loads[random.below(loads.len())];
        let (d, margins) = experiment(question, &q, &load);
        if margins.iter().all(|margin| *margin >= 0.0) {
            found.push((d, q, load));
        }
    }
    found.sort_by(|one, other| other.0.total_cmp(&one.0));
    found
}

fn effort(gap: f64, boxes: u64) -> ProofLimits<'static> {
    ProofLimits {
        gap,
        boxes,
        records: false,
        stop: &|| false,
        progress: &|_, _| {},
    }
}

/// Any point of the region lies, as it is or by the symmetries, in a box that is never forgotten under a threshold just
/// below its derivative: so nothing is proved from less than the largest derivative.
#[test]
fn nothing_is_proved_from_less_than_an_experiment_gives() {
    let mut random = Random(7);
    let mut questions = vec![heavy_arm()];
    questions[0].arm.joints[1].range_rad = [-1.6, -1.2];
    questions[0].arm.joints[2].range_rad = [0.9, 1.3];
    for round in 0..12 {
        let [x, y, z] = random.vector();
        let loads = [
            ProofLoads::OneOf(vec![[0.0, 0.0, z, 0.0, 0.0, 0.0], [x, y, z, x, y, z]]),
            ProofLoads::AnyForce(1.0),
        ];
        questions.push(random_arm(&mut random, loads[round % 2].clone()));
        if round % 4 == 2 {
            let question = questions[questions.len() - 1].clone();
            questions.push(with_spread(question, &mut random));
        }
    }
    for question in &questions {
        let Some(best) = sampled(question, 5_000, 1).into_iter().next() else {
            continue;
        };
        // A far too small derivative is given as found: the threshold rises with what is found on the way, and ends
        // above the best experiment.
        let Ok((proved, _)) = prove(question, 0.2 * best.0, effort(0.1, 15_000)) else {
            continue;
        };
        assert!(proved.largest >= best.0 * (1.0 - 1e-12));
    }
}

/// Two equal links in a vertical plane: a weight W at the end turns the second joint by W l cos(angle), so that its
/// deflection, of l times that, is largest with the link level: d = (b W l^2)^2.
#[test]
fn a_planar_arm_is_proved_to_its_known_maximum() -> Result<(), NoProof> {
    let arm = Arm {
        joints: vec![
            joint([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-90.0, 90.0]),
            joint([0.5, 0.0, 0.0], [0.0, 1.0, 0.0], [-90.0, 90.0]),
        ],
        tool_joints: 2,
        tool_offset_m: [0.5, 0.0, 0.0],
        tool_rotation: UPRIGHT,
    };
    let question = |parameters: Vec<usize>, rows: Vec<Vec<f64>>| Question {
        arm: arm.clone(),
        parameters,
        rows,
        region: SmoothRegion::default(),
        loads: ProofLoads::OneOf(vec![[0.0, 0.0, -100.0, 0.0, 0.0, 0.0]]),
        spread: None,
    };
    let outer = (100.0_f64 * 0.25).powi(2);
    let alone = |question: &Question, found: f64, effort: ProofLimits<'_>| {
        prove(question, found, effort).map(|(proved, _)| proved)
    };
    let proved = alone(
        &question(vec![1], vec![vec![1.0]]),
        outer,
        effort(1e-4, 100_000),
    )?;
    assert!(proved.largest >= outer && proved.gap() <= 1.001e-4);
    // The first joint: at full stretch, W (2l) times 2l.
    let inner = (100.0_f64).powi(2);
    let proved = alone(
        &question(vec![0], vec![vec![1.0]]),
        0.9 * inner,
        effort(1e-3, 100_000),
    )?;
    assert!(proved.largest >= inner && proved.largest <= inner * 1.0011);
    assert!(proved.found <= inner * (1.0 + 1e-12));
    // Below the maximum nothing is proved, however long it takes.
    let Proved { largest, .. } = alone(
        &question(vec![0], vec![vec![1.0]]),
        0.5 * inner,
        effort(0.3, 2_000),
    )?;
    assert!(largest >= inner);
    // A weight on a level floor of 1 m: the height is a constraint, and both links level is still possible.
    let mut floor = question(vec![0], vec![vec![1.0]]);
    floor.region.height_m = [Some(1.25), None];
    let proved = alone(&floor, 0.9 * inner, effort(1e-3, 200_000))?;
    // On the constraint, sin a + sin b = 1/2 for links of 1/2: the reach is largest with a = b.
    let reach = 2.0 * 0.5 * (1.0 - 0.0625_f64).sqrt();
    let best = (100.0 * reach * reach).powi(2);
    let lever = (reach * reach + 0.0625).sqrt() * reach * 100.0;
    assert!(best < lever * lever);
    assert!(proved.largest >= lever * lever * (1.0 - 1e-9));
    assert!(
        proved.largest <= lever * lever * 1.002,
        "{} {}",
        proved.largest,
        lever * lever
    );
    Ok(())
}

/// The matrix of a target is that of plain arithmetic, and the bound is rounded down.
#[test]
fn the_bound_is_that_of_plain_arithmetic_but_for_rounding() {
    let mut random = Random(11);
    for _ in 0..40 {
        let question = random_arm(&mut random, ProofLoads::OneOf(vec![[0.0; 6]]));
        let configuration_rad: Vec<f64> = (0..4).map(|_| 3.0 * random.number()).collect();
        let [force, torque] = [random.vector(), random.vector()];
        let wrench: [f64; 6] =
            std::array::from_fn(|k| if k < 3 { force[k] } else { torque[k - 3] });
        // Three rows that pick one coordinate of one column each: trace(C B^T) is its value.
        for (parameter, axis) in [(0, 0), (1, 1), (2, 2), (0, 2)] {
            let mut rows = vec![vec![0.0; 3]; 3];
            rows[axis][parameter] = 1.0;
            let target = Target {
                arm: question.arm.clone(),
                configuration_rad: configuration_rad.clone(),
                wrench,
                weight: 0.25,
                direction: None,
            };
            let ingredients = Ingredients {
                targets: &[target],
                parameters: &question.parameters,
                rows: &rows,
                sigma_m: 2.0,
            };
            let bound = ingredients.least_rho0_m(4.0);
            // d of a row that picks the column is its square.
            let mut one = question.clone();
            one.rows = vec![vec![0.0; 3]];
            one.rows[0][parameter] = 1.0;
            let column = column(&one, &configuration_rad, &wrench, parameter)[axis];
            let truth = 2.0 * 0.5 * column.abs() / 2.0;
            assert!(bound.is_some_and(|bound| bound <= truth + 1e-15));
            assert!(bound.is_some_and(|bound| bound >= truth - 1e-10));
        }
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let question = heavy_arm();
    let found = sampled(&question, 20_000, 3)[0].0;
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map(|pool| pool.install(|| prove(&question, found, effort(0.1, 30_000))))
    };
    let results: Vec<_> = [1, 2, 3].into_iter().map(run).collect();
    for result in results {
        assert_eq!(result.ok(), run(1).ok());
    }
}
