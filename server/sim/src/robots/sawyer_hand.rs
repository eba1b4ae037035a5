//! Sawyer's hand as MetaWorld's tasks feel it: a body that follows a target, and two fingers.
//!
//! The arm itself is not simulated; pictures find its joints by inverse kinematics. Each
//! control step moves the target by at most 1 cm per axis; the hand follows it about four
//! steps behind, as a mass on a damped spring of 8180 N/m.
//!
//! Differs from the original: the hand never tilts (there up to 4° in free motion, 2.3° per N·m), one gain
//! serves all directions, what pushes a finger reaches the hand whole, however the finger
//! gives way, and the 3 mm of a finger behind its pad have the pad's friction of 2 (there 1, which
//! is felt where the back of the fist hooks something, as in door-open).
//! Source: METAWORLD.md 1.1, 1.5, 1.6.

use domain::scene::{Geometry, Material, Shape, Transform};
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::sawyer_fingers::Fingers;
use super::tabletop::{self, Layer};
use crate::tasks::metaworld::{self, Point, plus};

/// Metres that a full action moves the target in one control step.
const ACTION_SCALE_M: f64 = 0.01;
/// Pull towards the target, s⁻², and drag, s⁻¹, both held for one control step.
/// Fitted to the step response in METAWORLD.md 1.6 (0.5 mm rms of 100 mm).
const PULL: f64 = 900.0;
const DRAG: f64 = 55.0;
/// What the hand yields to a steady force (0.122 mm/N).
const STIFFNESS_N_PER_M: f64 = 8180.0;
/// The mass that gives this stiffness with this pull.
const MASS_KG: f64 = STIFFNESS_N_PER_M / PULL;
/// The arm's weight pulls the hand this far below its target.
const SAG: Point = [0.0, 0.0, -0.0038];
/// After a reset the hand settles with this time constant, in control steps.
const SETTLING_STEPS: f64 = 20.0;
/// From here on the arm is stretched: of every metre further out the hand follows a third.
const REACH_M: f64 = 0.89;
const STRETCH: f64 = 0.35;
const SHOULDER: Point = [0.0, 0.0, 0.317];
/// How far a hard pull stretches the arm.
const STRAIGHT_M: f64 = 0.93;
/// Where the step response was measured.
const MEASURED_AT: Point = [0.0, 0.6, 0.2];
/// Bounds the drag of a stretched arm: a step of 12.5 ms would not carry more, m².
const LEAST_SQUARE_LEFT: f64 = 0.2;
/// Half extents of the gripper's body, whose edges are rounded.
const PALM_HALF_M: [f32; 3] = [0.033, 0.053, 0.027];
const PALM_EDGE_M: f32 = 0.02;
/// From a finger's mounting to the origin of its pad, metres.
const PAD_M: f64 = 0.003;

/// Where a task's hand starts and may go.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandRange {
    /// Target at reset, metres.
    pub home: Point,
    /// The hand at reset minus the target: the arm has not settled yet, metres.
    pub unsettled: Point,
    /// Least target, metres.
    pub lower: Point,
    /// Greatest target, metres.
    pub upper: Point,
}

impl HandRange {
    /// Near the robot, above the table: window-open, window-close.
    pub const NEAR: Self = Self {
        home: [0.0, 0.4, 0.2],
        unsettled: [0.005_91, -0.000_30, -0.005_02],
        lower: [-0.5, 0.40, 0.05],
        upper: [0.5, 1.0, 0.5],
    };
    /// Over the middle of the table: door-open, drawer-open, sweep-into.
    pub const FAR: Self = Self {
        home: [0.0, 0.6, 0.2],
        unsettled: [0.006_15, 0.000_19, -0.005_70],
        ..Self::NEAR
    };
    /// This range, but as far down as the table itself lets the hand: door-unlock, faucet-open.
    #[must_use]
    pub const fn deep(self) -> Self {
        let [x, y, _] = self.lower;
        Self {
            lower: [x, y, -0.15],
            ..self
        }
    }
}

