//! What a picture shows, as plain data: shapes once, places per step.
//!
//! Metres, radians, right-handed, z up; x to the right and y away from the viewer in the
//! manipulation tasks. Quaternions are (w, x, y, z).

/// Where something is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Metres.
    pub position: [f32; 3],
    /// Unit quaternion, (w, x, y, z).
    pub rotation: [f32; 4],
}

impl Transform {
    /// At the origin, unturned.
    pub const IDENTITY: Self = Self {
        position: [0.0; 3],
        rotation: [1.0, 0.0, 0.0, 0.0],
    };

    /// Moved, unturned.
    pub const fn at(x: f32, y: f32, z: f32) -> Self {
        Self {
            position: [x, y, z],
            rotation: [1.0, 0.0, 0.0, 0.0],
        }
    }

    /// Turned by `angle` radians about a unit `axis`.
    #[must_use]
    pub fn turned(self, axis: [f32; 3], angle: f32) -> Self {
        let (sin, cos) = (angle / 2.0).sin_cos();
        let turn = [cos, axis[0] * sin, axis[1] * sin, axis[2] * sin];
        Self {
            rotation: quaternion_product(self.rotation, turn),
            ..self
        }
    }

    /// This frame, then `child` inside it.
    #[must_use]
    pub fn then(self, child: Self) -> Self {
        let p = rotate(self.rotation, child.position);
        Self {
            position: [
                self.position[0] + p[0],
                self.position[1] + p[1],
                self.position[2] + p[2],
            ],
            rotation: quaternion_product(self.rotation, child.rotation),
        }
    }
}

fn quaternion_product(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn rotate(q: [f32; 4], v: [f32; 3]) -> [f32; 3] {
    let p = quaternion_product(
        quaternion_product(q, [0.0, v[0], v[1], v[2]]),
        [q[0], -q[1], -q[2], -q[3]],
    );
    [p[1], p[2], p[3]]
}

/// The form of a shape, centred on its frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Geometry {
    /// Half extents, metres.
    Cuboid {
        /// Along x, y, z.
        half: [f32; 3],
    },
    /// Around the frame's z axis.
    Cylinder {
        /// Metres.
        radius: f32,
        /// Half the height, metres.
        half_length: f32,
    },
    /// Around the frame's z axis, with round caps beyond `half_length`.
    Capsule {
        /// Metres.
        radius: f32,
        /// Half the length of the straight part, metres.
        half_length: f32,
    },
    /// A ball.
    Sphere {
        /// Metres.
        radius: f32,
    },
    /// Round, its axes the frame's; shaded like a ball.
    Ellipsoid {
        /// Half the length along x, y, z, metres.
        semi_axes: [f32; 3],
    },
    /// A flat ring or disc in the frame's xy plane, seen from both sides.
    Ring {
        /// Metres; 0 for a disc.
        inner: f32,
        /// Metres.
        outer: f32,
    },
}

/// What a surface looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pattern {
    /// One colour.
    Plain,
    /// Light boards with grain along x.
    Wood,
    /// Square tiles, 1 m.
    Tiles,
    /// A fine grid, 0.25 m: shows how far things move.
    Grid,
    /// Light and dark squares, 1 m: shows from afar how far things move.
    Checker,
}

/// Colour and finish of a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Red, green, blue, alpha, each in [0, 1], as in an image file (sRGB).
    pub color: [f32; 4],
    /// Drawn on top of the colour.
    pub pattern: Pattern,
    /// Whether light ignores it: goals and marks that are no objects.
    pub is_marker: bool,
}

impl Material {
    /// One opaque colour.
    pub const fn plain(r: f32, g: f32, b: f32) -> Self {
        Self {
            color: [r, g, b, 1.0],
            pattern: Pattern::Plain,
            is_marker: false,
        }
    }
    /// A mark rather than an object: unlit, casts no shadow.
    pub const fn marker(r: f32, g: f32, b: f32, alpha: f32) -> Self {
        Self {
            color: [r, g, b, alpha],
            pattern: Pattern::Plain,
            is_marker: true,
        }
    }
}

/// A form on a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Index into a frame's bodies; body 0 is the world.
    pub body: usize,
    /// Place inside the body's frame.
    pub local: Transform,
    /// Form.
    pub geometry: Geometry,
    /// Look.
    pub material: Material,
}

/// An arm that is drawn up to a body it holds; its joints are found by inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arm {
    /// Rethink's Sawyer, base at the world's origin, its hand frame at the body's frame.
    Sawyer {
        /// The hand's body.
        hand: usize,
    },
}

/// Where a picture is taken from.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// As users type it: `corner3`.
    pub name: String,
    /// Metres.
    pub eye: [f32; 3],
    /// Unit vector.
    pub forward: [f32; 3],
    /// Unit vector.
    pub up: [f32; 3],
    /// Vertical field of view, degrees.
    pub fovy_deg: f32,
}

/// Everything about a task's picture that does not move.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Number of bodies in every frame, the world included.
    pub n_bodies: usize,
    /// What is drawn.
    pub shapes: Vec<Shape>,
    /// An arm that needs its own joints found.
    pub arm: Option<Arm>,
    /// The first is the one that clips use.
    pub cameras: Vec<Camera>,
    /// Behind everything (sRGB).
    pub background: [f32; 3],
    /// What must lie inside the shadow map: centre and radius, metres.
    pub focus: ([f32; 3], f32),
}

/// One moment: where each body is; index 0 is the world and stays at the identity. `[n_bodies]`
pub type Frame = Vec<Transform>;
