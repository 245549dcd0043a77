//! `load-model`: only loads a model, in a process that may break down.

use std::path::PathBuf;

use crate::mujoco::{Model, State, limit_process, rehearse_with};
use clap::Args;

/// Its name on the command line.
const NAME: &str = "load-model";

#[derive(Debug, Args)]
pub struct LoadModel {
    model: PathBuf,
}

impl LoadModel {
    pub fn execute(&self) -> anyhow::Result<Vec<crate::codes::Condition>> {
        limit_process();
        let model = Model::load(&self.model)?;
        let mut state = State::new(&model);
        state.move_to(&[]);
        state.nearest_contact(0.0);
        Ok(Vec::new())
    }
}

/// Has every model loaded by such a process first, where there is a program for it.
pub fn rehearse_models(itself: Option<PathBuf>) {
    if let Some(program) = itself {
        rehearse_with(program, NAME);
    }
}
