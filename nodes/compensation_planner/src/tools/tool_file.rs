//! Changes one row of a tool file, and keeps everything else as its owner wrote it.
//!
//! Knows the two forms in which people write a row: `1: {diameter_mm: 10.0}` in one line, or one
//! key a line below `1:`. Text in, text out. The caller reads the result again before it writes the
//! file. If that is not the intended table, the owner uses a third form, and only [`whole`] is
//! left.

use crate::tools::set_tool::{Change, Row};
use cnc_msgs::tool_table::ToolTable;
use std::fmt::Write as _;

/// The text with the changed row, comments kept. `None` if the row has no place in it.
pub fn edited(text: &str, change: &Change) -> Option<String> {
    let (section, number) = match change.row {
        Row::Tool(number) => ("tools", number),
        Row::Offset(number) => ("offsets", number),
    };
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let words: Vec<String> =
        change.values.iter().map(|(key, value)| format!("{key}: {}", shown(key, *value))).collect();
    let Some(head) = lines.iter().position(|line| key_of(line) == Some((0, section))) else {
        lines.push(format!("{section}:"));
        lines.push(format!("  {number}: {{{}}}", words.join(", ")));
        return Some(joined(&lines));
    };
    if !is_bare(&lines[head]) {
        return None;
    }
    let is_inside = |line: &String| indent_of(line).is_none_or(|indent| indent > 0);
    let end = head + 1 + lines[head + 1..].iter().take_while(|line| is_inside(line)).count();
    let name = number.to_string();
    let is_row = |line: &String| key_of(line).is_some_and(|(_, key)| key == name);
    let Some(row) = (head + 1..end).find(|&index| is_row(&lines[index])) else {
        let last = (head + 1..end).rev().find(|&index| indent_of(&lines[index]).is_some());
        let first = (head + 1..end).find_map(|index| indent_of(&lines[index]));
        let indent = " ".repeat(first.unwrap_or(2));
        let line = format!("{indent}{name}: {{{}}}", words.join(", "));
        lines.insert(last.unwrap_or(head) + 1, line);
        return Some(joined(&lines));
    };
    if is_bare(&lines[row]) {
        let indent = indent_of(&lines[row])?;
        let is_below = |line: &String| indent_of(line).is_none_or(|at| at > indent);
        let mut end = row + 1 + lines[row + 1..end].iter().take_while(|l| is_below(l)).count();
        let below = (row + 1..end).find_map(|index| indent_of(&lines[index]))?;
        for (word, (key, value)) in words.iter().zip(&change.values) {
            let at = (row + 1..end).find(|&i| key_of(&lines[i]) == Some((below, *key)));
            match at {
                Some(at) => lines[at] = with_value(&lines[at], key, &shown(key, *value))?,
                None => {
                    lines.insert(row + 1, format!("{}{word}", " ".repeat(below)));
                    end += 1;
                }
            }
        }
    } else {
        for (key, value) in &change.values {
            lines[row] = with_value_in_braces(&lines[row], key, &shown(key, *value))?;
        }
    }
    Some(joined(&lines))
}

/// A table as a new file.
pub fn whole(tools: &ToolTable) -> String {
    let mut text =
        String::from("# Written by the planner: set_tool has changed it, millimetres.\n");
    let writes = "a text takes everything";
    text += "tools:\n";
    for (number, tool) in &tools.tools {
        writeln!(
            text,
            "  {number}: {{diameter_mm: {:?}, wear_diameter_mm: {:?}, length_mm: {:?}, nose_radius_mm: {:?}, tip_direction: {}}}",
            tool.diameter_mm, tool.wear_diameter_mm, tool.length_mm, tool.nose_radius_mm, tool.tip_direction
        )
        .expect(writes);
    }
    if tools.tools.is_empty() {
        text = text.replace("tools:\n", "tools: {}\n");
    }
    text += "offsets:";
    text += if tools.offsets.is_empty() { " {}\n" } else { "\n" };
    for (number, offset) in &tools.offsets {
        writeln!(
            text,
            "  {number}: {{radius_mm: {:?}, wear_mm: {:?}, length_mm: {:?}, tip_direction: {}}}",
            offset.radius_mm, offset.wear_mm, offset.length_mm, offset.tip_direction
        )
        .expect(writes);
    }
    text
}

fn joined(lines: &[String]) -> String {
    lines.join("\n") + "\n"
}

/// A number as YAML reads it back: a tip direction is whole, all others have a point.
fn shown(key: &str, value: f64) -> String {
    if key == "tip_direction" { format!("{value}") } else { format!("{value:?}") }
}

/// Blanks before the first word; `None` for a line without one.
fn indent_of(line: &str) -> Option<usize> {
    let visible = line.trim_start_matches(' ');
    (!visible.trim().is_empty() && !visible.starts_with('#')).then(|| line.len() - visible.len())
}

/// The key that a line begins with, and its indent.
fn key_of(line: &str) -> Option<(usize, &str)> {
    let indent = indent_of(line)?;
    let (key, _) = line[indent..].split_once(':')?;
    Some((indent, key.trim_end()))
}

/// Whether nothing but a comment follows the key of a line.
fn is_bare(line: &str) -> bool {
    line.split_once(':').is_some_and(|(_, rest)| {
        let rest = rest.trim_start();
        rest.is_empty() || rest.starts_with('#')
    })
}

/// A line `key: value # comment` with another value.
fn with_value(line: &str, key: &str, value: &str) -> Option<String> {
    let at = line.find(key)? + key.len();
    let (head, rest) = line.split_at(at + line[at..].find(':')? + 1);
    let old = rest.trim_start();
    let kept = old.find(|c: char| c.is_whitespace()).map_or("", |end| &old[end..]);
    Some(format!("{head} {value}{kept}"))
}

/// A line `1: {key: value, ...} # comment` with another value.
fn with_value_in_braces(line: &str, key: &str, value: &str) -> Option<String> {
    let (open, close) = (line.find('{')?, line.find('}')?);
    let inside = &line[open + 1..close];
    let mut parts: Vec<String> = inside.split(',').map(str::to_owned).collect();
    let has_key = |part: &String| part.split_once(':').is_some_and(|(name, _)| name.trim() == key);
    match parts.iter_mut().find(|part| has_key(part)) {
        Some(part) => {
            let (name, old) = part.split_once(':')?;
            let tail = &old[old.trim_end().len()..];
            *part = format!("{name}: {value}{tail}");
        }
        None if inside.trim().is_empty() => parts = vec![format!("{key}: {value}")],
        None => {
            let last = parts.last_mut()?;
            let length = last.trim_end().len();
            last.truncate(length);
            parts.push(format!(" {key}: {value}"));
        }
    }
    Some(format!("{}{{{}}}{}", &line[..open], parts.join(","), &line[close + 1..]))
}
