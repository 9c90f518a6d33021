//! The parameter file of the node: every program begins with its values, and a run that is finished
//! puts back what its program has changed.

use super::{Refusal, refuse};
use crate::parameter_file::runs::Runs;
use crate::parameter_file::{Left, PARAMETER_FILE_BYTES_MAX, after_run, with_parameters};
use cnc_msgs::profile::Profile;
use cnc_msgs::wire::cnc_msgs::msg::RunResult;
use cnc_msgs::wire::cnc_msgs::srv::LoadProgramResponse;
use intake::replace::replace;
use runtime::{Handle, Health, HealthLevel};
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// The file, and what programs leave in it.
pub(super) struct ParameterFile {
    path: PathBuf,
    state: Mutex<FileState>,
}

struct FileState {
    runs: Runs,
    /// Why the file lacks what the newest run has left.
    trouble: Option<String>,
}

impl ParameterFile {
    /// `None` where the node has no such file.
    pub(super) fn of(node: &Handle) -> Option<Self> {
        let path: String = node.parameter("parameter_file");
        let runs = Runs::since(node.now().into());
        (!path.is_empty()).then(|| Self::new(path.into(), runs))
    }

    fn new(path: PathBuf, runs: Runs) -> Self {
        Self { path, state: Mutex::new(FileState { runs, trouble: None }) }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, FileState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The text of a program with the values of the file.
    pub(super) fn append(&self, text: Vec<u8>, profile: &Profile) -> Result<Vec<u8>, Refusal> {
        let path = self.path.display().to_string();
        // Who loads a program need not know the folders of this host.
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let refused = |why: &dyn std::fmt::Display| {
            let message = format!("parameter_file {path}: {why}");
            refuse(LoadProgramResponse::INVALID_REQUEST, message)
        };
        let file = intake::file::read(&self.path, PARAMETER_FILE_BYTES_MAX)
            .or_else(|error| refused(&error))?;
        with_parameters(text, profile, &name, &file).or_else(|error| refused(&error))
    }

    /// Remembers what a program leaves when it has run.
    pub(super) fn loaded(&self, program_id: &str, left: Vec<Left>) {
        self.state().runs.loaded(program_id, left);
    }

    /// Puts what the program of a finished run has left into the file.
    pub(super) fn finished(&self, result: &RunResult) {
        let path = self.path.display();
        let left = self.state().runs.ended(result).map(<[Left]>::to_vec);
        let written = match left {
            Ok(left) if left.is_empty() => return,
            Ok(left) => self.write(&left),
            Err(why) => Err(why.into()),
        };
        let trouble = written.err().map(|why| format!("{path} was not changed after a run: {why}"));
        if let Some(message) = &trouble {
            tracing::error!("{message}");
        }
        self.state().trouble = trouble;
    }

    fn write(&self, left: &[Left]) -> Result<(), Box<dyn Error + Send + Sync>> {
        // A link stays a link.
        let path = fs::canonicalize(&self.path)?;
        let before = intake::file::read(&path, PARAMETER_FILE_BYTES_MAX)?;
        let after = after_run(&before, left)?;
        if before == after {
            return Ok(());
        }
        if fs::metadata(&path)?.permissions().readonly() {
            // The file could still be replaced, but its owner does not want that.
            return Err("it is read-only".into());
        }
        replace(&path, &after)?;
        let path = path.display();
        if left.iter().any(|it| it.is_read && it.began != it.value) {
            tracing::warn!(
                "{path} has what the program has left; the program that is loaded begins with the \
                 values from before: load it again to go on with the new ones"
            );
        } else {
            tracing::info!("{path} has what the program has left");
        }
        Ok(())
    }

    /// What was wrong with the runs before is not reported any more.
    pub(super) fn forget_trouble(&self) {
        self.state().trouble = None;
    }

    /// `None` if there is nothing to report.
    pub(super) fn health(&self) -> Option<Health> {
        let message = self.state().trouble.clone()?;
        let component = "parameter file".to_owned();
        Some(Health { component, level: HealthLevel::Warn, message, ..Health::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::wire::builtin_interfaces::msg::Time;
    use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
    use std::cell::Cell;
    use std::os::unix::fs::PermissionsExt;

    fn counts(began: f64) -> Vec<Left> {
        vec![Left { number: 31, began, value: began + 1.0, is_read: true }]
    }

    #[test]
    fn a_run_that_succeeds_changes_the_file_and_no_other_does() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, link) = (folder.path().join("mill.var"), folder.path().join("link.var"));
        fs::write(&path, "31\t7.000000\n").expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("allowed");
        std::os::unix::fs::symlink(&path, &link).expect("a link");
        let file = ParameterFile::new(link.clone(), Runs::since(Time::default()));
        let text = || fs::read_to_string(&path).expect("there");
        let goals = Cell::new(0);
        // Returns the trouble.
        let run = |program_id: &str, outcome| {
            goals.set(goals.get() + 1);
            let goal_id = UUID { uuid: [goals.get(); 16] };
            let program_id = program_id.to_owned();
            file.finished(&RunResult { goal_id, program_id, outcome, ..RunResult::default() });
            file.health().map_or(String::new(), |health| health.message)
        };
        let (done, aborted) = (RunResult::OUTCOME_SUCCEEDED, RunResult::OUTCOME_ABORTED);
        file.loaded("first", counts(7.0));
        assert_eq!(run("first", aborted), "");
        assert_eq!(text(), "31\t7.000000\n");
        // The next program is loaded while this one runs.
        file.loaded("second", counts(7.0));
        assert_eq!(run("first", done), "");
        assert_eq!(text(), "31\t8.0\n");
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
        assert_eq!(fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o640);
        assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2, "no other file is left");
        // Neither the first once more nor the second counts, and that is said until a run is kept.
        for program in ["first", "second"] {
            let trouble = run(program, done);
            assert!(trouble.contains("#31 is 8 in it, and the program began with 7"), "{trouble}");
        }
        file.loaded("nothing", Vec::new());
        assert!(run("nothing", done).contains("#31 is 8"));
        assert!(run("unknown", done).contains("its program is not known"));
        file.loaded("second", counts(8.0));
        assert_eq!(run("second", done), "");
        assert_eq!(text(), "31\t9.0\n");
        // A file that its owner has locked stays as it is.
        file.loaded("third", counts(9.0));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o440)).expect("allowed");
        assert!(run("third", done).contains("it is read-only"));
        assert_eq!(text(), "31\t9.0\n");
        file.forget_trouble();
        assert_eq!(file.health(), None);
        fs::remove_file(&path).expect("removed");
        assert!(run("third", done).contains("No such file"));
    }
}
