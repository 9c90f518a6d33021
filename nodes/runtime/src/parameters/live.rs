//! The parameters of a running node: checked when they are set, and watched for changes.

use crate::parameters::{ParameterValue, Parameters};
use crate::process::lock;
use std::sync::Mutex;
use tokio::sync::watch;

/// Validates changes that fit the declarations; returns the reason if it refuses.
pub(crate) type Guard = Box<dyn Fn(&[(String, ParameterValue)]) -> Result<(), String> + Send>;

/// The parameters of a running node.
pub(crate) struct LiveParameters {
    pub(crate) parameters: Mutex<Parameters>,
    guard: Mutex<Option<Guard>>,
    changes: watch::Sender<u64>,
}

impl LiveParameters {
    pub(crate) fn new(parameters: Parameters) -> Self {
        Self {
            parameters: Mutex::new(parameters),
            guard: Mutex::new(None),
            changes: watch::Sender::new(0),
        }
    }

    pub(crate) fn get(&self, name: &str) -> Option<ParameterValue> {
        lock(&self.parameters).get(name).cloned()
    }

    pub(crate) fn set_guard(&self, guard: Guard) {
        *lock(&self.guard) = Some(guard);
    }

    pub(crate) fn subscribe(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Sets all or none; an error has the reason.
    pub(crate) fn set(&self, changes: &[(String, ParameterValue)]) -> Result<(), String> {
        // Locked to the end, so that nothing else is set between check and change. The parameters are not:
        // the guard reads them.
        let guard = lock(&self.guard);
        lock(&self.parameters).check(changes).map_err(|error| error.to_string())?;
        if let Some(guard) = &*guard {
            guard(changes)?;
        }
        lock(&self.parameters).set(changes).map_err(|error| error.to_string())?;
        self.changes.send_modify(|count| *count = count.wrapping_add(1));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Declared;

    fn declared() -> Parameters {
        let feed = Declared::new("limits.feed", 1.0, "m/s").within(0.0, 2.0);
        Parameters::declare(vec![feed]).expect("valid")
    }

    #[test]
    fn a_guard_can_refuse_what_the_declaration_allows() {
        let live = LiveParameters::new(declared());
        let feed = |value: f64| vec![("limits.feed".to_owned(), ParameterValue::from(value))];
        live.set(&feed(1.5)).expect("fits");
        live.set_guard(Box::new(|_| Err("not while the machine runs".to_owned())));
        assert_eq!(live.set(&feed(0.5)), Err("not while the machine runs".to_owned()));
        assert_eq!(live.get("limits.feed"), Some(1.5.into()));
        assert!(live.set(&feed(9.0)).expect_err("range").contains("not between"));
    }
}
