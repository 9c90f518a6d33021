//! Opens the session of a node, and makes sure that it has a router.

use crate::command_line::environment::Environment;
use crate::command_line::names::Names;
use crate::command_line::zenoh_settings::RouterCheck;
use crate::zenoh::discovery::{Change, Discovery};
use crate::zenoh::error::ZenohError;
use crate::zenoh::names::{Kind, Token};
use crate::zenoh::node::Node;
use crate::zenoh::settings::{connects_to, of_session, text};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use zenoh::{Config, Session, Wait};

/// How long a router may take that is there.
const BRIEF: Duration = Duration::from_millis(1500);
/// Between two looks for it.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// How often a node that waits without end says so.
const SAY_AGAIN: Duration = Duration::from_secs(10);
/// How long an address is tried to find out why there is no router.
const PROBE: Duration = Duration::from_millis(200);

const WHAT: &str = "a session of Zenoh";

/// Opens a session, waits for a router and announces the node.
pub(crate) fn open(
    names: &Names,
    environment: &Environment,
    on_change: impl Fn(Change) + Send + Sync + 'static,
) -> Result<Node, ZenohError> {
    let config = of_session(&environment.zenoh)?;
    let check = environment.zenoh.router_check;
    // A thread without an executor: Zenoh does not wait on one that has a single thread.
    let opened = std::thread::scope(|scope| scope.spawn(|| open_checked(config, check)).join());
    let session =
        opened.unwrap_or_else(|_| Err(ZenohError::new(WHAT, &"Zenoh panicked; see above")))?;
    let discovery = Discovery::start(&session, environment.domain_id, Box::new(on_change))?;
    let token = Token {
        domain_id: environment.domain_id,
        zid: session.zid().to_string(),
        node_id: 0,
        id: 0,
        kind: Kind::Node,
        enclave: match environment.zenoh.enclave.as_str() {
            "" => "/".to_owned(),
            enclave => enclave.to_owned(),
        },
        namespace: match names.namespace() {
            "" => "/".to_owned(),
            namespace => namespace.to_owned(),
        },
        node: names.node().to_owned(),
        topic: None,
    };
    Node::new(session, discovery, token)
}

fn open_checked(config: Config, check: RouterCheck) -> Result<Session, ZenohError> {
    let started = Instant::now();
    let mode = text(&config, "mode").unwrap_or_else(|| "peer".to_owned());
    let endpoints = connects_to(&config, &mode);
    let deadline = match check {
        RouterCheck::Skip => Some(Duration::ZERO),
        RouterCheck::Brief => Some(BRIEF),
        RouterCheck::Attempts(count) => Some(Duration::from_secs(count.into())),
        RouterCheck::Endless => None,
    };
    let is_late = || deadline.is_some_and(|deadline| started.elapsed() >= deadline);
    let mut said: Option<Instant> = None;
    let mut say_that_it_waits = || {
        if deadline.is_none()
            && started.elapsed() >= BRIEF
            && said.is_none_or(|said| said.elapsed() >= SAY_AGAIN)
        {
            said = Some(Instant::now());
            tracing::warn!("{}; waiting for one", no_router(&endpoints));
        }
    };
    // A client has no session before its router is there.
    let session = loop {
        let error = match zenoh::open(config.clone()).wait() {
            Ok(session) => break session,
            Err(error) => error,
        };
        if mode != "client" || is_late() || endpoints.iter().any(|it| is_taken(it)) {
            let reason = match endpoints.is_empty() || mode == "router" {
                true => error.to_string(),
                false => format!("{}; {error}", no_router(&endpoints)),
            };
            return Err(ZenohError::new(WHAT, &reason));
        }
        say_that_it_waits();
        std::thread::sleep(LOOK_AGAIN);
    };
    if mode == "router" || check == RouterCheck::Skip {
        return Ok(session);
    }
    while session.info().routers_zid().wait().next().is_none() {
        if is_late() {
            drop(session.close().wait());
            return Err(ZenohError::new(WHAT, &no_router(&endpoints)));
        }
        say_that_it_waits();
        std::thread::sleep(LOOK_AGAIN);
    }
    Ok(session)
}

/// Whether something listens at an address, so that waiting does not help.
fn is_taken(endpoint: &str) -> bool {
    reach(endpoint).is_ok()
}

/// That there is no router, what is at its place instead, and how to start one.
fn no_router(endpoints: &[String]) -> String {
    let tried: Vec<String> =
        endpoints.iter().map(|endpoint| format!("{endpoint} ({})", probe(endpoint))).collect();
    no_router_of(&tried)
}

fn no_router_of(tried: &[String]) -> String {
    let place = match tried {
        [] => {
            "no Zenoh router: the configuration has no address of one in connect/endpoints".into()
        }
        tried => format!("no Zenoh router at {}", tried.join(", ")),
    };
    format!(
        "{place}; start one with `kerf router` or `ros2 run rmw_zenoh_cpp rmw_zenohd`, or name \
         another in ZENOH_SESSION_CONFIG_URI; with ZENOH_ROUTER_CHECK_ATTEMPTS=0 the node waits for \
         one, with -1 it starts without one"
    )
}

/// What is at an address.
fn probe(endpoint: &str) -> String {
    match reach(endpoint) {
        Ok("tls") => {
            "something listens there, but the two did not accept each other's certificates".into()
        }
        Ok(_) => "something listens there, but is no router of Zenoh".to_owned(),
        Err(failure) => failure,
    }
}

/// Connects to an address; returns its protocol.
fn reach(endpoint: &str) -> Result<&str, String> {
    let Some((protocol, address)) = endpoint.split_once('/') else {
        return Err("it is no address: PROTOCOL/HOST:PORT is needed".to_owned());
    };
    if !matches!(protocol, "tcp" | "tls") {
        return Err(format!("{protocol} is not built in: tcp and tls are"));
    }
    let address = address.split(['?', '#']).next().unwrap_or_default();
    let mut failure = "the name has no address".to_owned();
    for address in address.to_socket_addrs().map_err(|error| error.to_string())? {
        match TcpStream::connect_timeout(&address, PROBE) {
            Ok(_) => return Ok(protocol),
            Err(error) => failure = error.to_string(),
        }
    }
    Err(failure)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn what_is_at_the_place_of_a_router_is_named() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("bound").port();
        let of = |protocol: &str| probe(&format!("{protocol}/127.0.0.1:{port}#iface=lo"));
        assert!(of("tcp").contains("no router"));
        assert!(of("tls").contains("certificates"));
        assert!(of("quic").contains("not built in"));
        drop(listener);
        assert!(of("tcp").contains("refused"), "{}", of("tcp"));
        assert!(probe("7447").contains("PROTOCOL/HOST:PORT"));
    }

    #[test]
    fn a_missing_router_comes_with_what_to_do() {
        for text in [no_router_of(&[]), no_router_of(&["tcp/a:1 (refused)".to_owned()])] {
            for part in ["kerf router", "rmw_zenohd", "ZENOH_SESSION_CONFIG_URI", "=0", "-1"] {
                assert!(text.contains(part), "{text}");
            }
        }
        assert!(
            no_router_of(&["tcp/a:1 (refused)".to_owned()])
                .starts_with("no Zenoh router at tcp/a:1 (refused); start one with")
        );
    }
}
