// Voxels of the bricks that move, each from where it was before: ivd-field's row.rs, in f64, operation for operation, so that both give the same
// bytes. A workgroup makes half a brick of 8³, a lane a voxel. What needs more than eight voxels of data, or has to do with numbers so small that a device may take them for 0, is left to the
// processor, and marked.

struct Params {
    number: u32,
    nx: u32,
    ny: u32,
    nz: u32,
    across: u32, // bricks along x and y
    down: u32,
    first: u32,  // the first brick of this part, and how many there are
    bricks: u32,
    zero: u32,   // 0, which no driver knows
}

@group(0) @binding(0) var<storage, read> params: Params;
@group(0) @binding(2) var<storage, read> volume: array<u32>;
@group(0) @binding(3) var<storage, read> numbers: array<f64>; // rows of the world-to-voxel matrix; of each axis above what coordinate there's no room
@group(0) @binding(4) var<storage, read> places: array<u32>;  // of each brick that is stored, which it is
@group(0) @binding(5) var<storage, read> vectors: array<f32>;
@group(0) @binding(6) var<storage, read_write> moved: array<u32>; // of each brick its voxels, as they are stored; then 16 words of marks

//#include shared/pass.wgsl

//#if BYTES
const BRICK_WORDS = 128u;
//#end
//#if HALVES
const BRICK_WORDS = 256u;
//#end
//#if F32
const BRICK_WORDS = 512u;
//#end

// The exponent of 2⁻¹²⁵.
const LEAST = 0x38200000u;
// Words of half a brick.
const HALF = BRICK_WORDS / 2u;
const SNAP = 0.00000762939453125lf; // 2⁻¹⁷ exactly

var<workgroup> marks: array<atomic<u32>, 8>;
//#if F32
//#else
// The voxels, as they are stored.
var<workgroup> made: array<atomic<u32>, HALF>;
//#end

// Whether a value was met that a device may take for 0, or one that isn't finite.
var<private> odd: bool;

// A number that no driver joins with the sum that it goes into.
fn own(x: f64) -> f64 {
    return bitcast<f64>(bitcast<u64>(x) ^ u64(params.zero));
}

