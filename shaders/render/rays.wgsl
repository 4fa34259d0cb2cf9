// Makes the rays of a part of a picture in f64, as Camera::ray does: in f32 a start can be 1.4e-4 voxel off.
//#include shared/ray.wgsl
// One lane a pixel.

@group(0) @binding(0) var<storage, read> camera: array<f64>;
@group(0) @binding(1) var<storage, read> picture: array<u32>; // width, height, perspective; voxels along each axis; of the part first column, first row, columns, rows
@group(0) @binding(2) var<storage, read_write> rays: array<vec4<u32>>;

fn triple(i: u32) -> vec3<f64> {
    return vec3<f64>(camera[i], camera[i + 1u], camera[i + 2u]);
}

fn words(v: vec3<f64>, w: u32) -> vec4<u32> {
    return vec4<u32>(bitcast<u32>(f32(v.x)), bitcast<u32>(f32(v.y)), bitcast<u32>(f32(v.z)), w);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pixel = id.x + id.y * groups.x * 64u;
    let columns = picture[8];
    if (pixel >= columns * picture[9]) {
        return;
    }
    let x = f64(picture[6] + pixel % columns);
    let y = f64(picture[7] + pixel / columns);
    let distance = camera[12];
    let size = camera[13];
    let step = camera[14];
    let across = (x - 0.5lf * (f64(picture[0]) - 1.0lf)) * size;
    let upward = (0.5lf * (f64(picture[1]) - 1.0lf) - y) * size;
    let to_pixel = triple(3u) * across + triple(6u) * upward;
    var eye = triple(0u) + to_pixel;
    var direction = triple(9u);
    if (picture[2] != 0u) {
        let length = sqrt(across * across + upward * upward + distance * distance);
        eye = triple(0u);
        direction = (to_pixel + triple(9u) * distance) / length;
    }
    var near = 0.0lf;
    var far = 1.0e300lf;
    var misses = false;
    for (var a = 0u; a < 3u; a++) {
        let high = f64(picture[3u + a]) - 0.5lf;
        if (abs(direction[a]) < 1.0e-12lf) {
            misses = misses || eye[a] < -0.5lf || eye[a] > high;
        } else {
            let t0 = (-0.5lf - eye[a]) / direction[a];
            let t1 = (high - eye[a]) / direction[a];
            near = max(near, min(t0, t1));
            far = min(far, max(t0, t1));
        }
    }
    let at = pixel * RAY_WORDS;
    if (misses || far >= 1.0e300lf || near >= far) {
        rays[at] = vec4<u32>(0u);
        rays[at + 1u] = vec4<u32>(0u);
        rays[at + 2u] = vec4<u32>(0u);
        return;
    }
    let whole = floor((far - near) / step + 1.0e-9lf);
    let rest = max(far - near - whole * step, 0.0lf);
    var share = 0.0f;
    if (rest > 1.0e-6lf * step) {
        share = f32(rest / step);
    }
    rays[at] = words(eye + (near + 0.5lf * step) * direction, u32(f32(whole)));
    rays[at + 1u] = words(direction * step, bitcast<u32>(share));
    rays[at + 2u] = words(eye + (far - 0.5lf * rest) * direction, 0u);
}
