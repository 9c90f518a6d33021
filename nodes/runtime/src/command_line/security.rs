//! Who may talk to this node: the keystores and enclaves of SROS2, for DDS and for Zenoh.
//!
//! [`SecurityRequest`] is what the environment asks for and [`governance_problem`] judges a
//! document; both are pure. [`SecurityRequest::dds_enclave`] and [`SecurityRequest::zenoh_session`] look
//! into the keystore. The cryptography is that of the middleware: of DDS it is only built with the feature
//! `security`.

use std::path::{Path, PathBuf};

/// The files of an enclave that are needed, as SROS2 names them.
pub const ENCLAVE_FILES: [&str; 6] = [
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
];
/// The configuration of a session of Zenoh, as `config/security/make_keystore.py` names it.
pub const ZENOH_SESSION: &str = "zenoh.json5";
/// The certificate revocation list, which the DDS layer does not read.
const REVOKED: &str = "crl.pem";
/// The largest signed governance file, bytes; a usual one has 4 kB.
const GOVERNANCE_BYTES_MAX: u64 = 1 << 20;

/// What the variables `ROS_SECURITY_*` ask for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SecurityRequest {
    /// `ROS_SECURITY_KEYSTORE`.
    pub keystore: PathBuf,
    /// `ROS_SECURITY_STRATEGY=Enforce`: a node that cannot be protected does not start.
    pub is_enforced: bool,
    /// `ROS_SECURITY_ENCLAVE_OVERRIDE`, which wins over `--enclave`.
    pub enclave: Option<String>,
}

/// Why a node cannot be protected as asked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SecurityError {
    #[error("enclave \"{0}\": it begins with / and has no empty part, no . and no ..")]
    EnclaveName(String),
    #[error(
        "enclave {enclave}: {} is missing or cannot be read ({reason}); make it with \
         config/security/make_keystore.py, or unset ROS_SECURITY_ENABLE", .path.display()
    )]
    File { enclave: String, path: PathBuf, reason: String },
    #[error("{}: {problem}", .path.display())]
    Governance { path: PathBuf, problem: String },
    #[error(
        "{} lists certificates that are not valid any more, which this stack cannot check: \
         make a new keystore without them and remove the list", .0.display()
    )]
    Revoked(PathBuf),
    #[error(
        "ROS_SECURITY_ENABLE=true, but this program was built without it: build it with \
         `--features security`, or unset the variable"
    )]
    NotBuilt,
}

impl SecurityRequest {
    /// The enclave that this node is to be in; `argument` is `--enclave`.
    pub fn enclave<'a>(&'a self, argument: Option<&'a str>) -> &'a str {
        self.enclave.as_deref().or(argument).unwrap_or("/")
    }

    /// The configuration of the session of Zenoh in the enclave of this node.
    ///
    /// `None`: there is none, and the strategy (`Permissive`) allows to start without one.
    ///
    /// # Errors
    /// A file is missing.
    pub fn zenoh_session(&self, argument: Option<&str>) -> Result<Option<PathBuf>, SecurityError> {
        let folder = self.folder(self.enclave(argument), &[ZENOH_SESSION])?;
        Ok(folder.map(|folder| folder.join(ZENOH_SESSION)))
    }

    /// The folder of an enclave, if it has these files.
    fn folder(&self, enclave: &str, files: &[&str]) -> Result<Option<PathBuf>, SecurityError> {
        let folder = self.keystore.join("enclaves").join(relative(enclave)?);
        for file in files {
            let path = folder.join(file);
            match intake::file::open(&path) {
                Ok(_) => {}
                Err(_) if !self.is_enforced => return Ok(None),
                Err(error) => {
                    let (enclave, reason) = (enclave.to_owned(), error.to_string());
                    return Err(SecurityError::File { enclave, path, reason });
                }
            }
        }
        Ok(Some(folder))
    }

