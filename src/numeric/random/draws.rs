//! The random numbers of virtual robots in a file: with those of an older program a newer one simulates the same readings, whatever it
//! makes of seeds.
//!
//! A line for each stream, seed and run, with its numbers in their order: standard normal ones, and of frames those that
//! make them. While [`Draws`] lives, what is drawn is noted, or taken from the file instead.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::files::output::write_whole;
use crate::files::{FileError, read_text};

const HEADER: &str = "stream,seed,run,numbers";

/// Whether [`NOTED`] is of any concern.
static IS_NOTING: AtomicBool = AtomicBool::new(false);
static NOTED: Mutex<Noted> = Mutex::new(Noted::NEW);

/// Stream, seed and run.
type DrawKey = (String, u64, u64);

/// What was drawn.
#[derive(Debug)]
struct Noted {
    numbers: BTreeMap<DrawKey, Vec<f64>>,
    /// Whether the numbers are taken from a file.
    is_given: bool,
    is_used: bool,
    /// The first that was asked for and is not in the file.
    missing: Option<(DrawKey, usize)>,
}

impl Noted {
    const NEW: Self = Self {
        numbers: BTreeMap::new(),
        is_given: false,
        is_used: false,
        missing: None,
    };
}

fn noted() -> MutexGuard<'static, Noted> {
    NOTED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The random numbers of all virtual robots are noted, or taken from a file, as long as this lives; there is one at a time.
#[derive(Debug)]
pub struct Draws {
    path: PathBuf,
}

impl Draws {
    /// Notes what is drawn, for a file.
    pub fn to_file(path: &Path) -> Self {
        Self::begun(path, Noted::NEW)
    }

    /// Takes what is drawn from a file.
    pub fn from_file(path: &Path) -> Result<Self, FileError> {
        let mut given = Noted {
            is_given: true,
            ..Noted::NEW
        };
        let text = read_text(path)?;
        let mut lines = text.lines().enumerate();
        if lines.next().map(|(_, line)| line) != Some(HEADER) {
            let problem = format!("does not begin with {HEADER:?}");
            return Err(FileError::new(path, problem).hint("--draws-out writes such a file"));
        }
        for (index, line) in lines {
            let (key, numbers) = parsed(line).ok_or_else(|| {
                FileError::new(
                    path,
                    "is no name of a stream, a seed, a run and finite numbers",
                )
                .at(format!("line {}", index + 1))
            })?;
            given.numbers.insert(key, numbers);
        }
        Ok(Self::begun(path, given))
    }

    fn begun(path: &Path, new: Noted) -> Self {
        *noted() = new;
        IS_NOTING.store(true, Ordering::SeqCst);
        Self {
            path: path.to_owned(),
        }
    }

    /// Writes what was drawn.
    ///
    /// # Errors
    /// Nothing was drawn, numbers are missing in the file, or it cannot be written.
    pub fn finish(self) -> Result<(), FileError> {
        let noted = std::mem::replace(&mut *noted(), Noted::NEW);
        if !noted.is_used {
            let problem =
                "no virtual robot was sampled: --draws and --draws-out have no effect here";
            return Err(FileError::new(&self.path, problem));
        }
        if let Some(((stream, seed, run), index)) = noted.missing {
            let problem =
                format!("has no number {index} of stream {stream}, seed {seed}, run {run}");
            return Err(FileError::new(&self.path, problem)
                .hint("it is of another command, seed or number of runs"));
        }
        if noted.is_given {
            return Ok(());
        }
        let mut text = format!("{HEADER}\n");
        for ((stream, seed, run), numbers) in &noted.numbers {
            text += &format!("{stream},{seed},{run}");
            for number in numbers {
                text += &format!(",{number:?}");
            }
            text.push('\n');
        }
        write_whole(&self.path, text.as_bytes())
    }
}

impl Drop for Draws {
    fn drop(&mut self) {
        IS_NOTING.store(false, Ordering::SeqCst);
    }
}

fn parsed(line: &str) -> Option<(DrawKey, Vec<f64>)> {
    let mut cells = line.split(',');
    let stream = cells.next()?.to_owned();
    let mut whole = || cells.next()?.parse().ok();
    let key = (stream, whole()?, whole()?);
    let number = |cell: &str| cell.parse().ok().filter(|number: &f64| number.is_finite());
    Some((key, cells.map(number).collect::<Option<_>>()?))
}

/// Notes the first numbers of a stream, or replaces them by a file's.
pub(crate) fn pass(stream: &str, [seed, run]: [u64; 2], numbers: &mut [f64]) {
    if !IS_NOTING.load(Ordering::Relaxed) {
        return;
    }
    let mut noted = noted();
    noted.is_used = true;
    let key = (stream.to_owned(), seed, run);
    if !noted.is_given {
        let known = noted.numbers.entry(key).or_default();
        if known.len() < numbers.len() {
            *known = numbers.to_vec();
        }
        return;
    }
    let given = noted.numbers.get(&key).map_or(&[][..], Vec::as_slice);
    for (number, given) in numbers.iter_mut().zip(given) {
        *number = *given;
    }
    let count = given.len();
    if count < numbers.len() && noted.missing.is_none() {
        noted.missing = Some((key, count));
    }
}

/// The same for consecutive runs side by side.
pub(super) fn pass_lanes<const LANES: usize>(
    stream: &str,
    [seed, first_run]: [u64; 2],
    numbers: &mut [[f64; LANES]],
) {
    if !IS_NOTING.load(Ordering::Relaxed) {
        return;
    }
    for lane in 0..LANES {
        let mut own: Vec<f64> = numbers.iter().map(|lanes| lanes[lane]).collect();
        pass(
            stream,
            [seed, first_run.wrapping_add(lane as u64)],
            &mut own,
        );
        for (lanes, own) in numbers.iter_mut().zip(own) {
            lanes[lane] = own;
        }
    }
}
