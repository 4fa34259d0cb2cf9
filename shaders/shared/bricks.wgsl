// Bricks of 8³ voxels and the leaps over them: empty_space.rs. Of each brick `lookup` holds two words: leap (8 bits), whether it moves (bit 8); and
// the slot of its displacements.

const BRICK_WORDS = 2u;
const NO_SLOT = 0xffffffffu;

fn brick_of(cell: vec3<u32>) -> u32 {
    let b = cell >> vec3<u32>(3u);
    return b.x + params.bricks.x * (b.y + params.bricks.y * b.z);
}

fn moves(brick: u32) -> bool {
    return (lookup[brick * BRICK_WORDS] & 0x100u) != 0u;
}

fn leap_of(brick: u32) -> u32 {
    return lookup[brick * BRICK_WORDS] & 0xffu;
}

fn sample_at(ray: Ray, i: u32) -> vec3<f32> {
    return ray.start + product3(vec3<f32>(f32(i)), ray.delta);
}

// Samples of a ray: its whole steps, and one for what is left after them.
fn steps_of(ray: Ray) -> u32 {
    return ray.steps + select(0u, 1u, ray.rest > 0.0);
}

fn step_at(ray: Ray, i: u32) -> vec3<f32> {
    if (i < ray.steps) {
        return sample_at(ray, i);
    }
    return ray.rest_at;
}

// The brick that a ray is in, as its first cell; before the first one.
const NOWHERE = vec3<u32>(0xffffffffu);

fn home_of(cell: vec3<u32>) -> vec3<u32> {
    return cell & vec3<u32>(0xfffffff8u);
}

fn leaves(cell: vec3<u32>, home: vec3<u32>) -> bool {
    let off = cell ^ home;
    return (off.x | off.y | off.z) >= 8u;
}

// Index of a sample after `i` up to which all lie in the bricks up to `reach` from that of `cell`, where sample `i` is: estimated from the box's planes,
// then put right by looking at the samples themselves.
fn leap(ray: Ray, i: u32, cell: vec3<u32>, reach: u32) -> u32 {
    let brick = cell >> vec3<u32>(3u);
    let low = (max(brick, vec3<u32>(reach)) - vec3<u32>(reach)) << vec3<u32>(3u);
    let high = (brick + vec3<u32>(reach + 1u)) << vec3<u32>(3u);
    var steps = f32(ray.steps);
    for (var a = 0u; a < 3u; a++) {
        let d = ray.delta[a];
        if (d > 0.0) {
            if (brick[a] + reach + 1u < params.bricks[a]) {
                steps = min(steps, (f32(high[a]) - ray.start[a]) / d);
            }
        } else if (d < 0.0) {
            if (brick[a] > reach) {
                steps = min(steps, (f32(low[a]) - ray.start[a]) / d);
            }
        }
    }
    var end = clamp(u32(max(steps, 0.0)) + 1u, i + 1u, ray.steps);
    // A cell below `low` wraps round to a great number.
    while (end > i + 1u) {
        let there = place_of(sample_at(ray, end - 1u)).cell - low;
        if (all(there < high - low)) {
            break;
        }
        end -= 1u;
    }
    return end;
}
