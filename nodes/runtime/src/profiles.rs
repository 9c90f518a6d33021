//! Controller profiles: those that come with the program, and files.
//!
//! The rules themselves are in `config/controllers/*.yaml`, each explained
//! beside its value; what they mean is in `cnc_msgs::profile`.

use crate::parameter_file::line_of;
use crate::yaml::{FileError, from_yaml_str, read_text};
use cnc_msgs::profile::{Profile, ProfileFault};
use std::path::Path;

include!(concat!(env!("OUT_DIR"), "/profiles.rs"));

/// Why there is no such profile.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ProfileError {
    #[error("there is no controller \"{name}\"; known are {known}, or the path of a YAML file")]
    Unknown { name: String, known: String },
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}{}: {fault}", line.map(|line| format!(":{line}")).unwrap_or_default())]
    Inconsistent {
        file: String,
        /// 1-based, where it can be found.
        line: Option<usize>,
        fault: ProfileFault,
    },
}

/// The names that `--controller` knows, in order.
pub fn known_profiles() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

/// Loads the profile of a known name, or from a file if the word looks like a
/// path: with a slash in it or `.yaml` at its end.
///
/// # Errors
/// Neither, or the file is not a consistent profile.
pub fn load_profile(name_or_path: &str) -> Result<Profile, ProfileError> {
    if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
        let file = format!("config/controllers/{name}.yaml");
        return read(text, &file);
    }
    let is_path = name_or_path.contains('/')
        || [".yaml", ".yml"].iter().any(|end| name_or_path.ends_with(end));
    if is_path {
        return read(&read_text(Path::new(name_or_path))?, name_or_path);
    }
    let known = known_profiles().collect::<Vec<_>>().join(", ");
    Err(ProfileError::Unknown { name: name_or_path.to_owned(), known })
}

fn read(text: &str, file: &str) -> Result<Profile, ProfileError> {
    let profile: Profile = from_yaml_str(text, file)?;
    profile.check().map_err(|fault| {
        let path: Vec<String> = fault.path.iter().map(|&key| key.to_owned()).collect();
        ProfileError::Inconsistent { file: file.to_owned(), line: line_of(text, &path), fault }
    })?;
    Ok(profile)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_profile_that_comes_along_loads_and_has_the_name_of_its_file() {
        assert!(known_profiles().any(|name| name == "rs274"));
        for name in known_profiles() {
            let profile = load_profile(name).expect(name);
            assert_eq!(profile.name, name);
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        let text = load_profile("fanuc").expect_err("unknown").to_string();
        assert!(text.contains("\"fanuc\"") && text.contains("rs274"), "{text}");
        let text = load_profile("./fanuc.yaml").expect_err("no file").to_string();
        assert!(text.starts_with("./fanuc.yaml: No such file"), "{text}");
    }

    #[test]
    fn a_profile_that_contradicts_itself_is_refused() {
        let good = BUILT_IN.iter().find(|(name, _)| *name == "rs274").expect("there").1;
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mine.yaml");
        let table = [
            ("accept_tolerance_mm: 0.002", "accept_tolerance_mm: .nan", "accept_tolerance_mm: NaN"),
            ("accept_tolerance_mm: 0.002", "accept_tolerance_mm: -1.0", "accept_tolerance_mm: -1"),
            ("rule: [xy, zx, yz]", "rule: []", "mine.yaml:11: language.planes: at least one plane"),
            ("rule: [xy, zx, yz]", "rule: [xy, xy]", "twice"),
            ("d0: none", "d0: suspend", "d_register"),
            ("name: rs274", "name: ''", "name: it is empty"),
            ("name: rs274", "name: a\nspeed: 5", "unknown field `speed`"),
        ];
        for (from, to, part) in table {
            assert!(good.contains(from), "{from}");
            std::fs::write(&path, good.replacen(from, to, 1)).expect("written");
            let text = load_profile(&path.display().to_string()).expect_err(to).to_string();
            assert!(text.contains(part), "{text}");
        }
    }
}
