//! What an import tells of what it understood.

/// What a column of the written file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnRange {
    /// Its name.
    pub column: String,
    /// The smallest and the largest number; none where it holds words.
    pub range: Option<[f64; 2]>,
    /// How many different things are in it.
    pub different: usize,
}

/// The header and the fields of a text that this program wrote.
fn fields(text: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let mut lines = text.lines().map(|line| {
        line.split(',')
            .map(|field| field.trim_matches('"'))
            .collect()
    });
    let header = lines.next().unwrap_or_default();
    (header, lines.collect())
}

pub(super) fn ranges(text: &str) -> Vec<ColumnRange> {
    let (header, rows) = fields(text);
    let column = |(index, name): (usize, &&str)| {
        let words = ["target", "state", "station", "approach"];
        let all = rows.iter().filter_map(|row| row.get(index).copied());
        let different: std::collections::BTreeSet<&str> = all.clone().collect();
        let range = (!words.contains(name)).then(|| {
            let values = all.filter_map(|field| field.parse::<f64>().ok());
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            })
        });
        ColumnRange {
            column: (*name).to_owned(),
            range,
            different: different.len(),
        }
    };
    header.iter().enumerate().map(column).collect()
}

/// The first row as it was understood.
pub(super) fn in_words(text: &str, line: usize) -> String {
    let (header, rows) = fields(text);
    let first = rows.first().cloned().unwrap_or_default();
    let told = header.iter().zip(first).map(|(column, field)| {
        let (name, unit) = column.rsplit_once('_').unwrap_or((*column, ""));
        let shown = field
            .parse::<f64>()
            .map_or_else(|_| field.to_owned(), |value| format!("{value:.5}"));
        let trimmed = if shown.contains('.') {
            shown.trim_end_matches('0').trim_end_matches('.')
        } else {
            &shown
        };
        format!("{name} = {trimmed} {unit}").trim_end().to_owned()
    });
    format!("Line {line}: {}.", told.collect::<Vec<_>>().join(", "))
}
