//! What nearly every command needs.

pub(super) use std::path::{Path, PathBuf};

pub(super) use crate::codes::{Condition, ConditionCode, ErrorCode};
pub(super) use crate::files::FileError;
pub(super) use crate::scenario::Scenario;
pub(super) use crate::task::AccuracyKind;
pub(super) use crate::text::wording::{counted, joined, naming};
pub(super) use clap::Args;
pub(super) use serde_json::{Value, json};

pub(super) use super::table::{aligned, in_um, noted, number, or_dash, table};
pub(super) use super::{Common, Report, named_by_file, without_effect};
