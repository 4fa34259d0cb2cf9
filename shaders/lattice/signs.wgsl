// Reads the signs of the stored values: signs.rs. A lane a word of signs; what the lanes of a workgroup need they fetch together, side by side.
//#include lattice/words.wgsl

@group(0) @binding(2) var<storage, read> volume: array<u32>;
@group(0) @binding(3) var<storage, read_write> signs: array<u32>;

//#include shared/stored.wgsl

// As many lanes as have room for their words.
//#if BYTES
const LANES = 256u;
const EACH = 9u;
//#else
//#if HALVES
const LANES = 128u;
const EACH = 17u;
//#else
const LANES = 64u;
const EACH = 33u;
//#end
//#end

var<workgroup> firsts: array<u32, LANES>;
var<workgroup> fetched: array<u32, LANES * EACH>;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let w = LANES * place_in(group, groups) + lane;
    let row = w / params.words;
    let y = row % params.rows;
    let z = row / params.rows;
    let n = params.width - 2u;
    // Bit b is padded voxel x + b, which is the one before it of the row; those from `end` on aren't in the row.
    let x = 32u * (w % params.words);
    let end = min(32u, max(n + 1u, x) - x);
    let inside = w < all_words() && y > 0u && y + 1u < params.rows && z > 0u && z + 1u < params.layers && end > 0u;
    let start = n * (y - 1u + (params.rows - 2u) * (z - 1u));
    let stored = words_from(start + x - 1u);
    firsts[lane] = select(0u, stored.first, inside);
    workgroupBarrier();
    for (var i = lane; i < LANES * EACH; i += LANES) {
        fetched[i] = volume[firsts[i / EACH] + i % EACH];
    }
    workgroupBarrier();
    if (w < all_words()) {
        var word = 0u;
        if (inside) {
            for (var j = 0u; j < 32u / IN_A_WORD; j++) {
                let at = EACH * lane + j;
//#if F32
                let values = fetched[at];
//#else
                let values = joined(fetched[at], fetched[at + 1u], stored.bit);
//#end
                for (var i = 0u; i < IN_A_WORD; i++) {
                    let r = rank_in(values, i);
                    word |= select(0u, 1u, r >= params.first && r <= params.last) << (IN_A_WORD * j + i);
                }
            }
            word &= select((1u << end) - 1u, 0xffffffffu, end == 32u);
            word &= select(0xffffffffu, 0xfffffffeu, x == 0u);
        }
        signs[w] = word;
    }
    tell(lane);
}
