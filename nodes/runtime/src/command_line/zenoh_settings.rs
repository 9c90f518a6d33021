//! The settings of Zenoh in the environment.
//!
//! Pure; the variables are those of rmw_zenoh_cpp. Reading the file is up to who opens the session.

use crate::command_line::environment::EnvironmentError;
use std::path::PathBuf;

/// How the session of a node is opened.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ZenohSettings {
    /// The configuration of the session; none: that of rmw_zenoh_cpp.
    pub session_config: Option<PathBuf>,
    /// Single settings on top of it: a key and its value in JSON5.
    pub overrides: Vec<(String, String)>,
    pub router_check: RouterCheck,
    /// The enclave that the node announces; empty: `/`.
    pub enclave: String,
    /// `ROS_SECURITY_STRATEGY=Enforce`: a session that is not protected is not opened.
    pub must_be_protected: bool,
}

/// How long a node waits for a router.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RouterCheck {
    /// Long enough for a router that is there: our default.
    #[default]
    Brief,
    /// Not at all: the node starts without one.
    Skip,
    /// So many attempts, one a second.
    Attempts(u32),
    /// Until one is there.
    Endless,
}

impl ZenohSettings {
    /// Reads the variables; `get` returns those that are set and not empty.
    ///
    /// # Errors
    /// A value is invalid.
    pub(crate) fn read<'a>(
        get: impl Fn(&str) -> Option<&'a str>,
    ) -> Result<Self, EnvironmentError> {
        const ATTEMPTS: &str = "ZENOH_ROUTER_CHECK_ATTEMPTS";
        const OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";
        let refuse = |variable, value: &str, reason: &str| EnvironmentError {
            variable,
            value: value.to_owned(),
            reason: reason.to_owned(),
        };
        let router_check = match get(ATTEMPTS) {
            None => RouterCheck::Brief,
            Some(value) => match value.parse::<i64>() {
                Ok(0) => RouterCheck::Endless,
                Ok(..0) => RouterCheck::Skip,
                Ok(count) => RouterCheck::Attempts(u32::try_from(count).unwrap_or(u32::MAX)),
                Err(_) => {
                    let reason = "a whole number is needed: how often to look for a router, once a \
                                  second; 0 waits until there is one, -1 does not look";
                    return Err(refuse(ATTEMPTS, value, reason));
                }
            },
        };
        let mut overrides = Vec::new();
        for setting in get(OVERRIDE).into_iter().flat_map(|value| value.split(';')) {
            match setting.trim().split_once('=') {
                Some((key, value)) if !key.trim().is_empty() => {
                    overrides.push((key.trim().to_owned(), value.trim().to_owned()));
                }
                None if setting.trim().is_empty() => {}
                _ => {
                    let reason = "KEY=VALUE is needed, several with ; between them, as \
                                  connect/endpoints=[\"tcp/10.0.0.2:7447\"]";
                    return Err(refuse(OVERRIDE, setting.trim(), reason));
                }
            }
        }
        let session_config = get("ZENOH_SESSION_CONFIG_URI").map(path);
        Ok(Self {
            session_config,
            overrides,
            router_check,
            enclave: String::new(),
            must_be_protected: false,
        })
    }
}

/// The file of a variable, which may be written as a URI.
pub(crate) fn path(uri: &str) -> PathBuf {
    PathBuf::from(uri.strip_prefix("file://").unwrap_or(uri))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, value: &'static str) -> Result<ZenohSettings, EnvironmentError> {
        ZenohSettings::read(|asked| (asked == name).then_some(value))
    }

    #[test]
    fn a_router_is_looked_for_as_often_as_it_says() {
        use RouterCheck::{Attempts, Brief, Endless, Skip};
        assert_eq!(read("", "").expect("valid").router_check, Brief);
        for (value, check) in [
            ("-1", Skip),
            ("-7", Skip),
            ("0", Endless),
            ("3", Attempts(3)),
            ("99999999999", Attempts(u32::MAX)),
        ] {
            let found = read("ZENOH_ROUTER_CHECK_ATTEMPTS", value).expect(value);
            assert_eq!(found.router_check, check, "{value}");
        }
        for value in ["often", "1.5", "1 s"] {
            let error = read("ZENOH_ROUTER_CHECK_ATTEMPTS", value).expect_err(value).to_string();
            assert!(error.contains(value) && error.contains("whole number"), "{error}");
        }
    }

    #[test]
    fn single_settings_have_a_key_and_a_value() {
        let read = |value| read("ZENOH_CONFIG_OVERRIDE", value).map(|found| found.overrides);
        let found = read("mode=\"client\"; connect/endpoints=[\"tcp/a:1\"];").expect("valid");
        let owned = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        assert_eq!(
            found,
            [owned("mode", "\"client\""), owned("connect/endpoints", "[\"tcp/a:1\"]")]
        );
        for value in ["mode", "=1", "mode=1;oops"] {
            assert!(read(value).is_err(), "{value}");
        }
    }

    #[test]
    fn a_configuration_is_a_path_or_a_uri_of_one() {
        for uri in ["/etc/cell.json5", "file:///etc/cell.json5"] {
            let found = read("ZENOH_SESSION_CONFIG_URI", uri).expect("valid").session_config;
            assert_eq!(found.as_deref(), Some(std::path::Path::new("/etc/cell.json5")));
        }
    }
}
