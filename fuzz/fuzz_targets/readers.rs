//! Every reader of texts on whatever libFuzzer makes up: the first byte says which. `make fuzz` runs it.

#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use elastocal::comparison::results::ResultsFile;
use elastocal::compensation::read_targets;
use elastocal::files::{FileError, read_text};
use elastocal::identification::StoredIdentification;
use elastocal::laboratory::Dialect;
use elastocal::measurement::foreign::import;
use elastocal::measurement::{read_measured, read_measurements_so_far};
use elastocal::plan::read_plan;
use elastocal::record::tally_file::TallyFile;
use elastocal::scenario::Scenario;
use elastocal::workflow::calibrated::CalibratedRobot;
use elastocal::workflow::stored_robot::StoredRobot;
use libfuzzer_sys::fuzz_target;

/// The file that is read, again and again.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let name = format!("elastocal-fuzz-{}", std::process::id());
    std::env::temp_dir().join(name)
});

/// The robot that identifications are of.
static ROBOT: LazyLock<Scenario> = LazyLock::new(|| scenario("kr270"));
/// The robot that absolute readings are of.
static UR10: LazyLock<Scenario> = LazyLock::new(|| scenario("ur10"));

fn scenario(name: &str) -> Scenario {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios");
    Scenario::load(&Path::new(folder).join(format!("{name}.toml"))).expect("the scenario is valid")
}

/// A foreign table and its mapping.
static FOREIGN: LazyLock<[PathBuf; 2]> = LazyLock::new(|| {
    let texts = [
        "A1;A2;X;Y;Z\n0,5;-10;1000,5;-200;300\n1,25;20;1010,5;-210;310\n",
        "[[joint]]\ncolumn = \"A1\"\nunit = \"rad\"\n\n[[joint]]\ncolumn = \"A2\"\nunit = \"deg\"\n\n[position]\ncolumns = [\"X\", \"Y\", \"Z\"]\nunit = \"mm\"\n",
    ];
    let files = ["table.csv", "mapping.toml"].map(|name| FILE.with_extension(name));
    for (file, text) in files.iter().zip(texts) {
        std::fs::write(file, text).expect("the file can be written");
    }
    files
});

fn read_dialect() -> Result<Dialect, FileError> {
    let text = read_text(&FILE)?;
    Dialect::read(&text).map_err(|error| FileError::new(&FILE, error.to_string()))
}

/// A robot that was fitted to absolute readings.
fn read_absolute() -> Result<(), FileError> {
    if let Some(stored) = StoredRobot::read(&FILE)? {
        CalibratedRobot::of_absolute(&UR10.task.belief, &FILE, &stored)?;
    }
    Ok(())
}

fuzz_target!(|data: &[u8]| {
    let Some((&reader, text)) = data.split_first() else {
        return;
    };
    std::fs::write(&*FILE, text).expect("the file can be written");
    let error = match reader {
        b's' => Scenario::load(&FILE).err(),
        b'p' => read_plan(&FILE, 6).err(),
        b'm' => read_measured(&FILE, 6).err(),
        b'n' => read_measurements_so_far(&FILE, 6).err(),
        b'i' => StoredIdentification::read(&FILE, &ROBOT.task.belief.nominal).err(),
        b'a' => read_absolute().err(),
        b'x' => read_targets(&FILE).err(),
        b'f' => import(&FILE, &FOREIGN[1]).err(),
        b'o' => import(&FOREIGN[0], &FILE).err(),
        b'd' => read_dialect().err(),
        b't' => TallyFile::read(&FILE).err(),
        b'r' => ResultsFile::read(&FILE).err(),
        _ => None,
    };
    if let Some(error) = error {
        assert!(error.to_string().len() < 4000, "an error that nobody reads");
    }
});