/// The hand of one episode; its body lives in the world it was built into.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SawyerHand {
    body: RigidBodyHandle,
    /// Right, left.
    finger_colliders: [ColliderHandle; 2],
    fingers: Fingers,
    /// What pushes the right and the left finger along y, newtons.
    finger_forces: [f64; 2],
    range: HandRange,
    target: Point,
    command: f64,
    n_steps: u32,
}

impl SawyerHand {
    /// Puts a hand at its home, with open fingers and not yet settled.
    pub fn new(world: &mut PhysicsWorld, range: HandRange) -> Self {
        let start = plus(range.home, range.unsettled);
        let body = RigidBodyBuilder::dynamic()
            .translation(vector(start))
            .lock_rotations()
            .additional_mass(MASS_KG as f32)
            .gravity_scale(0.0)
            .can_sleep(false);
        let body = world.insert_body(body);
        let [x, y, z] = PALM_HALF_M.map(|half| half - PALM_EDGE_M);
        let palm = ColliderBuilder::round_cuboid(x, y, z, PALM_EDGE_M);
        let palm = tabletop::collider(palm, [-0.009, 0.0, 0.066], Layer::Hand).density(0.0);
        world.insert_collider(palm, Some(body));
        let fingers = Fingers::open();
        let finger_colliders = finger_centres(&fingers).map(|centre| {
            let finger = ColliderBuilder::cuboid(0.015, 0.0045, 0.045);
            let finger = tabletop::collider(finger, centre, Layer::Hand)
                .density(0.0)
                .friction(2.0);
            world.insert_collider(finger, Some(body))
        });
        Self {
            body,
            finger_colliders,
            fingers,
            finger_forces: [0.0; 2],
            range,
            target: range.home,
            command: -1.0,
            n_steps: 0,
        }
    }

    /// Takes an action in [−1, 1]⁴ (three increments of the target, the gripper command) and
    /// sets the forces of the coming control step; the caller then steps the world.
    pub fn drive(&mut self, world: &mut PhysicsWorld, action: [f64; 4]) {
        let HandRange { lower, upper, .. } = self.range;
        self.target = std::array::from_fn(|i| {
            (self.target[i] + ACTION_SCALE_M * action[i]).clamp(lower[i], upper[i])
        });
        self.command = action[3];
        self.fingers.advance(self.command, self.finger_forces);
        for (handle, centre) in self
            .finger_colliders
            .iter()
            .zip(finger_centres(&self.fingers))
        {
            world.colliders[*handle]
                .set_position_wrt_parent(Pose::from_translation(Vector::from(centre)));
        }

        let rest = self.rest();
        let out = outwards(self.position(world));
        self.n_steps += 1;
        let body = &mut world.bodies[self.body];
        let velocity = body.linvel();
        let (direction, drag) = (vector(out.direction), (out.drag - 1.0) as f32);
        let dragged = velocity + direction * (drag * direction.dot(velocity));
        let force = (vector(rest) - body.translation()) * (PULL * MASS_KG) as f32
            - dragged * (DRAG * MASS_KG) as f32;
        body.reset_forces(true);
        body.add_force(force, true);
    }

    /// Notes how hard the last step's contacts push the fingers, which give way to it in the next.
    pub fn feel(&mut self, world: &PhysicsWorld) {
        self.finger_forces = self
            .finger_colliders
            .map(|finger| f64::from(contact_force(world, finger).y));
    }

    /// Where the hand would come to rest, untouched.
    fn rest(&self) -> Point {
        let left = (-f64::from(self.n_steps) / SETTLING_STEPS).exp();
        let reached = within_reach(self.target);
        std::array::from_fn(|i| reached[i] + SAG[i] + left * (self.range.unsettled[i] - SAG[i]))
    }

    /// Origin of the hand's frame, between the fingers' mountings; metres.
    pub fn position(&self, world: &PhysicsWorld) -> Point {
        let p = world.bodies[self.body].translation();
        [f64::from(p.x), f64::from(p.y), f64::from(p.z)]
    }

    /// The point between the fingertips; metres.
    pub fn fingertips(&self, world: &PhysicsWorld) -> Point {
        let between = f64::midpoint(self.fingers.right(), self.fingers.left());
        plus(self.position(world), [0.0, between, -0.045])
    }

