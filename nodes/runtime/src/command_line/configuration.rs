//! The configuration of a node: arguments, environment and parameter files combined.
//!
//! Reads parameter files; everything else is given. Nothing is started here,
//! so that every error is reported before the node appears.

use crate::command_line::arguments::{ArgumentError, Arguments};
use crate::command_line::environment::{Environment, EnvironmentError, ServiceMapping};
use crate::command_line::log_levels::LogSettings;
use crate::command_line::names::{NameError, Names};
use crate::command_line::parameter_file;
use crate::command_line::security::SecurityError;
use crate::parameters::common::{autostart, of_process};
use crate::parameters::{Declared, ParameterError, Parameters};
use settings::yaml::{FileError, read_text};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// All that is decided before a node starts.
#[derive(Debug, Clone)]
pub struct Configuration {
    pub names: Names,
    pub environment: Environment,
    pub parameters: Parameters,
    pub logs: LogSettings,
    /// The keys and the rights of the node on DDS. None: nothing is protected, or the node is on Zenoh, whose
    /// session has them.
    pub enclave: Option<PathBuf>,
    /// The words of the command line that are not for ROS.
    pub rest: Vec<String>,
    /// What was understood but has no effect; for the log.
    pub warnings: Vec<String>,
}

/// Why a node cannot be started as asked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConfigurationError {
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    #[error(transparent)]
    Security(#[from] SecurityError),
    #[error(transparent)]
    Name(#[from] NameError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error("argument \"{0}\" is not known; see --ros-args")]
    Word(String),
    /// All parameters that do not fit, one a line.
    #[error("{}", lines(.0))]
    Parameters(Vec<ParameterError>),
}

impl Configuration {
    /// Puts the configuration of the node `name` together: defaults, then
    /// parameter files in order, then `-p` in order.
    ///
    /// # Errors
    /// The first thing that is wrong; of parameters, all.
    pub fn read(
        name: &str,
        declared: Vec<Declared>,
        words: &[String],
        variables: &BTreeMap<String, String>,
    ) -> Result<Self, ConfigurationError> {
        let arguments = Arguments::parse(words)?;
        let mut environment = Environment::read(variables)?;
        let names = Names::new(name, &arguments.remaps)?;
        let mut warnings = arguments.warnings.clone();
        warnings.extend(environment.warnings.iter().cloned());
        let asked = arguments.enclave.as_deref();
        let is_zenoh = environment.mapping == ServiceMapping::Queries;
        let mut enclave = None;
        if let Some(request) = &environment.security {
            if is_zenoh {
                environment.zenoh.session_config = request.zenoh_session(asked)?;
                environment.zenoh.enclave = request.enclave(asked).to_owned();
                environment.zenoh.must_be_protected = request.is_enforced;
            } else {
                enclave = request.dds_enclave(asked)?;
            }
        } else if let Some(asked) = asked {
            environment.zenoh.enclave = asked.to_owned();
        }
        if environment.security.is_some()
            && enclave.is_none()
            && environment.zenoh.session_config.is_none()
        {
            warnings.push(
                "there is no such enclave, and ROS_SECURITY_STRATEGY is not Enforce: whoever \
                 reaches this node can command it"
                    .into(),
            );
        }
        let mut parameters =
            Parameters::declare(declared).map_err(|error| vec![error]).map_err(Self::refused)?;
        let mut overrides = Vec::new();
        for file in &arguments.parameter_files {
            let text = read_text(Path::new(file))?;
            overrides.extend(parameter_file::read(&text, file, &names, name)?.overrides);
        }
        overrides.extend(parameter_file::from_arguments(&arguments.parameters, &names, name)?);
        warnings.extend(parameters.apply(&overrides).map_err(Self::refused)?);
        let logs = LogSettings::new(&arguments, &names);
        Ok(Self { names, environment, parameters, logs, enclave, rest: arguments.rest, warnings })
    }

    /// The configuration of a managed node from the environment of this process.
    ///
    /// # Errors
    /// As [`Self::read`]; or a word is not for ROS.
    pub fn of_process(
        name: &str,
        mut declared: Vec<Declared>,
        words: &[String],
    ) -> Result<Self, ConfigurationError> {
        declared.push(autostart());
        declared.extend(of_process());
        // Variables that are not UTF-8 are not ours.
        let variables = std::env::vars_os()
            .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
            .collect();
        let configuration = Self::read(name, declared, words, &variables)?;
        match configuration.rest.first() {
            Some(word) => Err(ConfigurationError::Word(word.clone())),
            None => Ok(configuration),
        }
    }

    fn refused(errors: Vec<ParameterError>) -> ConfigurationError {
        ConfigurationError::Parameters(errors)
    }
}

fn lines(errors: &[ParameterError]) -> String {
    errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::ParameterValue;

    fn read(words: &[&str]) -> Result<Configuration, ConfigurationError> {
        let declared =
            vec![Declared::new("port", "", "the line"), Declared::new("rate_hz", 10.0, "Hz")];
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        Configuration::read("driver", declared, &words, &BTreeMap::new())
    }

    #[test]
    fn arguments_win_over_files_and_later_files_over_earlier_ones() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("written");
            path.display().to_string()
        };
        let one = file("1.yaml", "/**:\n  ros__parameters: {port: a, rate_hz: 1.0, other: 1}\n");
        let two = file("2.yaml", "/cell/left:\n  ros__parameters: {rate_hz: 2.0}\n");
        let found = read(&[
            "--ros-args",
            "--params-file",
            &one,
            "--params-file",
            &two,
            "-p",
            "driver:port:=b",
            "-r",
            "__node:=left",
            "-r",
            "__ns:=/cell",
        ])
        .expect("valid");
        assert_eq!(found.names.fully_qualified(), "/cell/left");
        assert_eq!(found.parameters.get("port"), Some(&ParameterValue::from("b")));
        assert_eq!(found.parameters.get("rate_hz"), Some(&ParameterValue::from(2.0)));
        assert_eq!(found.warnings.len(), 1, "{:?}", found.warnings);
        // An argument wins over a later file, and the last argument over earlier ones.
        let words = ["--ros-args", "-p", "port:=c", "-p", "port:=d", "--params-file", &one];
        assert_eq!(read(&words).expect("valid").parameters.get("port"), Some(&"d".into()));
    }

    #[test]
    fn every_error_is_reported_before_the_start() {
        let error = read(&["--ros-args", "-p", "rate_hz:=1", "-p", "prot:=x"]);
        let text = error.expect_err("two errors").to_string();
        assert_eq!(text.lines().count(), 2, "{text}");
        assert!(text.contains("write 1.0") && text.contains("known") || text.contains("port"));
        assert!(read(&["--ros-args", "--params-file", "/no/such/file.yaml"]).is_err());
        assert!(read(&["--ros-args", "-r", "__node:=9"]).is_err());
    }
}
