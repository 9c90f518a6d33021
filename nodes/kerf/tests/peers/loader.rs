//! A loader that is lost while `kerf load` waits: the command ends soon and says so.

use super::machine::{domain, kill_at_once, until};
use super::stranger::Stranger;
use super::support::{Folder, Ran, kerf, run};
use cnc_msgs::wire::cnc_msgs::srv::{
    GetProgramChunks, GetProgramChunksResponse, LoadProgram, LoadProgramResponse,
};
use rustix::process::Pid;
use std::process::{Child, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A loss is noticed within this time; it was 120 s.
const SOON: Duration = Duration::from_secs(25);

/// A program, and a domain without a planner.
struct Cell {
    folder: Folder,
    domain: String,
    namespace: String,
}

impl Cell {
    fn new() -> Self {
        let (folder, domain) = (Folder::new(), domain());
        let namespace = format!("/loader_{}_{domain}", std::process::id());
        folder.file("part.ngc", "G21 G90 G94\nG1 X5 F2000\nM30\n");
        Self { folder, domain, namespace }
    }

    fn loader(&self) -> Loader {
        let log = std::fs::File::create(self.log()).expect("a log");
        let mut command = kerf();
        command.env("ROS_DOMAIN_ID", &self.domain).args(["node", "program_loader", "--ros-args"]);
        command.args(["-r", &format!("__ns:={}", self.namespace)]);
        Loader(command.stdout(Stdio::null()).stderr(log).spawn().expect("a loader"))
    }

    fn log(&self) -> std::path::PathBuf {
        self.folder.path().join("loader.log")
    }

    fn load(&self) -> JoinHandle<Ran> {
        let mut command = kerf();
        command.env("ROS_DOMAIN_ID", &self.domain).current_dir(self.folder.path());
        command.args(["load", "part.ngc", "--ros-args"]);
        command.args(["-r", &format!("__ns:={}", self.namespace)]);
        std::thread::spawn(move || run(&mut command))
    }

    fn until_loaded(&self) {
        until("the program is loaded", || {
            let log = std::fs::read_to_string(self.log()).unwrap_or_default();
            log.contains("part.ngc is loaded").then_some(())
        });
        // The loader logs it just before it answers: the command has the answer after this.
        std::thread::sleep(Duration::from_secs(2));
    }
}

/// The loader; gone with this value.
struct Loader(Child);

impl Drop for Loader {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What `kerf load` says, which ends soon.
#[track_caller]
fn end(loading: JoinHandle<Ran>, since: Instant) -> Ran {
    let ran = loading.join().expect("it only runs a command");
    let passed = since.elapsed();
    assert!(passed < SOON, "only after {passed:?}: {}", ran.err);
    ran
}

#[test]
fn a_loader_that_is_gone_ends_a_load_that_waits_for_its_plan() {
    let cell = Cell::new();
    let loader = cell.loader();
    let loading = cell.load();
    cell.until_loaded();
    kill_at_once(Pid::from_child(&loader.0));
    let killed = Instant::now();
    end(loading, killed).expect(3).says(&[
        "part.ngc was not planned: the program loader does not answer",
        "load the program again",
    ]);
}

#[test]
fn a_loader_that_comes_back_without_the_program_ends_a_load() {
    let cell = Cell::new();
    let mut loader = cell.loader();
    let loading = cell.load();
    cell.until_loaded();
    assert_eq!(loader.0.try_wait().expect("our child"), None, "it answers and lives");
    kill_at_once(Pid::from_child(&loader.0));
    let killed = Instant::now();
    let _again = cell.loader();
    end(loading, killed)
        .expect(3)
        .says(&["part.ngc was not planned: the program loader was restarted and no longer has it"]);
}

#[test]
fn a_loader_that_is_restarted_while_it_loads_ends_the_load() {
    let cell = Cell::new();
    let stranger = || {
        let stranger = Stranger::join_as("program_loader", &cell.domain, &cell.namespace);
        stranger.inside(|node| {
            let hangs = |_, _| std::future::pending::<LoadProgramResponse>();
            node.concurrent_service::<LoadProgram, _, _>("load_program", hangs).expect("a service");
            node.service::<GetProgramChunks, _, _>("program/get_chunks", |_, _| {
                std::future::ready(GetProgramChunksResponse::default())
            })
            .expect("a service");
        });
        stranger
    };
    let first = stranger();
    let loading = cell.load();
    // It has asked for the newest plan, found the loader and asked it.
    std::thread::sleep(Duration::from_secs(12));
    let _second = stranger();
    drop(first);
    end(loading, Instant::now())
        .expect(3)
        .says(&["part.ngc was not loaded: the program loader was restarted and no longer has it"]);
}
