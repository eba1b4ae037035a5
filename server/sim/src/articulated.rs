//! Robots as trees of joints, simulated in reduced coordinates with soft contacts.
//!
//! The locomotion tasks of DeepMind's control suite live from contacts, stops, rotor inertias and
//! stiff joint damping that have to feel like the originals': a policy's returns are compared
//! with published ones. Rapier's multibody joints were tried for them. They held neither the
//! quadruped's coupled joints together (0.55 rad of drift where the original allows 0.08) nor the
//! pace (2,500 to 4,900 of its control steps a second), and rapier's contacts know no impedance.
//! So these robots have dynamics of their own:
//!
//! - [`model`]: bodies, joints, solids, and what follows from them once;
//! - [`motion`]: poses, velocities, inertia matrix, bias forces;
//! - [`collision`] and `distance`: overlaps with the ground and of the robot with itself;
//! - [`softness`] and `solver`: what constraints want, and the accelerations that all agree on;
//! - [`simulation`]: one step of semi-implicit Euler, joint damping implicit.
//!
//! Everything is f64 and one thread; the same state and torques give the same bits.
//!
//! Units: metres, seconds, kilograms, radians; x forward, z up, ground at z = 0.

pub mod collision;
mod distance;
pub mod inertia;
pub mod model;
pub mod motion;
pub mod simulation;
pub mod softness;
mod solver;
pub mod vector;
