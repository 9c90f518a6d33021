//! What the lifecycle states of the loader mean.
//!
//! Configured: the default profile is valid. Active: programs are accepted. The loaded program is
//! published in every state.

use super::{Loader, LoaderState};
use runtime::{Health, Managed, TransitionResult, Trouble};

impl Managed for Loader {
    async fn configure(&self) -> TransitionResult {
        // An invalid default profile is found now, not with the first program.
        settings::load_profile(&self.control).map(drop).map_err(Trouble::failure)
    }

    async fn deactivate(&self) -> TransitionResult {
        // A load in progress is completed, and so is the parameter file.
        drop(self.work.lock().await);
        Ok(())
    }

    async fn cleanup(&self) -> TransitionResult {
        *self.state() = LoaderState::default();
        if let Some(file) = &self.parameter_file {
            file.forget_trouble();
        }
        Ok(())
    }

    fn health(&self) -> Vec<Health> {
        Loader::health(self)
    }
}
