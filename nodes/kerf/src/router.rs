//! `kerf router`: what nodes on Zenoh find each other by, until Ctrl-C.

use crate::exit::{CommandResult, Failure};

/// Runs the router until Ctrl-C, SIGTERM or the end of the terminal.
#[cfg(feature = "zenoh")]
pub(crate) fn run() -> CommandResult {
    use crate::end_signals::EndSignals;
    let variables = std::env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
        .collect();
    let router = runtime::Router::start(&variables).map_err(Failure::usage)?;
    let executor = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(Failure::usage)?;
    executor.block_on(async {
        let mut signals = EndSignals::listen()?;
        println!("a Zenoh router listens at {}", router.addresses().join(", "));
        signals.next().await;
        Ok::<(), Failure>(())
    })?;
    // Zenoh does not close in an executor that has a single thread.
    drop(router);
    Ok(())
}

/// There is none where Zenoh is not built in.
#[cfg(not(feature = "zenoh"))]
pub(crate) fn run() -> CommandResult {
    Err(Failure::usage(
        "this build has no Zenoh: build it with `cargo build --release --features zenoh`, or start \
         `ros2 run rmw_zenoh_cpp rmw_zenohd`",
    ))
}
