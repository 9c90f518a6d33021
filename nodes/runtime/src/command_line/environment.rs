//! The ROS network settings in the environment.
//!
//! Pure: reads a map of variables, not the process. Knows the variables of
//! ROS 2 Jazzy and how this stack handles each.

use crate::command_line::security::SecurityRequest;
use crate::command_line::zenoh_settings::ZenohSettings;
use std::collections::BTreeMap;

/// How the identity of a request travels on the wire; all peers must agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ServiceMapping {
    /// In the protocol's own fields, as `rmw_fastrtps_cpp` does.
    Enhanced,
    /// In 16 bytes before the payload, as `rmw_cyclonedds_cpp` does.
    Cyclone,
    /// As a query of Zenoh, as `rmw_zenoh_cpp` does: no DDS at all.
    Queries,
}

/// Whether Zenoh is built in.
pub const HAS_ZENOH: bool = cfg!(feature = "zenoh");

/// The network interfaces that the node uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// This computer alone: our default, because a peer that can reach the node can
    /// move the machine. The kernel drops what comes from elsewhere.
    Localhost,
    /// All interfaces with multicast.
    Subnet,
    /// As localhost, but the node does not look for peers: it is alone.
    Off,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Environment {
    /// The domain, 0 to 232.
    pub domain_id: u16,
    pub range: DiscoveryRange,
    pub mapping: ServiceMapping,
    /// Names or addresses of computers that are looked for without multicast, and that reach the node also where the
    /// range is this computer.
    pub static_peers: Vec<String>,
    /// How a session of Zenoh is opened, where the mapping is that of Zenoh.
    pub zenoh: ZenohSettings,
    /// Who may talk to the node; none: every peer in reach.
    pub security: Option<SecurityRequest>,
    /// What was understood but is not done; for the log.
    pub warnings: Vec<String>,
}

/// A variable with an invalid or unsupported value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{variable}=\"{value}\": {reason}")]
pub struct EnvironmentError {
    pub variable: &'static str,
    pub value: String,
    pub reason: String,
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            domain_id: 0,
            range: DiscoveryRange::Localhost,
            mapping: ServiceMapping::Enhanced,
            static_peers: Vec::new(),
            zenoh: ZenohSettings::default(),
            security: None,
            warnings: Vec::new(),
        }
    }
}

