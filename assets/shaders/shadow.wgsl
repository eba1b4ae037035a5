// Depth of one shape as the key light sees it.

@group(0) @binding(0) var<uniform> light: mat4x4f;

struct Vertex {
    @location(0) unit: vec3f,
    @location(1) other_and_lift: vec4f,
    @location(3) rotation: vec4f,
    @location(4) position: vec4f,
    @location(5) size: vec4f,
    @location(6) other_size: vec4f,
}

fn rotate(q: vec4f, v: vec3f) -> vec3f {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

@vertex
fn vertex(v: Vertex) -> @builtin(position) vec4f {
    var local = v.unit * v.size.xyz + v.other_and_lift.xyz * v.other_size.xyz;
    local.z += v.other_and_lift.w * v.size.w;
    return light * vec4f(v.position.xyz + rotate(v.rotation, local), 1.0);
}
