//! The unit for systemd under a real systemd, which runs in namespaces of its own.

use super::NODES;
use super::machine::until;
use super::support::{Folder, TIMEOUT};
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Says to this program that it runs below the systemd of the test.
const INSIDE: &str = "KERF_TEST_IN_SYSTEMD";
const DOMAIN: u16 = 1;
/// How long all of it may take.
const ALL_WITHIN: Duration = Duration::from_secs(240);

fn systemctl(words: &[&str]) -> String {
    let ran = Command::new("systemctl").args(words).output().expect("systemctl");
    String::from_utf8_lossy(&ran.stdout).trim().to_owned()
}

fn unit(node: &str) -> String {
    format!("kerf-node@{node}.service")
}

/// The process of a node that serves.
fn serving(node: &str) -> Option<Pid> {
    let is_active = systemctl(&["is-active", &unit(node)]) == "active";
    let id = systemctl(&["show", "--property=MainPID", "--value", &unit(node)]);
    id.parse().ok().and_then(Pid::from_raw).filter(|_| is_active)
}

/// Strikes a node; it is restarted, systemd says so, and the machine can be held again.
#[track_caller]
fn check(node: &str, said: &str, strike: impl FnOnce(Pid)) {
    let old = serving(node).expect("it serves");
    let began = Instant::now();
    strike(old);
    until(node, || serving(node).filter(|id| *id != old));
    let journal = Command::new("journalctl").args(["-o", "cat", "-u", &unit(node)]).output();
    let journal = journal.expect("journalctl").stdout;
    let journal = String::from_utf8_lossy(&journal);
    assert!(journal.contains(said), "{node}: {said} is not in\n{journal}");
    eprintln!("{node}: {said}: restarted after {:.2?}", began.elapsed());
    let end = Instant::now() + TIMEOUT;
    loop {
        let mut hold = Command::new("/usr/bin/kerf");
        let ran = hold.arg("hold").env("ROS_DOMAIN_ID", DOMAIN.to_string()).output();
        let ran = ran.expect("kerf");
        if ran.status.success() {
            break;
        }
        if Instant::now() > end {
            let mut journal = Command::new("journalctl");
            let journal = journal.args(["-o", "cat", "-u", &unit("axis_driver")]).output();
            let journal = journal.expect("journalctl");
            panic!("{ran:?}\n{}", String::from_utf8_lossy(&journal.stdout));
        }
    }
}

/// Runs as a service below the systemd of the test.
#[test]
fn inside() {
    if std::env::var_os(INSIDE).is_none() {
        return;
    }
    for node in NODES {
        until(node, || serving(node));
    }
    let to = |signal| move |id| kill_process(id, signal).expect("it is there");
    check("compensation_planner", "status=9/KILL", to(Signal::KILL));
    check("run_recorder", "Watchdog timeout", to(Signal::STOP));
    check("program_loader", "status=6/ABRT", to(Signal::ABORT));
    check("axis_driver", "Watchdog timeout", to(Signal::STOP));
    check("axis_driver", "status=9/KILL", to(Signal::KILL));
    systemctl(&["stop", &unit("axis_driver")]);
    let after =
        systemctl(&["show", "--property=ActiveState,Result", "--value", &unit("axis_driver")]);
    assert!(after.contains("inactive") && after.contains("success"), "{after}");
}

#[test]
fn the_unit_restarts_what_is_stopped_killed_or_aborts_under_a_real_systemd() {
    let is_root = rustix::process::geteuid().is_root();
    let means = ["/lib/systemd/systemd", "/usr/bin/unshare", "/usr/sbin/useradd"];
    // Not every computer lets a test have all that.
    if !is_root || !means.iter().all(|file| Path::new(file).exists()) {
        return;
    }
    let folder = Folder::new();
    let own = std::env::current_exe().expect("this program");
    folder.file("environment", format!("ROS_DOMAIN_ID={DOMAIN}\n"));
    folder.file(
        "kerf.yaml",
        "/**/axis_driver:\n  ros__parameters:\n    port: /run/vc/mill\n    poll_interval_ms: 500\n",
    );
    let units: Vec<String> = NODES.iter().map(|node| unit(node)).collect();
    folder.file(
        "kerf-test.target",
        format!(
            "[Unit]\nDefaultDependencies=no\nRequires=systemd-journald.service vc.service \
             inside.service {}\n",
            units.join(" ")
        ),
    );
    folder.file(
        "vc.service",
        "[Service]\nUser=kerf\nRuntimeDirectory=vc\n\
         ExecStart=/usr/bin/kerf node virtual_controller --link /run/vc/mill\n",
    );
    folder.file(
        "inside.service",
        format!(
            "[Service]\nType=oneshot\nTimeoutStartSec=infinity\nEnvironment={INSIDE}=1\n\
             ExecStart=/usr/bin/kerf-test systemd::inside --exact --nocapture\n\
             StandardOutput=append:/run/test/said\nStandardError=append:/run/test/said\n\
             ExecStopPost=/bin/sh -c 'echo $SERVICE_RESULT > /run/test/result'\n"
        ),
    );
    let here = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/hostile/systemd.sh");
    let unit = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/systemd/kerf-node@.service");
    let log = std::fs::File::create(folder.path().join("boot.log")).expect("a log");
    let mut booted = Command::new("bash")
        .arg(here)
        .args([folder.path(), Path::new(env!("CARGO_BIN_EXE_kerf")), &own, Path::new(unit)])
        .stdin(Stdio::null())
        .stdout(log.try_clone().expect("a second handle"))
        .stderr(log)
        .spawn()
        .expect("bash");
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap_or_default();
    let end = Instant::now() + ALL_WITHIN;
    while read("result").is_empty() && Instant::now() < end {
        if let Ok(Some(status)) = booted.try_wait() {
            panic!("systemd ended ({status}): {}", read("boot.log"));
        }
        std::thread::sleep(Duration::from_millis(200));
    }
    // All in its namespaces goes with it.
    booted.kill().expect("our child");
    booted.wait().expect("our child");
    let groups = format!("*/kerf-test-{}*", booted.id());
    until("control groups without a process", || {
        let mut find = Command::new("find");
        find.args(["/sys/fs/cgroup", "-depth", "-type", "d", "-path", &groups]);
        let ran = find.args(["-exec", "rmdir", "{}", "+"]).stderr(Stdio::null()).status();
        ran.expect("find").success().then_some(())
    });
    eprintln!("{}", read("said"));
    assert_eq!(read("result").trim(), "success", "{}\n{}", read("said"), read("boot.log"));
}
