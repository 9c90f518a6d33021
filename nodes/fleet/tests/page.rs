//! docs/fleet.md has every column with its meaning.

use fleet::core::schema::{Column, INDEX, Kind, VERDICTS};
use std::fs;

/// The table of the columns of the index or of the verdicts.
fn table(columns: &[Column]) -> String {
    let mut table = "| column | type | meaning |\n|---|---|---|\n".to_owned();
    for (name, kind, meaning) in columns {
        let kind = match kind {
            Kind::Text => "text",
            Kind::Integer => "integer",
            Kind::Real => "number",
            Kind::Time => "time",
        };
        table += &format!("| `{name}` | {kind} | {meaning} |\n");
    }
    table
}

#[test]
fn the_page_has_every_column() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/fleet.md");
    let text = fs::read_to_string(page).expect("a page");
    for columns in [INDEX, VERDICTS] {
        let table = table(columns);
        assert!(text.contains(&table), "docs/fleet.md lacks\n{table}");
    }
}
