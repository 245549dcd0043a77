//! What joints are off by over their own angles, as a table for controllers.

use crate::identification::DiscrepancyModel;
use crate::robot::Joint;

/// Rows are so far apart (rad; m where a joint slides).
const STEP: [f64; 2] = [std::f64::consts::PI / 180.0, 0.01];

/// A row for each degree, or 10 mm, between the angles that were read: by how much further than commanded the joint stands, with the standard
/// error. Between rows the error is nearly linear; outside of them nothing is known.
pub fn joint_error_table(model: &DiscrepancyModel, joints: &[Joint]) -> String {
    let mut text = "joint,unit,at,error_unit,error,standard_error\n".to_owned();
    for (place, each) in model.joints.iter().enumerate() {
        let Joint { name, drive, .. } = &joints[each.joint];
        let step = STEP[usize::from(drive.slides)];
        let error_unit = if drive.slides { "mm" } else { "mrad" };
        let [low, high] = each.process.range();
        let first = (low / step).floor() * step;
        let inner = (1..).map(|number| first + f64::from(number) * step);
        let inner = inner
            .skip_while(|at| *at <= low)
            .take_while(|at| *at < high);
        let last = (high > low).then_some(high);
        for at in [low].into_iter().chain(inner).chain(last) {
            let [error, standard_error] = model.error_at(place, at).map(|value| value * 1e3);
            let (at, unit) = drive.shown(at);
            text += &format!("{name},{unit},{at:.4},{error_unit},{error:.5},{standard_error:.5}\n");
        }
    }
    text
}
