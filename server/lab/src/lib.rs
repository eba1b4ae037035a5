//! A run told once, for every method: Algorithm 1 over parts.
//!
//! Invariants: knows neither pixels nor SQL nor people; talks to the world through
//! [`message`] and [`domain::teacher::Teacher`] alone; a method is a recipe of parts.

pub mod config;
pub mod cost;
pub mod evaluate;
pub mod experiment;
pub mod figure;
pub mod history;
pub mod memory;
pub mod message;
pub mod method;
pub mod policy;
pub mod record;
pub mod run;
pub mod stepping;
pub mod study;
pub mod temporal_map;
pub mod words;

mod candidates;
mod folder;
mod lanes;
mod learner;
mod meter;
mod preferences;
mod session;
