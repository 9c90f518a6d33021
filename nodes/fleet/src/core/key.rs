//! Names of the objects in a store.

use sha2::{Digest, Sha256};

/// Folder of the bags.
pub const BAGS: &str = "bags";
/// Folder of the index.
pub const INDEX: &str = "index";
/// Folder of the verdicts.
pub const VERDICTS: &str = "verdicts";
/// Hexadecimal digits of a bag's key.
const DIGITS: usize = 64;
/// Digits that name a part; a store with a million parts has two of one name once in 37 million stores.
const PART_DIGITS: usize = 16;

/// The key of a bag: the sha256 of its file.
pub fn key_of(content: &[u8]) -> String {
    hex(&Sha256::digest(content))
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The object of a bag.
pub fn bag_object(key: &str) -> String {
    format!("{BAGS}/{key}.mcap")
}

/// The key of a bag from the name of its object; `None` for anything else that lies there.
pub fn key_of_object(object: &str) -> Option<&str> {
    let key = object.strip_prefix(BAGS)?.strip_prefix('/')?.strip_suffix(".mcap")?;
    is_key(key).then_some(key)
}

/// Whether this is the key of a bag.
pub fn is_key(text: &str) -> bool {
    text.len() == DIGITS
        && text.bytes().all(|it| it.is_ascii_digit() || (b'a'..=b'f').contains(&it))
}

/// The name of a part of the verdicts with the rows of these bags: the same bags in any order give the same name, so a
/// part that is written twice is there once.
pub fn part_name<'a>(bags: impl IntoIterator<Item = &'a str>) -> String {
    let mut bags: Vec<&str> = bags.into_iter().collect();
    bags.sort_unstable();
    let mut digits = key_of(bags.join("\n").as_bytes());
    digits.truncate(PART_DIGITS);
    digits
}

/// A part of the index with this content: no other content ever has its name, so a part that was read may be removed
/// when its rows are elsewhere.
pub fn index_part(content: &[u8]) -> String {
    let mut digits = key_of(content);
    digits.truncate(PART_DIGITS);
    format!("{INDEX}/{digits}.parquet")
}

/// The folder of the verdicts of a build.
pub fn verdicts_of(build: &str) -> String {
    format!("{VERDICTS}/build={build}")
}

/// The build in the name of an object with verdicts.
pub fn build_of_object(object: &str) -> Option<&str> {
    object.strip_prefix(VERDICTS)?.strip_prefix("/build=")?.split('/').next()
}

/// Checks the name of a build, which becomes a folder.
pub fn check_build(build: &str) -> Result<(), String> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    if !build.is_empty() && build.chars().all(is_plain) && !build.starts_with('.') {
        return Ok(());
    }
    Err(format!(
        "`{build}` is not the name of a build; letters, digits, `.`, `_` and `-` make one, as in 1f3a9c0"
    ))
}

/// The name of this build when none is given: its commit, and the first digits of the program's sha256,
/// for an edited build may have the commit's name.
pub fn build_name(commit: Option<&str>, program_sha256: &str) -> Result<String, String> {
    let Some(commit) = commit else {
        return Err("a debug build does not know its commit; name it with --build NAME".to_owned());
    };
    if commit.ends_with("-dirty") {
        return Err(format!(
            "this build is {commit}: its tree had changes without a commit, which others cannot build; commit \
             them, or name the build with --build NAME"
        ));
    }
    Ok(format!("{commit}-{}", program_sha256.get(..8).unwrap_or(program_sha256)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bag_has_one_name_and_only_that_name_is_a_bag() {
        let key = key_of(b"");
        assert_eq!(key, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
        let object = bag_object(&key);
        assert_eq!(key_of_object(&object), Some(key.as_str()));
        let upper = object.to_uppercase();
        for other in ["bags/x.mcap", "bags/", "index/a.parquet", upper.as_str(), "bags/.mcap"] {
            assert_eq!(key_of_object(other), None, "{other}");
        }
    }

    #[test]
    fn a_part_is_named_by_its_bags_in_any_order() {
        assert_eq!(part_name(["b", "a"]), part_name(["a", "b"]));
        assert_ne!(part_name(["a"]), part_name(["a", "b"]));
        assert_eq!(part_name(["a"]).len(), 16);
    }

    #[test]
    fn a_build_that_nobody_named_is_its_commit_and_its_program() {
        let sha256 = key_of(b"");
        assert_eq!(build_name(Some("1f3a9c0"), &sha256), Ok("1f3a9c0-e3b0c442".to_owned()));
        for (commit, says) in
            [(None, "does not know its commit"), (Some("1f3a9c0-dirty"), "had changes")]
        {
            let why = build_name(commit, &sha256).expect_err("no name");
            assert!(why.contains(says) && why.contains("--build NAME"), "{why}");
        }
    }

    #[test]
    fn a_build_is_a_folder_and_nothing_else() {
        for good in ["1f3a9c0", "v1.2-3-gabc-dirty"] {
            assert_eq!(check_build(good), Ok(()));
            let object = format!("{}/shard=0-of-1/x.parquet", verdicts_of(good));
            assert_eq!(build_of_object(&object), Some(good));
        }
        for bad in ["", "a/b", "..", "a b", "ä"] {
            assert!(check_build(bad).is_err(), "{bad}");
        }
    }
}
