// The stored voxels, sampled trilinearly: samples.rs.

// Whether a voxel that isn't finite was met since this was last set to false.
var<private> missing: bool;

struct Place {
    cell: vec3<u32>,
    within: vec3<f32>,
}

// A product that isn't joined with the sum that it goes into: a driver may round the two as one, and a sample would be taken elsewhere than
// where the processor takes it. The word is 0, which no driver knows.
fn product(a: f32, b: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(a * b) ^ params.part.w);
}

fn product3(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(a * b) ^ vec3<u32>(params.part.w));
}

fn product4(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(bitcast<vec4<u32>>(a * b) ^ vec4<u32>(params.part.w));
}

fn blend(a: f32, b: f32, f: f32) -> f32 {
    return a + product(b - a, f);
}

fn blend3(a: vec3<f32>, b: vec3<f32>, f: f32) -> vec3<f32> {
    return a + product3(b - a, vec3<f32>(f));
}

fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    let p = product3(a, b);
    return p.x + p.y + p.z;
}

// The number in 0 ..= top nearest to x; 0 for none.
fn clamped(x: vec3<f32>, top: vec3<f32>) -> vec3<f32> {
    let low = select(vec3<f32>(0.0), x, x > vec3<f32>(0.0));
    return select(top, low, low < top);
}

fn place_of(at: vec3<f32>) -> Place {
    let cell = vec3<u32>(clamped(at, params.top.xyz));
    return Place(cell, clamped(at, params.end.xyz) - vec3<f32>(cell));
}

fn voxel(i: u32) -> f32 {
//#if U8
    return f32((volume[i >> 2u] >> ((i & 3u) * 8u)) & 0xffu);
//#end
//#if U16
    return f32((volume[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu);
//#end
//#if I16
    return f32(bitcast<i32>(volume[i >> 1u] << (16u - (i & 1u) * 16u)) >> 16u);
//#end
//#if F32
    let word = volume[i];
    missing = missing || (word & 0x7f800000u) == 0x7f800000u;
    return bitcast<f32>(word);
//#end
}

fn linear(v: vec3<u32>) -> u32 {
    return v.x + params.dims.x * (v.y + params.dims.y * v.z);
}

// Distance in memory to the next voxel along each axis, 0 along an axis of one voxel.
fn strides() -> vec3<u32> {
    return params.next.xyz;
}

fn row_value(i: u32, next: u32, f: f32) -> f32 {
    return blend(voxel(i), voxel(i + next), f);
}

// Trilinear value; sets `missing` where the cell touches missing data.
fn value_at(p: Place) -> f32 {
    let d = strides();
    let i = linear(p.cell);
    let low = blend(row_value(i, d.x, p.within.x), row_value(i + d.y, d.x, p.within.x), p.within.y);
    let j = i + d.z;
    let high = blend(row_value(j, d.x, p.within.x), row_value(j + d.y, d.x, p.within.x), p.within.y);
    let value = blend(low, high, p.within.z);
//#if F32
    // Differences of great numbers aren't finite either.
    missing = missing || (bitcast<u32>(value) & 0x7f800000u) == 0x7f800000u;
//#end
    return value;
}

fn value_with(at: vec3<f32>, axis: u32, coordinate: f32) -> f32 {
    var there = at;
    there[axis] = coordinate;
    return value_at(place_of(there));
}

fn rise(i: u32, d: u32) -> f32 {
    return 0.5 * (voxel(i + 2u * d) - voxel(i));
}

// Gradient per voxel, central over two voxels, one-sided at the sides; sets `missing` beside missing data.
fn gradient_at(at: vec3<f32>) -> vec3<f32> {
    let p = place_of(at);
    // One below the first cell wraps round to a great number.
    let deep = p.cell - vec3<u32>(1u) < max(params.dims.xyz, vec3<u32>(3u)) - vec3<u32>(3u);
    if (all(deep)) {
        let d = strides();
        let f = p.within;
        let i = linear(p.cell);
        let x0 = i - d.x;
        let y0 = i - d.y;
        let z0 = i - d.z;
        let gx = blend(
            blend(blend(rise(x0, d.x), rise(x0 + d.x, d.x), f.x), blend(rise(x0 + d.y, d.x), rise(x0 + d.y + d.x, d.x), f.x), f.y),
            blend(blend(rise(x0 + d.z, d.x), rise(x0 + d.z + d.x, d.x), f.x), blend(rise(x0 + d.z + d.y, d.x), rise(x0 + d.z + d.y + d.x, d.x), f.x), f.y),
            f.z,
        );
        let gy = blend(
            blend(blend(rise(y0, d.y), rise(y0 + d.y, d.y), f.y), blend(rise(y0 + d.x, d.y), rise(y0 + d.x + d.y, d.y), f.y), f.x),
            blend(blend(rise(y0 + d.z, d.y), rise(y0 + d.z + d.y, d.y), f.y), blend(rise(y0 + d.z + d.x, d.y), rise(y0 + d.z + d.x + d.y, d.y), f.y), f.x),
            f.z,
        );
        let gz = blend(
            blend(blend(rise(z0, d.z), rise(z0 + d.z, d.z), f.z), blend(rise(z0 + d.x, d.z), rise(z0 + d.x + d.z, d.z), f.z), f.x),
            blend(blend(rise(z0 + d.y, d.z), rise(z0 + d.y + d.z, d.z), f.z), blend(rise(z0 + d.y + d.x, d.z), rise(z0 + d.y + d.x + d.z, d.z), f.z), f.x),
            f.y,
        );
        return vec3<f32>(gx, gy, gz);
    }
    var gradient = vec3<f32>(0.0);
    for (var a = 0u; a < 3u; a++) {
        let top = f32(params.dims[a] - 1u);
        let here = min(max(at[a], 0.0), top);
        let below = max(here - 1.0, 0.0);
        let above = min(here + 1.0, top);
        if (above > below) {
            gradient[a] = (value_with(at, a, above) - value_with(at, a, below)) / (above - below);
        }
    }
    return gradient;
}

// The voxel nearest to a place.
fn nearest(p: Place) -> u32 {
    let up = select(vec3<u32>(0u), strides(), p.within >= vec3<f32>(0.5));
    return linear(p.cell) + up.x + up.y + up.z;
}
