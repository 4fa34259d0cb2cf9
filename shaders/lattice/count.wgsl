// Counts what each word of cells adds: vertices on edges, triangles of cells that the signs settle, and cells that they leave open. Each list has a word more, so that once
// it is summed up the last one tells the sum of all.
//#include lattice/words.wgsl
//#include lattice/cells.wgsl
//#include lattice/tables.wgsl

@group(0) @binding(3) var<storage, read> tables: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<u32>; // of each word its vertices, then of each word its triangles
@group(0) @binding(5) var<storage, read_write> opens: array<u32>;

fn each(w: u32) {
    if (w <= all_words()) {
        var edges = 0u;
        var settled = 0u;
        var open = 0u;
        if (has_cells(w)) {
            let bits = countOneBits(crossed(w));
            edges = bits.x + bits.y + bits.z;
            let corners = corners_of(w);
            for (var live = active_of(corners); live != 0u; live &= live - 1u) {
                let count = tables[CASE_WORDS * case_of(corners, firstTrailingBit(live))];
                if (count == OPEN) {
                    open += 1u;
                } else {
                    settled += count;
                }
            }
        }
        counts[w] = edges;
        counts[all_words() + 1u + w] = settled;
        opens[w] = open;
    }
}
