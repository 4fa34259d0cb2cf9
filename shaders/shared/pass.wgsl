// What every pass over data has: where each of its workgroups tells that it ran, and a number for each workgroup.

@group(0) @binding(1) var<storage, read_write> done: array<atomic<u32>>;

fn tell(lane: u32) {
    if (lane == 0u) {
        atomicAdd(&done[params.number], 1u);
    }
}

// Dispatches have at most 65,535 workgroups along an axis.
fn place_in(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.x + group.y * groups.x;
}
