//! What is predicted at each test pose, and what was observed there.

use super::figures::path_figure;
use super::sources::bar;
use crate::record::messages::TestPoseMessage;
use crate::task::TestPose;
use crate::text::wording::{counted, micrometres, percent};
use crate::view::markup::{cell, figure, paragraph, section, table_of_cells};

/// More test poses are a path or a region, and drawn as one.
const FEW_POSES: usize = 12;
const TITLE: &str = "At each test pose";

/// The section of what is predicted (mm) at each test pose and over all; of a run beside what was observed and, under a name, without what
/// was identified. Weights are shown where they differ.
pub(super) fn test_poses(
    poses: &[TestPose],
    predicted_mm: &[Option<f64>],
    all_mm: Option<f64>,
    run: Option<(&[TestPoseMessage], &str)>,
) -> String {
    let observed = run.map_or(&[][..], |(observed, _)| observed);
    let values_mm = || predicted_mm.iter().map(|rho0_mm| rho0_mm.unwrap_or(0.0));
    let is_drawn = poses.len() > FEW_POSES;
    let differ = |pair: &[TestPose]| (pair[0].weight - pair[1].weight).abs() > 1e-9;
    let has_weights = poses.windows(2).any(differ);
    let [order, weighted] = [
        ["in their order", "by their numbers in the table"][usize::from(is_drawn)],
        ["", ", by their weights,"][usize::from(has_weights)],
    ];
    let caption = match poses.len() {
        1 => "\u{3c1}\u{2080} at the test pose.".to_owned(),
        count => format!(
            "\u{3c1}\u{2080} at each of {}, {order}; over all{weighted} it is {}.",
            counted(count as u64, "test pose"),
            micrometres(all_mm)
        ),
    };
    let seen_mm = observed.iter().map(|seen| seen.residual_mm);
    let longest = values_mm().chain(seen_mm).fold(f64::MIN_POSITIVE, f64::max);
    let barred = |value_mm: Option<f64>, is_seen| {
        let share = 100.0 * value_mm.unwrap_or(0.0) / longest;
        bar(share, is_seen, &micrometres(value_mm))
    };
    let rows = (poses.iter().zip(predicted_mm).enumerate()).map(|(index, (pose, rho0_mm))| {
        let seen = observed.get(index).map_or_else(String::new, |seen| {
            let without = cell(&micrometres(Some(seen.uncompensated_mm)));
            barred(Some(seen.residual_mm), true) + &without
        });
        let weight = has_weights.then(|| cell(&percent(Some(pose.weight), 1)));
        let name = if is_drawn {
            format!("{}: {}", index + 1, pose.name)
        } else {
            pose.name.clone()
        };
        cell(&name) + &weight.unwrap_or_default() + &barred(*rho0_mm, false) + &seen
    });
    let mut header = vec!["test pose"];
    header.extend(has_weights.then_some("weight"));
    header.push("predicted rms \u{3c1}\u{2080}");
    header.extend(
        run.iter()
            .flat_map(|(_, without)| ["observed in this run", without]),
    );
    let numbers = table_of_cells(&header, rows);
    if !is_drawn {
        let body = paragraph(&caption) + &numbers;
        return section("poses", TITLE, &body);
    }
    let values_um: Vec<f64> = values_mm().map(|value_mm| value_mm * 1e3).collect();
    let names: Vec<&str> = poses.iter().map(|pose| &*pose.name).collect();
    let svg = path_figure(&names, &values_um, all_mm.map(|all| all * 1e3));
    let numbers = format!(
        "<details><summary>The test poses by their numbers</summary>\n{numbers}</details>\n"
    );
    let body = figure(&svg, &caption) + &numbers;
    section("poses", TITLE, &body)
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::robot::Load;

    fn poses(count: usize, second: f64) -> String {
        let pose = |index: usize| TestPose {
            name: format!("pose_{index}"),
            configuration_rad: DVector::zeros(1),
            load: Load::NONE,
            load_axes: None,
            weight: if index == 1 { second } else { 0.25 },
            direction: None,
        };
        let poses: Vec<TestPose> = (0..count).map(pose).collect();
        test_poses(&poses, &vec![Some(0.01); count], Some(0.01), None)
    }

    #[test]
    fn weights_are_shown_where_they_differ_and_many_poses_have_numbers() {
        let [alike, weighted, many] = [poses(2, 0.25), poses(2, 0.75), poses(13, 0.25)];
        assert!(!alike.contains("weight"));
        assert!(weighted.contains("<th>weight</th>") && weighted.contains("75.0\u{a0}%"));
        assert!(many.contains("<td>13: pose_12</td>") && many.contains("13, pose_12: 10.00"));
    }
}
