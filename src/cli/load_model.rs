//! `load-model`: only loads a model, in a process that may break down.

use std::path::PathBuf;

use crate::mujoco::{Model, State, limit_process};
use clap::Args;

/// Its name on the command line.
pub const NAME: &str = "load-model";

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
