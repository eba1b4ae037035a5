//! MetaWorld's table: what stands around every task, to collide with and to look at.
//!
//! Metres; x right, y away from the robot, z up, the table's top at z = 0.
//! Source: METAWORLD.md 1.7 and 5.

use domain::scene::{Camera, Geometry, Material, Pattern, Shape, Transform};
use rapier3d::prelude::*;

use crate::world::{Timing, World};

/// Which colliders meet: the hand meets everything, moving parts meet only the hand (in MetaWorld
/// a moving part slides in its own frame with a gap of 2 mm, which is not simulated).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// Table, walls and the fixed parts of an assembly.
    Fixed,
    /// The moving part of an assembly.
    Object,
    /// A body that lies on the table.
    Loose,
    /// The robot's hand.
    Hand,
}

impl Layer {
    /// Rapier's way of saying it.
    pub fn groups(self) -> InteractionGroups {
        let (fixed, object, hand) = (Group::GROUP_1, Group::GROUP_2, Group::GROUP_3);
        let loose = Group::GROUP_4;
        let (memberships, filter) = match self {
            Self::Fixed => (fixed, hand | loose),
            Self::Object => (object, hand),
            Self::Loose => (loose, hand | fixed),
            Self::Hand => (hand, fixed | object | loose),
        };
        InteractionGroups::new(memberships, filter, InteractionTestMode::And)
    }
}

/// Seconds of a [`world`]'s step: one control step.
const STEP_S: f32 = 0.0125;
const N_SUBSTEPS: usize = 4;

/// An empty world that is stepped once per control step (12.5 ms in four substeps). Without
/// gravity: the arm carries the hand, assemblies slide level.
pub fn world() -> World {
    let mut world = World::new(Timing {
        step_s: STEP_S,
        n_substeps: N_SUBSTEPS,
        gravity: 0.0,
    });
    // A heavy hand pushes light parts against their stops: one iteration leaves them oscillating.
    let parameters = &mut world.physics.integration_parameters;
    parameters.num_internal_pgs_iterations = 4;
    world
}

/// A collider with the friction that MetaWorld's objects have: 1, the larger of two counts.
pub fn collider(shape: ColliderBuilder, at: [f32; 3], layer: Layer) -> ColliderBuilder {
    shape
        .translation(Vector::from(at))
        .friction(1.0)
        .friction_combine_rule(CoefficientCombineRule::Max)
        .collision_groups(layer.groups())
}

/// Half extents and centre of the four retaining walls.
const WALLS: [([f32; 3], [f32; 3]); 4] = [
    ([0.7, 0.01, 0.06], [0.0, 0.21, 0.06]),
    ([0.7, 0.01, 0.06], [0.0, 0.99, 0.06]),
    ([0.01, 0.38, 0.06], [-0.69, 0.6, 0.06]),
    ([0.01, 0.38, 0.06], [0.69, 0.6, 0.06]),
];

/// Adds the table's block and its retaining walls.
pub fn add_table(world: &mut PhysicsWorld) {
    let table = ColliderBuilder::cuboid(0.7, 0.4, 0.46);
    world.insert_collider(collider(table, [0.0, 0.6, -0.46], Layer::Fixed), None);
    for ([x, y, z], centre) in WALLS {
        let wall = ColliderBuilder::cuboid(x, y, z);
        world.insert_collider(collider(wall, centre, Layer::Fixed), None);
    }
}

/// Behind everything (sRGB).
pub const BACKGROUND: [f32; 3] = [0.50, 0.495, 0.48];

const WOOD: Material = Material {
    color: [0.55, 0.40, 0.29, 1.0],
    pattern: Pattern::Wood,
    is_marker: false,
};
const LEG_WOOD: Material = Material::plain(0.42, 0.29, 0.21);

/// Table, walls, floor and the robot's pedestal, all on body 0.
pub fn scenery() -> Vec<Shape> {
    let metal = Material::plain(0.42, 0.43, 0.44);
    let mut shapes = floor_and_pedestal();
    shapes.extend([
        fixed_box([0.7, 0.4, 0.027], [0.0, 0.6, -0.027], WOOD),
        fixed_box([0.62, 0.01, 0.05], [0.0, 0.24, -0.104], LEG_WOOD),
        fixed_box([0.62, 0.01, 0.05], [0.0, 0.96, -0.104], LEG_WOOD),
    ]);
    for x in [-0.65, 0.65] {
        for y in [0.26, 0.94] {
            shapes.push(fixed_box([0.04, 0.04, 0.43], [x, y, -0.483], LEG_WOOD));
        }
    }
    shapes.extend(WALLS.map(|(half, centre)| fixed_box(half, centre, metal)));
    shapes
}

