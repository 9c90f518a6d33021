//! Control profiles: built-in ones, and files.
//!
//! The rules are in `config/controls/*.yaml`, each explained next to its value;
//! `cnc_msgs::profile` defines them.

use crate::yaml::{FileError, from_foreign_yaml, from_yaml_str, line_of, read_text, utf8};
use cnc_msgs::profile::{Profile, ProfileFault};
use intake::folders::{Folders, LookupError};
use intake::text::one_line;
use intake::yaml::Limits;
use std::fmt;
use std::path::Path;

include!(concat!(env!("OUT_DIR"), "/controls.rs"));

/// Why there is no such profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    #[error("there is no control \"{name}\"; known are {known}, or the path of a YAML file")]
    Unknown { name: String, known: String },
    #[error(transparent)]
    Lookup(#[from] LookupError),
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

impl Control {
    /// The control of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|control| control.name() == name)
    }

    /// Its rules.
    ///
    /// # Errors
    /// Its file is not a consistent profile; a test makes sure that each is.
    pub fn profile(self) -> Result<Profile, ProfileError> {
        checked(self.text(), &format!("config/controls/{}.yaml", self.name()), from_yaml_str)
    }
}

/// Loads the profile that the operator named: a known name, or a file if the word looks
/// like a path, with a slash in it or `.yaml` at its end.
///
/// # Errors
/// Neither, or the file is not a consistent profile.
pub fn load_profile(name_or_path: &str) -> Result<Profile, ProfileError> {
    match built_in(name_or_path)? {
        Some(profile) => Ok(profile),
        None => checked(&read_text(Path::new(name_or_path))?, name_or_path, from_yaml_str),
    }
}

/// Loads the profile that a peer named: a known name, or a file in one of the folders.
///
/// # Errors
/// Neither, or the file is not a consistent profile. The reason quotes nothing of the file.
pub fn load_foreign_profile(name: &str, folders: &Folders) -> Result<Profile, ProfileError> {
    if let Some(profile) = built_in(name)? {
        return Ok(profile);
    }
    let bytes = folders.read(name, Limits::MESSAGE.bytes as u64)?;
    let shown = one_line(name);
    checked(&utf8(bytes, &shown)?, &shown, from_foreign_yaml)
}

/// `None` for a word that looks like a path.
fn built_in(name: &str) -> Result<Option<Profile>, ProfileError> {
    if let Some(control) = Control::named(name) {
        return control.profile().map(Some);
    }
    if name.contains('/') || [".yaml", ".yml"].iter().any(|end| name.ends_with(end)) {
        return Ok(None);
    }
    let known = Control::ALL.map(Control::name).join(", ");
    Err(ProfileError::Unknown { name: one_line(name).into_owned(), known })
}

impl fmt::Display for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

fn checked(
    text: &str,
    file: &str,
    read: impl Fn(&str, &str) -> Result<Profile, FileError>,
) -> Result<Profile, ProfileError> {
    let profile = read(text, file)?;
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
        for control in Control::ALL {
            let name = control.name();
            let profile = control.profile().expect(name);
            assert_eq!(profile.name, control.name());
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        let text = load_profile("fanuc").expect_err("unknown").to_string();
        assert!(text.contains("\"fanuc\"") && text.contains("rs274"), "{text}");
        let text = load_profile("./fanuc.yaml").expect_err("no file").to_string();
        assert!(text.starts_with("cannot read ./fanuc.yaml: No such file"), "{text}");
    }

    #[test]
    fn a_profile_that_contradicts_itself_is_refused() {
        let good = Control::Rs274.text();
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

    #[test]
    fn a_file_that_a_peer_names_is_looked_up_in_the_folders_and_not_quoted() {
        let good = Control::Rs274.text();
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name).display().to_string();
        std::fs::create_dir(at("controls")).expect("made");
        let word = "hunter2";
        for (name, text) in [
            ("controls/mine.yaml", good.replacen("name: rs274", "name: mine", 1)),
            ("controls/notes.yaml", format!("{word}:x:0:0:root:/root:/bin/bash\nmore\n")),
            ("controls/keys.yaml", format!("{word}: 1\n")),
            ("controls/list.yaml", format!("- {word}\n- {word}\n")),
            ("controls/broken.yaml", format!("name: [{word}\n\t{word}: \"\n")),
            ("controls/wrong.yaml", good.replacen("name: rs274", &format!("name: [{word}]"), 1)),
            ("outside.yaml", good.to_owned()),
        ] {
            std::fs::write(at(name), text).expect("written");
        }
        let folders = Folders::new([at("controls")], "control_directories");
        for name in ["rs274", "mine.yaml", &at("controls/mine.yaml")] {
            assert!(load_foreign_profile(name, &folders).is_ok(), "{name}");
        }
        let outside = at("outside.yaml");
        for name in [&outside, "../outside.yaml", "/etc/passwd", "/etc/../etc/passwd"] {
            let error = load_foreign_profile(name, &folders).expect_err(name).to_string();
            assert!(error.contains("control_directories"), "{error}");
        }
        for name in ["notes.yaml", "keys.yaml", "list.yaml", "broken.yaml", "wrong.yaml"] {
            let error = load_foreign_profile(name, &folders).expect_err(name).to_string();
            assert!(!error.contains(word) && error.starts_with(name), "{error}");
        }
    }
}
