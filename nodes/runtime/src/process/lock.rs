//! Locks a mutex even if a thread panicked while it held the lock.
//!
//! A panic ends a node anyway, or was caught on purpose; the value is complete in both cases.

use std::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
