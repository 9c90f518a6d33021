//! Numbers of things, for people.

/// `1 error`, `2 errors`, `0 errors`.
pub fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn only_one_has_no_s() {
        let texts = [0, 1, 2].map(|count| counted(count, "error"));
        assert_eq!(texts, ["0 errors", "1 error", "2 errors"]);
    }
}
