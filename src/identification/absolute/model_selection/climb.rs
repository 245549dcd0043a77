//! The fits of the nested models, each started from the smaller one, in the end all with the same weights.

use nalgebra::DVector;

use super::super::super::gauss_newton::{FitError, ParameterFit, fit_from, fit_parameters};
use super::super::super::nominal::{UNKNOWN, with_nominal};
use super::super::unknowns::ToldApart;
use super::super::without::Fitted;
use super::super::{AbsoluteCase, AbsoluteError, ParameterGroup, ReadingWeights};
use crate::observation::SharedErrors;
use crate::parameter::ParameterSet;

/// The groups in the order in which nested models add them: what moves everything first.
const ORDER: [ParameterGroup; 6] = [
    ParameterGroup::Frames,
    ParameterGroup::Zeros,
    ParameterGroup::Links,
    ParameterGroup::Compliances,
    ParameterGroup::Springs,
    ParameterGroup::Payload,
];

/// One nested model's fit.
pub(super) struct NestedModelFit {
    pub added: ParameterGroup,
    /// As `--parameters` takes them.
    pub groups: Vec<ParameterGroup>,
    pub set: ParameterSet,
    pub fit: ParameterFit,
}

impl NestedModelFit {
    pub fn fitted(&self) -> Fitted<'_> {
        Fitted {
            set: &self.set,
            fit: &self.fit,
        }
    }
}

/// All nested models that could be fitted.
pub(super) struct Climbed {
    pub steps: Vec<NestedModelFit>,
    pub skipped: Vec<(ParameterGroup, String)>,
    pub shared: Option<SharedErrors>,
}

impl AbsoluteCase<'_> {
    /// Fits all nested models.
    pub(super) fn climb(&mut self, weights: ReadingWeights) -> Result<Climbed, AbsoluteError> {
        let has_discrepancy = weights != ReadingWeights::Own;
        let mut skipped = Vec::new();
        let mut shared = None;
        let mut steps: Vec<NestedModelFit> = Vec::new();
        for added in ORDER {
            let groups = named(&steps, added);
            let ToldApart { set, .. } = self.unknowns(&groups)?;
            let kinds = |set: &ParameterSet| -> Vec<_> {
                set.parameters().iter().map(|each| each.kind).collect()
            };
            let fit = match steps.last() {
                None => {
                    let fit = fit_parameters(&self.arm, &set, &self.observations)?;
                    let values = self.rebased(&set, &fit);
                    if has_discrepancy {
                        let discrepancy = self.estimated_discrepancy(&fit)?;
                        shared = self.weigh(discrepancy);
                    }
                    fit_from(
                        &self.arm,
                        &set,
                        &self.observations,
                        shared.as_ref(),
                        &values,
                    )
                }
                Some(below) if kinds(&below.set) == kinds(&set) => {
                    skipped.push((added, "adds nothing that this robot has".to_owned()));
                    continue;
                }
                Some(below) => {
                    let start = carried(&below.set, &below.fit.posterior.mean, &set);
                    fit_from(&self.arm, &set, &self.observations, shared.as_ref(), &start)
                }
            };
            let told =
                fit.and_then(|fit| self.with_nominal_where_unknown(set, fit, shared.as_ref()));
            match told {
                Ok((set, fit)) => {
                    if has_discrepancy {
                        let discrepancy = self.estimated_discrepancy(&fit)?;
                        shared = self.weigh(discrepancy);
                    }
                    steps.push(NestedModelFit {
                        added,
                        groups,
                        set,
                        fit,
                    });
                }
                Err(error) if steps.is_empty() => return Err(error.into()),
                Err(error) => skipped.push((added, error.to_string())),
            }
        }
        for step in &mut steps {
            let values = DVector::from_column_slice(&step.fit.posterior.mean);
            step.fit = fit_from(
                &self.arm,
                &step.set,
                &self.observations,
                shared.as_ref(),
                &values,
            )?;
        }
        Ok(Climbed {
            steps,
            skipped,
            shared,
        })
    }
}

impl AbsoluteCase<'_> {
    /// The same fit in which compliances stay nominal that it does not tell.
    fn with_nominal_where_unknown(
        &self,
        mut set: ParameterSet,
        mut fit: ParameterFit,
        shared: Option<&SharedErrors>,
    ) -> Result<(ParameterSet, ParameterFit), FitError> {
        while let Some(other) = with_nominal(
            &set,
            &fit.posterior.mean,
            &fit.posterior.covariance,
            UNKNOWN,
        ) {
            let start = DVector::from_column_slice(&fit.posterior.mean);
            set = other;
            fit = fit_from(&self.arm, &set, &self.observations, shared, &start)?;
        }
        Ok((set, fit))
    }
}

/// The nested models below and one group more, in the words of the command line.
fn named(steps: &[NestedModelFit], added: ParameterGroup) -> Vec<ParameterGroup> {
    let has = |group| steps.iter().any(|step| step.added == group) || added == group;
    let mut groups: Vec<ParameterGroup> = ORDER[1..]
        .iter()
        .copied()
        .filter(|&group| has(group))
        .collect();
    if groups.starts_with(&[ParameterGroup::Zeros, ParameterGroup::Links]) {
        groups.splice(..2, [ParameterGroup::Geometry]);
    }
    if groups.is_empty() {
        groups.push(ParameterGroup::Frames);
    }
    groups
}

/// The values of a set with those of another one where both have a parameter, nominal otherwise (p).
pub(super) fn carried(from: &ParameterSet, values: &[f64], to: &ParameterSet) -> DVector<f64> {
    let mut carried = to.prior().mean.clone();
    for (place, each) in to.parameters().iter().enumerate() {
        if let Some(known) = from.index_of(each.kind) {
            carried[place] = values[known];
        }
    }
    carried
}