    /// 1 open, 0.2967 closed on nothing.
    pub fn openness(&self) -> f64 {
        let right = [0.0, -0.05 + self.fingers.right(), 0.0];
        let left = [0.0, 0.05 + self.fingers.left(), 0.0];
        metaworld::openness(left, right)
    }

    /// Where the inner pads of the left and the right finger are, metres along y.
    pub fn pads(&self, world: &PhysicsWorld) -> [f64; 2] {
        let y = self.position(world)[1];
        [
            y + 0.05 + self.fingers.left() - PAD_M,
            y - 0.05 + self.fingers.right() + PAD_M,
        ]
    }

    /// The gripper command of the last step: +1 closes, −1 opens, as at the reset.
    pub fn command(&self) -> f64 {
        self.command
    }

    /// Whether palm or fingers are in contact with anything.
    pub fn touches(&self, world: &PhysicsWorld) -> bool {
        let colliders = world.bodies[self.body].colliders().iter();
        colliders
            .flat_map(|collider| world.contact_pairs_with(*collider))
            .any(ContactPair::has_any_active_contact)
    }

    /// Both fingers.
    pub fn fingers(&self) -> &Fingers {
        &self.fingers
    }
}

/// Away from the shoulder.
struct Outwards {
    /// Unit vector.
    direction: Point,
    /// How much harder the hand moves along it than where its drag was measured; 1 or more.
    drag: f64,
}

/// The drag of the arm's damped joints grows the straighter it is.
///
/// Two links of half the reach `R` that hold the hand at distance `r` turn their elbow by
/// `2 / √(R² − r²)` radians for each metre outwards, so that their damping acts on the hand with
/// the square of that.
fn outwards(hand: Point) -> Outwards {
    let square_left = |distance: f64| STRAIGHT_M * STRAIGHT_M - distance * distance;
    let distance = metaworld::distance(hand, SHOULDER);
    let measured = square_left(metaworld::distance(MEASURED_AT, SHOULDER));
    Outwards {
        direction: metaworld::minus(hand, SHOULDER).map(|x| x / distance),
        drag: (measured / square_left(distance).max(LEAST_SQUARE_LEFT)).max(1.0),
    }
}

/// Draws a target that the arm cannot reach closer to the shoulder.
fn within_reach(target: Point) -> Point {
    let out: Point = std::array::from_fn(|i| target[i] - SHOULDER[i]);
    let distance = metaworld::distance(target, SHOULDER);
    if distance <= REACH_M {
        return target;
    }
    let scale = (REACH_M + STRETCH * (distance - REACH_M)) / distance;
    std::array::from_fn(|i| SHOULDER[i] + scale * out[i])
}

/// What the contacts of a collider exerted on it in the last step, newtons.
fn contact_force(world: &PhysicsWorld, collider: ColliderHandle) -> Vector {
    let parameters = &world.integration_parameters;
    let substep_s = parameters.dt / parameters.num_solver_iterations as f32;
    let mut force = Vector::ZERO;
    for pair in world.contact_pairs_with(collider) {
        let is_first = pair.collider1 == collider;
        let other = if is_first {
            pair.collider2
        } else {
            pair.collider1
        };
        let is_jointed = world.colliders[other]
            .parent()
            .is_some_and(|body| world.multibody_joints.rigid_body_link(body).is_some());
        // Between plain bodies rapier has one friction per manifold, told by each of its points.
        let n_frictions = if is_jointed { usize::MAX } else { 1 };
        let mut on_first = Vector::ZERO;
        for manifold in pair.solver_manifolds() {
            let points = || manifold.points.iter().map(|point| &point.data);
            let normal = points().map(|data| data.impulse).sum::<f32>();
            on_first -= manifold.data.normal * (normal / parameters.dt);
            for data in points().take(n_frictions) {
                on_first += data.warmstart_tangent_world / substep_s;
            }
        }
        force += if is_first { on_first } else { -on_first };
    }
    force
}

/// Centres of the right and the left finger's box in the hand's frame (world axes), metres.
fn finger_centres(fingers: &Fingers) -> [[f32; 3]; 2] {
    [
        [0.0, (-0.0485 + fingers.right()) as f32, 0.0],
        [0.0, (0.0485 + fingers.left()) as f32, 0.0],
    ]
}

