//! Every reader of texts on whatever libFuzzer makes up: the first byte says which. `make fuzz` runs it.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use elastocal::comparison::results::ResultsFile;
use elastocal::files::{FileError, read_text};
use elastocal::identification::StoredIdentification;
use elastocal::laboratory::Dialect;
use elastocal::measurement::{read_measured, read_measurements_so_far};
use elastocal::plan::read_plan;
use elastocal::record::tally_file::TallyFile;
use elastocal::scenario::Scenario;
use libfuzzer_sys::fuzz_target;

/// The file that is read, again and again.
static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let name = format!("elastocal-fuzz-{}", std::process::id());
    std::env::temp_dir().join(name)
});

/// The robot that identifications are of.
static ROBOT: LazyLock<Scenario> = LazyLock::new(|| {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/kr270.toml");
    Scenario::load(file.as_ref()).expect("the scenario is valid")
});

fn read_dialect() -> Result<Dialect, FileError> {
    let text = read_text(&FILE)?;
    Dialect::read(&text).map_err(|error| FileError::new(&FILE, error.to_string()))
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
        b'd' => read_dialect().err(),
        b't' => TallyFile::read(&FILE).err(),
        b'r' => ResultsFile::read(&FILE).err(),
        _ => None,
    };
    if let Some(error) = error {
        assert!(error.to_string().len() < 4000, "an error that nobody reads");
    }
});
