//! Ctrl-C and SIGTERM, for commands that leave something to go on with.

use anyhow::Context as _;

/// Calls `told` once, on a thread of its own, when the user or the system asks to stop.
pub(super) fn on_interrupt(told: impl FnOnce() + Send + 'static) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.context("cannot listen for Ctrl-C")?;
    std::thread::spawn(move || {
        let heard = runtime.block_on(async {
            let mut terminate =
                tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
            tokio::select! {
                heard = tokio::signal::ctrl_c() => heard,
                _ = terminate.recv() => Ok(()),
            }
        });
        if heard.is_ok() {
            told();
        }
    });
    Ok(())
}
