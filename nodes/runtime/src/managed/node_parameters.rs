//! The parameters of a running node, for the node itself.

use crate::endpoints::node::Handle;
use crate::parameters::ParameterValue;
use crate::parameters::common::MEMORY_MB_MAX;
use crate::rustdds::memory_bound::MemoryBound;

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
        match self.inner.parameters.get(MEMORY_MB_MAX) {
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
