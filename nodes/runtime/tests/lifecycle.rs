//! A managed node as a process of its own, controlled through its services.
//!
//! The node is this test program, started again with a variable set.

mod common;

use cnc_msgs::wire::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
use cnc_msgs::wire::lifecycle_msgs::msg::{Transition, TransitionEvent};
use cnc_msgs::wire::lifecycle_msgs::srv;
use cnc_msgs::wire::rcl_interfaces::msg::{Log, LoggerLevel};
use cnc_msgs::wire::rcl_interfaces::srv::{
    GetLoggerLevels, GetLoggerLevelsRequest, SetLoggerLevels, SetLoggerLevelsRequest,
};
use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest, TriggerResponse};
use common::{PATIENCE, domain, namespace, soon, start_with};
use runtime::parameters::Declared;
use runtime::{
    Client, Handle, Health, Managed, Qos, ServiceMapping, Session, TransitionResult, Trouble,
};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const IS_NODE: &str = "RUNTIME_TEST_MANAGED_NODE";

/// Logs its steps; one of them fails.
struct Worker {
    failing: String,
    broken: String,
}

impl Worker {
    fn step(&self, name: &str) -> TransitionResult {
        tracing::info!("step {name}");
        match name {
            _ if self.failing == name => Err(Trouble::failure("there is no wood")),
            _ if self.broken == name => Err(Trouble::Error("the saw broke".into())),
            _ => Ok(()),
        }
    }
}

impl Managed for Worker {
    async fn configure(&self) -> TransitionResult {
        self.step("configure")
    }

    async fn activate(&self) -> TransitionResult {
        self.step("activate")
    }

    async fn deactivate(&self) -> TransitionResult {
        // A request for the state meanwhile sees the transitional state.
        tokio::time::sleep(Duration::from_millis(600)).await;
        self.step("deactivate")
    }

    async fn cleanup(&self) -> TransitionResult {
        self.step("cleanup")
    }

    async fn shutdown(&self) -> TransitionResult {
        self.step("shutdown")
    }

    fn health(&self) -> Vec<Health> {
        vec![Health { component: "saw".into(), ..Health::default() }]
    }
}

async fn make(node: Handle) -> Result<Worker, runtime::Error> {
    let handle = node.clone();
    node.service::<Trigger, _, _>("work", move |_, _| {
        tracing::debug!("somebody wants work");
        let may = handle.require_active();
        let message = may.as_ref().err().cloned().unwrap_or_default();
        std::future::ready(TriggerResponse { success: may.is_ok(), message })
    })?;
    Ok(Worker { failing: node.parameter("failing"), broken: node.parameter("broken") })
}

#[test]
fn the_node_itself() {
    let Ok(words) = std::env::var(IS_NODE) else { return };
    let declared = vec![
        Declared::new("failing", "", "the step that is not done"),
        Declared::new("broken", "", "the step that is half done"),
    ];
    let words: Vec<String> = words.split_whitespace().map(str::to_owned).collect();
    let status = runtime::run_managed("worker", declared, &words, make);
    std::process::exit(i32::from(status != std::process::ExitCode::SUCCESS));
}

fn launch(words: &str, domain_id: u16, mapping: ServiceMapping) -> Child {
    let rmw = match mapping {
        ServiceMapping::Enhanced => "rmw_fastrtps_cpp",
        ServiceMapping::Cyclone => "rmw_cyclonedds_cpp",
        ServiceMapping::Queries => "rmw_zenoh_cpp",
    };
    Command::new(std::env::current_exe().expect("this program"))
        .args(["--exact", "the_node_itself", "--nocapture"])
        .env(IS_NODE, format!("--ros-args -r __ns:={} {words}", namespace()))
        .env("ROS_DOMAIN_ID", domain_id.to_string())
        .env("RMW_IMPLEMENTATION", rmw)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts")
}

