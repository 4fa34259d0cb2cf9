// Where a place of a deformed volume was before: warp.rs.

struct Corners {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    d: vec3<f32>,
    e: vec3<f32>,
    f: vec3<f32>,
    g: vec3<f32>,
    h: vec3<f32>,
}

fn stored_vector(i: u32) -> vec3<f32> {
    let at = 3u * i;
    return vec3<f32>(vectors[at], vectors[at + 1u], vectors[at + 2u]);
}

fn within_brick(v: vec3<u32>) -> u32 {
    let w = v & vec3<u32>(7u);
    return w.x + 8u * (w.y + 8u * w.z);
}

fn vector_at(v: vec3<u32>) -> vec3<f32> {
    let slot = lookup[brick_of(v) * BRICK_WORDS + 1u];
    if (slot == NO_SLOT) {
        return vec3<f32>(0.0);
    }
    return stored_vector(slot * 512u + within_brick(v));
}

fn corners_of(cell: vec3<u32>) -> Corners {
    let far = min(cell + vec3<u32>(1u), params.dims.xyz - vec3<u32>(1u));
    if (all((cell >> vec3<u32>(3u)) == (far >> vec3<u32>(3u)))) {
        let slot = lookup[brick_of(cell) * BRICK_WORDS + 1u];
        if (slot == NO_SLOT) {
            let z = vec3<f32>(0.0);
            return Corners(z, z, z, z, z, z, z, z);
        }
        let i = slot * 512u + within_brick(cell);
        let d = (far - cell) * vec3<u32>(1u, 8u, 64u);
        return Corners(
            stored_vector(i),
            stored_vector(i + d.x),
            stored_vector(i + d.y),
            stored_vector(i + d.x + d.y),
            stored_vector(i + d.z),
            stored_vector(i + d.x + d.z),
            stored_vector(i + d.y + d.z),
            stored_vector(i + d.x + d.y + d.z),
        );
    }
    return Corners(
        vector_at(cell),
        vector_at(vec3<u32>(far.x, cell.y, cell.z)),
        vector_at(vec3<u32>(cell.x, far.y, cell.z)),
        vector_at(vec3<u32>(far.x, far.y, cell.z)),
        vector_at(vec3<u32>(cell.x, cell.y, far.z)),
        vector_at(vec3<u32>(far.x, cell.y, far.z)),
        vector_at(vec3<u32>(cell.x, far.y, far.z)),
        vector_at(far),
    );
}

fn turned(v: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot3(params.rows_x.xyz, v), dot3(params.rows_y.xyz, v), dot3(params.rows_z.xyz, v));
}

fn is_vacated(p: Place) -> bool {
    if ((params.flags.z & 1u) == 0u) {
        return false;
    }
    let i = nearest(p);
    return ((vacated[i >> 2u] >> ((i & 3u) * 8u)) & 0xffu) != 0u;
}

struct Before {
    at: vec3<f32>,
    here: bool,
}

fn before_of(at: vec3<f32>) -> Before {
    let p = place_of(at);
    if (is_vacated(p)) {
        return Before(at, false);
    }
    let k = corners_of(p.cell);
    let f = p.within;
    let low = blend3(blend3(k.a, k.b, f.x), blend3(k.c, k.d, f.x), f.y);
    let high = blend3(blend3(k.e, k.f, f.x), blend3(k.g, k.h, f.x), f.y);
    let there = at + turned(blend3(low, high, f.z));
    let inside = all(there >= vec3<f32>(-0.5)) && all(there <= vec3<f32>(params.dims.xyz) - vec3<f32>(0.5));
    return Before(there, inside);
}

// J⁻ᵀ of a gradient before: gradient + (∇v)ᵀ gradient, of the place's own cell.
fn pull_back(at: vec3<f32>, gradient: vec3<f32>) -> vec3<f32> {
    let p = place_of(at);
    let k = corners_of(p.cell);
    let f = p.within;
    let x = turned(blend3(blend3(k.b - k.a, k.d - k.c, f.y), blend3(k.f - k.e, k.h - k.g, f.y), f.z));
    let y = turned(blend3(blend3(k.c - k.a, k.d - k.b, f.x), blend3(k.g - k.e, k.h - k.f, f.x), f.z));
    let z = turned(blend3(blend3(k.e - k.a, k.f - k.b, f.x), blend3(k.g - k.c, k.h - k.d, f.x), f.y));
    return gradient + vec3<f32>(dot3(x, gradient), dot3(y, gradient), dot3(z, gradient));
}