fn vector(p: Point) -> Vector {
    Vector::new(p[0] as f32, p[1] as f32, p[2] as f32)
}

/// Bodies that [`place`] gives and [`shapes`] uses: the world, the hand, both fingers.
pub const N_BODIES: usize = 4;
/// The hand's body in a scene.
pub const HAND_BODY: usize = 1;
/// Numbers of a pose that belong to the hand: its position, the right and the left finger.
pub const POSE_SIZE: usize = 5;

/// The hand's part of a pose.
pub fn pose(hand: &SawyerHand, world: &PhysicsWorld) -> [f32; POSE_SIZE] {
    let [x, y, z] = hand.position(world);
    [x, y, z, hand.fingers.right(), hand.fingers.left()].map(|v| v as f32)
}

/// The world, the hand (its x axis down, as the arm holds it) and the fingers of a pose.
pub fn place(pose: &[f32]) -> [Transform; N_BODIES] {
    let (x, y, z) = (pose[0], pose[1], pose[2]);
    let hand = Transform::at(x, y, z).turned([0.0, 1.0, 0.0], std::f32::consts::FRAC_PI_2);
    [
        Transform::IDENTITY,
        hand,
        Transform::at(x, y - 0.0485 + pose[3], z),
        Transform::at(x, y + 0.0485 + pose[4], z),
    ]
}

