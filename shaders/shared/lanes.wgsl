// A lane for each number: `each`, which a shader has, does what there is to do for one. Numbers go beyond the last that there is anything for.

//#include shared/pass.wgsl

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    each(256u * place_in(group, groups) + lane);
    tell(lane);
}
