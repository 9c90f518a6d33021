//! The file that keeps a program on which the planner and its audit disagree, for a report.
//!
//! `kerf plan`, `kerf check` and the node write the same file.

use super::{Input, Planner};
use crate::verdict::Disagreement;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::diagnostic::Diagnostic;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::cnc_msgs::srv::GetProgramChunksRequest;
use serde_yaml::{Mapping, Value};
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The folder, unless a parameter names another one.
pub const FOLDER: &str = "kerf-reports";

/// How long the loader may take to hand over a piece of the text.
const ASK_WITHIN: Duration = Duration::from_secs(2);

/// What was judged.
#[derive(Debug, Clone, Copy)]
pub struct Judged<'a> {
    pub name: &'a str,
    /// The part program; empty when it cannot be had.
    pub text: &'a [u8],
    pub contour: &'a ProgrammedContour,
    pub profile: &'a Profile,
    pub tools: &'a ToolTable,
    pub findings: &'a [Diagnostic],
}

/// Writes the file into a folder, which is made; one that is there already is of the same
/// program and stays.
///
/// # Errors
/// The folder or the file cannot be written.
pub fn keep(
    folder: &Path,
    disagreement: &Disagreement,
    judged: &Judged<'_>,
) -> std::io::Result<PathBuf> {
    std::fs::create_dir_all(folder)?;
    let path = folder.join(&disagreement.file_name);
    match OpenOptions::new().write(true).create_new(true).open(&path) {
        Ok(mut file) => file.write_all(document(judged).as_bytes())?,
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
        Err(error) => return Err(error),
    }
    Ok(path)
}

fn document(judged: &Judged<'_>) -> String {
    let yaml = |value: Result<Value, serde_yaml::Error>| value.unwrap_or(Value::Null);
    let findings: Vec<String> = judged
        .findings
        .iter()
        .map(|it| format!("line {} {}: {}", it.source.line, it.code.name(), it.message))
        .collect();
    let fields = [
        ("build", Value::from(concat!("kerf ", env!("CARGO_PKG_VERSION")))),
        ("program", Value::from(judged.name)),
        ("start_mm", yaml(serde_yaml::to_value(judged.contour.start))),
        ("findings", yaml(serde_yaml::to_value(findings))),
        ("tools", yaml(serde_yaml::to_value(judged.tools))),
        ("controller", yaml(serde_yaml::to_value(judged.profile))),
        ("text", Value::from(String::from_utf8_lossy(judged.text).into_owned())),
    ];
    let fields = fields.into_iter().map(|(key, value)| (Value::from(key), value));
    serde_yaml::to_string(&fields.collect::<Mapping>()).unwrap_or_default()
}

impl Planner {
    /// Keeps the program that was just judged, and says where.
    pub(super) fn keep(
        &self,
        disagreement: &Disagreement,
        input: &Input,
        tools: &ToolTable,
        findings: &[Diagnostic],
    ) {
        let Input { manifest, contour, profile } = input;
        let text = tokio::runtime::Handle::current().block_on(self.text(&manifest.program_id));
        let name = &manifest.name;
        let judged = Judged { name, text: &text, contour, profile, tools, findings };
        match keep(&self.report_directory, disagreement, &judged) {
            Ok(path) => tracing::error!(
                "the planner and the audit of its path disagree on {name}: a defect of Kerf; \
                 please report {}",
                path.display()
            ),
            Err(error) => tracing::error!(
                "the planner and the audit of its path disagree on {name}, and {} cannot be \
                 written: {error}",
                self.report_directory.join(&disagreement.file_name).display()
            ),
        }
    }

    /// The text of a program, as far as the loader hands it over.
    async fn text(&self, program_id: &str) -> Vec<u8> {
        let (mut first, mut text) = (0, Vec::new());
        loop {
            let request = GetProgramChunksRequest { program_id: program_id.to_owned(), first };
            let Ok(answer) = self.programs.call_within(request, ASK_WITHIN).await else {
                return text;
            };
            let Some(last) = answer.chunks.last() else { return text };
            let next = last.index + 1;
            let is_complete = next >= last.chunk_count;
            text.extend(answer.chunks.iter().flat_map(|chunk| &chunk.data));
            if is_complete || next <= first {
                return text;
            }
            first = next;
        }
    }
}
