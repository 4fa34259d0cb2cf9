// Lists the cells that the signs leave open, in order: their word, and their bit in it with their case above.
//#include lattice/words.wgsl
//#include lattice/cells.wgsl
//#include lattice/tables.wgsl

@group(0) @binding(3) var<storage, read> tables: array<u32>;
@group(0) @binding(4) var<storage, read> opens: array<u32>;
@group(0) @binding(5) var<storage, read_write> list: array<vec2<u32>>;

fn each(w: u32) {
    if (w < all_words()) {
        var to = opens[w];
        if (opens[w + 1u] > to) {
            let corners = corners_of(w);
            for (var live = active_of(corners); live != 0u; live &= live - 1u) {
                let bit = firstTrailingBit(live);
                let signs_of = case_of(corners, bit);
                if (tables[CASE_WORDS * signs_of] == OPEN) {
                    list[to] = vec2<u32>(w, bit | signs_of << 8u);
                    to += 1u;
                }
            }
        }
    }
}
