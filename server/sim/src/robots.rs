//! Bodies that act: what a task drives by its actions.

pub mod cheetah;
pub mod panda;
pub mod planar_robot;
pub mod quadruped;
pub mod sawyer_fingers;
pub mod sawyer_hand;
pub mod tabletop;
pub mod walker;
