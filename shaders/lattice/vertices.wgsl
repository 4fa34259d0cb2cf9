// Writes the key of each vertex, in order: by word, voxel, axis; those of a cell after those on its first corner's edges. vertices.rs.
//#include lattice/words.wgsl
//#include lattice/cells.wgsl
//#include lattice/decided.wgsl

@group(0) @binding(3) var<storage, read> counts: array<u32>; // summed up
@group(0) @binding(4) var<storage, read> opens: array<u32>;
@group(0) @binding(5) var<storage, read> decided: array<u32>;
@group(0) @binding(6) var<storage, read_write> keys: array<vec2<u32>>;

fn each(w: u32) {
    if (has_cells(w)) {
        let edges = crossed(w);
        var any = edges.x | edges.y | edges.z;
        var cell = opens[w];
        let last = opens[w + 1u];
        for (var i = cell; i < last; i++) {
            any |= select(0u, 1u, own_of(decided[i]) > 0u) << bit_of(decided[i]);
        }
        var to = counts[w];
        let first = params.width * (w / params.words) + 32u * (w % params.words);
        for (; any != 0u; any &= any - 1u) {
            let bit = firstTrailingBit(any);
            // A key is eight times the voxel, and the element.
            let low = (first + bit) << 3u;
            let high = (first + bit) >> 29u;
            for (var axis = 0u; axis < 3u; axis++) {
                if ((edges[axis] >> bit & 1u) != 0u) {
                    keys[to] = vec2<u32>(low | axis, high);
                    to += 1u;
                }
            }
            while (cell < last && bit_of(decided[cell]) < bit) {
                cell += 1u;
            }
            if (cell < last && bit_of(decided[cell]) == bit) {
                for (var own = 0u; own < own_of(decided[cell]); own++) {
                    keys[to] = vec2<u32>(low | (6u + own), high);
                    to += 1u;
                }
            }
        }
    }
}
