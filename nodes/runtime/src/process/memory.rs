//! Values that a node keeps outside of its process, so that the next process can continue.
//!
//! Only the ROS process of the driver has such a memory, in the motion process. Actions keep
//! their goals in it, and a managed node its state.

use crate::process::lock;
use std::collections::BTreeMap;
use std::sync::Mutex;

/// Takes a value to keep, or `None` to forget it.
type Keep = Box<dyn Fn(&str, Option<Vec<u8>>) + Send + Sync>;

/// Values by name, of this process and the previous one.
pub struct Memory {
    values: Mutex<BTreeMap<String, Vec<u8>>>,
    keep: Keep,
}

impl Memory {
    /// `values` are those of the previous process; `keep` gets each change.
    pub fn new(
        values: BTreeMap<String, Vec<u8>>,
        keep: impl Fn(&str, Option<Vec<u8>>) + Send + Sync + 'static,
    ) -> Self {
        Self { values: Mutex::new(values), keep: Box::new(keep) }
    }

    /// The value of a name.
    pub fn get(&self, name: &str) -> Option<Vec<u8>> {
        lock(&self.values).get(name).cloned()
    }

    /// Keeps a value; does nothing if it has not changed.
    pub fn keep(&self, name: &str, value: Vec<u8>) {
        let mut values = lock(&self.values);
        if values.get(name) != Some(&value) {
            values.insert(name.to_owned(), value.clone());
            // Under the lock, so that changes go out in their order.
            (self.keep)(name, Some(value));
        }
    }

    /// Forgets a value.
    pub fn forget(&self, name: &str) {
        let mut values = lock(&self.values);
        if values.remove(name).is_some() {
            (self.keep)(name, None);
        }
    }
}

impl std::fmt::Debug for Memory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Memory").field("values", &lock(&self.values).len()).finish_non_exhaustive()
    }
}
