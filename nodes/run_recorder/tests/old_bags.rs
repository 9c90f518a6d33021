//! The recorder process removes expired bags when it starts.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::thread::sleep;
use std::time::{Duration, Instant, UNIX_EPOCH};

use run_recorder::run_bag::{RunBag, RunBagOptions};
use run_recorder::stored_bags::mark;

const LONG: Duration = Duration::from_secs(60);

/// The recorder as a process of its own, killed with the test.
struct Recorder(Child, PathBuf);

impl Recorder {
    /// The folder of its log, and of the folder of its bags.
    fn start(folder: &Path, parameter: &str) -> Self {
        let log = folder.join("log");
        let directory = folder.join("bags");
        let namespace = format!("__ns:=/old_bags_{}", std::process::id());
        let directory = format!("directory:={}", directory.display());
        let child = Command::new(env!("CARGO_BIN_EXE_run_recorder"))
            .args(["--ros-args", "-r", &namespace, "-p", &directory, "-p", parameter])
            .stderr(File::create(&log).unwrap())
            .spawn();
        Self(child.expect("the recorder starts"), log)
    }

    fn log(&self) -> String {
        fs::read_to_string(&self.1).unwrap()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A finished bag of the year 2001.
fn old_bag(directory: &Path, name: &str) {
    let mut options = RunBagOptions::new(directory, name);
    options.run.insert("run_id".into(), name.into());
    assert!(RunBag::create(options).unwrap().finish(LONG).complete);
    let file = directory.join(name).join(format!("{name}_0.mcap"));
    let then = UNIX_EPOCH + Duration::from_secs(1_000_000_000);
    File::options().append(true).open(file).unwrap().set_modified(then).unwrap();
}

#[test]
fn old_bags_are_removed_at_the_start_and_the_log_has_their_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let bags = folder.path().join("bags");
    // The newest of those that are not marked stays.
    for name in ["run_a", "run_b", "run_c", "run_marked"] {
        old_bag(&bags, name);
    }
    mark(&bags.join("run_marked"), "").unwrap();
    fs::write(bags.join("notes.txt"), "").unwrap();
    let recorder = Recorder::start(folder.path(), "keep_days:=30");
    for name in ["run_a", "run_b"] {
        let said = |line: &&str| line.contains("removed") && line.contains(name);
        let begin = Instant::now();
        let line = loop {
            let log = recorder.log();
            if let Some(line) = log.lines().find(said) {
                break line.to_owned();
            }
            assert!(begin.elapsed() < LONG, "nothing of {name} in {log}");
            sleep(Duration::from_millis(20));
        };
        assert!(line.contains("(0.0 MB)") && line.contains("days old"), "{line}");
        assert!(!bags.join(name).exists());
    }
    assert!(bags.join("run_c").exists() && bags.join("run_marked").exists());
    assert!(bags.join("notes.txt").exists());
}

#[test]
fn limits_that_mean_nothing_are_refused_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    for wrong in ["keep_days:=-1", "keep_gb:=-5", "split_size_mb:=-1", "split_duration_s:=1.5"] {
        let mut recorder = Recorder::start(folder.path(), wrong);
        let status = recorder.0.wait().expect("it ends");
        assert_eq!(status.code(), Some(2), "{wrong}");
        let name = wrong.split(':').next().expect("a name");
        assert!(recorder.log().contains(name), "{wrong}: {}", recorder.log());
    }
}
