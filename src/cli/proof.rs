//! How far the bound is proved, as options; and what came of it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::files::output::write_whole;
use crate::plan::proof::{NoProof, ProofLimits};
use crate::plan::search::{Bound, ProofFile, TIGHT};
use crate::record::messages::ProvenanceMessage;
use indicatif::ProgressStyle;
use serde::Serialize;

use super::command_prelude::*;
use super::progress::bar;

/// After so many boxes a proof ends of which nothing is asked: a second at most.
const BOXES: u64 = 300_000;

/// How far the bound that no plan can beat is proved.
#[derive(Debug, Args)]
pub struct ProofArgs {
    /// Prove the bound until it is that near, as "1%" or "0.01", however long it takes
    #[arg(long, value_name = "GAP", value_parser = share)]
    prove: Option<f64>,
    /// Go on proving for so long, as "60s" or "5min"; the result then depends on the clock
    #[arg(long, value_name = "TIME", value_parser = time)]
    prove_time: Option<Duration>,
    /// Prove nothing: the bound rests on searches
    #[arg(long, conflicts_with_all = ["prove", "prove_time"])]
    no_proof: bool,
    /// Where to write the proof, for `tools/check_proof.py`
    #[arg(long, value_name = "FILE", conflicts_with = "no_proof")]
    proof_out: Option<PathBuf>,
}

impl ProofArgs {
    /// No proof.
    pub const NONE: Self = Self {
        prove: None,
        prove_time: None,
        no_proof: true,
        proof_out: None,
    };

    /// Says what is proved; writes the proof where that is wanted.
    pub fn tell(
        &self,
        bound: &Bound,
        provenance: &ProvenanceMessage,
        report: &mut Report,
    ) -> anyhow::Result<()> {
        report.text += &told(bound);
        if let Some(path) = &self.proof_out {
            let proof = bound.proof().and_then(|proof| proof.as_ref().ok()?.file());
            let nothing = "there is no proof to write";
            let nothing = || FileError::new(path, nothing).code(ErrorCode::NotWritable);
            let written = match proof {
                Some(proof) => {
                    let file = WrittenProof { provenance, proof };
                    write_whole(path, &serde_json::to_vec(&file)?)
                }
                None => Err(nothing()),
            };
            report.noted(path, written);
        }
        Ok(())
    }

    /// Does what needs an effort, and shows how near the proof is meanwhile.
    pub fn with_effort<T>(
        &self,
        common: &Common,
        stop: &AtomicBool,
        work: impl FnOnce(Option<ProofLimits<'_>>) -> T,
    ) -> T {
        if self.no_proof {
            return work(None);
        }
        let is_asked_for = self.prove.is_some() || self.prove_time.is_some();
        let start = Instant::now();
        let bar = bar(common.quiet, "proving the bound");
        if let Ok(style) = ProgressStyle::with_template("{prefix} {spinner} {msg}") {
            bar.set_style(style);
        }
        let is_to_stop = || {
            let is_over = (self.prove_time).is_some_and(|time| start.elapsed() >= time);
            is_over || stop.load(Ordering::Relaxed)
        };
        let progress = |gap: Option<f64>, boxes: u64| {
            let near = gap.map_or_else(String::new, |gap| format!("within {}, ", percent(gap)));
            bar.set_message(format!("{near}{boxes} boxes"));
        };
        let effort = ProofLimits {
            gap: self.prove.unwrap_or(TIGHT),
            boxes: if is_asked_for { u64::MAX } else { BOXES },
            records: self.proof_out.is_some(),
            stop: &is_to_stop,
            progress: &progress,
        };
        let result = work(Some(effort));
        bar.finish_and_clear();
        result
    }
}

/// What a file of a proof has.
#[derive(Serialize)]
struct WrittenProof<'a> {
    provenance: &'a ProvenanceMessage,
    #[serde(flatten)]
    proof: ProofFile,
}

/// What is proved, in words; nothing where no proof was asked for.
fn told(bound: &Bound) -> String {
    match bound.proof() {
        None => String::new(),
        Some(Ok(proof)) => format!(
            "Proved: no experiment's directional derivative is more than {} above the largest found ({} boxes){}.\n",
            percent(proof.largest().gap()),
            proof.largest().boxes,
            leaving_out(proof.left_out())
        ),
        Some(Err(NoProof::Unfinished)) => {
            "Nothing is proved yet: --prove-time 60s gives the proof more time.\n".to_owned()
        }
        Some(Err(error)) => format!("Nothing is proved: {error}.\n"),
    }
}

/// What a proof leaves out, in words that follow it.
pub fn leaving_out(names: &[String]) -> String {
    naming(names, ", with {} assumed exact")
}

/// How near the proof is; null where there is none.
pub fn proof_json(bound: &Bound) -> Value {
    match bound.proof() {
        Some(Ok(proof)) => {
            json!({ "gap": proof.largest().gap(), "boxes": proof.largest().boxes, "left_out": proof.left_out() })
        }
        _ => Value::Null,
    }
}

fn percent(share: f64) -> String {
    format!("{:.2} %", share * 100.0)
}

/// A share above zero and below one hundred: "0.1%", "0.001".
fn share(text: &str) -> Result<f64, String> {
    let (number, unit) = match text.trim().strip_suffix('%') {
        Some(number) => (number.trim_end(), 0.01),
        None => (text.trim(), 1.0),
    };
    let share = number.parse::<f64>().map(|number| number * unit);
    match share {
        Ok(share) if (1e-6..=100.0).contains(&share) => Ok(share),
        _ => Err("a share of 0.0001% to 10000% is wanted, as in \"0.1%\" or \"0.001\"".to_owned()),
    }
}

/// A time: "60s", "2min", "1.5h", or seconds.
fn time(text: &str) -> Result<Duration, String> {
    let text = text.trim();
    let units = [("min", 60.0), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let (number, unit) = (units.iter())
        .find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit)))
        .unwrap_or((text, 1.0));
    let seconds = number.trim_end().parse::<f64>().ok();
    (seconds.map(|seconds| seconds * unit))
        .filter(|seconds| *seconds > 0.0)
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .ok_or_else(|| "a time is wanted, as in \"60s\" or \"5min\"".to_owned())
}
