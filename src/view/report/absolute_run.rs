//! What a page of absolute readings shows of one run: where the tool was, and what was identified beside the simulated truth of that run.

use crate::calibration::rms_m;
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::text::wording::{counted, micrometres, number};
use crate::view::markup::{card, paragraph, section};
use crate::view::tables;
use crate::workflow::run::{RANDOM_PLANS, RUN};
use crate::workflow::run_absolute::AbsoluteRun;

/// A smaller discrepancy (mm) is not said.
const LEAST_MM: f64 = 5e-6;

/// What was observed beside what was predicted, and random plans.
pub(super) fn cards(plan: &AbsolutePlanMessage, run: &AbsoluteRun<'_>) -> String {
    let [before, after] = rms_m(&run.poses).map(|value| micrometres(Some(value * 1e3)));
    let about = format!(
        "Residual error in run {} on the virtual robot: the distance of the loaded tool from where the identified robot predicts it, \
         rms over the test poses; predicted {} rms. Of the nominal robot, in the frames that suit the same readings best: {before}.",
        RUN,
        micrometres(plan.rho0_mm)
    );
    let observed = card("", "Observed in this run", &after, &about);
    let median_mm = run.random_rho0_m.map(|value| value * 1e3);
    let Some((median, own)) = median_mm.zip(plan.rho0_mm) else {
        return observed;
    };
    let about = format!(
        "Median predicted accuracy of {RANDOM_PLANS} random plans of {} of the same candidates: {}.",
        counted(plan.experiments.into(), "reading"),
        micrometres(median_mm)
    );
    let answer = format!("{} times as accurate", number(Some(median / own), 1));
    observed + &card("", "Against a random plan", &answer, &about)
}

/// What was identified, beside the simulated truth.
pub(super) fn identified(run: &AbsoluteRun<'_>) -> String {
    let found = &run.record.identification;
    let mut about = format!(
        "From {} of the virtual robot of run {}, beside the simulated truth of that run. Frames are found besides.",
        counted(found.readings as u64, "reading"),
        RUN
    );
    if !found.left_out.is_empty() {
        let names: Vec<&str> = found.left_out.iter().map(|each| &*each.name).collect();
        about += &format!(
            " Redundant, not fitted: {}. Frames take their part; where links do, too, no truth stands beside geometry.",
            names.join(", ")
        );
    }
    let distances = &found.distance_mm;
    about += &format!(
        " Read less predicted: {} rms, at most {}.",
        micrometres(Some(distances.rms)),
        micrometres(Some(distances.largest))
    );
    if let Some(discrepancy_mm) = found.discrepancy_mm.filter(|mm| *mm > LEAST_MM) {
        about += &format!(
            " Standard errors count a model discrepancy of {} in each coordinate.",
            micrometres(Some(discrepancy_mm))
        );
    }
    let body = paragraph(&about) + &tables::unknowns(&run.record).html();
    section("identified", "What was identified", &body)
}
