// A ray as it lies in memory: start.xyz and whole steps, delta.xyz and the rest's length in steps, the rest's middle.
struct Ray {
    start: vec3<f32>,
    steps: u32,
    delta: vec3<f32>,
    rest: f32,
    rest_at: vec3<f32>,
}
const RAY_WORDS = 3u;
