//! The table `[load]`, and every other force and torque.

use nalgebra::Vector3;

use super::Checker;
use crate::files::FileError;
use crate::robot::Load;
use crate::scenario::Loads;
use crate::scenario::file::{LoadKind, WrenchTable};

impl Checker<'_> {
    pub(super) fn loads(&self, kind: &LoadKind) -> Result<Loads, FileError> {
        Ok(match kind {
            LoadKind::Fixed { force_n, torque_nm } => {
                Loads::Fixed(self.acting_load("load", *force_n, *torque_nm)?)
            }
            LoadKind::Direction {
                direction,
                force_min_n,
                force_max_n,
            } => {
                let key = "load.direction";
                for value in direction {
                    self.finite(key, *value)?;
                }
                let direction = Vector3::from(*direction)
                    .try_normalize(0.0)
                    .ok_or_else(|| self.wrong(key, "found 0, 0, 0; a direction is needed"))?;
                let low = self.not_negative("load.force_min_n", *force_min_n)?;
                let high = self.positive("load.force_max_n", *force_max_n)?;
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
                force_max_n: self.positive("load.force_max_n", *force_max_n)?,
            },
            LoadKind::List { wrenches } => {
                if wrenches.is_empty() {
                    return Err(self.wrong("load.wrenches", "is empty"));
                }
                let load = |(index, wrench): (usize, &WrenchTable)| {
                    let key = format!("load.wrenches[{index}]");
                    self.acting_load(&key, wrench.force_n, wrench.torque_nm)
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

    pub(super) fn load(
        &self,
        key: &str,
        force: [f64; 3],
        torque: [f64; 3],
    ) -> Result<Load, FileError> {
        for value in force {
            self.finite(&format!("{key}.force_n"), value)?;
        }
        for value in torque {
            self.finite(&format!("{key}.torque_nm"), value)?;
        }
        Ok(Load {
            force_n: force.into(),
            torque_nm: torque.into(),
        })
    }

    fn acting_load(&self, key: &str, force: [f64; 3], torque: [f64; 3]) -> Result<Load, FileError> {
        let load = self.load(key, force, torque)?;
        if load == Load::NONE {
            return Err(self.wrong(key, "found a load of zero, which deflects nothing"));
        }
        Ok(load)
    }
}
