// Writes the triangles of each cell, in order: sweep.rs, face_row.
//#include lattice/words.wgsl
//#include lattice/cells.wgsl
//#include lattice/decided.wgsl
//#include lattice/tables.wgsl

@group(0) @binding(3) var<storage, read> tables: array<u32>;
@group(0) @binding(4) var<storage, read> counts: array<u32>; // summed up: those of the triangles go on from those of the vertices
@group(0) @binding(5) var<storage, read> opens: array<u32>;
@group(0) @binding(6) var<storage, read> decided: array<u32>;
@group(0) @binding(7) var<storage, read_write> corners: array<u32>;

// Numbers of the vertices that a voxel has: on its edges along x, y and z, and the first of its cell.
fn numbers(w: u32, bit: u32) -> vec4<u32> {
    let edges = crossed(w);
    let below = countOneBits(edges & vec3<u32>((1u << bit) - 1u));
    var first = counts[w] + below.x + below.y + below.z;
    for (var i = opens[w]; i < opens[w + 1u]; i++) {
        if (bit_of(decided[i]) < bit) {
            first += own_of(decided[i]);
        }
    }
    let here = edges >> vec3<u32>(bit) & vec3<u32>(1u);
    return vec4<u32>(first, first + here.x, first + here.x + here.y, first + here.x + here.y + here.z);
}

fn each(w: u32) {
    if (has_cells(w)) {
        let words_of = corners_of(w);
        var to = counts[all_words() + 1u + w] - counts[all_words() + 1u];
        var cell = opens[w];
        for (var live = active_of(words_of); live != 0u; live &= live - 1u) {
            let bit = firstTrailingBit(live);
            let step = select(0u, 1u, bit == 31u);
            let on = vec2<u32>(w + step, (bit + 1u) & 31u);
            let up = vec2<u32>(params.words, params.words * params.rows);
            // The voxels at the corners whose edges belong to the cell.
            let a = numbers(w, bit);
            let b = numbers(on.x, on.y);
            let c = numbers(w + up.x, bit);
            let d = numbers(on.x + up.x, on.y);
            let e = numbers(w + up.y, bit);
            let f = numbers(on.x + up.y, on.y);
            let g = numbers(w + up.x + up.y, bit);
            var vertex = array<u32, 16>(a.x, c.x, e.x, g.x, a.y, b.y, e.y, f.y, a.z, b.z, c.z, d.z, a.w, a.w + 1u, 0u, 0u);
            let entry = CASE_WORDS * case_of(words_of, bit);
            var count = tables[entry];
            if (count == OPEN) {
                let span = tables[CROSSINGS_AT + crossing_of(decided[cell])];
                cell += 1u;
                let first = TRIANGLES_AT + (span >> 8u);
                for (var t = 0u; t < (span & 0xffu); t++) {
                    let packed = tables[first + t];
                    for (var k = 0u; k < 3u; k++) {
                        corners[3u * to + k] = vertex[packed >> (4u * k) & 15u];
                    }
                    to += 1u;
                }
            } else {
                for (var k = 0u; k < 3u * count; k++) {
                    corners[3u * to + k] = vertex[tables[entry + 1u + k / 8u] >> (4u * (k % 8u)) & 15u];
                }
                to += count;
            }
        }
    }
}