/// Waits for the end, up to a time limit; status and log.
async fn end_of(mut child: Child) -> (Option<i32>, String) {
    let ending = tokio::task::spawn_blocking(move || {
        let start = Instant::now();
        while child.try_wait().expect("a child").is_none() {
            if start.elapsed() > PATIENCE {
                child.kill().expect("killed");
                panic!("the node does not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let Output { status, stderr, .. } = child.wait_with_output().expect("output");
        (status.code(), String::from_utf8_lossy(&stderr).into_owned())
    });
    ending.await.expect("ends")
}

/// The steps in a log.
fn steps(log: &str) -> Vec<&str> {
    log.lines().filter_map(|line| line.split_once("]: step ")).map(|(_, step)| step).collect()
}

/// The clients of a lifecycle manager for a node.
struct Manager {
    session: Session,
    change: Client<srv::ChangeState>,
    get: Client<srv::GetState>,
    states: Client<srv::GetAvailableStates>,
    ways: Client<srv::GetAvailableTransitions>,
    graph: Client<srv::GetAvailableTransitions>,
    work: Client<Trigger>,
    /// The announced transitions to lasting states: their start and goal states.
    events: Arc<Mutex<Vec<(u8, u8)>>>,
}

impl Manager {
    fn start(domain_id: u16, mapping: ServiceMapping) -> Self {
        let session = start_with("manager", domain_id, mapping);
        let node = session.handle();
        let mut changes = node
            .subscription::<TransitionEvent>(
                "worker/transition_event",
                Qos::DEFAULT.with_depth(100),
            )
            .expect("subscription");
        let events = Arc::<Mutex<Vec<(u8, u8)>>>::default();
        let kept = Arc::clone(&events);
        // Taken as they arrive: samples not taken when their sender leaves are lost.
        node.spawn("events", async move {
            loop {
                let (event, _) = changes.next().await;
                assert!(event.timestamp > 0 && !event.transition.label.is_empty(), "{event:?}");
                if event.goal_state.id < 10 {
                    let way = (event.start_state.id, event.goal_state.id);
                    kept.lock().expect("no panic").push(way);
                }
            }
        });
        Self {
            change: node.client("worker/change_state").expect("client"),
            get: node.client("worker/get_state").expect("client"),
            states: node.client("worker/get_available_states").expect("client"),
            ways: node.client("worker/get_available_transitions").expect("client"),
            graph: node.client("worker/get_transition_graph").expect("client"),
            work: node.client("work").expect("client"),
            events,
            session,
        }
    }

    async fn set(&self, id: u8, label: &str) -> bool {
        let transition = Transition { id, label: label.into() };
        let request = srv::ChangeStateRequest { transition };
        self.change.call_within(request, PATIENCE).await.expect("an answer").success
    }

    async fn state(&self) -> (u8, String) {
        let state = self.get.call_within(Default::default(), PATIENCE).await.expect("an answer");
        (state.current_state.id, state.current_state.label)
    }

    /// The number and the label of each transition from here.
    async fn ways(&self) -> Vec<(u8, String)> {
        let answer = self.ways.call_within(Default::default(), PATIENCE).await.expect("an answer");
        let ways = answer.available_transitions.into_iter().map(|way| way.transition);
        ways.map(|way| (way.id, way.label)).collect()
    }

    fn received(&self) -> Vec<(u8, u8)> {
        self.events.lock().expect("no panic").clone()
    }

    /// Configures and cleans up until a change is received: changes before the topic is
    /// matched are lost.
    async fn rounds_until_events_arrive(&self) -> usize {
        for round in 1.. {
            assert!(self.set(0, "configure").await && self.set(0, "cleanup").await);
            tokio::time::sleep(Duration::from_millis(500)).await;
            if self.received().last() == Some(&(11, 1)) {
                return round;
            }
        }
        unreachable!("the rounds do not end")
    }

    async fn works(&self) -> Result<(), String> {
        let request = TriggerRequest::default();
        let answer = self.work.call_within(request, PATIENCE).await.expect("an answer");
        if answer.success { Ok(()) } else { Err(answer.message) }
    }

    async fn stop(self) {
        let Self { session, .. } = self;
        session.stop().await;
    }
}

fn named(rows: &[(u8, &str)]) -> Vec<(u8, String)> {
    rows.iter().map(|(id, label)| (*id, (*label).to_owned())).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn others_configure_activate_and_shut_down_over_either_mapping() {
    for (offset, mapping) in [(70, ServiceMapping::Enhanced), (71, ServiceMapping::Cyclone)] {
        let manager = Manager::start(domain(offset), mapping);
        let child = launch("-p autostart:=false", domain(offset), mapping);
        assert_eq!(manager.state().await, (1, "unconfigured".into()));
        let states = manager.states.call_within(Default::default(), PATIENCE).await.expect("all");
        assert_eq!(states.available_states.len(), 11);
        let graph = manager.graph.call_within(Default::default(), PATIENCE).await.expect("all");
        assert_eq!(graph.available_transitions.len(), 25);
        assert_eq!(manager.ways().await, named(&[(1, "configure"), (5, "shutdown")]));

        assert!(!manager.set(3, "").await, "there is no way from here");
        assert!(!manager.set(1, "activate").await, "the label wins");
        assert_eq!(manager.state().await.0, 1);
        let why = manager.works().await.expect_err("unconfigured");
        assert!(why.starts_with("worker is unconfigured, not active: "), "{why}");

        let rounds = manager.rounds_until_events_arrive().await;
        assert!(manager.set(0, "configure").await);
        assert_eq!(manager.state().await, (2, "inactive".into()));
        let ways = [(2, "cleanup"), (3, "activate"), (6, "shutdown")];
        assert_eq!(manager.ways().await, named(&ways));
        assert!(manager.works().await.is_err());
        assert!(manager.set(3, "").await);
        assert_eq!(manager.state().await, (3, "active".into()));
        manager.works().await.expect("active");

        let (changed, meanwhile) = tokio::join!(manager.set(4, ""), async {
            tokio::time::sleep(Duration::from_millis(200)).await;
            let why = manager.works().await;
            (manager.state().await.0, why)
        });
        assert!(changed);
        // On a busy host it may be over already.
        assert!([14, 2].contains(&meanwhile.0), "{meanwhile:?}");
        assert!(meanwhile.1.is_err(), "what is being deactivated takes up nothing");
        assert!(manager.set(2, "").await);
        assert!(manager.set(0, "shutdown").await);
        let (status, log) = end_of(child).await;
        assert_eq!(status, Some(0), "{log}");
        let done = ["configure", "activate", "deactivate", "cleanup", "shutdown"];
        assert_eq!(steps(&log)[2 * rounds..], done, "{log}");
        assert!(log.contains("there is no transition 3 from unconfigured"), "{log}");

        let way = [(10, 2), (13, 3), (14, 2), (11, 1), (12, 4)];
        soon("all events", async {
            while manager.received().last() != Some(&(12, 4)) {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        })
        .await;
        assert!(manager.received().ends_with(&way), "{:?}", manager.received());
        manager.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_node_makes_itself_active_and_a_signal_finalizes_it() {
    let mapping = ServiceMapping::Enhanced;
    let manager = Manager::start(domain(72), mapping);
    let mut health = manager
        .session
        .handle()
        .subscription::<DiagnosticArray>("/diagnostics", Qos::DEFAULT)
        .expect("subscription");
    let child = launch("", domain(72), mapping);
    soon("an active node", async {
        while manager.works().await.is_err() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    })
    .await;
    let name = format!("{}/worker: lifecycle", &namespace()[1..]);
    let parts = soon("its health", async {
        loop {
            let (array, _) = health.next().await;
            let is_active =
                |status: &DiagnosticStatus| status.name == name && status.message == "active";
            if array.status.iter().any(is_active) {
                return array.status;
            }
        }
    })
    .await;
    assert_eq!(parts.iter().map(|part| part.level).collect::<Vec<_>>(), [DiagnosticStatus::OK; 2]);
    assert!(parts[0].name.ends_with("/worker: saw"), "{parts:?}");
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().expect("kill").success());
    let (status, log) = end_of(child).await;
    assert_eq!(status, Some(0), "{log}");
    assert_eq!(steps(&log), ["configure", "activate", "shutdown"], "{log}");
    drop(health);
    manager.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_step_that_fails_leaves_the_state_and_one_that_breaks_ends_the_node() {
    let mapping = ServiceMapping::Enhanced;
    // With autostart a node cannot continue without the step.
    for step in ["configure", "activate"] {
        let child = launch(&format!("-p failing:={step}"), domain(73), mapping);
        let (status, log) = end_of(child).await;
        assert_eq!(status, Some(1), "{log}");
        assert!(log.contains(&format!("{step}: there is no wood")), "{log}");
        assert_eq!(steps(&log).last(), Some(&"shutdown"), "{log}");
    }
    // Others may try again.
    let manager = Manager::start(domain(74), mapping);
    let words = "-p autostart:=false -p failing:=activate -p broken:=cleanup";
    let child = launch(words, domain(74), mapping);
    assert!(manager.set(0, "configure").await);
    assert!(!manager.set(0, "activate").await);
    assert!(!manager.set(0, "activate").await);
    assert_eq!(manager.state().await, (2, "inactive".into()));
    assert!(!manager.set(0, "cleanup").await);
    let (status, log) = end_of(child).await;
    assert_eq!(status, Some(1), "{log}");
    assert!(log.contains("cleanup failed: the saw broke"), "{log}");
    assert_eq!(steps(&log), ["configure", "activate", "activate", "cleanup"], "{log}");
    manager.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_level_of_the_log_changes_while_the_node_runs() {
    for (offset, mapping) in [(75, ServiceMapping::Enhanced), (76, ServiceMapping::Cyclone)] {
        let manager = Manager::start(domain(offset), mapping);
        let node = manager.session.handle();
        let get = node.client::<GetLoggerLevels>("worker/get_logger_levels").expect("client");
        let set = node.client::<SetLoggerLevels>("worker/set_logger_levels").expect("client");
        let mut log = node.subscription::<Log>("/rosout", Qos::ROSOUT).expect("rosout");
        let child = launch("--log-level worker:=warn", domain(offset), mapping);
        let logger = format!("{}.worker", &namespace()[1..]);
        let names = vec![logger.clone(), "somebody.else".into(), String::new()];
        let request = GetLoggerLevelsRequest { names };
        let levels = get.call_within(request, PATIENCE).await.expect("an answer").levels;
        assert_eq!(levels.iter().map(|one| one.level).collect::<Vec<_>>(), [30, 0, 20]);
        // At this level it is not logged.
        let _ = manager.works().await;
        let level = |level| LoggerLevel { name: logger.clone(), level };
        let request = SetLoggerLevelsRequest { levels: vec![level(7), level(10)] };
        let results = set.call_within(request, PATIENCE).await.expect("an answer").results;
        assert!(!results[0].successful && results[0].reason.contains("7 is not a level"));
        assert!(results[1].successful, "{results:?}");
        let _ = manager.works().await;
        let line = soon("a line", async {
            loop {
                let (line, _) = log.next().await;
                if line.msg.contains("somebody wants work") {
                    return line;
                }
            }
        })
        .await;
        assert_eq!(line.level, Log::DEBUG);
        assert!(manager.set(0, "shutdown").await || manager.set(0, "shutdown").await);
        let (_, text) = end_of(child).await;
        assert_eq!(text.matches("somebody wants work").count(), 1, "{text}");
        drop((get, set, log));
        manager.stop().await;
    }
}
