//! Remarks on error sources beside an uncertainty budget.

/// What sources do not move, a line each.
pub fn remarks<'a>(sources: impl Iterator<Item = (&'a str, Option<&'a str>)>) -> String {
    sources
        .filter_map(|(name, remark)| Some(format!("  {name} {}\n", remark?)))
        .collect()
}

/// The accuracy with the error sources that the campaign of the prior has, too.
pub fn common_sources(common: Option<(&[String], String)>) -> String {
    common.map_or_else(String::new, |(names, rho0)| {
        format!(
            "  error sources in common with the campaign of robot.prior: {}; rho0 takes them as independent, and is {rho0} with the \
             same values in both\n",
            names.join(", ")
        )
    })
}
