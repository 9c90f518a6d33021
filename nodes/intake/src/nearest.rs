//! Finds the known word that is nearest to a misspelt one.

/// Edits up to which a word counts as misspelt: two swapped letters, or two wrong ones.
const EDITS_MAX: usize = 2;

/// The known word that is nearest to `word`, or `None` when none is near.
///
/// A short word may differ in one letter only.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let allowed = |other: &str| if other.len().min(word.len()) < 5 { 1 } else { EDITS_MAX };
    known
        .into_iter()
        .map(|other| (edits(word, other), other))
        .filter(|(edits, other)| *edits <= allowed(other))
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, other)| other)
}

/// Letters that are added, left out or changed between two words (Levenshtein).
fn edits(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (index, letter) in from.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = index + 1;
        for (column, other) in to.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[column + 1];
            row[column + 1] = changed.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_with_a_slip_is_recognised_and_another_word_is_not() {
        let known = ["axis_driver", "program_loader", "port", "baud"];
        let table = [
            ("axis_drvier", Some("axis_driver")),
            ("axes_driver", Some("axis_driver")),
            ("programloader", Some("program_loader")),
            ("prot", None),
            ("ports", Some("port")),
            ("camera_driver", None),
            ("", None),
        ];
        for (word, expected) in table {
            assert_eq!(nearest(word, known), expected, "{word}");
        }
    }
}
