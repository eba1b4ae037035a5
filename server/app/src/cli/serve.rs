//! `stair serve`: the server.

use std::future::IntoFuture as _;
use std::io::IsTerminal as _;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use store::{Secret, Store};
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};

use super::BadInput;
use crate::live::Live;
use crate::router::router;
use crate::state::AppState;

/// How long requests in hand may still take when the runs have left their checkpoints.
const GRACE: Duration = Duration::from_millis(500);

/// Start the server: pages for labelers and researchers, and the API
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair serve
  stair serve --bind 127.0.0.1:9000 --data ~/stair
  stair serve --bind 0.0.0.0:8080 --new-token       prints a token once; others need it to come in")]
pub struct Args {
    /// Address and port; port 0 takes a free one
    #[arg(long, default_value = "127.0.0.1:8080", value_name = "ADDRESS:PORT")]
    #[arg(value_parser = address)]
    bind: SocketAddr,
    /// Folder for the database, clips and runs
    #[arg(long, default_value = "data", value_name = "DIR")]
    data: PathBuf,
    /// The token that others must bring when --bind is more than this machine
    #[arg(
        long,
        env = "STAIR_TOKEN",
        hide_env_values = true,
        value_name = "SECRET"
    )]
    token: Option<String>,
    /// Make a token and print it, once
    #[arg(long, conflicts_with = "token")]
    new_token: bool,
}

/// An address to listen on; `localhost` is this machine's own.
fn address(text: &str) -> Result<SocketAddr, String> {
    let numbers = match text.split_once(':') {
        Some(("localhost", port)) => format!("127.0.0.1:{port}"),
        _ => text.to_owned(),
    };
    let parsed = numbers.parse::<SocketAddr>();
    parsed.map_err(|_| "write an address and a port, for instance 127.0.0.1:8080".to_owned())
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for an address that needs a token, a port in use, a data folder that another
/// server or a newer version holds; anything that stops the server later.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env();
    let filter = filter.unwrap_or_else(|_| {
        "info,sqlx=warn,wgpu=error,naga=error,wgpu_hal=off,wgpu_core=error".into()
    });
    // Colours are for people who look, and who have not said otherwise.
    let is_plain = std::env::var("NO_COLOR").is_ok_and(|value| !value.is_empty());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal() && !is_plain)
        .init();
    let runtime = tokio::runtime::Runtime::new().context("cannot start the server's threads")?;
    runtime.block_on(serve(args))?;
    Ok(ExitCode::SUCCESS)
}

async fn serve(args: Args) -> anyhow::Result<()> {
    let token = token(&args)?;
    let store = Store::open(&args.data)
        .await
        .map_err(BadInput::from_error)?;
    if let Some(token) = &token {
        store.add_access_token(token).await?;
    }
    let listener = TcpListener::bind(args.bind)
        .await
        .map_err(|error| cannot_listen(args.bind, &error))?;
    let address = listener
        .local_addr()
        .context("cannot read the server's address")?;
    // Pages tell how long a run takes on this machine; nobody should wait for its first measure.
    tokio::task::spawn_blocking(lab::cost::gigaflop_per_second);
    let live = Live::start(store.clone()).await?;
    let router = router(AppState::new(store, live.clone(), token.is_some()));
    announce(&args, address, token.as_ref());

    let (closing, mut closed) = tokio::sync::watch::channel(false);
    let until_told = async move {
        told_to_stop().await;
        tracing::info!("stopping: runs leave a checkpoint and go on at the next start");
        let _ = closing.send(true); // nobody else listens when the server has failed already
    };
    let mut serving = tokio::spawn(
        axum::serve(listener, router)
            .with_graceful_shutdown(until_told)
            .into_future(),
    );
    let ended = tokio::select! {
        ended = &mut serving => Some(ended),
        _ = closed.wait_for(|is_closing| *is_closing) => None,
    };
    live.close().await;
    let ended = match ended {
        Some(ended) => ended,
        // Streams of events never end by themselves, so the wait for requests in hand has an end.
        None => tokio::time::timeout(GRACE, serving)
            .await
            .unwrap_or(Ok(Ok(()))),
    };
    ended
        .context("the server stopped")?
        .context("the server stopped")
}

/// The secret that others must bring; none is needed where nobody else can come.
fn token(args: &Args) -> anyhow::Result<Option<Secret>> {
    if args.new_token {
        return Ok(Some(Secret::random()?));
    }
    if let Some(token) = &args.token {
        if token.trim().len() < 16 {
            return Err(BadInput(
                "the token is too easy to guess: use at least 16 characters, or --new-token".into(),
            )
            .into());
        }
        return Ok(Some(Secret::brought(token.trim())));
    }
    if args.bind.ip().is_loopback() {
        return Ok(None);
    }
    let told = format!(
        "{} can be reached by others, so it needs a token: add --new-token (it is printed once), or set STAIR_TOKEN",
        args.bind
    );
    Err(BadInput(told).into())
}

fn cannot_listen(address: SocketAddr, error: &std::io::Error) -> anyhow::Error {
    let told = match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            let other = SocketAddr::new(address.ip(), address.port().wrapping_add(1));
            format!(
                "port {} is in use; stop the other program, or choose another: --bind {other}",
                address.port()
            )
        }
        _ => format!("cannot listen on {address}: {error}"),
    };
    BadInput(told).into()
}

/// What the person who started the server needs: where to go, where the data is.
fn announce(args: &Args, address: SocketAddr, token: Option<&Secret>) {
    match token {
        Some(token) if args.new_token => {
            println!("Open http://{address}/enter?token={}", token.reveal());
            println!("The token is shown only now; it stays valid for this data folder.");
        }
        Some(_) => println!("Open http://{address}/enter?token=… with your token"),
        None => println!("Open http://{address}"),
    }
    println!(
        "Data is kept in {}. Ctrl-C stops; runs go on at the next start.",
        args.data.display()
    );
}

async fn told_to_stop() {
    let Ok(mut terminate) = signal(SignalKind::terminate()) else {
        return std::future::pending().await;
    };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => {}
        _ = terminate.recv() => {}
    }
}

#[cfg(test)]
mod tests {
    use super::address;

    #[test]
    fn this_machine_may_be_called_by_name_and_what_is_no_address_is_told_one() {
        let own = address("127.0.0.1:8080");
        assert_eq!(address("localhost:8080"), own);
        assert!(own.is_ok() && address("[::1]:0").is_ok());
        for wrong in ["8080", ":8080", "localhost", "localhost:", "example.org:80"] {
            let told = address(wrong).unwrap_err();
            assert!(told.ends_with("for instance 127.0.0.1:8080"), "{told}");
        }
    }
}
