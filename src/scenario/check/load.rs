//! The table `[load]`, and every other force and torque.

use nalgebra::Vector3;

use super::Checker;
use crate::experiment::Loads;
use crate::files::FileError;
use crate::quantities::limits::MOST_LISTED;
use crate::quantities::plausible::{FORCE, FORCE_LIMIT, LEAST_FORCE, TORQUE, faint_load};
use crate::robot::Load;
use crate::scenario::file::{LoadKind, WrenchTable};

impl Checker<'_> {
    pub(super) fn loads(&self, kind: &LoadKind) -> Result<Loads, FileError> {
        let most = |value: f64| self.number("load.force_max_n", value, &FORCE_LIMIT);
        Ok(match kind {
            LoadKind::Fixed { force_n, torque_nm } => {
                let parts = [Some(force_n.as_slice()), torque_nm.as_deref()];
                Loads::Fixed(self.load("load", ["force_n", "torque_nm"], parts)?)
            }
            LoadKind::Direction {
                direction,
                force_min_n,
                force_max_n,
            } => {
                let direction = self.unit("load.direction", direction)?;
                let low = self.number("load.force_min_n", *force_min_n, &LEAST_FORCE)?;
                let high = most(*force_max_n)?;
                if low > high {
                    let problem =
                        format!("found {low}; at most load.force_max_n = {high} is allowed");
                    return Err(self.wrong("load.force_min_n", problem));
                }
                Loads::Direction {
                    direction,
                    force_n: [low, high],
                }
            }
            LoadKind::Any { force_max_n } => Loads::Any {
                force_max_n: most(*force_max_n)?,
            },
            LoadKind::List { wrenches } => {
                if wrenches.is_empty() {
                    return Err(self.wrong("load.wrenches", "is empty"));
                }
                let load = |key: &str, wrench: &WrenchTable| {
                    let parts = [Some(wrench.force_n.as_slice()), wrench.torque_nm.as_deref()];
                    self.load(key, ["force_n", "torque_nm"], parts)
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

    /// A force (N) and a torque (N m) under the keys of their names, of which one must act. A force must be given.
    pub(super) fn load(
        &self,
        key: &str,
        names: [&str; 2],
        [force_n, torque_nm]: [Option<&[f64]>; 2],
    ) -> Result<Load, FileError> {
        let [force, torque] = names.map(|name| format!("{key}.{name}"));
        let force_n = force_n.ok_or_else(|| self.wrong(&force, "is missing"))?;
        let torque_nm = torque_nm.unwrap_or(&[0.0; 3]);
        let load = Load {
            force_n: Vector3::from(self.numbers(&force, force_n, &FORCE)?),
            torque_nm: Vector3::from(self.numbers(&torque, torque_nm, &TORQUE)?),
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