/// Half extents and centre of the boards around the hole of [`add_table_with_hole`], top at
/// z = 0.05: in front, left, right, behind.
const BOARDS: [([f32; 3], [f32; 3]); 4] = [
    ([0.08, 0.28, 0.05], [0.0, 0.48, 0.0]),
    ([0.31, 0.4, 0.05], [-0.39, 0.6, 0.0]),
    ([0.31, 0.4, 0.05], [0.39, 0.6, 0.0]),
    ([0.08, 0.04, 0.05], [0.0, 0.96, 0.0]),
];
/// Half extents and centre of the bottom of the hole. Its top is at z = 0: METAWORLD.md has it at
/// −0.053, but in every recording a block in the hole comes to rest with its middle at 0.02.
const BOTTOM: ([f32; 3], [f32; 3]) = ([0.08, 0.08, 0.025], [0.0, 0.84, -0.025]);
/// Half extents and centre of what the boards lie on.
const SUPPORT: ([f32; 3], [f32; 3]) = ([0.69, 0.38, 0.43], [0.0, 0.6, -0.483]);

/// Adds a table without walls, its top at z = 0.05, with a square hole from (−0.08, 0.76) to
/// (0.08, 0.92) whose bottom is at z = 0.
pub fn add_table_with_hole(world: &mut PhysicsWorld) {
    for ([x, y, z], centre) in BOARDS.into_iter().chain([BOTTOM, SUPPORT]) {
        let board = ColliderBuilder::cuboid(x, y, z);
        world.insert_collider(collider(board, centre, Layer::Fixed), None);
    }
}

/// Height of the floor, metres.
const FLOOR_Z: f32 = -0.913;

/// Adds the floor, for what may fall off the table.
pub fn add_floor(world: &mut PhysicsWorld) {
    let floor = ColliderBuilder::cuboid(4.0, 4.0, 0.5);
    let centre = [0.0, 0.0, FLOOR_Z - 0.5];
    world.insert_collider(collider(floor, centre, Layer::Fixed), None);
}

/// The table with a hole, floor and the robot's pedestal, all on body 0.
pub fn scenery_with_hole() -> Vec<Shape> {
    let mut shapes = floor_and_pedestal();
    shapes.extend(BOARDS.map(|(half, centre)| fixed_box(half, centre, WOOD)));
    shapes.extend([BOTTOM, SUPPORT].map(|(half, centre)| fixed_box(half, centre, LEG_WOOD)));
    shapes
}

fn floor_and_pedestal() -> Vec<Shape> {
    const TILES: Material = Material {
        color: [0.86, 0.86, 0.85, 1.0],
        pattern: Pattern::Tiles,
        is_marker: false,
    };
    let black = Material::plain(0.2, 0.2, 0.2);
    vec![
        fixed_box([4.0, 4.0, 0.01], [0.0, 0.0, FLOOR_Z - 0.01], TILES),
        fixed_box([0.11, 0.2, 0.265], [-0.325, 0.0, -0.38], black),
        fixed_box([0.385, 0.35, 0.155], [-0.1225, 0.0, -0.758], black),
        Shape {
            body: 0,
            local: Transform::at(-0.02, 0.0, -0.29),
            geometry: Geometry::Cylinder {
                radius: 0.18,
                half_length: 0.31,
            },
            material: black,
        },
    ]
}

fn fixed_box(half: [f32; 3], centre: [f32; 3], material: Material) -> Shape {
    Shape {
        body: 0,
        local: Transform::at(centre[0], centre[1], centre[2]),
        geometry: Geometry::Cuboid { half },
        material,
    }
}

/// The original's fixed cameras, upright, with `first` in front.
pub fn cameras(first: &str) -> Vec<Camera> {
    let camera = |name: &str, eye, forward, up, fovy_deg| Camera {
        name: name.into(),
        eye,
        forward,
        up,
        fovy_deg,
    };
    let (down_left, up_left) = (
        [-0.745_71, 0.458_24, -0.483_67],
        [-0.376_21, 0.309_55, 0.873_30],
    );
    let mut cameras = vec![
        camera(
            "corner3",
            [0.9, 0.0, 1.5],
            [-0.427_38, 0.317_13, -0.846_62],
            [-0.760_75, 0.379_82, 0.526_30],
            45.0,
        ),
        camera(
            "corner",
            [-1.1, -0.4, 0.6],
            [0.680_41, 0.680_41, -0.272_17],
            [0.192_45, 0.192_45, 0.962_25],
            45.0,
        ),
        camera("corner2", [1.3, -0.2, 1.1], down_left, up_left, 60.0),
        camera("corner4", [0.75, 0.075, 0.7], down_left, up_left, 60.0),
        camera(
            "topview",
            [0.0, 0.5, 1.5],
            [0.0, 0.0, -1.0],
            [0.0, 1.0, 0.0],
            45.0,
        ),
    ];
    cameras.sort_by_key(|camera| camera.name != first);
    cameras
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_look_along_unit_vectors_at_right_angles_to_up() {
        for camera in cameras("corner") {
            let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            assert!((dot(camera.forward, camera.forward) - 1.0).abs() < 1e-4);
            assert!(
                (dot(camera.up, camera.up) - 1.0).abs() < 1e-4,
                "{}",
                camera.name
            );
            assert!(
                dot(camera.forward, camera.up).abs() < 1e-4,
                "{}",
                camera.name
            );
        }
        assert_eq!(cameras("corner")[0].name, "corner");
    }
}
