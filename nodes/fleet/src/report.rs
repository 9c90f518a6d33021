//! What came out: counts, and what differs in groups, as text and as JSON.

use crate::core::groups::{
    Counts, Grouping, INDEX_COLUMNS, Index, Known, Verdicts, changed, group, not_reproduced,
};
use crate::core::key::{BAGS, bag_object, key_of_object};
use crate::core::schema::VERDICTS;
use crate::store::Store;
use crate::{FleetError, dataset};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Groups of one column, and names of objects, that are printed.
const SHOWN_MAX: usize = 10;

/// A report on one build, and on what it changes against another.
#[derive(Debug)]
pub struct Report {
    pub store: String,
    pub build: String,
    pub counts: Counts,
    /// Bags in the index without a verdict of this build.
    pub to_do: usize,
    /// Of the bags that are not reproduced.
    pub groups: Vec<Grouping>,
    pub against: Option<Against>,
    /// Rows of the index whose bag is not in the store, and bags that have no row.
    pub rows_without_bag: Vec<String>,
    pub bags_without_row: Vec<String>,
    /// Every build in the order of their first verdicts.
    pub builds: Vec<(String, Counts)>,
    /// Files that could not be read.
    pub problems: Vec<String>,
    /// Pages of bags that were drawn, next to the page of the report.
    pub pages: BTreeMap<String, String>,
}

/// What two builds do not say alike.
#[derive(Debug)]
pub struct Against {
    pub build: String,
    /// Bags with a verdict of both.
    pub compared: usize,
    pub changed: usize,
    /// Of the bags that changed, by the verdicts of the newer build.
    pub groups: Vec<Grouping>,
}

