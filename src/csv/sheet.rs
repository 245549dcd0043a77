//! A table to be written, column by column.

/// A table whose columns are added one after the other.
#[derive(Debug)]
pub struct Sheet<'a, R> {
    /// What its rows are of.
    pub of: &'a [R],
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl<'a, R> Sheet<'a, R> {
    /// A row for each of these.
    pub fn new(of: &'a [R]) -> Self {
        Self {
            of,
            columns: Vec::new(),
            rows: vec![Vec::new(); of.len()],
        }
    }

    /// Columns of these names, and what a row has in them.
    pub fn add(&mut self, names: &[impl AsRef<str>], fields: impl Fn(&R) -> Vec<String>) {
        (self.columns).extend(names.iter().map(|name| name.as_ref().to_owned()));
        for (row, of) in self.rows.iter_mut().zip(self.of) {
            row.append(&mut fields(of));
        }
    }

    /// The table, its columns' names in the first line.
    pub fn text(self) -> String {
        let rows = self.rows.iter().map(|row| row.join(",") + "\n");
        rows.fold(self.columns.join(",") + "\n", |text, row| text + &row)
    }
}
