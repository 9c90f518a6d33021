//! What the states of the loader mean.
//!
//! Configured is: the profile of programs that name none can be had. Active is: programs
//! are taken. The program that is loaded is told of in any state that has one.

use super::{Loader, State};
use runtime::{Health, Managed, Step, Trouble};

impl Managed for Loader {
    async fn configure(&self) -> Step {
        // A wrong default is better found now than with the first program.
        settings::load_profile(&self.control).map(drop).map_err(Trouble::failure)
    }

    async fn deactivate(&self) -> Step {
        // A program that is being loaded is loaded to its end.
        drop(self.work.lock().await);
        Ok(())
    }

    async fn cleanup(&self) -> Step {
        *self.state() = State::default();
        Ok(())
    }

    fn health(&self) -> Vec<Health> {
        vec![Loader::health(self)]
    }
}
