// Casts a ray through every pixel of a part of a picture: dvr.rs, cast.rs (mip, first_hit), one loop over the steps, brick by brick.

struct Params {
    dims: vec4<u32>,
    next: vec4<u32>,       // distance in memory to the next voxel along each axis
    bricks: vec4<u32>,     // along each axis; values of a row of the table by gradient
    part: vec4<u32>,       // width, rows, tiles across, 0
    top: vec4<f32>,        // the greatest coordinate whose whole part is a cell
    end: vec4<f32>,        // the last voxel's coordinate
    axis: vec4<f32>,       // low, scale, top of the table's places
    steep_axis: vec4<f32>,
    steep: vec4<f32>,      // factor and last row of gradients, unit of values
    look: vec4<f32>,       // termination or isovalue, sign
    colour: vec4<f32>,
    lamp: vec4<f32>,
    halfway: vec4<f32>,
    shares: vec4<f32>,
    world_x: vec4<f32>,    // rows of the matrix from gradients per voxel to gradients per mm
    world_y: vec4<f32>,
    world_z: vec4<f32>,
    rows_x: vec4<f32>,     // rows of the matrix from mm to voxels
    rows_y: vec4<f32>,
    rows_z: vec4<f32>,
    flags: vec4<u32>,      // first word of row starts, first entry of the table by gradient, bits: 1 vacated, 2 skip by bounds; the submission's number
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> volume: array<u32>;
@group(0) @binding(2) var<storage, read> lookup: array<u32>;
//#if DVR
@group(0) @binding(3) var<storage, read> colours: array<vec4<f32>>;
//#end
@group(0) @binding(4) var<storage, read> rays: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> picture: array<vec4<u32>>;
//#if LABELLED
@group(0) @binding(6) var<storage, read> labels: array<u32>;
//#end
//#if MOVED
@group(0) @binding(7) var<storage, read> vectors: array<f32>;
@group(0) @binding(8) var<storage, read> vacated: array<u32>;
//#end

//#include shared/ray.wgsl
//#include shared/volume.wgsl
//#include shared/bricks.wgsl
//#include shared/light.wgsl
//#if MOVED
//#include shared/warp.wgsl
//#end

const TILE = 8u;
// In the last word of what is told of a tile, with the submission's number: that this one wrote it.
const WRITTEN = 0x1bd5eedu;

var<workgroup> taken_of_tile: atomic<u32>;
var<workgroup> skipped_of_tile: atomic<u32>;

struct Cast {
    rgba: vec4<f32>,
    taken: u32,
    skipped: u32,
}

// Whether there is matter at a place that may have moved, and where it was.
struct Source {
    at: vec3<f32>,
    here: bool,
}

fn source(at: vec3<f32>, moving: bool) -> Source {
//#if MOVED
    if (moving) {
        let before = before_of(at);
        return Source(before.at, before.here);
    }
//#end
    return Source(at, true);
}

// World normal at a place that was at `before`; zero where there is none.
fn normal_at(at: vec3<f32>, before: vec3<f32>, moving: bool) -> vec3<f32> {
    missing = false;
    var gradient = gradient_at(before);
    if (missing) {
        return vec3<f32>(0.0);
    }
//#if MOVED
    if (moving) {
        gradient = pull_back(at, gradient);
    }
//#end
    return normal_of(gradient);
}

fn index_on(axis: vec4<f32>, value: f32) -> u32 {
    let x = product(value - axis.x, axis.y) + 0.5;
    return u32(min(max(x, 0.0), axis.z));
}

//#if DVR
// Emission and absorption of a step at a place.
fn classified(at: vec3<f32>, moving: bool) -> vec4<f32> {
    let origin = source(at, moving);
    if (!origin.here) {
        return vec4<f32>(0.0);
    }
    let p = place_of(origin.at);
    missing = false;
    let value = value_at(p);
    if (missing) {
        return vec4<f32>(0.0);
    }
    var row = 0u;
//#if LABELLED
    let i = nearest(p);
    row = lookup[params.flags.x + ((labels[i >> 1u] >> ((i & 1u) * 16u)) & 0xffffu)];
//#end
    var entry = colours[row + index_on(params.axis, value)];
    if (entry.w <= 0.0) {
        return entry;
    }
//#if STEEP
    missing = false;
    let gradient = gradient_at(origin.at);
    // Beside missing data there is no gradient: a flat place.
    let steepness = select(params.steep.z * length_of(to_world(gradient)), 0.0, missing);
    let j = u32(min(max(product(steepness, params.steep.x) + 0.5, 0.0), params.steep.y));
    entry = colours[params.flags.y + j * params.bricks.w + index_on(params.steep_axis, value)];
    if (entry.w <= 0.0) {
        return entry;
    }
//#end
//#if SHADED
    return lit(entry, normal_at(at, origin.at, moving));
//#else
    return entry;
//#end
}

fn cast_ray(ray: Ray) -> Cast {
    var c = Cast(vec4<f32>(0.0), 0u, 0u);
    var home = NOWHERE;
    var moving = false;
    var number = 0u;
    let last = steps_of(ray);
    while (number < last) {
        let whole = number < ray.steps;
        let at = step_at(ray, number);
        let cell = place_of(at).cell;
        if (leaves(cell, home) || !whole) {
            let brick = brick_of(cell);
            let distance = leap_of(brick);
            if (whole && distance > 0u) {
                let end = leap(ray, number, cell, distance - 1u);
                c.skipped += end - number;
                number = end;
                continue;
            }
            home = home_of(cell);
            moving = moves(brick);
        }
        c.taken += 1u;
        var entry = classified(at, moving);
        if (!whole) {
            entry = part_of(entry, ray.rest);
        }
        c.rgba += product4(vec4<f32>(1.0 - c.rgba.w), entry);
        number += 1u;
        if (c.rgba.w >= params.look.x) {
            break;
        }
    }
    return c;
}

// A premultiplied entry over a part of its step.
fn part_of(entry: vec4<f32>, share: f32) -> vec4<f32> {
    if (entry.w <= 0.0) {
        return entry;
    }
    var alpha = 1.0;
    if (entry.w < 1.0) {
        alpha = 1.0 - pow(1.0 - entry.w, share);
    }
    return vec4<f32>(entry.xyz * (alpha / entry.w), alpha);
}
//#end

//#if MAXIMUM
fn cast_ray(ray: Ray) -> Cast {
    var c = Cast(vec4<f32>(0.0), 0u, 0u);
    var greatest = -3.4028234e38;
    var met = false;
    var home = NOWHERE;
    var moving = false;
    var number = 0u;
    let last = steps_of(ray);
    while (number < last) {
        let whole = number < ray.steps;
        let at = step_at(ray, number);
        let cell = place_of(at).cell;
        if (leaves(cell, home) || !whole) {
            let brick = brick_of(cell);
            let distance = leap_of(brick);
            let low = (params.flags.z & 2u) != 0u && met && bitcast<f32>(lookup[params.flags.x + brick]) <= greatest;
            if (whole && (distance > 0u || low)) {
                let end = leap(ray, number, cell, max(distance, 1u) - 1u);
                c.skipped += end - number;
                number = end;
                continue;
            }
            home = home_of(cell);
            moving = moves(brick);
        }
        c.taken += 1u;
        let origin = source(at, moving);
        if (origin.here) {
            missing = false;
            let value = params.look.y * value_at(place_of(origin.at));
            if (!missing) {
                greatest = max(greatest, value);
                met = true;
            }
        }
        number += 1u;
    }
    if (met) {
        c.rgba = vec4<f32>(greatest, 0.0, 0.0, 1.0);
    }
    return c;
}
//#end

//#if SURFACE
// 0 for no data, 1 outside, 2 inside.
fn side(at: vec3<f32>) -> u32 {
    let origin = source(at, moves(brick_of(place_of(at).cell)));
    if (!origin.here) {
        return 0u;
    }
    missing = false;
    let value = params.look.y * value_at(place_of(origin.at));
    if (missing) {
        return 0u;
    }
    return select(1u, 2u, value >= params.look.x);
}

// What a ray to a surface does: it marches; looks whether the sample before the first one inside is outside; halves the step between them.
const MARCH = 0u;
const LOOK_BACK = 1u;
const HALVE = 2u;

// One place where samples are taken, whatever they are for: drivers put a copy of what is called at each.
fn cast_ray(ray: Ray) -> Cast {
    var c = Cast(vec4<f32>(0.0), 0u, 0u);
    var home = NOWHERE;
    var number = 0u;
    var doing = MARCH;
    var halvings = 0u;
    var hit = vec3<f32>(0.0);
    var outside = vec3<f32>(0.0);
    let last = steps_of(ray);
    loop {
        var at = 0.5 * (outside + hit);
        if (doing == LOOK_BACK) {
            at = sample_at(ray, number - 1u);
        } else if (doing == MARCH) {
            if (number >= last) {
                return c;
            }
            at = step_at(ray, number);
            if (number < ray.steps) {
                let cell = place_of(at).cell;
                if (leaves(cell, home)) {
                    let distance = leap_of(brick_of(cell));
                    if (distance > 0u) {
                        let end = leap(ray, number, cell, distance - 1u);
                        c.skipped += end - number;
                        number = end;
                        continue;
                    }
                    home = home_of(cell);
                }
            }
        }
        c.taken += 1u;
        let found = side(at);
        if (doing == MARCH) {
            if (found != 2u) {
                number += 1u;
                continue;
            }
            hit = at;
            if (number == 0u) {
                break;
            }
            doing = LOOK_BACK;
        } else if (doing == LOOK_BACK) {
            if (found != 1u) {
                break;
            }
            outside = at;
            doing = HALVE;
        } else {
            if (found == 2u) {
                hit = at;
            } else {
                outside = at;
            }
            halvings += 1u;
            if (halvings >= 16u) {
                break;
            }
        }
    }
    let moving = moves(brick_of(place_of(hit).cell));
    let origin = source(hit, moving);
    var normal = vec3<f32>(0.0);
    if (origin.here) {
        normal = normal_at(hit, origin.at, moving);
    }
    c.rgba = lit(vec4<f32>(params.colour.xyz, 1.0), normal);
    return c;
}
//#end

@compute @workgroup_size(TILE, TILE)
fn main(@builtin(workgroup_id) tile: vec3<u32>, @builtin(local_invocation_id) lane: vec3<u32>, @builtin(local_invocation_index) first: u32) {
    let x = tile.x * TILE + lane.x;
    let y = tile.y * TILE + lane.y;
    if (first == 0u) {
        atomicStore(&taken_of_tile, 0u);
        atomicStore(&skipped_of_tile, 0u);
    }
    workgroupBarrier();
    if (x < params.part.x && y < params.part.y) {
        let pixel = x + params.part.x * y;
        let a = rays[pixel * RAY_WORDS];
        let b = rays[pixel * RAY_WORDS + 1u];
        let d = rays[pixel * RAY_WORDS + 2u];
        let ray = Ray(bitcast<vec3<f32>>(a.xyz), a.w, bitcast<vec3<f32>>(b.xyz), bitcast<f32>(b.w), bitcast<vec3<f32>>(d.xyz));
        let c = cast_ray(ray);
        picture[pixel] = bitcast<vec4<u32>>(c.rgba);
        atomicAdd(&taken_of_tile, c.taken);
        atomicAdd(&skipped_of_tile, c.skipped);
    }
    workgroupBarrier();
    if (first == 0u) {
        let told = params.part.x * params.part.y + tile.x + params.part.z * tile.y;
        picture[told] = vec4<u32>(atomicLoad(&taken_of_tile), atomicLoad(&skipped_of_tile), 0u, WRITTEN ^ params.flags.w);
    }
}