    /// The folder of the enclave of this node on DDS.
    ///
    /// `None`: there is none, and the strategy (`Permissive`) allows to start without one.
    ///
    /// # Errors
    /// A file is missing, or asks for something that this node does not support.
    pub fn dds_enclave(&self, argument: Option<&str>) -> Result<Option<PathBuf>, SecurityError> {
        if !cfg!(feature = "security") {
            return Err(SecurityError::NotBuilt);
        }
        let Some(folder) = self.folder(self.enclave(argument), &ENCLAVE_FILES)? else {
            return Ok(None);
        };
        if folder.join(REVOKED).exists() {
            return Err(SecurityError::Revoked(folder.join(REVOKED)));
        }
        let path = folder.join("governance.p7s");
        let read = intake::file::read(&path, GOVERNANCE_BYTES_MAX);
        let problem = match read {
            Ok(bytes) => governance_problem(&String::from_utf8_lossy(&bytes)),
            Err(error) => Some(error.to_string()),
        };
        match problem {
            Some(problem) => Err(SecurityError::Governance { path, problem }),
            None => Ok(Some(folder)),
        }
    }
}

/// `/kerf/axis_driver` as a path below the enclaves.
fn relative(name: &str) -> Result<&Path, SecurityError> {
    let refused = || SecurityError::EnclaveName(name.to_owned());
    let rest = name.strip_prefix('/').ok_or_else(refused)?;
    let is_part = |part: &str| !matches!(part, "" | "." | "..");
    (rest.is_empty() || rest.split('/').all(is_part)).then_some(Path::new(rest)).ok_or_else(refused)
}

/// Why a governance document is not supported, or would protect nothing.
///
/// The DDS layer loses each sample with `data_protection_kind` other than NONE whose length
/// is not a multiple of four, which is most of them. `metadata_protection_kind=ENCRYPT` hides
/// the same bytes.
pub fn governance_problem(document: &str) -> Option<String> {
    let mut topics = 0;
    for kind in elements(document, "data_protection_kind") {
        topics += 1;
        if kind != "NONE" {
            return Some(format!(
                "data_protection_kind is {kind}, with which samples are lost; it has to be NONE, \
                 and metadata_protection_kind ENCRYPT protects the same bytes"
            ));
        }
    }
    if topics == 0 {
        return Some("there is no data_protection_kind: it is no governance document".into());
    }
    let unprotected = |kind: &&str| !kind.starts_with("ENCRYPT");
    if let Some(kind) = elements(document, "metadata_protection_kind").find(unprotected) {
        return Some(format!(
            "metadata_protection_kind is {kind}: with data_protection_kind NONE everybody could \
             read; it has to be ENCRYPT"
        ));
    }
    for (flag, meaning) in [
        ("allow_unauthenticated_participants", "whoever has no key could move the machine"),
        ("enable_join_access_control", "whoever has any key could join"),
        ("enable_read_access_control", "whoever has any key could read everything"),
        ("enable_write_access_control", "whoever has any key could command everything"),
    ] {
        let wanted = if flag.starts_with("allow") { "false" } else { "true" };
        let is_other = |value: &&str| {
            let is_true = matches!(*value, "true" | "1" | "TRUE");
            is_true != (wanted == "true")
        };
        if elements(document, flag).next().is_none() {
            return Some(format!("{flag} is missing: it has to be {wanted}"));
        }
        if let Some(value) = elements(document, flag).find(is_other) {
            return Some(format!("{flag} is {value}: {meaning}; it has to be {wanted}"));
        }
    }
    None
}

