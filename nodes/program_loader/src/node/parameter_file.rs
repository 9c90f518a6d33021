//! The parameter file of the node: every program begins with its values, and a run that is finished
//! puts back what its program has changed.

use super::{Loader, Refusal, refuse};
use crate::parameter_file::{Left, PARAMETER_FILE_BYTES_MAX, after_run, with_parameters};
use cnc_msgs::profile::Profile;
use cnc_msgs::wire::cnc_msgs::msg::RunResult;
use cnc_msgs::wire::cnc_msgs::srv::LoadProgramResponse;
use intake::replace::replace;
use runtime::{Handle, Health, HealthLevel, NodeError, Qos};
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Programs whose end is remembered: one that is loaded while another runs must not take its place.
const PROGRAMS_MAX: usize = 8;

/// The file, and what programs leave in it.
pub(super) struct ParameterFile {
    path: PathBuf,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// By program id, newest last.
    left: Vec<(String, Vec<Left>)>,
    /// Why the file lacks what the newest run has left.
    trouble: Option<String>,
}

impl ParameterFile {
    /// `None` where the node has no such file.
    pub(super) fn of(node: &Handle) -> Option<Self> {
        let path: String = node.parameter("parameter_file");
        (!path.is_empty()).then(|| Self { path: path.into(), state: Mutex::default() })
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The text of a program with the values of the file.
    pub(super) fn append(&self, text: Vec<u8>, profile: &Profile) -> Result<Vec<u8>, Refusal> {
        let path = self.path.display().to_string();
        let refused = |why: &dyn std::fmt::Display| {
            let message = format!("parameter_file {path}: {why}");
            refuse(LoadProgramResponse::INVALID_REQUEST, message)
        };
        let file = intake::file::read(&self.path, PARAMETER_FILE_BYTES_MAX)
            .or_else(|error| refused(&error))?;
        with_parameters(text, profile, &path, &file).or_else(|error| refused(&error))
    }

    /// Remembers what a program leaves when it has run.
    pub(super) fn loaded(&self, program_id: &str, left: Vec<Left>) {
        let state = &mut self.state().left;
        state.retain(|(known, _)| known != program_id);
        if !left.is_empty() {
            state.push((program_id.to_owned(), left));
            let surplus = state.len().saturating_sub(PROGRAMS_MAX);
            state.drain(..surplus);
        }
    }

    /// Puts what the program of a finished run has left into the file.
    fn finished(&self, result: &RunResult) {
        if result.outcome != RunResult::OUTCOME_SUCCEEDED {
            return;
        }
        let left = self.state().left.iter().find(|it| it.0 == result.program_id).cloned();
        let Some((_, left)) = left else { return };
        let path = self.path.display();
        let trouble = match self.write(&left) {
            Ok(false) => None,
            Ok(true) => {
                tracing::warn!(
                    "{path} has {} values that the program has set; the program that is loaded \
                     begins with those from before: load it again to go on with the new ones",
                    left.len()
                );
                None
            }
            Err(why) => {
                let message = format!(
                    "{path} lacks {} values that the program has set: {why}; the next program \
                     begins with those from before",
                    left.len()
                );
                tracing::error!("{message}");
                Some(message)
            }
        };
        self.state().trouble = trouble;
    }

    /// Whether the file was changed.
    fn write(&self, left: &[Left]) -> Result<bool, intake::file::ReadError> {
        // A link stays a link.
        let path = fs::canonicalize(&self.path)?;
        let permissions = fs::metadata(&path)?.permissions();
        let before = intake::file::read(&path, PARAMETER_FILE_BYTES_MAX)?;
        let after = after_run(&before, left);
        if before == after {
            return Ok(false);
        }
        if permissions.readonly() {
            // The file could still be replaced, but its owner does not want that.
            return Err(std::io::Error::other("it is read-only").into());
        }
        replace(&path, &after)?;
        Ok(true)
    }

    /// `None` where there is nothing to tell.
    pub(super) fn health(&self) -> Option<Health> {
        let message = self.state().trouble.clone()?;
        let component = "parameter file".to_owned();
        Some(Health { component, level: HealthLevel::Warn, message, ..Health::default() })
    }
}

/// Follows the runs, where there is a file to write. Only results from now on: an older one has
/// nothing to do with a program that is loaded later.
pub(super) fn follow(node: &Handle, loader: &Arc<Loader>) -> Result<(), NodeError> {
    if loader.parameter_file.is_none() {
        return Ok(());
    }
    let mut results = node.subscription::<RunResult>("run_result", Qos::DEFAULT)?;
    let loader = Arc::clone(loader);
    node.spawn("run results", async move {
        loop {
            let (result, _) = results.next().await;
            let loader = Arc::clone(&loader);
            let written = tokio::task::spawn_blocking(move || {
                if let Some(file) = &loader.parameter_file {
                    file.finished(&result);
                }
            });
            if let Err(error) = written.await {
                tracing::error!("the parameter file was not written: {error}");
            }
        }
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn left(number: u32, value: f64) -> Vec<Left> {
        vec![Left { number, value: Some(value) }]
    }

    fn result(program_id: &str, outcome: u8) -> RunResult {
        RunResult { program_id: program_id.into(), outcome, ..RunResult::default() }
    }

    #[test]
    fn a_run_that_succeeds_changes_the_file_and_no_other_does() {
        const DONE: u8 = RunResult::OUTCOME_SUCCEEDED;
        let folder = tempfile::tempdir().expect("a folder");
        let (path, link) = (folder.path().join("mill.var"), folder.path().join("link.var"));
        fs::write(&path, "31\t7.000000\n").expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("allowed");
        std::os::unix::fs::symlink(&path, &link).expect("a link");
        let file = ParameterFile { path: link.clone(), state: Mutex::default() };
        let text = || fs::read_to_string(&path).expect("there");
        file.loaded("first", left(31, 8.0));
        for outcome in
            [RunResult::OUTCOME_UNKNOWN, RunResult::OUTCOME_CANCELED, RunResult::OUTCOME_ABORTED]
        {
            file.finished(&result("first", outcome));
        }
        file.finished(&result("another", DONE));
        assert_eq!(text(), "31\t7.000000\n");
        // The next program is loaded while this one runs.
        file.loaded("second", left(32, 1.0));
        file.finished(&result("first", DONE));
        assert_eq!(text(), "31\t8.0\n");
        file.finished(&result("second", DONE));
        assert_eq!(text(), "31\t8.0\n32\t1.0\n");
        assert_eq!(file.health(), None);
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
        assert_eq!(fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o640);
        assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2, "no other file is left");
        // A file that its owner has locked stays as it is, and that is said until a run is kept.
        file.loaded("third", left(31, 9.0));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o440)).expect("allowed");
        file.finished(&result("third", DONE));
        let trouble = file.health().expect("trouble").message;
        assert!(trouble.contains("read-only") && trouble.contains("1 values"), "{trouble}");
        assert_eq!(text(), "31\t8.0\n32\t1.0\n");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("allowed");
        file.finished(&result("third", DONE));
        assert_eq!(file.health(), None);
        fs::remove_file(&path).expect("removed");
        file.finished(&result("third", DONE));
        let trouble = file.health().expect("trouble").message;
        assert!(trouble.contains("No such file"), "{trouble}");
    }

    #[test]
    fn few_programs_are_remembered() {
        let file = ParameterFile { path: PathBuf::new(), state: Mutex::default() };
        for number in 0..20 {
            file.loaded(&number.to_string(), left(31, 1.0));
        }
        file.loaded("19", Vec::new());
        assert_eq!(file.state().left.len(), PROGRAMS_MAX - 1);
        assert_eq!(file.state().left[0].0, "12");
    }
}
