//! The recommended nested model: the rule of one standard error of cross-validation.

use super::{CrossValidation, NestedModel};

/// Losses that differ by less than this share of them are equal: of models whose further unknowns nothing determines.
const ROUNDING: f64 = 1e-9;
/// A loss that is smaller by so many standard errors of the difference is clearly smaller.
const CLEAR: f64 = 2.0;

/// Which nested model to use.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommendation {
    /// The nested model of the smallest cross-validated loss.
    pub best: usize,
    /// The lowest nested model whose loss is no more than one standard error of the difference above that.
    pub nested_model: usize,
    /// Whether to use joint error functions beside it.
    pub with_joint_errors: bool,
    /// What is recommended, and why.
    pub sentences: Vec<String>,
}

impl Recommendation {
    /// Compares the recommended model with the same that has joint error functions beside its parameters: that is recommended if its loss is
    /// smaller by more than [`CLEAR`] standard errors of the difference.
    pub(super) fn compare_joint_errors(&mut self, without: &NestedModel, with: &mut NestedModel) {
        let (Ok(plain), Ok(judged)) = (&without.cross_validation, &mut with.cross_validation)
        else {
            return;
        };
        let (apart, error) = difference(judged, plain);
        (judged.beyond_best, judged.standard_error) = (plain.beyond_best + apart, error);
        self.with_joint_errors = apart < -CLEAR * error;
        let rms_mm = judged.distances.map_or(0.0, |each| each.rms * 1e3);
        let (side, verdict) = match (apart < 0.0, self.with_joint_errors) {
            (true, true) => ("smaller", "they are used"),
            (true, false) => ("smaller", "no reason to use them"),
            (false, _) => ("larger", "they are left out"),
        };
        self.sentences.push(format!(
            "With joint error functions beside it, {rms_mm:.4} mm there: the loss is {side} by {:.1} standard errors of the \
             difference, {verdict}.",
            apart.abs() / error
        ));
    }
}

/// By how much the loss of one model is larger than another's, with the standard error of this from block to block.
fn difference(own: &CrossValidation, other: &CrossValidation) -> (f64, f64) {
    let losses = own.block_losses.iter().zip(&other.block_losses);
    let apart: Vec<f64> = losses.map(|(own, other)| own - other).collect();
    let count = apart.len() as f64;
    let mean = apart.iter().sum::<f64>() / count;
    let squares: f64 = apart.iter().map(|each| (each - mean).powi(2)).sum();
    let error = (squares / (count - 1.0) / count).sqrt();
    (own.loss - other.loss, error)
}

/// Compares the nested models that could be judged; none where none could.
pub(super) fn recommended(nested_models: &mut [NestedModel]) -> Option<Recommendation> {
    let judged = nested_models.iter().enumerate();
    let judged =
        judged.filter_map(|(place, each)| Some((place, each.cross_validation.clone().ok()?)));
    let (best, of_best) = judged.min_by(|one, other| one.1.loss.total_cmp(&other.1.loss))?;
    let all = nested_models.iter_mut();
    for own in all.filter_map(|each| each.cross_validation.as_mut().ok()) {
        let (beyond, error) = difference(own, &of_best);
        own.standard_error = error;
        own.beyond_best = if beyond > ROUNDING * of_best.loss.abs() {
            beyond
        } else {
            0.0
        };
    }
    let is_enough = |nested_model: &NestedModel| {
        let judged = nested_model.cross_validation.as_ref();
        judged.is_ok_and(|each| each.beyond_best <= each.standard_error)
    };
    let nested_model = nested_models.iter().position(is_enough).unwrap_or(best);
    let sentences = sentences(nested_models, best, nested_model);
    Some(Recommendation {
        best,
        nested_model,
        with_joint_errors: true,
        sentences,
    })
}