/// The text between the tags of this name.
fn elements<'a>(document: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let (open, close) = (format!("<{name}>"), format!("</{name}>"));
    let mut rest = document;
    std::iter::from_fn(move || {
        let (_, after) = rest.split_once(&open)?;
        let (text, after) = after.split_once(&close)?;
        rest = after;
        Some(text.trim())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOVERNANCE: &str = include_str!("../../../../config/security/governance.xml");

    #[test]
    fn the_governance_of_this_stack_is_one_that_works() {
        assert_eq!(governance_problem(GOVERNANCE), None);
    }

    #[test]
    fn what_loses_samples_or_protects_nothing_is_refused() {
        let table = [
            ("<data_protection_kind>NONE", "<data_protection_kind>ENCRYPT", "samples are lost"),
            ("<metadata_protection_kind>ENCRYPT", "<metadata_protection_kind>NONE", "everybody"),
            ("<metadata_protection_kind>ENCRYPT", "<metadata_protection_kind>SIGN", "everybody"),
            ("<enable_read_access_control>true", "<enable_read_access_control>false", "any key"),
            ("enable_write_access_control", "no_such_element", "is missing"),
            (
                "<allow_unauthenticated_participants>false",
                "<allow_unauthenticated_participants> true",
                "no key",
            ),
            ("<enable_join_access_control>true", "<enable_join_access_control>0", "any key"),
        ];
        for (from, to, says) in table {
            assert!(GOVERNANCE.contains(from), "{from}");
            let problem = governance_problem(&GOVERNANCE.replace(from, to)).expect(to);
            assert!(problem.contains(says), "{problem}");
        }
        assert!(governance_problem("").expect("nothing").contains("no governance document"));
    }

    #[test]
    fn enclaves_are_absolute_names_within_the_keystore() {
        assert_eq!(relative("/"), Ok(Path::new("")));
        assert_eq!(relative("/kerf/axis_driver"), Ok(Path::new("kerf/axis_driver")));
        for name in ["", "kerf", "/kerf/", "//kerf", "/kerf/../../etc", "/."] {
            assert_eq!(relative(name), Err(SecurityError::EnclaveName(name.into())), "{name}");
        }
    }

    #[test]
    fn a_node_does_not_start_without_what_is_enforced() {
        let folder = tempfile::tempdir().expect("a folder");
        let request = |is_enforced| SecurityRequest {
            keystore: folder.path().into(),
            is_enforced,
            enclave: None,
        };
        if !cfg!(feature = "security") {
            assert_eq!(request(true).dds_enclave(None), Err(SecurityError::NotBuilt));
            assert_eq!(request(false).dds_enclave(None), Err(SecurityError::NotBuilt));
            return;
        }
        let error = request(true).dds_enclave(Some("/mill")).expect_err("there are no files");
        assert!(error.to_string().contains("enclaves/mill/identity_ca.cert.pem"), "{error}");
        assert_eq!(request(false).dds_enclave(Some("/mill")), Ok(None));

        let mill = folder.path().join("enclaves/mill");
        std::fs::create_dir_all(&mill).expect("created");
        for file in ENCLAVE_FILES {
            std::fs::write(mill.join(file), GOVERNANCE).expect("written");
        }
        assert_eq!(request(true).dds_enclave(Some("/mill")), Ok(Some(mill.clone())));
        let overriding = SecurityRequest { enclave: Some("/lathe".into()), ..request(true) };
        assert!(overriding.dds_enclave(Some("/mill")).is_err());
        std::fs::write(mill.join("governance.p7s"), "hello").expect("written");
        // Either strategy refuses files that exist and are wrong.
        assert!(matches!(
            request(false).dds_enclave(Some("/mill")),
            Err(SecurityError::Governance { .. })
        ));
        std::fs::write(mill.join("governance.p7s"), GOVERNANCE).expect("written");
        std::fs::write(mill.join(REVOKED), "").expect("written");
        assert!(matches!(request(true).dds_enclave(Some("/mill")), Err(SecurityError::Revoked(_))));
    }

    #[test]
    fn on_zenoh_the_enclave_has_the_configuration_of_the_session() {
        let folder = tempfile::tempdir().expect("a folder");
        let request = |is_enforced| SecurityRequest {
            keystore: folder.path().into(),
            is_enforced,
            enclave: None,
        };
        let error = request(true).zenoh_session(Some("/mill")).expect_err("there is no file");
        assert!(error.to_string().contains("enclaves/mill/zenoh.json5"), "{error}");
        assert_eq!(request(false).zenoh_session(Some("/mill")), Ok(None));
        let session = folder.path().join("enclaves/mill/zenoh.json5");
        std::fs::create_dir_all(session.parent().expect("a folder")).expect("created");
        std::fs::write(&session, "{}").expect("written");
        assert_eq!(request(true).zenoh_session(Some("/mill")), Ok(Some(session)));
        assert!(request(false).zenoh_session(Some("mill")).is_err());
        let overriding = SecurityRequest { enclave: Some("/lathe".into()), ..request(true) };
        assert_eq!(overriding.enclave(Some("/mill")), "/lathe");
        assert!(overriding.zenoh_session(Some("/mill")).is_err());
    }
}
