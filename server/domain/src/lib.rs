//! What things are: the vocabulary of a run and every decision that needs no heavy library.
//!
//! Invariants: no input or output, no clock, no threads; randomness comes in as a [`random::Rng`];
//! knows no other crate of the workspace.

pub mod agreement;
pub mod answer;
pub mod environment;
pub mod episode;
pub mod nearest;
pub mod query;
pub mod random;
pub mod sampler;
pub mod scene;
pub mod schedule;
pub mod stage;
pub mod study;
pub mod teacher;
