//! Tasks simulated with rapier3d, and runners with our own dynamics, behind `domain`'s
//! [`Environment`](domain::environment::Environment).
//!
//! Invariants: the only crate that touches rapier; never draws, never learns; an episode is a
//! function of its seed and its actions, bit for bit on one machine; what happens between two
//! steps is nobody's business but the task's, so tasks share physics but no behaviour.

pub mod articulated;
pub mod course;
pub mod expert;
pub mod golden;
pub mod reward;
pub mod robots;
pub mod solid;
pub mod tasks;
pub mod world;
