//! The parameters of a running node, for the node itself.

use crate::endpoints::node::Handle;
use crate::managed::parameter_services::row_to_wire;
use crate::parameters::ParameterValue;
use crate::parameters::Parameters;
use crate::parameters::common::MEMORY_MB_MAX;
use crate::process::lock;
use crate::rustdds::memory_bound::MemoryBound;
use cnc_msgs::cdr;
use cnc_msgs::convert::parameter_from_wire;
use cnc_msgs::wire::rcl_interfaces::msg::Parameter;
use std::sync::Arc;

/// Where the memory has the parameters that were changed.
const KEPT: &str = "parameters";

type Kept = Vec<Parameter>;

/// The parameters that may change while a node runs, with their values.
fn settable(parameters: &Parameters) -> Kept {
    let rows = parameters.iter().filter(|(declared, _)| !declared.read_only);
    rows.map(|(declared, value)| row_to_wire(declared, value)).collect()
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

    /// Goes on with what was set in the process before this one, and keeps what is set from now
    /// on in the node's memory. Returns whether there was something to go on with.
    ///
    /// # Panics
    /// The node has no memory.
    pub fn keep_parameters(&self) -> bool {
        let memory = || self.memory().expect("the node has a memory");
        let live = Arc::clone(&self.inner.parameters);
        let at_start = settable(&lock(&live.parameters));
        let kept = memory().get(KEPT).and_then(|bytes| cdr::from_body::<Kept>(&bytes).ok());
        let is_kept = kept.is_some();
        for Parameter { name, value } in kept.unwrap_or_default() {
            // Each by itself: one that a newer version does not take costs no other.
            let set = parameter_from_wire(&value).map(|value| live.set(&[(name.clone(), value)]));
            if let Some(Err(reason)) = set {
                tracing::warn!("parameter \"{name}\" is not kept: {reason}");
            }
        }
        let (node, mut changes) = (self.clone(), live.subscribe());
        self.spawn("parameters to keep", async move {
            while changes.changed().await.is_ok() {
                let now = settable(&lock(&node.inner.parameters.parameters));
                let changed: Kept = now.into_iter().filter(|row| !at_start.contains(row)).collect();
                if let Some(memory) = node.memory() {
                    memory.keep(KEPT, cdr::body(&changed));
                }
            }
        });
        is_kept
    }

    /// Receives every later change of the parameters.
    pub fn parameter_changes(&self) -> tokio::sync::watch::Receiver<u64> {
        self.inner.parameters.subscribe()
    }
}
