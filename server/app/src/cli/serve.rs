//! `stair serve`: the server.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;

use crate::router::router;
use crate::state::AppState;

/// Start the server: pages for labelers and researchers, and the API
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Address and port; port 0 takes a free one
    #[arg(long, default_value = "127.0.0.1:8080")]
    bind: SocketAddr,
    /// Folder for the database, clips and runs
    #[arg(long, default_value = "data", value_name = "DIR")]
    data: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// A port in use, a folder that cannot be used.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let runtime = tokio::runtime::Runtime::new().context("cannot start the server's threads")?;
    runtime.block_on(serve(args))?;
    Ok(ExitCode::SUCCESS)
}

async fn serve(args: Args) -> anyhow::Result<()> {
    let state = AppState::new(args.data);
    let listener = tokio::net::TcpListener::bind(args.bind).await;
    let listener = listener.with_context(|| format!("cannot listen on {}", args.bind))?;
    println!(
        "Open http://{}",
        listener.local_addr().context("cannot read the address")?
    );
    axum::serve(listener, router(state))
        .await
        .context("the server stopped")
}
