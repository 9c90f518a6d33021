//! The words of the command line.

/// The arguments after the name of the program.
///
/// # Errors
/// An argument is not UTF-8; the message says which one.
pub fn words() -> Result<Vec<String>, String> {
    decoded(std::env::args_os().skip(1))
}

fn decoded(words: impl Iterator<Item = std::ffi::OsString>) -> Result<Vec<String>, String> {
    words
        .enumerate()
        .map(|(index, word)| {
            word.into_string().map_err(|word| {
                let shown = word.to_string_lossy();
                let shown = crate::text::one_line(&shown);
                format!(
                    "argument {} (\"{shown}\") is not UTF-8; rename the file, or give it a link \
                     with a name in UTF-8",
                    index + 1
                )
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt;

    #[test]
    fn a_word_that_is_not_utf_8_is_an_error_that_names_it() {
        let bad = OsString::from_vec(b"part\xff\x1b.ngc".to_vec());
        let error = decoded(["load".into(), bad].into_iter()).expect_err("not UTF-8");
        assert!(error.starts_with("argument 2 (\"part\u{fffd}\\u001b.ngc\")"), "{error}");
        assert_eq!(decoded(["ü".into()].into_iter()).expect("UTF-8"), ["ü"]);
    }
}
