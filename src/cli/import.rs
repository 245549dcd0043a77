//! `import`: a foreign table becomes a measurement file.

use crate::files::roles::Roles;
use crate::measurement::foreign::{ImportedTable, import};
use crate::record::messages::SchemaMessage;

use super::command_prelude::*;
use super::{Said, check_outputs, program};

#[derive(Debug, Args)]
pub struct Import {
    /// The table that another program wrote.
    table: PathBuf,
    /// What its columns are, in TOML.
    #[arg(long, value_name = "FILE")]
    mapping: PathBuf,
    /// Where to write the measurements.
    #[arg(long, alias = "out", value_name = "FILE")]
    measurements_out: Option<PathBuf>,
    #[command(flatten)]
    pub said: Said,
}

impl Import {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let mut roles = Roles::default();
        roles.reads("the table", &self.table);
        roles.reads("the mapping", &self.mapping);
        let out = self.measurements_out.as_deref();
        let written = out.map(|path| ("--measurements-out", path));
        check_outputs(&mut roles, written.as_slice())?;
        let imported = import(&self.table, &self.mapping)?;
        let ranges: Vec<_> = (imported.ranges.iter())
            .map(|(column, range)| json!({ "column": column, "range": range }))
            .collect();
        let json = json!({
            "schema": SchemaMessage::new("import"),
            "provenance": program(),
            "measurements_file": out,
            "rows": imported.rows,
            "columns": ranges,
            "unread": imported.unread,
        });
        let mut report = Report::new(json, describe(&self.table, &imported), Vec::new());
        if let Some(path) = out {
            report.write(path, &imported.text)?;
        }
        Ok(report)
    }
}

fn describe(path: &Path, imported: &ImportedTable) -> String {
    let rows = counted(imported.rows as u64, "row");
    let shown = |value: f64| format!("{value:.5}");
    let ranges = (imported.ranges.iter())
        .map(|(column, [low, high])| vec![column.clone(), shown(*low), shown(*high)]);
    let ranges = table("column | smallest | largest", ranges);
    let unread = naming(&imported.unread, "Not read: {}.\n");
    format!("{}: {rows}\n{ranges}{unread}", path.display())
}
