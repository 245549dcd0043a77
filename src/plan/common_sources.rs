//! Error sources that a plan shares with the campaign behind `robot.prior`.
//!
//! The estimate errs by -K `M_0` d of what is known before ([shares](super::shares)), and identification takes the errors d of the
//! earlier compliances and of the other unknowns as independent. Where the value of an unknown s is the same in both campaigns, as of
//! one load cell, they are not: with the errors (`e_k`, `e_s`) of the earlier identification E[`e_k` `d_s`^T] = E[`e_k` `e_s`^T], as its
//! estimates are independent of their errors, and the mean square becomes
//!
//! ```text
//! rho^2 + tr(K_k (P S P - P) K_k^T) + 2 sum_s K_k P X_s L_s K_s^T
//! ```
//!
//! with S = E[`e_k` `e_k`^T], X_s = E[`e_k` `e_s`], P all that is known of the compliances before, `L_s` of s.

use nalgebra::{DMatrix, DVector};

use super::task_rows;
use crate::numeric::posterior::Posterior;
use crate::task::{Belief, Task};

/// The error sources that two campaigns have in common, and the accuracy with them.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CommonSources {
    /// The names of the sources.
    pub names: Vec<String>,
    /// The predicted rms distance (m) where their values are the same in both.
    pub rho0_m: f64,
}

impl CommonSources {
    /// Those of a plan of deflections that leaves `rho0_m` where they are independent.
    pub fn of_deflections(task: &Task, posterior: &Posterior, rho0_m: f64) -> Option<Self> {
        let belief = &task.belief;
        belief.prior_campaign.as_ref()?;
        let gain = task_rows(task) * &posterior.covariance;
        Self::new(belief, rho0_m, &|place| {
            Some(gain.column(place).into_owned())
        })
    }

    /// Those of a plan that leaves `rho0_m` where they are independent, by the columns of its gain K: of the unknown at a place of
    /// the belief's vector, per its unit (m). `None` where there are none.
    pub fn new(
        belief: &Belief,
        rho0_m: f64,
        column: &dyn Fn(usize) -> Option<DVector<f64>>,
    ) -> Option<Self> {
        let (extended, campaign) = (belief.uncertain.as_ref()?, belief.prior_campaign.as_ref()?);
        let identified = extended.identified();
        let compliances: Vec<DVector<f64>> = (0..identified).map(column).collect::<Option<_>>()?;
        let gain = DMatrix::from_columns(&compliances);
        let known = &belief.prior.as_ref()?.precision;
        let own = DVector::from_fn(identified, |place, _| extended.own_precision(place));
        let pulled = &gain * (known + DMatrix::from_diagonal(&own));
        let parameters = extended.set().parameters();
        let (mut names, mut added) = (Vec::new(), 0.0);
        for (name, places) in extended.shared() {
            let mut is_common = false;
            for &place in places {
                if place < identified {
                    // Its mean is the earlier estimate.
                    is_common |= campaign.covariance[(place, place)] > 0.0;
                    continue;
                }
                let other = (campaign.others.iter())
                    .find(|(other, _)| *other == parameters[place].name)
                    .filter(|_| parameters[place].kind.is_kept_between_campaigns());
                if let (Some((_, covariance)), Some(column)) = (other, column(place)) {
                    is_common = true;
                    let together = (&pulled * covariance).dot(&column);
                    added += 2.0 * extended.own_precision(place) * together;
                }
            }
            if is_common {
                names.push(name.clone());
            }
        }
        if names.is_empty() {
            return None;
        }
        // With no belief of its own, P S P = P of what the prior determines.
        if own.amax() > 0.0 {
            added += (&pulled * &campaign.covariance).dot(&pulled) - pulled.dot(&gain);
        }
        Some(Self {
            names,
            rho0_m: (rho0_m * rho0_m + added).max(0.0).sqrt(),
        })
    }
}