/// Makes a report; without a build, on the one that was replayed last.
pub fn report(
    store: &Store,
    build: Option<&str>,
    against: Option<&str>,
) -> Result<Report, FleetError> {
    let all = dataset::builds(store)?;
    let known = |build: &str| all.iter().any(|(it, _)| it == build);
    let names = || all.iter().map(|(build, _)| build.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(missing) = build.iter().chain(&against).find(|it| !known(it)) {
        return Err(FleetError::Usage(format!(
            "no verdict of build {missing} is in {}; it has {}",
            store.name(),
            names()
        )));
    }
    let Some(build) = build.or_else(|| all.last().map(|(build, _)| build.as_str())) else {
        return Err(FleetError::Usage(format!(
            "no verdict is in {}; `kerf fleet replay` makes them",
            store.name()
        )));
    };
    let columns: Vec<&str> = VERDICTS.iter().map(|(name, ..)| *name).collect();
    let mut problems = Vec::new();
    let mut verdicts = |build: &str, columns: &[&str]| -> Result<Verdicts, FleetError> {
        let read = dataset::verdicts(store, build, columns)?;
        problems.extend(read.problems);
        Ok(read.rows)
    };
    let now = verdicts(build, &columns)?;
    let before = against.map(|build| verdicts(build, &columns)).transpose()?;
    let mut builds = Vec::new();
    for (name, _) in &all {
        let counts = match name.as_str() {
            name if name == build => Counts::of(now.values()),
            name => Counts::of(verdicts(name, &["bag", "verdict"])?.values()),
        };
        builds.push((name.clone(), counts));
    }
    let read = dataset::index(store, &INDEX_COLUMNS)?;
    problems.extend(read.problems);
    let index: Index = read.rows.into_iter().map(|(bag, row)| (bag, Known::of(&row))).collect();
    let listed = store.list(BAGS)?;
    let bags: BTreeSet<&str> = listed.iter().filter_map(|it| key_of_object(&it.object)).collect();
    let against = against.zip(before).map(|(name, before)| {
        let bags = changed(&now, &before);
        Against {
            build: name.to_owned(),
            compared: now.keys().filter(|bag| before.contains_key(*bag)).count(),
            changed: bags.len(),
            groups: group(&bags, &index, &now),
        }
    });
    Ok(Report {
        store: store.name().to_owned(),
        build: build.to_owned(),
        counts: Counts::of(now.values()),
        to_do: index.keys().filter(|bag| !now.contains_key(*bag)).count(),
        groups: group(&not_reproduced(&now), &index, &now),
        against,
        rows_without_bag: index.keys().filter(|it| !bags.contains(it.as_str())).cloned().collect(),
        bags_without_row: bags
            .iter()
            .filter(|it| !index.contains_key(**it))
            .map(|it| (*it).to_owned())
            .collect(),
        builds,
        problems,
        pages: BTreeMap::new(),
    })
}

impl Report {
    /// For people.
    pub fn text(&self) -> String {
        let Counts { reproduced, different, error } = self.counts;
        let mut text = format!(
            "{}, build {}: {} bags\n  {reproduced} reproduced, {different} different, {error} cannot be compared, {} to do\n",
            self.store,
            self.build,
            self.counts.total() + self.to_do,
            self.to_do
        );
        text += &groups(&self.groups);
        if let Some(against) = &self.against {
            let Against { build, compared, changed, groups: of } = against;
            let _ = writeln!(
                text,
                "against build {build}: {changed} of {compared} bags have another verdict"
            );
            text += &groups(of);
        }
        for (what, bags) in [
            ("a row without a bag; push the bag again", &self.rows_without_bag),
            ("a bag without a row; push it again for its row", &self.bags_without_row),
        ] {
            for bag in bags.iter().take(SHOWN_MAX) {
                let _ = writeln!(text, "{}: {what}", bag_object(bag));
            }
            if bags.len() > SHOWN_MAX {
                let _ = writeln!(text, "and {} more; --json lists all", bags.len() - SHOWN_MAX);
            }
        }
        text
    }

    /// For scripts.
    pub fn json(&self) -> Value {
        let counts = |it: &Counts| json!({"reproduced": it.reproduced, "different": it.different, "error": it.error});
        let builds =
            self.builds.iter().map(|(build, it)| json!({"build": build, "counts": counts(it)}));
        json!({
            "store": self.store,
            "build": self.build,
            "counts": counts(&self.counts),
            "to_do": self.to_do,
            "groups": groups_json(&self.groups),
            "against": self.against.as_ref().map(|it| json!({
                "build": it.build,
                "compared": it.compared,
                "changed": it.changed,
                "groups": groups_json(&it.groups),
            })),
            "rows_without_bag": self.rows_without_bag,
            "bags_without_row": self.bags_without_row,
            "builds": builds.collect::<Vec<_>>(),
            "problems": self.problems,
        })
    }

    /// The command that draws a bag on a page; a bag in a bucket is drawn by `--pages`.
    pub fn page_command(&self, bag: &str) -> String {
        if self.store.starts_with("s3://") {
            let store = shell_word(&self.store);
            let build = shell_word(&self.build);
            return format!(
                "kerf fleet report --store {store} --build {build} --html report.html --pages"
            );
        }
        let folder = self.store.strip_prefix("file://").unwrap_or(&self.store);
        format!(
            "kerf replay {} --html {}.html",
            shell_word(&format!("{folder}/{}", bag_object(bag))),
            &bag[..12.min(bag.len())]
        )
    }
}

/// A word of a shell that is this text.
fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    if text.chars().all(is_plain) && !text.starts_with('-') {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

fn groups(groupings: &[Grouping]) -> String {
    let mut text = String::new();
    for Grouping { by, groups } in groupings.iter().filter(|it| !it.groups.is_empty()) {
        let _ = writeln!(text, "  by {by}:");
        for group in groups.iter().take(SHOWN_MAX) {
            let _ = writeln!(text, "    {:>7}  {}", group.bags, group.value);
            let _ = writeln!(
                text,
                "             first {}: {}",
                bag_object(&group.first_bag),
                group.first_text
            );
        }
        if groups.len() > SHOWN_MAX {
            let _ = writeln!(
                text,
                "             and {} more; --json lists all",
                groups.len() - SHOWN_MAX
            );
        }
    }
    text
}

fn groups_json(groupings: &[Grouping]) -> Value {
    let rows = |it: &Grouping| -> Vec<Value> {
        let rows = it.groups.iter().map(|group| {
            json!({
                "value": group.value,
                "bags": group.bags,
                "first_bag": group.first_bag,
                "first_text": group.first_text,
            })
        });
        rows.collect()
    };
    Value::Object(groupings.iter().map(|it| (it.by.to_owned(), rows(it).into())).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_of_a_shell_is_one_word() {
        for text in ["/srv/bags/ab.mcap", "/srv/my bags/$(id)", "it's `here`", "a;b"] {
            let echo = format!("printf %s {}", shell_word(text));
            let said = std::process::Command::new("sh").args(["-c", &echo]).output();
            assert_eq!(said.expect("a shell").stdout, text.as_bytes(), "{echo}");
        }
        assert_eq!(shell_word("/srv/bags/ab.mcap"), "/srv/bags/ab.mcap");
    }
}
