//! From a file, and what a scenario adds to it, to a compiled model: looked at before MuJoCo does.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use mujoco_rs::prelude::{MjModel, MjSpec};

use super::error::{refused, unsuitable};
use super::kept::{KeptModel, LONG};
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
        let text = prepare(path)?;
        let kept = KeptModel::of(path, additions);
        let found = || kept.as_ref().and_then(KeptModel::read);
        let found_or_rehearsed = match found() {
            None if additions.is_empty() => {
                rehearse(path)?;
                found()
            }
            there => there,
        };
        if let Some((inner, left_out)) = found_or_rehearsed {
            return Self::left_without(inner, path, left_out)?.with_whole(&additions.payloads);
        }
        let plain = (!additions.is_empty())
            .then(|| Self::load(path))
            .transpose()?;
        let (began, warnings) = (Instant::now(), messages::warnings());
        let (mut spec, left_out) = specification_of(path, &text)?;
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
        // A warning is to be heard by every command.
        let is_silent = messages::warnings() == warnings;
        if let Some(kept) = kept.filter(|_| is_silent && began.elapsed() > LONG) {
            kept.write(&inner, &left_out);
        }
        Self::left_without(inner, path, left_out)?.with_whole(&additions.payloads)
    }

    fn left_without(inner: MjModel, path: &Path, left_out: Vec<String>) -> Result<Self, FileError> {
        Ok(Self {
            left_out: Arc::new(left_out),
            ..Self::new(inner, path)?
        })
    }
}

/// What a file says, to be edited, and what is left out of it, in words.
pub(super) fn specification(path: &Path) -> Result<(MjSpec, Vec<String>), FileError> {
    specification_of(path, &prepare(path)?)
}

/// The same of a file that was looked at, with its text.
fn specification_of(path: &Path, text: &str) -> Result<(MjSpec, Vec<String>), FileError> {
    rehearse(path)?;
    if urdf::is_one(text) {
        return urdf::specification(path, text);
    }
    let mut spec =
        MjSpec::from_xml(path).map_err(|error| refused(path, refusal(path, &error.to_string())))?;
    // Fused bodies have no names, and payloads none to be found by; the statics are the same.
    spec.compiler_mut().set_fusestatic(false);
    let left_out =
        beside::leave_out(&mut spec).map_err(|error| refused(path, error.to_string()))?;
    Ok((spec, left_out))
}

/// Looks at a file before MuJoCo does, whose messages are taken over; its text.
fn prepare(path: &Path) -> Result<String, FileError> {
    if path.to_str().is_none_or(|path| path.contains('\0')) {
        return Err(unsuitable(path, "its path is not UTF-8 text"));
    }
    let text = String::from_utf8_lossy(&read_bytes(path)?).into_owned();
    unsuited::refuse(path, &text)?;
    messages::take_over();
    Ok(text)
}
