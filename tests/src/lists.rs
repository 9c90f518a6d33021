//! Lists of controls that people keep by hand: each is whole, and none is in a Rust source.
//!
//! [`settings::Control`] is the one list. A page or a script cannot use it, so a paragraph, or a row
//! of a table, that names more than half of the controls has to name all of them. A source can use
//! it, so three lines that name more than half are a list of its own.

use std::collections::BTreeSet;

/// Where a text names more than half of `names`, but not all: the line, and what is missing.
pub fn partial_lists<'n>(text: &str, names: &[&'n str]) -> Vec<(usize, BTreeSet<&'n str>)> {
    let all: BTreeSet<&str> = names.iter().copied().collect();
    let mut found = Vec::new();
    let mut paragraph: (usize, BTreeSet<&str>) = (1, BTreeSet::new());
    let mut lines = (1..).zip(text.lines()).peekable();
    while let Some((line, text)) = lines.next() {
        paragraph.1.extend(words_of(text, &all));
        let is_row = |text: &str| text.trim_start().starts_with('|');
        let is_end = |next: &(usize, &str)| next.1.trim().is_empty() || is_row(next.1);
        if is_row(text) || text.trim().is_empty() || lines.peek().is_none_or(is_end) {
            let named = std::mem::take(&mut paragraph.1);
            if 2 * named.len() > all.len() && named.len() < all.len() {
                found.push((paragraph.0, &all - &named));
            }
            paragraph.0 = line + 1;
        }
    }
    found
}

/// The lines from which a source names more than half of `names` in three lines.
pub fn lists_in_source(text: &str, names: &[&str]) -> Vec<usize> {
    let quoted: BTreeSet<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
    let lines: Vec<&str> = text.lines().collect();
    let is_list = |three: &&[&str]| {
        let named = quoted.iter().filter(|name| three.iter().any(|line| line.contains(*name)));
        2 * named.count() > names.len()
    };
    (1..).zip(lines.windows(3)).filter(|(_, three)| is_list(three)).map(|(line, _)| line).collect()
}

fn words_of<'n>(text: &str, names: &BTreeSet<&'n str>) -> Vec<&'n str> {
    let is_of_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    let words: BTreeSet<&str> = text.split(|letter| !is_of_word(letter)).collect();
    names.iter().copied().filter(|name| words.contains(name)).collect()
}