fn voxel(i: u32) -> f64 {
//#if U8
    return f64((volume[i >> 2u] >> ((i & 3u) * 8u)) & 0xffu);
//#end
//#if I8
    return f64(bitcast<i32>(volume[i >> 2u] << (24u - (i & 3u) * 8u)) >> 24u);
//#end
//#if U16
    return f64((volume[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu);
//#end
//#if I16
    return f64(bitcast<i32>(volume[i >> 1u] << (16u - (i & 1u) * 16u)) >> 16u);
//#end
//#if F32
    let word = volume[i];
    let size = word & 0x7f800000u;
    odd = odd || size == 0x7f800000u || (size == 0u && (word & 0x7fffffu) != 0u);
    return f64(bitcast<f32>(word));
//#end
}

fn line(i: u32, x: f64) -> f64 {
    return own((1.0lf - x) * voxel(i)) + own(x * voxel(i + 1u));
}

// The nearest whole number, ties to even.
fn whole(x: f64) -> f64 {
    let low = floor(x);
    let over = x - low;
    let up = over > 0.5lf || (over == 0.5lf && floor(0.5lf * low) * 2.0lf != low);
    return select(low, low + 1.0lf, up);
}

struct Value {
    bits: u32,
    left: bool,
}

fn value_at(v: vec3<u32>, vector: vec3<f32>) -> Value {
    let u = vec3<f64>(f64(vector.x), f64(vector.y), f64(vector.z));
    var first = vec3<u32>(0u);
    var weight = vec3<f64>(0.0lf);
    for (var a = 0u; a < 3u; a++) {
        let x = f64(v[a]) + ((own(numbers[3u * a] * u.x) + own(numbers[3u * a + 1u] * u.y)) + own(numbers[3u * a + 2u] * u.z));
        // A comparison that fails for what is no number too.
        if (!(x >= 0.0lf && numbers[9u + a] - x >= 0.0lf)) {
            return Value(0u, true);
        }
        let low = floor(x);
        let t = x - low;
        let up = 1.0lf - t <= SNAP;
        weight[a] = select(t, 0.0lf, up || t <= SNAP);
        first[a] = u32(low) + select(0u, 1u, up);
    }
    let i = first.x + params.nx * (first.y + params.ny * first.z);
    let over = params.nx * params.ny;
    // The loads of eight voxels and of one more in a row must lie within.
    if (i + over + params.nx + 2u > params.nx * params.ny * params.nz) {
        return Value(0u, true);
    }
    let y1 = own(1.0lf - weight.y);
    let z1 = own(1.0lf - weight.z);
    let y = weight.y;
    let z = weight.z;
    let sum = own(own(y1 * z1) * line(i, weight.x))
        + own(own(y * z1) * line(i + params.nx, weight.x))
        + own(own(y1 * z) * line(i + over, weight.x))
        + own(own(y * z) * line(i + over + params.nx, weight.x));
//#if F32
    let bits = bitcast<u32>(f32(sum));
    // What isn't finite comes through any weight, 0 too. A sum below the least float of full precision is the processor's to round.
    let size = u32(bitcast<u64>(sum) >> 32u) & 0x7ff00000u;
    let small = sum != 0.0lf && size < LEAST;
    return Value(select(bits, 0u, sum == 0.0lf), size == 0x7ff00000u || small || odd);
//#else
    return Value(bitcast<u32>(i32(whole(sum))), odd);
//#end
}

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if (lane < 8u) {
        atomicStore(&marks[lane], 0u);
    }
//#if F32
//#else
    if (lane < HALF) {
        atomicStore(&made[lane], 0u);
    }
//#end
    workgroupBarrier();
    let place = place_in(group, groups);
    let brick = place / 2u;
    let half = place % 2u;
    let to = (BRICK_WORDS + 16u) * brick;
    if (brick < params.bricks) {
        let slot = params.first + brick;
        let b = places[slot];
        let at = 8u * vec3<u32>(b % params.across, b / params.across % params.down, b / (params.across * params.down));
        let i = 256u * half + lane;
        let v = at + vec3<u32>(i & 7u, i >> 3u & 7u, i >> 6u);
        let start = 3u * (512u * slot + i);
        let bits = vec3<u32>(bitcast<u32>(vectors[start]), bitcast<u32>(vectors[start + 1u]), bitcast<u32>(vectors[start + 2u]));
        var value = Value(0u, false);
        // Not −0 either.
        if (any((bits & vec3<u32>(0x7fffffffu)) != vec3<u32>(0u)) && all(v < vec3<u32>(params.nx, params.ny, params.nz))) {
            odd = any((bits & vec3<u32>(0x7f800000u)) == vec3<u32>(0u) & (bits & vec3<u32>(0x7fffffu)) != vec3<u32>(0u));
            value = value_at(v, bitcast<vec3<f32>>(bits));
            if (value.left) {
                atomicOr(&marks[lane >> 5u], 1u << (lane & 31u));
            }
        }
//#if BYTES
        atomicOr(&made[lane >> 2u], (value.bits & 0xffu) << (8u * (lane & 3u)));
//#end
//#if HALVES
        atomicOr(&made[lane >> 1u], (value.bits & 0xffffu) << (16u * (lane & 1u)));
//#end
//#if F32
        moved[to + i] = value.bits;
//#end
    }
    workgroupBarrier();
    if (brick < params.bricks) {
//#if F32
//#else
        if (lane < HALF) {
            moved[to + HALF * half + lane] = atomicLoad(&made[lane]);
        }
//#end
        if (lane < 8u) {
            moved[to + BRICK_WORDS + 8u * half + lane] = atomicLoad(&marks[lane]);
        }
    }
    tell(lane);
}
