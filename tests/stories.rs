//! Whole-program stories: real processes, real sockets, real kills.

mod bad_input;
mod env_over_pipes;
mod experiment;
mod lost_replies;
mod restart;
mod resume;
pub(crate) mod server_process;
mod taught_over_http;
