//! The parameters of several nodes that are started together.
//!
//! One node cannot know whether a key under `/**`, or a section, is meant for another node.
//! A launcher of all nodes can. It refuses parameters that no node has before it starts any.

use crate::command_line::arguments::{Arguments, ParameterArgument};
use crate::command_line::configuration::ConfigurationError;
use crate::command_line::names::Names;
use crate::command_line::parameter_file;
use crate::parameters::common::{autostart, of_process};
use crate::parameters::{Declared, Origin, Override, ParameterError, Parameters};
use intake::nearest::nearest;
use settings::yaml::{FileError, read_text};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The parameters of each node of a stack.
#[derive(Debug)]
pub struct StackParameters {
    /// By the default name of the node.
    pub nodes: BTreeMap<String, Parameters>,
    /// What has no effect on any node.
    pub warnings: Vec<String>,
}

impl StackParameters {
    /// Reads the parameter files and `-p` in `words` for these managed nodes.
    ///
    /// # Errors
    /// What is wrong for a node, or a parameter that none of them has.
    pub fn read(
        nodes: Vec<(&str, Vec<Declared>)>,
        words: &[String],
    ) -> Result<Self, ConfigurationError> {
        let arguments = Arguments::parse(words)?;
        let mut files = Vec::new();
        for file in &arguments.parameter_files {
            files.push((file, read_text(Path::new(file))?));
        }
        let mut read = BTreeMap::new();
        // By default, and as they are called here.
        let mut called: BTreeSet<String> = BTreeSet::new();
        let mut errors = Vec::new();
        let mut shared: Vec<Override> = Vec::new();
        // Sections that are meant for no node so far.
        let mut others: Option<BTreeSet<(String, String)>> = None;
        for (name, mut declared) in nodes {
            declared.push(autostart());
            declared.extend(of_process());
            let names = Names::new(name, &arguments.remaps)?;
            let mut parameters = Parameters::declare(declared)
                .map_err(|error| ConfigurationError::Parameters(vec![error]))?;
            let mut overrides = Vec::new();
            let mut passed_over = BTreeSet::new();
            for (file, text) in &files {
                let found = parameter_file::read(text, file, &names, name)?;
                overrides.extend(found.overrides);
                passed_over
                    .extend(found.others.into_iter().map(|(Origin(place), name)| (place, name)));
            }
            others = Some(match others {
                None => passed_over,
                Some(others) => &others & &passed_over,
            });
            overrides.extend(parameter_file::from_arguments(&arguments.parameters, &names, name)?);
            if let Err(wrong) = parameters.apply(&overrides) {
                errors.extend(wrong);
            }
            shared.extend(overrides.into_iter().filter(|found| found.is_shared));
            read.insert(name.to_owned(), parameters);
            called.insert(names.node().to_owned());
        }
        called.extend(read.keys().cloned());
        for argument in &arguments.parameters {
            if let Some(node) = argument.node.as_ref().filter(|node| !called.contains(*node)) {
                return Err(of_no_node(node, argument, &called).into());
            }
        }
        let known: BTreeSet<&str> = read
            .values()
            .flat_map(Parameters::iter)
            .map(|(declared, _)| declared.name.as_str())
            .collect();
        let mut said = BTreeSet::new();
        for Override { name, origin, .. } in shared {
            let is_new = said.insert((origin.0.clone(), name.clone()));
            let is_known = known.contains(name.as_str())
                || read.values().any(|node| node.renamed(&name).is_some());
            if is_new && !is_known && !Parameters::is_of_ros(&name) {
                let meant = nearest(&name, known.iter().copied()).map(str::to_owned);
                errors.push(ParameterError::OfNoNode { origin, name, meant });
            }
        }
        if !errors.is_empty() {
            return Err(ConfigurationError::Parameters(errors));
        }
        let warning = |(place, section): (String, String)| {
            format!(
                "{place}: no node that is started here is called \"{section}\"; its parameters have no effect"
            )
        };
        let warnings = others.unwrap_or_default().into_iter().map(warning).collect();
        Ok(Self { nodes: read, warnings })
    }
}

