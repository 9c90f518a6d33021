//! The configuration of sessions and routers.
//!
//! Without a file of the user's, that of rmw_zenoh_cpp: a node is a peer, listens on the loopback
//! interface, and learns of the others by a router on this computer. Nothing is sent by multicast.

use crate::command_line::zenoh_settings::ZenohSettings;
use crate::zenoh::error::ZenohError;
use std::fs::File;
use std::path::Path;
use zenoh::Config;

/// Where a router is, unless a file says otherwise.
const ROUTER: &str = r#"["tcp/localhost:7447"]"#;

/// What rmw_zenoh_cpp sets for the session of a node.
const SESSION: [(&str, &str); 8] = [
    ("mode", r#""peer""#),
    ("connect/endpoints", ROUTER),
    ("listen/endpoints", r#"["tcp/localhost:0"]"#),
    ("scouting/multicast/enabled", "false"),
    // All learn of each other by the router; of two peers, one connects to the other.
    ("scouting/gossip/target", r#"{ router: ["router", "peer"], peer: ["router"] }"#),
    (
        "scouting/gossip/autoconnect_strategy",
        r#"{ peer: { to_router: "always", to_peer: "greater-zid" } }"#,
    ),
    ("queries_default_timeout", "60000"),
    ("transport/link/rx/max_message_size", "33554432"),
];

/// The same of a router; without a file it is reached from this computer alone.
const ROUTER_OF_ITS_OWN: [(&str, &str); 4] = [
    ("mode", r#""router""#),
    ("listen/endpoints", ROUTER),
    ("scouting/multicast/enabled", "false"),
    ("transport/link/rx/max_message_size", "33554432"),
];

/// Files that a configuration may name.
const CERTIFICATES: [&str; 5] = [
    "root_ca_certificate",
    "listen_private_key",
    "listen_certificate",
    "connect_private_key",
    "connect_certificate",
];

/// The configuration of the session of a node.
pub(crate) fn of_session(settings: &ZenohSettings) -> Result<Config, ZenohError> {
    let mut config =
        from_file(settings.session_config.as_deref(), "ZENOH_SESSION_CONFIG_URI", &SESSION)?;
    override_with(&mut config, &settings.overrides)?;
    // What is latched is kept by its time.
    set(&mut config, "timestamping/enabled", "{ router: true, peer: true, client: true }")
        .map_err(|reason| ZenohError::new("a session of Zenoh", &reason))?;
    certificates_are_there(&config)?;
    if settings.must_be_protected {
        let protected = set(&mut config, "transport/link/protocols", r#"["tls"]"#);
        protected.and_then(|()| is_protected(&config)).map_err(|reason| {
            let reason = format!(
                "ROS_SECURITY_STRATEGY=Enforce: {reason}; the files of make_keystore.py have it, unless \
                 ZENOH_CONFIG_OVERRIDE changes it"
            );
            ZenohError::new("a session of Zenoh", &reason)
        })?;
    }
    Ok(config)
}

/// Whether a session talks to those alone that have a certificate, or what it lacks.
fn is_protected(config: &Config) -> Result<(), String> {
    const TLS: &str = "transport/link/tls";
    let mode = text(config, "mode").unwrap_or_else(|| "peer".to_owned());
    let open = |key| endpoints(config, key, &mode).into_iter().find(|it| !it.starts_with("tls/"));
    for key in ["connect/endpoints", "listen/endpoints"] {
        // A client listens nowhere.
        if let Some(endpoint) = open(key).filter(|_| key == "connect/endpoints" || mode != "client")
        {
            return Err(format!("{key} has {endpoint}, which is not tls/HOST:PORT"));
        }
    }
    if text(config, &format!("{TLS}/root_ca_certificate")).is_none() {
        return Err(format!("{TLS}/root_ca_certificate is not set"));
    }
    let asks_for_certificates =
        config.get_json(&format!("{TLS}/enable_mtls")).is_ok_and(|json| json.trim() == "true");
    if mode != "client" && !asks_for_certificates {
        return Err(format!("{TLS}/enable_mtls is not true, and a {mode} lets others connect"));
    }
    Ok(())
}

/// The configuration of a router.
pub(crate) fn of_router(
    file: Option<&Path>,
    overrides: &[(String, String)],
) -> Result<Config, ZenohError> {
    let mut config = from_file(file, "ZENOH_ROUTER_CONFIG_URI", &ROUTER_OF_ITS_OWN)?;
    override_with(&mut config, overrides)?;
    certificates_are_there(&config)?;
    Ok(config)
}

fn from_file(
    file: Option<&Path>,
    variable: &str,
    defaults: &[(&str, &str)],
) -> Result<Config, ZenohError> {
    let Some(file) = file else {
        let mut config = Config::default();
        for (key, value) in defaults {
            set(&mut config, key, value)
                .map_err(|reason| ZenohError::new("a session of Zenoh", &reason))?;
        }
        return Ok(config);
    };
    let failed = |reason: &dyn std::fmt::Display| {
        let what = "a session of Zenoh";
        ZenohError::new(what, &format_args!("{variable}=\"{}\": {reason}", file.display()))
    };
    // Zenoh names the file and not what is wrong with it.
    File::open(file).map_err(|error| failed(&error))?;
    Config::from_file(file).map_err(|error| failed(&error))
}

fn override_with(config: &mut Config, overrides: &[(String, String)]) -> Result<(), ZenohError> {
    for (key, value) in overrides {
        set(config, key, value).map_err(|reason| {
            let reason = format!("ZENOH_CONFIG_OVERRIDE: {reason}");
            ZenohError::new("a session of Zenoh", &reason)
        })?;
    }
    Ok(())
}

fn set(config: &mut Config, key: &str, value: &str) -> Result<(), String> {
    config.insert_json5(key, value).map_err(|error| format!("{key}={value}: {error}"))
}

fn certificates_are_there(config: &Config) -> Result<(), ZenohError> {
    for name in CERTIFICATES {
        let Some(file) = text(config, &format!("transport/link/tls/{name}")) else { continue };
        File::open(&file).map_err(|error| {
            let reason = format!("transport/link/tls/{name}=\"{file}\": {error}");
            ZenohError::new("a session of Zenoh", &reason)
        })?;
    }
    Ok(())
}

/// A text in a configuration.
pub(crate) fn text(config: &Config, key: &str) -> Option<String> {
    // JSON is YAML. What is not set is null.
    let value: serde_yaml::Value = serde_yaml::from_str(&config.get_json(key).ok()?).ok()?;
    value.as_str().map(str::to_owned)
}

/// Where a session looks for others: the endpoints of its mode.
pub(crate) fn connects_to(config: &Config, mode: &str) -> Vec<String> {
    endpoints(config, "connect/endpoints", mode)
}

fn endpoints(config: &Config, key: &str, mode: &str) -> Vec<String> {
    let Ok(json) = config.get_json(key) else { return Vec::new() };
    // A list, or a list for each mode.
    match serde_yaml::from_str::<serde_yaml::Value>(&json) {
        Ok(serde_yaml::Value::Sequence(all)) => texts(&all),
        Ok(serde_yaml::Value::Mapping(modes)) => match modes.get(mode) {
            Some(serde_yaml::Value::Sequence(all)) => texts(all),
            _ => Vec::new(),
        },
        _ => Vec::new(),
    }
}

fn texts(values: &[serde_yaml::Value]) -> Vec<String> {
    values.iter().filter_map(|value| value.as_str().map(str::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let mut file = tempfile::Builder::new().suffix(".json5").tempfile().expect("a file");
        file.write_all(text.as_bytes()).expect("writable");
        file
    }

    fn session(file: Option<&Path>) -> Result<Config, ZenohError> {
        let session_config = file.map(Path::to_owned);
        of_session(&ZenohSettings { session_config, ..Default::default() })
    }

    #[test]
    fn a_session_that_must_be_protected_talks_to_those_with_certificates_alone() {
        let certificate = file("");
        let root = certificate.path().display();
        let tls =
            format!(r#"transport: {{ link: {{ tls: {{ root_ca_certificate: "{root}" }} }} }}"#);
        let client = format!(
            r#"{{ mode: "client", connect: {{ endpoints: ["tls/localhost:7447"] }}, {tls} }}"#
        );
        let peer = format!(
            r#"{{ mode: "peer", listen: {{ endpoints: ["tls/localhost:7447"] }}, {tls} }}"#
        );
        let open = [("connect/endpoints".to_owned(), r#"["tcp/localhost:7447"]"#.to_owned())];
        let no_root = client.replace("root_ca_certificate", "connect_certificate");
        for (session, overrides, problem) in [
            (client.as_str(), &[][..], None),
            (&client, &open[..], Some("connect/endpoints has tcp/localhost:7447")),
            ("{}", &[], Some("is not tls/HOST:PORT")),
            (&no_root, &[], Some("root_ca_certificate is not set")),
            (&peer, &[], Some("enable_mtls is not true")),
        ] {
            let written = file(session);
            let settings = ZenohSettings {
                session_config: Some(written.path().to_owned()),
                overrides: overrides.to_vec(),
                must_be_protected: true,
                ..ZenohSettings::default()
            };
            match (of_session(&settings), problem) {
                (Ok(config), None) => {
                    assert_eq!(endpoints(&config, "connect/endpoints", "client").len(), 1);
                }
                (Err(error), Some(problem)) => {
                    let text = error.to_string();
                    assert!(text.contains(problem) && text.contains("Enforce"), "{text}");
                }
                (got, problem) => panic!("{session}: {got:?} and not {problem:?}"),
            }
        }
    }

    #[test]
    fn without_a_file_a_node_is_reached_from_this_computer_alone() {
        let config = session(None).expect("valid");
        assert_eq!(text(&config, "mode").as_deref(), Some("peer"));
        assert_eq!(connects_to(&config, "peer"), ["tcp/localhost:7447"]);
        assert_eq!(config.get_json("scouting/multicast/enabled").expect("set"), "false");
        assert!(config.get_json("listen/endpoints").expect("set").contains("localhost:0"));
        let router = of_router(None, &[]).expect("valid");
        assert_eq!(text(&router, "mode").as_deref(), Some("router"));
        assert!(router.get_json("listen/endpoints").expect("set").contains("localhost:7447"));
    }

    #[test]
    fn a_file_and_single_settings_count() {
        let of_the_cell = file("{mode: 'client', connect: {endpoints: ['tcp/10.0.0.2:7447']}}");
        let config = session(Some(of_the_cell.path())).expect("valid");
        assert_eq!(text(&config, "mode").as_deref(), Some("client"));
        assert_eq!(connects_to(&config, "client"), ["tcp/10.0.0.2:7447"]);
        let overrides = vec![("connect/endpoints".to_owned(), "[\"tcp/b:2\"]".to_owned())];
        let settings = ZenohSettings {
            session_config: Some(of_the_cell.path().to_owned()),
            overrides,
            ..Default::default()
        };
        let config = of_session(&settings).expect("valid");
        assert_eq!(connects_to(&config, "client"), ["tcp/b:2"]);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let missing = session(Some(Path::new("/no/such.json5"))).expect_err("missing").to_string();
        assert!(missing.contains("ZENOH_SESSION_CONFIG_URI=\"/no/such.json5\""), "{missing}");
        for text in ["{mode: 'boss'}", "{mode", "{listen: 5}"] {
            let file = file(text);
            let error = session(Some(file.path())).expect_err(text).to_string();
            assert!(error.contains("ZENOH_SESSION_CONFIG_URI"), "{error}");
        }
        let tls = file("{transport: {link: {tls: {connect_certificate: '/no/cert.pem'}}}}");
        let error = session(Some(tls.path())).expect_err("no certificate").to_string();
        assert!(error.contains("connect_certificate=\"/no/cert.pem\""), "{error}");
        let overrides = vec![("mode".to_owned(), "7".to_owned())];
        let settings = ZenohSettings { overrides, ..Default::default() };
        let error = of_session(&settings).expect_err("no mode").to_string();
        assert!(error.contains("ZENOH_CONFIG_OVERRIDE: mode=7"), "{error}");
    }
}
