//! From a file, and what a scenario adds to it, to a compiled model: looked at before MuJoCo does.

use std::path::Path;
use std::sync::Arc;

use mujoco_rs::prelude::{MjModel, MjSpec};

use super::error::refused;
use super::messages::{self, refusal};
use super::rehearsal::rehearse;
use super::scan::scan;
use super::urdf::UrdfText;
use super::{Additions, Model, ModelError, beside, foreign, obstacle};
use crate::files::source;

impl Model {
    /// Compiles the MJCF file with MuJoCo.
    ///
    /// # Errors
    /// The file cannot be read, or MuJoCo refuses it.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        let Some(read) = prepare(path)? else {
            let inner = MjModel::from_xml(path)
                .map_err(|error| refused(path, refusal(path, &error.to_string())))?;
            if beside::is_in(&inner) {
                let mut spec = specification_of(path)?;
                let left_out =
                    beside::leave_out(&mut spec).map_err(|error| refused(path, error))?;
                return Self::compiled((spec, left_out), path);
            }
            return Self::new(inner, path);
        };
        Self::compiled(read.spec(path)?, path)
    }

    /// The model of a specification, from which this was left out.
    fn compiled(
        (mut spec, left_out): (MjSpec, Vec<String>),
        path: &Path,
    ) -> Result<Self, ModelError> {
        let inner = (spec.compile()).map_err(|error| refused(path, error.to_string()))?;
        Ok(Self {
            left_out: Arc::new(left_out),
            ..Self::new(inner, path)?
        })
    }

    /// Compiles the MJCF file with what a scenario adds: obstacles, which stand still and collide with all
    /// that collides, tools and payloads.
    ///
    /// # Errors
    /// The file cannot be read, or MuJoCo refuses it with the additions, as where the model has a
    /// body or a geometry of the same name.
    pub fn load_with(path: &Path, additions: &Additions) -> Result<Self, ModelError> {
        if additions.is_empty() {
            return Self::load(path);
        }
        let plain = Self::load(path)?;
        let (mut spec, left_out) = plain.specification()?;
        for obstacle in &additions.obstacles {
            obstacle::add(&mut spec, obstacle).map_err(|message| refused(path, message))?;
        }
        if !additions.tools.is_empty() || !additions.payloads.is_empty() {
            plain.mount(&mut spec, additions)?;
        }
        Self::compiled((spec, left_out), path)
    }

    /// What the file of this model says, to be edited, and what is left out of it, in words. The model is what the file says alone.
    pub(super) fn specification(&self) -> Result<(MjSpec, Vec<String>), ModelError> {
        let path = self.path();
        if let Some(urdf) = prepare(path)? {
            return urdf.spec(path);
        }
        let mut spec = specification_of(path)?;
        let left_out = if self.left_out().is_empty() {
            Vec::new()
        } else {
            beside::leave_out(&mut spec).map_err(|error| refused(path, error))?
        };
        Ok((spec, left_out))
    }
}

/// What an MJCF file says.
fn specification_of(path: &Path) -> Result<MjSpec, ModelError> {
    MjSpec::from_xml(path).map_err(|error| refused(path, refusal(path, &error.to_string())))
}

/// Looks at a file before MuJoCo does; MuJoCo's messages are taken over, and a URDF comes
/// back as MuJoCo's compiler takes it.
pub(super) fn prepare(path: &Path) -> Result<Option<UrdfText>, ModelError> {
    if path.to_str().is_none_or(|path| path.contains('\0')) {
        return Err(refused(path, "its path is not UTF-8 text"));
    }
    // MuJoCo's own message for a missing file does not say why; the system's does.
    std::fs::metadata(path).map_err(|source| ModelError::Read {
        path: path.to_owned(),
        source,
    })?;
    let untrusted = |problem, hint| ModelError::Untrusted {
        path: path.to_owned(),
        problem,
        hint,
    };
    let bytes = source::read(path).map_err(|problem| untrusted(problem, None))?;
    let text = String::from_utf8_lossy(&bytes).into_owned();
    foreign::refuse(path, &text)?;
    scan(path).map_err(|problem| untrusted(problem, None))?;
    rehearse(path).map_err(|refusal| untrusted(refusal.problem, refusal.hint))?;
    messages::take_over();
    Ok(UrdfText::of(path, text))
}
