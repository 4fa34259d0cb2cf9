// The label of each voxel, by a table of its values or by cuts between them: labelling.rs. A lane makes four.

struct Params {
    number: u32,
    first: u32, // the first quad of voxels of this part, and how many quads it has
    quads: u32,
    cuts: u32,  // of floats: how many, ascending; the labels come after them
    none: u32,  // the label of what has none
}

@group(0) @binding(0) var<storage, read> params: Params;
@group(0) @binding(2) var<storage, read> volume: array<u32>;
@group(0) @binding(3) var<storage, read> table: array<u32>; // two labels a word, by rank; of floats the ranks of the cuts, and a label a word
@group(0) @binding(4) var<storage, read_write> labels: array<vec2<u32>>;
//#if MASKED
@group(0) @binding(5) var<storage, read> mask: array<u32>;
//#end

//#include shared/lanes.wgsl
//#include shared/stored.wgsl

fn label(r: u32) -> u32 {
//#if F32
    if (!is_number(r)) {
        return params.none;
    }
    // Cuts at or below the value.
    var low = 0u;
    var high = params.cuts;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (table[middle] <= r) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return table[params.cuts + low];
//#else
    return (table[r >> 1u] >> ((r & 1u) * 16u)) & 0xffffu;
//#end
}

fn each(to: u32) {
    if (to < params.quads) {
        let quad = params.first + to;
        let r = ranks(quad);
        var made = vec4<u32>(label(r.x), label(r.y), label(r.z), label(r.w));
//#if MASKED
        let outside = (vec4<u32>(mask[quad]) & vec4<u32>(0xffu, 0xff00u, 0xff0000u, 0xff000000u)) == vec4<u32>(0u);
        made = select(made, vec4<u32>(params.none), outside);
//#end
        labels[to] = vec2<u32>(made.x | made.y << 16u, made.z | made.w << 16u);
    }
}