impl Environment {
    /// Reads the variables; an empty value counts as none, as it does in ROS 2.
    ///
    /// # Errors
    /// A value is invalid or not supported.
    pub fn read(variables: &BTreeMap<String, String>) -> Result<Self, EnvironmentError> {
        let get = |name: &str| {
            variables.get(name).map(|value| value.trim()).filter(|value| !value.is_empty())
        };
        let refuse = |variable, value: &str, reason: &str| EnvironmentError {
            variable,
            value: value.to_owned(),
            reason: reason.to_owned(),
        };
        let mut found = Self::default();

        if let Some(value) = get("ROS_DOMAIN_ID") {
            let id = value.parse::<u16>().ok().filter(|id| *id <= 232);
            found.domain_id = id.ok_or_else(|| {
                refuse("ROS_DOMAIN_ID", value, "a whole number from 0 to 232 is needed")
            })?;
            if (102..=214).contains(&found.domain_id) {
                found.warnings.push(format!(
                    "ROS_DOMAIN_ID={value}: the ports of domains 102 to 214 are ephemeral ports \
                     of Linux and may be taken"
                ));
            }
        }

        if let Some(value) = get("ROS_AUTOMATIC_DISCOVERY_RANGE") {
            found.range = match value {
                "LOCALHOST" | "SYSTEM_DEFAULT" => DiscoveryRange::Localhost,
                "SUBNET" => DiscoveryRange::Subnet,
                "OFF" => DiscoveryRange::Off,
                _ => {
                    return Err(refuse(
                        "ROS_AUTOMATIC_DISCOVERY_RANGE",
                        value,
                        "one of LOCALHOST (our default), SUBNET, OFF, SYSTEM_DEFAULT is needed",
                    ));
                }
            };
        }
        // The older variable wins where it is more restrictive, as in ROS 2.
        match get("ROS_LOCALHOST_ONLY") {
            None | Some("0") => {}
            Some("1") => {
                if found.range == DiscoveryRange::Subnet {
                    found.warnings.push(
                        "ROS_LOCALHOST_ONLY=1 overrides ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"
                            .to_owned(),
                    );
                    found.range = DiscoveryRange::Localhost;
                }
            }
            Some(value) => return Err(refuse("ROS_LOCALHOST_ONLY", value, "0 or 1 is needed")),
        }

        if let Some(value) = get("ROS_STATIC_PEERS") {
            let peers = value.split(';').map(str::trim).filter(|peer| !peer.is_empty());
            found.static_peers = peers.map(str::to_owned).collect();
            if found.range == DiscoveryRange::Off {
                found.warnings.push(
                    "ROS_STATIC_PEERS has no effect with ROS_AUTOMATIC_DISCOVERY_RANGE=OFF"
                        .to_owned(),
                );
                found.static_peers.clear();
            }
        }

        match get("RMW_IMPLEMENTATION") {
            None | Some("rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp") => {}
            Some("rmw_cyclonedds_cpp") => found.mapping = ServiceMapping::Cyclone,
            Some("rmw_zenoh_cpp") if HAS_ZENOH => {
                found.mapping = ServiceMapping::Queries;
                found.zenoh = ZenohSettings::read(get)?;
                if !found.static_peers.is_empty() {
                    found.warnings.push(
                        "ROS_STATIC_PEERS has no effect under rmw_zenoh_cpp: name other routers \
                         in ZENOH_ROUTER_CONFIG_URI"
                            .to_owned(),
                    );
                }
                if found.range != DiscoveryRange::Localhost {
                    found.warnings.push(
                        "ROS_AUTOMATIC_DISCOVERY_RANGE has no effect under rmw_zenoh_cpp: who \
                         reaches this node is up to the router and to ZENOH_SESSION_CONFIG_URI"
                            .to_owned(),
                    );
                }
            }
            Some(value @ "rmw_zenoh_cpp") => {
                return Err(refuse(
                    "RMW_IMPLEMENTATION",
                    value,
                    "this build has no Zenoh; build it with `cargo build --release --features \
                     zenoh`, or use rmw_fastrtps_cpp (our default) or rmw_cyclonedds_cpp",
                ));
            }
            Some(value) => {
                return Err(refuse(
                    "RMW_IMPLEMENTATION",
                    value,
                    "services would be misread; rmw_fastrtps_cpp (our default), \
                     rmw_cyclonedds_cpp and, where it is built in, rmw_zenoh_cpp are supported",
                ));
            }
        }

        if get("ROS_SECURITY_ENABLE").is_some_and(|value| value.eq_ignore_ascii_case("true")) {
            if let Some(file) = &found.zenoh.session_config {
                let reason = "with ROS_SECURITY_ENABLE=true the session is that of the enclave: \
                              unset one of the two";
                let file = file.display().to_string();
                return Err(refuse("ZENOH_SESSION_CONFIG_URI", &file, reason));
            }
            let is_enforced = match get("ROS_SECURITY_STRATEGY") {
                None | Some("Permissive") => false,
                Some("Enforce") => true,
                Some(value) => {
                    let reason = "Enforce or Permissive is needed";
                    return Err(refuse("ROS_SECURITY_STRATEGY", value, reason));
                }
            };
            let Some(keystore) = get("ROS_SECURITY_KEYSTORE") else {
                let reason = "ROS_SECURITY_KEYSTORE has to say where the keystore is";
                return Err(refuse("ROS_SECURITY_ENABLE", "true", reason));
            };
            let enclave = get("ROS_SECURITY_ENCLAVE_OVERRIDE").map(str::to_owned);
            found.security =
                Some(SecurityRequest { keystore: keystore.into(), is_enforced, enclave });
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)]) -> Result<Environment, EnvironmentError> {
        let map = variables.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        Environment::read(&map)
    }

    #[test]
    fn without_variables_only_this_computer_is_reached_in_domain_0() {
        assert_eq!(read(&[]), Ok(Environment::default()));
        assert_eq!(read(&[("ROS_DOMAIN_ID", ""), ("RMW_IMPLEMENTATION", " ")]), read(&[]));
    }

    #[test]
    fn domains_go_from_0_to_232() {
        for (value, id) in [("0", 0), ("42", 42), ("232", 232), (" 7 ", 7)] {
            assert_eq!(read(&[("ROS_DOMAIN_ID", value)]).expect(value).domain_id, id);
        }
        assert_eq!(read(&[("ROS_DOMAIN_ID", "150")]).expect("valid").warnings.len(), 1);
        for value in ["233", "-1", "1.5", "0x10", "seven", "99999999999999999999"] {
            let error = read(&[("ROS_DOMAIN_ID", value)]).expect_err(value);
            assert!(error.to_string().contains("0 to 232"), "{error}");
        }
    }

    #[test]
    fn the_range_of_discovery_is_the_smaller_of_both_variables() {
        use DiscoveryRange::{Localhost, Off, Subnet};
        let table = [
            ("SUBNET", "", Subnet),
            ("SUBNET", "0", Subnet),
            ("SUBNET", "1", Localhost),
            ("LOCALHOST", "0", Localhost),
            ("SYSTEM_DEFAULT", "", Localhost),
            ("OFF", "1", Off),
            ("", "1", Localhost),
        ];
        for (range, only, expected) in table {
            let variables =
                [("ROS_AUTOMATIC_DISCOVERY_RANGE", range), ("ROS_LOCALHOST_ONLY", only)];
            assert_eq!(read(&variables).expect(range).range, expected, "{range} {only}");
        }
        assert!(read(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "subnet")]).is_err());
        assert!(read(&[("ROS_LOCALHOST_ONLY", "yes")]).is_err());
    }

    #[test]
    fn the_service_mapping_follows_the_middleware_of_the_peers() {
        let mapping =
            |value| read(&[("RMW_IMPLEMENTATION", value)]).map(|environment| environment.mapping);
        assert_eq!(mapping("rmw_fastrtps_cpp"), Ok(ServiceMapping::Enhanced));
        assert_eq!(mapping("rmw_cyclonedds_cpp"), Ok(ServiceMapping::Cyclone));
        assert!(mapping("rmw_connextdds").is_err());
    }

    #[test]
    fn zenoh_is_there_where_it_is_built_in() {
        let found = read(&[("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")]);
        if !HAS_ZENOH {
            let error = found.expect_err("it is not built in").to_string();
            assert!(error.contains("--features zenoh"), "{error}");
            return;
        }
        let found = found.expect("valid");
        assert!(found.mapping == ServiceMapping::Queries && found.warnings.is_empty());
        let with = |name, value| read(&[("RMW_IMPLEMENTATION", "rmw_zenoh_cpp"), (name, value)]);
        let range = with("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET").expect("valid");
        assert!(range.warnings.iter().any(|warning| warning.contains("router")), "{range:?}");
        let peers = with("ROS_STATIC_PEERS", "10.0.0.2").expect("valid");
        assert!(peers.warnings.iter().any(|warning| warning.contains("routers")), "{peers:?}");
        assert!(with("ROS_SECURITY_ENABLE", "true").is_err(), "it names no keystore");
        let two = [
            ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp"),
            ("ROS_SECURITY_ENABLE", "true"),
            ("ROS_SECURITY_KEYSTORE", "/keys"),
            ("ZENOH_SESSION_CONFIG_URI", "/a.json5"),
        ];
        assert_eq!(
            read(&two[..3]).expect("valid").security.expect("asked").keystore,
            std::path::Path::new("/keys")
        );
        let error = read(&two).expect_err("two configurations").to_string();
        assert!(error.contains("/a.json5") && error.contains("unset one"), "{error}");
        assert!(with("ZENOH_ROUTER_CHECK_ATTEMPTS", "often").is_err());
        assert!(with("ROS_DOMAIN_ID", "233").is_err());
    }

    #[test]
    fn peers_are_a_list() {
        let peers = |value| read(&[("ROS_STATIC_PEERS", value)]).map(|found| found.static_peers);
        assert_eq!(peers(" 10.0.0.2; mill;").expect("valid"), ["10.0.0.2", "mill"]);
        let off = [("ROS_STATIC_PEERS", "10.0.0.2"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")];
        let off = read(&off).expect("valid");
        assert!(off.static_peers.is_empty() && off.warnings.len() == 1, "{off:?}");
    }

    #[test]
    fn security_is_asked_for_as_in_ros() {
        let asked = |more: &[(&str, &str)]| {
            let keystore = ("ROS_SECURITY_KEYSTORE", "/keys");
            let variables = [&[("ROS_SECURITY_ENABLE", "true"), keystore], more].concat();
            read(&variables).map(|environment| environment.security.expect("it was asked for"))
        };
        let enforced = ("ROS_SECURITY_STRATEGY", "Enforce");
        assert!(!asked(&[]).expect("valid").is_enforced);
        assert!(asked(&[enforced]).expect("valid").is_enforced);
        assert!(asked(&[("ROS_SECURITY_STRATEGY", "enforce")]).is_err());
        let overridden = asked(&[("ROS_SECURITY_ENCLAVE_OVERRIDE", "/mill")]).expect("valid");
        assert_eq!(overridden.enclave.as_deref(), Some("/mill"));
        assert!(read(&[("ROS_SECURITY_ENABLE", "true")]).is_err());
        assert_eq!(read(&[("ROS_SECURITY_ENABLE", "false")]), read(&[]));
        assert_eq!(read(&[("ROS_SECURITY_KEYSTORE", "/keys")]), read(&[]));
    }
}
