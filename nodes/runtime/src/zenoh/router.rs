//! A router: what nodes learn of each other by, and what carries their samples between computers.

use crate::command_line::zenoh_settings::{ZenohSettings, path};
use crate::zenoh::error::ZenohError;
use crate::zenoh::settings::of_router;
use std::collections::BTreeMap;
use zenoh::{Session, Wait};

/// A router; it routes as long as this lives.
pub struct Router {
    session: Session,
}

impl Router {
    /// Starts one with the configuration that `ZENOH_ROUTER_CONFIG_URI` names. Without that it listens on
    /// port 7447 of the loopback interface. Blocks; not to be called in an executor.
    ///
    /// # Errors
    /// A variable or the configuration is invalid, or nothing can listen there.
    pub fn start(variables: &BTreeMap<String, String>) -> Result<Self, ZenohError> {
        const WHAT: &str = "a router of Zenoh";
        let get = |name: &str| {
            variables.get(name).map(|value| value.trim()).filter(|value| !value.is_empty())
        };
        let settings = ZenohSettings::read(get).map_err(|error| ZenohError::new(WHAT, &error))?;
        let file = get("ZENOH_ROUTER_CONFIG_URI").map(path);
        let config = of_router(file.as_deref(), &settings.overrides)?;
        let session = zenoh::open(config).wait().map_err(|error| ZenohError::new(WHAT, &error))?;
        Ok(Self { session })
    }

    /// Where it listens.
    pub fn addresses(&self) -> Vec<String> {
        let locators = self.session.info().locators().wait();
        locators.into_iter().map(|locator| locator.to_string()).collect()
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        // Nothing is left to be done if it fails.
        drop(self.session.close().wait());
    }
}

impl std::fmt::Debug for Router {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Router").finish_non_exhaustive()
    }
}
