//! Which rung to use: the rule of one standard error.

use super::rung::Rung;

/// Which rung to use.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommendation {
    /// The rung of the smallest cross-validated loss.
    pub best: usize,
    /// The lowest rung whose loss is no more than one standard error of the difference above that.
    pub rung: usize,
    /// What is recommended, and why.
    pub sentences: Vec<String>,
}

/// Compares the rungs that could be judged; none where none could.
pub(super) fn recommended(rungs: &mut [Rung]) -> Option<Recommendation> {
    let loss = |rung: &Rung| rung.cross_validation.as_ref().ok().map(|each| each.loss);
    let judged = rungs.iter().enumerate();
    let judged = judged.filter_map(|(place, rung)| Some((place, loss(rung)?)));
    let (best, _) = judged.min_by(|one, other| one.1.total_cmp(&other.1))?;
    let of_best = rungs[best].cross_validation.clone().ok()?;
    for rung in rungs.iter_mut() {
        let Ok(own) = &mut rung.cross_validation else {
            continue;
        };
        let losses = own.block_losses.iter().zip(&of_best.block_losses);
        let apart: Vec<f64> = losses.map(|(own, best)| own - best).collect();
        let count = apart.len() as f64;
        let mean = apart.iter().sum::<f64>() / count;
        let squares: f64 = apart.iter().map(|each| (each - mean).powi(2)).sum();
        own.beyond_best = own.loss - of_best.loss;
        own.standard_error = (squares / (count - 1.0) / count).sqrt();
    }
    let is_enough = |rung: &Rung| {
        let judged = rung.cross_validation.as_ref();
        judged.is_ok_and(|each| each.beyond_best <= each.standard_error)
    };
    let rung = rungs.iter().position(is_enough).unwrap_or(best);
    let sentences = sentences(rungs, best, rung);
    Some(Recommendation {
        best,
        rung,
        sentences,
    })
}

/// A rung as `--parameters` takes it.
fn named(rung: &Rung) -> String {
    let names = rung.groups.iter().map(|group| group.word());
    names.collect::<Vec<_>>().join(",")
}

fn sentences(rungs: &[Rung], best: usize, rung: usize) -> Vec<String> {
    let rms_mm = |rung: &Rung| {
        let judged = rung.cross_validation.as_ref().ok();
        let distances = judged.and_then(|each| each.distances.as_ref());
        distances.map_or(0.0, |each| each.rms * 1e3)
    };
    let chosen = &rungs[rung];
    let mut sentences = vec![format!(
        "Use --parameters {}: of blocks of joint space that it was not fitted to it leaves {:.4} mm (rms).",
        named(chosen),
        rms_mm(chosen)
    )];
    if let Some(below) = rung.checked_sub(1).map(|below| &rungs[below])
        && let Ok(judged) = &below.cross_validation
    {
        sentences.push(format!(
            "With less, {} leaves {:.4} mm there: its loss is larger than the best by {:.1} standard errors.",
            named(below),
            rms_mm(below),
            judged.beyond_best / judged.standard_error
        ));
    }
    let more = rungs[best].unknowns.saturating_sub(chosen.unknowns);
    if best != rung
        && let Ok(judged) = &chosen.cross_validation
    {
        sentences.push(format!(
            "The smallest loss is that of {}, {:.4} mm; that is {:.1} standard errors of the difference, no reason for {more} \
             unknowns more.",
            named(&rungs[best]),
            rms_mm(&rungs[best]),
            judged.beyond_best / judged.standard_error
        ));
    }
    if let Some(above) = rungs.get(best + 1)
        && let Ok(judged) = &above.cross_validation
    {
        let verdict = if judged.beyond_best > judged.standard_error {
            "predicts worse than it fits: its parameters follow what the model does not explain"
        } else {
            "predicts no better"
        };
        sentences.push(format!(
            "With more, {} leaves {:.4} mm there: it {verdict}.",
            named(above),
            rms_mm(above)
        ));
    }
    sentences
}
