//! From a file, and what a scenario adds to it, to a compiled model: looked at before MuJoCo does.

use std::path::Path;
use std::sync::Arc;

use mujoco_rs::prelude::MjSpec;

use super::error::refused;
use super::messages::{self, refusal};
use super::rehearsal::rehearse;
use super::{Additions, Model, beside, obstacle, unsuited, urdf};
use crate::files::{FileError, read_bytes};

impl Model {
    /// Compiles the MJCF file, or URDF, with MuJoCo.
    ///
    /// # Errors
    /// The file cannot be read, or MuJoCo refuses it.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::load_with(path, &Additions::default())
    }

    /// The same with what a scenario adds: obstacles, which stand still and collide with all that collides, tools and
    /// payloads.
    ///
    /// # Errors
    /// The file cannot be read, or MuJoCo refuses it with the additions, as where the model has a
    /// body or a geometry of the same name.
    pub fn load_with(path: &Path, additions: &Additions) -> Result<Self, FileError> {
        let plain = (!additions.is_empty())
            .then(|| Self::load(path))
            .transpose()?;
        let (mut spec, left_out) = specification(path)?;
        for obstacle in &additions.obstacles {
            obstacle::add(&mut spec, obstacle).map_err(|message| refused(path, message))?;
        }
        if let Some(plain) = &plain {
            plain.mount(&mut spec, additions)?;
        }
        let inner = spec.compile().map_err(|error| {
            let shortened = error.to_string();
            let is_of_file = plain.is_none();
            let message = is_of_file.then(|| refusal(path, &shortened));
            refused(path, message.unwrap_or(shortened))
        })?;
        Ok(Self {
            left_out: Arc::new(left_out),
            ..Self::new(inner, path)?
        })
    }
}

/// What a file says, to be edited, and what is left out of it, in words.
pub(super) fn specification(path: &Path) -> Result<(MjSpec, Vec<String>), FileError> {
    if let Some(text) = prepare(path)? {
        return urdf::specification(path, &text);
    }
    let mut spec =
        MjSpec::from_xml(path).map_err(|error| refused(path, refusal(path, &error.to_string())))?;
    let left_out =
        beside::leave_out(&mut spec).map_err(|error| refused(path, error.to_string()))?;
    Ok((spec, left_out))
}

/// Looks at a file before MuJoCo does; MuJoCo's messages are taken over, and the text of a URDF comes back.
pub(super) fn prepare(path: &Path) -> Result<Option<String>, FileError> {
    if path.to_str().is_none_or(|path| path.contains('\0')) {
        return Err(refused(path, "its path is not UTF-8 text"));
    }
    let text = String::from_utf8_lossy(&read_bytes(path)?).into_owned();
    unsuited::refuse(path, &text)?;
    rehearse(path)?;
    messages::take_over();
    Ok(urdf::is_one(&text).then_some(text))
}
