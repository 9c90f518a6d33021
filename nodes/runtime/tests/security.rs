//! Who may read and who may command, between nodes with keys of the policy in
//! `config/security` and nodes without.
#![cfg(feature = "security")]

mod common;

use cnc_msgs::wire::std_msgs::msg::String as Text;
use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest, TriggerResponse};
use common::{PATIENCE, domain, soon};
use runtime::configuration::Configuration;
use runtime::{CallError, Qos, Session};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Long enough for what may come to have come: a protected match takes a second.
const NOTHING_WITHIN: Duration = Duration::from_secs(6);

/// A keystore with authorities of its own.
fn keystore() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/security/make_keystore.py");
    let made = Command::new("python3").arg(script).arg(folder.path()).output().expect("python3");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    folder
}

/// A node with the keys of an enclave; without a keystore, with none.
fn start(name: &str, domain_id: u16, keys: Option<(&Path, &str)>) -> Session {
    let mut variables = BTreeMap::from([("ROS_DOMAIN_ID".to_owned(), domain_id.to_string())]);
    let mut words = Vec::new();
    if let Some((keystore, enclave)) = keys {
        for (variable, value) in [
            ("ROS_SECURITY_ENABLE", "true"),
            ("ROS_SECURITY_STRATEGY", "Enforce"),
            ("ROS_SECURITY_KEYSTORE", keystore.to_str().expect("a path of ours is UTF-8")),
        ] {
            variables.insert(variable.to_owned(), value.to_owned());
        }
        words.extend(["--ros-args", "--enclave", enclave].map(str::to_owned));
    }
    let configuration = Configuration::read(name, Vec::new(), &words, &variables);
    Session::start(configuration.expect("a configuration")).expect("a node")
}

/// What a node may do with a driver: whether it reads its state, and how two calls end.
#[derive(Debug, PartialEq, Eq)]
struct Reach {
    reads: bool,
    holds: bool,
    resumes: bool,
}

/// Tries it.
async fn reach(session: &Session) -> Reach {
    let handle = session.handle();
    let reads = async {
        // A node without the right is refused here, or receives nothing.
        let Ok(mut states) = handle.subscription::<Text>("machine_state", Qos::LATCHED) else {
            return false;
        };
        tokio::time::timeout(NOTHING_WITHIN, states.next()).await.is_ok()
    };
    let call = async |name: &str| {
        let Ok(client) = handle.client::<Trigger>(name) else { return false };
        match client.call_within(TriggerRequest::default(), NOTHING_WITHIN).await {
            Ok(answer) => answer.success,
            Err(CallError::NoServer { .. } | CallError::NoAnswer { .. }) => false,
            Err(error) => panic!("{error}"),
        }
    };
    let (reads, holds, resumes) = tokio::join!(reads, call("feed_hold"), call("resume"));
    Reach { reads, holds, resumes }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_commander_commands_a_viewer_reads_and_holds_and_others_do_nothing() {
    let (ours, other) = (keystore(), keystore());
    let domain = domain(40);
    let driver = start("axis_driver", domain, Some((ours.path(), "/kerf/axis_driver")));
    let state = driver.handle().publisher::<Text>("machine_state", Qos::LATCHED).expect("may");
    state.publish(Text { data: "IDLE".into() });
    let resumed = Arc::new(AtomicU32::new(0));
    let count = Arc::clone(&resumed);
    for name in ["feed_hold", "resume"] {
        let count = Arc::clone(&count);
        let answer = move |_: TriggerRequest, _| {
            count.fetch_add(u32::from(name == "resume"), Ordering::Relaxed);
            std::future::ready(TriggerResponse { success: true, message: String::new() })
        };
        driver.handle().service::<Trigger, _, _>(name, answer).expect("may");
    }

    let commander = start("kerf_commander", domain, Some((ours.path(), "/kerf/commander")));
    let all = Reach { reads: true, holds: true, resumes: true };
    assert_eq!(soon("the commander", reach(&commander)).await, all);
    assert_eq!(resumed.load(Ordering::Relaxed), 1);

    let viewer = start("kerf_viewer", domain, Some((ours.path(), "/kerf/viewer")));
    let reading = Reach { reads: true, holds: true, resumes: false };
    assert_eq!(soon("the viewer", reach(&viewer)).await, reading);

    let nothing = Reach { reads: false, holds: false, resumes: false };
    let naked = start("naked", domain, None);
    assert_eq!(soon("whoever has no key", reach(&naked)).await, nothing);
    let foreign = start("kerf_foreign", domain, Some((other.path(), "/kerf/commander")));
    assert_eq!(soon("whoever has another's key", reach(&foreign)).await, nothing);
    assert_eq!(resumed.load(Ordering::Relaxed), 1, "somebody without the right has resumed");

    drop(state);
    for session in [commander, viewer, naked, foreign, driver] {
        tokio::time::timeout(PATIENCE, session.stop()).await.expect("it ends");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_many_endpoints_that_meet_at_once_none_stays_deaf() {
    const MANY: u32 = 120;
    let keys = keystore();
    let domain = domain(41);
    let driver = start("axis_driver", domain, Some((keys.path(), "/kerf/axis_driver")));
    let commander = start("kerf_commander", domain, Some((keys.path(), "/kerf/commander")));
    let serving = driver.handle().clone();
    let served = tokio::task::spawn_blocking(move || {
        for number in 0..MANY {
            let answer = |_: TriggerRequest, _| {
                std::future::ready(TriggerResponse { success: true, message: String::new() })
            };
            serving.service::<Trigger, _, _>(&format!("~/n{number}"), answer).expect("may");
        }
    });
    let client = |number| {
        commander.handle().client::<Trigger>(&format!("axis_driver/n{number}")).expect("may")
    };
    let clients: Vec<_> = (0..MANY).map(client).collect();
    served.await.expect("it only serves");
    for (number, client) in clients.iter().enumerate() {
        let answer = client.call_within(TriggerRequest::default(), PATIENCE);
        assert!(soon("an answer", answer).await.is_ok(), "n{number} gets no answer");
    }
    drop(clients);
    commander.stop().await;
    driver.stop().await;
}
