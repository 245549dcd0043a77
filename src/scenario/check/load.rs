//! The table `[load]`, and every other force and torque.

use super::Checker;
use super::number::vector;
use crate::experiment::Loads;
use crate::files::FileError;
use crate::quantities::limits::MOST_LISTED;
use crate::quantities::plausible::faint_load;
use crate::robot::Load;
use crate::scenario::file::{LoadKind, WrenchTable};

impl Checker<'_> {
    pub(super) fn loads(&self, kind: &LoadKind) -> Result<Loads, FileError> {
        Ok(match kind {
            LoadKind::Fixed { force_n, torque_nm } => {
                let parts = [Some(force_n.as_slice()), torque_nm.as_deref()];
                Loads::Fixed(self.load("load", "force_n", parts)?)
            }
            LoadKind::Direction {
                direction,
                force_min_n: low,
                force_max_n: high,
            } => {
                let direction = self.unit("load.direction", direction)?;
                if low > high {
                    let problem =
                        format!("found {low}; at most load.force_max_n = {high} is allowed");
                    return Err(self.wrong("load.force_min_n", problem));
                }
                Loads::Direction {
                    direction,
                    force_n: [*low, *high],
                }
            }
            LoadKind::Any { force_max_n } => Loads::Any {
                force_max_n: *force_max_n,
            },
            LoadKind::List { wrenches } => {
                if wrenches.is_empty() {
                    return Err(self.wrong("load.wrenches", "is empty"));
                }
                let load = |key: &str, wrench: &WrenchTable| {
                    let parts = [Some(wrench.force_n.as_slice()), wrench.torque_nm.as_deref()];
                    self.load(key, "force_n", parts)
                };
                let loads = self.each("load.wrenches", MOST_LISTED, wrenches, load)?;
                if let Some(place) = (1..loads.len()).find(|&at| loads[..at].contains(&loads[at])) {
                    let key = format!("load.wrenches[{place}]");
                    return Err(self.wrong(&key, "the same load is there twice"));
                }
                Loads::List(loads)
            }
        })
    }

    /// A force (N), which must be given under its name, and a torque (N m), of which one must act.
    pub(super) fn load(
        &self,
        key: &str,
        name: &str,
        [force_n, torque_nm]: [Option<&[f64]>; 2],
    ) -> Result<Load, FileError> {
        let missing = || self.wrong(&format!("{key}.{name}"), "is missing");
        let load = Load {
            force_n: vector(force_n.ok_or_else(missing)?),
            torque_nm: torque_nm.map(vector).unwrap_or_default(),
        };
        if load == Load::NONE {
            return Err(self.wrong(key, "found a load of zero, which deflects nothing"));
        }
        match faint_load(&load.wrench()) {
            Some(problem) => Err(self.wrong(key, problem)),
            None => Ok(load),
        }
    }
}
