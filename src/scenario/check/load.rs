//! The table `[load]`, and every other force and torque.

use nalgebra::Vector3;

use super::Checker;
use crate::experiment::Loads;
use crate::files::FileError;
use crate::quantities::limits::MOST_LISTED;
use crate::quantities::plausible::{
    DIRECTION, FORCE, FORCE_LIMIT, LEAST_FORCE, TORQUE, faint_load,
};
use crate::robot::Load;
use crate::scenario::file::{LoadKind, WrenchTable};

impl Checker<'_> {
    pub(super) fn loads(&self, kind: &LoadKind) -> Result<Loads, FileError> {
        Ok(match kind {
            LoadKind::Fixed { force_n, torque_nm } => {
                Loads::Fixed(self.load("load", force_n, torque_nm.as_deref())?)
            }
            LoadKind::Direction {
                direction,
                force_min_n,
                force_max_n,
            } => {
                let key = "load.direction";
                let direction = Vector3::from(self.numbers(key, direction, &DIRECTION)?)
                    .try_normalize(f64::MIN_POSITIVE)
                    .ok_or_else(|| self.wrong(key, "found 0, 0, 0; a direction is needed"))?;
                let low = self.number("load.force_min_n", *force_min_n, &LEAST_FORCE)?;
                let high = self.number("load.force_max_n", *force_max_n, &FORCE_LIMIT)?;
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
                force_max_n: self.number("load.force_max_n", *force_max_n, &FORCE_LIMIT)?,
            },
            LoadKind::List { wrenches } => {
                if wrenches.is_empty() {
                    return Err(self.wrong("load.wrenches", "is empty"));
                }
                self.at_most("load.wrenches", wrenches.len(), MOST_LISTED)?;
                let load = |(index, wrench): (usize, &WrenchTable)| {
                    let key = format!("load.wrenches[{index}]");
                    self.load(&key, &wrench.force_n, wrench.torque_nm.as_deref())
                };
                Loads::List(
                    wrenches
                        .iter()
                        .enumerate()
                        .map(load)
                        .collect::<Result<_, _>>()?,
                )
            }
        })
    }

    /// A force and a torque, of which one must act.
    pub(super) fn load(
        &self,
        key: &str,
        force_n: &[f64],
        torque_nm: Option<&[f64]>,
    ) -> Result<Load, FileError> {
        let torque_nm = torque_nm.map(<[f64]>::to_vec);
        let parts = [&Some(force_n.to_vec()), &torque_nm];
        self.load_of(key, ["force_n", "torque_nm"], parts)
    }

    /// A force and a torque under the keys of their names, of which one must act. A force must be given.
    pub(super) fn load_of(
        &self,
        key: &str,
        [force, torque]: [&str; 2],
        [force_n, torque_nm]: [&Option<Vec<f64>>; 2],
    ) -> Result<Load, FileError> {
        let (force, torque) = (format!("{key}.{force}"), format!("{key}.{torque}"));
        let force_n = (force_n.as_ref()).ok_or_else(|| self.wrong(&force, "is missing"))?;
        let torque_nm = torque_nm.as_deref().unwrap_or(&[0.0; 3]);
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
