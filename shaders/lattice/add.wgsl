// Adds what the open cells were decided to have to the counts of their words.
//#include lattice/words.wgsl
//#include lattice/decided.wgsl
//#include lattice/tables.wgsl

@group(0) @binding(2) var<storage, read> list: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> decided: array<u32>;
@group(0) @binding(4) var<storage, read> tables: array<u32>;
@group(0) @binding(5) var<storage, read_write> counts: array<atomic<u32>>;

fn each(i: u32) {
    if (i < params.count) {
        let w = list[i].x;
        atomicAdd(&counts[w], own_of(decided[i]));
        atomicAdd(&counts[all_words() + 1u + w], tables[CROSSINGS_AT + crossing_of(decided[i])] & 0xffu);
    }
}
