// Lights one shape: a key light with a shadow, two fill lights and a light at the eye.
// The vertex formula is explained in server/render/src/mesh.rs.

struct View {
    camera: mat4x4f,
    // World to the shadow map's clip space.
    light: mat4x4f,
    eye: vec4f,
    // x: metres that a shadow's test point is lifted off its surface.
    shadow: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var shadow_map: texture_depth_2d;
@group(0) @binding(2) var shadow_sampler: sampler_comparison;

// One pipeline per look, so that no pixel pays for a look it does not have.
const PLAIN: u32 = 0;
const WOOD: u32 = 1;
const TILES: u32 = 2;
const GRID: u32 = 3;
const CHECKER: u32 = 4;
const MARKER: u32 = 5;
const GLASS: u32 = 6;
const VEIL: u32 = 7;
override LOOK: u32 = 0;

struct Vertex {
    @location(0) unit: vec3f,
    @location(1) other_and_lift: vec4f,
    @location(2) normal: vec3f,
    @location(3) rotation: vec4f,
    @location(4) position: vec4f,
    @location(5) size: vec4f,
    @location(6) other_size: vec4f,
    @location(7) color: vec4f,
}

struct Fragment {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    @location(1) to_eye: vec3f,
    @location(2) shadow: vec3f,
    @location(3) surface: vec2f,
    @location(4) @interpolate(flat) color: vec4f,
}

fn rotate(q: vec4f, v: vec3f) -> vec3f {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

@vertex
fn vertex(v: Vertex) -> Fragment {
    var local = v.unit * v.size.xyz + v.other_and_lift.xyz * v.other_size.xyz;
    local.z += v.other_and_lift.w * v.size.w;
    let world = v.position.xyz + rotate(v.rotation, local);
    var out: Fragment;
    out.clip = view.camera * vec4f(world, 1.0);
    out.normal = rotate(v.rotation, v.normal);
    out.to_eye = view.eye.xyz - world;
    let lit = view.light * vec4f(world + out.normal * view.shadow.x, 1.0);
    out.shadow = vec3f(lit.xy * vec2f(0.5, -0.5) + 0.5, lit.z);
    let facing = abs(v.normal);
    if facing.z > 0.5 {
        out.surface = local.xy;
    } else if facing.y > 0.5 {
        out.surface = local.xz;
    } else {
        out.surface = local.yz;
    }
    out.color = v.color;
    return out;
}

// A number in [0, 1) that looks random.
fn scatter(p: vec2f) -> f32 {
    return fract(sin(dot(p, vec2f(12.9898, 78.233))) * 43758.547);
}

fn wood(p: vec2f) -> f32 {
    let board = floor(p.y / 0.1);
    let across = p.y / 0.1 - board;
    let tone = scatter(vec2f(board, 3.0));
    let wave = sin(p.x * 5.0 + tone * 40.0) + 0.5 * sin(p.x * 11.0 + tone * 90.0);
    let grain = sin(across * 21.0 + wave * 0.9 + tone * 6.0);
    let joint = smoothstep(0.0, 0.03, min(across, 1.0 - across));
    return (0.82 + 0.26 * tone + 0.07 * grain) * (0.72 + 0.28 * joint);
}

fn tiles(p: vec2f) -> f32 {
    let cell = floor(p);
    let inside = abs(p - cell - 0.5);
    let edge = 0.5 - max(inside.x, inside.y);
    let blur = fwidth(p.x) + fwidth(p.y);
    let joint = smoothstep(0.006 - blur * 0.5, 0.010 + blur, edge);
    return (0.96 + 0.06 * scatter(cell)) * (1.0 - 0.16 * (1.0 - joint));
}

fn grid(p: vec2f) -> f32 {
    let q = p / 0.25;
    let from_line = (0.5 - abs(fract(q) - 0.5)) * 0.25;
    let blur = fwidth(p);
    let lines = 1.0 - smoothstep(vec2f(0.003) , vec2f(0.004) + blur * 1.2, from_line);
    return 1.0 - 0.16 * max(lines.x, lines.y);
}

// Squares that fade into their mean where a pixel covers many.
fn checker(p: vec2f) -> f32 {
    let blur = max(fwidth(p), vec2f(1e-4));
    let wave = abs(fract(p * 0.5) - 0.5) * 2.0 - 0.5;
    let side = clamp(wave / blur, vec2f(-0.5), vec2f(0.5)) * 2.0;
    let far = smoothstep(0.3, 1.0, max(blur.x, blur.y));
    return 0.86 + 0.14 * side.x * side.y * (1.0 - far);
}

// 1 in the light, 0 in the shadow.
fn sunlit(p: vec3f) -> f32 {
    let outside = any(p.xy < vec2f(0.0)) || any(p > vec3f(1.0));
    let lit = textureSampleCompareLevel(shadow_map, shadow_sampler, p.xy, p.z);
    return select(lit, 1.0, outside);
}

fn encode(c: vec3f) -> vec3f {
    let low = c * 12.92;
    let high = 1.055 * pow(c, vec3f(1.0 / 2.4)) - 0.055;
    return select(high, low, c <= vec3f(0.0031308));
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4f {
    if LOOK == MARKER || LOOK == VEIL {
        return vec4f(encode(in.color.rgb), in.color.a);
    }
    var base = in.color.rgb;
    if LOOK == WOOD {
        base *= wood(in.surface);
    }
    if LOOK == TILES {
        base *= tiles(in.surface);
    }
    if LOOK == GRID {
        base *= grid(in.surface);
    }
    if LOOK == CHECKER {
        base *= checker(in.surface);
    }
    let n = normalize(in.normal);
    let v = normalize(in.to_eye);
    // Towards the lights of the reference scenes.
    let key = vec3f(0.57735, -0.57735, 0.57735);
    let left = vec3f(-0.57735, -0.57735, 0.57735);
    let behind = vec3f(0.0, 0.70711, 0.70711);
    let lit = sunlit(in.shadow);
    // A level surface in full light shows its own colour.
    let sky = 0.22 + 0.06 * n.z;
    let fill = 0.16 * max(dot(n, left), 0.0) + 0.12 * max(dot(n, behind), 0.0)
        + 0.18 * max(dot(n, v), 0.0);
    let sun = 0.80 * max(dot(n, key), 0.0) * lit;
    // (n · h)^32 for the key light.
    let h = max(dot(n, normalize(key + v)), 0.0);
    let h4 = h * h * h * h;
    let h16 = h4 * h4 * h4 * h4;
    let gloss = 0.22 * h16 * h16 * lit;
    let light = base * (sky + fill + sun) + gloss;
    return vec4f(encode(min(light, vec3f(1.0))), in.color.a);
}
