//! MetaWorld's small safe, whose door opens or stays shut under its lock.
//!
//! Metres, in the frame of the assembly's root `P`, the cabinet's centre.
//! Source: METAWORLD.md 3.1.

use domain::scene::Material;

use super::assembly::{Part, cuboid};
use super::metaworld::Point;

/// Walls and door.
pub const STEEL: Material = Material::plain(0.3, 0.32, 0.35);
/// Handle, hinges, lock.
pub const HANDLE: Material = Material::plain(0.75, 0.75, 0.75);

/// Where the door's hinge is, seen from `P`.
pub const HINGE: Point = [-0.185, -0.1, 0.0];

/// The cabinet without its door.
pub const PARTS: [Part; 5] = [
    cuboid([-0.204, 0.0, 0.0], [0.016, 0.106, 0.15], STEEL),
    cuboid([0.204, 0.0, 0.0], [0.016, 0.106, 0.15], STEEL),
    cuboid([0.0, 0.0, 0.138], [0.188, 0.106, 0.012], STEEL),
    cuboid([0.0, 0.0, -0.138], [0.189, 0.106, 0.012], STEEL),
    cuboid([0.0, 0.094, 0.0], [0.188, 0.012, 0.126], STEEL),
];
