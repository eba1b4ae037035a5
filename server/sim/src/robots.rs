//! Bodies that act: what a task drives by its actions.

pub mod planar_robot;
