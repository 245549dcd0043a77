//! The table `[gate]`.

use super::{Checker, hint_for};
use crate::files::FileError;
use crate::gate::Gate;

impl Checker<'_> {
    pub(super) fn gate(&self, gate: Gate) -> Result<Gate, FileError> {
        match gate.check() {
            Ok(()) => Ok(gate),
            Err((key, problem)) => {
                let wrong = self.wrong(&format!("gate.{key}"), &*problem);
                Err(wrong.hinted(hint_for(&problem)))
            }
        }
    }
}
