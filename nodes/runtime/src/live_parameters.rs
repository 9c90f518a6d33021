//! The parameters of a running node, for the node itself.

use crate::memory_bound::{self, MemoryBound};
use crate::node::{Handle, lock};
use crate::parameters::{ParameterValue, Parameters};
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
        let mut parameters = lock(&self.parameters);
        parameters.check(changes).map_err(|error| error.to_string())?;
        if let Some(guard) = &*lock(&self.guard) {
            guard(changes)?;
        }
        parameters.set(changes).map_err(|error| error.to_string())?;
        drop(parameters);
        self.changes.send_modify(|count| *count = count.wrapping_add(1));
        Ok(())
    }
}

impl Handle {
    /// The value of a parameter now.
    ///
    /// # Panics
    /// The node did not declare it, or declared another type.
    pub fn parameter<T: TryFrom<ParameterValue>>(&self, name: &str) -> T {
        let value = self.inner.parameters.get(name);
        let value = value.unwrap_or_else(|| panic!("parameter \"{name}\" is not declared"));
        let type_name = value.type_name();
        T::try_from(value)
            .unwrap_or_else(|_| panic!("parameter \"{name}\" is declared as {type_name}"))
    }

    /// The memory at which this process ends, bytes: `memory_mb_max`, or less on a small computer.
    pub fn memory_bytes_max(&self) -> u64 {
        match self.inner.parameters.get(memory_bound::PARAMETER) {
            Some(ParameterValue::Integer(megabytes)) => MemoryBound::of(megabytes),
            _ => MemoryBound::usual(),
        }
        .bytes()
    }

    /// Sets a validator for changes of parameters while the node runs. It gets all changes
    /// together, once they fit the declarations, and returns the reason if it refuses.
    pub fn guard_parameters(
        &self,
        guard: impl Fn(&[(String, ParameterValue)]) -> Result<(), String> + Send + 'static,
    ) {
        self.inner.parameters.set_guard(Box::new(guard));
    }

    /// Receives every later change of the parameters.
    pub fn parameter_changes(&self) -> tokio::sync::watch::Receiver<u64> {
        self.inner.parameters.subscribe()
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
        assert!(live.set(&feed(9.0)).expect_err("range").contains("not within"));
    }
}
