//! Uncertainty budgets as tables, for all commands.

use crate::plan::{BudgetSource, UncertaintyBudget};
use crate::text::wording::significant;

use super::command_prelude::*;

/// Where a budget is written.
#[derive(Debug, Args)]
pub struct BudgetArgs {
    /// Where to write the uncertainty budget with all its columns (CSV).
    #[arg(long, value_name = "FILE")]
    budget_out: Option<PathBuf>,
}

impl BudgetArgs {
    /// Writes a budget where that is wanted, and tells of it; one that there is not has no rows.
    pub fn write(&self, budget: Option<&UncertaintyBudget>, report: &mut Report) {
        if let Some(path) = &self.budget_out {
            let sources = budget.map_or(&[][..], |budget| &budget.sources);
            report.save(path, &BudgetSource::csv(sources));
        }
    }
}

/// The main columns of a budget, where it has more than the instrument's noise.
pub fn describe(budget: Option<&UncertaintyBudget>) -> String {
    let Some(budget) = budget.filter(|budget| budget.has_more_than_noise()) else {
        return String::new();
    };
    let row = |each: &BudgetSource| {
        let unit = each.unit.as_deref().unwrap_or("-");
        vec![
            each.source.clone(),
            each.evaluation.name().to_owned(),
            each.level.name().to_owned(),
            or_dash(each.standard_uncertainty, |each| significant(each, 3)),
            unit.to_owned(),
            number(Some(each.contribution_um), 3),
            number(Some(each.variance_share_percent), 1),
        ]
    };
    let rows = budget.sources.iter().map(row);
    let header = "source | type | level | u(x) | unit | contribution [um] | share [%]";
    let remark =
        |each: &BudgetSource| Some(format!("  {} {}\n", each.source, each.remark.as_ref()?));
    let remarks: String = budget.sources.iter().filter_map(remark).collect();
    let combined = format!(
        "  u_c = {} um, U = {} um (95 %), k = {}\n",
        in_um(Some(budget.combined_standard_uncertainty_um * 1e-6), 3),
        in_um(budget.expanded_uncertainty_um.map(|um| um * 1e-6), 3),
        number(budget.coverage_factor, 3)
    );
    format!("\n{}{combined}{remarks}", table(header, rows))
}
