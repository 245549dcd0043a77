//! The predicted accuracy of a plan and the contributions to its errors in the simulated truth, in tallies and results.

use serde::Serialize;

use crate::study::account::{Account, AccountPart};
use crate::study::{summary::Measured, verdict::Kept};

/// The contribution of a source to the errors of the simulated truth.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ContributionMessage {
    /// Its name: "noise", "earlier identification", "true robot", or that of an uncertainty.
    pub source: String,
    /// Whether the planner's model does not know of it.
    pub hidden: bool,
    /// The contribution `u_i` (um), to first order.
    pub contribution_um: f64,
}

impl From<&AccountPart> for ContributionMessage {
    fn from(part: &AccountPart) -> Self {
        Self {
            source: part.name.clone(),
            hidden: part.is_hidden,
            contribution_um: part.rms_m * 1e6,
        }
    }
}

/// What an observed rms distance (m) says of the prediction, in words.
pub fn verdict(account: &Account, observed_m: Measured) -> String {
    let ratio = observed_m.value / account.predicted_m;
    match Kept::of(account.predicted_m, observed_m) {
        Kept::Holds if account.common.is_some() => {
            return "holds where the two campaigns are independent".to_owned();
        }
        Kept::Holds => return "holds".to_owned(),
        Kept::Conservative => return format!("conservative: {ratio:.3} of what is predicted"),
        Kept::Exceeded => {}
    }
    let hidden = account.parts.iter().filter(|part| part.is_hidden);
    let worst = hidden.max_by(|one, other| one.rms_m.total_cmp(&other.rms_m));
    match worst {
        Some(part) if part.rms_m > 0.0 => format!(
            "exceeded: {ratio:.3} times what is predicted; the largest hidden contribution is {:?}, {:.3} um",
            part.name,
            part.rms_m * 1e6
        ),
        // What it leaves was not computed, or is no first order.
        Some(part) => format!(
            "exceeded: {ratio:.3} times what is predicted; {:?} is hidden",
            part.name
        ),
        None => format!(
            "exceeded: {ratio:.3} times what is predicted, though nothing is hidden: the model is not linear enough"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn account() -> Account {
        let part = |name: &str, is_hidden, rms_m| AccountPart {
            name: name.to_owned(),
            is_hidden,
            rms_m,
        };
        Account {
            common: None,
            predicted_m: 6e-6,
            parts: vec![
                part("noise", false, 6e-6),
                part("scale", true, 8e-6),
                part("offset", true, 1e-6),
            ],
        }
    }

    #[test]
    fn verdicts_name_what_breaks_a_prediction() {
        let account = account();
        let said = |value, standard_error| {
            verdict(
                &account,
                Measured {
                    value,
                    standard_error,
                },
            )
        };
        assert_eq!(said(6.1e-6, 1e-9), "holds");
        assert_eq!(said(6.4e-6, 1e-7), "holds");
        assert!(said(5.5e-6, 1e-8).starts_with("conservative: 0.917"));
        let broken = said(1e-5, 1e-7);
        assert!(
            broken.contains("1.667 times") && broken.contains("\"scale\""),
            "{broken}"
        );
    }

    #[test]
    fn an_account_comes_back_from_its_text() {
        let text = serde_json::to_string(&account()).expect("JSON");
        let read: Account = serde_json::from_str(&text).expect("an account");
        assert_eq!(read, account());
    }
}
