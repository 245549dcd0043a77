//! What is predicted at each test pose, and what was observed there.

use serde_json::{Value, json};

use super::figures::path_figure;
use crate::record::messages::TestPoseMessage;
use crate::task::TestPose;

/// More test poses are a path or a region, and drawn as one.
const FEW_POSES: usize = 12;

/// What is predicted (mm) at each test pose and over all; of a run beside what was observed and, under a name, without what was
/// identified. Weights are shown where they differ.
pub(super) fn test_poses(
    poses: &[TestPose],
    predicted_mm: impl Iterator<Item = Option<f64>>,
    all_mm: Option<f64>,
    run: Option<(&[TestPoseMessage], &str)>,
) -> Value {
    let (mut rows, mut values_um) = (Vec::new(), Vec::new());
    let mut longest_mm = f64::MIN_POSITIVE;
    for (index, (pose, rho0_mm)) in poses.iter().zip(predicted_mm).enumerate() {
        let observed = run.and_then(|(observed, _)| observed.get(index));
        let observed_mm = observed.map(|each| each.residual_mm);
        let shown = [rho0_mm, observed_mm].into_iter().flatten();
        longest_mm = shown.fold(longest_mm, f64::max);
        values_um.push(rho0_mm.unwrap_or(0.0) * 1e3);
        rows.push(json!({
            "name": pose.name,
            "weight": pose.weight,
            "predicted_mm": rho0_mm,
            "observed_mm": observed_mm,
            "without_mm": observed.map(|each| each.uncompensated_mm),
        }));
    }
    let differ = |pair: &[TestPose]| (pair[0].weight - pair[1].weight).abs() > 1e-9;
    let figure = (poses.len() > FEW_POSES).then(|| {
        let names: Vec<&str> = poses.iter().map(|pose| &*pose.name).collect();
        path_figure(&names, &values_um, all_mm.map(|all| all * 1e3))
    });
    json!({
        "rows": rows,
        "has_weights": poses.windows(2).any(differ),
        "without": run.map(|(_, without)| without),
        "longest_mm": longest_mm,
        "all_mm": all_mm,
        "figure": figure,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::robot::Load;

    fn poses(count: usize, second: f64) -> Value {
        let pose = |index: usize| TestPose {
            name: format!("pose_{index}"),
            configuration_rad: DVector::zeros(1),
            load: Load::NONE,
            load_axes: None,
            weight: if index == 1 { second } else { 0.25 },
            direction: None,
        };
        let poses: Vec<TestPose> = (0..count).map(pose).collect();
        test_poses(&poses, poses.iter().map(|_| Some(0.01)), Some(0.01), None)
    }

    #[test]
    fn weights_are_shown_where_they_differ_and_many_poses_are_drawn() {
        let [alike, weighted, many] = [poses(2, 0.25), poses(2, 0.75), poses(13, 0.25)];
        assert_eq!(
            [&alike, &weighted].map(|each| &each["has_weights"]),
            [false, true]
        );
        assert!(alike["figure"].is_null());
        assert!(many["figure"].to_string().contains("13, pose_12: 10.00"));
    }
}