fn sentences(nested_models: &[NestedModel], best: usize, chosen: usize) -> Vec<String> {
    // A model as `--parameters` takes it, with its rms distance in other blocks.
    let words = |place: usize| {
        let groups = nested_models[place].groups.iter();
        let names: Vec<&str> = groups.map(|group| group.word()).collect();
        let judged = nested_models[place].cross_validation.as_ref().ok();
        let distances = judged.and_then(|each| each.distances.as_ref());
        let rms_mm = distances.map_or(0.0, |each| each.rms * 1e3);
        (names.join(","), format!("{rms_mm:.4} mm"))
    };
    let judged = |place: usize| nested_models.get(place)?.cross_validation.as_ref().ok();
    let beyond = |judged: &CrossValidation| judged.beyond_best / judged.standard_error;
    let (name, rms) = words(chosen);
    let mut sentences = vec![format!(
        "Use --parameters {name}: its cross-validated residual, over blocks of joint space, is {rms} (rms)."
    )];
    if let Some(less) = chosen.checked_sub(1)
        && let Some(judged) = judged(less)
    {
        let ((name, rms), beyond) = (words(less), beyond(judged));
        sentences.push(format!(
            "With less, {name} has {rms} there: its loss is larger than the best by {beyond:.1} standard errors."
        ));
    }
    if best != chosen
        && let Some(judged) = judged(chosen)
    {
        let [most, unknowns] = [best, chosen].map(|place| nested_models[place].unknowns);
        let ((name, rms), beyond) = (words(best), beyond(judged));
        let more = most.saturating_sub(unknowns);
        sentences.push(format!(
            "The smallest loss is that of {name}, {rms}; that is {beyond:.1} standard errors of the difference, no reason for \
             {more} unknowns more."
        ));
    }
    if let Some(more) = judged(best + 1) {
        let verdict = if more.beyond_best > more.standard_error {
            "predicts worse: its parameters follow what the model does not explain"
        } else {
            "predicts no better"
        };
        let (name, rms) = words(best + 1);
        sentences.push(format!("With more, {name} has {rms} there: it {verdict}."));
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::super::super::ParameterGroup;
    use super::super::CrossValidation;
    use super::*;

    fn nested_model(block_losses: [f64; 3]) -> NestedModel {
        NestedModel {
            added: ParameterGroup::Zeros,
            groups: Vec::new(),
            unknowns: 0,
            undetermined: Vec::new(),
            distances: None,
            angles: None,
            discrepancy: [0.0; 2],
            cross_validation: Ok(CrossValidation {
                block_losses: block_losses.to_vec(),
                loss: block_losses.iter().sum::<f64>() / 3.0,
                beyond_best: 0.0,
                standard_error: 0.0,
                distances: None,
                angles: None,
            }),
        }
    }

    /// The losses of three nested models are larger than the best by 0.2, 0.1, 0 and 0.3, with standard errors of 0.058, 0.153 and 0.1.
    #[test]
    fn the_lowest_within_one_standard_error_is_recommended() {
        let best = [1.0, 2.0, 3.0];
        let more =
            |by: [f64; 3]| nested_model(std::array::from_fn(|block| best[block] + by[block]));
        let far = more([0.3, 0.2, 0.1]);
        let near = more([0.4, -0.1, 0.0]);
        let more_than_enough = more([0.2, 0.2, 0.5]);
        let mut nested_models = [far, near, nested_model(best), more_than_enough];
        let found = recommended(&mut nested_models).expect("a recommendation");
        assert_eq!((found.best, found.nested_model), (2, 1));
        let errors =
            nested_models.map(|each| each.cross_validation.expect("judged").standard_error);
        for (found, expected) in errors.iter().zip([0.02_f64, 0.14, 0.0, 0.06]) {
            assert!((found - (expected / 6.0).sqrt()).abs() < 1e-12, "{found}");
        }
    }

    /// Of models that are equal but for rounding, the lowest is recommended, and none predicts worse.
    #[test]
    fn equal_models_are_equal() {
        let rounded = [1.0, 2.0, 3.0].map(|loss| loss * (1.0 + 1e-15));
        let mut nested_models = [rounded, [1.0, 2.0, 3.0]].map(nested_model);
        let found = recommended(&mut nested_models).expect("a recommendation");
        assert_eq!(found.nested_model, 0);
    }
}
