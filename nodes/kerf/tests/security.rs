//! The whole stack with the keys and the policy of `config/security`: the policy allows what
//! a run needs, and a peer without the key can neither read the state nor start a program.
#![cfg(feature = "security")]
#![allow(dead_code, reason = "the machine of other tests")]

#[path = "support/machine.rs"]
mod machine;
mod support;

use machine::{Machine, SLOW_POLLING, domain, until};
use std::path::Path;
use std::process::Command;
use support::{Ran, kerf, run};

const PROGRAM: &str = "G21 G17 G90 G94\n#31=[#31+1]\nG0 X0 Y0\nG1 X5 F600\nG1 X0 Y5\nM30\n";

struct Keys<'a> {
    keystore: &'a Path,
    enclave: &'a str,
}

impl Keys<'_> {
    fn give(&self, command: &mut Command) {
        command
            .env("ROS_SECURITY_ENABLE", "true")
            .env("ROS_SECURITY_STRATEGY", "Enforce")
            .env("ROS_SECURITY_KEYSTORE", self.keystore)
            .args(["--ros-args", "--enclave", self.enclave]);
    }
}

/// Runs `kerf` next to a machine, with or without keys. Keys are of ROS: the local socket has the
/// rights of its file, and is not reachable here.
fn run_kerf(machine: &Machine, domain: &str, keys: Option<Keys<'_>>, args: &[&str]) -> Ran {
    let mut command = kerf();
    let folder = machine.folder.path();
    command.env("ROS_DOMAIN_ID", domain).env("KERF_RUNTIME_DIR", folder.join("no_sockets"));
    command.current_dir(folder).args(args).args([
        "--ros-args",
        "-r",
        &format!("__ns:={}", machine.namespace),
        "--",
    ]);
    if let Some(keys) = keys {
        keys.give(&mut command);
    }
    run(&mut command)
}

#[test]
fn with_keys_a_program_runs_and_without_nothing_is_seen_of_it() {
    let domain = domain();
    let keystore = tempfile::tempdir().expect("a folder");
    let namespace = format!("/locked_{}_{domain}", std::process::id());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/security/make_keystore.py");
    let mut make = Command::new("python3");
    let made = make.arg(script).arg(keystore.path()).args(["--namespace", &namespace]).output();
    assert!(made.expect("python3").status.success());
    let keys = |enclave| Some(Keys { keystore: keystore.path(), enclave });

    let machine = Machine::start_as(
        &domain,
        "locked",
        &["--virtual-controller", "--time-factor", "10"],
        &SLOW_POLLING,
        None,
        |mut command, folder| {
            std::fs::write(folder.join("mill.var"), "31 7\n").expect("written");
            Keys { keystore: keystore.path(), enclave: "/kerf" }.give(&mut command);
            command.args(["-p", "program_loader:parameter_file:=mill.var"]);
            command
        },
    );
    assert_eq!(machine.namespace, namespace, "the keys are for it");
    let program = machine.folder.file("part.ngc", PROGRAM);
    let program = program.to_str().expect("a path of ours is UTF-8");
    until("IDLE", || {
        let ran = run_kerf(&machine, &domain, keys("/kerf/commander"), &["status"]);
        ran.out.starts_with("IDLE").then_some(())
    });

    // Exit status 3: no node answers.
    run_kerf(&machine, &domain, None, &["status"]).expect(3);
    run_kerf(&machine, &domain, None, &["load", program]).expect(3);

    run_kerf(&machine, &domain, keys("/kerf/commander"), &["load", program]).expect(0);
    assert_ne!(run_kerf(&machine, &domain, keys("/kerf/viewer"), &["run"]).status, 0);
    assert_ne!(run_kerf(&machine, &domain, None, &["run"]).status, 0);
    assert!(machine.bags().is_empty(), "a run has begun: {}", machine.log());

    run_kerf(&machine, &domain, keys("/kerf/commander"), &["run"]).expect(0);
    // The policy lets the loader hear of the run.
    let parameters = machine.folder.path().join("mill.var");
    until("the count in the file", || {
        (std::fs::read_to_string(&parameters).ok()? == "31\t8.0\n").then_some(())
    });
    let bag = machine.until_bags(1).remove(0);
    let bag = bag.to_str().expect("UTF-8");
    run(kerf().args(["replay", bag])).expect(0);
    // What the policy forgets, the DDS layer refuses.
    let log = machine.log();
    assert!(!log.to_lowercase().contains("not allowed"), "{log}");
}
