//! The order of the folders of a crate: each imports only those before it.
//!
//! Reads paths that begin with `crate::`. A path with enough `super::` to leave the folder is wrong
//! wherever it leads. Comments are skipped: a link in a doc comment is no import.

use std::path::Path;

/// Everything that breaks the order in `src`, one line each.
///
/// `order` names the folders of `src`, the lowest first; `a.rs` belongs to the folder `a`, or stands
/// for it. Other files next to the folders may import everything, and no folder may import them.
pub fn upward_imports(src: &Path, order: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(src).expect("a folder of sources") {
        let path = entry.expect("its entries too").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !order.contains(&name.as_str()) {
            found.push(format!("{name}/ has no place in the order"));
        }
    }
    for (place, room) in order.iter().enumerate() {
        let folder = src.join(room);
        let says_what_belongs =
            |file: &Path| std::fs::read_to_string(file).is_ok_and(|text| text.starts_with("//!"));
        if !says_what_belongs(&folder.join("mod.rs"))
            && !says_what_belongs(&src.join(format!("{room}.rs")))
        {
            found.push(format!("{room}/ does not say what belongs there"));
        }
        let allowed = &order[..=place];
        let mut look = |file: &Path| {
            let text = std::fs::read_to_string(file).expect("sources are UTF-8");
            let inside = file.strip_prefix(src).expect("a file in src");
            let is_mod = inside.file_name().is_some_and(|name| name == "mod.rs");
            let depth = inside.components().count() - usize::from(is_mod);
            for wrong in outside(&text, depth, allowed) {
                found.push(format!("{}: {wrong}", inside.display()));
            }
        };
        if folder.is_dir() {
            walk(&folder, &mut look);
        }
        let root_of_folder = src.join(format!("{room}.rs"));
        if root_of_folder.exists() {
            look(&root_of_folder);
        }
    }
    found.sort();
    found
}

fn walk(folder: &Path, look: &mut impl FnMut(&Path)) {
    for entry in std::fs::read_dir(folder).expect("a folder of the order") {
        let path = entry.expect("its entries too").path();
        if path.is_dir() {
            walk(&path, look);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            look(&path);
        }
    }
}

/// The paths of a module so deep under the crate's root that lead to other folders than these.
fn outside(text: &str, depth: usize, allowed: &[&str]) -> Vec<String> {
    let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let code = lines.collect::<Vec<_>>().join("\n");
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        // Not the end of a longer word.
        if code[..at].ends_with(|before: char| before.is_alphanumeric() || before == '_') {
            continue;
        }
        for target in targets(&code[at + "crate::".len()..]) {
            if !allowed.contains(&target) {
                found.push(format!("crate::{target}"));
            }
        }
    }
    for line in code.lines() {
        let ups = line.matches("super::").count();
        // A module inside of the file is one level deeper.
        let depth = depth + usize::from(line.starts_with(' '));
        if ups >= depth {
            found.push(line.trim().to_owned());
        }
    }
    found
}

/// The first names of what follows `crate::`: one, or those of a group.
fn targets(path: &str) -> Vec<&str> {
    fn word(text: &str) -> &str {
        let text = text.trim_start();
        let end = text.find(|next: char| !next.is_alphanumeric() && next != '_');
        &text[..end.unwrap_or(text.len())]
    }
    let Some(group) = path.strip_prefix('{') else { return vec![word(path)] };
    let (mut level, mut start, mut found) = (0, 0, Vec::new());
    for (at, next) in group.char_indices() {
        match next {
            '{' => level += 1,
            '}' if level > 0 => level -= 1,
            ',' | '}' if level == 0 => {
                found.push(word(&group[start..at]));
                start = at + 1;
                if next == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    found.retain(|word| !word.is_empty());
    found
}
