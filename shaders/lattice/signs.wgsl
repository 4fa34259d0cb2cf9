// Reads the signs of the stored values: signs.rs. A lane a word.
//#include lattice/words.wgsl
//#include shared/stored.wgsl

@group(0) @binding(2) var<storage, read> volume: array<u32>;
@group(0) @binding(3) var<storage, read_write> signs: array<u32>;

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let w = 256u * place_in(group, groups) + lane;
    if (w < all_words()) {
        let row = w / params.words;
        let y = row % params.rows;
        let z = row / params.rows;
        var word = 0u;
        if (y > 0u && y + 1u < params.rows && z > 0u && z + 1u < params.layers) {
            let n = params.width - 2u;
            let start = n * (y - 1u + (params.rows - 2u) * (z - 1u));
            // Bit b is the padded voxel, which is voxel x − 1 of the row.
            let x = 32u * (w % params.words);
            let end = min(32u, max(n + 1u, x) - x);
            for (var b = select(0u, 1u, x == 0u); b < end; b++) {
                let r = rank(start + x + b - 1u);
                if (r >= params.first && r <= params.last) {
                    word |= 1u << b;
                }
            }
        }
        signs[w] = word;
    }
    tell(lane);
}
