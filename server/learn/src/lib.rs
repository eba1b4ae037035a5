//! Learns: the agent (SAC), the reward ensemble, the temporal distance, the drive to explore, and
//! to tell the step from the state.
//!
//! Invariants: the only crate that touches tensors; randomness only from [`domain::random`], keyed
//! by (seed, stream, step), so that every learner resumes bit for bit from what it saves, on
//! any number of threads; a task reward reaches a learner only through
//! [`replay::RewardSource::Task`], the upper bound's own road.

#![expect(
    clippy::cast_possible_wrap,
    reason = "libtorch counts in i64, Rust in usize; nothing here comes near 2⁶³"
)]

pub mod beliefs;
pub mod checkpoint;
pub mod checksum;
pub mod device;
pub mod durable;
pub mod exploration;
pub mod replay;
pub mod reward;
pub mod sac;
pub mod stage;
pub mod temporal;
pub mod timestep;

mod adam;
mod error;
mod init;
mod kernel;
mod net;
mod precision;
mod threads;

pub use error::LearnError;
pub use precision::Precision;
