//! `stair openapi`: the description of the API, without a server.

use std::process::ExitCode;

use anyhow::Context as _;
use utoipa::OpenApi as _;

use crate::api::Document;

/// Print the API's description (OpenAPI 3.1, JSON)
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair openapi > openapi.json")]
pub struct Args {}

/// Runs the command.
///
/// # Errors
/// A description that cannot be written as JSON.
pub fn run(_args: &Args) -> anyhow::Result<ExitCode> {
    println!(
        "{}",
        Document::openapi()
            .to_pretty_json()
            .context("cannot write the description")?
    );
    Ok(ExitCode::SUCCESS)
}
