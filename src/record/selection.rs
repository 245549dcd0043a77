//! Selections of readings and their residual errors, as a record.

use serde_json::{Value, json};

use crate::study::selection::{Chosen, NUMBERS, Selection, SelectionOfSize};

/// What came of choices of readings. Readings are counted from 1; what random choices come to stands under [`NUMBERS`], and the mean
/// distance of each for the picture.
pub fn selection_json(selection: &Selection<'_>) -> Value {
    let (parts, all) = (&selection.parts, &selection.parts.all);
    let names = all.set.parameters().iter().map(|each| &each.name);
    let left_out = all.left_out.iter().map(|each| &each.name);
    let joint_errors = parts.known.functions.iter().map(|each| {
        let joint = &all.arm.chain.joints[each.joint];
        let (std, length) = (each.deviation_rad * 1e3, each.kernel.length);
        let mut function = if joint.drive.slides {
            json!({ "joint": joint.name, "std_mm": std, "correlation_mm": length * 1e3 })
        } else {
            json!({ "joint": joint.name, "std_mrad": std, "correlation_deg": length.to_degrees() })
        };
        if !each.kernel.correlation.is_exponential() {
            function["correlation"] = json!(each.kernel.correlation);
        }
        function
    });
    json!({
        "readings": all.left.len(),
        "chosen": format!("{}s", parts.unit()),
        "unknowns": names.collect::<Vec<_>>(),
        "known_before": selection.known_before(),
        "left_out": left_out.collect::<Vec<_>>(),
        "joint_errors": joint_errors.collect::<Vec<_>>(),
        "discrepancy_mm": parts.discrepancy_m().map(|value| value * 1e3),
        "all_mm": selection.all_mm(),
        "sizes": selection.sizes.iter().map(of_one_size).collect::<Vec<_>>(),
    })
}

fn of_one_size(of_size: &SelectionOfSize) -> Value {
    let means_mm = of_size.random_means_mm();
    let mut random = json!({
        "draws": of_size.random.len(),
        "failed": of_size.random.len() - means_mm.len(),
        "means_mm": means_mm,
    });
    for (name, spread) in NUMBERS.iter().zip(of_size.spreads_mm()) {
        random[name] = json!(spread);
    }
    let planned = of_size.planned.iter().map(|(criterion, chosen)| {
        let found = chosen.as_ref().ok();
        let readings = found.map_or(&[][..], |found| &found.readings);
        let mut planned = json!({
            "criterion": criterion,
            "readings": readings.iter().map(|reading| reading + 1).collect::<Vec<_>>(),
            "lower_bound_rho0_mm": found.and_then(|found| found.bound_m).map(|bound| bound * 1e3),
            "distance_mm": found.and_then(|found| found.judged).map(|judged| judged.distance.in_thousandths()),
            "better_than_random": found.and_then(|found| of_size.better_than_random(found)),
            "problem": Chosen::problem(chosen),
        });
        // The first four stand under `distance_mm`.
        let numbers = found.map_or([None; 8], Chosen::numbers_mm);
        for (name, number) in NUMBERS.iter().zip(numbers).skip(4) {
            planned[name] = json!(number);
        }
        planned
    });
    json!({ "size": of_size.size, "planned": planned.collect::<Vec<_>>(), "random": random })
}