/// Palm, rail, the white right and the cyan left finger, red fingertips.
pub fn shapes() -> Vec<Shape> {
    let upright = Transform::IDENTITY.turned([0.0, 1.0, 0.0], -std::f32::consts::FRAC_PI_2);
    let cuboid = |body, local, half, material| Shape {
        body,
        local,
        geometry: Geometry::Cuboid { half },
        material,
    };
    let palm = upright.then(Transform::at(-0.009, 0.0, 0.066));
    let rail = upright.then(Transform::at(0.0, 0.0, 0.05));
    let mut shapes = vec![
        cuboid(HAND_BODY, palm, PALM_HALF_M, Material::plain(0.5, 0.1, 0.1)),
        cuboid(
            HAND_BODY,
            rail,
            [0.005, 0.055, 0.005],
            Material::plain(0.5, 0.5, 0.5),
        ),
    ];
    let colors = [
        Material::plain(0.95, 0.95, 0.95),
        Material::plain(0.0, 0.85, 0.85),
    ];
    for (body, material) in (2..).zip(colors) {
        let half = [0.015, 0.0045, 0.045];
        shapes.push(cuboid(body, Transform::IDENTITY, half, material));
        shapes.push(Shape {
            body,
            local: Transform::at(0.0, 0.0, -0.045),
            geometry: Geometry::Sphere { radius: 0.01 },
            material: Material::plain(0.85, 0.1, 0.1),
        });
    }
    shapes
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACROSS: HandRange = HandRange {
        home: [0.0, 0.6, 0.2],
        ..HandRange::NEAR
    };

    fn settled() -> (PhysicsWorld, SawyerHand) {
        let mut world = tabletop::world().physics;
        let mut hand = SawyerHand::new(&mut world, ACROSS);
        advance(&mut world, &mut hand, [0.0; 4], 150);
        (world, hand)
    }

    fn advance(world: &mut PhysicsWorld, hand: &mut SawyerHand, action: [f64; 4], n: usize) {
        for _ in 0..n {
            hand.drive(world, action);
            world.step();
            hand.feel(world);
        }
    }

    /// METAWORLD.md 1.6, v2: mm after each control step, ten of full action, then none; the
    /// mean of ±x, ±y and ±z.
    const STEP_RESPONSE_MM: [f64; 20] = [
        0.65, 2.9, 6.9, 12.4, 19.2, 26.9, 35.3, 44.2, 53.5, 62.9, 71.8, 79.2, 84.9, 89.1, 92.1,
        94.1, 95.4, 96.3, 96.9, 97.3,
    ];

    fn step_response_mm(axis: usize, sign: f64) -> [f64; 20] {
        let (mut world, mut hand) = settled();
        let start = hand.position(&world)[axis];
        std::array::from_fn(|t| {
            let mut action = [0.0; 4];
            action[axis] = if t < 10 { sign } else { 0.0 };
            advance(&mut world, &mut hand, action, 1);
            sign * (hand.position(&world)[axis] - start) * 1000.0
        })
    }

    fn rms_error_mm(response: &[f64; 20]) -> f64 {
        let pairs = response.iter().zip(&STEP_RESPONSE_MM);
        (pairs
            .map(|(ours, theirs)| (ours - theirs).powi(2))
            .sum::<f64>()
            / 20.0)
            .sqrt()
    }

    #[test]
    fn a_settled_hand_follows_ten_full_steps_as_recorded() {
        let mut mean = [0.0; 20];
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let response = step_response_mm(axis, sign);
                let rms = rms_error_mm(&response);
                // Outwards the arm follows with a slow tail of 3 to 8 mm.
                let bound = if (axis, sign) == (1, 1.0) { 4.0 } else { 1.0 };
                assert!(rms < bound, "axis {axis}, sign {sign}: {rms} mm rms");
                for (mean, moved) in mean.iter_mut().zip(response) {
                    *mean += moved / 6.0;
                }
            }
        }
        let rms = rms_error_mm(&mean);
        assert!(rms < 1.0, "mean of all directions: {rms} mm rms");
    }

    #[test]
    fn a_hand_left_alone_settles_just_below_its_target() {
        let (world, hand) = settled();
        let off = metaworld::distance(hand.position(&world), [0.0, 0.6, 0.1962]);
        assert!(off < 0.0003, "{off} m");
    }

    #[test]
    fn a_target_beyond_the_arm_only_stretches_it() {
        let reached = within_reach([0.0, 0.9, 0.2]);
        assert!((reached[1] - 0.886).abs() < 0.005, "{reached:?}");
        let reached = within_reach([0.25, 1.0, 0.2]);
        assert!((reached[0] - 0.226).abs() < 0.005 && (reached[1] - 0.905).abs() < 0.01);
        let near = [0.0, 0.8, 0.2];
        assert!(metaworld::distance(within_reach(near), near) < 1e-12);
    }

    #[test]
    fn a_steady_push_of_100_newtons_moves_the_hand_by_12_millimetres() {
        let (mut world, mut hand) = settled();
        let start = hand.position(&world)[1];
        for _ in 0..100 {
            hand.drive(&mut world, [0.0; 4]);
            world.bodies[hand.body].add_force(Vector::new(0.0, 100.0, 0.0), true);
            world.step();
        }
        let moved_mm = (hand.position(&world)[1] - start) * 1000.0;
        assert!((moved_mm - 12.2).abs() < 0.3, "{moved_mm} mm");
    }

    /// The hand pressed onto the table and dragged along it: friction of 2 pulls both fingers
    /// back with more than their springs hold.
    #[test]
    fn a_fist_dragged_over_the_table_opens_its_trailing_finger() {
        let mut world = tabletop::world().physics;
        tabletop::add_table(&mut world);
        let mut hand = SawyerHand::new(&mut world, ACROSS.deep());
        advance(&mut world, &mut hand, [0.0, 0.0, -1.0, 0.7], 24);
        let closed = hand.fingers.right();
        assert!((0.02..0.045).contains(&closed), "{closed}");
        advance(&mut world, &mut hand, [0.0, 1.0, 0.0, 0.7], 20);
        assert!(hand.fingers.right() < closed - 0.01, "{:?}", hand.fingers);
        assert!(
            (hand.fingers.left() + 0.03).abs() < 0.001,
            "{:?}",
            hand.fingers
        );
    }

    #[test]
    fn the_hand_frame_points_down_and_the_palm_sits_above_the_fingers() {
        let placed = place(&[0.1, 0.5, 0.2, 0.04, -0.03]);
        let palm = placed[HAND_BODY].then(shapes()[0].local);
        assert!((palm.position[2] - 0.266).abs() < 1e-6, "{palm:?}");
        assert!((placed[2].position[1] - 0.4915).abs() < 1e-6);
        assert!((placed[3].position[1] - 0.5185).abs() < 1e-6);
    }
}