/// A value for a node that is not started here would have no effect.
fn of_no_node(node: &str, argument: &ParameterArgument, called: &BTreeSet<String>) -> FileError {
    let origin = format!("-p {node}:{}:={}", argument.name, argument.yaml);
    let meant = nearest(node, called.iter().map(String::as_str));
    let why = match meant {
        Some(meant) => format!("there is no node \"{node}\"; did you mean \"{meant}\"?"),
        None => {
            let called: Vec<&str> = called.iter().map(String::as_str).collect();
            format!("there is no node \"{node}\" here; there are {}", called.join(", "))
        }
    };
    FileError::new(&origin, None, why)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<StackParameters, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("f.yaml");
        std::fs::write(&file, text).expect("written");
        let words = ["--ros-args", "-r", "__ns:=/mill", "--params-file"].map(str::to_owned);
        let words = [&words[..], &[file.display().to_string()]].concat();
        let nodes = vec![
            ("axis_driver", vec![Declared::new("port", "", "the line")]),
            ("program_loader", vec![Declared::new("frame_id", "work", "the frame")]),
        ];
        StackParameters::read(nodes, &words).map_err(|error| error.to_string())
    }

    #[test]
    fn a_parameter_of_no_node_is_refused_with_the_nearest_name() {
        let section =
            |name: &str, key: &str| format!("{name}:\n  ros__parameters:\n    {key}: a\n");
        let table = [
            (
                section("/**", "frame_idd"),
                Err("f.yaml:3: parameter \"frame_idd\" belongs to no node; did you mean \
                     \"frame_id\"?"),
            ),
            (section("/**", "speed"), Err("parameter \"speed\" belongs to no node")),
            (section("/**", "frame_id"), Ok(0)),
            (section("/**", "port"), Ok(0)),
            (
                section("/**/axis_driver", "prot"),
                Err("f.yaml:3: parameter \"prot\" is not one of this node's"),
            ),
            (
                section("/**/axis_drvier", "port"),
                Err("f.yaml:1: there is no node \"axis_drvier\"; did you mean \"axis_driver\"?"),
            ),
            (section("/mill/programloader", "frame_id"), Err("did you mean \"program_loader\"?")),
            (section("/mill/camera", "rate"), Ok(1)),
            (section("/lathe/axis_driver", "port"), Ok(1)),
            (section("/mill/axis_driver_left", "port"), Ok(1)),
        ];
        for (text, expected) in table {
            match (read(&text), expected) {
                (Ok(found), Ok(warnings)) => assert_eq!(found.warnings.len(), warnings, "{text}"),
                (Err(error), Err(part)) => assert!(error.contains(part), "{text}{error}"),
                (found, _) => panic!("{text}{found:?}"),
            }
        }
        for (argument, expected) in [
            ("axis_driver:port:=a", None),
            ("port:=a", None),
            (
                "axsi_driver:port:=a",
                Some(
                    "-p axsi_driver:port:=a: there is no node \"axsi_driver\"; did you mean \"axis_driver\"?",
                ),
            ),
            ("camera:rate:=1", Some("there is no node \"camera\" here; there are axis_driver")),
        ] {
            let words = ["--ros-args", "-p", argument].map(str::to_owned);
            let nodes = vec![("axis_driver", vec![Declared::new("port", "", "the line")])];
            let error = StackParameters::read(nodes, &words).err().map(|it| it.to_string());
            match expected {
                None => assert_eq!(error, None),
                Some(part) => {
                    assert!(error.as_ref().is_some_and(|it| it.contains(part)), "{error:?}")
                }
            }
        }
        let found = read(&section("/**", "port")).expect("valid");
        assert_eq!(found.nodes["axis_driver"].get("port"), Some(&"a".into()));
    }
}
