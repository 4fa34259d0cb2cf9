// The lamp: light.rs.

fn to_world(g: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot3(params.world_x.xyz, g), dot3(params.world_y.xyz, g), dot3(params.world_z.xyz, g));
}

fn square_of(v: vec3<f32>) -> f32 {
    return dot3(v, v);
}

fn length_of(v: vec3<f32>) -> f32 {
    return sqrt(square_of(v));
}

// Against a gradient per voxel, out of what is dense; zero where there is no direction.
fn normal_of(gradient: vec3<f32>) -> vec3<f32> {
    let world = to_world(gradient);
    let square = square_of(world);
    if (!(square > 1.1754944e-38 && square < 3.4028234e38)) {
        return vec3<f32>(0.0);
    }
    return world * (-1.0 / sqrt(square));
}

// A premultiplied colour under the lamp; unchanged without a normal.
fn lit(entry: vec4<f32>, n: vec3<f32>) -> vec4<f32> {
    if (all(n == vec3<f32>(0.0))) {
        return entry;
    }
    let wrapped = 0.5 + 0.5 * dot3(n, params.lamp.xyz);
    let matt = params.shares.x + params.shares.y * wrapped * wrapped;
    var shine = max(dot3(n, params.halfway.xyz), 0.0);
    for (var i = 0u; i < 5u; i++) {
        shine *= shine;
    }
    let highlight = params.shares.z * shine * entry.w;
    return vec4<f32>(min(entry.xyz * matt + highlight, vec3<f32>(entry.w)), entry.w);
}
